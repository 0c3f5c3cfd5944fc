"""Tools and their lengths: T, M6, M61; G43, G43.1, G43.4, G49. mm, degrees inside."""

from __future__ import annotations

import math

from toolpath_stiff.nc.codes.code import Alias, Code, g_codes, m_codes
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import tool_of, tool_table_hint

HOLDS_TIP = "G43.4"  # tool centre point control
HOLDS_HINT = (
    "post X, Y, Z, A, B, C of the tip, or name the machine it is posted for ([kinematics] of a controller file)"
)


def tool_word(state: State, block: CurrentBlock, code: str) -> None:
    """T: the tool that the next M6 takes."""
    number = block.take("T")
    assert number is not None
    state.selected = int(number)


def change_tool(state: State, block: CurrentBlock, code: str) -> None:
    """M6: the selected tool into the spindle."""
    state.tool, state.renamed = state.selected, False
    _forget_changes(state)


def name_tool(state: State, block: CurrentBlock, code: str) -> None:
    """M61 Q: the tool in the spindle has that number; what T has selected for the next M6 stays."""
    number = block.take("Q")
    if number is None or number < 0 or number != int(number):
        raise block.fail(code, "needs the tool number", "Q with a whole number")
    state.tool, state.renamed = int(number), True
    _forget_changes(state)


def _forget_changes(state: State) -> None:
    """What LinuxCNC's rs274 forgets at a tool change."""
    state.height_lost = state.height_lost or state.length_changed
    if state.rotation_changed:
        state.unsettled = "G10"
    if state.beside is not None:  # it then counts from where the tool centre stands
        frames = state.frames
        frames.position = [coordinate + b for coordinate, b in zip(frames.position, state.beside, strict=True)]
        state.beside = None


def table_length(state: State, block: CurrentBlock, code: str) -> None:
    """G43 H: the tool's length from the tool table, of H or of the tool in the spindle."""
    _hold_tip(state, block, code, False)
    _set_length(state, _length_in_table(state, block, code))


def length_of_z(state: State, block: CurrentBlock, code: str) -> None:
    """G43.1 Z: the tool's length."""
    _hold_tip(state, block, code, False)
    value = block.take("Z")
    if value is None or any(block.has(axis) for axis in "XYABC"):
        raise block.fail(code, "with other words than Z", "Z with the tool length")
    _set_length(state, value * state.length_scale)


def hold_tip(state: State, block: CurrentBlock, code: str) -> None:
    """G43.4 H: as G43, and X, Y, Z are those of the tip on the part while the rotary axes turn."""
    if state.frames.posted is None:
        raise block.fail(code, "is tool centre point control of one control, which is not supported", hint=HOLDS_HINT)
    table_length(state, block, code)
    _hold_tip(state, block, code, True)


def list_numbers(state: State, block: CurrentBlock) -> None:
    """D and H beside a tool change or a tool length: numbers of offsets that nothing of the block uses."""
    present = block.groups.keys()
    if block.has("D") and (present & {"tool length", "M tool change"} or "T" in block.values):
        block.take("D")
        state.note(block.line, block.values["D"], "the number of a radius offset, which acts with G41 and G42 alone")
    if not block.has("H") or not (present & {"M tool change"} or "G49" in block.codes or "T" in block.values):
        return
    if not math.isnan(state.tool_length):
        raise block.fail("H", "without G43, while a tool length is in force", "G43 beside it")
    state.named_length = block.take("H")
    state.note(block.line, block.values["H"], "the number of a tool length, which acts with G43 alone")


def no_length(state: State, block: CurrentBlock, code: str) -> None:
    """G49: no tool length."""
    _hold_tip(state, block, code, False)
    _set_length(state, math.nan)


def _set_length(state: State, length: float) -> None:
    """A tool length from here on, mm; nan: none."""
    state.tool_length = length
    new = 0.0 if math.isnan(length) else length
    state.length_changed = state.length_changed or new != state.frames.tool
    state.frames.set_tool(new)


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
    from toolpath_stiff.nc.posted import switched

    length = state.tool_length
    if math.isnan(length):
        length = tool_of(state.tools, state.tool).length
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
        raise block.fail(
            "H",
            "is no offset on some controls, on LinuxCNC that of the tool",
            "H or G49",
            "name the control with --dialect",
        )
    tool = state.tool if number is None else int(number)
    differ = "controls differ in whose length it takes"
    if number is None and state.named_length not in (None, state.tool):
        raise block.fail(code, f"without H after H{state.named_length:g}: {differ}", "H")
    if number is None and state.renamed:
        raise block.fail(code, f"without H after M61: {differ}", f"G43 H{tool}, or T and M6")
    if number is not None and (number < 0 or number != int(number)):
        raise block.fail("H", "is not a tool number", "a whole number")
    if state.tools is None:
        problem = f"needs the length of tool {tool}, and there is no tool table"
        raise block.fail(code, problem, hint=tool_table_hint(tool))
    if tool not in state.tools or math.isnan(state.tools[tool].length):
        raise block.fail(code, f"needs the length of tool {tool}", hint="add it to the tool table (--tools FILE)")
    return state.tools[tool].length


TOOL_CODES = (
    Code("T", "T", tool_word, "the tool of the next M6", "LinuxCNC, Other Codes, T: Select Tool"),
    Code("M6", "M tool change", change_tool, "tool change", m_codes("M6")),
    Code("M61", "M tool change", name_tool, "tool number", m_codes("M61")),
    Code("G43", "tool length", table_length, "tool length", g_codes("G43")),
    Code("G43.1", "tool length", length_of_z, "tool length in the block", g_codes("G43.1"), takes_axes=True),
    Code(
        HOLDS_TIP, "tool length", hold_tip, "tool centre point control",
        "Fanuc, operator's manual of the series 30i, Tool center point control (G43.4)",
        controls=("generic", "linuxcnc", "fanuc"),
    ),
    Code("G49", "tool length", no_length, "tool length off", g_codes("G49")),
)  # fmt: skip
TOOL_ALIASES = (
    Alias(
        "G234", HOLDS_TIP, "tool centre point control (Haas)", "Haas, mill operator's manual, G234", ("haas",),
        label="tool centre point control (Haas)",
    ),
)  # fmt: skip
