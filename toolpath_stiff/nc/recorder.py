"""Moves as they are found, in lists; one conversion to SI arrays at the end."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from toolpath_stiff.nc.moves import RAPID, Moves
from toolpath_stiff.units import m_from_mm, m_per_s_from_mm_per_min, rad_from_deg

NO_VECTOR = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Arc:
    """An arc of a move: centre (set-up frame, mm), unit normal, signed sweep (rad)."""

    center: tuple[float, float, float]
    normal: tuple[float, float, float]
    sweep: float


@dataclass
class Recorder:
    """Collects moves; a move of no length in any axis is none."""

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
        return True

    def add_dwell(self, seconds: float) -> None:
        """A pause after the last move; before the first move nothing waits."""
        if self.dwell:
            self.dwell[-1] += seconds

    @property
    def cuts(self) -> bool:
        """Whether any move is a cutting one."""
        return any(motion != RAPID for motion in self.motion)

    def moves(self) -> Moves:
        """The moves as arrays, SI."""
        import numpy as np

        start, end = np.array(self.start, dtype=float), np.array(self.end, dtype=float)
        for pose in (start, end):
            pose[:, :3] = m_from_mm(pose[:, :3])
            pose[:, 3:] = rad_from_deg(pose[:, 3:])
        # The feed of a move of the rotary axes alone is in degrees per minute.
        feed = np.array(self.feed, dtype=float)
        arcs = np.array([arc is not None for arc in self.arc], dtype=bool)
        rotary = ~arcs & (start[:, :3] == end[:, :3]).all(axis=1)
        speed = np.where(rotary, rad_from_deg(feed) / 60.0, m_per_s_from_mm_per_min(feed))
        motion = np.array(self.motion, dtype=np.int64)
        return Moves(
            line=np.array(self.line, dtype=np.int64),
            motion=motion,
            start=start,
            end=end,
            arc_sweep=np.array([arc.sweep if arc else 0.0 for arc in self.arc], dtype=float),
            arc_center=m_from_mm(np.array([arc.center if arc else NO_VECTOR for arc in self.arc], dtype=float)),
            arc_normal=np.array([arc.normal if arc else NO_VECTOR for arc in self.arc], dtype=float),
            feed=np.where(motion == RAPID, math.nan, speed),
            dwell=np.array(self.dwell, dtype=float),
            tool=np.array(self.tool, dtype=np.int64),
            tool_length=m_from_mm(np.array(self.tool_length, dtype=float)),
            from_machine=np.array(self.from_machine, dtype=bool).reshape(-1, 2),
        )
