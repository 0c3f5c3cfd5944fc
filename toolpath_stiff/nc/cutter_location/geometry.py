"""Geometry of a cutter-location file, which knows no file: circles in mm, tool axes in degrees.

Circles: which way round, how far, and whether start, end and radius agree.

- `CIRCLE/x,y,z,i,j,k,r`: by the right hand about i, j, k (PTC, "CL Output for Circular Interpolation").
- `CIRCLE/x,y,z,i,j,k`: by the right hand too (files of a post for CAMplete, whose arcs enter smoothly so).
- `CIRCLE/x,y,z,i,j,k,r,t,f,d,e`: clockwise about i, j, k (Siemens NX, "CLSF Manager": "assuming a clockwise direction";
  Autodesk's post for CAMplete).
- `MOVARC/x,y,z,i,j,k,r,ANGLE,a`: by the right hand (ISO 4343; Autodesk's post for it).
- `INDIRV/i,j,k` before `CIRCLE/x,y,z,r` or `TLON,GOFWD/(CIRCLE/...)`: the direction at the start.

Tool axes as roll and pitch, and moves divided where the axis turns. A machine that is told two tool axes turns the tool
in their plane, along the great circle between them. Our moves turn
roll and pitch linearly. On the unit sphere with roll a as latitude and pitch b as longitude a geodesic of angle t has
a'' = -sin a cos a b'^2 and b'' = 2 tan a a' b' (do Carmo, "Differential Geometry of Curves and Surfaces", 4-4). With
y = cos a b' / t, which is the share of its speed across, both together are tan|a| y sqrt(4 - 3 y^2) t^2 long, and the
linear interpolation departs by at most an eighth of the largest of them. Along the geodesic y cos a is constant
(Clairaut), the y component of its normal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from toolpath_stiff.nc.geometry import (
    RELATIVE_TOLERANCE,
    ArcError,
    Point2,
    Vector,
    check_bulge,
    roll_pitch_of_axis,
)
from toolpath_stiff.nc.moves import Arc
from toolpath_stiff.units import MM_PER_INCH

VERTICAL: Vector = (0.0, 0.0, 1.0)
SAME_POINT = 1e-12
SAME_POINT_MM = 5e-4  # start and end closer than this are one point: a whole turn
# Radii may differ by a thousandth, as LinuxCNC allows, but not by more than 0.127 mm; or by what two points rounded to
# 0.0001 inch in each axis make of them.
LARGEST_DIFFERENCE = 0.127
ROUNDING_MM = 2.0 * math.sqrt(3.0) * 0.5e-4 * MM_PER_INCH
SMOOTH_DEG = 5.0  # a path that enters an arc within this of its tangent enters it smoothly
SWEEP_TOLERANCE_DEG = 0.05
AXIS_TOLERANCE = 1e-3  # of the length of a unit vector: four decimals and a little more
GREAT_CIRCLE_DEG = 0.01  # how far the tool axis may leave the great circle within a move
STEEPEST = 89.0  # deg of roll up to which that holds; at 90 pitch is not defined
TURNED_OVER = 179.0  # deg: beyond, two axes do not say in which plane the tool turns


@dataclass(frozen=True)
class Circle:
    """A circle that the next motion follows: centre, unit axis (the motion is right-handed about it), radius.

    The radius is nan where the file gives none. `turns` are whole turns, given for a start that is the end; `sweep` is
    the angle in degrees, if given.
    """

    center: Vector
    axis: Vector
    radius: float
    turns: int = 1
    sweep: float | None = None


def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def along(point: Vector, direction: Vector, distance: float) -> Vector:
    """A point moved by a distance."""
    x, y, z = (p + distance * d for p, d in zip(point, direction, strict=True))
    return (x, y, z)


def minus(a: Vector, b: Vector) -> Vector:
    """Difference."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _in_plane(circle: Circle, start: Vector) -> tuple[Vector, Vector]:
    """Axes of the circle's plane, the first towards the start as far as that lies in the plane."""
    out = minus(start, circle.center)
    out = along(out, circle.axis, -dot(out, circle.axis))
    length = math.sqrt(dot(out, out))
    if length < SAME_POINT:
        raise ArcError("a circle whose centre is the tool's position", "a centre apart from it")
    first = (out[0] / length, out[1] / length, out[2] / length)
    return first, cross(circle.axis, first)


