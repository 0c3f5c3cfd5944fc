"""M70 to M73: modes saved and restored, as LinuxCNC has them (manual, "M-Codes", M70 - M73)."""

from __future__ import annotations

from toolpath_stiff.nc.codes.code import Code, m_codes
from toolpath_stiff.nc.codes.offsets import take_offset
from toolpath_stiff.nc.codes.points import forget_polar
from toolpath_stiff.nc.state import CurrentBlock, SavedModes, State

OTHER_CONTROLS = "is an M code of the machine's builder on other controls"


def save_modes(state: State, block: CurrentBlock, code: str) -> None:
    """M70: save the modes at this level of calls; M73: the same, and restore them where the subprogram returns."""
    _check_block(state, block, code)
    state.saved[state.level] = SavedModes(
        state.inch, state.plane, state.absolute, state.arc_absolute, state.feed_mode, state.feed, state.speed,
        state.retract, state.frames.active, state.frames.tool, state.frames.tip_held, code == "M73",
    )  # fmt: skip


def forget_modes(state: State, block: CurrentBlock, code: str) -> None:
    """M71: what was saved at this level does not hold any more."""
    _check_block(state, block, code)
    state.saved.pop(state.level, None)


def restore_modes(state: State, block: CurrentBlock, code: str) -> None:
    """M72: the modes saved at this level hold again."""
    _check_block(state, block, code)
    saved = state.saved.get(state.level)
    if saved is None:
        raise block.fail(code, "and nothing was saved at this level of calls", "M70 or M73 before it")
    obstacle = _restore(state, saved)
    if obstacle:
        raise block.fail(code, f"where {obstacle}", "G40, G49, G69 and G15 before it")


def leave_level(state: State, level: int) -> str:
    """A subprogram of that level returns: after M73 its caller's modes hold again. What forbids that; "" if nothing."""
    saved = state.saved.pop(level, None)
    return _restore(state, saved) if saved is not None and saved.at_return else ""


def _restore(state: State, saved: SavedModes) -> str:
    frames = state.frames
    if frames.tool != saved.tool or frames.tip_held != saved.tip_held:
        return "the tool length in force is another one than where the modes were saved"
    if frames.tool and state.inch != saved.inch:
        return "the unit would change while a tool length is in force"
    if state.cutter is not None or frames.rotation is not None or state.polar is not None:
        return "cutter compensation, G68 or G16 is in force"
    state.inch, state.absolute, state.arc_absolute = saved.inch, saved.absolute, saved.arc_absolute
    state.speed, state.retract, state.feed_mode = saved.speed, saved.retract, saved.feed_mode
    state.feed = None if saved.feed_mode == "G93" else saved.feed
    if state.plane != saved.plane:
        state.plane = saved.plane
        forget_polar(state)
    take_offset(state, saved.offset)
    return ""


def _check_block(state: State, block: CurrentBlock, code: str) -> None:
    word = block.codes[code]
    if state.dialect.name != "linuxcnc":
        raise block.fail(word, OTHER_CONTROLS, hint="name the control with --dialect linuxcnc if it saves modal state")
    if len(block.codes) > 1 or block.values:
        raise block.fail(word, "beside other words", "a block of its own")


_SAVED = m_codes("M70 - M73")


SAVED_CODES = (
    Code("M70", "M modal state", save_modes, "modes saved", _SAVED, ("linuxcnc",)),
    Code("M71", "M modal state", forget_modes, "saved modes forgotten", _SAVED, ("linuxcnc",)),
    Code("M72", "M modal state", restore_modes, "saved modes restored", _SAVED, ("linuxcnc",)),
    Code("M73", "M modal state", save_modes, "modes saved, restored at the return", _SAVED, ("linuxcnc",)),
)
