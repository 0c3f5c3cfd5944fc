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
from toolpath_stiff.nc.heidenhain.points import FREE_POLE, ON_CIRCLE_MM, feed, in_plane, present
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES

CORNERS, FREE = ("RND", "CHF"), ("FL", "FLT", "FC", "FCT")
WORDS = {"PR", "PA", "CCPR", "CCPA", "AN", "IAN", "R", "LEN", "CCA", "CLSD+", "CLSD-", "DR+", "DR-", "R0", "RL", "RR",
         "F", "FMAX", "FAUTO"}  # beside the coordinates  # fmt: skip
SAME_DIRECTION = 1e-3  # rad: data that say twice how an element begins may differ by rounding
NOT_DETERMINED = "is not determined by its own data and those of the elements behind it, or has several solutions"
Curve = tuple[complex, complex | float]  # a point and the direction of a line; centre and radius with its sign


@dataclass(frozen=True)
class FreeElement:
    """What is known of an element: `turn` 0 of a line; the radius has its sign; coordinates not known are nan."""

    tangent: bool
    turn: int
    radius: float
    center: complex
    end: complex
    ahead: complex | None
    length: float
    angle: float

    @property
    def curve(self) -> Curve | None:
        """A line by its end and direction, an arc by its circle, an end as a circle of radius 0."""
        radius = self.radius or self.turn * abs(self.end - self.center)
        curve = (self.center, radius) if self.turn else (self.end, self.ahead or 0.0)
        return None if cmath.isnan(curve[0]) or cmath.isnan(curve[1]) else curve


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
        heading = plain.heading if known[0].tangent else known[0].ahead
        block.refuse_if(known[0].tangent and not heading, None, "without a contour element before it", "FL or FC")
        found = _solved(block, [*known, None, None], start, heading and heading / abs(heading))
        if found is None:
            return
        del plain.free[0]
        plain.to_corner, there = to_corner, {first: found[0].real, second: found[0].imag}
        if found[1] is not None:
            arc_to(state, block, there, (found[1], direction(block), 1))
        else:
            rapid = feed(state, block)
            compensate(state, block, there)
            go(state, block, there, rapid=rapid)


def _known(state: State, block: CurrentBlock, code: str, start: complex | None) -> FreeElement:
    """What a statement gives; steps count if the element's start is known."""
    plain, values = state.plain, {name: word.value for name, word in block.values.items()}
    letters, unit = [AXES[axis] for axis in PLANES[state.plane][:2]], state.length_scale
    pole = plain.pole[1] if plain.pole and plain.pole[0] == FREE_POLE else None

    def place(x: str, y: str, size: str, angle: str) -> complex:
        if pole is not None and size in values and angle in values:
            return pole + cmath.rect(values[size] * unit, math.radians(values[angle]))
        block.refuse_if(values.keys() & {size, angle}, None, f"with {size} or {angle}", "both of them, behind FPOL")
        return complex(values.get(x, math.nan) * unit, values.get(y, math.nan) * unit)

    x, y = letters
    end, center, ahead = place(x, y, "PR", "PA"), place(f"CC{x}", f"CC{y}", "CCPR", "CCPA"), None
    if start is not None:
        plain.closes = start if "CLSD+" in values else plain.closes
        steps = start + complex(values.get(f"I{x}", math.nan) * unit, values.get(f"I{y}", math.nan) * unit)
        end = complex(*(b if math.isnan(a) else a for a, b in ((end.real, steps.real), (end.imag, steps.imag))))
    if "CLSD-" in values and plain.closes is not None:
        end = plain.closes
    if "AN" in values or ("IAN" in values and start is not None and plain.heading):
        before = 0.0 if "AN" in values else cmath.phase(plain.heading or 1.0)
        ahead = cmath.rect(1.0, before + math.radians(values.get("AN", values.get("IAN", 0.0))))
    turn = 0 if code in ("FL", "FLT") else 1 if "DR+" in values else -1
    radius, length = turn * values.get("R", 0.0) * unit, values.get("LEN", 0.0) * unit
    return FreeElement(code[-1] == "T", turn, radius, center, end, ahead, length, values.get("CCA", 0.0))


