"""Shifts of program coordinates on top of the work offset: G52, G92 to G92.3. mm, degrees."""

from toolpath_stiff.nc.codes.code import Code, family, g_codes
from toolpath_stiff.nc.codes.motion import know_position
from toolpath_stiff.nc.codes.points import axis_words
from toolpath_stiff.nc.codes.polar import forget_polar
from toolpath_stiff.nc.codes.unsettled import refuse_while_rotated, zero_moved
from toolpath_stiff.nc.state import CurrentBlock, State


def shift(state: State, block: CurrentBlock, code: str) -> None:
    """G52: the shift; G92: the shift that gives the present point these numbers."""
    refuse_while_rotated(state, block, code, "shifts the zero")
    forget_polar(state)
    words, frames = axis_words(state, block), state.frames
    if not words:
        raise block.fail(code, "without axis words", "X, Y, Z, A, B or C")
    if code == "G92":
        know_position(state, block, block.codes[code], words)
        here = frames.to_program(frames.position)
        words = {axis: frames.g92[axis] + (here[axis] - value) for axis, value in words.items()}
    for axis, value in words.items():
        frames.g92[axis] = value
    frames.g92_kept = list(frames.g92)
    zero_moved(state)


def shift_state(state: State, block: CurrentBlock, code: str) -> None:
    """G92.1: no shift; G92.2: none for now; G92.3: the one before G92.2."""
    refuse_while_rotated(state, block, code, "shifts the zero")
    forget_polar(state)
    zero_moved(state)
    frames = state.frames
    frames.g92 = list(frames.g92_kept) if code == "G92.3" else [0.0] * 6
    if code == "G92.1":
        frames.g92_kept = [0.0] * 6


SHIFT_CODES = (
    Code("G52", "non-modal", shift, "local shift", g_codes("G52"), takes_axes=True),
    Code("G92", "non-modal", shift, "shift", g_codes("G92"), takes_axes=True),
    *family(
        {"G92.1": "no shift any more", "G92.2": "shift suspended"}, "non-modal", shift_state, g_codes("G92.1 G92.2")
    ),
    Code("G92.3", "non-modal", shift_state, "shift restored", g_codes("G92.3")),
)
