"""The moves of an NC program, one row per move, in SI units; and the recorder that collects them while reading.

This is what the reader hands on: geometry with its line, feed and tool; no machine, no sampling.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import chain
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import ArrayColumns, BoolArray, FloatArray, IntArray
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.poses import Pose
from toolpath_stiff.units import (
    deg_from_rad,
    m_from_mm,
    m_per_s_from_mm_per_min,
    mm_from_m,
    mm_per_min_from_m_per_s,
    rad_from_deg,
    rad_per_s_from_deg_per_min,
    rad_per_s_from_per_min,
)

RAPID, FEED, ARC, CYCLE = 0, 1, 2, 3
CUTTER_LOCATION = "cutter-location file"
Blank = tuple[tuple[float, float, float], tuple[float, float, float]]
MOTION_NAMES = ("rapid", "feed", "arc", "cycle")
PACKED_AT = 20_000  # recent moves; a move in arrays takes 260 bytes, before 490 (tracemalloc, straight moves)
NARROW = {"line": np.int32, "motion": np.int8}  # whole numbers that a long program has many of
KINDS = {**dict.fromkeys(("line", "motion", "tool"), np.int64), "from_machine": np.bool_}  # other columns: float
WIDE = {"start": (6,), "end": (6,), "arc_center": (3,), "arc_normal": (3,), "from_machine": (2,)}
HELD = ("tool", "tool_length", "spindle")  # columns with a single value in most programs


@dataclass(frozen=True, repr=False)
class Moves(ArrayColumns):
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
    spindle
        (n,) rad/s, clockwise seen from behind the spindle (M3) above 0, M4 below; 0: it stands, or nothing is said;
        nan: not known (constant surface speed).
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
    spindle: FloatArray
    from_machine: BoolArray

    def __len__(self) -> int:
        return len(self.line)

    def __repr__(self) -> str:
        lines = f" of the lines {self.line.min()} to {self.line.max()}" if len(self) else ""
        return f"<Moves: {len(self)} moves{lines}>"


def move_columns(moves: Moves) -> dict[str, NDArray[Any]]:
    """Column -> values of a table of moves in the shop's units; arcs have their signed angle, others 0."""
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
    """A departure from the order of lines: moves before it, the line left, the line after which the run continues."""

    moves: int
    left: int
    after: int


@dataclass(frozen=True)
class Remark:
    """Something to check: a sentence, and the line of the program that it concerns, 0 for the whole."""

    text: str
    line: int = 0

    def __str__(self) -> str:
        return f"line {self.line}: {self.text}" if self.line else self.text


@dataclass(frozen=True)
class Unsupported:
    """A word of the program that was read, is harmless to the path, and was not acted upon."""

    line: int
    column: int
    word: str
    reason: str


@dataclass(frozen=True, repr=False)
class ReadProgram:
    r"""A program read to its end.

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
        The tools that the program used, lengths in mm.
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
    stock
        (2, 3) m, smallest and largest corner of the blank in the set-up frame; None where the program says none.

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
    source: Sequence[str]
    moves: Moves
    origin: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    origin_source: str = "default"
    unsupported: tuple[Unsupported, ...] = ()
    warnings: tuple[Remark, ...] = ()
    assumptions: tuple[str, ...] = ()
    tools: tuple[ToolEntry, ...] = ()
    interpreter: str = "builtin"
    dialect: str = "generic"
    kinematics: str = ""
    marks: tuple[tuple[int, str], ...] | None = None
    jumps: tuple[Jump, ...] = ()
    parametric: bool = False
    stock: Blank | None = None

    @property
    def native(self) -> bool:
        """True if words A, B, C are those of the machine that it runs on, not recovered from another's."""
        return not self.kinematics and self.dialect != CUTTER_LOCATION

    def __repr__(self) -> str:
        return f"<ReadProgram {self.name}: {len(self.moves)} moves, read as {self.dialect}>"


@dataclass(frozen=True)
class Arc:
    """An arc of a move: centre (set-up frame, mm), unit normal, signed sweep (rad)."""

    center: tuple[float, float, float]
    normal: tuple[float, float, float]
    sweep: float


