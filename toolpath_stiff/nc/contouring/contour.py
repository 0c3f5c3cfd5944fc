"""Contours by the words of statements: lines, arcs, corners between them, compensation; moves of cycles. mm, degrees.

HEIDENHAIN, user's manuals of the TNC 426, the iTNC 530 and the TNC 640, "Programming contours" ("Path contours:
Cartesian coordinates", "Polar coordinates"), "Tool compensation"; SIEMENS, SINUMERIK 840D sl, Programming Manual
Fundamentals, "Motion commands", "Tool radius compensation". Words have Heidenhain's names (RL, PA, FMAX), which
Siemens' words get before. Coordinates are those of program axes; moves are recorded as those of G0 to G3.
"""

import cmath
import math
from collections.abc import Iterable

from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes.center_path import arc_about
from toolpath_stiff.nc.codes.cutter import LEFT, RIGHT, switch_off
from toolpath_stiff.nc.codes.motion import machine_move, record, record_strokes
from toolpath_stiff.nc.codes.tools import HOLDS_HINT
from toolpath_stiff.nc.compensation import RadiusCompensation
from toolpath_stiff.nc.contouring.points import (
    ON_CIRCLE_MM,
    end_of,
    feed,
    in_plane,
    named,
    outside_contour,
    plane_of_pole,
    polar,
    present,
)
from toolpath_stiff.nc.elements import STRAIGHT_ON, Element, cut_off, direction
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.moves import ARC, CYCLE, FEED, RAPID, Remark
from toolpath_stiff.nc.pockets import Cut
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.strokes import SAME_HEIGHT_MM
from toolpath_stiff.nc.tables import LARGEST_MM
from toolpath_stiff.nc.words import AXES, Word

COMPENSATED = (
    "RL, RR (G41, G42) begin and end perpendicular to the first and the last contour element and round outside corners"
)
Circle = tuple[complex, int, int]  # about a centre, +1 counter-clockwise or -1, turns begun
Stroke = tuple[float, float | None, float]  # height, feed, dwell after it
SIDES = {"RL": LEFT, "RR": RIGHT}
UNKNOWN_POINT = "goes to a point of the machine that the program does not give: left out of the path"


def take_side(block: CurrentBlock) -> str | None:
    """R0, RL or RR of a statement, taken; None without one."""
    return next((word for word in ("R0", *SIDES) if block.take(word) is not None), None)


def compensate(state: State, block: CurrentBlock, there: dict[int, float]) -> None:
    """R0, RL, RR of a straight statement: the tool on the contour, left of it, right of it."""
    side, cutter = take_side(block), state.cutter
    if state.plain.approach is not None:  # which decides the side
        block.refuse_if(side == "R0", side, "behind an APPR", "no R0")
        return
    if side is None or (side == "R0" and cutter is None) or (cutter and SIDES.get(side) == cutter.side):
        return
    first, second, _ = PLANES[state.plane]
    moves = bool(there.keys() & {first, second})
    block.refuse_if(not moves, side, "in a statement that does not move in the plane", "it beside X or Y")
    block.refuse_if(state.plain.held, side, "right behind a corner (CHF, RND)", "a contour element between")
    if cutter is None:
        begin_compensation(state, block, side)
        return
    block.refuse_if(side != "R0", side, "while the tool is on the other side", "R0 in a statement before it")
    switch_off(state, block, side)


def tool_radius(state: State, block: CurrentBlock, side: str | None) -> float:
    """Radius of the tool by the tool table or TOOL DEF, and its DR; a check goes on without one, with 0."""
    radius = state.plain.radius
    if math.isnan(radius):
        name = next((name for name, number in state.plain.names.items() if number == state.tool), "")
        tool, own = f'"{name}"' if name else f"{state.tool}", f", or TOOL DEF {state.tool} L.. R.."
        of_name = ", as that of the tool with this remark" if name else own * (state.dialect.name == "heidenhain")
        hint = f"give it in a tool table (--tools FILE){of_name}"
        state.fault(block.fail(side, f"needs the radius of tool {tool}", hint=hint))
        return 0.0
    return radius


def begin_compensation(state: State, block: CurrentBlock, side: str) -> None:
    """The tool beside the contour, by its radius, from the next move on."""
    radius = tool_radius(state, block, side)
    go_beside(state, SIDES[side] if radius >= 0.0 else -SIDES[side], abs(radius) / state.plain.scale)


