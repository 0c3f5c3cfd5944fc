"""Input files of `rs274`: a copy of the program, a tool table, a parameter file.

Comments are how LinuxCNC is told to run Python, to open files and to print messages; none reaches it but `(abort,...)`,
which ends a program. Lines keep their places, so that a line number in one of its messages is that of the file.
Lengths of the tool table and the parameter file are inches to `rs274`, whatever G21 says.
"""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.tables import (
    FIRST_OFFSET,
    HOME_G28,
    HOME_G30,
    OFFSET_STRIDE,
    ROTATION,
    Offsets,
    ToolEntry,
    tool_of,
)
from toolpath_stiff.nc.words import without_comments
from toolpath_stiff.units import MM_PER_INCH

LONGEST_LINE = 250  # rs274 reads at most 255 characters (LINELEN, interp_internal.hh)
LINE_NUMBER = re.compile(r"N[0-9]+(\.[0-9]+)?")
# What must not follow the line number of the copy, because it would join it: `1O<x>CALL` would become N11 and a call
# that no check has seen.
BARE_NUMBER = tuple("0123456789.")
NAMED = re.compile(r"<[^<>]*>")
EXPRESSION = re.compile(r"\[[^\[\]]*(?:\]|$)")  # an expression without another in it
AXIS_WORD = re.compile(r"([XYZABC])(?=[-+.\d#\[]|$|[A-Z])")
# A block that moves in program coordinates, in the unit in force, to a point given by numbers only.
PLAIN_BLOCK = re.compile(
    r"(?:G(?:0*[0-3]|1[789]|9[014])(?![\d.])|M0*[3-9](?!\d)|[XYZABCIJKRFSPT][+-]?(?:\d++\.?\d*+|\.\d++))*+", re.ASCII
)
COORDINATE = re.compile(r"([XYZ])([+-]?(?:\d++\.?\d*+|\.\d++))", re.ASCII)
ABORTS = re.compile(r"[(;]\s*a\s*b\s*o\s*r\s*t\s*,", re.IGNORECASE)


@dataclass(frozen=True)
class Line:
    """A line of the program: its words without blanks, in upper case, and the columns of their characters."""

    number: int
    text: str
    words: str
    columns: Sequence[int] = ()
    optional: bool = False
    user_codes: tuple[str, ...] = ()  # taken out of its words

    @cached_property
    def plain(self) -> str:
        """Words with names in angle brackets and bracketed expressions removed."""
        words = NAMED.sub(_struck_out, self.words)
        while "[" in words:
            words = EXPRESSION.sub(_struck_out, words)
        return words

    @property
    def named(self) -> list[str]:
        """Axes given by numbers or expressions."""
        return AXIS_WORD.findall(self.plain)

    @cached_property
    def coordinates(self) -> dict[str, float] | None:
        """X, Y and Z of a plain block, to the digits of the program; None for any other."""
        plain = PLAIN_BLOCK.fullmatch(self.words)
        return {letter: float(number) for letter, number in COORDINATE.findall(self.words)} if plain else None


def _struck_out(match: re.Match[str]) -> str:
    return "#" * len(match[0])


def split(lines: Iterable[str], name: str) -> list[Line]:
    """Words of every line. Raises `InputError` for an unclosed comment, or foreign letters."""
    return [_line(text, Place(name, number)) for number, text in enumerate(lines, 1)]


def _line(text: str, place: Place) -> Line:
    words, columns = without_comments(text, place, semicolon=True)
    if not words.isascii():
        foreign, column = next((c, column) for c, column in zip(words, columns, strict=True) if not c.isascii())
        raise place.fail(f"{foreign!r} outside a comment", "letters and digits of the NC language", column=column)
    optional = words.startswith("/")
    words = words[1:].lstrip("0123456789") if optional else words
    words = LINE_NUMBER.sub("", words, count=1) if words.startswith("N") else words
    return Line(place.line, text, words, columns[len(columns) - len(words) :], optional)


