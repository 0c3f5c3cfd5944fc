"""Motion of Siemens' language: G0 to G3, CIP, CT, polar words, tool vectors, SUPA, corners. mm and degrees.

SIEMENS, SINUMERIK 840D sl, Programming Manual Fundamentals, "Motion commands", "Tool radius compensation"; Job
Planning, "Transformations". A coordinate is one of its block (X), of a step (IX, from =IC() or in G91), or absolute
(@X, from =AC()). Contours are made as those of Heidenhain's controls: both enter a compensated contour perpendicular to
it and round its outside corners.
"""

import cmath
import math

import numpy as np

from toolpath_stiff.nc.codes.motion import machine_move, record
from toolpath_stiff.nc.geometry import PLANES, ArcError, center_from_radius
from toolpath_stiff.nc.heidenhain import contour, functions
from toolpath_stiff.nc.heidenhain.points import in_plane, named, present
from toolpath_stiff.nc.moves import ARC, Arc, Remark
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES, Word

POLAR = frozenset(("AP", "RP", "IAP", "IRP", "@AP"))
SHORTER = ("DC", "ACP", "ACN")
POINTS = POLAR | {f"{kind}{letter}" for letter in AXES for kind in ("", "I", "@", *SHORTER)}
CENTERS = frozenset((*"IJK", "@I", "@J", "@K", "CR", "AR", "TURN"))
VECTOR = ("A3", "B3", "C3")
CORNERS = ("RND", "CHF", "CHR")
SIDES = {"G40": "R0", "G41": "RL", "G42": "RR"}
MACHINE = ("SUPA", "G53", "G153")
ENDS = "the tool goes on the great circle from axis to axis (ORIVECT); between these ORIAXES would lead it otherwise"
UNKNOWN_HOME = "goes to a machine position in a variable of the machine builder's: left out of the path"
CHORDS = "a spline is taken as straight lines through its points"


def rename(block: CurrentBlock, old: str, new: str) -> None:
    """Give a word that is free another letter."""
    block.refuse_if(new in block.values, old, f"and {new} name the same in one block", "one of them")
    block.values[new] = block.values.pop(old)
    block.free = (block.free - {old}) | {new}


def mark(block: CurrentBlock, letter: str) -> None:
    """Give a block a word without a number."""
    block.values[letter] = Word(letter, 0.0, block.block.words[0].column, letter)
    block.free.add(letter)


def moves(state: State, block: CurrentBlock) -> bool:
    """Whether a block moves: it names a point, or an arc's centre, in a motion mode."""
    arcs = state.motion in ("G2", "G3") and "motion" in block.groups
    return bool(block.free & POINTS) or bool(block.free & {*VECTOR}) or (arcs and bool(block.free & CENTERS))


def move(state: State, block: CurrentBlock) -> None:
    """Carry out the motion of a block, with its corner and its change of compensation."""
    plain, mode = state.plain, state.motion or "G1"  # a control starts in G1
    corner = next((letter for letter in CORNERS if block.has(letter)), None)
    size = (block.take(corner) or 0.0) * state.length_scale if corner else 0.0
    block.refuse_if(size < 0.0, corner, "is the size of a corner", "more than 0")
    plain.to_corner = size > 0.0
    once = next((name for name in MACHINE if name in block.codes), None)
    if once is not None or plain.base == "machine":
        _machine(state, block, once or "G500", mode)
    else:
        try:
            MOTIONS[mode](state, block, mode)
        except ArcError as error:
            raise block.fail(None, error.found, error.expected) from None
    if plain.to_corner and plain.held is not None and corner is not None:
        head = Word("", size, block.values[corner].column, "RND" if corner == "RND" else "CHF")
        values = {"size": head} | ({"across": head} if corner == "CHF" else {})
        plain.corner = CurrentBlock(block.name, block.block, {}, {}, values)
        plain.corner.block = type(block.block)(block.line, (head,))
    plain.to_corner = False


