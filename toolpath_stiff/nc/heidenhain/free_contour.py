"""Corners (CHF, RND); free contours (FK), whose ends follow from what their elements and the next ones give. mm.

HEIDENHAIN, user's manual of the iTNC 530, "Path contours: FK free contour programming". An element waits until it is
determined. Circles have a direction (radius positive counter-clockwise), so that two of them, a circle and a line, or a
circle and a point have one common tangent along the path (E. Laguerre's directed circles). What has several solutions,
among which FSELECT chooses in an order that manuals only draw, is refused.
"""

import cmath
import math
from collections import defaultdict
from dataclasses import dataclass

from toolpath_stiff.nc.contouring.contour import arc_to, compensate, go, turn_of
from toolpath_stiff.nc.contouring.points import FREE_POLE, ON_CIRCLE_MM, feed, in_plane, inch_tenths, present
from toolpath_stiff.nc.geometry import NOWHERE, PLANES, turned
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES, Word

CORNERS, FREE = ("RND", "CHF"), ("FL", "FLT", "FC", "FCT")
ANGLES = {"PA", "CCPA", "AN", "IAN", "CCA"}
WORDS = {"PR", "CCPR", "R", "LEN", "CLSD+", "CLSD-", "DR+", "DR-", "R0", "RL", "RR", "F", "FMAX", "FAUTO"}
SAME_DIRECTION = 1e-3  # rad: data that say twice how an element begins may differ by rounding
NOT_DETERMINED = "is not determined by its own data and those of the elements behind it, or has several solutions"
Curve = tuple[complex, complex | float]  # a point and the direction of a line; centre and radius with its sign


@dataclass(frozen=True)
class FreeElement:
    """What is known of an element: `turn` 0 of a line; the radius has its sign; numbers not known are nan."""

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
        radius = self.turn * abs(self.end - self.center) if math.isnan(self.radius) else self.radius
        curve: Curve = (self.center, radius) if self.turn else (self.end, self.ahead or 0.0)
        return None if cmath.isnan(curve[0]) or cmath.isnan(curve[1]) else curve


def rounding(state: State, block: CurrentBlock, code: str) -> None:
    """CHF, RND: a corner, which waits where the element before it does."""
    if state.plain.free:
        state.plain.free.append((block, code, False))
    else:
        corner(state, block, code)


def corner(state: State, block: CurrentBlock, code: str) -> None:
    """CHF, RND: cut off or round the corner between the contour elements before and after."""
    block.refuse_if(state.plain.held is None, None, "without a contour element before it", "L, C, CR or CT before it")
    size = block.take("#") if code == "CHF" and block.has("#") else block.take("R")
    rate = block.take("F")
    if rate is not None:  # holds only for the corner
        block.values["F alone"] = Word("F", rate * inch_tenths(state), 1, "F")
    block.refuse_if(not size or size < 0.0, None, "without its size", "RND R5, CHF 2")
    block.values["size"] = Word("R", (size or 0.0) * state.length_scale, 1, "R")
    state.plain.corner = block


def free_element(state: State, block: CurrentBlock, code: str) -> None:
    """FL, FLT, FC, FCT: make the elements that are determined now."""
    plain, (first, second, _) = state.plain, PLANES[state.plane]
    coordinates = {f"{kind}{AXES[axis]}" for axis in (first, second) for kind in ("", "I", "CC")}
    unused = next(iter(sorted(block.free - WORDS - ANGLES - coordinates)), None)
    block.refuse_if(unused, unused, f"is no word of {code} that is read", "its own words")
    plain.free.append((block, code, plain.to_corner))
    while plain.free:
        block, code, to_corner = plain.free[0]
        if code in CORNERS:
            del plain.free[0]
            corner(state, block, code)
            continue
        start, queue = in_plane(state, present(state)), [entry for entry in plain.free if entry[1] in FREE]
        known = [_known(state, b, c, start if b is block else NOWHERE) for b, c, _ in queue]
        heading = plain.heading if known[0].tangent else known[0].ahead
        block.refuse_if(known[0].tangent and not heading, None, "without a contour element before it", "FL or FC")
        end, center = _solved(block, [*known, None, None], start, heading and heading / abs(heading))
        if cmath.isnan(end):
            return
        del plain.free[0]
        plain.to_corner, there = to_corner, {first: end.real, second: end.imag}
        if known[0].turn:
            arc_to(state, block, there, (center, turn_of(block), 1))
        else:
            rapid = feed(state, block)
            compensate(state, block, there)
            go(state, block, there, rapid=rapid)


