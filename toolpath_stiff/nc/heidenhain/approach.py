"""APPR and DEP: how a contour is approached and left, LT, LN, CT and LCT, by X and Y or polar (PLT ...). mm.

HEIDENHAIN, user's manuals of the TNC 426, the iTNC 530 and the TNC 640, "Contour approach and departure". Lines and
arcs are those of the tool's centre: the manuals' examples approach with R5 and a tool of R10 (linear and circular
movements), and with R2 and a tool of R5 (helix). The compensation begins, and ends, beside the contour's ends.
"""

import cmath
import math
from functools import partial

from toolpath_stiff.nc.codes.cutter import switch_off
from toolpath_stiff.nc.contouring.contour import SIDES, Circle, begin_compensation, go, take_side
from toolpath_stiff.nc.contouring.points import feed, in_plane, named, plane_of_pole, polar, present
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES

Feeds = tuple[float | None, float | None]
NO_ARC_MM = 1e-3  # an arc of LCT shorter than this is left out: the line continues smoothly
OF_CENTER = "lines and arcs of APPR and DEP (LEN, R) are those of the tool's centre"


def approach(state: State, block: CurrentBlock, code: str) -> None:
    """APPR: waits for the first contour element."""
    plain, (first, second, normal) = state.plain, PLANES[state.plane]
    wrong = state.cutter is not None or plain.held is not None or state.beside is not None or plain.approach is not None
    block.refuse_if(wrong, None, "inside a contour, or right behind one", "R0 and a positioning before it")
    to_arc = code.endswith("LCT")
    block.refuse_if(to_arc and AXES[normal] in block.values, None, "with the tool axis", "it before the APPR")
    there, modal = _point(state, block, code), state.feed
    block.refuse_if(not there.keys() >= {first, second}, None, "without its contour point", "both coordinates")
    block.refuse_if(feed(state, block), "FMAX", "in an approach", "F with a number")
    plain.heading = None
    plain.approach = (there, partial(begin_contour, state, block, code, there, (modal, state.feed)))


def _point(state: State, block: CurrentBlock, code: str) -> dict[int, float]:
    """Axis -> coordinate, also from the polar forms by PR and PA."""
    if " P" not in code:
        return named(state, block)
    with plane_of_pole(state, block) as pole:
        return polar(state, block, pole)


def begin_contour(
    state: State, block: CurrentBlock, code: str, there: dict[int, float], feeds: Feeds, heading: complex
) -> None:
    """Carry out an APPR, once the direction of the first contour element is known; `feeds` before and in it."""
    modal, rate = feeds
    state.plain.approach, (first, second, normal), after = None, PLANES[state.plane], state.feed
    contour, start, to_arc = complex(there[first], there[second]), in_plane(state, present(state)), code.endswith("LCT")
    rapid = state.plain.fast and not to_arc
    state.feed = rate if to_arc else modal
    side = take_side(block) or "R0"
    block.refuse_if(side == "R0" and not code.endswith("LT"), None, "without a side", "RL or RR")
    if side != "R0":
        begin_compensation(state, block, side)
    cutter, state.cutter = state.cutter, None
    apex = contour if cutter is None else contour + cutter.side * 1j * heading * cutter.radius
    place, about = _way(state, block, code, apex, -heading, -SIDES.get(side, 1), start)
    _go(state, block, place, rapid=rapid)
    if normal in there:
        go(state, block, {normal: there[normal]}, rapid=rapid)
    state.feed = rate
    if about is None or abs(apex - place) > NO_ARC_MM:
        _go(state, block, apex, about and (about[0], -about[1], 1))
    if cutter is not None:  # the tool stands beside the contour's first point, where the contour continues
        cutter.position = state.frames.to_program(state.frames.position)
        cutter.anchor = apex
        state.frames.position = state.frames.to_control(cutter.moved(cutter.position, contour))
    state.cutter = cutter
    unused = next(iter(block.free), None)
    block.refuse_if(unused, unused, f"is no word of {code}", "its own words")
    state.feed = after


