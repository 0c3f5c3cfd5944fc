"""Coordinates of Siemens' language: frames, settable offsets, swivelling (CYCLE800), TRAORI, poles, units.

SIEMENS, SINUMERIK 840D sl, Programming Manual Fundamentals, "Coordinate transformations (frames)", "Geometry settings";
Job Planning, "Transformations"; Operating Manual Milling, "Swivel". A point goes through the programmable frame, the
swivelled one, then the settable offset. mm, degrees.
"""

from collections.abc import Mapping

from toolpath_stiff.nc.codes import coordinates as settable
from toolpath_stiff.nc.codes import tools
from toolpath_stiff.nc.contouring.points import outside_contour, present
from toolpath_stiff.nc.contouring.tilting import put, turn_tool
from toolpath_stiff.nc.frames import UNIT, product, rotation_matrix
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import WORK_OFFSETS, WorkOffset
from toolpath_stiff.nc.words import AXES

BASE_IS_ZERO = "G500 (no settable offset) is program zero: the program takes no other one"
MODES = ("motion", "plane", "absolute", "inch", "feed_mode")  # of SAVE
FIRST_ADDITIONAL, LAST_OF_FOUR = 505, 4
G70_INCH = "under G70 F counts inches a minute too, as on a control whose basic system is inch"


def apply(state: State, block: CurrentBlock) -> None:
    """Put the programmable and the swivelled frame into force."""
    plain = state.plain
    put(state, block, plain.inner)
    (a, b, c), (d, e, f), (g, h, i) = plain.inner
    volume = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    plain.scale, plain.mirrored = abs(volume) ** (1.0 / 3.0), frozenset({0} if volume < 0.0 else ())


def frame(state: State, block: CurrentBlock, code: str) -> None:
    """TRANS, ROT, SCALE, MIRROR: a new programmable frame; with A before it: added to the present one, in its axes."""
    plain, kind, scale = state.plain, code.removeprefix("A"), state.length_scale
    if kind == code:
        plain.shift, plain.inner = [0.0] * 3, [list(row) for row in UNIT]
    words = [block.take(letter) for letter in AXES[:3]]
    values = [word or 0.0 for word in words]
    if kind == "TRANS":
        moved = product(plain.inner, [[v * scale] for v in values])
        plain.shift = [s + row[0] for s, row in zip(plain.shift, moved, strict=True)]
    elif kind == "ROT":
        angle = block.take("RPL")
        block.refuse_if(angle is not None and any(values), "RPL", "beside angles about axes", "one of them")
        values[PLANES[state.plane][2]] += angle or 0.0
        plain.inner = product(plain.inner, rotation_matrix(values))  # Z first, then about the new Y and X (RPY angles)
    elif kind == "SCALE":
        factors = [1.0 if word is None else word for word in words]
        uneven = len(set(factors)) > 1 or factors[0] <= 0.0
        block.refuse_if(uneven, None, f"{code} by factors that differ", "one factor above 0 for X, Y and Z")
        plain.inner = [[v * factors[0] for v in row] for row in plain.inner]
    else:
        signs = [1.0 if word is None else -1.0 for word in words]
        plain.inner = [[v * sign for v, sign in zip(row, signs, strict=True)] for row in plain.inner]
    apply(state, block)


def offset(state: State, block: CurrentBlock, code: str) -> None:
    """G54 to G57, and G505 to G599 for the fifth and further settable offsets; G500: none."""
    plain, frames = state.plain, state.frames
    outside_contour(state, block, code)
    if code == "G500":
        plain.base = "machine" if plain.offsets_named else "zero"
        if not plain.offsets_named:
            state.assume(BASE_IS_ZERO)
        return
    plain.base = ""
    if int(code[1:]) >= FIRST_ADDITIONAL:
        number = int(code[1:]) - FIRST_ADDITIONAL + 1 + LAST_OF_FOUR
        if number not in frames.offsets.additional:
            state.warnings.append(Remark(f"{code} is an offset that nothing defines: taken as 0", block.line))
        frames.offsets.additional.setdefault(number, WorkOffset())
        frames.active = len(WORK_OFFSETS) + number - 1
    else:
        settable.work_offset(state, block, code)
    frames.g92 = list(frames.g92)  # the coordinates of the present point change


def modes_of(state: State) -> dict[str, object]:
    """Modes and frames in force, which the end of a subprogram with SAVE brings back."""
    plain, frames = state.plain, state.frames
    return {name: getattr(state, name) for name in MODES} | {"": (plain.inner, plain.base, frames.g92, frames.active)}


