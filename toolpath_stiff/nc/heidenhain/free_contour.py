"""Free contour programming (FK): lines and arcs whose ends follow from what they and the next elements give. mm.

HEIDENHAIN, user's manual of the iTNC 530, "Path contours: FK free contour programming". An element waits until it is
determined. Circles have a direction (radius positive counter-clockwise), so that two of them, a circle and a line, or a
circle and a point have one common tangent along the path (E. Laguerre's directed circles). What has several solutions,
among which FSELECT chooses in an order that manuals only draw, is refused.
"""

import cmath
import math
from dataclasses import dataclass

from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.heidenhain.contour import arc_to, compensate, corner, direction, go
from toolpath_stiff.nc.heidenhain.points import ON_CIRCLE_MM, feed, in_plane, named, present
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES

CORNERS, FREE = ("RND", "CHF"), ("FL", "FLT", "FC", "FCT")
WORDS = {"PR", "PA", "CCPR", "CCPA", "AN", "IAN", "R", "LEN", "CCA", "CLSD+", "CLSD-", "DR+", "DR-", "R0", "RL", "RR",
         "F", "FMAX", "FAUTO"}  # beside the coordinates  # fmt: skip
SAME_DIRECTION = 1e-3  # rad: data that say twice how an element begins may differ by rounding
NOT_DETERMINED = "is not determined by its own data and those of the elements behind it, or has several solutions"
Circle = tuple[complex, float]  # centre, radius with its sign


@dataclass(frozen=True)
class FreeElement:
    """What is known of an element: `turn` 0 of a line; the radius has its sign; coordinates not known are nan."""

    tangent: bool
    turn: int
    radius: float | None
    center: complex | None
    end: complex
    ahead: complex | None
    length: float | None
    angle: float | None

    @property
    def circle(self) -> Circle | None:
        """The circle of an arc, where it is known; the end of a line, of radius 0."""
        if cmath.isnan(self.end) and not self.radius:
            return None
        if not self.turn:
            return self.end, 0.0
        return self.center and (self.center, self.radius or self.turn * abs(self.end - self.center))


def free_pole(state: State, block: CurrentBlock, code: str) -> None:
    """FPOL: the pole of polar coordinates in free contours."""
    first, second, _ = PLANES[state.plane]
    there = named(state, block)
    block.refuse_if(there.keys() != {first, second}, None, "without its coordinates", "both of the plane")
    state.plain.free_pole = complex(there[first], there[second])


def rounding(state: State, block: CurrentBlock, code: str) -> None:
    """CHF, RND: a corner, which waits where the element before it does."""
    if state.plain.free:
        state.plain.free.append((block, code, False))
    else:
        corner(state, block, code)


def free_element(state: State, block: CurrentBlock, code: str) -> None:
    """FL, FLT, FC, FCT: make the elements that are determined now."""
    plain, (first, second, _) = state.plain, PLANES[state.plane]
    coordinates = {f"{kind}{AXES[axis]}" for axis in (first, second) for kind in ("", "I", "CC")}
    unused = next(iter(sorted(block.free - WORDS - coordinates)), None)
    block.refuse_if(unused, unused, f"is no word of {code} that is read", "its own words")
    plain.free.append((block, code, plain.to_corner))
    while plain.free:
        block, code, to_corner = plain.free[0]
        if code in CORNERS:
            del plain.free[0]
            corner(state, block, code)
            continue
        start = in_plane(state, present(state))
        known = [_known(state, b, c, start if b is block else None) for b, c, _ in plain.free if c in FREE]
        found = (_arc if known[0].turn else _line)(block, [*known, None, None], start, _begin(state, block, known[0]))
        if found is None:
            return
        end, center = found
        _agree(block, known[0].end.real - end.real, known[0].end.imag - end.imag, limit=ON_CIRCLE_MM)
        del plain.free[0]
        plain.to_corner, there = to_corner, {first: end.real, second: end.imag}
        if center is not None:
            arc_to(state, block, there, (center, direction(block), 1))
        else:
            rapid = feed(state, block)
            compensate(state, block, there)
            go(state, block, there, rapid=rapid)


def _known(state: State, block: CurrentBlock, code: str, start: complex | None) -> FreeElement:
    """What a statement gives; steps count if the element's start is known."""
    plain, values = state.plain, {name: word.value for name, word in block.values.items()}
    letters = [AXES[axis] for axis in PLANES[state.plane][:2]]

    def place(x: str, y: str, size: str, angle: str) -> complex:
        if plain.free_pole is not None and size in values and angle in values:
            return plain.free_pole + cmath.rect(values[size] * state.length_scale, math.radians(values[angle]))
        block.refuse_if(values.keys() & {size, angle}, None, f"with {size} or {angle}", "both of them, behind FPOL")
        return complex(*(values.get(word, math.nan) * state.length_scale for word in (x, y)))

    def positive(word: str, scale: float = state.length_scale) -> float | None:
        return values[word] * scale if values.get(word, 0.0) > 0.0 else None

    end, center = place(*letters, "PR", "PA"), place(f"CC{letters[0]}", f"CC{letters[1]}", "CCPR", "CCPA")
    if start is not None:
        plain.closes = start if "CLSD+" in values else plain.closes
        stepped = start + complex(*(values.get(f"I{letter}", math.nan) * state.length_scale for letter in letters))
        end = complex(*(b if math.isnan(a) else a for a, b in zip(_parts(end), _parts(stepped), strict=True)))
    if "CLSD-" in values and plain.closes is not None:
        end = plain.closes
    turned = values.get("AN", values.get("IAN"))
    ahead = None if turned is None else cmath.rect(1.0, math.radians(turned))
    if ahead and "IAN" in values:
        ahead = ahead * plain.heading / abs(plain.heading) if start is not None and plain.heading else None
    turn, radius = 0 if code in ("FL", "FLT") else 1 if "DR+" in values else -1, positive("R")
    return FreeElement(
        code[-1] == "T", turn, radius and turn * radius, None if cmath.isnan(center) else center, end, ahead,
        positive("LEN"), positive("CCA", 1.0),
    )  # fmt: skip


