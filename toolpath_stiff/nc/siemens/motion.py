"""Motion of Siemens' language: G0 to G3, CIP, CT, polar words, tool vectors, SUPA, corners. mm and degrees.

SIEMENS, SINUMERIK 840D sl, Programming Manual Fundamentals, "Motion commands", "Tool radius compensation"; Job
Planning, "Transformations". A coordinate is one of its block (X), of a step (IX, from =IC() or in G91), or absolute
(@X, from =AC()). Contours are made by `contouring`, whose names the words get: as on Heidenhain's controls the tool
enters a compensated contour perpendicular to it and rounds its outside corners.
"""

import cmath
import math

import numpy as np

from toolpath_stiff.nc.codes.motion import record
from toolpath_stiff.nc.codes.tools import HOLDS_HINT
from toolpath_stiff.nc.contouring import contour, tilting
from toolpath_stiff.nc.contouring.points import end_of, in_plane, named, outside_contour, plane_of_pole, polar, present
from toolpath_stiff.nc.geometry import PLANES, turned
from toolpath_stiff.nc.moves import ARC, Arc
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES, Word

POLAR = frozenset(("PR", "PA", "IPR", "IPA"))  # RP and AP have the names PR and PA here
SHORTER = ("DC", "ACP", "ACN")
POINTS = POLAR | {"ANG"} | {f"{kind}{letter}" for letter in AXES for kind in ("", "I", "@", *SHORTER)}
CENTERS = frozenset((*"IJK", "@I", "@J", "@K", "R", "AR", "TURN"))  # CR is R
VECTOR = ("A3", "B3", "C3")
CORNERS = ("RND", "CHF", "CHR")
SIDES = {"G40": "R0", "G41": "RL", "G42": "RR"}
MACHINE = ("SUPA", "G53", "G153")
CUTS = ("G1", "G2", "G3", "CT")  # between which RNDM rounds
LEAST_ANGLE = 1e-4  # rad, of ANG from the axis that has no coordinate
ENDS = "from tool axis to tool axis the tool goes on a great circle (ORIVECT), whatever leads it on the control"
CHORDS = "a spline is taken as straight lines through its points"


def rename(block: CurrentBlock, old: str, new: str, value: float | None = None) -> None:
    """Give an unused word another letter and, if given, another value."""
    block.refuse_if(new in block.values, old, f"and {new} name the same in one block", "one of them")
    word = block.values.pop(old)
    block.values[new] = word if value is None else word._replace(value=value)
    block.free = (block.free - {old}) | {new}


def mark(block: CurrentBlock, letter: str, shown: str = "", value: float = 0.0) -> None:
    """Add to a block a word that is not written in it."""
    block.values[letter] = Word(letter, value, block.block.words[0].column, shown or letter)
    block.free.add(letter)


def moves(state: State, block: CurrentBlock) -> bool:
    """True if a block moves: it names a point, a tool axis, or an arc's centre beside G2 or G3."""
    arcs = state.motion in ("G2", "G3") and "motion" in block.groups
    return bool(block.free & (POINTS | {*VECTOR} | (CENTERS if arcs else frozenset())))


def round_all(state: State, block: CurrentBlock) -> None:
    """RNDM: the radius of each corner between contour elements from here on; 0: none."""
    if block.has("RNDM"):
        early = state.plain.held is not None and not moves(state, block)
        block.refuse_if(early, "RNDM", "between a corner (RND, CHF, CHR) and the move behind it", "the move")
        size = (block.take("RNDM") or 0.0) * state.length_scale
        block.refuse_if(size < 0.0, "RNDM", "is the radius of corners", "0 or more")
        state.plain.rounding = size