def arc_to(circle: Circle, start: Vector, end: Vector) -> Arc:
    """The arc from start to end. Raises `ArcError` where they do not lie on the circle within its tolerance."""
    first, second = _in_plane(circle, start)
    from_center, to_end = minus(start, circle.center), minus(end, circle.center)
    here = (dot(from_center, first), 0.0)
    there = (dot(to_end, first), dot(to_end, second))
    radius, last = here[0], math.hypot(*there)
    allowed = min(max(ROUNDING_MM, RELATIVE_TOLERANCE * radius), LARGEST_DIFFERENCE)
    if last < SAME_POINT or abs(last - radius) > allowed:
        raise ArcError(
            f"an arc whose end lies {abs(last - radius):.4f} mm off its circle (radius {radius:.4f} mm at the start, "
            f"{last:.4f} mm at the end)",
            f"radii that agree within {allowed:.4f} mm",
        )
    if abs(circle.radius - radius) > allowed:  # never, if the file gives no radius
        raise ArcError(
            f"a circle of radius {circle.radius:.4f} mm whose centre lies {radius:.4f} mm from the tool's position",
            f"radii that agree within {allowed:.4f} mm",
        )
    center = along(circle.center, circle.axis, dot(from_center, circle.axis))
    sweep = _sweep(circle, here, there)
    check_bulge(radius, sweep)
    return Arc(center, circle.axis, sweep)


def _sweep(circle: Circle, here: Point2, there: Point2) -> float:
    angle = math.atan2(there[1], there[0])
    whole = math.dist(here, there) < SAME_POINT_MM
    angle = angle + math.tau * circle.turns if whole else angle % math.tau
    if circle.turns > 1 and not whole:
        raise ArcError("a helix of several turns that does not end above its start", "one CIRCLE a turn")
    if circle.sweep is not None:
        angle += math.tau * round((math.radians(circle.sweep) - angle) / math.tau)
        if angle <= 0.0 or abs(math.degrees(angle) - circle.sweep) > SWEEP_TOLERANCE_DEG:
            raise ArcError(
                f"an arc of {math.degrees(angle % math.tau):.3f} degrees where ANGLE says {circle.sweep:g}",
                "an end that is that far along the circle",
            )
    return angle


def turned_as(center: Vector, axis: Vector, start: Vector, direction: Vector) -> Vector:
    """The axis with the sign that makes a motion from the start begin in a direction. Raises `ArcError`."""
    tangent = cross(axis, minus(start, center))
    size = math.sqrt(dot(tangent, tangent) * dot(direction, direction))
    if size < SAME_POINT or abs(dot(tangent, direction)) < 0.5 * size:
        raise ArcError("a direction (INDIRV) that does not go along the circle", "the tangent at the start")
    return axis if dot(tangent, direction) > 0.0 else (-axis[0], -axis[1], -axis[2])


def line_meets(circle: Circle, start: Vector, line: tuple[Vector, Vector], which: int) -> Vector:
    """Where a motion along the circle meets a line for the first or second time. Raises `ArcError`.

    Parameters
    ----------
    circle, start
        The motion.
    line
        Two points of the line; it goes on beyond them.
    which
        1 or 2: APT's `ON,(LINE/...)` and `ON,2,INTOF,(LINE/...)`.
    """
    first, second = _in_plane(circle, start)
    a, b = (minus(point, circle.center) for point in line)
    p, q = (dot(a, first), dot(a, second)), (dot(b, first), dot(b, second))
    length = math.dist(p, q)
    if length < SAME_POINT:
        raise ArcError("a line of no length", "two points")
    u = ((q[0] - p[0]) / length, (q[1] - p[1]) / length)
    foot = -(p[0] * u[0] + p[1] * u[1])
    miss = abs(p[0] * u[1] - p[1] * u[0])
    radius = dot(minus(start, circle.center), first)
    if miss > radius:
        raise ArcError("a line that does not meet its circle", "one that does")
    half = math.sqrt(radius * radius - miss * miss)
    met = [(p[0] + (foot + s * half) * u[0], p[1] + (foot + s * half) * u[1]) for s in (-1.0, 1.0)]
    # The start itself, if the line goes through it, is met after a whole turn.
    order = sorted(met, key=lambda m: math.atan2(m[1], m[0]) % math.tau or math.tau)
    order.sort(key=lambda m: math.dist(m, (radius, 0.0)) < 10.0 * SAME_POINT_MM)
    x, y = order[which - 1]
    if abs(math.hypot(*q) - radius) < 10.0 * SAME_POINT_MM and math.dist(q, (x, y)) > 10.0 * SAME_POINT_MM:
        raise ArcError(
            "a line whose second point lies on the circle, where the motion does not end",
            "that point at the intersection that is asked for",
        )
    rise = dot(minus(start, circle.center), circle.axis)
    flat = along(along(circle.center, first, x), second, y)
    return along(flat, circle.axis, rise)


