"""Cutter compensation: path of the tool centre beside a programmed contour. mm, rad.

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

import cmath
import math
from dataclasses import dataclass, field

from toolpath_stiff.nc.elements import Element, direction, meetings
from toolpath_stiff.nc.geometry import refuse_if, turn_between
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

    center: complex
    turn: int
    turns: int = 1
    programmed: float = 0.0

    def sweep_to(self, start: complex, end: complex) -> float:
        """Signed angle from one point to another, rad."""
        first, last = cmath.phase(start - self.center), cmath.phase(end - self.center)
        sweep = turn_between(first, last, self.turn < 0)
        return sweep + math.copysign(math.tau * (self.turns - 1), sweep)


@dataclass
class Pending:
    """A move of the tool centre whose end the next corner may still move back.

    `end`: program coordinates (6); `direction` as programmed, in the plane; `move`: recorded, None if it goes nowhere.
    """

    end: list[float]
    direction: complex
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
    anchor: complex = 0j
    pending: list[Pending] = field(default_factory=list)
    straight: bool = False
    entering: bool = False
    rounded: bool = False

    @property
    def center(self) -> complex:
        """Tool centre in the plane."""
        assert self.position is not None
        return self.in_plane(self.position)

    def in_plane(self, point: list[float]) -> complex:
        """The two in-plane coordinates of a point."""
        return complex(point[self.axes[0]], point[self.axes[1]])

    def moved(self, point: list[float], to: complex) -> list[float]:
        """Point with other coordinates in the plane."""
        point = list(point)
        point[self.axes[0]], point[self.axes[1]] = to.real, to.imag
        return point

    def beside(self, point: complex, heading: complex) -> complex:
        """Tool centre beside a point of a contour whose unit tangent is `heading`."""
        return point + self.side * 1j * self.radius * heading


@dataclass(frozen=True)
class CenterMove:
    """Path of the tool centre for a programmed move: new end of the moves before it, arc about a corner, own end."""

    end: complex
    trim: complex | None = None
    corner: complex | None = None  # where the tool centre leaves the arc about the programmed start
    center: complex | None = None  # of its own arc, where that is not the programmed one
    outside: bool = False  # a corner that straight moves go round: `way`, after the move before is made longer
    way: tuple[complex, ...] = ()


def enter(
    cutter: RadiusCompensation, start: complex, target: complex, arc: OffsetArc | None
) -> tuple[CenterMove, complex]:
    """First move, and its direction (arcs have none). Raises `GeometryError`.

    LinuxCNC's, longer than the tool's radius, ends beside its end point, an arc tangent there to the programmed one;
    Fanuc's where the next one says.

    Examples
    --------
    >>> enter(RadiusCompensation(1, 3.0, (0, 1, 2), 1.0), 0j, 10 + 0j, None)[0].end
    (10+3j)
    """
    if cutter.straight:
        refuse_if(arc is not None, "an arc as the first move of cutter compensation", "G0 or G1")
        cutter.entering = True
        return CenterMove(target), 0j
    refuse_if(
        abs(target - start) <= cutter.radius,
        f"the entry move of cutter compensation is {abs(target - start):.4f} mm long in its plane",
        f"more than the tool's radius of {cutter.radius:g} mm",
    )
    element = _element(start, target, arc)
    end = cutter.beside(target, direction(element, target))
    if arc is None:
        return CenterMove(end), (end - target) / cutter.radius
    if cutter.side * arc.turn > 0:
        _check_fits(cutter, abs(arc.center - start) - TIGHT)
    chord, inward = start - end, (arc.center - end) / abs(arc.center - end)
    along = (chord * inward.conjugate()).real
    refuse_if(abs(along) < FLAT * abs(chord), "an entry arc that the tool's radius makes straight", SMALLER)
    return CenterMove(end, center=end + inward * abs(chord) ** 2 / (2.0 * along)), 0j


def go_on(cutter: RadiusCompensation, start: complex, target: complex, arc: OffsetArc | None) -> CenterMove:
    """Further move, straight or an arc. Raises `GeometryError` if the tool cannot follow it or controls differ."""
    element = _element(start, target, arc)
    if arc is not None and cutter.side * arc.turn > 0:
        _check_fits(cutter, abs(arc.center - target))
    ahead, end = direction(element, start), cutter.beside(target, direction(element, target))
    beside, before = cutter.beside(start, ahead), (cutter.center - start) / (cutter.side * 1j * cutter.radius)
    if not cutter.straight:
        return _turn_off(cutter, start, before, ahead, (beside, end), arc, CORNER)
    alone = len(cutter.pending) < 2 or cutter.rounded
    if cutter.entering:
        problem = "a move along the tool right after the first move of cutter compensation"
        refuse_if(not alone, problem, "it before G41")
        cutter.entering = False
        return CenterMove(end, trim=beside)
    turn = cmath.phase(ahead / before)
    if abs(turn) <= TURNED:
        return CenterMove(end)
    refuse_if(not alone, "a move along the tool in a corner (G41, G42)", "it where the contour is smooth")
    problem = "a contour under cutter compensation that turns back on itself"
    refuse_if(abs(turn) > math.pi - TURNED, problem, "another contour")
    if turn * cutter.side > 0.0 or cutter.rounded:  # an inside corner, as LinuxCNC has it
        return _turn_off(cutter, start, before, ahead, (beside, end), arc, TURNED)
    acute = abs(turn) > math.pi / 2.0 + SHARP  # straight moves go round, a straight move before it is made longer
    reach = cutter.radius * (1.0 if acute else math.tan(abs(turn) / 2.0))
    way = [cutter.center + reach * before, *([beside - reach * ahead] if acute else []), *([beside] if arc else [])]
    longer = way.pop(0) if cutter.pending[0].arc is None else None
    return CenterMove(end, trim=longer, outside=True, way=tuple(way))


def _element(start: complex, target: complex, arc: OffsetArc | None) -> Element:
    return (start, target, None, 0) if arc is None else (start, target, arc.center, arc.turn)


def _check_fits(cutter: RadiusCompensation, radius: float) -> None:
    """Raise `GeometryError` for an arc that the tool, on its inside, cannot follow."""
    refuse_if(
        radius <= cutter.radius,
        f"an inside arc of radius {radius:.4f} mm",
        f"more than the tool's radius, {cutter.radius:g} mm",
    )


def _turn_off(
    cutter: RadiusCompensation,
    start: complex,
    before: complex,
    ahead: complex,
    ends: tuple[complex, complex],
    arc: OffsetArc | None,
    least: float,
) -> CenterMove:
    """Move of the tool centre that starts in another direction than the last one ended; `least`: smallest corner.

    Raises `GeometryError`.
    """
    (beside, end), last, center = ends, cutter.pending[0].arc, cutter.center
    corner = (math.pi / 2.0 - cutter.side * cmath.phase(ahead / before)) % math.tau - math.pi / 2.0  # above 0: convex
    if arc is None:  # as over the arch of an "h" and along its stem: the tool stays outside, it does not go round
        over = corner > math.pi - CORNER and last is not None and cutter.side * last.turn < 0
    else:
        over = abs(corner - math.pi) < CORNER and cutter.side * arc.turn < 0
    if corner < -least or corner > math.pi + least or over:
        path = (center - before, center, None, 0) if last is None else _element(center, center, last)
        following = (beside, end, None, 0) if arc is None else _element(end, end, arc)
        places, turned = meetings(path, following), last.turn * cutter.side if last is not None else 0
        refuse_if(not places, GOUGE, SMALLER)
        beyond = -turned if arc is None else arc.turn * (turned or cutter.side)  # off a circle, from inside onto it
        return CenterMove(end, trim=places[beyond > 0])
    if corner > least:
        return CenterMove(end, trim=center if arc is None else None, corner=beside)
    return CenterMove(end)
