"""The moves of an NC program, one row a move, in SI units; and the recorder that collects them while reading.

This is what the reader hands on: geometry with its line, feed and tool; no machine, no sampling.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.units import (
    Pose,
    deg_from_rad,
    m_from_mm,
    m_per_s_from_mm_per_min,
    mm_from_m,
    mm_per_min_from_m_per_s,
    rad_from_deg,
    rad_per_s_from_deg_per_min,
)

RAPID, FEED, ARC, CYCLE = 0, 1, 2, 3
CUTTER_LOCATION = "cutter-location file"
MOTION_NAMES = ("rapid", "feed", "arc", "cycle")


@dataclass(frozen=True, repr=False)
class Moves:
    r"""Columns over n moves, in the set-up frame (program zero of G54 at the origin) unless placed.

    A move of zero length in all six axes is not a move and has no row. `start[i]` is `end[i - 1]`,
    except where a coordinate system changed in between (then the tool stands still, the numbers change).

    Attributes
    ----------
    line
        (n,) line of the program, from 1, that asked for the move.
    motion
        (n,) RAPID, FEED, ARC or CYCLE; rapids within a canned cycle are RAPID, its feeds CYCLE.
    start, end
        (n, 6) tool-tip position x, y, z in m and rotary words a, b, c in rad as programmed
        (interpolated linearly along the move, as a control does).
    arc_sweep
        (n,) rad, the signed angle of an arc about `arc_normal` (right hand), turns included; 0: not an arc.
    arc_center
        (n, 3) m, centre of the arc in the plane of its start; 0 where there is no arc. A helix climbs
        along `arc_normal`; radii of start and end that differ within tolerance are interpolated.
    arc_normal
        (n, 3) unit vector; 0 where there is no arc.
    feed
        (n,) m/s along the path (rad/s for a move of the rotary axes alone); nan for rapids.
    dwell
        (n,) s, the pause after the move (G4 and the dwell of a cycle).
    tool
        (n,) tool number in the spindle (T with M6), 0 for none.
    tool_length
        (n,) m, the length in force through G43; nan: the machine's reference tool.
    from_machine
        (n, 2) whether start, end were given in machine coordinates (G53, G28, G30): these ends do
        not follow the work when it is placed elsewhere.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> moves = parse_program("G21 G90 F600\nG0 Z5\nG1 Z-1\nX40\nM30\n").moves
    >>> moves
    <Moves: 3 moves of the lines 2 to 4>
    >>> [MOTION_NAMES[motion] for motion in moves.motion]
    ['rapid', 'feed', 'feed']
    >>> moves.end[-1, :3].tolist()  # m
    [0.04, 0.0, -0.001]
    """

    line: IntArray
    motion: IntArray
    start: FloatArray
    end: FloatArray
    arc_sweep: FloatArray
    arc_center: FloatArray
    arc_normal: FloatArray
    feed: FloatArray
    dwell: FloatArray
    tool: IntArray
    tool_length: FloatArray
    from_machine: BoolArray

    def __len__(self) -> int:
        return len(self.line)

    def __repr__(self) -> str:
        lines = f" of the lines {self.line.min()} to {self.line.max()}" if len(self) else ""
        return f"<Moves: {len(self)} moves{lines}>"

    def take(self, index: IntArray | BoolArray | slice) -> Moves:
        """The moves at `index` (integers, a mask or a slice)."""
        return Moves(**{f.name: getattr(self, f.name)[index] for f in fields(self)})


def move_columns(moves: Moves) -> dict[str, NDArray[Any]]:
    """Column -> values of a table of moves in the shop's units; arcs have their signed angle, else it is 0."""
    columns: dict[str, NDArray[Any]] = {
        "line": moves.line,
        "motion": np.array(MOTION_NAMES)[moves.motion],
        "tool": moves.tool,
    }
    for name, ends in (("start", moves.start), ("end", moves.end)):
        columns |= {f"{name}_{axis}_mm": mm_from_m(ends[:, i]) for i, axis in enumerate("xyz")}
        columns |= {f"{name}_{axis}_deg": deg_from_rad(ends[:, i]) for i, axis in enumerate("abc", 3)}
    columns["arc_deg"] = deg_from_rad(moves.arc_sweep)
    columns["feed_mm_per_min"] = mm_per_min_from_m_per_s(moves.feed)
    return {**columns, "dwell_s": moves.dwell}


