"""Lines of the plain language as statements: a head, and words with their columns.

A statement is a line, `~` at its end continues it; `;` begins a comment, `*` a heading, `/` a statement that may be
left out. Cycles from 200 on have their parameters in lines that follow (HEIDENHAIN, user's manuals of the iTNC 530 and
the TNC 640, "Programming fundamentals", "Structuring programs", "Fixed cycles").
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from toolpath_stiff.nc.heidenhain.milling import AUTO, MAX
from toolpath_stiff.nc.heidenhain.vocabulary import look_up
from toolpath_stiff.nc.lines import code_text
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.words import LONGEST_BLOCK, MOST_DIGITS, Word

NUMBER = r"(?:\d+[.,]?\d*|[.,]\d+)"
VALUE = rf"(?:[+-]\s*)?(?:{NUMBER}|Q[LR]?\d+)"
_BEGIN = re.compile(r"\s*(/?)\s*(?:N?\d+(?![\d.,])\s*)?(/?)\s*", re.IGNORECASE)
_HEAD = re.compile(
    r"(?:BEGIN|END)\s+PGM|BLK\s+FORM(?:\s+(?:0[.,][12]|[A-Z]+))?|TOOL\s+(?:CALL|DEF)|CYCL\s+DEF\s*\d+(?:\s*[.,]\d+)?"
    r"|CYCL\s+CALL(?:\s+P[OA][ST]\b)?|CALL\s+(?:LBL|PGM)|FN\s*\d+\s*:|FUNCTION\s+(?:RESET\s+|DWELL\s+)?[A-Z]+|PLANE\s+[A-Z]+"
    r"|(?:APPR|DEP)\s+[A-Z]+|TCH\s+PROBE(?:\s+\d+)?|(?:SEL|PATTERN|INIT)\s+[A-Z]+|Q[LRS]?\d+(?=\s*=)|DECLARE\s+STRING"
    r"|TRANS\s+DATUM(?:\s+(?:AXIS|RESET))?|[A-Z]+"
)
_WORD = re.compile(
    r"(R0(?![\d.,])|R[LR]|DR[+-](?!\s*[\d.,Q])|F\s*MAX|F\s*AUTO|MB\s*MAX|(?:SEQ|SYM|CLSD)[+-]|STAY|TURN|MOVE|(?:TABLE|COORD)\s+ROT"
    r"|AXIS\s+(?:POS|SPAT)|PATHCTRL\s+(?:AXIS|VECTOR)|F\s+(?:TCP|CONT)|REFPNT\s+[A-Z-]+)"
    rf"|(I?(?:PA|PR|AN|ROT|SP[ABC]|[XYZABCUVW])|CC(?:[XYZA]|P[RA])|LEN|DR2|D[LR]|MB|[NT][XYZ]|DIST|ABST|SCL|HSC-MODE:|TA|LA|F[UZ]|[A-PR-Z])\s*({VALUE})"
    rf"|(Q[LRS]?\d+)\s*(?:=\s*({VALUE}|PREDEF)|=?\s*(F?AUTO|F?MAX))"
    r"|([XYZABCUVW])(?![A-Z])"
    rf"|(#\s*Q?\d+)|({VALUE})|\"([^\"]*)\"|[FRM](?![A-Z\d])"
    r"|\([^)]*\)?|(\S)"  # a remark, as simulators write it; anything else that is no word
)
_LABEL = re.compile(r'\s*/?\s*(?:N?\d+\s+)?/?\s*LBL\s*(?:0*(\d+)|"([^"]*)")\s*$')
PARAMETER = re.compile(r"\s*\bQ\d+\s*(?:=|F?AUTO|F?MAX)", re.IGNORECASE)
_INCH = re.compile(r"\b(INCH)()()\s*$")
_NUMBERS = re.compile(rf"(DR[+-]|(?<![A-Z])[FXY]|)(?:(?<=DR[+-])()|\s*({VALUE}))")  # behind names in any language
_OLD = re.compile(r"CYCL DEF (?:9\.1|(?:1|2|4|5|17)\.[1-6])|FUNCTION DWELL TIME")
_VALUES = {"MAX": MAX, "FMAX": MAX, "AUTO": AUTO, "FAUTO": AUTO}
# Heads whose rest has another form, or is irrelevant.
_OTHERWISE = re.compile(
    r"(?:BEGIN|END|CALL) PGM|PATTERN|(?:CALL )?LBL|TCH|FN|Q|DECLARE|BLK FORM (?!0)|FUNCTION (?!TCPM|RESET)"
    r"|CYCL DEF (?!(?:7|8|10|11|19)\.[1-9])\d+\."
)


@dataclass(frozen=True)
class PlainStatement:
    """A statement: its head, its words, its rest as text with its column, and the line after it.

    Of a bare axis letter a word's key is "X!", of a bare number "#", of a name `"`. `computed`: place of a word -> its
    value as it is written, where that is a Q parameter or no number.
    """

    line: int
    head: str
    column: int
    words: tuple[Word, ...]
    computed: dict[int, str]
    rest: str
    begins: int
    optional: bool
    after: int


def labels(lines: Sequence[str], first: int, stop: int) -> dict[str, list[int]]:
    """Label -> lines between two lines (from 0) where it occurs, except LBL 0."""
    places = dict[str, list[int]]()
    for row in range(first, stop):
        label = _LABEL.match(code_text(lines[row])) if "LBL" in lines[row].upper() else None
        if label is not None and label[1] != "0":
            places.setdefault(label[1] or label[2], []).append(row)
    return places


@lru_cache(256)
def _form(head: str) -> tuple[str, re.Pattern[str] | None, bool]:
    """Head as in messages, the only pattern looked for after it, and True if words follow it."""
    shown = " ".join(head.split()).replace(",", ".").replace("FN ", "FN").rstrip(": ")
    if shown.startswith("CYCL DEF"):
        shown = "CYCL DEF " + shown.removeprefix("CYCL DEF").replace(" ", "")
    special = _INCH if shown == "BEGIN PGM" else _NUMBERS if _OLD.match(shown) else None
    return shown, special, special is None and look_up(shown) is not None and not _OTHERWISE.match(shown)


def read_statement(lines: Sequence[str], row: int, name: str) -> PlainStatement:
    """Statement that begins at a line (from 0), with its continuation. Raises `InputError`."""
    text, after, place = code_text(lines[row]), row + 1, Place(name, row + 1)
    begin = _BEGIN.match(text)
    assert begin is not None
    head = _HEAD.match(text, begin.end())
    if begin.end() == len(text) or text[begin.end()] in "*(%":
        return PlainStatement(row + 1, "", 1, (), {}, "", 1, False, after)
    if head is None:
        raise place.fail(f"{text[begin.end() :][:20]!r} is no statement", "plain language", "", begin.end() + 1)
    shown, special, has_words = _form(head[0])
    if len(text) > LONGEST_BLOCK:
        raise place.fail(f"a statement of {len(text)} characters", f"at most {LONGEST_BLOCK}")
    end, cycle = head.start() if shown == "M" else head.end(), shown.startswith("CYCL DEF") and "." not in shown
    rest, words, computed = text[end:], list[Word](), dict[int, str]()
    for number in special.finditer(text, end) if special is not None else ():
        if number[0]:
            written = (number[3] or "").replace(",", ".").replace(" ", "")
            _add(words, computed, number[1] or "#", written, number.start() + 1, number[0].strip())
    if has_words:
        first = PARAMETER.search(text, end) if cycle else None  # the text before it is the cycle's name
        _words(words, computed, text, first.start() if first else len(text) if cycle else end, place, shown)
    while after < len(lines) and (lines[after - 1].rstrip().endswith("~") or (cycle and PARAMETER.match(lines[after]))):
        if has_words and (cycle or ";" not in lines[after - 1]):  # otherwise a remark continues
            _words(words, computed, code_text(lines[after]), 0, Place(name, after + 1), shown)
        elif ";" not in lines[after - 1]:
            rest += f" {code_text(lines[after]).lstrip()}"
        after += 1
    return PlainStatement(
        row + 1, shown, head.start() + 1, tuple(words), computed, rest, end + 1, bool(begin[1] or begin[2]), after
    )


def _words(words: list[Word], computed: dict[int, str], text: str, position: int, place: Place, head: str) -> None:
    """Add the words of a text from a position on."""
    for match in _WORD.finditer(text, position):
        flag, key, value, parameter, given, feed, axis, table, bare, quoted, wrong = match.groups()
        column = match.start() + 1
        if wrong is not None:
            raise place.fail(f"{text[column - 1 : column + 11]!r} is no word of {head}", "", "", column)
        key = (
            "".join(flag.split())
            if flag
            else key or parameter or (f"{axis}!" if axis else "TABLE" if table else "#" if bare else '"')
        )
        written = (value or given or feed or bare or (table or "")[1:]).replace(" ", "").replace(",", ".")
        if len(written) > 2 * MOST_DIGITS and sum(map(str.isdigit, written)) > 2 * MOST_DIGITS:
            raise place.fail(f"a number of {len(written)} characters", "", "", column)
        if key == "M":
            key = f"M{written.lstrip('+0') or '0'}"
        if match.lastindex:  # otherwise F, R or M alone, which changes nothing
            _add(words, computed, key, written, column, quoted if quoted is not None else match[0])


def _add(words: list[Word], computed: dict[int, str], key: str, written: str, column: int, text: str) -> None:
    """Add a word; if its value is no number it is evaluated when the word runs."""
    number = _VALUES.get(written)
    if number is None and "Q" not in written and written != "PREDEF":
        number = float(written or 0.0)
    if number is None:
        computed[len(words)] = written
    words.append(Word(key, number or 0.0, column, text))
