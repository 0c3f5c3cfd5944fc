"""Lines of a cutter-location file as statements: a major word, a slash, arguments between commas.

`$` at the end of a line continues a statement on the next one; `$$` begins a comment (APT; ISO 4343).
"""

import re
from dataclasses import dataclass

from toolpath_stiff.nc.place import Place

_NUMBER = r"[+-]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[EeDd][+-]?\d++)?"
NUMBERS = re.compile(_NUMBER)
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
# Without an exponent D, which `float` does not read.
_FIRST = rf"\s*({_NUMBER.replace('Dd', '')})"
_NEXT = rf"\s*,{_FIRST}"
_POINT = re.compile(rf"\s*GOTO\s*/{_FIRST}{_NEXT * 2}(?:{_NEXT * 3})?\s*$", re.IGNORECASE)


@dataclass(frozen=True)
class MajorStatement:
    """A statement. `word` is upper case, "" for a line of numbers alone; `text` is free text after a text word."""

    line: int
    column: int
    word: str
    arguments: tuple[str, ...] = ()
    text: str = ""

    @property
    def words(self) -> list[str]:
        """The arguments in upper case."""
        return [argument.upper() for argument in self.arguments]

    @property
    def shown(self) -> str:
        """The statement for a message."""
        arguments = ",".join(" ".join(argument.split()) for argument in self.arguments)
        shown = f"{self.word}/{arguments}" if arguments else self.word or self.text
        return shown if len(shown) <= 60 else shown[:57] + "..."


def plain_point(line: str) -> list[float] | None:
    """The 3 or 6 numbers of a GOTO on one line, as most lines are; None for any other line."""
    point = _POINT.match(line)
    return [float(number) for number in point.groups() if number is not None] if point else None


def is_number(text: str) -> bool:
    """True if a text is a number."""
    return NUMBERS.fullmatch(text) is not None


def number(text: str) -> float:
    """Value of a number, whose exponent may begin with D."""
    return float(text.upper().replace("D", "E"))


def read_statement(lines: tuple[str, ...], index: int, name: str) -> tuple[MajorStatement | None, int]:
    """Statement that begins at line `index` (from 0), None if there is none, and the next line.

    Raises `InputError` with line and column.
    """
    line = lines[index]
    if line.lstrip().startswith("$$"):
        return None, _after_comment(lines, index)
    label = _LABEL.match(line)
    begin = label.end() if label else 0
    text_word = _TEXT_WORD.match(line, begin)
    if text_word:
        text = line[text_word.end() :].strip().removeprefix("/").strip()
        return MajorStatement(index + 1, text_word.start(1) + 1, text_word[1].upper(), (), text), index + 1
    joined, place = "", Place(name, index + 1, begin + len(line[begin:]) - len(line[begin:].lstrip()) + 1)
    while True:
        code, continues, rest = lines[index].partition("$$")[0].partition("$")
        if rest.strip():
            problem = f"{rest.strip()[:20]!r} after a $, which continues a statement on the next line"
            raise Place(name, index + 1, len(code) + 2).fail(problem, "nothing, or $$ and a comment")
        joined += code[begin:]
        index, begin = index + 1, 0
        if not continues:
            return _parse(joined.strip(), place), index
        if index == len(lines) or _NEW_STATEMENT.match(lines[index]):
            problem = "a $ at the end of a line, and no line that continues the statement"
            raise Place(name, index, len(code) + 1).fail(problem, "the rest of the statement")


def _after_comment(lines: tuple[str, ...], index: int) -> int:
    """Line after a comment; `$$-> CSYS / ..., $` continues over lines of numbers (Creo)."""
    goes_on = lines[index].lstrip().startswith("$$->")
    index += 1
    while (
        goes_on
        and index < len(lines)
        and lines[index - 1].rstrip()[-1:] == "$"
        and _ONLY_NUMBERS.fullmatch(lines[index])
    ):
        index += 1
    return index


def frame_in_comment(lines: tuple[str, ...], index: int) -> tuple[str, tuple[float, ...]] | None:
    """Coordinate system that a comment names: a word for its origin, and its matrix of 3 rows of 4.

    CATIA writes `$$*CATIA0`, a name and three rows, all of them comments; Creo `$$-> CSYS /` and twelve numbers.
    """
    frame = _FRAME.match(lines[index])
    if frame is None:
        return None
    if frame[1] == "*":
        text = " ".join(line.strip().removeprefix("$$") for line in lines[index + 2 : index + 5])
    else:
        text = " ".join((lines[index][frame.end() :], *lines[index + 1 : _after_comment(lines, index)]))
    numbers = tuple(map(number, NUMBERS.findall(text)))
    return (frame[0].strip(), numbers) if len(numbers) == FRAME_NUMBERS else None


def _parse(text: str, place: Place) -> MajorStatement | None:
    """Statement of a text, given the place of its first character."""
    line, column = place.line, place.column or 1
    if not text:
        return None
    if _ONLY_NUMBERS.fullmatch(text):
        return MajorStatement(line, column, "", _arguments(text), text)
    head = _WORD.match(text)
    if head is None:
        hint = "definitions and computations need APT's processor: give the file that it or the CAM system writes"
        problem = f"{text[:40]!r} is not a statement of a cutter-location file"
        raise place.fail(problem, "a word, or a word and / and its arguments", hint if "=" in text else "")
    word = re.sub(r"\s*,\s*", ",", re.sub(r"\s+", " ", head[1].strip().upper()))
    if head[2]:
        return MajorStatement(line, column, word, _arguments(text[head.end() :]))
    # Without a slash, words after a comma are arguments: CHANNEL,1 or MULTAX,ON.
    word, _, rest = word.partition(",")
    return MajorStatement(line, column, word, (rest,) if rest else ())


def _arguments(text: str) -> tuple[str, ...]:
    """Texts between the commas outside parentheses."""
    arguments, depth = [""], 0
    for character in text:
        depth += (character == "(") - (character == ")")
        if character == "," and depth <= 0:
            arguments.append("")
        else:
            arguments[-1] += character
    return tuple(argument.strip() for argument in arguments) if text.strip() else ()