def go_beside(state: State, side: int, apart: float) -> None:
    """The tool's centre at a distance from the contour, +1 left of it or -1, from the next move on."""
    state.assume(COMPENSATED)
    axes = PLANES[state.plane]
    state.cutter = RadiusCompensation(side, apart, axes, state.length_scale, straight=True, rounded=True)


def go(
    state: State, block: CurrentBlock, there: dict[int, float], about: Circle | None = None, rapid: bool = False
) -> None:
    """A contour element from the present point, straight or `about` a centre. Waits if a corner follows."""
    plain, (first, second, _), (center, turn, turns) = state.plain, PLANES[state.plane], about or (None, 0, 1)
    start = present(state)
    begin, end = in_plane(state, start), complex(there.get(first, start[first]), there.get(second, start[second]))
    if plain.approach is not None:
        _approach(state, block, end - begin if center is None else turn * 1j * (begin - center))
    check_known(state, block, there, rapid)
    nowhere = any(not abs(v) <= LARGEST_MM for v in there.values())  # nan in a check, behind an error
    block.refuse_if(nowhere, None, "leads to a point that is not known, or beyond 100 m")
    if center is not None:
        off = abs(abs(begin - center) - abs(end - center))
        block.refuse_if(abs(begin - center) < ON_CIRCLE_MM, None, "begins at its circle centre", "another CC")
        block.refuse_if(off > ON_CIRCLE_MM, None, f"ends {off:.4f} mm off its circle", f"at most {ON_CIRCLE_MM} mm")
    if plain.held is not None:
        _cut_corner(state, block, (begin, end, center, turn), there, rapid)
    ahead = end - begin if center is None else turn * 1j * (end - center)
    plain.heading, plain.fast = ahead or None, rapid
    if plain.to_corner:
        block.refuse_if(rapid or turns > 1 or there.keys() - {first, second}, None, *_NO_CORNER)
        plain.held = (block, (begin, end, center, turn), state.feed)
    else:
        move(state, block, there, about, rapid)


def move(
    state: State, block: CurrentBlock, there: dict[int, float], about: Circle | None = None, rapid: bool = False
) -> None:
    """Record a straight move or an arc from where the tool stands, as G0 to G3 do."""
    frames = state.frames
    here = frames.to_program(frames.position)
    control = frames.to_control([there.get(axis, value) for axis, value in enumerate(here)])
    if not frames.rotated:  # an axis that is not named keeps its number to the last digit
        control = [control[axis] if axis in there else value for axis, value in enumerate(frames.position)]
    if about is None:
        record(state, block, RAPID if rapid else FEED, control, there)
        return
    center, turn, turns = about
    block.refuse_if(state.beside, None, "is an arc right after R0", "a straight statement (L) between")
    first, second, _ = PLANES[state.plane]
    end = there.get(first, here[first]), there.get(second, here[second])
    middle, start = (center.real, center.imag), (here[first], here[second])
    sweep = geometry.sweep_about(middle, start, end, turn < 0, state.inch, turns)
    record(state, block, ARC, control, there, arc=arc_about(state, here, center, sweep))


def mill(state: State, block: CurrentBlock, cuts: Iterable[Cut]) -> None:
    """Carry out the moves of a milled pocket, slot or stud, and keep the modal feed."""
    (first, second, normal), modal = PLANES[state.plane], state.feed
    for place, height, rate, center, turn in cuts:
        block.refuse_if(rate is not None and not rate > 0.0, None, "cuts without a feed", "its feed above 0")
        there = {first: place.real, second: place.imag, normal: height}
        state.feed = rate or modal
        go(state, block, there, None if center is None else (center, turn, 1), rate is None)
    state.feed, state.plain.heading = modal, None


def plunge(state: State, block: CurrentBlock, path: Iterable[Stroke]) -> None:
    """Carry out strokes at the present point, in mm and mm/min; a feed of 0 means that none was given."""
    modal, moves = state.feed, ((height, RAPID if rate is None else CYCLE, rate, wait) for height, rate, wait in path)
    record_strokes(state, block, PLANES[state.plane][2], moves, SAME_HEIGHT_MM)
    state.feed, state.plain.heading = modal, None


