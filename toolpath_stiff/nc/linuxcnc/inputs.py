"""What `rs274` is given: a copy of the program, a tool table, a parameter file; and what it is never given.

Comments are how LinuxCNC is told to run Python, to open files and to print messages; none reaches it but `(abort,...)`,
which ends a program. Lines keep their places, so that a line number in one of its messages is that of the file.

LinuxCNC executes Python in comments (`;py,...`, `(py,...)`, `(pyrun,...)`), user M codes (M100 to M199) as executables,
and subprograms of other files. A program with these is refused here, before anything is started. The copy that rs274
reads has no comments at all, so the first would not run even if it passed.

Lengths of the tool table and the parameter file are inches to `rs274`, whatever G21 says.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from toolpath_stiff.errors import InputError
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
ABORT = "abort,"
NO_COMMENTS: tuple[tuple[int, str], ...] = ()
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

    def left_by_switches(self) -> Line:
        """What block delete leaves of it."""
        if not self.optional and self.rest is None:
            return self
        return replace(self, words=self.words[: 0 if self.optional else self.rest])

    @property
    def plain(self) -> str:
        """The words without names in angle brackets and without bracketed expressions."""
        return without_expressions(NAMED.sub("<>", self.words))


def split(lines: Iterable[str], name: str) -> list[Line]:
    """Words and comments of every line. Raises `InputError` for a comment that is not closed, or foreign letters."""
    return [_split_line(text, number, name) for number, text in enumerate(lines, 1)]


def _split_line(text: str, number: int, name: str) -> Line:
    place = Place(name, number)
    if not any(mark in text for mark in "(;)"):
        words, comments = text, NO_COMMENTS
    else:
        words, comments = _cut_comments(text, place)
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
    return Line(number, compact, comments, optional, rest)


def _cut_comments(text: str, place: Place) -> tuple[str, tuple[tuple[int, str], ...]]:
    """`(` to its `)`, and outside of that `;` to the end; comments become blanks.

    LinuxCNC refuses a comment within a comment, which Haas' controls have; the copy has neither.
    """
    words, comments = [], []
    start = depth = 0
    for column, character in enumerate(text, 1):
        if start:
            depth += (character == "(") - (character == ")")
            if not depth:
                comments.append((start, text[start : column - 1]))
                start = 0
            words.append(" ")
        elif character == "(":
            start, depth = column, 1
            words.append(" ")
        elif character == ")":
            raise place.fail("`)` without `(`", column=column)
        elif character == ";":
            comments.append((column, text[column:]))
            break
        else:
            words.append(character)
    if start:
        raise place.fail("a comment is not closed", "`)` on the same line", column=start)
    return "".join(words), tuple(comments)


def without_expressions(words: str) -> str:
    """Words with what stands in square brackets left out."""
    if "[" not in words:
        return words
    kept, depth = [], 0
    for character in words:
        depth += character == "["
        if not depth:
            kept.append(character)
        depth -= character == "]" and depth > 0
    return "".join(kept)


def needs_tags(lines: Iterable[Line]) -> bool:
    """Whether the copy must carry its line numbers as comments too, which stay in order with the moves."""
    return any("G" in line.words and NEEDS_TAGS.search(line.words) for line in lines)


def numbered(lines: Iterable[Line], name: str, *, block_delete: bool, tags: bool, prefix: tuple[str, ...] = ()) -> str:
    """The text for `rs274`: after the `prefix`, one line for each of the program's.

    Text before a tape mark that follows words, and after it, is treated as by the built-in reader: the second `%`, or
    one that follows words, ends the program. `M2` is added: LinuxCNC requires an end.
    """
    copy = list(prefix)
    started = False
    for line in lines:
        if line.words == "%":
            if started:
                break
            started = True
            copy.append("")
            continue
        started = started or bool(line.words)
        copy.append(_numbered_line(line.left_by_switches() if block_delete else line, name, tags))
    return "\n".join([*copy, "M2", ""])


def _numbered_line(line: Line, name: str, tags: bool) -> str:
    aborts = any("".join(text.split()).lower().startswith(ABORT) for _, text in line.comments)
    if not line.words and not aborts:
        return ""
    if line.words.startswith(BARE_NUMBER):
        raise Place(name, line.number).fail(
            f"a block that begins with a number: {line.words[:20]!r}", "a letter before each number"
        )
    comment = f"({ABORT}stopped by the program)" if aborts else f"({line.number})" if tags else ""
    if line.words.startswith("O") and not aborts:  # after an O word some forms take no comment
        comment = ""
    text = f"N{line.number}{line.words}{comment}"
    if len(text) > LONGEST_LINE:
        raise Place(name, line.number).fail(
            f"a line of {len(text)} characters without blanks and comments",
            f"at most {LONGEST_LINE}, as LinuxCNC reads",
        )
    return text


# -- steps smaller than the digits that rs274 prints -------------------------------------------------------------------

# A block that moves in program coordinates, in the modes in force, and says where by numbers alone.
PLAIN_BLOCK = re.compile(r"(?:G0*[0-3](?![\d.])|[XYZABCIJKRFSP][+-]?(?:\d++\.?\d*+|\.\d++))*+", re.ASCII)
COORDINATE = re.compile(r"([XYZ])([+-]?(?:\d++\.?\d*+|\.\d++))", re.ASCII)


def step_in_words(lines: Sequence[Line], number: int, axes: Sequence[str]) -> list[float] | None:
    """How far a line (from 1) moves along some axes in G90, by the words alone, in program units.

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


