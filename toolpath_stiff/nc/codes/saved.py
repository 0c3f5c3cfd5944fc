"""M70 to M73: save and restore modes, as LinuxCNC does ("M-Codes", "M70 - M73"); motion mode and tool stay."""

from copy import copy

from toolpath_stiff.nc.codes.code import family, m_codes
from toolpath_stiff.nc.codes.coordinates import take_offset
from toolpath_stiff.nc.state import CurrentBlock, State

MODES = (
    "inch", "plane", "absolute", "arc_absolute", "feed_mode", "speed", "turn", "surface_speed", "retract",
)  # fmt: skip


def save(state: State, block: CurrentBlock, code: str) -> None:
    """M70: the modes are kept for M72 of this call, by M73 for its end too; M71: they are kept no longer."""
    _alone(block, code)
    state.saved[-1] = None if code == "M71" else (code, copy(state), state.frames.active, state.frames.tool)


def restore_block(state: State, block: CurrentBlock, code: str) -> None:
    """M72: the modes that this call has saved."""
    _alone(block, code)
    restore(state, block)


def restore(state: State, block: CurrentBlock) -> None:
    """Bring back the modes saved last; F to a tenth, as LinuxCNC does."""
    saved, feed = state.saved[-1], state.feed
    if saved is None:
        raise block.fail(None, "restores modes, and none are saved", "M70 before it")
    _, modes, active, length = saved
    other = state.cutter or state.polar or length != state.frames.tool
    block.refuse_if(other, None, "restores modes after G43, G49, G41 or G16", "the same tool length as at M70")
    for name in MODES:
        setattr(state, name, getattr(modes, name))
    if modes.feed != feed:
        state.feed = None if modes.feed is None else float(f"{modes.feed / state.feed_scale:.1f}") * state.feed_scale
    take_offset(state, block, block.block.words[0], active)


def leave_call(state: State, block: CurrentBlock) -> None:
    """The end of a subprogram: what M73 saved in it comes back."""
    saved = state.saved[-1]
    if saved is not None and saved[0] == "M73":
        restore(state, block)
    state.saved.pop()


def _alone(block: CurrentBlock, code: str) -> None:
    block.refuse_if(len(block.groups) > 1 or block.values, code, "beside other words", "a block of its own")


_MEANINGS = {
    "M70": "modes saved", "M71": "saved modes forgotten", "M73": "modes saved, restored at the end of the call",
}  # fmt: skip
_SOURCE, _CONTROLS = m_codes("M70 - M73"), ("generic", "linuxcnc")
SAVED_CODES = (
    *family(_MEANINGS, "M saved modes", save, _SOURCE, _CONTROLS),
    *family({"M72": "modes restored"}, "M saved modes", restore_block, _SOURCE, _CONTROLS),
)
