"""Cutter compensation: the path of the tool centre beside a programmed contour. mm, rad.

As LinuxCNC makes it (sources: its manual, "Cutter Compensation"; what `rs274` 2.9 prints, against which the tests
hold this on random contours). In a plane: the first move ends beside its end point; a convex corner is rounded by an
arc about it (a rapid cuts it straight); a concave one moves the end of the move before to where both offset moves
meet, and is an error where that lies before its start.

As Fanuc's manuals have it, and Haas' controls whose setting 58 is FANUC (`straight`): with straight corners. Source:
Fanuc's operator's manuals, "Details of cutter or tool nose radius compensation": start-up and cancellation of type A
(parameter 5003, bit 0, SUP = 0; Haas: setting 43), corners joined by straight moves (parameter 19607, bit 2,
CCC = 0). The first move, straight, ends beside the beginning of the next one; inside a corner the tool goes to where
both offset moves meet; outside, up to 90 degrees, to where the tangents of both meet, and beyond 90 degrees each of
the two is longer by the tool's radius.

Heidenhain's controls enter and leave as Fanuc's type A (the tool stands perpendicular to the first and the last contour
element), and round outside corners by an arc as LinuxCNC does (user's manuals, "Tool radius compensation").
"""

import math
from dataclasses import dataclass, field

from toolpath_stiff.nc.geometry import Point2, arc_sweep, refuse_arc_if
from toolpath_stiff.nc.moves import Move

CORNER = 0.05  # rad; less than this is no corner (LinuxCNC's TOLERANCE_CONCAVE_CORNER)
SHORTENED = 1e-3  # rad by which a shortened arc may seem longer than before
MATCHING = 0.01  # program units by which the radii of a shortened arc may differ
FLAT = 1e-4  # cosine below which no arc of entry is tangent
TIGHT = 0.01  # mm by which an entry arc must be wider than the tool: below, rounding decides on its centre
GOUGE = "a concave corner that the tool cannot reach without gouging"
SMALLER = "a smaller tool, or another contour"
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


@dataclass
class OffsetArc:
    """An arc of the tool centre: centre, +1 counter-clockwise or -1, turns; the programmed sweep, 0 if it has none."""

    center: Point2
    turn: int
    turns: int = 1
    programmed: float = 0.0

    def sweep_to(self, start: Point2, end: Point2) -> float:
        """Signed angle from one point to another, rad."""
        return arc_sweep(start, end, self.center, self.turn < 0, self.turns)


@dataclass
class Pending:
    """A move of the tool centre whose end the next corner may still move back.

    `end`: program coordinates (6); `direction` as programmed, in the plane; `move`: recorded, None if it goes nowhere.
    """

    end: list[float]
    direction: Point2
    arc: OffsetArc | None
    move: Move | None


@dataclass
class RadiusCompensation:
    """Cutter compensation in force.

    Attributes
    ----------
    side, radius
        +1: the tool is left of the contour (G41), -1: right; its radius, mm.
    axes
        First, second axis of the plane, and the one along the tool.
    unit
        Millimetres of one length unit of the program.
    position
        Tool centre in program coordinates (6); None before the first move.
    anchor
        Where the pending moves begin, in the plane.
    pending
        Moves since the last corner, the one in the plane first.
    straight
        As Fanuc's and Haas' manuals have it (straight corners), not LinuxCNC's.
    rounded
        `straight`, but for outside corners, which are rounded (Heidenhain).
    entering
        The first move waits for the next one, which says where it ends.
    """

    side: int
    radius: float
    axes: tuple[int, int, int]
    unit: float
    position: list[float] | None = None
    anchor: Point2 = (0.0, 0.0)
    pending: list[Pending] = field(default_factory=list)
    straight: bool = False
    entering: bool = False
    rounded: bool = False

    @property
    def center(self) -> Point2:
        """Tool centre in the plane."""
        assert self.position is not None
        return self.in_plane(self.position)

    def in_plane(self, point: list[float]) -> Point2:
        """A point's two coordinates of the plane."""
        return point[self.axes[0]], point[self.axes[1]]

    def moved(self, point: list[float], to: Point2) -> list[float]:
        """A point with other coordinates in the plane."""
        point = list(point)
        point[self.axes[0]], point[self.axes[1]] = to
        return point