# -- what only confuses rs274 ------------------------------------------------------------------------------------------

TOKEN = re.compile(r"([A-Z])([+-]?(?:\d++\.?\d*+|\.\d++))", re.ASCII)
TOKENS = re.compile(rf"(?:{TOKEN.pattern})++", re.ASCII)
KNOWN_M = frozenset((*range(10), 19, 30, *range(48, 54), *range(60, 69), *range(70, 74), *range(96, 200)))
# Codes of other controls that change no path, with their words (as in `codes.registry`); the first three are
# LinuxCNC's own with any other word.
OTHERS_CODES = {"G5": "P", "G5.1": "QR", "G8": "P", "G9": "", "G103": "P", "G187": "PE", "G254": "", "G255": ""}
OWN_CODES = ("G5", "G5.1", "G8")
ARC_CODES = frozenset(("G0", "G1", "G2", "G3", "G17", "G18", "G19", "G20", "G21", "G40", "G90", "G91", "G94"))
Dropped = tuple[int, str]  # line, word


def without_others(lines: Iterable[Line]) -> tuple[list[Line], list[Dropped]]:
    """The lines without words of other controls that change no path and that rs274 refuses; and those words.

    Blocks of plain words alone are looked at; what is left of one is a part of its words, each as it was.
    """
    kept, dropped = [], list[Dropped]()
    for line in lines:
        out = _others(line.words) if line.rest is None and TOKENS.fullmatch(line.words) else ()
        if out:
            found = [match for match in TOKEN.finditer(line.words) if match[0] not in out]
            dropped += [(line.number, word) for word in out]
            kept.append(replace(line, words="".join(match[0] for match in found)))
        else:
            kept.append(line)
    return kept, dropped


def _others(words: str) -> tuple[str, ...]:
    """The words of a block that rs274 need not see."""
    tokens = TOKEN.findall(words)
    codes = {f"{letter}{float(number):g}" for letter, number in tokens if letter in "GM"}
    letters = {letter for letter, _ in tokens}
    out = _others_codes(codes, letters)
    taken = _centres_of_no_plane(tokens, codes) | _numbers_of_tools(codes, letters)
    taken |= {letter for code in out for letter in OTHERS_CODES.get(code, "")}
    if out == codes and any(code[0] == "M" for code in out) and not letters & set("XYZABC"):
        taken |= set("PQERS")  # parameters of the M code
    return tuple(
        letter + number
        for letter, number in tokens
        if letter in taken or (letter in "GM" and f"{letter}{float(number):g}" in out)
    )


def _others_codes(codes: set[str], letters: set[str]) -> set[str]:
    """Codes of a block that are of other controls."""
    out = {code for code in codes if code[0] == "M" and _is_foreign(float(code[1:]))}
    for code in codes & OTHERS_CODES.keys():
        words = set(OTHERS_CODES[code])
        if code not in OWN_CODES or (letters & words and letters <= words | set("GMFST")):
            out.add(code)
    return out