def bring_back(state: State, kept: Mapping[str, object]) -> bool:
    """Put modes that were kept into force again; False if the frames have changed."""
    for name in MODES:
        setattr(state, name, kept[name])
    return kept[""] == modes_of(state)[""]


def set_offset(state: State, block: CurrentBlock, code: str) -> None:
    """$P_UIFR: the shift of a settable offset, all of it or (TR) of one axis; it acts from the next G54 to G599 on."""
    number, frames = int(block.codes[code].value), state.frames
    block.refuse_if(not 1 <= number <= 99, code, "is no settable offset", "1 to 99")
    index = number - 1 + (len(WORK_OFFSETS) if number > LAST_OF_FOUR else 0)
    waits = len(state.recorder) and index == frames.active and not state.plain.base
    block.refuse_if(waits, code, "writes the offset in force, which acts from its next call on", "it before G54")
    offset = frames.offsets.additional.setdefault(number, WorkOffset()) if index >= number else frames.offsets.at(index)
    block.take("FRAME")
    kept = offset.axes if block.take("TR") is not None else [0.0] * 6
    scales, given = [state.length_scale] * 3 + [1.0] * 3, [block.take(letter) for letter in AXES]
    offset.axes[:] = [k if g is None else g * scale for k, g, scale in zip(kept, given, scales, strict=True)]
    offset.given = True


def swivel(state: State, block: CurrentBlock, code: str) -> None:
    """CYCLE800: tilt the plane by angles about its axes, tool perpendicular to it; without angles: reset."""
    plain = state.plain
    block.take("FR"), block.take("TC"), block.take("FRI"), block.take("DMODE")
    kind, mode = int(block.take("ST") or 0), int(block.take("MODE") or 0)
    points = [[(block.take(f"{axis}{end}") or 0.0) * state.length_scale for axis in "XYZ"] for end in "01"]
    angles, direction = [block.take(letter) or 0.0 for letter in "ABC"], block.take("DIR")
    turned = [list(row) for row in UNIT]
    block.refuse_if(any(angles) and mode >= 64, "MODE", "gives no angles about axes one by one", "57, 27 or 39")
    for place, angle in enumerate(angles):
        axis = (mode >> 2 * place & 3) - 1
        block.refuse_if(angle and axis < 0, "MODE", "names no axis for each angle", "57, 27 or 39")
        about = [angle if axis == number else 0.0 for number in range(3)]
        turned = product(turned, rotation_matrix((about[0], about[1], about[2])))
    added = kind % 10 == 1 and plain.tilt is not None
    framed = any(plain.shift) or plain.inner != UNIT
    block.refuse_if(added and framed, "ST", "adds to a plane under a frame (TRANS, ROT)", "TRANS before it")
    before, outer = (plain.tilt or UNIT, plain.outer) if added else (UNIT, [0.0] * 3)
    for matrix, point in ((before, points[0]), (product(before, turned), points[1])):
        outer = [o + row[0] for o, row in zip(outer, product(matrix, [[v] for v in point]), strict=True)]
    leans = any(angles) or added
    block.refuse_if(state.frames.posted is not None and leans, None, "beside [kinematics]", "no --controller")
    block.refuse_if(leans and direction == 0.0, "DIR", "leaves the machine's axes where they are", "-1 or 1")
    was, plain.outer = plain.tilt is not None, outer
    plain.tilt = product(before, turned) if leans else None
    if not added:
        plain.shift, plain.inner = [0.0] * 3, [list(row) for row in UNIT]
    apply(state, block)
    if was or leans:
        turn_tool(state, block)


def transformation(state: State, block: CurrentBlock, code: str) -> None:
    """TRAORI: X, Y, Z are the tip's while the tool turns; TRAFOOF: off."""
    tools.hold_tip(state, block, code, code == "TRAORI")
    state.plain.transformed = code == "TRAORI"


def pole(state: State, block: CurrentBlock, code: str) -> None:
    """G110, G111, G112: the pole, relative to the present point, to zero, to the last pole."""
    first, second, _ = PLANES[state.plane]
    here, last = present(state), state.plain.pole[1] if state.plain.pole else 0j
    base = {"G110": complex(here[first], here[second]), "G111": 0j, "G112": last}[code]
    x, y = ((block.take(AXES[axis]) or 0.0) * state.length_scale for axis in (first, second))
    state.plain.pole = state.plane, base + complex(x, y)


def units(state: State, block: CurrentBlock, code: str) -> None:
    """G70, G700: inch; G71, G710: mm."""
    state.inch = code in ("G70", "G700")
    if code == "G70":
        state.assume(G70_INCH)