def _parts(point: complex) -> tuple[float, float]:
    return point.real, point.imag


def _begin(state: State, block: CurrentBlock, element: FreeElement) -> complex | None:
    """Direction in which an element begins; None: not known."""
    heading = state.plain.heading if element.tangent else element.ahead
    block.refuse_if(element.tangent and not heading, None, "without a contour element before it", "FL or FC")
    if heading and element.ahead:
        _agree(block, cmath.phase(heading / element.ahead))
    return heading and heading / abs(heading)


def _agree(block: CurrentBlock, *differences: float, limit: float = SAME_DIRECTION) -> None:
    wrong = any(abs(difference) > limit for difference in differences)
    block.refuse_if(wrong, None, "has data that contradict each other", "data that agree")


def _tangent(one: Circle, other: Circle | None) -> tuple[complex, complex] | tuple[None, None]:
    """Points where the common tangent leaves one directed circle and reaches the other."""
    apart, more = (other[0] - one[0], other[1] - one[1]) if other else (0j, 0.0)
    square = abs(apart) ** 2 - more**2
    if other is None or square <= 0.0:
        return None, None
    left = 1j * apart / complex(math.sqrt(square), more)
    return one[0] - one[1] * left, other[0] - other[1] * left


def _crossing(start: complex, ahead: complex, other: complex, along: complex) -> complex | None:
    """Point where two lines meet; None if they are parallel."""
    sine = (ahead.conjugate() * along).imag
    return start + ahead * ((other - start).conjugate() * along).imag / sine if abs(sine) > SAME_DIRECTION else None


def _line(
    block: CurrentBlock, known: list[FreeElement | None], start: complex, ahead: complex | None
) -> tuple[complex, None] | None:
    """End of a line, without a centre; None: not determined yet."""
    line, after, last = known[:3]
    assert line is not None
    circle, end = after.circle if after and after.tangent else None, None if cmath.isnan(line.end) else line.end
    if end is None and ahead is None:
        end = _tangent((start, 0.0), circle)[1]
    elif end is None and ahead is not None:
        shares = [
            (there - here) / along
            for here, there, along in zip(_parts(start), _parts(line.end), _parts(ahead), strict=True)
            if not math.isnan(there) and abs(along) > SAME_DIRECTION
        ] + [line.length]
        if shares[0] is not None:
            end = start + ahead * shares[0]
        elif after and not after.turn and after.ahead and after.circle:
            end = _crossing(start, ahead, after.circle[0], after.ahead)
        elif after and circle:
            end = start + ahead * ((circle[0] - start) / ahead).real
        elif after and after.tangent and after.radius and last and last.tangent and last.ahead and last.circle:
            left, right = (after.radius * 1j * v for v in (ahead, last.ahead))
            middle = _crossing(start + left, ahead, last.circle[0] + right, last.ahead)
            end = None if middle is None else middle - left
    if end is None:
        return None
    block.refuse_if(abs(end - start) < ON_CIRCLE_MM, None, "ends where it begins", "another end")
    _agree(block, cmath.phase((end - start) / ahead) if ahead else 0.0)
    return end, None


def _arc(
    block: CurrentBlock, known: list[FreeElement | None], start: complex, ahead: complex | None
) -> tuple[complex, complex] | None:
    """End and centre of an arc; None: not determined yet."""
    arc, after, last = known[:3]
    assert arc is not None
    center, end = arc.center, None if cmath.isnan(arc.end) else arc.end
    if center is None and ahead and arc.radius:
        center = start + arc.radius * 1j * ahead
    elif center is None and ahead and end is not None:
        chord = (end - start) / ahead
        center = start + 1j * ahead * abs(chord) ** 2 / (2.0 * chord.imag) if chord.imag else None
    if center is None or center == start:
        return None
    radius = arc.turn * abs(start - center)
    _agree(block, radius - (arc.radius or radius), limit=ON_CIRCLE_MM)
    _agree(block, cmath.phase(1j * (start - center) / radius / ahead) if ahead else 0.0)
    if end is not None:
        return end, center
    if arc.angle:
        end = center + (start - center) * cmath.exp(1j * arc.turn * math.radians(arc.angle))
    elif after and after.tangent and not after.turn and after.ahead:
        end = center - radius * 1j * after.ahead
    elif after and after.tangent and not after.turn:
        end = _tangent((center, radius), after.circle or (last.circle if last and last.tangent else None))[0]
    elif after and after.tangent and after.circle and after.circle[1] != radius:
        end = center - radius * (after.circle[0] - center) / (after.circle[1] - radius)
    return None if end is None or abs(end - start) < ON_CIRCLE_MM else (end, center)