def _points(state: State, block: CurrentBlock) -> dict[int, float]:
    """Axis -> coordinate of the words, polar ones about the pole; whether they are steps is said by word or mode."""
    plain, scale = state.plain, state.length_scale
    for letter in (*AXES, "AP", "RP"):
        if f"@{letter}" in block.free:
            rename(block, f"@{letter}", letter)
        elif letter in block.free and not state.absolute and letter in AXES:
            rename(block, letter, f"I{letter}")
        for kind in SHORTER:
            if kind + letter in block.free:
                start = present(state)[AXES.index(letter)]
                angle = block.values[kind + letter].value - start
                angle = math.remainder(angle, 360.0) if kind == "DC" else angle % 360.0 - 360.0 * (kind == "ACN")
                rename(block, kind + letter, letter)
                block.values[letter] = block.values[letter]._replace(value=start + angle)
    for axis in sorted(plain.renumbered):
        problem = "is a step right after another frame, tool length or SUPA: a setting decides whether that is added"
        block.refuse_if(f"I{AXES[axis]}" in block.free, f"I{AXES[axis]}", problem, f"{AXES[axis]} in G90 before it")
    turned = plain.tilt is not None and any(block.has(step + letter) for letter in "ABC" for step in ("", "I"))
    block.refuse_if(
        turned, None, "turns rotary axes in a tilted plane (CYCLE800)", "no A, B, C, or CYCLE800() before it"
    )
    polar_words = block.free & POLAR
    there = named(state, block)
    plain.renumbered -= there.keys()
    if polar_words:
        block.refuse_if(plain.pole is None, None, "polar words without a pole", "G111 before it")
        first, second, _ = PLANES[state.plane]
        block.refuse_if(there.keys() & {first, second}, None, "polar words beside those of the plane")
        pole = plain.pole[1] if plain.pole else 0j
        here = in_plane(state, present(state)) - pole
        given = block.take("RP"), block.take("IRP"), block.take("AP"), block.take("IAP")
        radius = abs(here) if given[0] is None else given[0] * scale
        heading = math.degrees(cmath.phase(here)) if given[2] is None else given[2]
        place = pole + cmath.rect(radius + (given[1] or 0.0) * scale, math.radians(heading + (given[3] or 0.0)))
        there |= {first: place.real, second: place.imag}
    return there


def straight(state: State, block: CurrentBlock, code: str) -> None:
    """G0, G1: straight to a point, with the tool's axis where A3, B3, C3 give one; splines as their chords."""
    rapid, plain = code == "G0", state.plain
    if code in ("ASPLINE", "CSPLINE"):
        state.assume(CHORDS)
    if any(block.has(letter) for letter in VECTOR):
        _lean(state, block, rapid)
        return
    there = _points(state, block)
    _compensate(state, block, there)
    contour.go(state, block, there, rapid=rapid)
    plain.fast = rapid


def _lean(state: State, block: CurrentBlock, rapid: bool) -> None:
    """A move with the tool's axis as a vector of the workpiece, turned with the frames in force."""
    plain = state.plain
    block.refuse_if(not plain.held_tip, "A3", "is the tool's axis without TRAORI", "TRAORI before it")
    vector = [block.take(letter) or 0.0 for letter in VECTOR]
    length = math.hypot(*vector)
    block.refuse_if(length < 1e-6, "A3", "is no direction", "A3, B3, C3")
    block.refuse_if(plain.mirrored or plain.side, "A3", "under MIRROR, or with G41 or G42", "G40, no mirror image")
    x, y, z = state.frames.turn_direction((vector[0] / length, vector[1] / length, vector[2] / length))
    there = _points(state, block)
    here = present(state)
    for letter, value in zip(("TX", "TY", "TZ"), (x, y, z), strict=True):
        block.values[letter] = Word(letter, value, 1, letter)
    block.free |= {"TX", "TY", "TZ"}
    _restate(state, block, there)
    if rapid:
        mark(block, "FMAX")
    if plain.orientation != "ORIVECT" and here[3:5] != [0.0, 0.0]:
        state.assume(ENDS)
    functions.vectors(state, block, "LN")


def _restate(state: State, block: CurrentBlock, there: dict[int, float]) -> None:
    """Give a block its point as absolute words again, for what takes them."""
    for axis, value in there.items():
        block.values[AXES[axis]] = Word(AXES[axis], value / (state.length_scale if axis < 3 else 1.0), 1, AXES[axis])
        block.free.add(AXES[axis])


def _compensate(state: State, block: CurrentBlock, there: dict[int, float]) -> None:
    """G40, G41, G42 act with the next straight move in the plane."""
    first, second, _ = PLANES[state.plane]
    if state.plain.side and there.keys() & {first, second}:
        mark(block, SIDES[state.plain.side])
        state.plain.side = ""
        contour.compensate(state, block, there)


