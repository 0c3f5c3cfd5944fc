"""The tool on its way: position, axis, feed, tool; makes moves of points, arcs and holes. mm, degrees, mm/min."""

from __future__ import annotations

import math
from collections.abc import Callable

from toolpath_stiff.nc.cutter_location import circles
from toolpath_stiff.nc.cutter_location.circles import Circle
from toolpath_stiff.nc.cutter_location.tilting import (
    VERTICAL,
    Vector,
    angle_between,
    angles_near,
    division,
    on_great_circle,
)
from toolpath_stiff.nc.cycles import Drilling, strokes
from toolpath_stiff.nc.moves import ARC, CYCLE, RAPID, ToolUse
from toolpath_stiff.nc.recorder import Arc, Recorder
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.units import m_from_mm

FIRST_POINT = "the path begins at the file's first point; where the tool comes from is not said (no FROM)"
FREE_YAW = "the turn of the tool about its own axis (yaw) is free in a cutter-location file; it is 0"
TURN_FEED = "where the tool turns about its standing tip, a feed of 1 mm/min counts as 1 degree per minute"
PECKS = "a drilling cycle with STEP or INCR ends its rapids 0.254 mm above the last depth, as LinuxCNC does"
NOT_MOVED = (False, False)


class NoFeedError(Exception):
    """Why there is no feed for a cut: found, expected."""

    def __init__(self, found: str, expected: str) -> None:
        super().__init__(found)
        self.found, self.expected = found, expected


