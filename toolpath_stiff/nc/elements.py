"""Corners between contour elements in their plane, whose points are complex numbers: chamfers, and roundings of lines and
arcs. mm, rad.

The centre of a rounding lies where the two elements, set off to its side by its radius, meet next to the corner.
"""

import cmath
import math
from typing import NamedTuple

from toolpath_stiff.nc.geometry import refuse_arc_if, turn_between

STRAIGHT_ON = 1e-6  # rad
REACHED = 1e-9  # mm, rad
TOO_LONG = "a corner that does not fit its contour elements"


class Element(NamedTuple):
    """A line, or an arc about a centre (turn +1 counter-clockwise, -1 clockwise)."""

    start: complex
    end: complex
    center: complex | None = None
    turn: int = 0

    def direction(self, place: complex) -> complex:
        """Unit vector along it at one of its points."""
        ahead = self.end - self.start if self.center is None else self.turn * 1j * (place - self.center)
        refuse_arc_if(not abs(ahead), "a corner at an element of no length", "two elements")
        return ahead / abs(ahead)

    def foot(self, place: complex) -> complex:
        """Its point next to a place beside it."""
        if self.center is not None:
            return self.center + abs(self.start - self.center) * (place - self.center) / abs(place - self.center)
        along = self.direction(self.start)
        return self.start + along * ((place - self.start) / along).real

    def holds(self, place: complex) -> bool:
        """Whether one of its points lies between its ends."""
        if self.center is None:
            share = ((place - self.start) / (self.end - self.start)).real
            return -REACHED <= share <= 1.0 + REACHED
        angles = [cmath.phase(point - self.center) for point in (self.start, place, self.end)]
        clockwise = self.turn < 0
        part, whole = (abs(turn_between(angles[0], angle, clockwise)) for angle in angles[1:])
        return part <= whole + REACHED or math.tau - part < REACHED

    def meets(self, other: "Element", left: float, near: complex) -> complex | None:
        """Where it and another, both set off to the left, meet next to a point; None: nowhere."""
        if self.center is None and other.center is None:
            u, v = self.direction(self.start), other.direction(other.start)
            apart = (other.start + left * 1j * v) - (self.start + left * 1j * u)
            return self.start + left * 1j * u + u * (apart.conjugate() * v).imag / (u.conjugate() * v).imag
        if self.center is None:
            return other.meets(self, left, near)
        radius = abs(self.start - self.center) - self.turn * left
        if other.center is None:
            u = other.direction(other.start)
            middle = other.start + left * 1j * u
            middle += u * ((self.center - middle) / u).real
            across, square = u, radius**2 - abs(self.center - middle) ** 2
        else:
            apart, second = other.center - self.center, abs(other.start - other.center) - other.turn * left
            if not abs(apart) or second <= 0.0:
                return None
            along = (abs(apart) ** 2 + radius**2 - second**2) / (2.0 * abs(apart))
            middle, across = self.center + along * apart / abs(apart), 1j * apart / abs(apart)
            square = radius**2 - along**2
        if radius <= 0.0 or square < 0.0:
            return None
        return min((middle + sign * math.sqrt(square) * across for sign in (1.0, -1.0)), key=lambda z: abs(z - near))


def cut_off(
    before: Element, after: Element, size: float, rounded: bool
) -> tuple[complex, complex, complex | None, int] | None:
    """Begin, end, centre and turn of the corner between two elements; a chamfer has no centre; None: no corner.

    Raises `ArcError` where it does not fit.

    Examples
    --------
    >>> cut_off(Element(0j, 9 + 0j), Element(9 + 0j, 9 + 9j), 2.0, rounded=True)
    ((7+0j), (9+2j), (7+2j), 1)
    """
    apex = before.end
    u, v = before.direction(apex), after.direction(apex)
    turned = cmath.phase(v / u)
    if abs(turned) < STRAIGHT_ON:
        return None
    refuse_arc_if(math.pi - abs(turned) < STRAIGHT_ON, "a corner where the path goes straight back", "another one")
    turn = 1 if turned > 0.0 else -1
    begin, end, center = apex - size * u, apex + size * v, None
    if rounded:
        center = before.meets(after, turn * size, apex)
        if center is not None:
            begin, end = before.foot(center), after.foot(center)
    refuse_arc_if(rounded and center is None, TOO_LONG, "a smaller one")
    refuse_arc_if(not (before.holds(begin) and after.holds(end)), TOO_LONG, "a smaller one")
    return begin, end, center, turn
