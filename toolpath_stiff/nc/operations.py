"""Operations of a program: moves that belong together, and their names.

An operation begins at a tool change, and at a block of comment lines, if cutting follows before the next one. Between
two cuts there is one beginning at most: tool change, comments and rapids between them belong to what follows, rapids
before the first of these to what went before. An operation always cuts. docs/nc.md has the whole rule.

What posts write as headings was looked up in published programs: of Fusion 360 (one line before each operation; tools,
notes on the licence in the header), FreeCAD (`begin operation: NAME`, `finish operation: NAME`), Mastercam (tool and
name in one block), Vectric (`Toolpath:- NAME` between lines of dashes), Estlcam, CamBam, jscut, Gcodetools, bCNC,
pcb2gcode, and five-axis demos of LinuxCNC.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from toolpath_stiff.arrays import IntArray
from toolpath_stiff.nc.moves import RAPID, ReadProgram

NAMED, MARKED, TOOL = "named", "marked", "tool"

COMMENTS = re.compile(r"\(([^()]*)\)?|;(.*)")
NO_WORDS = re.compile(r"\s*+(?:N\s*+\d++\s*+)?", re.IGNORECASE)  # a line number is not a word
BEGINS = re.compile(r"\s*+(?:N\s*+\d++\s*+)?[(;]", re.IGNORECASE)
ACTIVE = re.compile(r"\s*(?:MSG|DEBUG|PRINT)\s*,", re.IGNORECASE)  # LinuxCNC shows what follows
FRAME, DASHES = " *=#~|'\"", "-_."  # dashes and points frame only if two or more: -X SIDE, .5 CHAMFER
MARK = re.compile(
    r"(?:(?:begin|start)\s+(?:of\s+)?(?:operation|section|toolpath|cutting\s+path\s+id)|tool\s?path(?:\s+name)?"
    r"|operation(?:\s+name)?|block-name)\s*(?::-?|=)\s*(?=.*\w)",
    re.IGNORECASE,
)
FIELD = re.compile(r"(?:name|type)\s*:\s*(?=.*\w)", re.IGNORECASE)  # after `Operation: 0`
TOOL_LINE = re.compile(r"(?:T\s*\d+|tools?|change\s+(?:to\s+)?tool)\b|.*\btool\s*-\s*\d", re.IGNORECASE)
TOOL_NUMBERS = re.compile(r"\s*\btool\s*-\s*\d+\s*|\s*\b(?:tool\s+)?dia\.\s*off\..*$", re.IGNORECASE)
# No headings: ends of things, states of a post, single moves, licence notes, commented-out code.
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
FROM_HERE_NOTES = re.compile(r"when\s+using\s+fusion\b", re.IGNORECASE)  # the rest of its block belongs to the sentence


class Heading(NamedTuple):
    """A block of comment lines: its first line, its name, and what the name is: NAMED, MARKED (by the post) or TOOL."""

    line: int
    name: str
    kind: str


def split_comments(text: str) -> tuple[str, str]:
    """The code of a line and its comments, joined."""
    return COMMENTS.sub(" ", text), " ".join(first or second for first, second in COMMENTS.findall(text))


def headings(lines: Sequence[str]) -> list[Heading]:
    """Blocks of successive lines with comments only, in order; blocks that name nothing are left out.

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
    """Heading of a block of comments: the post's mark, otherwise the first line with letters, otherwise a tool."""
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
    """Comment without its frame of blanks, asterisks, dashes; of `MSG, text` only the text."""
    active = ACTIVE.match(comment)
    text = " ".join((comment[active.end() :] if active else comment).split())
    inside = text.lstrip(FRAME + DASHES)
    text = _last_dash(text[: len(text) - len(inside)]) + inside
    inside = text.rstrip(FRAME + DASHES)
    return inside + _last_dash(text[len(inside) :][::-1])


def _last_dash(frame: str) -> str:
    """Dash or point next to the text, if single: it belongs to the text."""
    return frame[-1:] if frame and frame[-1] in DASHES and frame[-2:-1] not in tuple(DASHES) else ""


MOST_OPERATIONS = 1000  # if there are more, comments name passes or moves: tools define the operations
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
    """All operations of a program, and `of_move` (n,): the row of each move's operation, ascending."""

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
    moves, marks = program.moves, program.marks
    cuts = np.flatnonzero(moves.motion != RAPID)
    if not len(cuts):
        return Operations((), np.zeros(len(moves), dtype=np.int64))
    title, heads = "", [Heading(*mark, MARKED) for mark in marks or ()]
    if marks is None:
        title, heads = _title_and_headings(program.source)
    begins = _beginnings(program, cuts, heads)
    first = [begin.move for begin in begins]
    remarks = {tool.number: tool.remark for tool in program.tools}
    names = [_name(begin, title, remarks, alone=len(begins) == 1) or program.name for begin in begins]
    of_move = np.repeat(np.arange(len(first)), np.diff([*first, len(moves)]))
    low, high = np.minimum.reduceat(moves.line, first), np.maximum.reduceat(moves.line, first)
    rows = [
        Operation(i + 1, names[i], min(int(low[i]), begin.line), int(high[i]), begin.tool, begin.move)
        for i, begin in enumerate(begins)
    ]
    return Operations(tuple(rows), of_move.astype(np.int64))


