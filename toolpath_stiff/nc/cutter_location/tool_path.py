"""Moves of the tool tip, straight, along circles and into holes, with the tool axis that turns meanwhile.

Moves begin where the tool stands and are of the line of the statement being executed. Raises `AxisError` and
`arcs.ArcError`, which know no line, and `InputError`, which does.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from toolpath_stiff.nc.cutter_location import geometry
from toolpath_stiff.nc.cutter_location.geometry import VERTICAL, Circle, Vector
from toolpath_stiff.nc.cutter_location.state import State
from toolpath_stiff.nc.cycles import Drilling, strokes
from toolpath_stiff.nc.moves import ARC, CYCLE, RAPID, ToolUse
from toolpath_stiff.nc.recorder import Arc
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.units import m_from_mm

FIRST_POINT = "the path begins at the file's first point; where the tool comes from is not said (no FROM)"
FREE_YAW = "the turn of the tool about its own axis (yaw) is free in a cutter-location file; it is 0"
TURN_FEED = "where the tool turns about its standing tip, a feed of 1 mm/min counts as 1 degree per minute"
PECKS = "a drilling cycle with STEP or INCR ends its rapids 0.254 mm above the last depth, as LinuxCNC does"
NOT_MOVED = (False, False)


def stand(state: State, point: Vector, axis: Vector) -> None:
    """The tool stands somewhere; how it got there is not part of the path."""
    state.point, state.axis, state.heading = point, axis, None
    state.angles = geometry.angles_near(axis, state.angles)
    if axis != VERTICAL:
        state.assume(FREE_YAW)


def straight(state: State, motion: int, target: Vector, axis: Vector) -> None:
    """A straight move of the tip to a point, where the tool has an axis."""
    start = state.point
    if start is None:
        stand(state, target, axis)
        state.assume(FIRST_POINT)
        return
    if axis == state.axis:
        if target != start:
            _add(state, motion, target, state.angles, _feed(state, motion))
            state.heading = geometry.minus(target, start)
        return
    whole = geometry.minus(target, start)
    _turning(state, motion, target, axis, lambda share: geometry.along(start, whole, share), None)
    state.heading = whole if target != start else state.heading


def circular(state: State, circle: Circle, target: Vector, axis: Vector) -> float:
    """A move of the tip along a circle; its sweep in rad."""
    start = state.point
    assert start is not None
    arc = geometry.arc_to(circle, start, target)
    if axis == state.axis:
        _add(state, ARC, target, state.angles, _feed(state, ARC), arc)
    else:
        _turning(state, ARC, target, axis, lambda share: geometry.part_of(arc, start, target, share), arc)
    state.heading = None
    return arc.sweep


def drill(state: State, target: Vector, axis: Vector, hole: Drilling, feed: float) -> None:
    """A drilled hole at a point: heights of `hole` count from the point, along the tool axis."""
    start = state.point
    if start is None:
        start = geometry.along(target, axis, hole.clear)
        stand(state, start, axis)
        state.assume(FIRST_POINT)
    here = geometry.dot(geometry.minus(start, target), state.axis)
    level = max(here, hole.clear, hole.retract)
    # Up to the level of the holes first, where the tool is below it; then across, then down.
    _to_height(state, RAPID, geometry.along(start, state.axis, -here), level, math.nan)
    for height, motion, dwell in [
        (level, RAPID, 0.0),
        (hole.retract, RAPID, 0.0),
        *((stroke.height, CYCLE if stroke.feed else RAPID, stroke.dwell) for stroke in strokes(hole)),
    ]:
        _to_height(state, motion, target, height, feed)
        if dwell:
            state.recorder.add_dwell(dwell)
    if hole.peck:
        state.assume(PECKS)
    state.heading = None


def _to_height(state: State, motion: int, target: Vector, height: float, feed: float) -> None:
    point = geometry.along(target, state.axis, height)
    if state.point is not None and math.dist(point, state.point) > 1e-9:
        _add(state, motion, point, state.angles, feed)


def _turning(
    state: State, motion: int, target: Vector, axis: Vector, point_at: Callable[[float], Vector], arc: Arc | None
) -> None:
    """A move whose tool axis turns, in as many parts as keep the axis near its great circle."""
    first, angles = state.axis, state.angles
    parts = geometry.division(first, axis)
    still = arc is None and state.point == target
    feed = _feed(state, motion)
    if still and motion != RAPID:
        state.assume(TURN_FEED)
    state.assume(FREE_YAW)
    for part in range(1, parts + 1):
        share = part / parts
        end = target if part == parts or still else point_at(share)
        turned = axis if part == parts else geometry.on_great_circle(first, axis, share)
        angles = geometry.angles_near(turned, angles)
        piece = None
        if arc is not None:
            climb = geometry.dot(geometry.minus(target, arc.center), arc.normal)
            center = geometry.along(arc.center, arc.normal, climb * (part - 1) / parts)
            piece = Arc(center, arc.normal, arc.sweep / parts)
        _add(state, motion, end, angles, feed, piece)
    state.axis = axis


def _add(
    state: State, motion: int, end: Vector, angles: tuple[float, float], feed: float, arc: Arc | None = None
) -> None:
    assert state.point is not None
    start = [*state.point, *state.angles, 0.0]
    tool, line = state.tool, state.statement.line
    added = state.recorder.add(line, motion, start, [*end, *angles, 0.0], feed, tool, state.tool_length, NOT_MOVED, arc)
    state.point, state.angles = end, angles
    if added and tool not in state.used_tools:
        state.used_tools[tool] = _tool_use(state)


def _tool_use(state: State) -> ToolUse:
    """The tool in the spindle; the tool table wins over the file."""
    entry = (state.tools or {}).get(state.tool, ToolEntry(state.tool))
    diameter = state.diameter if math.isnan(entry.diameter) else entry.diameter
    return ToolUse(
        state.tool,
        m_from_mm(state.tool_length),
        m_from_mm(diameter),
        entry.remark or state.tool_name,
        m_from_mm(entry.stick_out),
        entry.material,
    )


def _feed(state: State, motion: int) -> float:
    """mm/min; for a tip that stands still the same number of degrees per minute."""
    if motion == RAPID:
        return math.nan
    if state.feed is None:
        raise state.fail("a cut before any feed", "FEDRAT/ with a feed above 0, or RAPID, before it")
    return state.feed_per_minute(state.feed, state.per_revolution)