def _approach(state: State, block: CurrentBlock, ahead: complex) -> None:
    plain = state.plain
    block.refuse_if(not abs(ahead), None, "behind an APPR has no direction in the plane", "the first contour element")
    assert plain.approach is not None
    waits, plain.to_corner = plain.to_corner, False
    plain.approach[1](ahead / abs(ahead))
    plain.to_corner = waits


_NO_CORNER = ("before a corner (CHF, RND) moves out of the plane, or at FMAX", "a contour element in the plane")


def check_known(state: State, block: CurrentBlock, there: dict[int, float], rapid: bool) -> None:
    """Refuse a cut from a point that is not known, and moves in coordinates whose order is uncertain."""
    plain = state.plain
    problem = "is a cut from where the tool's place is not known (after PLANE, cycle 19, M140 or M92)"
    axes = " ".join(AXES[axis] for axis in sorted(plain.unknown))
    block.refuse_if(plain.unknown and not rapid, None, problem, f"{axes} in a statement with FMAX before it")
    plain.unknown = plain.unknown - there.keys()
    inner = plain.angle != 0.0, bool(plain.mirrored), plain.scale != 1.0
    uncertain = plain.doubt and (any(inner) or plain.tilt is not None)
    block.refuse_if(uncertain, None, plain.doubt, "cycle 7 first, then PLANE, then 8, 10 or 11")
    plain.doubt = ""
    block.refuse_if(all(inner[:2]), None, "under cycle 8 and cycle 10: their order decides the path", "one of them")
    if plain.held_tip and state.frames.posted is None:
        turned = any(state.frames.position[3:]) and state.frames.position[3:] != plain.led_to
        leans = turned or any(there.get(axis) for axis in (3, 4, 5))
        block.refuse_if(leans, None, "turns rotary axes under tool centre point control (M128)", "", HOLDS_HINT)


def line(state: State, block: CurrentBlock, code: str) -> None:
    """L: straight to a point. In machine coordinates under M91."""
    plain, there, rapid = state.plain, named(state, block), feed(state, block)
    if plain.tilt is not None and there.keys() & {3, 4, 5}:
        block.refuse_if(there.keys() & {0, 1, 2} and not rapid, None, "turns rotary axes in a tilted plane", "FMAX")
        for axis in there.keys() & {3, 4, 5}:
            word = block.values.get(AXES[axis]) or block.values[f"I{AXES[axis]}"]
            state.note(block.line, word, "turns the machine's axes to the tilted plane, which gives the tool's axis")
            del there[axis]
    machine = next((code for code in ("M91", "M92") if block.take(code) is not None), "")
    if machine:
        _to_machine(state, block, machine, there, rapid)
        return
    compensate(state, block, there)
    if there:
        go(state, block, there, rapid=rapid)


def _to_machine(state: State, block: CurrentBlock, code: str, there: dict[int, float], rapid: bool) -> None:
    """M91: machine coordinates; unknown ones, and the points of M92, are left out of the path."""
    plain, unit = state.plain, state.length_scale
    block.take("R0")
    lost = {axis for axis, value in there.items() if code == "M92" or math.isnan(value)}
    if lost:
        block.refuse_if(not rapid, code, "in a cut: the machine builder says where its points are", "FMAX")
        state.warnings.append(Remark(UNKNOWN_POINT, block.line))
        plain.unknown |= lost & {0, 1, 2}
    words = {axis: value for axis, value in there.items() if axis not in lost}
    if not words:
        return
    outside_contour(state, block, code, plain.to_corner)
    block.refuse_if(any(letter[0] == "I" for letter in block.values), code, "with steps", "coordinates")
    values = {AXES[a]: Word(AXES[a], v / unit if a < 3 else v, 1, AXES[a]) for a, v in words.items()}
    current = CurrentBlock(block.name, block.block, {"G53": block.values[code]}, {}, values, set(values))
    state.motion, plain.heading, plain.pole = "G0" if rapid else "G1", None, None
    plain.unknown -= words.keys() if plain.tilt is None else set()
    machine_move(state, current, "G53")


def polar_line(state: State, block: CurrentBlock, code: str) -> None:
    """LP: straight to a point in polar coordinates about CC."""
    with plane_of_pole(state, block) as pole:
        there, rapid = polar(state, block, pole), feed(state, block)
        compensate(state, block, there)
        go(state, block, there, rapid=rapid)