@dataclass(frozen=True)
class CenterMove:
    """What a programmed move makes of the path: the new end of those before it, an arc about a corner, its own end."""

    end: Point2
    trim: Point2 | None = None
    corner: Point2 | None = None  # where the tool centre leaves the arc about the programmed start
    center: Point2 | None = None  # of its own arc, where that is not the programmed one
    outside: bool = False  # a corner that straight moves go round: `way`, after the move before is made longer
    way: tuple[Point2, ...] = ()


def enter(
    cutter: RadiusCompensation, start: Point2, target: Point2, arc: OffsetArc | None
) -> tuple[CenterMove, Point2]:
    """The first move, and its direction (arcs have none). Raises `ArcError`.

    LinuxCNC's, longer than the tool's radius, ends beside its end point; Fanuc's where the next one says.

    Examples
    --------
    >>> step, _ = enter(RadiusCompensation(1, 3.0, (0, 1, 2), 1.0), (0.0, 0.0), (10.0, 0.0), None)
    >>> [round(value, 9) for value in step.end]
    [10.0, 3.0]
    """
    if cutter.straight:
        refuse_arc_if(arc is not None, "an arc as the first move of cutter compensation", "G0 or G1")
        cutter.entering = True
        return CenterMove(target), (0.0, 0.0)
    refuse_arc_if(
        math.dist(start, target) <= cutter.radius,
        f"the entry move of cutter compensation is {math.dist(start, target):.4f} mm long in its plane",
        f"more than the tool's radius of {cutter.radius:g} mm",
    )
    if arc is not None:
        return _enter_arc(cutter, start, target, arc.center, arc.turn), (0.0, 0.0)
    across = _angle(start, target) + cutter.side * math.pi / 2.0
    return CenterMove(_beside(target, cutter.radius, across)), (math.cos(across), math.sin(across))


def _go(cutter: RadiusCompensation, start: Point2, target: Point2, arc: OffsetArc | None, least: float) -> CenterMove:
    if arc is None:
        return _go_straight(cutter, start, target, least)
    return _go_round(cutter, start, target, arc.center, arc.turn, least)


def _beside(point: Point2, length: float, angle: float) -> Point2:
    return point[0] + length * math.cos(angle), point[1] + length * math.sin(angle)


def _angle(tail: Point2, head: Point2) -> float:
    return math.atan2(head[1] - tail[1], head[0] - tail[0])


def _enter_arc(cutter: RadiusCompensation, start: Point2, target: Point2, center: Point2, turn: int) -> CenterMove:
    """The first move, an arc: from the present point, tangent at its end to the programmed one. Raises `ArcError`."""
    inside = cutter.side * turn > 0
    if inside:
        _check_fits(cutter, math.dist(center, start) - TIGHT)
    end = _beside(target, cutter.radius, _angle(target, center) if inside else _angle(center, target))
    inward = _angle(end, center)
    cosine = math.cos(_angle(end, start) - inward)
    refuse_arc_if(abs(cosine) < FLAT, "an entry arc that the tool's radius makes straight", SMALLER)
    return CenterMove(end, center=_beside(end, math.dist(start, end) / 2.0 / cosine, inward))


def _check_fits(cutter: RadiusCompensation, radius: float) -> None:
    """Raise `ArcError` for an arc that the tool, inside it, cannot follow."""
    refuse_arc_if(
        radius <= cutter.radius,
        f"an inside arc of radius {radius:.4f} mm",
        f"more than the tool's radius, {cutter.radius:g} mm",
    )


