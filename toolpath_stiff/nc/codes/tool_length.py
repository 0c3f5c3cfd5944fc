"""The tool's length and tool centre point control: G43, G43.1, G43.4, G49. mm, degrees inside."""

import math

from toolpath_stiff.nc.codes.code import HAAS, Alias, Code, g_codes
from toolpath_stiff.nc.posted import switched
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import tool_of, tool_table_hint

HOLDS_TIP = "G43.4"  # tool centre point control
HOLDS_HINT = (
    "post X, Y, Z, A, B, C of the tip, or name the machine it is posted for ([kinematics] of a controller file)"
)


def tool_length(state: State, block: CurrentBlock, code: str) -> None:
    """G43 H: the tool's length from the table, of H or of the tool in the spindle; G43.1 Z: of the block; G49: none.

    G43.4 H: as G43, and X, Y, Z are those of the tip on the part while the rotary axes turn.
    """
    frames, length = state.frames, math.nan
    if code == HOLDS_TIP and frames.posted is None:
        raise block.fail(code, "is tool centre point control of one control, which is not supported", hint=HOLDS_HINT)
    _hold_tip(state, block, code, False)
    if code == "G43.1":
        value = block.take("Z")
        if value is None or any(block.has(axis) for axis in "XYABC"):
            raise block.fail(code, "with other words than Z", "Z with the tool length")
        length = value * state.length_scale
    elif code != "G49":
        length = _length_in_table(state, block, code)
    state.tool_length = length
    new = 0.0 if math.isnan(length) else length
    state.length_changed = state.length_changed or new != frames.tool
    frames.set_tool(new)
    if code == HOLDS_TIP:
        _hold_tip(state, block, code, True)


def _hold_tip(state: State, block: CurrentBlock, code: str, hold: bool) -> None:
    """Switch tool centre point control: the machine stands still, the numbers of the present point change."""
    frames = state.frames
    if frames.posted is None or (not frames.posted.tcp and frames.tip_held == hold):
        return
    turned = any(frames.position[3 + axis.column] for axis in frames.posted.axes)
    if not frames.posted.tcp:
        frames.tip_held = hold
        state.tip_held.append((len(state.recorder), hold))
    if not turned:
        return
    if frames.posted.tcp or (frames.bound and frames.source != "program"):
        frames.from_machine[:3] = [True] * 3  # not known until X, Y and Z are named
        return
    length = tool_of(state.tools, state.tool).length if math.isnan(state.tool_length) else state.tool_length
    position = switched(frames, length, hold)
    if any(map(math.isnan, position)):
        raise block.fail(code, "with a tilted head needs the tool's length", hint="add it to the tool table")
    frames.position = position


def _length_in_table(state: State, block: CurrentBlock, code: str) -> float:
    """Length of the tool that G43 names by H, or of the one in the spindle."""
    number = block.take("H")
    if number == 0 and state.dialect.name == "linuxcnc":  # find_tool_pocket(0): the tool in the spindle
        number = None
    if number == 0:
        if state.dialect.increments:
            return math.nan
        problem = "is no offset on some controls, on LinuxCNC that of the tool"
        raise block.fail("H", problem, "H or G49", "name the control with --dialect")
    if number is None and (state.renamed or state.named_length not in (None, state.tool)):
        problem = "without H after M61, or after another H: controls differ in whose length it takes"
        raise block.fail(code, problem, f"G43 H{state.tool}, or T and M6")
    if number is not None and (number < 0 or number != int(number)):
        raise block.fail("H", "is not a tool number", "a whole number")
    tool = state.tool if number is None else int(number)
    if state.tools is None:
        problem = f"needs the length of tool {tool}, and there is no tool table"
        raise block.fail(code, problem, hint=tool_table_hint(tool))
    length = tool_of(state.tools, tool).length
    if math.isnan(length):
        raise block.fail(code, f"needs the length of tool {tool}", hint="add it to the tool table (--tools FILE)")
    return length


_TCP = "Fanuc, operator's manual of the series 30i, Tool center point control (G43.4)"
TOOL_LENGTH_CODES = (
    Code("G43", "tool length", tool_length, "tool length", g_codes("G43")),
    Code("G43.1", "tool length", tool_length, "tool length in the block", g_codes("G43.1"), takes_axes=True),
    Code(HOLDS_TIP, "tool length", tool_length, "tool centre point control", _TCP, ("generic", "linuxcnc", "fanuc")),
    Code("G49", "tool length", tool_length, "tool length off", g_codes("G49")),
)
TOOL_ALIASES = (Alias("G234", HOLDS_TIP, "tool centre point control (Haas)", f"{HAAS}, G234", ("haas",)),)