def arc(state: State, block: CurrentBlock, code: str) -> None:
    """G2, G3: by centre, radius (CR), opening angle (AR) or polar words, with whole turns (TURN)."""
    (first, second, normal), clockwise, scale = PLANES[state.plane], code == "G2", state.length_scale
    begin, turn = in_plane(state, present(state)), -1 if clockwise else 1
    _no_side(state, block)
    polar_words = bool(block.free & POLAR)
    there = _points(state, block)
    end = complex(there.get(first, begin.real), there.get(second, begin.imag))
    turns = 1 + (block.whole("TURN", block.values["TURN"], 0) or 0 if block.has("TURN") else 0)
    block.refuse_if(turns > 1000, "TURN", "is not a number of turns", "0 to 999")
    radius, opening = block.take("CR"), block.take("AR")
    off = "IJK"[normal]
    for letter in (off, f"@{off}"):
        wrong = letter in block.values and letter[0] != "@" and block.take(letter)
        block.refuse_if(wrong, letter, f"is off the plane {state.plane}")
    center, by_center = [begin.real, begin.imag], False
    for place, letter in enumerate("IJK"[axis] for axis in (first, second)):
        absolute, step = block.take(f"@{letter}"), block.take(letter)
        by_center |= absolute is not None or step is not None
        center[place] = absolute * scale if absolute is not None else center[place] + (step or 0.0) * scale
    middle = complex(*center)
    block.refuse_if(by_center and radius is not None, "CR", "and a centre are both given", "one of them")
    if opening is not None:
        block.refuse_if(not 0.0 < opening < 360.0, "AR", "is no opening angle", "0 to 360 degrees")
        swept = cmath.exp(1j * turn * math.radians(opening))
        if by_center:
            end = middle + (begin - middle) * swept
            there |= {first: end.real, second: end.imag}
        else:
            middle = (end - begin * swept) / (1.0 - swept)
    elif radius is not None:
        places = (begin.real, begin.imag), (end.real, end.imag)
        middle = complex(*center_from_radius(*places, radius * scale, clockwise))
    elif polar_words and not by_center:
        middle = state.plain.pole[1] if state.plain.pole else 0j
    else:
        block.refuse_if(not by_center, None, "an arc without a centre", "I, J, K, CR= or AR=")
    contour.go(state, block, there, middle, turn, turns)


def tangent(state: State, block: CurrentBlock, code: str) -> None:
    """CT: an arc that goes on smoothly from the element before."""
    _no_side(state, block)
    there = _points(state, block)
    _restate(state, block, there)
    contour.tangent_circle(state, block, code)


def through(state: State, block: CurrentBlock, code: str) -> None:
    """CIP: an arc in space through the point of I1, J1, K1."""
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
    there = _points(state, block)
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
    """SUPA, G53, G153, and G500 where other offsets are in use: coordinates of the machine, of the tool's tip."""
    plain, frames = state.plain, state.frames
    waits = state.cutter or plain.held or plain.to_corner or plain.side
    block.refuse_if(waits, None, f"{code} beside a contour with compensation or a corner", "G40 before it")
    block.refuse_if(mode != "G0", None, f"{code} in a cut: where the work sits on the machine is not known", "G0")
    for letter in AXES:
        if f"@{letter}" in block.free:
            rename(block, f"@{letter}", letter)
    lost = {axis for axis, letter in enumerate(AXES) if letter in block.free and math.isnan(block.values[letter].value)}
    if lost:
        state.warnings.append(Remark(UNKNOWN_HOME, block.line))
        block.free -= {AXES[axis] for axis in lost}
        plain.unknown |= lost & {0, 1, 2}
    block.codes.setdefault("G53", block.codes.get(code, block.block.words[0]))
    moved = {axis for axis, letter in enumerate(AXES) if block.has(letter)}
    state.motion, length, frames.tool = mode, frames.tool, 0.0
    if moved:
        machine_move(state, block, "G53")
    frames.tool = length
    plain.renumbered |= moved
    plain.unknown -= moved if plain.tilt is None else set()
    plain.heading = plain.pole = None


MOTIONS = {
    "G0": straight, "G1": straight, "G2": arc, "G3": arc, "CIP": through, "CT": tangent, "ASPLINE": straight,
    "CSPLINE": straight,
}  # fmt: skip