def move(state: State, block: CurrentBlock) -> None:
    """Carry out the motion of a block, with its corner and its change of compensation."""
    plain, mode = state.plain, state.motion or "G1"
    corner = next((letter for letter in CORNERS if block.has(letter)), "")
    size = (block.take(corner) or 0.0) * state.length_scale if corner else plain.rounding * (mode in CUTS)
    block.refuse_if(size < 0.0, corner, "is the size of a corner", "more than 0")
    plain.to_corner = size > 0.0
    modal, alone = state.feed, block.take("FB")
    state.feed = modal if alone is None else alone * state.feed_scale
    once = next((name for name in MACHINE if name in block.codes), "G500" if plain.base == "machine" else "")
    _name_steps(state, block)
    if once:
        _machine(state, block, once, mode)
    else:
        MOTIONS[mode](state, block, mode)
    state.feed = modal if alone is not None else state.feed
    if plain.to_corner and plain.held is not None:
        column = block.values[corner].column if corner else block.block.words[0].column
        head = Word("", size, column, "RND" if corner in ("", "RND") else "CHF")
        plain.corner = CurrentBlock(block.name, type(block.block)(block.line, (head,)))
        plain.corner.values |= {"size": head} | ({"across": head} if corner == "CHF" else {})
    plain.to_corner = False


def _name_steps(state: State, block: CurrentBlock) -> None:
    """Rename coordinates to the names of `contouring`: X, and IX for an increment."""
    plain, here = state.plain, present(state)
    for axis, letter in enumerate(AXES):
        if f"@{letter}" in block.free:
            rename(block, f"@{letter}", letter)
        elif letter in block.free and not state.absolute:
            rename(block, letter, f"I{letter}")
        for kind in SHORTER:
            if kind + letter in block.free:
                angle = block.values[kind + letter].value - here[axis]
                angle = math.remainder(angle, 360.0) if kind == "DC" else angle % 360.0 - 360.0 * (kind == "ACN")
                rename(block, kind + letter, letter, here[axis] + angle)
        problem = "is a step right after another frame, tool length or SUPA: a setting decides whether that is added"
        unsure = axis in plain.renumbered and f"I{letter}" in block.free
        block.refuse_if(unsure, f"I{letter}", problem, f"{letter} in G90 before it")
        plain.renumbered -= {axis} if letter in block.free else set()
    turned = plain.tilt is not None and any(block.has(step + letter) for letter in "ABC" for step in ("", "I"))
    block.refuse_if(turned, None, "turns rotary axes in a tilted plane (CYCLE800)", "CYCLE800() before it")
    rotary = any(word.value for letter, word in block.values.items() if letter in block.free and letter[-1] in "ABC")
    unknown = plain.transformed and state.frames.posted is None and rotary
    block.refuse_if(unknown, None, "turns rotary axes under TRAORI", "A3, B3, C3", HOLDS_HINT)
    lost = bool(block.free & POLAR) and plain.pole is None
    steps = not state.absolute and bool(block.free & {"PR", "PA"})
    block.refuse_if(steps, None, "polar words (RP, AP) in G91", "G90, or =IC()")
    block.refuse_if(lost, None, "polar words without a pole, or after a change of the coordinates", "G111 before it")


def straight(state: State, block: CurrentBlock, code: str) -> None:
    """G0, G1: straight to a point, with the tool axis if A3, B3, C3 give one; splines as their chords."""
    plain, (first, second, _) = state.plain, PLANES[state.plane]
    if code in ("ASPLINE", "CSPLINE"):
        state.assume(CHORDS)
    if code == "G0":
        mark(block, "FMAX")
    if any(block.has(letter) for letter in VECTOR):
        _lean(state, block)
        return
    _by_angle(state, block)
    in_the_plane = POLAR | {step + AXES[axis] for axis in (first, second) for step in ("", "I")}
    if plain.side and block.free & in_the_plane:
        mark(block, SIDES[plain.side], plain.side)
        plain.side = ""
    (contour.polar_line if block.free & POLAR else contour.line)(state, block, "L")


