"""Corners between contour elements in their plane, whose points are complex numbers: chamfers, roundings. mm, rad.

An element is a line, or an arc about a centre: start, end, centre (None: a line), turn (+1 counter-clockwise). The
centre of a rounding lies where the two elements, set off to its side by its radius, meet next to the corner.
"""

import cmath
import math

from toolpath_stiff.nc.geometry import refuse_if, turn_between

Element = tuple[complex, complex, complex | None, int]
Contour = list[Element]
STRAIGHT_ON = 1e-6  # rad
REACHED = 1e-9  # mm, rad
TOO_LONG = "a corner that does not fit its contour elements"


def direction(element: Element, place: complex) -> complex:
    """Unit vector along an element at one of its points."""
    start, end, center, turn = element
    ahead = end - start if center is None else turn * 1j * (place - center)
    refuse_if(not abs(ahead), "a corner at an element of no length", "two elements")
    return ahead / abs(ahead)


def swept(element: Element) -> float:
    """Signed angle of an arc; 0 of a line."""
    start, end, center, turn = element
    return turn_between(cmath.phase(start - center), cmath.phase(end - center), turn < 0) if center is not None else 0.0


def _foot(element: Element, place: complex) -> complex:
    """Point of an element nearest to a place beside it."""
    start, _, center, _ = element
    if center is not None:
        return center + abs(start - center) * (place - center) / abs(place - center)
    along = direction(element, start)
    return start + along * ((place - start) / along).real


def _holds(element: Element, place: complex) -> bool:
    """True if a point of an element lies between its ends."""
    start, end, center, turn = element
    if center is None:
        return -REACHED <= ((place - start) / (end - start)).real <= 1.0 + REACHED
    begin, here, last = (cmath.phase(point - center) for point in (start, place, end))
    part, whole = (abs(turn_between(begin, angle, turn < 0)) for angle in (here, last))
    return part <= whole + REACHED or math.tau - part < REACHED


def meetings(first: Element, second: Element, left: float = 0.0) -> tuple[complex, ...]:
    """Points where two elements, both offset to the left, meet: none or two, which coincide for two lines.

    In the order along the line; of two arcs the one to the right of the way from the first's centre to the second's.
    """
    if first[2] is None and second[2] is not None:
        first, second = second, first
    v = direction(second, second[0]) if second[2] is None else 0j
    line = second[0] + left * 1j * v
    if first[2] is None:
        u = direction(first, first[0])
        apart = line - (first[0] + left * 1j * u)
        return (first[0] + left * 1j * u + u * (apart.conjugate() * v).imag / (u.conjugate() * v).imag,) * 2
    radius = abs(first[0] - first[2]) - first[3] * left
    if second[2] is None:
        middle, across = line + v * ((first[2] - line) / v).real, v
        square = radius**2 - abs(first[2] - middle) ** 2
    else:
        apart, other = second[2] - first[2], abs(second[0] - second[2]) - second[3] * left
        if not abs(apart) or other <= 0.0:
            return ()
        along = (abs(apart) ** 2 + radius**2 - other**2) / (2.0 * abs(apart))
        middle, across = first[2] + along * apart / abs(apart), 1j * apart / abs(apart)
        square = radius**2 - along**2
    if radius <= 0.0 or square < 0.0:
        return ()
    return tuple(middle + sign * math.sqrt(square) * across for sign in (-1.0, 1.0))


def cut_off(
    before: Element, after: Element, size: float, rounded: bool
) -> tuple[complex, complex, complex | None, int] | None:
    """Begin, end, centre and turn of the corner between two elements; a chamfer has no centre; None: no corner.

    Raises `GeometryError` where it does not fit.

    Examples
    --------
    >>> cut_off((0j, 9 + 0j, None, 0), (9 + 0j, 9 + 9j, None, 0), 2.0, rounded=True)
    ((7+0j), (9+2j), (7+2j), 1)
    """
    apex = before[1]
    u, v = direction(before, apex), direction(after, apex)
    turned = cmath.phase(v / u)
    if abs(turned) < STRAIGHT_ON:
        return None
    refuse_if(math.pi - abs(turned) < STRAIGHT_ON, "a corner where the path goes straight back", "another one")
    turn = 1 if turned > 0.0 else -1
    begin, end, center = apex - size * u, apex + size * v, None
    if rounded:
        places = meetings(before, after, turn * size)
        refuse_if(not places, TOO_LONG, "a smaller one")
        center = min(places, key=lambda place: abs(place - apex))
        begin, end = (_foot(element, center) for element in (before, after))
    refuse_if(not (_holds(before, begin) and _holds(after, end)), TOO_LONG, "a smaller one")
    return begin, end, center, turn
