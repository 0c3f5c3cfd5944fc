"""Files that `rs274` is given: a copy of the program, a tool table, a parameter file.

Comments are how LinuxCNC is told to run Python, to open files and to print messages; none reaches it but `(abort,...)`,
which ends a program. Lines keep their places, so that a line number in one of its messages is that of the file.
Lengths of the tool table and the parameter file are inches to `rs274`, whatever G21 says.
"""

from __future__ import annotations

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
from toolpath_stiff.units import MM_PER_INCH

LONGEST_LINE = 250  # rs274 reads at most 255 characters (LINELEN, interp_internal.hh)
LINE_NUMBER = re.compile(r"N[0-9]+(\.[0-9]+)?")
# What must not follow the line number of the copy, because it would join it: `1O<x>CALL` would become N11 and a call
# that no check has seen.
BARE_NUMBER = tuple("0123456789.")
NAMED = re.compile(r"<[^<>]*>")
EXPRESSION = re.compile(r"\[[^\[\]]*(?:\]|$)")  # one without another in it
TOKEN = re.compile(r"([A-Z])([+-]?(?:\d++\.?\d*+|\.\d++))", re.ASCII)
TOKENS = re.compile(rf"(?:{TOKEN.pattern})++", re.ASCII)
ABORT = "abort,"
# Where the line that asks for a move is not the one that rs274 is reading when it prints it (cutter compensation holds
# moves back), or where more than the move is needed from its line: cycles, machine coordinates, computed G codes.
NEEDS_TAGS = re.compile(r"G(?:4[12]|7[346]|8[1-9]|0*53|28|30|33|[\[#A-Z])")


@dataclass(frozen=True)
class Line:
    """A line of the program: its words without blanks, in upper case, and its comments with their columns."""

    number: int
    words: str
    comments: tuple[tuple[int, str], ...] = ()
    optional: bool = False
    rest: int | None = None  # how many characters of the words stand before a slash in the middle

    @cached_property
    def plain(self) -> str:
        """The words without names in angle brackets and without bracketed expressions."""
        words = NAMED.sub("<>", self.words)
        while "[" in words:
            words = EXPRESSION.sub("", words)
        return words


def split(lines: Iterable[str], name: str) -> list[Line]:
    """Words and comments of every line. Raises `InputError` for a comment that is not closed, or foreign letters."""
    return [_split_line(text, Place(name, number)) for number, text in enumerate(lines, 1)]


def _split_line(text: str, place: Place) -> Line:
    words, comments = _cut_comments(text, place) if any(mark in text for mark in "(;)") else (text, ())
    compact = "".join(words.replace("\ufeff", "").split())
    if not compact.isascii():  # before upper case: of other scripts some letters become ASCII ones
        foreign = next(c for c in words if not c.isascii() and not c.isspace() and c != "\ufeff")
        raise place.fail(
            f"{foreign!r} outside a comment", "letters and digits of the NC language", column=words.index(foreign) + 1
        )
    compact = compact.upper()
    optional = compact.startswith("/")
    if optional:
        compact = compact[1:].lstrip("0123456789")
    compact = LINE_NUMBER.sub("", compact, count=1) if compact.startswith("N") else compact
    rest = None
    if "/" in compact and TOKENS.fullmatch(compact.replace("/", "")):  # of a block, no quotient
        before, _, behind = compact.partition("/")
        rest, compact = len(before), before + behind.lstrip("0123456789")
    return Line(place.line, compact, comments, optional, rest)


def _cut_comments(text: str, place: Place) -> tuple[str, tuple[tuple[int, str], ...]]:
    """`(` to its `)`, and outside of that `;` to the end; comments become blanks.

    LinuxCNC refuses a comment within a comment, which Haas' controls have; the copy has neither.
    """
    words, comments, start, depth = "", list[tuple[int, str]](), 0, 0
    for column, character in enumerate(text, 1):
        if character == ";" and not depth:
            comments.append((column, text[column:]))
            break
        depth += (character == "(") - (character == ")")
        if depth < 0:
            raise place.fail("`)` without `(`", column=column)
        start = start or (column if depth else 0)
        words += " " if start else character
        if start and not depth:
            comments.append((start, text[start : column - 1]))
            start = 0
    if start:
        raise place.fail("a comment is not closed", "`)` on the same line", column=start)
    return words, tuple(comments)