class Jump(NamedTuple):
    """A run that leaves the order of the lines: moves before it, the line left, the line after which it goes on."""

    moves: int
    left: int
    after: int


@dataclass(frozen=True)
class Unsupported:
    """A word of the program that was read, is harmless to the path, and was not acted upon."""

    line: int
    column: int
    word: str
    reason: str


@dataclass(frozen=True)
class ToolUse:
    """A tool of the tool table: number; length, diameter, stick-out in m (nan: not given); remark, material."""

    number: int
    length: float
    diameter: float
    remark: str = ""
    stick_out: float = math.nan
    material: str = ""


@dataclass(frozen=True, repr=False)
class ReadProgram:
    r"""A program that was read to its end.

    Attributes
    ----------
    name
        File name without its folder, for headings.
    path
        Where it was read from ("" for text).
    source
        The program's lines as they stand in the file, without line ends.
    moves
        The moves in the set-up frame.
    origin
        Where program zero (G54) sits in machine coordinates: x, y, z in m, A, B, C in rad. The moves do
        not depend on it, except those that were given in machine coordinates.
    origin_source
        Where that comes from: "option" (the caller), "program" (`G10 L2 P1` or an offsets file) or "default".
    unsupported, warnings, assumptions
        What was read but not acted upon; what should be checked; what was assumed; each one sentence.
    tools
        The tools that the program used.
    interpreter
        Who read it: "builtin" or "linuxcnc".
    dialect
        How it was read: "generic", "linuxcnc", "fanuc", "haas", or one of them as a controller file changes it;
        `CUTTER_LOCATION` for a cutter-location file.
    kinematics
        The kinematics that it was posted for ("table-table A C"), from which the moves were recovered; "": A, B, C are
        roll, pitch, yaw of the platform.
    marks
        (line, name) where operations begin, ascending, in a language that marks them otherwise than by comment
        lines; None: the comment lines of `source` mark them.
    jumps
        Where the run left the order of the lines, for a subprogram or back from it.
    parametric
        Whether variables, expressions or loops made the moves.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> program = parse_program("G21 G90 F600\nG1 X40\nM30\n", "slot.nc")
    >>> program.name, len(program.moves), program.dialect
    ('slot.nc', 1, 'generic')
    >>> program.assumptions
    ('before its first move the tool stands at 0, 0, 0 of the control, as LinuxCNC assumes',)
    """

    name: str
    path: str
    source: tuple[str, ...]
    moves: Moves
    origin: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    origin_source: str = "default"
    unsupported: tuple[Unsupported, ...] = ()
    warnings: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
    tools: tuple[ToolUse, ...] = field(default=())
    interpreter: str = "builtin"
    dialect: str = "generic"
    kinematics: str = ""
    marks: tuple[tuple[int, str], ...] | None = None
    jumps: tuple[Jump, ...] = ()
    parametric: bool = False

    def __repr__(self) -> str:
        return f"<ReadProgram {self.name}: {len(self.moves)} moves, read as {self.dialect}>"


@dataclass(frozen=True)
class Arc:
    """An arc of a move: centre (set-up frame, mm), unit normal, signed sweep (rad)."""

    center: tuple[float, float, float]
    normal: tuple[float, float, float]
    sweep: float


