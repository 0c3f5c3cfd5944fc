"""G68 and G69: the rotated coordinate system; and what hangs on numbers of X and Y that turned.

The rotation follows Fanuc's milling controls (operator's manuals of the series 16 and 15i, "Coordinate system
rotation"); LinuxCNC has no such code. Where these manuals leave the point to parameters or forbid the block, it is
refused.
"""

from __future__ import annotations

import math

from toolpath_stiff.nc.blocks import CurrentBlock
from toolpath_stiff.nc.codes.contract import ROTATION, Code
from toolpath_stiff.nc.frames import Rotation
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.words import AXES, Word

SAME_PLACE_MM = 1e-9
XY = frozenset((0, 1))


def rotation(state: State, block: CurrentBlock, code: str) -> None:
    """G68 X Y R: programmed points turn about X, Y (absolute; without them about the present point). G69: no more.

    On Fanuc's controls incremental words between G68 and the first absolute ones turn about the tool's place at
    G68: from there on they are turned steps, as they are here.
    """
    frames = state.frames
    here = frames.to_program(frames.position)
    if code == "G69":
        frames.rotation = None
    else:
        new = _rotation_of(state, block, block.codes[code], here)
        if frames.rotation is not None and frames.rotation[:2] != new[:2]:
            raise block.fail(block.codes[code], "with another centre while a rotation is in force", "G69 before it")
        frames.rotation = new
    there = frames.to_program(frames.position)
    if math.dist(here[:2], there[:2]) > SAME_PLACE_MM:
        state.unsettled = code


def _rotation_of(state: State, block: CurrentBlock, word: Word, here: list[float]) -> Rotation:
    if state.plane != "G17":
        raise block.fail(word, f"in the plane {state.plane}, which is not supported", "G17")
    solid = next((block.values[letter] for letter in "ZIJK" if block.has(letter)), None)
    if solid is not None:
        raise block.fail(solid, "makes G68 a rotation in space, which is not supported", "G68 X Y R in G17")
    angle = block.take("R")
    if angle is None:
        raise block.fail(word, "without its angle, which is then a parameter of the control", "R in degrees")
    present = state.frames.rotation
    if not state.absolute and present is not None:
        raise block.fail(
            word,
            "in incremental mode (G91) under a rotation: a parameter of the control says whether R adds",
            "G90, or G69 before it",
        )
    x, y = block.take("X"), block.take("Y")
    if present is not None:
        here = [*present[:2], *here[2:]] if x is None and y is None else here
    return (
        here[0] if x is None else x * state.length_scale,
        here[1] if y is None else y * state.length_scale,
        angle,
    )


def refuse_while_rotated(state: State, block: CurrentBlock, word: Word, what: str) -> None:
    """Refuse what Fanuc's controls forbid between G68 and G69."""
    if state.frames.rotation is not None:
        raise block.fail(word, f"{what} while the coordinate system is rotated (G68)", "G69 before it")


def forget_polar(state: State) -> None:
    """The tool went, or the zero moved, otherwise than by polar words: the next ones must name both."""
    if state.polar is not None:
        state.polar = [math.nan, math.nan]


def zero_moved(state: State) -> None:
    """Note that the zero of turned coordinates moved: LinuxCNC's rs274 forgets that at the next M6."""
    if state.frames.offsets.at(state.frames.active).rotation:
        state.rotation_changed = True


def know_place(state: State, block: CurrentBlock, word: Word) -> None:
    """Refuse what hangs on the present X and Y, after a G10 that turned the offset in force."""
    if state.unsettled == "G10":
        raise block.fail(
            word,
            "hangs on the present X and Y after G10, or another work offset and M6, turned the coordinates: "
            "LinuxCNC's interpreter may have other ones",
            "a move with both X and Y before it",
        )


def settle(state: State, block: CurrentBlock, words: dict[int, float]) -> None:
    """Refuse what a control may take for another point: X and Y had other numbers before the rotation changed."""
    named = XY & words.keys()
    if state.unsettled == "G10" and not (state.absolute and named == XY):
        raise block.fail(
            None,
            "G10, or another work offset and M6, turned the coordinates, and the next move does not name both X "
            "and Y: LinuxCNC would take the old numbers for them",
            "absolute X and Y in the first move after it",
        )
    if not named:
        return
    word = block.values[AXES[min(named)]]
    if state.absolute and named == XY:
        state.unsettled = None
    elif state.absolute:
        raise block.fail(word, f"alone in the first move after {state.unsettled}", "both X and Y")
    elif state.unsettled == "G69":
        raise block.fail(word, "is incremental in the first move after G69", "absolute X and Y (G90)")


_FANUC = "Fanuc, operator's manuals of the series 16 and 15i, Coordinate system rotation (G68, G69)"
CODES = (
    Code("G68", ROTATION, rotation, "rotated coordinates", _FANUC, takes_axes=True),
    Code("G69", ROTATION, rotation, "rotation off", _FANUC),
)