def numbered(lines: Iterable[Line], name: str, *, block_delete: bool, prefix: Sequence[str] = ()) -> str:
    """Text for `rs274`: the `prefix`, then one line for each of the program's.

    Text before a tape mark that follows words, and after it, is treated as by the built-in reader: the second `%`, or
    one that follows words, ends the program. `M2` is added: LinuxCNC requires an end.
    """
    copy, started = list(prefix), False
    for line in lines:
        if line.words == "%":
            if started:
                break
            started = True
            copy.append("")
        else:
            started = started or bool(line.words)
            words = "" if line.optional and block_delete else line.words
            copy.append(numbered_line(line, words, Place(name, line.number)))
    return "\n".join([*copy, "M2", ""])


def numbered_line(line: Line, words: str, place: Place) -> str:
    """A line of the copy, with its number."""
    if words.startswith(BARE_NUMBER):
        raise place.fail(f"a block that begins with a number: {words[:20]!r}", "a letter before each number")
    comment = "" if words[:1] in ("", "O") else f"({line.number})"  # some forms allow no comment after an O word
    if ABORTS.search(line.text):
        comment = "(abort,stopped by the program)"
    text = f"N{line.number}{words}{comment}" if words or comment else ""
    if len(text) > LONGEST_LINE:
        problem = f"a line of {len(text)} characters without blanks and comments"
        raise place.fail(problem, f"at most {LONGEST_LINE}, as LinuxCNC reads")
    return text


# LinuxCNC's manual, "Parameters": the persistent ones must all be there, in order.
G92_ENABLED, G92_FIRST, ACTIVE_SYSTEM = 5210, 5211, 5220
MOST_TOOLS = 900  # out of LinuxCNC's 1000 pockets
UNKNOWN_LENGTH_MM = -1e5  # stands for a length that the table does not give; a move with it is refused
TOOL_WORDS = re.compile(r"[THD]0*(\d+)(?![\d.])")
COMPUTED_TOOL = re.compile(r"[THD](?:[#\[]|[A-Z]{2})")


def parameter_file(offsets: Offsets, shift: Sequence[float], active: int) -> str:
    """Text of the parameter file: offsets and reference points (mm, degrees), all offsets moved by `shift` (mm)."""
    values: dict[int, float] = {G92_ENABLED: 0.0, ACTIVE_SYSTEM: active + 1.0}
    tables = [(G92_FIRST, [0.0] * 6), (HOME_G28, offsets.home_g28), (HOME_G30, offsets.home_g30)]
    for index, offset in enumerate(offsets.table):
        first = FIRST_OFFSET + OFFSET_STRIDE * index
        tables.append((first, [a + s for a, s in zip(offset.axes, (*shift, 0.0, 0.0, 0.0), strict=True)]))
        values[first + ROTATION] = offset.rotation
    for first, axes in tables:
        values |= {first + place: 0.0 for place in range(6, 9)}
        values |= {first + place: value / (MM_PER_INCH if place < 3 else 1.0) for place, value in enumerate(axes)}
    return "".join(f"{number}\t{values[number]:.9f}\n" for number in sorted(values))


def first_offset(text: str) -> list[float]:
    """G54 in a parameter file written by rs274: six axes in mm and degrees."""
    values = {int(number): float(value) for number, value in re.findall(r"^(\d+)\s+(\S+)", text, re.MULTILINE)}
    return [values.get(FIRST_OFFSET + place, 0.0) * (MM_PER_INCH if place < 3 else 1.0) for place in range(6)]


def tool_numbers(tools: dict[int, ToolEntry] | None, lines: Iterable[Line]) -> list[int]:
    """Tools known and tools that the program names, in the order of `tool_file`: rs274 prints places in it."""
    numbers = set(tools or {})
    for line in lines:
        numbers |= {int(digits) for digits in TOOL_WORDS.findall(line.plain)}
        if COMPUTED_TOOL.search(line.words):
            numbers |= set(range(1, 100))
    return sorted(numbers - {0})[:MOST_TOOLS]


def tool_file(numbers: Iterable[int], tools: dict[int, ToolEntry] | None) -> str:
    """Text of the tool table for these tools; a T word without an entry is an error in rs274."""

    def inches(value: float, otherwise: float) -> str:
        return f"{(otherwise if math.isnan(value) else value) / MM_PER_INCH:.9f}"

    entries = [tool_of(tools, number) for number in numbers]
    return "".join(
        f"T{tool.number} P{pocket} Z{inches(tool.length, UNKNOWN_LENGTH_MM)} D{inches(tool.diameter, 0.0)} ;\n"
        for pocket, tool in enumerate(entries, 1)
    )