class ToolPath:
    """What is modal, and the moves found so far in `recorder`.

    Raises `AxisError`, `arcs.ArcError` and `NoFeedError`, which know no line.
    """

    def __init__(self, tools: dict[int, ToolEntry] | None) -> None:
        self.tools = tools
        self.recorder = Recorder()
        self.used_tools: dict[int, ToolUse] = {}
        self.assumptions: list[str] = []
        self.scale = 1.0  # mm of the length unit
        self.point: Vector | None = None
        self.axis: Vector = VERTICAL
        self.angles = (0.0, 0.0)
        self.feed: float | None = None  # mm/min, or mm per revolution
        self.per_revolution = False
        self.speed = 0.0
        self.tool, self.tool_length = 0, math.nan
        self.diameter, self.tool_name = math.nan, ""
        self.smooth, self.unsmooth, self.first_unsmooth = 0, 0, 0
        self._direction: Vector | None = None  # of the straight move before
        self._cutter_at = 0  # moves before the last CUTTER

    def assume(self, text: str) -> None:
        """Note an assumption, once."""
        if text not in self.assumptions:
            self.assumptions.append(text)

    def stand(self, point: Vector, axis: Vector) -> None:
        """The tool stands somewhere; how it got there is not part of the path."""
        self.point, self.axis, self._direction = point, axis, None
        self.angles = angles_near(axis, self.angles)
        if axis != VERTICAL:
            self.assume(FREE_YAW)

    # -- motion ------------------------------------------------------------------------------------------------------

    def straight(self, line: int, motion: int, target: Vector, axis: Vector) -> None:
        """A straight move of the tip to a point, where the tool has an axis."""
        start = self.point
        if start is None:
            self.stand(target, axis)
            self.assume(FIRST_POINT)
            return
        if axis == self.axis:
            if target != start:
                self._add(line, motion, target, self.angles, self._feed(motion))
                self._direction = circles.minus(target, start)
            return
        whole = circles.minus(target, start)

        def point_at(share: float) -> Vector:
            return circles.along(start, whole, share)

        self._turning(line, motion, target, axis, point_at, None)
        self._direction = whole if target != start else self._direction

    def circular(self, line: int, circle: Circle, target: Vector, axis: Vector) -> float:
        """A move of the tip along a circle; its sweep in rad."""
        start = self.point
        assert start is not None
        arc = circles.arc_to(circle, start, target)
        if axis == self.axis:
            self._add(line, ARC, target, self.angles, self._feed(ARC), arc)
        else:
            self._turning(line, ARC, target, axis, lambda share: circles.part_of(arc, start, target, share), arc)
        self._direction = None
        return arc.sweep

    def hole(self, line: int, target: Vector, axis: Vector, hole: Drilling, feed: float) -> None:
        """A drilled hole at a point: heights of `hole` count from the point, along the tool axis."""
        start = self.point
        if start is None:
            start = circles.along(target, axis, hole.clear)
            self.stand(start, axis)
            self.assume(FIRST_POINT)
        here = circles.dot(circles.minus(start, target), self.axis)
        level = max(here, hole.clear, hole.retract)
        # Up to the level of the holes first, where the tool is below it; then across, then down.
        self._to_height(line, RAPID, circles.along(start, self.axis, -here), level, math.nan)
        for height, motion, dwell in [
            (level, RAPID, 0.0),
            (hole.retract, RAPID, 0.0),
            *((stroke.height, CYCLE if stroke.feed else RAPID, stroke.dwell) for stroke in strokes(hole)),
        ]:
            self._to_height(line, motion, target, height, feed)
            if dwell:
                self.recorder.add_dwell(dwell)
        if hole.peck:
            self.assume(PECKS)
        self._direction = None

    def _to_height(self, line: int, motion: int, target: Vector, height: float, feed: float) -> None:
        point = circles.along(target, self.axis, height)
        if self.point is not None and math.dist(point, self.point) > 1e-9:
            self._add(line, motion, point, self.angles, feed)

    def _turning(
        self,
        line: int,
        motion: int,
        target: Vector,
        axis: Vector,
        point_at: Callable[[float], Vector],
        arc: Arc | None,
    ) -> None:
        """A move whose tool axis turns, in as many parts as keep the axis near its great circle."""
        first, angles = self.axis, self.angles
        parts = division(first, axis)
        still = arc is None and self.point == target
        feed = self._feed(motion)
        if still and motion != RAPID:
            self.assume(TURN_FEED)
        self.assume(FREE_YAW)
        for part in range(1, parts + 1):
            share = part / parts
            end = target if part == parts or still else point_at(share)
            turned = axis if part == parts else on_great_circle(first, axis, share)
            angles = angles_near(turned, angles)
            piece = None
            if arc is not None:
                climb = circles.dot(circles.minus(target, arc.center), arc.normal)
                center = circles.along(arc.center, arc.normal, climb * (part - 1) / parts)
                piece = Arc(center, arc.normal, arc.sweep / parts)
            self._add(line, motion, end, angles, feed, piece)
        self.axis = axis

    def _add(
        self, line: int, motion: int, end: Vector, angles: tuple[float, float], feed: float, arc: Arc | None = None
    ) -> None:
        assert self.point is not None
        start = [*self.point, *self.angles, 0.0]
        added = self.recorder.add(
            line, motion, start, [*end, *angles, 0.0], feed, self.tool, self.tool_length, NOT_MOVED, arc
        )
        self.point, self.angles = end, angles
        if added and self.tool not in self.used_tools:
            self._use_tool()

    def _use_tool(self) -> None:
        entry = (self.tools or {}).get(self.tool, ToolEntry(self.tool))
        diameter = self.diameter if math.isnan(entry.diameter) else entry.diameter
        self.used_tools[self.tool] = ToolUse(
            self.tool,
            m_from_mm(self.tool_length),
            m_from_mm(diameter),
            entry.remark or self.tool_name,
            m_from_mm(entry.stick_out),
            entry.material,
        )

    def _feed(self, motion: int) -> float:
        """mm/min; for a tip that stands still the same number of degrees per minute."""
        if motion == RAPID:
            return math.nan
        if self.feed is None:
            raise NoFeedError("a cut before any feed", "FEDRAT/ with a feed above 0, or RAPID, before it")
        return self.feed_per_minute(self.feed, self.per_revolution)

    def feed_per_minute(self, feed: float, per_revolution: bool) -> float:
        """mm/min of a feed that may be per revolution."""
        if not per_revolution:
            return feed
        if not self.speed > 0.0:
            raise NoFeedError("a feed per revolution without a spindle speed", "SPINDL/ with RPM before it")
        return feed * self.speed

    def note_entry(self, line: int, circle: Circle) -> None:
        """Count whether a straight move goes on into an arc smoothly, as it nearly always does, or would turn back."""
        if self._direction is None or self.point is None:
            return
        tangent = circles.cross(circle.axis, circles.minus(self.point, circle.center))
        sizes = math.sqrt(circles.dot(tangent, tangent)), math.sqrt(circles.dot(self._direction, self._direction))
        if min(sizes) < 1e-9:
            return
        x, y, z = (t / sizes[0] for t in tangent)
        u, v, w = (d / sizes[1] for d in self._direction)
        angle = angle_between((x, y, z), (u, v, w))
        if angle < circles.SMOOTH_DEG:
            self.smooth += 1
        elif angle > 180.0 - circles.SMOOTH_DEG:
            self.unsmooth += 1
            self.first_unsmooth = self.first_unsmooth or line

    def cutter(self, diameter: float) -> None:
        """The diameter of the tool that cuts next."""
        self.diameter = diameter if diameter > 0.0 else math.nan
        self._cutter_at = len(self.recorder)

    def change_tool(self, number: int, length: float) -> None:
        """Another tool; a CUTTER that stands between the last move and this is its own."""
        if len(self.recorder) > self._cutter_at:
            self.diameter = math.nan
        self.tool, self.tool_length = number, length
