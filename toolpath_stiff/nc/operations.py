"""The operations of a program: which moves belong together, and what people call them.

An operation begins at a tool change, and at a block of comment lines, if cutting follows before the next one. Between
two cuts there is one beginning at most: tool change, comments and rapids between them belong to what follows, rapids
before the first of these to what went before. An operation always cuts. docs/nc.md has the whole rule.

What posts write as headings was looked up in published programs: of Fusion 360 (one line before each operation; tools,
notes on the licence in the header), FreeCAD (`begin operation: NAME`, `finish operation: NAME`), Mastercam (tool and
name in one block), Vectric (`Toolpath:- NAME` between lines of dashes), Estlcam, CamBam, jscut, Gcodetools, bCNC,
pcb2gcode, and five-axis demos of LinuxCNC.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from toolpath_stiff.arrays import BoolArray, IntArray
from toolpath_stiff.nc.moves import RAPID, Jump, Moves, ReadProgram

NAMED, MARKED, TOOL = "named", "marked", "tool"

COMMENTS = re.compile(r"\(([^()]*)\)?|;(.*)")
NO_WORDS = re.compile(r"\s*+(?:N\s*+\d++\s*+)?", re.IGNORECASE)  # a line number is not a word
BEGINS = re.compile(r"\s*+(?:N\s*+\d++\s*+)?[(;]", re.IGNORECASE)
ACTIVE = re.compile(r"\s*(?:MSG|DEBUG|PRINT)\s*,", re.IGNORECASE)  # LinuxCNC shows what follows
FRAME, DASHES = " *=#~|'\"", "-_."  # of dashes and points only two and more are a frame: -X SIDE, .5 CHAMFER
MARK = re.compile(
    r"(?:(?:begin|start)\s+(?:of\s+)?(?:operation|section|toolpath|cutting\s+path\s+id)|tool\s?path(?:\s+name)?"
    r"|operation(?:\s+name)?|block-name)\s*(?::-?|=)\s*(?=.*\w)",
    re.IGNORECASE,
)
FIELD = re.compile(r"(?:name|type)\s*:\s*(?=.*\w)", re.IGNORECASE)  # after `Operation: 0`
TOOL_LINE = re.compile(r"(?:T\s*\d+|tools?|change\s+(?:to\s+)?tool)\b|.*\btool\s*-\s*\d", re.IGNORECASE)
TOOL_NUMBERS = re.compile(r"\s*\btool\s*-\s*\d+\s*|\s*\b(?:tool\s+)?dia\.\s*off\..*$", re.IGNORECASE)
# The end of something, the state of a post, single moves, licence notes, code that is commented out: no headings.
NOTHING = re.compile(
    r"(?:finish(?:ed)?|end)\s+(?:of\s+)?(?:the\s+)?(?:op|operation|section|tool\s?path|cutting|path|preamble)\b"
    r"|.*\b(?:done|finished|completed)$"
    r"|(?:begin|start)\s+(?:of\s+)?(?:preamble|tool\s?change)\b|tool\s?change$|(?:section|start|stop|end)\s+(?:begin|end)$"
    r"|(?:plunge|cut|cutting|retract|approach|ramp|penetrate|lead[\s-]?(?:in|out))$|(?:rapid|retract|move|go)\s+to\b"
    r"|(?:pass\s+\d+\s+)?path\s+\d+$|.*\bmove\s+(?:starts|ends)$|machine\s+group-\d+$"
    r"|(?:MOVEMENT|COMMAND)_\w+$|>>>|block-(?:expand|enable)\b|[XYZ]\s+min\b|when\s+using\s+fusion\b"
    r"|(?:[A-Z]\s*[-+]?(?:\d++\.?\d*+|\.\d++)\s*)++(?:;.*)$|(?:[A-Z]\s*[-+]?(?:\d++\.?\d*+|\.\d++)\s*){2,}+$"
    r"|[A-Z]\s*[-+]?(?:\d++\.\d*+|\.\d++)$",  # an axis and where it stands; M8 may be a hole
    re.IGNORECASE,
)
FROM_HERE_NOTES = re.compile(r"when\s+using\s+fusion\b", re.IGNORECASE)  # the rest of its block is its sentence


class Heading(NamedTuple):
    """A block of comment lines: its first line, its name, and what the name is: NAMED, MARKED (by the post) or TOOL."""

    line: int
    name: str
    kind: str


def split_comments(text: str) -> tuple[str, str]:
    """The code of a line and its comments, joined."""
    return COMMENTS.sub(" ", text), " ".join(first or second for first, second in COMMENTS.findall(text))


def headings(lines: Sequence[str]) -> list[Heading]:
    """Blocks of successive lines that hold comments alone, in order; those that name nothing are left out.

    Examples
    --------
    >>> [(heading.line, heading.name) for heading in headings(("G21", "(FACE)", "G1 X1"))]
    [(2, 'FACE')]
    """
    blocks: list[tuple[int, list[str]]] = []  # the first line of each, and its comments
    last = -1
    for number, text in enumerate(lines, 1):
        if ("(" in text or ";" in text) and BEGINS.match(text):
            code, comment = split_comments(text)
            if NO_WORDS.fullmatch(code):
                if number != last + 1:
                    blocks.append((number, []))
                blocks[-1][1].append(comment)
                last = number
    named = (heading_of(comments, first) for first, comments in blocks)
    return [heading for heading in named if heading is not None]


def heading_of(block: Sequence[str], line: int) -> Heading | None:
    """The heading of a block of comments: what the post marks, else the first line with letters, else a tool."""
    named = tool = number = None
    for comment in block:
        name = plain_name(comment)
        mark = MARK.match(name)
        if mark is not None:
            marked = plain_name(name[mark.end() :])
            if any(map(str.isalpha, marked)):
                return Heading(line, marked, MARKED)
            number = name
        field = FIELD.match(name)
        if number and field is not None:
            return Heading(line, plain_name(name[field.end() :]), MARKED)
        if FROM_HERE_NOTES.match(name):
            break
        if NOTHING.match(name) or not any(map(str.isalpha, name)):
            continue
        if TOOL_LINE.match(name):
            tool = tool or TOOL_NUMBERS.sub("", name) or name
        else:
            named = named or name
    kinds = ((number, MARKED), (named, NAMED), (tool, TOOL))
    return next((Heading(line, name, kind) for name, kind in kinds if name is not None), None)


def plain_name(comment: str) -> str:
    """A comment without what frames it: blanks, asterisks, dashes; the text alone of `MSG, text`."""
    active = ACTIVE.match(comment)
    text = " ".join((comment[active.end() :] if active else comment).split())
    inside = text.lstrip(FRAME + DASHES)
    text = _last_dash(text[: len(text) - len(inside)]) + inside
    inside = text.rstrip(FRAME + DASHES)
    return inside + _last_dash(text[len(inside) :][::-1])


def _last_dash(frame: str) -> str:
    """The dash or point next to the text, if it stands alone: it belongs to the text."""
    return frame[-1:] if frame and frame[-1] in DASHES and frame[-2:-1] not in tuple(DASHES) else ""


MOST_OPERATIONS = 1000  # beyond, comments name passes or moves, not operations: the tools are taken
# A call, a return, a loop or a condition: M97, M98, M99 and LinuxCNC's O words (`o100 call`, `o<name> while`).
LEAVES = re.compile(
    r"\s*+(?:/\s*+\d?\s*+)?(?:N\s*+\d++\s*+)?(?:O\s*(?:\d+\s*[A-Z]|[<#\[])|[^O(;]*?M\s*+0*9[789](?!\d))", re.IGNORECASE
)
# Where a run arrives only from elsewhere: the head of a subprogram, and what follows the end of a program.
HEAD = re.compile(r"\s*+(?:/?\s*[O:]\s*\d+\s*+(?:[(;]|$)|[^(;]*?M\s*+0*(?:2|30)(?!\d))", re.IGNORECASE)
BARE = re.compile(r"\s*+(?:%|[O:]\s*+\d++|N\s*+\d++)?\s*+", re.IGNORECASE)
CHANGES_TOOL = re.compile(r"M\s*0*6(?!\d)|T\s*\d", re.IGNORECASE)


@dataclass(frozen=True)
class Operation:
    """A stretch of moves between two beginnings.

    Attributes
    ----------
    number
        From 1, in the order of the run.
    name
        Of its comment block, of its tool, or of the program.
    first_line, last_line
        From its heading to the last line of its moves; with subprograms the smallest and the largest of its lines.
    tool
        The tool that cuts, 0 for none.
    first_move
        Row of its first move.
    """

    number: int
    name: str
    first_line: int
    last_line: int
    tool: int
    first_move: int


@dataclass(frozen=True)
class Operations:
    """All operations of a program, and `of_move` (n,): the row of its operation for every move, ascending."""

    rows: tuple[Operation, ...]
    of_move: IntArray


def operations(program: ReadProgram) -> Operations:
    r"""The operations of a program that was read, by either interpreter.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> program = parse_program("F600\n(FACE)\nG0 Z5\nG1 Z0\nX40\n(SLOT)\nG0 Z5\nG1 Z-1\nX0\nM30\n")
    >>> found = operations(program)
    >>> [(row.number, row.name, row.first_line, row.last_line) for row in found.rows]
    [(1, 'FACE', 2, 5), (2, 'SLOT', 6, 9)]
    >>> found.of_move.tolist()
    [0, 0, 0, 1, 1, 1]
    """
    remarks = {tool.number: tool.remark for tool in program.tools}
    return find_operations(program.source, program.moves, program.name, remarks, program.marks, program.jumps)


def find_operations(
    lines: Sequence[str],
    moves: Moves,
    name: str,
    remarks: dict[int, str] | None = None,
    marks: Sequence[tuple[int, str]] | None = None,
    jumps: Sequence[Jump] | None = None,
) -> Operations:
    """The operations of moves.

    Parameters
    ----------
    lines
        The program's text.
    moves
        With the lines that asked for them.
    name
        Of the program, for an operation that nothing else names.
    remarks
        What the tool table says of tools, by number.
    marks
        (line, name) where operations begin, ascending, on the line of their first move or before it: of a language
        that marks them otherwise than by comment lines.
    jumps
        Where the run left the order of the lines; None: not known, then calls and loops are looked for in the text.
    """
    cuts = np.flatnonzero(moves.motion != RAPID)
    if not len(cuts):
        return Operations((), np.zeros(len(moves), dtype=np.int64))
    title, heads = _title_and_headings(lines) if marks is None else ("", [Heading(*mark, MARKED) for mark in marks])
    way = _Way(lines, moves, jumps if marks is None else ())
    begins = _beginnings(way, moves, cuts, heads, MOST_OPERATIONS) or _beginnings(way, moves, cuts, [])
    first = [begin.move for begin in begins]
    names = [_name(begin, title, remarks or {}, alone=len(begins) == 1) or name for begin in begins]
    of_move = np.repeat(np.arange(len(first)), np.diff([*first, len(moves)]))
    low, high = np.minimum.reduceat(moves.line, first), np.maximum.reduceat(moves.line, first)
    rows = [
        Operation(i + 1, names[i], min(int(low[i]), begin.line), int(high[i]), begin.tool, begin.move)
        for i, begin in enumerate(begins)
    ]
    return Operations(tuple(rows), of_move.astype(np.int64))


@dataclass
class _Beginning:
    """The gap between two cuts: the first move after it, headings passed, the tool that cuts, its tool change."""

    move: int
    heads: list[Heading]
    tool: int
    change: tuple[int, str] | None  # line and comment

    @property
    def line(self) -> int:
        """The line of its heading or its tool change; the largest number there is without any."""
        lines = [head.line for head in self.heads] + ([self.change[0]] if self.change else [])
        return min(lines, default=np.iinfo(np.int64).max)


def _title_and_headings(lines: Sequence[str]) -> tuple[str, list[Heading]]:
    """The program's title, and the headings of its operations.

    The title is the comment beside the program's number, or the first heading before the first line with other words.
    """
    title, header_end = "", len(lines)
    for number, text in enumerate(lines, 1):
        code, comment = split_comments(text)
        if not BARE.fullmatch(code):
            header_end = number - 1
            break
        if code.strip() and comment and not title:
            title = plain_name(comment)
    every = headings(lines)
    title = title or next((head.name for head in every if head.line <= header_end and head.kind == NAMED), "")
    marked = [head for head in every if head.kind == MARKED]
    if len(marked) > 1:  # a post that marks operations means other things by other comments
        return title, marked
    return title, [head for head in every if head.line > header_end or head.kind == MARKED]


class _Way:
    """The lines that a run passes between two moves, as stretches: their first line left out, their last one in it."""

    def __init__(self, lines: Sequence[str], moves: Moves, jumps: Sequence[Jump] | None) -> None:
        self.lines, self.jumps = lines, jumps
        self.line = np.concatenate([[0], moves.line])  # that of move i is at i + 1
        self.jump_moves = np.array([jump.moves for jump in jumps or ()], dtype=np.int64)
        self.leaves = self._lines_of(LEAVES) if jumps is None else np.empty(0, dtype=np.int64)

    def _lines_of(self, pattern: re.Pattern[str]) -> IntArray:
        return np.array([number for number, text in enumerate(self.lines, 1) if pattern.match(text)], dtype=np.int64)

    @cached_property
    def enters(self) -> IntArray:
        """Lines at which a run can arrive from elsewhere: calls and loops, heads and ends of programs."""
        return np.union1d(self.leaves, self._lines_of(HEAD))

    def turns(self) -> BoolArray:
        """(n,) whether the run does not come straight on to a move from the one before."""
        if self.jumps is not None:
            turns = np.zeros(len(self.line) - 1, dtype=bool)
            turns[self.jump_moves[self.jump_moves < len(turns)]] = True
            return turns
        return np.asarray((np.diff(self.line) < 0) | (np.diff(np.searchsorted(self.leaves, self.line)) != 0))

    def passed(self, last: int, move: int) -> list[tuple[int, int]]:
        """From move `last` (-1: from the start of the file) to a later one."""
        start, end = int(self.line[last + 1]), int(self.line[move + 1])
        if self.jumps is None:  # up to where the run leaves for a call or a loop, and from where it arrives
            leaves = self.leaves[np.searchsorted(self.leaves, start) :][:1].tolist()
            arrive = self.enters[: np.searchsorted(self.enters, end)][-1:].tolist()
            stop = leaves[0] if leaves else len(self.lines) + 1
            return [(start, end)] if start <= end <= stop else [(start, stop), (arrive[0] if arrive else 0, end)]
        first, stop = np.searchsorted(self.jump_moves, [last + 1, move + 1]).tolist()
        stretches = []
        for jump in self.jumps[first:stop]:
            stretches.append((start, jump.left))
            start = jump.after
        return [*stretches, (start, end)]


def _beginnings(
    way: _Way, moves: Moves, cuts: IntArray, heads: list[Heading], most: float = np.inf
) -> list[_Beginning]:
    """One for every cut before which a heading is passed or the tool changes, and one for the first cut.

    None at all if there are more than `most`.
    """
    seen = _headings_passed(way, heads)
    changes = set((np.flatnonzero(np.diff(moves.tool) != 0) + 1).tolist())
    events = sorted(changes.union(seen))
    next_cut = np.searchsorted(cuts, events)
    tool = int(moves.tool[cuts[0]])
    change = _tool_change(way.lines, way.passed(-1, int(cuts[0]))) if tool else None
    begins = [_Beginning(0, [], tool, change)]
    # Cuts (rows of `cuts`) that the running operation, and what stands before the next cut, begin with.
    current = gap = 0
    known: set[int] = set()  # headings passed where the running operation began: passed again, they begin none
    before, passed = known, set[int]()
    for event, ordinal in zip(events, next_cut.tolist(), strict=True):
        if ordinal == len(cuts):
            break  # nothing is cut after it
        if len(begins) > most:
            return []
        rows = seen.get(event, [])
        if ordinal != gap:
            gap, before, passed = ordinal, known, set()
        passed.update(rows)
        fresh = [heads[row] for row in rows if row not in before]
        if ordinal == current:
            begins[-1].heads += fresh
            known = passed
            continue
        tool, last = int(moves.tool[cuts[ordinal]]), int(moves.tool[cuts[ordinal - 1]])
        if not fresh and tool == last:
            continue
        stretches = [] if tool == last else way.passed(int(cuts[ordinal - 1]), int(cuts[ordinal]))
        change = _tool_change(way.lines, stretches) if stretches else None
        begins.append(_Beginning(event, fresh, tool, change))
        current, known = ordinal, passed
    return begins if len(begins) <= most else []


def _headings_passed(way: _Way, heads: list[Heading]) -> dict[int, Sequence[int]]:
    """Move -> headings (rows of `heads`) passed right before it."""
    lines = np.array([head.line for head in heads], dtype=np.int64)
    seen: dict[int, Sequence[int]] = {}
    below, odd = np.searchsorted(lines, way.line, side="right"), way.turns()
    straight = np.flatnonzero(~odd & (np.diff(below) != 0))
    for move, low, high in zip(straight.tolist(), below[straight].tolist(), below[straight + 1].tolist(), strict=True):
        seen[move] = range(low, high)
    for move in np.flatnonzero(odd).tolist() if heads else ():
        spans = [np.searchsorted(lines, ends, side="right").tolist() for ends in way.passed(move - 1, move)]
        between = [row for low, high in spans for row in range(low, high)]
        if between:
            seen[move] = between
    return seen


def _tool_change(lines: Sequence[str], stretches: list[tuple[int, int]]) -> tuple[int, str]:
    """Line of the first tool change in some stretches of lines, and the comment beside the last one that has any."""
    first, remark = 0, ""
    for low, high in stretches:
        for number, words in enumerate(lines[low:high], low + 1):
            code, comment = split_comments(words)
            if CHANGES_TOOL.search(code):
                first = first or number
                remark = plain_name(comment) or remark
    return first or stretches[-1][1], remark


def _name(begin: _Beginning, title: str, remarks: dict[int, str], alone: bool) -> str:
    """The name: what the post marks, else the first heading, else the tool; of a lone one rather the title, or ""."""
    names: dict[str, list[str]] = {MARKED: [], NAMED: [], TOOL: []}
    for head in begin.heads:
        names[head.kind].append(head.name)
    if names[MARKED]:
        return names[MARKED][-1]
    if names[NAMED]:
        return names[NAMED][0]
    if alone and title:
        return title
    about = (begin.change[1] if begin.change else "") or "".join(names[TOOL][:1]) or remarks.get(begin.tool, "")
    number = f"T{begin.tool}"
    if about:
        return about if about.upper().startswith(number) else f"{number} {about}"
    return title if not begin.tool else "" if alone else number