@dataclass(frozen=True)
class Arcs:
    """Columns over m arcs of some moves: their rows, ascending; the rest as of `Arc`."""

    rows: IntArray
    center: FloatArray
    normal: FloatArray
    sweep: FloatArray

    @staticmethod
    def of(arcs: Mapping[int, Arc]) -> Arcs:
        """Columns of arcs that are given by their rows."""
        columns = (
            zip(*((arc.center, arc.normal, arc.sweep) for arc in arcs.values()), strict=True) if arcs else ((),) * 3
        )
        center, normal, sweep = (np.array(column, dtype=float) for column in columns)
        return Arcs(np.array(list(arcs), dtype=np.int64), center.reshape(-1, 3), normal.reshape(-1, 3), sweep)

    def by_row(self) -> dict[int, Arc]:
        """One by one."""
        columns = (self.rows.tolist(), self.center.tolist(), self.normal.tolist(), self.sweep.tolist())
        return {
            row: Arc((x, y, z), (i, j, k), sweep) for row, (x, y, z), (i, j, k), sweep in zip(*columns, strict=True)
        }


@dataclass(frozen=True)
class MovesInMm:
    """Columns over n moves, as in `Moves` but in mm, degrees, mm/min (deg/min of the rotary axes alone)."""

    line: IntArray
    motion: IntArray
    start: FloatArray
    end: FloatArray
    feed: FloatArray
    dwell: FloatArray
    tool: IntArray
    tool_length: FloatArray
    from_machine: BoolArray
    arcs: Arcs

    def __len__(self) -> int:
        return len(self.line)


# Columns that the recorder collects: kind, and shape of one of them.
COLUMNS: dict[str, tuple[str, tuple[int, ...]]] = {
    **dict.fromkeys(("line", "motion", "tool"), ("i8", ())),
    **dict.fromkeys(("start", "end"), ("f8", (6,))),
    **dict.fromkeys(("feed", "dwell", "tool_length"), ("f8", ())),
    "from_machine": ("?", (2,)),
}


@dataclass
class Recorder:
    """Collects moves; a move of no length in any axis is none. The lists hold those since the last of `parts`."""

    line: list[int] = field(default_factory=list)
    motion: list[int] = field(default_factory=list)
    start: list[list[float]] = field(default_factory=list)
    end: list[list[float]] = field(default_factory=list)
    arc: list[Arc | None] = field(default_factory=list)
    feed: list[float] = field(default_factory=list)
    dwell: list[float] = field(default_factory=list)
    tool: list[int] = field(default_factory=list)
    tool_length: list[float] = field(default_factory=list)
    from_machine: list[tuple[bool, bool]] = field(default_factory=list)
    parts: list[MovesInMm] = field(default_factory=list)
    cuts: bool = False  # whether any move is a cutting one

    def __len__(self) -> int:
        return len(self.line) + sum(len(part) for part in self.parts)

    def add(
        self,
        line: int,
        motion: int,
        start: list[float],
        end: list[float],
        feed: float,
        tool: int,
        tool_length: float,
        from_machine: tuple[bool, bool],
        arc: Arc | None = None,
    ) -> bool:
        """Add a move (mm, degrees; feed in mm/min or deg/min). Returns whether it was one."""
        if start == end and arc is None:
            return False
        self.line.append(line)
        self.motion.append(motion)
        self.start.append(start)
        self.end.append(end)
        self.arc.append(arc)
        self.feed.append(math.nan if motion == RAPID else feed)
        self.dwell.append(0.0)
        self.tool.append(tool)
        self.tool_length.append(tool_length)
        self.from_machine.append(from_machine)
        self.cuts = self.cuts or motion != RAPID
        return True

    def drop(self, row: int) -> None:
        """Take a move out of the lists, that of its place there; its pause goes to the one before it."""
        pause = self.dwell[row]
        for column in self._lists.values():
            del column[row]
        if row:
            self.dwell[row - 1] += pause
        elif self.parts:
            self.parts[-1].dwell[-1] += pause

    @property
    def _lists(self) -> dict[str, list[Any]]:
        return {name: getattr(self, name) for name in (*COLUMNS, "arc")}

    def add_many(self, moves: MovesInMm) -> None:
        """Add moves at once, each of some length."""
        if not len(moves):
            return
        self.pack()
        self.parts.append(moves)
        self.cuts = self.cuts or bool((moves.motion != RAPID).any())

    def pack(self) -> None:
        """The lists to arrays, which take a fifth of their memory."""
        if self.line:
            self.parts.append(self._close())

    def add_dwell(self, seconds: float) -> None:
        """A pause after the last move; before the first move nothing waits."""
        if self.dwell:
            self.dwell[-1] += seconds
        elif self.parts:
            self.parts[-1].dwell[-1] += seconds

    def moves(self) -> Moves:
        """The moves as arrays, SI; the recorder is empty afterwards."""
        self.parts.append(self._close())
        parts, self.parts = self.parts[::-1], []
        return _joined(parts)

    def _close(self) -> MovesInMm:
        """The lists as a part; they are empty afterwards."""
        arcs, n = {row: arc for row, arc in enumerate(self.arc) if arc is not None}, len(self.line)
        arrays = {name: np.array(getattr(self, name), kind).reshape(n, *wide) for name, (kind, wide) in COLUMNS.items()}
        for column in self._lists.values():
            column.clear()
        return MovesInMm(**arrays, arcs=Arcs.of(arcs))