def _by_angle(state: State, block: CurrentBlock) -> None:
    """ANG: the line's angle from the first axis of the plane, and one of its end's two coordinates."""
    plain, angle, plane = state.plain, block.take("ANG"), PLANES[state.plane][:2]
    if angle is None:
        return
    given = [axis for axis in plane if block.free & {AXES[axis], f"I{AXES[axis]}"}]
    block.refuse_if(
        len(given) != 1 or block.free & POLAR, "ANG", "names no end", f"one of {AXES[plane[0]]}, {AXES[plane[1]]}"
    )
    (known,) = given
    other, here, step = sum(plane) - known, present(state), block.values.get(f"I{AXES[known]}")
    block.refuse_if(
        other in plain.renumbered, "ANG", "right after another frame or tool length", f"{AXES[other]} before it"
    )
    way = step.value if step else block.values[AXES[known]].value - here[known] / state.length_scale
    ahead = turned(angle)
    along, across = (ahead.real, ahead.imag) if known == plane[0] else (ahead.imag, ahead.real)
    backward = abs(along) < LEAST_ANGLE or way * along < 0.0
    block.refuse_if(backward, "ANG", "leads away from that end", "its direction")
    mark(block, f"I{AXES[other]}", "ANG", way * across / along)


def _lean(state: State, block: CurrentBlock) -> None:
    """Move with the tool axis as a vector in workpiece coordinates, rotated by the frames in force."""
    plain, vector = state.plain, [block.take(letter) or 0.0 for letter in VECTOR]
    length = math.hypot(*vector)
    block.refuse_if(not plain.transformed, "A3", "is the tool's axis without TRAORI", "TRAORI before it")
    block.refuse_if(length < 1e-6, "A3", "is no direction", "A3, B3, C3")
    block.refuse_if(plain.mirrored or plain.side, "A3", "under MIRROR, or with G41 or G42", "G40, no mirror image")
    turned = state.frames.turn_direction((vector[0] / length, vector[1] / length, vector[2] / length))
    for letter, value in zip(("TX", "TY", "TZ"), turned, strict=True):
        mark(block, letter, "A3", value)
    state.assume(ENDS)
    tilting.vectors(state, block, "LN")


def arc(state: State, block: CurrentBlock, code: str) -> None:
    """G2, G3: by centre, radius (CR), opening angle (AR) or polar words, with whole turns (TURN)."""
    plain, (first, second, normal), scale = state.plain, PLANES[state.plane], state.length_scale
    _no_side(state, block)
    middle, given = in_plane(state, present(state)), False
    for axis in (first, second, normal):
        for absolute, letter in ((True, f"@{'IJK'[axis]}"), (False, "IJK"[axis])):
            value = block.take(letter)
            block.refuse_if(axis == normal and value, letter, f"is off the plane {state.plane}")
            if value is not None and axis != normal:
                shift, part = value * scale, [middle.real, middle.imag]
                place = (first, second).index(axis)
                part[place], given = shift if absolute else part[place] + shift, True
                middle = complex(*part)
    block.refuse_if(given and block.has("R"), "R", "and a centre are both given", "one of them")
    if block.has("R"):
        mark(block, "DR-" if code == "G2" else "DR+")
        contour.radius_circle(state, block, code)
        return
    turns = 1 + (block.whole("TURN", block.values["TURN"], 0) or 0 if block.has("TURN") else 0)
    block.refuse_if(turns > 1000, "TURN", "is not a number of turns", "0 to 999")
    begin, opening, turn = in_plane(state, present(state)), block.take("AR"), -1 if code == "G2" else 1
    if block.free & POLAR:
        with plane_of_pole(state, block) as pole:
            middle, given, there = (middle if given else pole), True, polar(state, block, pole)
    else:
        there = named(state, block)
    if opening is not None:
        block.refuse_if(not 0.0 < opening < 360.0, "AR", "is no opening angle", "0 to 360 degrees")
        swept, end = cmath.exp(1j * turn * math.radians(opening)), end_of(state, there)
        middle = middle if given else (end - begin * swept) / (1.0 - swept)
        end = middle + (begin - middle) * swept
        there, given = there | {first: end.real, second: end.imag}, True
    block.refuse_if(not given, None, "an arc without a centre", "I, J, K, CR= or AR=")
    plain.fast = False
    contour.go(state, block, there, (middle, turn, turns))