@dataclass
class _Beginning:
    """Gap between two cuts: the first move after it, headings passed, the cutting tool, its tool change."""

    move: int
    heads: list[Heading]
    tool: int
    change: tuple[int, str] | None  # line and comment

    @property
    def line(self) -> int:
        """Line of its heading or tool change; the largest possible number without either."""
        lines = [head.line for head in self.heads] + ([self.change[0]] if self.change else [])
        return min(lines, default=np.iinfo(np.int64).max)


def _title_and_headings(lines: Sequence[str]) -> tuple[str, list[Heading]]:
    """Title of the program, and headings of its operations.

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
    if len(marked) > 1:  # if a post marks operations, its other comments are something else
        return title, marked
    return title, [head for head in every if head.line > header_end or head.kind == MARKED]


class _Way:
    """Lines and headings that a run passes between two moves."""

    def __init__(self, program: ReadProgram, heads: Sequence[Heading]) -> None:
        self.jumps = program.jumps
        self.line = np.concatenate([[0], program.moves.line])  # the line of move i is at i + 1
        self.jump_moves = np.array([jump.moves for jump in self.jumps], dtype=np.int64)
        self.head_lines = np.array([head.line for head in heads], dtype=np.int64)

    def stretches(self, last: int, move: int) -> list[tuple[int, int]]:
        """Stretches of lines from move `last` (-1: file start) to a later one; first line excluded, last included."""
        stretches, start = [], int(self.line[last + 1])
        first, stop = np.searchsorted(self.jump_moves, [last + 1, move + 1]).tolist()
        for jump in self.jumps[first:stop]:
            stretches.append((start, jump.left))
            start = jump.after
        return [*stretches, (start, int(self.line[move + 1]))]

    def headings(self, last: int, move: int) -> list[int]:
        """Rows of the headings, in order of the run."""
        ends = np.searchsorted(self.head_lines, self.stretches(last, move), side="right").tolist()
        return [row for low, high in ends for row in range(low, high)]

    def events(self, moves: IntArray) -> IntArray:
        """Number of headings above the lines of moves and of jumps before them: if it stays, no heading is passed."""
        above = np.searchsorted(self.head_lines, self.line[moves + 1], side="right")
        return np.stack([above, np.searchsorted(self.jump_moves, moves + 1)])


def _beginnings(program: ReadProgram, cuts: IntArray, heads: list[Heading]) -> list[_Beginning]:
    """Beginnings: at the first cut, and at every cut before which a heading is passed or the tool changes."""
    way, tools, before_cuts = _Way(program, heads), program.moves.tool, np.array([-1, *cuts[:-1]])
    eventful = (way.events(before_cuts) != way.events(cuts)).any(axis=0) | (tools[before_cuts] != tools[cuts])
    eventful[0] = True
    begins: list[_Beginning] = []
    known: set[int] = set()  # headings passed where the present operation began: passing them again begins none
    for last, cut in zip(before_cuts[eventful].tolist(), cuts[eventful].tolist(), strict=True):
        if heads and len(begins) > MOST_OPERATIONS:
            return _beginnings(program, cuts, [])
        passed, tool = way.headings(last, cut), int(tools[cut])
        fresh = [row for row in dict.fromkeys(passed) if row not in known]
        another = tool != (0 if last < 0 else tools[last])
        if last >= 0 and not fresh and not another:
            continue
        first = 0
        if last >= 0:
            gap = range(last + 1, cut + 1)
            first = next(m for m in gap if tools[m] != tools[m - 1] or {*fresh} & {*way.headings(m - 1, m)})
        change = _tool_change(program.source, way.stretches(last, cut)) if another else None
        begins.append(_Beginning(first, [heads[row] for row in fresh], tool, change))
        known = set(passed)
    return begins


def _tool_change(lines: Sequence[str], stretches: list[tuple[int, int]]) -> tuple[int, str]:
    """Line of the first tool change in some stretches of lines, and the comment beside the last one with any."""
    first, remark = 0, ""
    for low, high in stretches:
        for number, words in enumerate(lines[low:high], low + 1):
            code, comment = split_comments(words)
            if CHANGES_TOOL.search(code):
                first = first or number
                remark = plain_name(comment) or remark
    return first or stretches[-1][1], remark


def _name(begin: _Beginning, title: str, remarks: dict[int, str], alone: bool) -> str:
    """Name: the post's mark, otherwise the first heading, otherwise the tool; a lone operation has the title, or ""."""
    names = {kind: [head.name for head in begin.heads if head.kind == kind] for kind in (MARKED, NAMED, TOOL)}
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