def _numbers_of_tools(codes: set[str], letters: set[str]) -> set[str]:
    """D and H of a block that calls a tool or takes its length, and nothing that uses them."""
    tool, taken = "T" in letters or "M6" in codes, set[str]()
    if (tool or "G43" in codes) and not any(code.startswith(("G41", "G42", "G96")) for code in codes):
        taken.add("D")
    if tool and not any(code.startswith(("G43", "G76")) for code in codes):
        taken.add("H")
    return taken


def _centres_of_no_plane(tokens: Sequence[tuple[str, str]], codes: set[str]) -> set[str]:
    """Those of I, J and K that are 0, where all three are given and not all 0."""
    centres = {letter: float(number) for letter, number in tokens if letter in "IJK"}
    if len(centres) < 3 or not any(centres.values()) or any(code[0] == "G" for code in codes - ARC_CODES):
        return set()
    return {letter for letter, value in centres.items() if not value}


def _is_foreign(number: float) -> bool:
    """Whether rs274 has no such M code; those that it rounds to a user's are the fence's."""
    return number == int(number) and int(number) not in KNOWN_M


# -- the fence ---------------------------------------------------------------------------------------------------------

# `py,`, `pyrun`, `pyreload`, and `py` alone or before anything but a letter or digit, whatever blanks are in between;
# a comment within a comment counts, though LinuxCNC does not look there.
PYTHON = re.compile(r"[\s(;]*p\s*y(?:\s*(?:[^\w\s]|$|r\s*u\s*n|r\s*e\s*l\s*o\s*a\s*d)|\s)", re.IGNORECASE)
# Of all functions, operators and O words only MOD has an M in it.
M_WORD = re.compile(r"M(?!OD)([+-]?[0-9.]+)?", re.ASCII)
SUBPROGRAM = re.compile(r"O(<[^<>]*>|\d+)(SUB|CALL)?")
OPENS_OR_ENDS = re.compile(r"O(<[^<>]*>|\d+)(END)?(SUB|IF|WHILE|REPEAT)")
M98 = re.compile(r"M[+]?0*98(?!\d)")
NUMBER_ONLY = re.compile(r"O(\d+)$")


def refuse_other_programs(lines: Iterable[Line], name: str) -> None:
    """Raise `InputError`, with the line, for a program that must not be given to `rs274`."""
    lines = list(lines)
    for line in lines:
        for column, text in line.comments:
            if PYTHON.match(text):
                raise _refused("a comment that runs Python", Place(name, line.number, column))
        if "M" in line.words:
            _check_m_codes(line, name)
    _check_calls(lines, name)


def _refused(found: str, place: Place) -> InputError:
    return place.fail(
        f"{found}: LinuxCNC's interpreter is not started on such a program",
        "a program that runs no other",
        "remove it, or read the program with --interpreter builtin",
    )


def _check_m_codes(line: Line, name: str) -> None:
    for match in M_WORD.finditer(NAMED.sub("<>", line.words)):
        digits = match[1]
        if digits is None:
            raise _refused("an M code that is computed, and might be a user's (M100 to M199)", Place(name, line.number))
        try:
            code = float(digits)
        except ValueError:
            raise Place(name, line.number).fail(f"M{digits} is not an M code") from None
        # Rounded as LinuxCNC does (interp_read.cc: the nearest integer), and to be safe both neighbours.
        if 99.0 < code < 200.0:
            raise _refused(f"the user M code M{digits} (M100 to M199 run a program)", Place(name, line.number))


def _check_calls(lines: list[Line], name: str) -> None:
    """O words may call only what the program itself defines: LinuxCNC would go and look for a file."""
    calls: list[tuple[str, int]] = []
    defined: set[str] = set()
    for line in lines:
        match = SUBPROGRAM.match(line.words)
        if match and "/" in match[1]:  # it would be looked for there, if what defines it here is left out
            raise _refused("a subprogram whose name is a path", Place(name, line.number))
        if match and match[2] == "SUB":
            defined.add(_key(match[1]))
        elif match and match[2] == "CALL":
            calls.append((_key(match[1]), line.number))
        elif NUMBER_ONLY.match(line.words):
            defined.add(_key(line.words[1:]))
        elif line.words.startswith("O") and "CALL" in NAMED.sub("<>", line.words):
            raise _refused("a call of a subprogram whose name is computed", Place(name, line.number))
        elif M98.search(line.words):
            called = re.search(r"P(\d+)", line.plain)
            if called is None:
                raise _refused("M98 without the number of its subprogram", Place(name, line.number))
            calls.append((_key(called[1]), line.number))
    for key, number in calls:
        if key not in defined:
            raise Place(name, number).fail(
                f"subprogram O{key} is not in the program",
                "subprograms in the same file",
                "copy it into the program; other files are not read",
            )


