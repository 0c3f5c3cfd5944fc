"""Circles of a cutter-location file in mm: direction, sweep, and whether start, end and radius agree.

- `CIRCLE/x,y,z,i,j,k,r`: by the right hand about i, j, k (PTC, "CL Output for Circular Interpolation").
- `CIRCLE/x,y,z,i,j,k`: by the right hand too (files of a post for CAMplete, whose arcs enter smoothly so).
- `CIRCLE/x,y,z,i,j,k,r,t,f,d,e`: clockwise about i, j, k (Siemens NX, "CLSF Manager": "assuming a clockwise direction";
  Autodesk's post for CAMplete).
- `MOVARC/x,y,z,i,j,k,r,ANGLE,a`: by the right hand (ISO 4343; Autodesk's post for it).
- `INDIRV/i,j,k` before `CIRCLE/x,y,z,r` or `TLON,GOFWD/(CIRCLE/...)`: the direction at the start.
"""

import cmath
import math
from dataclasses import dataclass

from toolpath_stiff.nc.elements import meetings
from toolpath_stiff.nc.geometry import RELATIVE_TOLERANCE, GeometryError, Vector, check_bulge, cross, dot, refuse_if
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


@dataclass(frozen=True)
class Circle:
    """A circle that the next motion follows: centre, unit axis (the motion is right-handed about it), radius.

    The radius is nan where the file gives none. `sweep` is the angle in degrees, if given; `line`
    that of the file.
    """

    center: Vector
    axis: Vector
    radius: float
    line: int
    sweep: float | None = None


def along(point: Vector, direction: Vector, distance: float) -> Vector:
    """A point moved by a distance."""
    x, y, z = (p + distance * d for p, d in zip(point, direction, strict=True))
    return (x, y, z)


def minus(a: Vector, b: Vector) -> Vector:
    """Difference."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _in_plane(circle: Circle, start: Vector) -> tuple[Vector, Vector]:
    """Axes of the circle's plane, the first towards the start, projected onto the plane."""
    out = minus(start, circle.center)
    out = along(out, circle.axis, -dot(out, circle.axis))
    length = math.sqrt(dot(out, out))
    refuse_if(length < SAME_POINT, "a circle whose centre is the tool's position", "a centre apart from it")
    first = (out[0] / length, out[1] / length, out[2] / length)
    return first, cross(circle.axis, first)


def arc_to(circle: Circle, start: Vector, end: Vector) -> Arc:
    """Arc from start to end. Raises `GeometryError` if they do not lie on the circle within its tolerance."""
    first, second = _in_plane(circle, start)
    from_center, to_end = minus(start, circle.center), minus(end, circle.center)
    radius, there = dot(from_center, first), complex(dot(to_end, first), dot(to_end, second))
    allowed = min(max(ROUNDING_MM, RELATIVE_TOLERANCE * radius), LARGEST_DIFFERENCE)
    expected, last = f"radii that agree within {allowed:.4f} mm", abs(there)
    if last < SAME_POINT or abs(last - radius) > allowed:
        problem = (
            f"an arc whose end lies {abs(last - radius):.4f} mm off its circle (radius {radius:.4f} mm at the start"
        )
        raise GeometryError(f"{problem}, {last:.4f} mm at the end)", expected)
    if abs(circle.radius - radius) > allowed:  # never true if the file gives no radius
        problem = f"whose centre lies {radius:.4f} mm from the tool's position"
        raise GeometryError(f"a circle of radius {circle.radius:.4f} mm {problem}", expected)
    center = along(circle.center, circle.axis, dot(from_center, circle.axis))
    sweep = _sweep(circle, radius, there)
    check_bulge(radius, sweep)
    return Arc(center, circle.axis, sweep)


def _sweep(circle: Circle, here: float, there: complex) -> float:
    angle = cmath.phase(there)
    angle = angle + math.tau if abs(there - here) < SAME_POINT_MM else angle % math.tau
    if circle.sweep is not None:
        angle += math.tau * round((math.radians(circle.sweep) - angle) / math.tau)
        if angle <= 0.0 or abs(math.degrees(angle) - circle.sweep) > SWEEP_TOLERANCE_DEG:
            problem = f"an arc of {math.degrees(angle % math.tau):.3f} degrees where ANGLE says {circle.sweep:g}"
            raise GeometryError(problem, "an end that is that far along the circle")
    return angle


def turned_as(center: Vector, axis: Vector, start: Vector, direction: Vector) -> Vector:
    """Axis with the sign for which a motion from the start begins in a direction. Raises `GeometryError`."""
    tangent = cross(axis, minus(start, center))
    size = math.sqrt(dot(tangent, tangent) * dot(direction, direction))
    across = size < SAME_POINT or abs(dot(tangent, direction)) < 0.5 * size
    refuse_if(across, "a direction (INDIRV) that does not go along the circle", "the tangent at the start")
    return axis if dot(tangent, direction) > 0.0 else (-axis[0], -axis[1], -axis[2])


def line_meets(circle: Circle, start: Vector, line: tuple[Vector, Vector], which: int) -> Vector:
    """Point where a motion along the circle meets a line for the first or second time. Raises `GeometryError`.

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
    apart, near = [minus(point, circle.center) for point in line], 10.0 * SAME_POINT_MM
    p, q = (complex(dot(point, first), dot(point, second)) for point in apart)
    refuse_if(abs(q - p) < SAME_POINT, "a line of no length", "two points")
    radius = dot(minus(start, circle.center), first)
    places = meetings((p, q, None, 0), (complex(radius), complex(radius), 0j, 1))
    refuse_if(not places, "a line that does not meet its circle", "one that does")
    # If the line goes through the start, that is met after a whole turn.
    order = sorted(places, key=lambda place: cmath.phase(place) % math.tau or math.tau)
    order.sort(key=lambda place: abs(place - radius) < near)
    place = order[which - 1]
    if abs(abs(q) - radius) < near < abs(q - place):
        problem = "a line whose second point lies on the circle, where the motion does not end"
        raise GeometryError(problem, "that point at the intersection that is asked for")
    rise = dot(minus(start, circle.center), circle.axis)
    flat = along(along(circle.center, first, place.real), second, place.imag)
    return along(flat, circle.axis, rise)
