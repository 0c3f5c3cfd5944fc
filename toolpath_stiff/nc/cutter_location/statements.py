"""Lines of a cutter-location file to statements: a major word, a slash, arguments between commas.

`$` at the end of a line continues a statement on the next one; `$$` begins a comment (APT; ISO 4343).
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from operator import itemgetter

from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.tables import LARGEST_MM

_NUMBER = r"[+-]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[EeDd][+-]?\d++)?"


_IS_NUMBER = re.compile(_NUMBER)


_LABEL = re.compile(r"\s*(?:N?\d+\s+(?=[A-Za-z])|[A-Za-z0-9]+\))")


# These carry free text, which no `$` continues.
_TEXT_WORD = re.compile(r"\s*(PARTNO|PPRINT|REMARK|INSERT|LETTER|TITLES|MFGNO)", re.IGNORECASE)


_WORD = re.compile(r"\s*([A-Za-z][\w.-]*(?: +[A-Za-z][\w.-]*)*(?:\s*,\s*\w+)*)\s*(/|$)")


_FRAME = re.compile(r"\s*\$\$(?:(\*)CATIA0\b|->\s*CSYS\s*/)", re.IGNORECASE)


FRAME_NUMBERS = 12


_ONLY_NUMBERS = re.compile(r"[\s\d.,+\-EeDd$]*")


_NEW_STATEMENT = re.compile(
    r"\s*(?:(?:GOTO|FROM|FEDRAT|GODLTA|CYCLE|LOADTL|SPINDL|CUTTER|UNITS?|TLAXIS|INDIRV)\s*/|TLON\s*,|(?:RAPID|FINI)\s*$)",
    re.IGNORECASE,
)


_NEXT = rf"\s*,\s*({_NUMBER})"


_POINT = re.compile(rf"\s*GOTO\s*/\s*({_NUMBER})" + _NEXT * 2 + f"(?:{_NEXT * 3})?" + r"\s*$", re.IGNORECASE)


@dataclass(frozen=True)
class Argument:
    """What stands between two commas, and where it begins."""

    text: str
    line: int
    column: int


@dataclass(frozen=True)
class Statement:
    """A statement. `word` is upper case, "" for a line of numbers alone; `text` is free text after a text word."""

    line: int
    column: int
    word: str
    arguments: tuple[Argument, ...] = ()
    text: str = ""

    @property
    def words(self) -> list[str]:
        """The arguments in upper case."""
        return [argument.text.upper() for argument in self.arguments]

    @property
    def shown(self) -> str:
        """The statement for a message."""
        arguments = ",".join(" ".join(argument.text.split()) for argument in self.arguments)
        shown = f"{self.word}/{arguments}" if arguments else self.word or self.text
        return shown if len(shown) <= 60 else shown[:57] + "..."


def plain_point(line: str) -> list[float] | None:
    """The 3 or 6 numbers of a GOTO that stands on one line, which most lines are; None for any other line."""
    found = _POINT.match(line)
    if found is None:
        return None
    try:
        return [float(number) for number in found.groups() if number is not None]
    except ValueError:  # an exponent with D
        return None


def read_statement(lines: tuple[str, ...], at: int, name: str) -> tuple[Statement | None, int]:
    """The statement that begins with line `at` (from 0), None if there is none, and the line after it.

    Raises `InputError` with line and column.
    """
    line = lines[at]
    if line.lstrip().startswith("$$"):
        return None, _after_comment(lines, at)
    label = _LABEL.match(line)
    begin = label.end() if label else 0
    text_word = _TEXT_WORD.match(line, begin)
    if text_word:
        text = line[text_word.end() :].strip().removeprefix("/").strip()
        return Statement(at + 1, text_word.start(1) + 1, text_word[1].upper(), (), text), at + 1
    pieces, after = _pieces(lines, at, begin, name)
    return _parse(pieces, name), after


def _after_comment(lines: tuple[str, ...], at: int) -> int:
    """The line after a comment; `$$-> CSYS / ..., $` goes on over lines of numbers (Creo)."""
    goes_on = lines[at].lstrip().startswith("$$->")
    while (
        goes_on and lines[at].rstrip().endswith("$") and at + 1 < len(lines) and _ONLY_NUMBERS.fullmatch(lines[at + 1])
    ):
        at += 1
    return at + 1


def frame_in_comment(lines: tuple[str, ...], at: int) -> tuple[str, tuple[float, ...]] | None:
    """The coordinate system that a comment names: a word for whose it is, and its matrix of 3 rows of 4.

    CATIA writes `$$*CATIA0`, a name and three rows, all of them comments; Creo `$$-> CSYS /` and twelve numbers.
    """
    found = _FRAME.match(lines[at])
    if found is None:
        return None
    if found[1] == "*":
        text = " ".join(line.strip().removeprefix("$$") for line in lines[at + 2 : at + 5])
    else:
        text = " ".join((lines[at][found.end() :], *lines[at + 1 : _after_comment(lines, at)]))
    numbers = tuple(float(number.upper().replace("D", "E")) for number in _IS_NUMBER.findall(text))
    return (found[0].strip(), numbers) if len(numbers) == FRAME_NUMBERS else None


def _pieces(lines: tuple[str, ...], at: int, begin: int, name: str) -> tuple[list[tuple[int, int, str]], int]:
    """The lines of one statement, each as line, column, text without comment and `$`; and the line after them."""
    pieces: list[tuple[int, int, str]] = []
    while True:
        code = lines[at].partition("$$")[0]
        code, continues, rest = code.partition("$")
        if rest.strip():
            raise Place(name, at + 1).fail(
                f"{rest.strip()[:20]!r} after a $, which continues a statement on the next line",
                "nothing, or $$ and a comment",
                column=len(code) + 2,
            )
        pieces.append((at + 1, begin + 1, code[begin:]))
        at, begin = at + 1, 0
        if not continues:
            return pieces, at
        if at >= len(lines) or _NEW_STATEMENT.match(lines[at]):
            raise Place(name, pieces[-1][0]).fail(
                "a $ at the end of a line, and no line that continues the statement",
                "the rest of the statement",
                column=len(code) + 1,
            )


def _parse(pieces: list[tuple[int, int, str]], name: str) -> Statement | None:
    joined = "".join(text for _, _, text in pieces)
    if not joined.strip():
        return None
    starts, offset = list[tuple[int, int, int]](), 0
    for line, column, text in pieces:
        starts.append((offset, line, column))
        offset += len(text)

    def place(index: int) -> tuple[int, int]:
        begin, line, column = starts[bisect_right(starts, index, key=itemgetter(0)) - 1]
        return line, column + index - begin

    line, column = place(len(joined) - len(joined.lstrip()))
    if _ONLY_NUMBERS.fullmatch(joined):
        return Statement(line, column, "", _arguments(joined, 0, place), joined.strip())
    found = _WORD.match(joined)
    if found is None:
        raise Place(name, line).fail(
            f"{joined.strip()[:40]!r} is not a statement of a cutter-location file",
            "a word, or a word and / and its arguments",
            "definitions and computations need APT's processor: give the file that it or the CAM system writes"
            if "=" in joined
            else "",
            column=column,
        )
    word = re.sub(r"\s*,\s*", ",", re.sub(r"\s+", " ", found[1].strip().upper()))
    if not found[2]:
        # Without a slash, words after a comma are arguments: CHANNEL,1 or MULTAX,ON.
        word, _, rest = word.partition(",")
        return Statement(line, column, word, (Argument(rest, line, column),) if rest else ())
    return Statement(line, column, word, _arguments(joined, found.end(), place))


def _arguments(joined: str, begin: int, place: Callable[[int], tuple[int, int]]) -> tuple[Argument, ...]:
    """Split at the commas outside parentheses."""
    if not joined[begin:].strip():
        return ()
    found, depth, start = [], 0, begin
    for index in range(begin, len(joined) + 1):
        character = joined[index] if index < len(joined) else ","
        if character == "(":
            depth += 1
        elif character == ")":
            depth -= 1
        elif character == "," and (depth <= 0 or index == len(joined)):
            text = joined[start:index]
            lead = len(text) - len(text.lstrip())
            found.append(Argument(text.strip(), *place(min(start + lead, len(joined) - 1))))
            start = index + 1
    return tuple(found)


def number_of(argument: Argument, name: str, what: str = "a number") -> float:
    """The number of an argument. Raises `InputError`."""
    value = math.nan
    if _IS_NUMBER.fullmatch(argument.text):
        value = float(argument.text.upper().replace("D", "E"))
    if not abs(value) <= LARGEST_MM * 100.0:
        raise Place(name, argument.line).fail(f"{argument.text[:30]!r}", what, column=argument.column)
    return value


def is_number(text: str) -> bool:
    """Whether an argument is a number."""
    return _IS_NUMBER.fullmatch(text) is not None


Nested = tuple[str, tuple["float | str | Nested", ...]]


def nested(text: str) -> Nested | None:
    """A geometry in parentheses, `(CIRCLE/x,y,z,r)`, as its word and its arguments; None if it is none."""
    if not (text.startswith("(") and text.endswith(")")):
        return None
    word, slash, rest = text[1:-1].partition("/")
    if not slash or not word.strip().isalpha():
        return None
    found: list[float | str | Nested] = []
    for argument in _arguments(rest, 0, lambda index: (0, index)):
        if argument.text.startswith("("):
            inner = nested(argument.text)
            if inner is None:
                return None
            found.append(inner)
        elif is_number(argument.text):
            found.append(float(argument.text.upper().replace("D", "E")))
        else:
            found.append(argument.text.upper())
    return word.strip().upper(), tuple(found)