def arc_to(state: State, block: CurrentBlock, there: dict[int, float], about: Circle) -> None:
    """An arc to a point, with its feed; the side of the compensation may not change on it."""
    rapid = feed(state, block)
    block.refuse_if(rapid, "FMAX", "on an arc", "F with a number")
    side = take_side(block)
    same = side is None or SIDES.get(side, 0) == (state.cutter.side if state.cutter else 0)
    block.refuse_if(not same or state.beside, side, "changes on an arc", "a straight statement (L) for it")
    go(state, block, there, about)


def turn_of(block: CurrentBlock, step: float = 0.0) -> int:
    """+1 or -1 by DR+ and DR-; without them by the sign of an angle's step."""
    plus, minus = block.take("DR+"), block.take("DR-")
    block.refuse_if(plus is None and minus is None and not step, None, "without its direction", "DR+ or DR-")
    return 1 if plus is not None or (minus is None and step > 0.0) else -1


def radius_circle(state: State, block: CurrentBlock, code: str) -> None:
    """CR: to a point by a radius; a negative one goes the longer way."""
    turn, there, radius = turn_of(block), named(state, block), block.take("R")
    if not radius:
        raise block.fail(None, "without its radius", "R")
    start, end = in_plane(state, present(state)), end_of(state, there)
    places, clockwise = ((start.real, start.imag), (end.real, end.imag)), turn < 0
    center = complex(*geometry.center_from_radius(*places, radius * state.length_scale, clockwise))
    arc_to(state, block, there, (center, turn, 1))


def tangent_circle(state: State, block: CurrentBlock, code: str) -> None:
    """CT, CTP: an arc to a point that continues smoothly from the previous contour element."""
    heading = state.plain.heading
    if heading is None:
        raise block.fail(None, "without a contour element in the plane before it", "L, C, CR or CT before it")
    if code == "CT":
        there = named(state, block)
    else:
        with plane_of_pole(state, block) as pole:
            there = polar(state, block, pole)
    start, end = in_plane(state, present(state)), end_of(state, there)
    ahead = heading / abs(heading)
    chord = (end - start) / ahead  # seen along the path
    block.refuse_if(abs(chord) < ON_CIRCLE_MM, None, "to its own start", "another point")
    if abs(cmath.phase(chord)) < STRAIGHT_ON:
        go(state, block, there, rapid=feed(state, block))
        return
    block.refuse_if(math.pi - abs(cmath.phase(chord)) < STRAIGHT_ON, None, "straight back", "another point")
    radius = abs(chord) ** 2 / (2.0 * chord.imag)  # to the left where positive
    arc_to(state, block, there, (start + radius * 1j * ahead, 1 if radius > 0.0 else -1, 1))


def _cut_corner(state: State, after: CurrentBlock, element: Element, there: dict[int, float], rapid: bool) -> None:
    """Carry out the waiting element, shortened, and its corner; the tool then stands where the next element begins."""
    (block, held, rate), corner_block, modal = state.plain.held or (None, None, None), state.plain.corner, state.feed
    state.plain.held = state.plain.corner = None
    if block is None or held is None or corner_block is None:  # in a check, after the corner's own error
        raise after.fail(None, "follows a corner (CHF, RND) that was not read", "a corner that fits")
    first, second, _ = PLANES[state.plane]
    size, rounded = corner_block.values["size"].value, corner_block.block.words[0].text == "RND"
    after.refuse_if(rapid or there.keys() - {first, second}, None, *_NO_CORNER)
    if "across" in corner_block.values:  # the chamfer's own length, not that along the lines
        turned = cmath.phase(direction(element, held[1]) / direction(held, held[1]))
        size /= 2.0 * max(math.cos(turned / 2.0), STRAIGHT_ON)
    lines = held[2] is None and element[2] is None
    corner_block.refuse_if(not rounded and not lines, None, "beside an arc", "CHF between two lines")
    with corner_block.placing():
        cut = cut_off(held, element, size, rounded)
    rounding = cut or (held[1], held[1], None, 0)
    state.feed = rate
    _along(state, block, held, rounding[0])
    alone = corner_block.values.get("F alone")
    state.feed = alone.value if alone else rate
    if cut is not None:
        _along(state, corner_block, cut, cut[1])
    state.feed = modal


def _along(state: State, block: CurrentBlock, element: Element, end: complex) -> None:
    (first, second, _), (_, _, center, turn) = PLANES[state.plane], element
    move(state, block, {first: end.real, second: end.imag}, None if center is None else (center, turn, 1))