NO_ARC = Arc((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)


@dataclass(slots=True)
class Move:
    """A move as it is recorded, as in `Moves` but in mm, degrees, mm/min (deg/min of the rotary axes alone), 1/min."""

    line: int
    motion: int
    start: list[float]
    end: list[float]
    feed: float
    tool: int
    tool_length: float
    spindle: float
    from_machine: tuple[bool, bool]
    arc: Arc | None = None
    dwell: float = 0.0


ENTRIES = tuple(entry.name for entry in fields(Move))


@dataclass
class Recorder:
    """Collector of moves; a move without length in any axis does not count. `recent`: moves not yet in `columns`."""

    recent: list[Move] = field(default_factory=list)
    columns: dict[str, NDArray[Any]] = field(default_factory=dict)  # columns of `Moves`, longer than their content
    cuts: bool = False  # whether any move is a cutting one
    packed: int = 0  # number of moves in `columns`

    def __len__(self) -> int:
        return len(self.recent) + self.packed

    def add(self, move: Move) -> bool:
        """Add a move. Returns True if it has any length."""
        if move.start == move.end and move.arc is None:
            return False
        if move.motion == RAPID:
            move.feed = math.nan
        else:
            self.cuts = True
        self.recent.append(move)
        return True

    def drop(self, row: int) -> None:
        """Remove one of the recent moves; its pause goes to the move before."""
        pause = self.recent.pop(row).dwell
        if row:
            self.recent[row - 1].dwell += pause
        elif self.packed:
            self.columns["dwell"][self.packed - 1] += pause

    def add_many(self, moves: Moves) -> None:
        """Add moves at once, each of nonzero length; units as for `Move`."""
        if not len(moves):
            return
        self.pack()
        self._keep(in_si(moves))
        self.cuts = self.cuts or bool((moves.motion != RAPID).any())

    def pack(self, beyond: int = 0) -> None:
        """Move the recent moves, if there are more than `beyond`, into arrays, which take a fifth of the memory."""
        if len(self.recent) > beyond:
            self._keep(self._recent_in_si())
            self.recent = []

    def _keep(self, moves: Moves) -> None:
        """Append moves in SI to the columns, which grow in place: a long program is in memory only once."""
        first, self.packed = self.packed, self.packed + len(moves)
        for column in fields(Moves):
            new = getattr(moves, column.name)
            kept = self.columns.setdefault(column.name, new[:0].astype(NARROW.get(column.name, new.dtype)))
            if len(kept) < self.packed:
                kept.resize((self.packed + self.packed // 4, *new.shape[1:]), refcheck=False)
            kept[first : self.packed] = new

    def add_dwell(self, seconds: float) -> None:
        """Add a pause after the last move; before the first move it is ignored."""
        if self.recent:
            self.recent[-1].dwell += seconds
        elif self.packed:
            self.columns["dwell"][self.packed - 1] += seconds

    def moves(self) -> Moves:
        """Moves as arrays, SI; the recorder is empty afterwards."""
        self._keep(self._recent_in_si())
        columns, n = self.columns, self.packed
        self.recent, self.columns, self.packed = [], {}, 0
        for name, column in columns.items():
            column.resize((n, *column.shape[1:]), refcheck=False)
            if not column.any():  # pages never written to take no memory
                columns[name] = np.zeros(column.shape, column.dtype)
        start, end = columns["start"], columns["end"]
        if n and np.array_equal(start[1:].view(np.int64), end[:-1].view(np.int64)):  # without gaps: each point once
            points = np.concatenate([start[:1], end])
            columns |= {"start": points[:-1], "end": points[1:]}
        return Moves(**columns | {name: held_once(columns[name]) for name in HELD})

    def _recent_in_si(self) -> Moves:
        rows: dict[str, Sequence[Any]] = dict(
            zip(ENTRIES, zip(*map(attrgetter(*ENTRIES), self.recent), strict=True), strict=False)
        )
        arcs = [arc or NO_ARC for arc in rows.pop("arc", ())]
        for name in ("sweep", "center", "normal"):
            rows[f"arc_{name}"] = [getattr(arc, name) for arc in arcs]
        columns: dict[str, NDArray[Any]] = {}
        for name in (column.name for column in fields(Moves)):
            wide, kind, values = WIDE.get(name, ()), KINDS.get(name, float), rows.get(name, ())
            flat = list(chain.from_iterable(values)) if wide else values
            columns[name] = np.array(flat, kind).reshape(-1, *wide)
        return in_si(Moves(**columns))


def in_si(moves: Moves) -> Moves:
    """Moves in SI, from columns in the units of `Move`."""
    start, end = (
        np.concatenate([m_from_mm(ends[:, :3]), rad_from_deg(ends[:, 3:])], axis=1) for ends in (moves.start, moves.end)
    )
    # If only rotary axes move, the feed is in degrees per minute.
    rotary = np.logical_and.reduce([start[:, axis] == end[:, axis] for axis in range(3)]) & (moves.arc_sweep == 0.0)
    return replace(
        moves,
        start=start,
        end=end,
        arc_center=m_from_mm(moves.arc_center),
        feed=np.where(rotary, rad_per_s_from_deg_per_min(moves.feed), m_per_s_from_mm_per_min(moves.feed)),
        tool_length=m_from_mm(moves.tool_length),
        spindle=rad_per_s_from_per_min(moves.spindle),
    )


def held_once(column: NDArray[Any]) -> NDArray[Any]:
    """Column (n,); if it has one value (nan counts as one), a read-only view of that: most programs have one tool."""
    alike = len(column) > 0 and np.array_equal(column, np.broadcast_to(column[0], column.shape), equal_nan=True)
    return np.broadcast_to(column[0], column.shape) if alike else column