def _known(state: State, block: CurrentBlock, code: str, start: complex) -> FreeElement:
    """What a statement gives; steps count if the element's start is known."""
    plain, (x, y) = state.plain, (AXES[axis] for axis in PLANES[state.plane][:2])
    v: dict[str, float] = defaultdict(lambda: math.nan)
    v |= {name: w.value * (1.0 if name in ANGLES else state.length_scale) for name, w in block.values.items()}
    pole = plain.pole[1] if plain.pole and plain.pole[0] == FREE_POLE else NOWHERE
    if "CLSD+" in v and not cmath.isnan(start):
        plain.closes = start
    end = _first(complex(v[x], v[y]), pole + turned(v["PA"], v["PR"]), start + complex(v[f"I{x}"], v[f"I{y}"]))
    center = _first(complex(v[f"CC{x}"], v[f"CC{y}"]), pole + turned(v["CCPA"], v["CCPR"]))
    end = plain.closes if "CLSD-" in v else end
    before = plain.heading if "IAN" in v and not cmath.isnan(start) else None
    ahead = before * turned(v["IAN"]) if before else turned(v["AN"]) if "AN" in v else None
    turn = 0 if code in ("FL", "FLT") else 1 if "DR+" in v else -1
    return FreeElement(code[-1] == "T", turn, turn * (v["R"] or math.nan), center, end, ahead, v["LEN"], v["CCA"])


def _first(*places: complex) -> complex:
    """Each coordinate by the first place that gives it."""
    parts = zip(*((place.real, place.imag) for place in places), strict=True)
    return complex(*(next((v for v in values if not math.isnan(v)), math.nan) for values in parts))


def _agree(block: CurrentBlock, *differences: float, limit: float = SAME_DIRECTION) -> None:
    wrong = any(abs(difference) > limit for difference in differences)  # not of data that are not known
    block.refuse_if(wrong, None, "has data that contradict each other", "data that agree")


def _tangent(one: Curve, other: Curve | None) -> tuple[complex, complex]:
    """Points where the common tangent leaves one directed circle and reaches the other."""
    apart, more = (other[0] - one[0], other[1] - one[1]) if other else (0j, 0.0)
    if other is None or not abs(apart) > abs(more):
        return NOWHERE, NOWHERE
    left = 1j * apart / complex(math.sqrt(abs(apart) ** 2 - abs(more) ** 2), more.real)
    return one[0] - one[1] * left, other[0] - other[1] * left


def _meeting(one: Curve, other: Curve) -> complex:
    """Point where two lines meet, or two curves touch of which one at least is a circle."""
    (p, u), (q, v) = one, other
    if isinstance(u, complex) and isinstance(v, complex):
        sine = (u.conjugate() * v).imag
        return p + u * ((q - p).conjugate() * v).imag / sine if abs(sine) > SAME_DIRECTION else NOWHERE
    if isinstance(u, complex):
        return p + u * ((q - p) / u).real
    return p - u * 1j * v if isinstance(v, complex) else p - u * (q - p) / (v - u) if v != u else NOWHERE


def _solved(
    block: CurrentBlock, known: list[FreeElement | None], start: complex, ahead: complex | None
) -> tuple[complex, complex]:
    """End and centre of the first element; nan: not determined yet."""
    this, after, last = known[:3]
    assert this is not None
    end, center, radius = this.end, this.center, 0.0
    _agree(block, cmath.phase(ahead / this.ahead) if ahead and this.ahead else 0.0)
    if this.turn and cmath.isnan(center) and ahead:
        chord = (end - start) / ahead
        bend = abs(chord) ** 2 / (2.0 * chord.imag) if chord.imag else math.nan
        center = start + 1j * ahead * (bend if math.isnan(this.radius) else this.radius)
    if this.turn:
        radius = this.turn * abs(start - center)
        _agree(block, radius - this.radius, limit=ON_CIRCLE_MM)
        if math.isnan(radius) or not radius:
            return NOWHERE, NOWHERE
    own: Curve = (center, radius) if this.turn else (start, ahead or 0.0)
    lines = ((start.real, end.real, (ahead or 0j).real), (start.imag, end.imag, (ahead or 0j).imag))
    shares = [(to - at) / along for at, to, along in lines if abs(along) > SAME_DIRECTION and not math.isnan(to)]
    found, circle = end, last.curve if last and last.tangent else None
    if not cmath.isnan(end):
        pass
    elif this.turn and this.angle > 0.0:
        found = center + (start - center) * turned(this.turn * this.angle)
    elif not this.turn and ahead and (shares or this.length > 0.0):
        found = start + ahead * [*shares, this.length][0]
    elif after and not this.turn and not after.turn and ahead and after.ahead and after.curve:
        found = _meeting(own, after.curve)
    elif after and after.tangent and (this.turn or after.turn):
        if not after.turn and after.ahead:
            found = _meeting(own, (0j, after.ahead))
        elif not after.turn or not (this.turn or ahead):
            found = _tangent(own, after.curve or circle)[0 if this.turn else 1]
        elif after.curve:
            found = _meeting(own, after.curve)
        elif ahead and last and last.ahead and circle:
            beside = [(p + after.radius * 1j * d, d) for p, d in ((start, ahead), (last.end, last.ahead))]
            found = _meeting(*beside) - after.radius * 1j * ahead
    if abs(found - start) < ON_CIRCLE_MM and cmath.isnan(end):
        return NOWHERE, center
    begins = 1j * (start - center) / radius if this.turn else found - start
    _agree(block, cmath.phase(begins / ahead) if ahead and begins else 0.0)
    _agree(block, found.real - end.real, found.imag - end.imag, limit=ON_CIRCLE_MM)
    return found, center
