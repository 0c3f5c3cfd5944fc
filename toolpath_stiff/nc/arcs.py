"""Arc geometry of G2 and G3 in the active plane: centre and signed sweep, with LinuxCNC's tolerances. mm."""

from __future__ import annotations

import math

# LinuxCNC's defaults (manual, "INI configuration", CENTER_ARC_RADIUS_TOLERANCE_MM; interp_arc.cc): start and end radius
# may differ by a thousandth of the radius, or by 0.00127 mm if that is more, and never by more than 0.127 mm.
RELATIVE_TOLERANCE = 1e-3
ABSOLUTE_TOLERANCE = 1.27e-3
LARGEST_DIFFERENCE = 100.0 * ABSOLUTE_TOLERANCE
RADIUS_FORMAT_TOLERANCE = 1.27e-2  # a half chord may exceed R by this much (interp_internal.hh)
SAME_POINT = 1e-12

PLANES = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}  # first, second axis, normal: right-handed
CENTER_WORDS = ("I", "J", "K")
CENTER_LETTERS = "IJKR"  # words that an arc alone has

Point2 = tuple[float, float]


class ArcError(Exception):
    """What is wrong with an arc: found, expected."""

    def __init__(self, found: str, expected: str) -> None:
        super().__init__(found)
        self.found, self.expected = found, expected


def center_from_radius(start: Point2, end: Point2, radius: float, clockwise: bool) -> Point2:
    """Centre of an arc given by R; a negative radius takes the longer way. Raises `ArcError`."""
    if start == end:
        raise ArcError("an arc with R that ends where it starts", "another end point, or I, J, K for a full circle")
    if radius == 0.0:
        raise ArcError("an arc of radius 0", "R other than 0")
    chord = math.dist(start, end)
    half, size = chord / 2.0, abs(radius)
    if half - size > RADIUS_FORMAT_TOLERANCE:
        raise ArcError(
            f"an arc whose radius {size:g} mm cannot reach its end {chord:.4f} mm away",
            f"a radius of at least {half:.4f} mm",
        )
    height = math.sqrt(max(size * size - half * half, 0.0))
    # The centre lies left of the chord for a short counter-clockwise arc.
    side = 1.0 if (radius > 0.0) != clockwise else -1.0
    along = ((end[0] - start[0]) / chord, (end[1] - start[1]) / chord)
    middle = ((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0)
    return (middle[0] - side * height * along[1], middle[1] + side * height * along[0])


def check_radii(start: Point2, end: Point2, center: Point2) -> None:
    """Raise `ArcError` if start and end do not lie on one circle about the centre within LinuxCNC's tolerance."""
    first, last = math.dist(start, center), math.dist(end, center)
    if first < SAME_POINT or last < SAME_POINT:
        raise ArcError("an arc of radius 0", "a centre apart from the start and the end point")
    difference = abs(first - last)
    relative = difference / max(first, last)
    if difference > LARGEST_DIFFERENCE or (difference > ABSOLUTE_TOLERANCE and relative > RELATIVE_TOLERANCE):
        allowed = min(max(ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE * max(first, last)), LARGEST_DIFFERENCE)
        raise ArcError(
            f"an arc whose end lies {difference:.4f} mm off its circle (radius {first:.4f} mm at the start, "
            f"{last:.4f} mm at the end)",
            f"radii that agree within {allowed:.4f} mm",
        )


def arc_sweep(start: Point2, end: Point2, center: Point2, clockwise: bool, turns: int) -> float:
    """Signed angle in rad (counter-clockwise positive); start = end is a full circle; P words add whole turns."""
    first = math.atan2(start[1] - center[1], start[0] - center[0])
    last = math.atan2(end[1] - center[1], end[0] - center[0])
    sweep = (first - last if clockwise else last - first) % math.tau
    # The modulus of a tiny negative difference is almost a whole turn, and must be one.
    if sweep < 1e-10:
        sweep = math.tau
    sweep += math.tau * (turns - 1)
    return -sweep if clockwise else sweep
