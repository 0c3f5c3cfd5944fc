"""M70 to M73: modes saved and restored, as LinuxCNC has them (manual, "M-Codes", M70 - M73)."""

from toolpath_stiff.nc.codes.code import family, m_codes
from toolpath_stiff.nc.codes.polar import forget_polar
from toolpath_stiff.nc.codes.work_offsets import take_offset
from toolpath_stiff.nc.state import CurrentBlock, SavedModes, State

OTHER_CONTROLS = "is an M code of the machine's builder on other controls"
MODES = ("inch", "absolute", "arc_absolute", "speed", "retract", "feed_mode")


def saved_modes(state: State, block: CurrentBlock, code: str) -> None:
    """M70: save the modes at this level of calls; M73: until its return; M71: forget them, M72: restore them."""
    word, frames = block.codes[code], state.frames
    if state.dialect.name != "linuxcnc":
        raise block.fail(word, OTHER_CONTROLS, hint="name the control with --dialect linuxcnc if it saves modal state")
    if len(block.codes) > 1 or block.values:
        raise block.fail(word, "beside other words", "a block of its own")
    if code == "M71":
        state.saved.pop(state.level, None)
    elif code == "M72":
        saved = state.saved.get(state.level)
        obstacle = "nothing was saved at this level of calls" if saved is None else _restore(state, saved)
        if obstacle:
            raise block.fail(code, f"where {obstacle}", "M70 or M73 before it, and G40, G49, G69 and G15")
    else:
        modes = {name: getattr(state, name) for name in MODES}
        state.saved[state.level] = SavedModes(
            modes, state.plane, state.feed, frames.active, (frames.tool, frames.tip_held), code == "M73"
        )


def leave_level(state: State, level: int) -> str:
    """A subprogram of that level returns: after M73 its caller's modes hold again. What forbids that; "" if nothing."""
    saved = state.saved.pop(level, None)
    return _restore(state, saved) if saved is not None and saved.at_return else ""


def _restore(state: State, saved: SavedModes) -> str:
    frames = state.frames
    other_unit = frames.tool != 0.0 and state.inch != saved.modes["inch"]
    if (frames.tool, frames.tip_held) != saved.tool or other_unit:
        return "the tool length in force, or its unit, is another one than where the modes were saved"
    if state.cutter is not None or frames.rotation is not None or state.polar is not None:
        return "cutter compensation, G68 or G16 is in force"
    for name, value in saved.modes.items():
        setattr(state, name, value)
    state.feed = None if state.feed_mode == "G93" else saved.feed
    if state.plane != saved.plane:
        state.plane = saved.plane
        forget_polar(state)
    take_offset(state, saved.offset)
    return ""


_MEANINGS = {
    "M70": "modes saved", "M71": "saved modes forgotten", "M72": "saved modes restored",
    "M73": "modes saved, restored at the return",
}  # fmt: skip
SAVED_CODES = family(_MEANINGS, "M modal state", saved_modes, m_codes("M70 - M73"), ("linuxcnc",))