def unit_axis(numbers: Sequence[float], what: str = "a tool axis") -> Vector:
    """An axis of length 1. Raises `ArcError` if the given one is further off than `AXIS_TOLERANCE`."""
    i, j, k = numbers
    length = math.sqrt(i * i + j * j + k * k)
    if abs(length - 1.0) > AXIS_TOLERANCE:
        raise ArcError(f"{what} {i:g},{j:g},{k:g} of length {length:.6g}", f"a unit vector, within {AXIS_TOLERANCE:g}")
    return (i / length, j / length, k / length)


def angles_near(axis: Vector, near: tuple[float, float]) -> tuple[float, float]:
    """Roll and pitch of a unit tool axis, the pitch within half a turn of the one before."""
    i, j, k = axis
    roll, pitch = roll_pitch_of_axis(i, j, k)
    if i * i + k * k < 1e-18:  # along Y any pitch gives this axis
        return roll, near[1]
    # Adding 0 makes a 0 of -0.
    return roll + 0.0, pitch + 360.0 * round((near[1] - pitch) / 360.0)


def angle_between(first: Vector, second: Vector) -> float:
    """Degrees between two unit vectors; exact for small ones too."""
    return math.degrees(2.0 * math.asin(min(1.0, math.dist(first, second) / 2.0)))


def angle_of(first: Vector, second: Vector) -> float:
    """Degrees between two vectors of any length, nan where one has none."""
    x, y, z = cross(first, second)
    if min(dot(first, first), dot(second, second)) < 1e-18:
        return math.nan
    return math.degrees(math.atan2(math.sqrt(x * x + y * y + z * z), dot(first, second)))


def division(first: Vector, second: Vector) -> int:
    """Into how many equal parts a turn of the tool axis is divided. Raises `ArcError` where it turns over."""
    chord = math.dist(first, second)
    if chord < 0.008 and abs(first[1]) < 0.9 and abs(second[1]) < 0.9:
        return 1  # half a degree and less, of a tool well away from Y: what most moves turn by
    angle = angle_between(first, second)
    if angle > TURNED_OVER:
        raise ArcError(f"a tool axis that turns over by {angle:.1f} degrees within one move", "points in between")
    turn = math.radians(angle)
    steepest = math.radians(min(_steepest_roll(first, second, turn), STEEPEST))
    normal_y = abs(first[2] * second[0] - first[0] * second[2]) / math.sin(turn)
    across = min((normal_y / math.cos(steepest)) ** 2, 2.0 / 3.0)  # y^2; beyond 2/3 y sqrt(4 - 3 y^2) falls again
    departure = math.sqrt(across * (4.0 - 3.0 * across)) * math.tan(steepest) * turn**2 / 8.0
    return max(1, math.ceil(math.sqrt(departure / math.radians(GREAT_CIRCLE_DEG))))


def _steepest_roll(first: Vector, second: Vector, angle: float) -> float:
    """Greatest roll in degrees on the way: sin(roll) is -j, and j = j0 cos t + g sin t along the great circle."""
    sine = max(abs(first[1]), abs(second[1]))
    if angle > 1e-9:
        growth = (second[1] - first[1] * math.cos(angle)) / math.sin(angle)
        if 0.0 < math.atan2(growth, first[1]) % math.pi < angle:
            sine = math.hypot(first[1], growth)
    return math.degrees(math.asin(min(sine, 1.0)))


def on_great_circle(first: Vector, second: Vector, share: float) -> Vector:
    """The unit vector at a share of the way from one to another."""
    angle = math.radians(angle_between(first, second))
    if angle < 1e-9:
        return second
    near, far = math.sin((1.0 - share) * angle) / math.sin(angle), math.sin(share * angle) / math.sin(angle)
    x, y, z = (near * a + far * b for a, b in zip(first, second, strict=True))
    return (x, y, z)
