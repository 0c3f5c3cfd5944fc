"""Moves as they are found, one by one or many at a time; one conversion to SI arrays at the end."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from toolpath_stiff.nc.moves import RAPID, Moves
from toolpath_stiff.units import m_from_mm, m_per_s_from_mm_per_min, rad_from_deg

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]
    BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Arc:
    """An arc of a move: centre (set-up frame, mm), unit normal, signed sweep (rad)."""

    center: tuple[float, float, float]
    normal: tuple[float, float, float]
    sweep: float


@dataclass(frozen=True)
class MovesInMm:
    """Columns over n moves, as in `Moves` but in mm, degrees, mm/min (deg/min of the rotary axes alone).

    `arcs` are the arcs in order, `arc_rows` their rows.
    """

    line: IntArray
    motion: IntArray
    start: FloatArray
    end: FloatArray
    arc_rows: list[int]
    arcs: list[Arc]
    feed: FloatArray
    dwell: FloatArray
    tool: IntArray
    tool_length: FloatArray
    from_machine: BoolArray

    def __len__(self) -> int:
        return len(self.line)


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
        """The moves as arrays, SI; they are thereby taken."""
        self.parts.append(self._close())
        parts, self.parts = self.parts[::-1], []
        return _joined(parts)

    def _close(self) -> MovesInMm:
        """The lists as a part; they are empty thereafter."""
        import numpy as np

        n = len(self.line)
        part = MovesInMm(
            line=np.array(self.line, dtype=np.int64),
            motion=np.array(self.motion, dtype=np.int64),
            start=np.array(self.start, dtype=float).reshape(n, 6),
            end=np.array(self.end, dtype=float).reshape(n, 6),
            arc_rows=[row for row, arc in enumerate(self.arc) if arc is not None],
            arcs=[arc for arc in self.arc if arc is not None],
            feed=np.array(self.feed, dtype=float),
            dwell=np.array(self.dwell, dtype=float),
            tool=np.array(self.tool, dtype=np.int64),
            tool_length=np.array(self.tool_length, dtype=float),
            from_machine=np.array(self.from_machine, dtype=bool).reshape(n, 2),
        )
        columns: tuple[list[Any], ...] = (self.line, self.motion, self.start, self.end, self.arc, self.feed)
        for column in (*columns, self.dwell, self.tool, self.tool_length, self.from_machine):
            column.clear()
        return part


def _joined(parts: list[MovesInMm]) -> Moves:
    """All parts, the last one first, in SI; each is let go once it is copied, so that no move is held twice."""
    import numpy as np

    n = sum(len(part) for part in parts)
    moves = Moves(
        line=np.empty(n, dtype=np.int64),
        motion=np.empty(n, dtype=np.int64),
        start=np.empty((n, 6)),
        end=np.empty((n, 6)),
        arc_sweep=np.zeros(n),
        arc_center=np.zeros((n, 3)),
        arc_normal=np.zeros((n, 3)),
        feed=np.empty(n),
        dwell=np.empty(n),
        tool=np.empty(n, dtype=np.int64),
        tool_length=np.empty(n),
        from_machine=np.empty((n, 2), dtype=bool),
    )
    first = 0
    while parts:
        part = parts.pop()
        _copy(part, moves.take(slice(first, first + len(part))))
        first += len(part)
    return moves


def _copy(part: MovesInMm, into: Moves) -> None:
    """Copy a part into rows of moves, to SI."""
    import numpy as np

    for mm, si in ((part.start, into.start), (part.end, into.end)):
        si[:, :3] = m_from_mm(mm[:, :3])
        si[:, 3:] = rad_from_deg(mm[:, 3:])
    if part.arcs:
        rows = np.array(part.arc_rows)
        into.arc_sweep[rows] = [arc.sweep for arc in part.arcs]
        into.arc_center[rows] = m_from_mm(np.array([arc.center for arc in part.arcs]))
        into.arc_normal[rows] = [arc.normal for arc in part.arcs]
    # The feed of a move of the rotary axes alone is in degrees per minute.
    rotary = (into.start[:, :3] == into.end[:, :3]).all(axis=1)
    rotary[part.arc_rows] = False
    speed = np.where(rotary, rad_from_deg(part.feed) / 60.0, m_per_s_from_mm_per_min(part.feed))
    into.feed[:] = np.where(part.motion == RAPID, math.nan, speed)
    into.line[:], into.motion[:], into.dwell[:] = part.line, part.motion, part.dwell
    into.tool[:], into.tool_length[:] = part.tool, m_from_mm(part.tool_length)
    into.from_machine[:] = part.from_machine