def needs_tags(lines: Iterable[Line]) -> bool:
    """True where the copy must carry its line numbers as comments too, which stay in order with the moves."""
    return any("G" in line.words and NEEDS_TAGS.search(line.words) for line in lines)


def numbered(lines: Iterable[Line], name: str, *, block_delete: bool, tags: bool, prefix: tuple[str, ...] = ()) -> str:
    """The text for `rs274`: after the `prefix`, one line for each of the program's.

    Text before a tape mark that follows words, and after it, is treated as by the built-in reader: the second `%`, or
    one that follows words, ends the program. `M2` is added: LinuxCNC requires an end.
    """
    copy = list(prefix)
    started = False
    for line in lines:
        words = line.words
        if words == "%":
            if started:
                break
            started = True
            copy.append("")
            continue
        if block_delete:
            words = "" if line.optional else words[: line.rest]
        started = started or bool(line.words)
        copy.append(_numbered_line(line, words, name, tags))
    return "\n".join([*copy, "M2", ""])


def _numbered_line(line: Line, words: str, name: str, tags: bool) -> str:
    aborts = any("".join(text.split()).lower().startswith(ABORT) for _, text in line.comments)
    if not words and not aborts:
        return ""
    place = Place(name, line.number)
    if words.startswith(BARE_NUMBER):
        raise place.fail(f"a block that begins with a number: {words[:20]!r}", "a letter before each number")
    comment = ""
    if aborts:
        comment = f"({ABORT}stopped by the program)"
    elif tags and not words.startswith("O"):  # after an O word some forms take no comment
        comment = f"({line.number})"
    text = f"N{line.number}{words}{comment}"
    if len(text) > LONGEST_LINE:
        problem = f"a line of {len(text)} characters without blanks and comments"
        raise place.fail(problem, f"at most {LONGEST_LINE}, as LinuxCNC reads")
    return text


# A block that moves in program coordinates, in the modes in force, and says where by numbers alone.
PLAIN_BLOCK = re.compile(r"(?:G0*[0-3](?![\d.])|[XYZABCIJKRFSP][+-]?(?:\d++\.?\d*+|\.\d++))*+", re.ASCII)
COORDINATE = re.compile(r"([XYZ])([+-]?(?:\d++\.?\d*+|\.\d++))", re.ASCII)


def step_in_words(lines: Sequence[Line], number: int, axes: Sequence[str]) -> list[float] | None:
    """Distances by which a line (from 1) moves along some axes in G90, by the words alone, in program units.

    None where the words do not say it: they are computed, or other codes stand between the two numbers of an axis.
    """
    wanted: dict[str, str] = dict(COORDINATE.findall(lines[number - 1].words))
    steps = {axis: 0.0 for axis in axes if axis not in wanted}
    for line in reversed(lines[:number]):
        if line.optional or PLAIN_BLOCK.fullmatch(line.words) is None:
            return None
        if line.number < number:
            for axis, value in COORDINATE.findall(line.words):
                if axis in axes and axis not in steps:
                    steps[axis] = float(wanted[axis]) - float(value)
        if len(steps) == len(axes):
            return [steps[axis] for axis in axes]
    return None


# LinuxCNC's manual, "Parameters": the persistent ones must all be there, in order.
G92_ENABLED, G92_FIRST, ACTIVE_SYSTEM = 5210, 5211, 5220
MOST_TOOLS = 900  # of the 1000 pockets that LinuxCNC has
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
    """G54 of a parameter file that rs274 wrote: six axes in mm and degrees."""
    values = {int(number): float(value) for number, value in re.findall(r"^(\d+)\s+(\S+)", text, re.MULTILINE)}
    return [values.get(FIRST_OFFSET + place, 0.0) * (MM_PER_INCH if place < 3 else 1.0) for place in range(6)]


def tool_numbers(tools: dict[int, ToolEntry] | None, lines: Iterable[Line]) -> list[int]:
    """The tools known and those that the program names, in the order of `tool_file`: rs274 prints places in it."""
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
