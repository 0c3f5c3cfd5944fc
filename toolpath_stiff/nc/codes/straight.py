"""Straight moves: G0, G1, in machine coordinates (G53), to reference points (G28, G30). mm, degrees."""

from __future__ import annotations

from toolpath_stiff.nc.blocks import POINT_WORDS, CurrentBlock
from toolpath_stiff.nc.codes.contract import MOTION, ONCE, Code, g_codes
from toolpath_stiff.nc.codes.moving import find_height, know_position, record
from toolpath_stiff.nc.codes.points import axis_words, cartesian, control_point, point_words
from toolpath_stiff.nc.codes.turning import XY, forget_polar, know_place, refuse_while_rotated
from toolpath_stiff.nc.moves import FEED, RAPID
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.words import Word


def straight(state: State, block: CurrentBlock, code: str) -> None:
    """G0, G1: straight to the point that the axis words name."""
    if any(block.has(letter) for letter in POINT_WORDS):
        words = point_words(state, block)
        target = control_point(state, block, state.frames.to_program(state.frames.position), words)
        record(state, block, RAPID if code == "G0" else FEED, target, words)
    elif MOTION in block.groups and code == "G1" and state.height_lost:  # rs274 moves then
        find_height(state, block, FEED, named=False)


def motion_off(state: State, block: CurrentBlock, code: str) -> None:
    """G80: no motion mode; axis words have none to move in."""
    state.motion = None


def machine_move(state: State, block: CurrentBlock, code: str) -> None:
    """G53: the axis words are machine coordinates, for this block only."""
    word = block.codes[code]
    if state.motion not in ("G0", "G1"):
        raise block.fail(word, f"with {state.motion}", "G0 or G1")
    if not state.absolute:
        raise block.fail(word, "in incremental mode (G91)", "G90")
    words = axis_words(state, block)
    frames = state.frames
    if any(axis > 2 for axis in words) and any(frames.origin[3:]):
        raise block.fail(word, "with rotary axes, while the work is turned", "X, Y, Z alone")
    if words:
        _leave_program_coordinates(state, block, word, words)
    point = frames.machine_position()
    for axis, value in words.items():
        point[axis] = value
    motion = RAPID if state.motion == "G0" else FEED
    record(state, block, motion, frames.control_of_machine(point), machine=words)


def go_home(state: State, block: CurrentBlock, code: str) -> None:
    """G28, G30: rapid to the intermediate point, then the axes named there, or all, to the reference point."""
    words = axis_words(state, block)
    frames = state.frames
    _leave_program_coordinates(state, block, block.codes[code], words)
    if words:
        between = cartesian(state, frames.to_program(frames.position), words)
        record(state, block, RAPID, frames.to_control(between), words)
    home = frames.offsets.home_g28 if code == "G28" else frames.offsets.home_g30
    if not any(home):
        state.assume(f"the reference point of {code}, not given by any offsets file, is machine 0, 0, 0")
    going = set(words) or set(range(6))
    # Axis by axis in program coordinates, as LinuxCNC does: with a rotation in force it is not the same.
    there = frames.to_program(frames.control_of_machine(list(home)))
    here = frames.to_program(frames.position)
    point = [there[axis] if axis in going else here[axis] for axis in range(6)]
    record(state, block, RAPID, frames.to_control(point), machine=going)


def set_home(state: State, block: CurrentBlock, code: str) -> None:
    """G28.1, G30.1: the present point is the reference point from here on."""
    know_position(state, block, block.codes[code], range(6))
    offsets = state.frames.offsets
    home = offsets.home_g28 if code == "G28.1" else offsets.home_g30
    home[:] = state.frames.machine_position()


def _leave_program_coordinates(state: State, block: CurrentBlock, word: Word, words: dict[int, float]) -> None:
    """A move of `words` (none: all axes) by machine coordinates: harmless under G68 only off the rotated plane."""
    if state.frames.tip_held:
        raise block.fail(word, "while tool centre point control is on (G43.4)", "G49 before it")
    if words and not words.keys() >= XY:
        know_place(state, block, word)
    if not words or XY & words.keys():
        refuse_while_rotated(state, block, word, "moves X and Y by machine coordinates")
        forget_polar(state)
        if not words or words.keys() >= XY:
            state.unsettled = None


_G28, _G30 = g_codes("G28 - G28.1"), g_codes("G30 - G30.1")
CODES = (
    Code("G0", MOTION, straight, "rapid", g_codes("G0"), many=True),
    Code("G1", MOTION, straight, "feed", g_codes("G1"), many=True),
    Code("G80", MOTION, motion_off, "motion mode off", g_codes("G80")),
    Code("G53", ONCE, machine_move, "machine coordinates", g_codes("G53"), step=MOTION),
    Code("G28", ONCE, go_home, "to the first reference point", _G28, takes_axes=True),
    Code("G30", ONCE, go_home, "to the second reference point", _G30, takes_axes=True),
    Code("G28.1", ONCE, set_home, "set the first reference point", _G28, label=ONCE),
    Code("G30.1", ONCE, set_home, "set the second reference point", _G30, label=ONCE),
)
