"""Cutter compensation as Fanuc's manuals have it, and Haas' controls whose setting 58 is FANUC. mm, rad.

Source: Fanuc's operator's manuals, "Details of cutter or tool nose radius compensation": start-up and cancellation of
type A (parameter 5003, bit 0, SUP = 0; Haas: setting 43), corners joined by straight moves (parameter 19607, bit 2,
CCC = 0). The first move, straight, ends beside the beginning of the next one; inside a corner the tool goes to where
both offset moves meet; outside, up to 90 degrees, to where the tangents of both meet, and beyond 90 degrees each of the
two is longer by the tool's radius.
"""

from __future__ import annotations

import math

from toolpath_stiff.nc import compensation
from toolpath_stiff.nc.compensation import Cutter, OffsetArc, Step
from toolpath_stiff.nc.geometry import ArcError, Point2

TURNED = 1e-3  # rad; less than this is no corner: it moves the tool by less than half a millionth of its radius
SHARP = 1e-9  # rad by which a corner of 90 degrees may seem larger
TYPE_A = (
    "cutter compensation begins and ends by type A (Fanuc: parameter 5003, bit 0, is 0; Haas: setting 43), and D is "
    "the tool in the tool table whose diameter it takes"
)
STRAIGHT = (
    "outside corners of cutter compensation are joined by straight moves (Fanuc: parameter 19607, bit 2, is 0; Haas: "
    "setting 58 is FANUC)"
)


def enter(cutter: Cutter, target: Point2, arc: OffsetArc | None) -> Step:
    """The first move: where it ends, the next one says. Raises `ArcError` for an arc."""
    if arc is not None:
        raise ArcError("an arc as the first move of cutter compensation", "G0 or G1")
    cutter.entering = True
    return Step(target)


def go_on(cutter: Cutter, start: Point2, target: Point2, arc: OffsetArc | None) -> Step:
    """A further move, straight or an arc. Raises `ArcError` where the tool cannot follow it, or controls differ."""
    along = _heading(start, start, target, arc)
    beside = _beside(start, cutter, along)
    if cutter.entering:
        if len(cutter.pending) > 1:
            raise ArcError("a move along the tool right after the first move of cutter compensation", "it before G41")
        cutter.entering = False
        return Step(_end(cutter, start, target, arc), trim=beside)
    before = math.atan2(cutter.center[1] - start[1], cutter.center[0] - start[0]) - cutter.side * math.pi / 2.0
    turn = math.remainder(along - before, math.tau)
    if abs(turn) <= TURNED:
        return Step(_end(cutter, start, target, arc))
    if len(cutter.pending) > 1:
        raise ArcError("a move along the tool in a corner of cutter compensation", "it where the contour is smooth")
    if abs(turn) > math.pi - TURNED:
        raise ArcError("a contour under cutter compensation that turns back on itself", "another contour")
    if turn * cutter.side > 0.0:
        return _inside(cutter, start, target, arc)
    return _outside(cutter, _end(cutter, start, target, arc), (before, turn), beside, arc)


def _end(cutter: Cutter, start: Point2, target: Point2, arc: OffsetArc | None) -> Point2:
    """Where the tool centre is beside the end of a programmed move."""
    if arc is not None and cutter.side * arc.turn > 0:
        compensation.check_fits(cutter, math.dist(arc.center, target))
    return _beside(target, cutter, _heading(target, start, target, arc))


def _inside(cutter: Cutter, start: Point2, target: Point2, arc: OffsetArc | None) -> Step:
    """An inside corner: where both offset moves meet, on LinuxCNC too."""
    if arc is None:
        return compensation.go_straight(cutter, start, target, TURNED)
    return compensation.go_round(cutter, start, target, arc.center, arc.turn, TURNED)


def _heading(at: Point2, start: Point2, target: Point2, arc: OffsetArc | None) -> float:
    """Direction of a programmed move at one of its ends."""
    if arc is None:
        return math.atan2(target[1] - start[1], target[0] - start[0])
    return math.atan2(at[1] - arc.center[1], at[0] - arc.center[0]) + arc.turn * math.pi / 2.0


def _beside(point: Point2, cutter: Cutter, heading: float) -> Point2:
    """Where the tool centre is beside a point of a contour with that heading."""
    return _ahead(point, cutter.radius, heading + cutter.side * math.pi / 2.0)


def _ahead(point: Point2, length: float, heading: float) -> Point2:
    return point[0] + length * math.cos(heading), point[1] + length * math.sin(heading)


def _outside(cutter: Cutter, end: Point2, headings: tuple[float, float], beside: Point2, arc: OffsetArc | None) -> Step:
    """Straight moves round an outside corner: heading before it, and turn; a straight move before it is made longer."""
    before, turn = headings
    acute = abs(turn) > math.pi / 2.0 + SHARP
    reach = cutter.radius * (1.0 if acute else math.tan(abs(turn) / 2.0))
    way = [_ahead(cutter.center, reach, before)]
    if acute:
        way.append(_ahead(beside, -reach, before + turn))
    if arc is not None:
        way.append(beside)
    longer = way.pop(0) if cutter.pending[0].arc is None else None
    return Step(end, trim=longer, outside=True, way=tuple(way))