def tangent(state: State, block: CurrentBlock, code: str) -> None:
    """CT: an arc tangent to the element before."""
    _no_side(state, block)
    contour.tangent_circle(state, block, "CTP" if block.free & POLAR else "CT")


def through(state: State, block: CurrentBlock, code: str) -> None:
    """CIP: an arc in space through the intermediate point I1, J1, K1."""
    plain, frames, scale, start = state.plain, state.frames, state.length_scale, present(state)
    other = state.cutter or plain.held or plain.to_corner or plain.side
    block.refuse_if(other, None, "CIP beside a corner, or with G41 or G42", "G2, G3")
    middle = list(start)
    for axis, letter in enumerate(("I1", "J1", "K1")):
        step, absolute, value = block.take(f"I{letter}"), block.take(f"@{letter}"), block.take(letter)
        if not state.absolute and value is not None:
            step, value = value, None
        value = absolute if absolute is not None else value
        middle[axis] = start[axis] + (step or 0.0) * scale if value is None else value * scale
    there = named(state, block)
    contour.check_known(state, block, there, rapid=False)
    control = frames.to_control([there.get(axis, value) for axis, value in enumerate(start)])
    here, over = (np.array(frames.to_setup(frames.to_control(point))[:3]) for point in (start, middle))
    a, b = over - here, np.array(frames.to_setup(control)[:3]) - here
    normal = np.cross(a, b)
    size = float(normal @ normal)
    block.refuse_if(size < 1e-9 * float(a @ a) * float(b @ b) or not size, None, "three points of CIP on a line")
    out = np.cross((a @ a) * b - (b @ b) * a, normal) / (2.0 * size)
    normal /= math.sqrt(size)
    sweep = math.atan2(float(np.cross(-out, b - out) @ normal), float(-out @ (b - out))) % math.tau
    (x, y, z), (i, j, k) = (here + out).tolist(), normal.tolist()
    plain.heading = None
    record(state, block, ARC, control, there, arc=Arc((x, y, z), (i, j, k), sweep))


def _no_side(state: State, block: CurrentBlock) -> None:
    problem = f"an arc as the first move of {state.plain.side}"
    block.refuse_if(state.plain.side, None, problem, "a straight move (G0, G1) between")


def _machine(state: State, block: CurrentBlock, code: str, mode: str) -> None:
    """SUPA, G53, G153, and G500 where other offsets are in use: machine coordinates of the tool's tip."""
    plain, frames, moved = state.plain, state.frames, {axis for axis, letter in enumerate(AXES) if block.has(letter)}
    outside_contour(state, block, code, plain.to_corner or plain.side)
    cut = mode != "G0" and (code == "G500" or mode != "G1")
    block.refuse_if(cut, None, f"{code} in a cut: where the work sits on the machine is not known", "G0")
    framed = code == "G500" and (frames.linear is not None or any(frames.g92))
    block.refuse_if(framed, None, "a frame under G500 (no settable offset)", "TRANS, or G54 before it")
    mark(block, "M91", code)
    if mode == "G0" or state.feed is None:  # a control starts in G1
        mark(block, "FMAX")
    length, frames.tool = frames.tool, 0.0
    contour.line(state, block, "L")
    frames.tool = length
    plain.renumbered |= moved


MOTIONS = {
    "G0": straight, "G1": straight, "G2": arc, "G3": arc, "CIP": through, "CT": tangent, "ASPLINE": straight,
    "CSPLINE": straight,
}  # fmt: skip