def _agree(block: CurrentBlock, *differences: float, limit: float = SAME_DIRECTION) -> None:
    wrong = any(abs(difference) > limit for difference in differences)
    block.refuse_if(wrong, None, "has data that contradict each other", "data that agree")


def _tangent(one: Curve, other: Curve | None) -> tuple[complex, complex] | tuple[None, None]:
    """Points where the common tangent leaves one directed circle and reaches the other."""
    if other is None or isinstance(one[1], complex) or isinstance(other[1], complex):
        return None, None
    apart, more = other[0] - one[0], other[1] - one[1]
    if abs(apart) <= abs(more):
        return None, None
    left = 1j * apart / complex(math.sqrt(abs(apart) ** 2 - more**2), more)
    return one[0] - one[1] * left, other[0] - other[1] * left


def _meeting(one: Curve, other: Curve) -> complex | None:
    """Point where two lines meet, or two curves touch of which one at least is a circle; None: there is none."""
    (p, u), (q, v) = one, other
    if isinstance(u, complex) and isinstance(v, complex):
        sine = (u.conjugate() * v).imag
        return p + u * ((q - p).conjugate() * v).imag / sine if abs(sine) > SAME_DIRECTION else None
    if isinstance(u, complex):
        return p + u * ((q - p) / u).real
    return p - u * 1j * v if isinstance(v, complex) else p - u * (q - p) / (v - u) if v != u else None


def _solved(
    block: CurrentBlock, known: list[FreeElement | None], start: complex, ahead: complex | None
) -> tuple[complex, complex | None] | None:
    """End and centre (None: of a line) of the first element; None: not determined yet."""
    this, after, last = known[:3]
    assert this is not None
    end, center = this.end, this.center
    _agree(block, cmath.phase(ahead / this.ahead) if ahead and this.ahead else 0.0)
    if this.turn and cmath.isnan(center) and ahead:
        chord = (end - start) / ahead
        radius = this.radius or (abs(chord) ** 2 / (2.0 * chord.imag) if chord.imag else math.nan)
        center = start + radius * 1j * ahead
    if this.turn and cmath.isnan(center):
        return None
    radius = this.turn * abs(start - center) if this.turn else 0.0
    _agree(block, radius - (this.radius or radius), limit=ON_CIRCLE_MM)
    own: Curve = (center, radius) if this.turn else (start, ahead or 0.0)
    axes = ((start.real, end.real, (ahead or 0j).real), (start.imag, end.imag, (ahead or 0j).imag))
    shares = [(to - at) / along for at, to, along in axes if not math.isnan(to) and abs(along) > SAME_DIRECTION]
    found: complex | None = None if cmath.isnan(end) else end
    if found is None and this.turn and this.angle:
        found = center + (start - center) * cmath.exp(1j * this.turn * math.radians(this.angle))
    elif found is None and not this.turn and ahead and (shares or this.length):
        found = start + ahead * (shares[0] if shares else this.length)
    elif found is None and after and not (this.turn or after.turn):
        found = _meeting(own, after.curve) if ahead and after.ahead and after.curve else None
    elif found is None and after and after.tangent:
        target = after.curve or (last.curve if last and last.tangent else None)
        if not after.turn and after.ahead:
            found = _meeting(own, (0j, after.ahead))
        elif not after.turn or (not this.turn and not ahead):
            found = _tangent(own, target)[0 if this.turn else 1]
        elif after.curve:
            found = _meeting(own, after.curve)
        elif after.radius and ahead and last and last.tangent and last.ahead and last.curve:
            beside = (start + after.radius * 1j * ahead, ahead), (last.end + after.radius * 1j * last.ahead, last.ahead)
            middle = _meeting(*beside)
            found = None if middle is None else middle - after.radius * 1j * ahead
    if found is None or (abs(found - start) < ON_CIRCLE_MM and cmath.isnan(end)):
        return None
    begins = 1j * (start - center) / radius if this.turn else found - start
    _agree(block, cmath.phase(begins / ahead) if ahead and begins else 0.0)
    _agree(block, found.real - end.real, found.imag - end.imag, limit=ON_CIRCLE_MM)
    return found, center if this.turn else None
