"""APPR and DEP: how a contour is approached and left, LT, LN, CT and LCT. mm, in program axes.

HEIDENHAIN, user's manuals of the TNC 407, the TNC 410 and the TNC 640, "Contour approach and departure". The straight
line or the arc belongs to the contour: under RL and RR the tool's centre is beside it, and the radius of its arc is
smaller by the tool's. Of LCT, the line of the tool's centre touches the arc of the tool's centre.
"""

import cmath
import math
from functools import partial

from toolpath_stiff.nc.codes.cutter import switch_off
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.heidenhain.contour import SIDES, begin_compensation, go
from toolpath_stiff.nc.heidenhain.points import feed, in_plane, named, present
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES

NO_ARC_MM = 1e-3  # an arc of LCT that is shorter is none: the line goes on smoothly
OF_CONTOUR = (
    "the arcs of APPR and DEP belong to the contour: the radius of the tool centre's is smaller by the tool's radius"
)


def approach(state: State, block: CurrentBlock, code: str) -> None:
    """APPR: waits for the first contour element."""
    plain, (first, second, normal) = state.plain, PLANES[state.plane]
    wrong = state.cutter is not None or plain.held is not None or state.beside is not None or plain.approach is not None
    block.refuse_if(wrong, None, "inside a contour, or right behind one", "R0 and a positioning before it")
    block.refuse_if(
        code == "APPR LCT" and AXES[normal] in block.values, None, "with the tool axis", "it before the APPR"
    )
    there, modal = named(state, block), state.feed
    block.refuse_if(not there.keys() >= {first, second}, None, "without its contour point", "both coordinates")
    block.refuse_if(feed(state, block), "FMAX", "in an approach", "F with a number")
    plain.approach = (there, partial(begin_contour, state, block, code, there, modal, state.feed))


def begin_contour(
    state: State,
    block: CurrentBlock,
    code: str,
    there: dict[int, float],
    modal: float | None,
    rate: float | None,
    heading: complex,
) -> None:
    """Carry out an APPR, now that the direction of the first contour element is known; feeds before and in it."""
    state.plain.approach, (first, second, normal), after = None, PLANES[state.plane], state.feed
    start, depth, apex = in_plane(state, present(state)), there.get(normal), complex(there[first], there[second])
    rapid = state.plain.fast and code != "APPR LCT"
    state.feed = rate if code == "APPR LCT" else modal
    side = next((word for word in ("R0", "RL", "RR") if block.take(word) is not None), "R0")
    block.refuse_if(side == "R0" and code != "APPR LT", None, "without a side", "RL or RR")
    if side != "R0":
        begin_compensation(state, block, side)
    cutter = state.cutter
    place, center, turn = _way(state, block, code, apex, -heading, -SIDES.get(side, 1), start)
    if code == "APPR LN":
        state.cutter = None
    go(state, block, {first: place.real, second: place.imag}, rapid=rapid)
    if depth is not None:
        go(state, block, {normal: depth}, rapid=rapid)
    state.cutter, state.feed = cutter, rate
    if center is None or abs(apex - place) > NO_ARC_MM:
        go(state, block, {first: apex.real, second: apex.imag}, center, -turn)
    unused = next(iter(block.free), None)
    block.refuse_if(unused, unused, f"is no word of {code}", "its own words")
    state.feed = after


def _way(
    state: State, block: CurrentBlock, code: str, apex: complex, away: complex, side: int, other: complex
) -> tuple[complex, complex | None, int]:
    """Where the line or arc ends that leaves a contour point in a direction, the arc's centre and its turn.

    An approach is such a way back: `side` is then the other one than the contour's. `other`: where LCT begins or ends.
    """
    across, kind = side * 1j * away, code.split()[1]
    if kind == "LT":
        return apex + size_of(state, block, "LEN") * away, None, 0
    assert state.cutter is not None
    if kind == "LN":
        return apex + (size_of(state, block, "LEN") + state.cutter.radius) * across, None, 0
    state.assume(OF_CONTOUR)
    radius, swept = size_of(state, block, "R"), size_of(state, block, "CCA", 1.0) if kind == "CT" else 0.0
    turn = side if radius > 0.0 else -side
    center = apex + radius * across
    if kind == "CT":
        return center + (apex - center) * cmath.exp(1j * turn * math.radians(swept)), center, turn
    return center + _touching(block, other - center, radius, state.cutter.radius, turn), center, turn


def size_of(state: State, block: CurrentBlock, letter: str, scale: float | None = None) -> float:
    """A length (an angle with `scale` 1) that APPR and DEP need: above 0, R of CT but not 0."""
    value = block.take(letter) or 0.0
    signed = letter == "R" and block.block.words[0].text.endswith(" CT")
    wrong = value == 0.0 or (value < 0.0 and not signed) or (letter == "CCA" and value > 360.0)
    block.refuse_if(wrong, letter if letter in block.values else None, f"is no {letter} of {block.block.words[0].text}")
    return value * (state.length_scale if scale is None else scale)


def _touching(block: CurrentBlock, apart: complex, radius: float, tool: float, turn: int) -> complex:
    """From an arc's centre, where a line from a point (`apart` from it) touches it for a tool of that radius.

    `turn`: +1 if the path leaves the arc counter-clockwise towards the point, or enters it clockwise from there.
    """
    inner = radius - tool
    block.refuse_if(inner <= 0.0, "R", "is no more than the tool's radius", "a larger one, or a smaller tool")
    block.refuse_if(
        abs(apart) <= inner, None, "whose arc holds the point from which, or to which, it goes", "another R"
    )
    reach = math.sqrt(abs(apart) ** 2 - inner**2)
    direction = apart / complex(inner, turn * reach)
    return radius * direction / abs(direction)


def depart(state: State, block: CurrentBlock, code: str) -> None:
    """DEP: leaves the contour and ends the compensation there; the tool then stands at its end without one."""
    plain, (first, second, normal) = state.plain, PLANES[state.plane]
    if plain.heading is None:
        raise block.fail(None, "without a contour element in the plane before it", "L, C, CR or CT before it")
    heading, cutter, apex = plain.heading / abs(plain.heading), state.cutter, in_plane(state, present(state))
    block.refuse_if(cutter is None and code != "DEP LT", None, "without RL or RR, which give its side", "L statements")
    there = named(state, block)
    block.refuse_if(feed(state, block), "FMAX", "on the way off a contour", "F with a number")
    block.take("R0")
    depth = there.pop(normal, None)
    if there.keys() != ({first, second} if code == "DEP LCT" else set()):
        raise block.fail(None, "with or without its end point", "X and Y with LCT alone")
    end = complex(there.get(first, 0.0), there.get(second, 0.0))
    place, center, turn = _way(state, block, code, apex, heading, cutter.side if cutter else 1, end)
    if code != "DEP LN" and abs(place - apex) > NO_ARC_MM:
        _go(state, block, place, center, turn)
    stop(state, block)
    if code in ("DEP LN", "DEP LCT"):
        _go(state, block, end if code == "DEP LCT" else place)
    if depth is not None:
        go(state, block, {normal: depth})


def _go(state: State, block: CurrentBlock, place: complex, center: complex | None = None, turn: int = 0) -> None:
    first, second, _ = PLANES[state.plane]
    go(state, block, {first: place.real, second: place.imag}, center, turn)


def stop(state: State, block: CurrentBlock) -> None:
    """Compensation off where the tool centre stands, which is the programmed point from here on."""
    switch_off(state, block, "R0")
    if state.beside is not None:
        state.frames.position = [p + b for p, b in zip(state.frames.position, state.beside, strict=True)]
        state.beside = None
