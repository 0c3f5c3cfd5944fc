"""G33, G33.1: moves whose feed the spindle's turns give, as LinuxCNC has them (manual, "G-Codes", G33, G33.1). mm."""

from toolpath_stiff.nc.codes.code import Code, g_codes
from toolpath_stiff.nc.codes.feeds import SLOWEST
from toolpath_stiff.nc.codes.motion import record
from toolpath_stiff.nc.codes.points import control_point, point_words
from toolpath_stiff.nc.moves import CYCLE, FEED
from toolpath_stiff.nc.state import POINT_WORDS, CurrentBlock, State

ROTARY = (3, 4, 5)


def synchronised(state: State, block: CurrentBlock, code: str) -> None:
    """G33: straight, K mm a turn of the spindle; G33.1: so to the point, and back with the spindle reversed."""
    if not ("motion" in block.groups or any(block.has(letter) for letter in (*POINT_WORDS, "K"))):
        return
    first = block.block.words[0]
    if state.dialect.name != "linuxcnc":
        raise block.fail(
            first,
            f"is under {code}, spindle-synchronised motion, whose words differ from control to control",
            hint="leave threading and rigid tapping out, or name the control with --dialect linuxcnc",
        )
    pitch = block.take("K") or 0.0
    words = point_words(state, block)
    feed = abs(pitch) * state.length_scale * state.speed
    if not words or feed < SLOWEST or any(axis in words for axis in ROTARY):
        problem = f"under {code} without point or pitch (K{pitch:g}), or with the spindle at S{state.speed:g}"
        raise block.fail(first, problem, "a point in X, Y, Z, and K and S above 0")
    frames = state.frames
    here = list(frames.position)
    target = control_point(state, block, frames.to_program(here), words)
    mode, kept, state.feed_mode, state.feed = state.feed_mode, state.feed, "G94", feed
    record(state, block, FEED if code == "G33" else CYCLE, target, words)
    if code == "G33.1":
        record(state, block, CYCLE, here, words)
    state.feed_mode, state.feed = mode, kept


SYNCHRONISED_CODES = (
    Code("G33", "motion", synchronised, "straight, K a turn of the spindle", g_codes("G33"), ("linuxcnc",)),
    Code("G33.1", "motion", synchronised, "rigid tapping, in and out", g_codes("G33.1"), ("linuxcnc",)),
)
