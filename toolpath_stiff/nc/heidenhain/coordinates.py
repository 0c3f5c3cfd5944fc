"""Coordinates of the plain language: cycles 7, 8, 10, 11, 19 and 247, PLANE, M128 and FUNCTION TCPM.

HEIDENHAIN, user's manual "Cycles" of the iTNC 530, "Coordinate transformation cycles"; user's manual of the iTNC 530,
"The PLANE function". Whatever is in force becomes the frames' linear part and shift: first cycle 7, then the tilting,
cycle 7 in the tilted plane, then mirror image or rotation, and the scale. Where the order of programming is another
one, moves are refused. mm, degrees.
"""

from toolpath_stiff.nc.codes import tools
from toolpath_stiff.nc.contouring.tilting import put, turn_tool
from toolpath_stiff.nc.frames import UNIT, product, rotation_matrix
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES

HOW_AXES_TURN = (
    "STAY", "MOVE", "TURN", "F", "FMAX", "SEQ+", "SEQ-", "SYM+", "SYM-", "DIST", "ABST", "MB", "MBMAX", "TABLEROT",
    "COORDROT",
)  # fmt: skip
SPATIAL = "the angles of cycle 19 are spatial angles, not positions of the machine's axes"


def apply(state: State, block: CurrentBlock) -> None:
    """Put the transformations in force into the frames."""
    plain = state.plain
    inner = [[plain.scale * v for v in row] for row in UNIT]
    if plain.angle:
        turn = [0.0, 0.0, 0.0]
        turn[PLANES[state.plane][2]] = plain.angle
        inner = product(rotation_matrix(turn), inner)
    for axis in plain.mirrored:
        inner[axis] = [-v for v in inner[axis]]
    put(state, block, inner)
    settled = not plain.angle and not plain.mirrored and plain.scale == 1.0 and plain.tilt is None
    plain.doubt = "" if settled else plain.doubt


def shift(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL DEF 7.1 and on, TRANS DATUM: the datum, absolute or by a step; in a tilted plane along its axes."""
    plain = state.plain
    values, outer = list(plain.shift), list(plain.outer)
    if block.has("TABLE"):
        datum(state, block, code)
    for axis, letter in enumerate(AXES[:3]):
        value, step = 0.0 if code == "TRANS DATUM RESET" else block.take(letter), block.take(f"I{letter}")
        if value is not None:
            values[axis], outer[axis] = value * state.length_scale, outer[axis] if value else 0.0
        if step is not None:
            values[axis] += step * state.length_scale
    turned = next((letter for letter in "ABC" if block.take(letter)), None)
    block.refuse_if(turned, turned, "shifts a rotary axis", "X, Y, Z")
    above = plain.tilt is not None and any(plain.outer)
    block.refuse_if(above and any(values), None, "shifts a datum shifted before the tilting", "PLANE RESET first")
    if above or (values != plain.shift and (plain.angle or plain.mirrored or plain.scale != 1.0)):
        plain.doubt = (
            f"after {code} in a tilted plane, or under cycle 8, 10 or 11: the order decides where the datum is"
        )
    plain.shift, plain.outer = values, outer if above else plain.outer
    apply(state, block)


def mirror(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL DEF 8.1 X Y: axes that are mirrored; without any none is."""
    named_axes = frozenset(axis for axis, letter in enumerate(AXES[:3]) if block.take(f"{letter}!") is not None)
    state.plain.mirrored = named_axes
    apply(state, block)


def rotation(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL DEF 10.1 ROT: about the datum in the plane, absolute or by a step."""
    value, step = block.take("ROT"), block.take("IROT")
    block.refuse_if(value is None and step is None, None, "without its angle", "ROT+30")
    state.plain.angle = value if value is not None else state.plain.angle + (step or 0.0)
    apply(state, block)


def scale(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL DEF 11.1 SCL: about the datum, in all three axes."""
    factor = block.take("SCL")
    if factor is None or not 1e-6 <= factor <= 100.0:
        raise block.fail("SCL" if factor is not None else None, "without a factor", "SCL 0.95")
    state.plain.scale = factor
    apply(state, block)
    state.assume("cycle 11 scales the tool axis too (machine parameter 7410)")


def tilt(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL DEF 19.1, PLANE SPATIAL: the plane by spatial angles; the tool stands upright on it. PLANE RESET: none."""
    plain, frames = state.plain, state.frames
    letters = ("SPA", "SPB", "SPC") if code == "PLANE SPATIAL" else AXES[3:]
    angles = [block.take(letter) for letter in letters]
    for word in HOW_AXES_TURN:
        block.take(word)
    block.refuse_if(code == "PLANE SPATIAL" and None in angles, None, "without SPA, SPB and SPC", "all three")
    a, b, c = (angle or 0.0 for angle in angles)
    leans = (a, b, c) != (0.0, 0.0, 0.0)
    if not leans and plain.tilt is None:
        return
    by_axes = code == "PLANE AXIAL"
    block.refuse_if(by_axes, None, "by angles of the machine's axes, which are not known here", "PLANE SPATIAL")
    block.refuse_if(state.plane != "G17", None, f"with the tool in {state.plane}", "the tool axis Z")
    block.refuse_if(frames.posted, None, "beside [kinematics]: it gives the tool's axis itself", "no --controller")
    inner = plain.angle or plain.mirrored or plain.scale != 1.0 or (plain.tilt is not None and any(plain.shift))
    block.refuse_if(inner, None, "while cycle 7, 8, 10 or 11 is in force in the plane", "their reset before it")
    if code != "PLANE SPATIAL" and leans:
        state.assume(SPATIAL)
    if plain.tilt is None:
        plain.outer, plain.shift = plain.shift, [0.0] * 3
    plain.tilt = rotation_matrix((a, b, c)) if leans else None
    if not leans:
        plain.outer, plain.shift = [0.0] * 3, plain.outer
    apply(state, block)
    turn_tool(state, block)


def datum(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL DEF 247 and 7.1 #: the datum of a table; the program's first is its zero."""
    number, plain = block.take("TABLE" if block.has("TABLE") else "Q339"), state.plain
    other = plain.preset not in (None, number) or (plain.preset is None and state.recorder.cuts)
    problem = "another datum than before: where it is stands in a table of the control"
    block.refuse_if(
        other or any(plain.shift) or plain.tilt is not None, None, problem, "one datum, and cycle 7 for others"
    )
    plain.preset = number
    state.assume("the datum of the control's table that the program calls (cycle 247, 7.1 #) is program zero (G54)")


def hold_tip(state: State, block: CurrentBlock, code: str) -> None:
    """M128, FUNCTION TCPM: X, Y, Z are the tip's while rotary axes turn; M129, FUNCTION RESET TCPM: no longer."""
    plain, on = state.plain, code in ("M128", "FUNCTION TCPM")
    if code[0] == "F":
        block.free.clear()
    elif block.block.words[0].text == "M":  # M128 F1000: the feed of the axes that follow
        block.take("F"), block.take("FMAX")
    tools.hold_tip(state, block, code, on)
    plain.held_tip = on