def _go_straight(cutter: RadiusCompensation, start: Point2, target: Point2, least: float = CORNER) -> CenterMove:
    """A straight move from one programmed point to another, after others; `least`: rad that make a corner.

    Raises `ArcError`.
    """
    before, along = _angle(start, cutter.center), _angle(start, target)
    turned = cutter.side * (before - along)
    corner = (turned + math.tau if turned < 0.0 else turned) - math.pi / 2.0  # above 0: convex
    across = along + cutter.side * math.pi / 2.0
    end = _beside(target, cutter.radius, across)
    arc = cutter.pending[0].arc
    # Over the round part of an "h" and along its upright: the tool stays above, it does not go round.
    over = corner > math.pi - CORNER and arc is not None and cutter.side * arc.turn < 0
    if corner < -least or corner > math.pi + least or over:
        if arc is not None:
            return CenterMove(end, trim=_arc_meets_line(cutter, arc, start, along))
        retreat = cutter.radius / math.tan((corner + math.pi) / 2.0)
        return CenterMove(end, trim=_beside(cutter.center, retreat, before + cutter.side * math.pi / 2.0))
    if corner > least:
        return CenterMove(end, trim=cutter.center, corner=_beside(start, cutter.radius, across))
    return CenterMove(end)


def _go_round(
    cutter: RadiusCompensation, start: Point2, target: Point2, center: Point2, turn: int, least: float = CORNER
) -> CenterMove:
    """An arc from one programmed point to another, after other moves; `least`: rad that make a corner.

    Raises `ArcError`.
    """
    inside = cutter.side * turn > 0
    radius = math.dist(center, target)
    heading = _angle(start, cutter.center) - cutter.side * math.pi / 2.0  # of the move before
    inward = _angle(start, center)
    corner = cutter.side * (heading - (inward - turn * math.pi / 2.0))
    if corner > 1.5 * math.pi:
        corner -= math.tau
    elif corner < -math.pi / 2.0:
        corner += math.tau
    if inside:
        _check_fits(cutter, radius)
    end = _beside(target, cutter.radius, _angle(target, center) if inside else _angle(center, target))
    if corner < -least or corner > math.pi + least or (abs(corner - math.pi) < CORNER and not inside):
        arc = cutter.pending[0].arc
        if arc is not None:
            return CenterMove(end, trim=_arc_meets_arc(cutter, arc, center, turn, radius))
        return CenterMove(end, trim=_line_meets_arc(cutter, heading, corner, center, turn, radius))
    if corner > least:
        return CenterMove(end, corner=_beside(start, cutter.radius, inward if inside else inward + math.pi))
    return CenterMove(end)


def _within(value: float) -> float:
    """The sine or cosine of where two offset moves meet."""
    refuse_arc_if(not -1.0 <= value <= 1.0, GOUGE, SMALLER)
    return value


def _arc_meets_line(cutter: RadiusCompensation, arc: OffsetArc, start: Point2, along: float) -> Point2:
    """Where the offset arc before meets the offset line that begins at a programmed point."""
    end = cutter.pending[0].end
    radius = math.dist(arc.center, (end[cutter.axes[0]], end[cutter.axes[1]]))
    side = 1 if cutter.side * arc.turn > 0 else -1  # the tool is inside the arc
    normal = along + arc.turn * math.pi / 2.0
    far = (radius + side * cutter.radius) * math.cos(normal - _angle(start, arc.center))
    refuse_arc_if(radius == 0.0, GOUGE, SMALLER)
    back = math.acos(_within((far - side * cutter.radius) / radius))
    return _beside(arc.center, radius, normal + math.pi - side * arc.turn * back)


def _line_meets_arc(
    cutter: RadiusCompensation, heading: float, corner: float, center: Point2, turn: int, radius: float
) -> Point2:
    """Where the offset line before meets the offset arc."""
    side = 1 if cutter.side * turn > 0 else -1
    offset = radius - side * cutter.radius
    turned = math.asin(_within((radius * math.sin(corner - math.pi / 2.0) + side * cutter.radius) / offset))
    return _beside(center, offset, heading + turn * turned if side > 0 else heading + math.pi - turn * turned)


