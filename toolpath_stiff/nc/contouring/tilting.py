"""Tilted planes, and the tool's axis: upright on a plane, or led by vectors (LN; Siemens: A3, B3, C3). mm, degrees.

HEIDENHAIN, user's manual of the iTNC 530, "The PLANE function", "Three-dimensional compensation"; SIEMENS, SINUMERIK
840D sl, Programming Manual Job Planning, "Transformations".
"""

import math

from toolpath_stiff.nc.codes.motion import record
from toolpath_stiff.nc.contouring.contour import compensate, go
from toolpath_stiff.nc.contouring.points import feed, named, outside_contour, present
from toolpath_stiff.nc.frames import UNIT, Matrix, product, rotate
from toolpath_stiff.nc.geometry import Vector, roll_pitch_of_axis
from toolpath_stiff.nc.moves import RAPID
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tool_axes import angles_near, division, on_great_circle, unit_axis

TIP_TURNS = (
    "PLANE, cycle 19 and CYCLE800 turn the tool about its tip where it stands: how the machine's axes turn is not known"
)


def put(state: State, block: CurrentBlock, inner: Matrix) -> None:
    """Put a rotation, mirror image and scale, the tilting and the shifts in force; the tool does not move."""
    plain, frames = state.plain, state.frames
    outside_contour(state, block, "changes coordinates", state.beside is not None or plain.side)
    whole, shift = inner, plain.shift
    if plain.tilt is not None:
        whole, shift = product(plain.tilt, inner), rotate(plain.tilt, plain.shift)
    frames.linear = None if whole == UNIT else whole
    frames.g92 = [*(a + b for a, b in zip(plain.outer, shift, strict=True)), 0.0, 0.0, 0.0]
    plain.pole = plain.heading = None


def turn_tool(state: State, block: CurrentBlock) -> None:
    """Turn the tool upright on the tilted plane, after which the position of its tip is unknown."""
    plain = state.plain
    axis = [row[2] for row in plain.tilt] if plain.tilt is not None else [0.0, 0.0, 1.0]
    state.assume(TIP_TURNS)
    record(state, block, RAPID, [*state.frames.position[:3], *roll_pitch_of_axis(*axis), 0.0], (3, 4, 5))
    plain.unknown |= {0, 1, 2}


def vectors(state: State, block: CurrentBlock, code: str) -> None:
    """LN: straight to a point, with the tool's axis TX TY TZ; normals alone change nothing without compensation."""
    there, rapid = named(state, block), feed(state, block)
    normal, axis = ([block.take(f"{kind}{letter}") for letter in "XYZ"] for kind in "NT")
    block.refuse_if(block.has("RL") or block.has("RR"), None, "LN with compensation by the radius", "R0")
    compensate(state, block, there)
    if all(component is None for component in axis):
        turned = state.plain.held_tip and normal != [None] * 3 and state.frames.posted is None
        block.refuse_if(turned, None, "LN with normals under M128, where the tool may follow them", "TX, TY, TZ")
        go(state, block, there, rapid=rapid)
        return
    other = state.frames.posted is not None or state.plain.tilt is not None or there.keys() & {3, 4, 5} or None in axis
    block.refuse_if(other, None, "LN with A, B, C, in a tilted plane, or beside [kinematics]", "TX, TY and TZ alone")
    target = unit_axis([component or 0.0 for component in axis])
    start, here = _axis(state), present(state)
    parts = division(start, target)
    held, state.plain.held_tip = state.plain.held_tip, False  # the vectors themselves state what M128 would hold
    for part in range(1, parts + 1):
        share = part / parts
        at_part = {i: here[i] + share * (there[i] - here[i]) for i in there} if part < parts else dict(there)
        leaning = target if part == parts else on_great_circle(start, target, share)
        roll, pitch = angles_near(leaning, (state.frames.position[3], state.frames.position[4]))
        go(state, block, at_part | {3: roll, 4: pitch, 5: 0.0}, rapid=rapid)
    state.plain.held_tip, state.plain.led_to = held, state.frames.position[3:]


def _axis(state: State) -> Vector:
    """Axis of the tool, from roll and pitch."""
    roll, pitch = (math.radians(v) for v in state.frames.position[3:5])
    return (math.sin(pitch) * math.cos(roll), -math.sin(roll), math.cos(pitch) * math.cos(roll))
