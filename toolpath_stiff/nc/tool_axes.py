"""Tool axes as roll and pitch, and moves divided where the axis turns; degrees.

A machine that is told two tool axes turns the tool in their plane, along the great circle between them. Our moves turn
roll and pitch linearly. On the unit sphere with roll a as latitude and pitch b as longitude a geodesic of angle t has
a'' = -sin a cos a b'^2 and b'' = 2 tan a a' b' (do Carmo, "Differential Geometry of Curves and Surfaces", 4-4). With
y = cos a b' / t, which is the share of its speed across, both together are tan|a| y sqrt(4 - 3 y^2) t^2 long, and the
linear interpolation departs by at most an eighth of the largest of them. Along the geodesic y cos a is constant
(Clairaut), the y component of its normal.
"""

import math
from collections.abc import Sequence

from toolpath_stiff.nc.geometry import GeometryError, Vector, cross, dot, roll_pitch_of_axis

OFF_UNIT = 1e-3  # of the length of a unit vector: four decimals and a little more
GREAT_CIRCLE_DEG = 0.01  # how far the tool axis may leave the great circle within a move
STEEPEST = 89.0  # deg of roll up to which that holds; at 90 pitch is not defined
TURNED_OVER = 179.0  # deg: beyond, two axes do not say in which plane the tool turns


def unit_axis(numbers: Sequence[float], what: str = "a tool axis") -> Vector:
    """Axis of length 1. Raises `GeometryError` if the given one is further off than `OFF_UNIT`."""
    i, j, k = numbers
    length = math.sqrt(i * i + j * j + k * k)
    if abs(length - 1.0) > OFF_UNIT:
        raise GeometryError(f"{what} {i:g},{j:g},{k:g} of length {length:.6g}", f"a unit vector, within {OFF_UNIT:g}")
    return (i / length, j / length, k / length)


def angles_near(axis: Vector, near: tuple[float, float]) -> tuple[float, float]:
    """Roll and pitch of a unit tool axis, the pitch within half a turn of the previous one."""
    i, j, k = axis
    roll, pitch = roll_pitch_of_axis(i, j, k)
    if i * i + k * k < 1e-18:  # along Y any pitch gives this axis
        return roll, near[1]
    # Adding 0 makes a 0 of -0.
    return roll + 0.0, pitch + 360.0 * round((near[1] - pitch) / 360.0)


def angle_of(first: Vector, second: Vector) -> float:
    """Angle in degrees between two vectors of any length; nan if one has no length."""
    x, y, z = cross(first, second)
    if min(dot(first, first), dot(second, second)) < 1e-18:
        return math.nan
    return math.degrees(math.atan2(math.sqrt(x * x + y * y + z * z), dot(first, second)))


def division(first: Vector, second: Vector) -> int:
    """Number of equal parts for a turn of the tool axis. Raises `GeometryError` if it turns over."""
    chord = math.dist(first, second)
    if chord < 0.008 and abs(first[1]) < 0.9 and abs(second[1]) < 0.9:
        return 1  # most moves: half a degree or less, with the tool well away from Y
    angle = angle_of(first, second)
    if angle > TURNED_OVER:
        raise GeometryError(f"a tool axis that turns over by {angle:.1f} degrees within one move", "points in between")
    turn = math.radians(angle)
    steepest = math.radians(min(_steepest_roll(first, second, turn), STEEPEST))
    normal_y = abs(first[2] * second[0] - first[0] * second[2]) / math.sin(turn)
    across = min((normal_y / math.cos(steepest)) ** 2, 2.0 / 3.0)  # y^2; beyond 2/3 y sqrt(4 - 3 y^2) falls again
    departure = math.sqrt(across * (4.0 - 3.0 * across)) * math.tan(steepest) * turn**2 / 8.0
    return max(1, math.ceil(math.sqrt(departure / math.radians(GREAT_CIRCLE_DEG))))


def _steepest_roll(first: Vector, second: Vector, angle: float) -> float:
    """Greatest roll on the way, degrees: sin(roll) is -j, and j = j0 cos t + g sin t along the great circle."""
    sine = max(abs(first[1]), abs(second[1]))
    if angle > 1e-9:
        growth = (second[1] - first[1] * math.cos(angle)) / math.sin(angle)
        if 0.0 < math.atan2(growth, first[1]) % math.pi < angle:
            sine = math.hypot(first[1], growth)
    return math.degrees(math.asin(min(sine, 1.0)))


def on_great_circle(first: Vector, second: Vector, share: float) -> Vector:
    """Unit vector at a share of the way from one to another along the great circle."""
    angle = math.radians(angle_of(first, second))
    if angle < 1e-9:
        return second
    near, far = math.sin((1.0 - share) * angle) / math.sin(angle), math.sin(share * angle) / math.sin(angle)
    x, y, z = (near * a + far * b for a, b in zip(first, second, strict=True))
    return (x, y, z)