def _arc_meets_arc(cutter: RadiusCompensation, arc: OffsetArc, center: Point2, turn: int, radius: float) -> Point2:
    """Where the offset arc before meets the next one."""
    end = cutter.pending[0].end
    old = math.dist(arc.center, (end[cutter.axes[0]], end[cutter.axes[1]]))
    new = radius - cutter.radius if cutter.side * turn > 0 else radius + cutter.radius
    apart = math.dist(arc.center, center)
    refuse_arc_if(old == 0.0 or apart == 0.0, "a corner between two arcs of one centre", "arcs of different centres")
    back = math.acos(_within((old * old + apart * apart - new * new) / (2.0 * old * apart)))
    inside = cutter.side * arc.turn > 0
    return _beside(arc.center, old, _angle(arc.center, center) + (turn if inside else -turn) * back)


def go_on(cutter: RadiusCompensation, start: Point2, target: Point2, arc: OffsetArc | None) -> CenterMove:
    """A further move, straight or an arc. Raises `ArcError` where the tool cannot follow it, or controls differ."""
    if not cutter.straight:
        return _go(cutter, start, target, arc, CORNER)
    along = _heading(start, start, target, arc)
    beside = _beside_contour(start, cutter, along)
    if cutter.entering:
        refuse_arc_if(
            len(cutter.pending) > 1 and not cutter.rounded,
            "a move along the tool right after the first move of cutter compensation",
            "it before G41",
        )
        cutter.entering = False
        return CenterMove(_end(cutter, start, target, arc), trim=beside)
    before = _angle(start, cutter.center) - cutter.side * math.pi / 2.0
    turn = math.remainder(along - before, math.tau)
    if abs(turn) <= TURNED:
        return CenterMove(_end(cutter, start, target, arc))
    refuse_arc_if(
        len(cutter.pending) > 1 and not cutter.rounded,
        "a move along the tool in a corner of cutter compensation",
        "it where the contour is smooth",
    )
    refuse_arc_if(
        abs(turn) > math.pi - TURNED, "a contour under cutter compensation that turns back on itself", "another contour"
    )
    if turn * cutter.side > 0.0 or cutter.rounded:
        return _go(cutter, start, target, arc, TURNED)  # an inside corner, as LinuxCNC has it
    return _outside(cutter, _end(cutter, start, target, arc), (before, turn), beside, arc)


def _end(cutter: RadiusCompensation, start: Point2, target: Point2, arc: OffsetArc | None) -> Point2:
    """Where the tool centre is beside the end of a programmed move."""
    if arc is not None and cutter.side * arc.turn > 0:
        _check_fits(cutter, math.dist(arc.center, target))
    return _beside_contour(target, cutter, _heading(target, start, target, arc))


def _heading(point: Point2, start: Point2, target: Point2, arc: OffsetArc | None) -> float:
    """Direction of a programmed move at one of its ends."""
    if arc is None:
        return _angle(start, target)
    return _angle(arc.center, point) + arc.turn * math.pi / 2.0


def _beside_contour(point: Point2, cutter: RadiusCompensation, heading: float) -> Point2:
    """Where the tool centre is beside a point of a contour with that heading."""
    return _beside(point, cutter.radius, heading + cutter.side * math.pi / 2.0)


def _outside(
    cutter: RadiusCompensation, end: Point2, headings: tuple[float, float], beside: Point2, arc: OffsetArc | None
) -> CenterMove:
    """Straight moves round an outside corner: heading before it, and turn; a straight move before it is made longer."""
    before, turn = headings
    acute = abs(turn) > math.pi / 2.0 + SHARP
    reach = cutter.radius * (1.0 if acute else math.tan(abs(turn) / 2.0))
    way = [_beside(cutter.center, reach, before)]
    if acute:
        way.append(_beside(beside, -reach, before + turn))
    if arc is not None:
        way.append(beside)
    longer = way.pop(0) if cutter.pending[0].arc is None else None
    return CenterMove(end, trim=longer, outside=True, way=tuple(way))