def unclosed(lines: Iterable[Line]) -> int | None:
    """The line of the first O word whose end is missing."""
    opened: dict[str, int] = {}
    for line in lines:
        match = OPENS_OR_ENDS.match(line.words)
        if match and match[2]:
            opened.pop(_key(match[1]), None)
        elif match:
            opened.setdefault(_key(match[1]), line.number)
    return min(opened.values(), default=None)


def _key(name: str) -> str:
    return name if name.startswith("<") else str(int(name))


# -- tool table and parameters -----------------------------------------------------------------------------------------

# LinuxCNC's manual, "Parameters": the persistent ones must all be there, in order.
G92_ENABLED, G92_FIRST, ACTIVE_SYSTEM = 5210, 5211, 5220
MOST_TOOLS = 900  # of the 1000 pockets that LinuxCNC has
UNKNOWN_LENGTH_MM = -1e5  # stands for a length that the table does not give; a move with it is refused
TOOL_WORDS = re.compile(r"[THD]0*(\d+)(?![\d.])")
COMPUTED_TOOL = re.compile(r"[THD](?:[#\[]|[A-Z]{2})")


def parameter_file(offsets: Offsets, shift: tuple[float, float, float] = (0.0, 0.0, 0.0), active: int = 0) -> str:
    """Text of the parameter file: offsets and reference points (mm, degrees), all offsets moved by `shift` (mm)."""
    values: dict[int, float] = {G92_ENABLED: 0.0, ACTIVE_SYSTEM: active + 1.0}
    values |= {G92_FIRST + place: 0.0 for place in range(9)}
    for first, home in ((HOME_G28, offsets.home_g28), (HOME_G30, offsets.home_g30)):
        values |= {first + place: 0.0 for place in range(9)}
        values |= {first + place: _inches(value, place) for place, value in enumerate(home)}
    for index, offset in enumerate(offsets.table):
        first = FIRST_OFFSET + OFFSET_STRIDE * index
        values |= {first + place: 0.0 for place in range(ROTATION)}
        axes = [a + s for a, s in zip(offset.axes, (*shift, 0.0, 0.0, 0.0), strict=True)]
        values |= {first + place: _inches(value, place) for place, value in enumerate(axes)}
        values[first + ROTATION] = offset.rotation
    return "".join(f"{number}\t{values[number]:.9f}\n" for number in sorted(values))


def _inches(value: float, place: int) -> float:
    return value / MM_PER_INCH if place < 3 else value


def first_offset(text: str) -> tuple[list[float], float]:
    """G54 of a parameter file that rs274 wrote: six axes in mm and degrees, and the rotation."""
    found = {int(number): float(value) for number, value in re.findall(r"^(\d+)\s+(\S+)", text, re.MULTILINE)}
    axes = [found.get(FIRST_OFFSET + place, 0.0) * (MM_PER_INCH if place < 3 else 1.0) for place in range(6)]
    return axes, found.get(FIRST_OFFSET + ROTATION, 0.0)


def tool_numbers(tools: dict[int, ToolEntry] | None, lines: Iterable[Line]) -> list[int]:
    """The tools known and those that the program names, in the order of `tool_file`: rs274 prints places in it."""
    numbers = set(tools or {})
    for line in lines:
        numbers |= {int(found) for found in TOOL_WORDS.findall(line.plain)}
        if COMPUTED_TOOL.search(line.words):
            numbers |= set(range(1, 100))
    return sorted(numbers - {0})[:MOST_TOOLS]


def tool_file(numbers: Iterable[int], tools: dict[int, ToolEntry] | None) -> str:
    """Text of the tool table for these tools; a T word without an entry is an error in rs274."""
    rows = []
    for pocket, number in enumerate(numbers, 1):
        tool = tool_of(tools, number)
        length = UNKNOWN_LENGTH_MM if math.isnan(tool.length) else tool.length
        diameter = 0.0 if math.isnan(tool.diameter) else tool.diameter
        rows.append(f"T{number} P{pocket} Z{length / MM_PER_INCH:.9f} D{diameter / MM_PER_INCH:.9f} ;\n")
    return "".join(rows)
