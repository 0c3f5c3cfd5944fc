"""Rotated coordinates: G68, G69.

They follow Fanuc's milling controls (operator's manuals of the series 16 and 15i, "Coordinate system rotation"). Where
these manuals leave the point to parameters or forbid the block, it is refused. mm and degrees.
"""

import math

from toolpath_stiff.nc.codes.code import FANUC, Code
from toolpath_stiff.nc.codes.polar import SAME_PLACE_MM
from toolpath_stiff.nc.frames import Rotation
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import Word


def rotation(state: State, block: CurrentBlock, code: str) -> None:
    """G68 X Y R: programmed points turn about X, Y (absolute; without them about the present point). G69: rotation off.

    On Fanuc's controls incremental words between G68 and the first absolute ones turn about the tool's place at
    G68: from there on they are turned steps, as they are here.
    """
    frames = state.frames
    here = frames.to_program(frames.position)
    new = None if code == "G69" else _rotation_of(state, block, block.codes[code], here)
    if new is not None and frames.rotation is not None and frames.rotation[:2] != new[:2]:
        raise block.fail(code, "with another centre while a rotation is in force", "G69 before it")
    frames.rotation = new
    there = frames.to_program(frames.position)
    if math.dist(here[:2], there[:2]) > SAME_PLACE_MM:
        state.unsettled = code


def _rotation_of(state: State, block: CurrentBlock, word: Word, here: list[float]) -> Rotation:
    if state.plane != "G17" or any(block.has(letter) for letter in "ZIJK"):
        problem = f"in the plane {state.plane}, or in space (Z, I, J, K), which is not supported"
        raise block.fail(word, problem, "G68 X Y R in G17")
    angle = block.take("R")
    if angle is None:
        raise block.fail(word, "without its angle, which is then a parameter of the control", "R in degrees")
    present = state.frames.rotation
    if not state.absolute and present is not None:
        problem = "in incremental mode (G91) under a rotation: a parameter of the control says whether R adds"
        raise block.fail(word, problem, "G90, or G69 before it")
    x, y = block.take("X"), block.take("Y")
    if present is not None and x is None and y is None:
        return (present[0], present[1], angle)
    return (
        here[0] if x is None else x * state.length_scale,
        here[1] if y is None else y * state.length_scale,
        angle,
    )


_ROTATION = f"{FANUC} of the series 16 and 15i, Coordinate system rotation (G68, G69)"
ROTATION_CODES = (
    Code("G68", "rotation", rotation, "rotated coordinates", _ROTATION, takes_axes=True),
    Code("G69", "rotation", rotation, "rotation off", _ROTATION),
)
