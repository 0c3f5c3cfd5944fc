"""Geometry of words: planes, arcs of G2 and G3 within LinuxCNC's tolerances, corners, tool axes. mm, rad."""

import cmath
import math
from collections.abc import Sequence

from toolpath_stiff.nc.tables import LARGEST_MM
from toolpath_stiff.units import MM_PER_INCH

Point2 = tuple[float, float]
Vector = tuple[float, float, float]

# Of LinuxCNC's rs274 2.9, by bisection (the tests hold both sides of each): start and end radius may differ by a
# thousandth of the larger one, or by 2 sqrt(2) hundredths of a millimetre (thousandths of an inch in inch programs) if
# that is more, and never by more than a hundred times that. It leaves room for ends that are rounded to 0.01 mm.
RELATIVE_TOLERANCE = 1e-3
MM_TOLERANCE = 2.0 * math.sqrt(2.0) * 1e-2
INCH_TOLERANCE = 2.0 * math.sqrt(2.0) * 1e-3 * MM_PER_INCH
MOST_TOLERANCES = 100.0
RADIUS_FORMAT_TOLERANCE = 1.27e-3  # mm; a half chord may exceed R by this much, in inch programs too
SMALLEST_RADIUS = 1.27e-3  # mm; an arc of less is one of radius 0

PLANES = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}  # first, second axis, normal: right-handed
CENTER_WORDS = ("I", "J", "K")
CENTER_LETTERS = "IJKR"  # words that an arc alone has

NOWHERE = complex(math.nan, math.nan)
LEAST_SWEEP = 1e-10  # rad; an arc of less is a whole turn


def normal_of(plane: str) -> Vector:
    """Unit normal of a plane, in program axes.

    Examples
    --------
    >>> normal_of("G18")
    (0.0, 1.0, 0.0)
    """
    normal = PLANES[plane][2]
    return (float(normal == 0), float(normal == 1), float(normal == 2))


def turned(degrees: float, size: float = 1.0) -> complex:
    """A length in a direction of the plane; nan where one of them is not known."""
    return NOWHERE if math.isnan(degrees + size) else cmath.rect(size, math.radians(degrees))


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Sequence[float], b: Sequence[float]) -> Vector:
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


class GeometryError(Exception):
    """Error of an arc, a corner, a contour, a tool axis: what was found, what was expected."""

    def __init__(self, problem: str, expected: str) -> None:
        super().__init__(problem)
        self.found, self.expected = problem, expected


def refuse_if(wrong: object, problem: str, expected: str) -> None:
    """Raise `GeometryError` if `wrong`."""
    if wrong:
        raise GeometryError(problem, expected)