def _joined(parts: list[MovesInMm]) -> Moves:
    """All parts, the last one first, in SI; each is let go once it is copied, so that no move is held twice."""
    n, first = sum(len(part) for part in parts), 0
    # Pages of zeros that nobody writes to take no memory.
    zeros: dict[str, NDArray[Any]] = {name: np.zeros((n, *wide), kind) for name, (kind, wide) in COLUMNS.items()}
    moves = Moves(**zeros, arc_sweep=np.zeros(n), arc_center=np.zeros((n, 3)), arc_normal=np.zeros((n, 3)))
    while parts:
        part = parts.pop()
        _copy(part, moves.take(slice(first, first + len(part))))
        first += len(part)
    return replace(moves, tool=held_once(moves.tool), tool_length=held_once(moves.tool_length))


def held_once(column: NDArray[Any]) -> NDArray[Any]:
    """A column (n,); of one value, nan counts as one, a read-only view of that: most programs have one tool."""
    alike = len(column) > 0 and np.array_equal(column, np.broadcast_to(column[0], column.shape), equal_nan=True)
    return np.broadcast_to(column[0], column.shape) if alike else column


def _copy(part: MovesInMm, into: Moves) -> None:
    """Copy a part into rows of moves, to SI."""
    for mm, si in ((part.start, into.start), (part.end, into.end)):
        si[:, :3] = m_from_mm(mm[:, :3])
        si[:, 3:] = rad_from_deg(mm[:, 3:])
    rows = part.arcs.rows
    into.arc_sweep[rows] = part.arcs.sweep
    into.arc_center[rows] = m_from_mm(part.arcs.center)
    into.arc_normal[rows] = part.arcs.normal
    # The feed of a move of the rotary axes alone is in degrees per minute.
    rotary = np.logical_and.reduce([into.start[:, axis] == into.end[:, axis] for axis in range(3)])
    rotary[rows] = False
    into.feed[:] = m_per_s_from_mm_per_min(part.feed)
    into.feed[rotary] = rad_per_s_from_deg_per_min(part.feed[rotary])
    into.feed[part.motion == RAPID] = math.nan
    into.line[:], into.motion[:] = part.line, part.motion
    into.tool[:], into.tool_length[:] = part.tool, m_from_mm(part.tool_length)
    for given, zeros in ((part.dwell, into.dwell), (part.from_machine, into.from_machine)):
        if given.any():
            zeros[:] = given