def _way(
    state: State, block: CurrentBlock, code: str, apex: complex, away: complex, side: int, other: complex
) -> tuple[complex, Circle | None]:
    """End of the line or arc that leaves a point in a direction, and its circle.

    An approach is such a way back: `side` is then the other one than the contour's. `other`: where LCT begins or ends.
    """
    across, kind = side * 1j * away, code.split()[1].removeprefix("P")
    if kind in ("LT", "LN"):
        return apex + size_of(state, block, "LEN") * (away if kind == "LT" else across), None
    state.assume(OF_CENTER)
    radius, swept = size_of(state, block, "R"), size_of(state, block, "CCA", 1.0) if kind == "CT" else 0.0
    turn = side if radius > 0.0 else -side
    center = apex + radius * across
    if kind == "CT":
        return center + (apex - center) * cmath.exp(1j * turn * math.radians(swept)), (center, turn, 1)
    apart = other - center
    problem = "whose arc holds the point from which, or to which, it goes"
    block.refuse_if(abs(apart) <= radius, None, problem, "another R")
    direction = apart / complex(radius, turn * math.sqrt(abs(apart) ** 2 - radius**2))
    return center + radius * direction / abs(direction), (center, turn, 1)


def size_of(state: State, block: CurrentBlock, letter: str, scale: float | None = None) -> float:
    """Length (with `scale` 1 an angle) that APPR and DEP need: above 0; R of CT may be negative, but not 0."""
    value = block.take(letter) or 0.0
    signed = letter == "R" and block.block.words[0].text.endswith((" CT", " PCT"))
    wrong = value == 0.0 or (value < 0.0 and not signed) or (letter == "CCA" and value > 360.0)
    block.refuse_if(wrong, letter if letter in block.values else None, f"is no {letter} of {block.block.words[0].text}")
    return value * (state.length_scale if scale is None else scale)


def depart(state: State, block: CurrentBlock, code: str) -> None:
    """DEP: leave the contour and end the compensation there; the tool then stands at its end without one."""
    plain, (first, second, normal) = state.plain, PLANES[state.plane]
    if plain.heading is None:
        raise block.fail(None, "without a contour element in the plane before it", "L, C, CR or CT before it")
    heading, cutter, to_point = plain.heading / abs(plain.heading), state.cutter, code.endswith("LCT")
    block.refuse_if(cutter is None and code != "DEP LT", None, "without RL or RR, which give its side", "L statements")
    there = _point(state, block, code)
    if to_point and there:  # a coordinate that is not named is that of the contour's last point
        there = {axis: present(state)[axis] for axis in (first, second)} | there
    block.refuse_if(feed(state, block), "FMAX", "on the way off a contour", "F with a number")
    block.take("R0")
    depth = there.pop(normal, None)
    if there.keys() != ({first, second} if to_point else set()):
        raise block.fail(None, "with or without its end point", "X and Y with LCT alone")
    stop(state, block)
    apex, end = in_plane(state, present(state)), complex(there.get(first, 0.0), there.get(second, 0.0))
    place, about = _way(state, block, code, apex, heading, cutter.side if cutter else 1, end)
    if about is None or abs(place - apex) > NO_ARC_MM:
        _go(state, block, place, about)
    if to_point:
        _go(state, block, end)
    if depth is not None:
        go(state, block, {normal: depth})


def _go(state: State, block: CurrentBlock, place: complex, about: Circle | None = None, rapid: bool = False) -> None:
    first, second, _ = PLANES[state.plane]
    go(state, block, {first: place.real, second: place.imag}, about, rapid)


def stop(state: State, block: CurrentBlock) -> None:
    """End the compensation where the tool centre stands, which becomes the programmed point."""
    switch_off(state, block, "R0")
    if state.beside is not None:
        state.frames.position = [p + b for p, b in zip(state.frames.position, state.beside, strict=True)]
        state.beside = None