def center_from_radius(start: Point2, end: Point2, radius: float, clockwise: bool) -> Point2:
    """Centre of an arc given by R; a negative radius takes the longer way. Raises `GeometryError`.

    Examples
    --------
    >>> center_from_radius((0.0, 0.0), (20.0, 0.0), 10.0, clockwise=False)
    (10.0, 0.0)
    """
    chord, other = math.dist(start, end), "another end point, or I, J, K for a full circle"
    refuse_if(not chord, "an arc with R that ends where it starts", other)
    refuse_if(radius == 0.0, "an arc of radius 0", "R other than 0")
    half, size = chord / 2.0, abs(radius)
    if half - size > RADIUS_FORMAT_TOLERANCE:
        problem = f"an arc whose radius {size:g} mm cannot reach its end {chord:.4f} mm away"
        raise GeometryError(problem, f"a radius of at least {half:.4f} mm")
    height = math.sqrt(max(size * size - half * half, 0.0))
    # The centre lies left of the chord for a short counter-clockwise arc.
    side = 1.0 if (radius > 0.0) != clockwise else -1.0
    along = ((end[0] - start[0]) / chord, (end[1] - start[1]) / chord)
    middle = ((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0)
    return (middle[0] - side * height * along[1], middle[1] + side * height * along[0])


def check_radii(start: Point2, end: Point2, center: Point2, inch: bool = False) -> float:
    """The radius at the start; `GeometryError` if the end does not lie on its circle within LinuxCNC's tolerance.

    `inch`: it is an inch program, whose ends may be rounded to thousandths; the points are in mm all the same.

    Examples
    --------
    >>> check_radii((10.0, 0.0), (0.0, 10.001), (0.0, 0.0))
    10.0
    >>> check_radii((10.0, 0.0), (10.0, 0.0), (10.0, 0.0))
    Traceback (most recent call last):
        ...
    toolpath_stiff.nc.geometry.GeometryError: an arc of radius 0
    """
    first, last = math.dist(start, center), math.dist(end, center)
    if first < SMALLEST_RADIUS or last < SMALLEST_RADIUS:
        raise GeometryError("an arc of radius 0", "a centre apart from the start and the end point")
    difference, least = abs(first - last), INCH_TOLERANCE if inch else MM_TOLERANCE
    if difference <= least:  # of nearly all arcs
        return first
    allowed = min(max(least, RELATIVE_TOLERANCE * max(first, last)), MOST_TOLERANCES * least)
    if difference > allowed:
        radii = f"(radius {first:.4f} mm at the start, {last:.4f} mm at the end)"
        problem = f"an arc whose end lies {difference:.4f} mm off its circle {radii}"
        raise GeometryError(problem, f"radii that agree within {allowed:.4f} mm")
    return first


def check_bulge(radius: float, sweep: float) -> None:
    """Raise `GeometryError` if an arc goes further from its start than coordinates may: its ends do not bound it.

    Examples
    --------
    >>> check_bulge(1e9, 1e-7)
    """
    widest = 2.0 * radius
    if widest > LARGEST_MM and (away := widest * math.sin(min(abs(sweep), math.pi) / 2.0)) > LARGEST_MM:
        problem = f"an arc of radius {radius:g} mm that goes {away:g} mm away from its start"
        raise GeometryError(problem, f"at most {LARGEST_MM:g} mm")


def arc_sweep(start: Point2, end: Point2, center: Point2, clockwise: bool, turns: int) -> float:
    """Signed angle in rad (counter-clockwise positive); start = end is a full circle; P words add whole turns.

    Examples
    --------
    >>> math.degrees(arc_sweep((10.0, 0.0), (0.0, 10.0), (0.0, 0.0), clockwise=False, turns=1))
    90.0
    >>> math.degrees(arc_sweep((10.0, 0.0), (0.0, 10.0), (0.0, 0.0), clockwise=True, turns=1))
    -270.0
    """
    first = math.atan2(start[1] - center[1], start[0] - center[0])
    last = math.atan2(end[1] - center[1], end[0] - center[0])
    sweep = turn_between(first, last, clockwise)
    return sweep + math.copysign(math.tau * (turns - 1), sweep)


def sweep_about(center: Point2, start: Point2, end: Point2, clockwise: bool, inch: bool, turns: int = 1) -> float:
    """Signed angle of an arc in rad. Raises `GeometryError` unless start and end lie on one circle about the centre."""
    radius, sweep = check_radii(start, end, center, inch), arc_sweep(start, end, center, clockwise, turns)
    check_bulge(radius, sweep)
    return sweep


def turn_between(first: float, last: float, clockwise: bool) -> float:
    """Signed turn in rad from one polar angle to another, above 0 and up to a whole one in size."""
    sweep = (first - last if clockwise else last - first) % math.tau
    # A tiny negative difference modulo a turn is almost a whole turn, and must count as one.
    if sweep < LEAST_SWEEP:
        sweep = math.tau
    return -sweep if clockwise else sweep


def roll_pitch_of_axis(i: float, j: float, k: float) -> tuple[float, float]:
    """Roll and pitch in degrees that turn the spindle's z onto a tool axis, at a yaw of 0.

    With R = Rz(c) Ry(b) Rx(a) and c = 0 the tool axis, from the tip to the spindle, is R z = (sin b cos a, -sin a,
    cos b cos a) (the convention of `rotations`). Roll is in [-90, 90]; where it is +-90, pitch is 0.

    Parameters
    ----------
    i, j, k
        The tool axis from tip to spindle, of any length above 0.

    Examples
    --------
    >>> roll, pitch = roll_pitch_of_axis(0.0, 0.5, math.sqrt(0.75))
    >>> round(roll, 9), pitch
    (-30.0, 0.0)
    """
    across = math.hypot(i, k)
    return math.degrees(math.atan2(-j, across)), math.degrees(math.atan2(i, k)) if across else 0.0
