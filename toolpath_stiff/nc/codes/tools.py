"""Tools and their lengths: T, M6, M61; G43, G43.1, G43.4, G49."""

from __future__ import annotations

import math

from toolpath_stiff.nc.blocks import CurrentBlock
from toolpath_stiff.nc.codes.contract import LENGTH, M_TOOL, TOOL, Alias, Code, g_codes, m_codes
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.nc.words import Word

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
        raise block.fail(block.codes[code], "needs the tool number", "Q with a whole number")
    state.tool, state.renamed = int(number), True
    _forget_changes(state)


def _forget_changes(state: State) -> None:
    """What LinuxCNC's rs274 forgets at a tool change."""
    state.height_lost = state.height_lost or state.length_changed
    if state.rotation_changed:
        state.unsettled = "G10"


def table_length(state: State, block: CurrentBlock, code: str) -> None:
    """G43 H: the tool's length from the tool table, of H or of the tool in the spindle."""
    word = block.codes[code]
    _hold_tip(state, block, word, False)
    _set_length(state, _length_in_table(state, block, word))


def length_of_z(state: State, block: CurrentBlock, code: str) -> None:
    """G43.1 Z: the tool's length."""
    word = block.codes[code]
    _hold_tip(state, block, word, False)
    value = block.take("Z")
    if value is None or any(block.has(axis) for axis in "XYABC"):
        raise block.fail(word, "with other words than Z", "Z with the tool length")
    _set_length(state, value * state.length_scale)


def hold_tip(state: State, block: CurrentBlock, code: str) -> None:
    """G43.4 H: as G43, and X, Y, Z are those of the tip on the part while the rotary axes turn."""
    word = block.codes[code]
    if state.frames.posted is None:
        raise block.fail(word, "is tool centre point control of one control, which is not supported", hint=HOLDS_HINT)
    table_length(state, block, code)
    _hold_tip(state, block, word, True)


def no_length(state: State, block: CurrentBlock, code: str) -> None:
    """G49: no tool length."""
    _hold_tip(state, block, block.codes[code], False)
    _set_length(state, math.nan)


def _set_length(state: State, length: float) -> None:
    """A tool length from here on, mm; nan: none."""
    state.tool_length = length
    new = 0.0 if math.isnan(length) else length
    state.length_changed = state.length_changed or new != state.frames.tool
    state.frames.set_tool(new)


def _hold_tip(state: State, block: CurrentBlock, word: Word, hold: bool) -> None:
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
    from toolpath_stiff.nc.posted.program import switched

    length = state.tool_length
    if math.isnan(length):
        length = (state.tools or {}).get(state.tool, ToolEntry(state.tool)).length
    position = switched(frames, length, hold)
    if any(map(math.isnan, position)):
        raise block.fail(word, "with a tilted head needs the tool's length", hint="add it to the tool table")
    frames.position = position


def _length_in_table(state: State, block: CurrentBlock, word: Word) -> float:
    """Length of the tool that G43 names by H, or of the one in the spindle."""
    number = block.take("H")
    if number == 0:
        if state.dialect.increments:
            return math.nan
        raise block.fail(block.values["H"], "is no offset on some controls, on LinuxCNC that of its tool", "H or G49")
    tool = state.tool if number is None else int(number)
    if number is None and state.renamed:
        raise block.fail(
            word, "without H after M61: controls differ in whose length it takes", f"G43 H{tool}, or T and M6"
        )
    if number is not None and (number < 0 or number != int(number)):
        raise block.fail(block.values["H"], "is no tool number", "a whole number")
    if state.tools is None:
        raise block.fail(
            word, f"needs the length of tool {tool}, and there is no tool table", hint="give one with --tools FILE"
        )
    if tool not in state.tools or math.isnan(state.tools[tool].length):
        raise block.fail(word, f"needs the length of tool {tool}", hint="add it to the tool table (--tools FILE)")
    return state.tools[tool].length


CODES = (
    Code("T", TOOL, tool_word, "the tool of the next M6", "LinuxCNC, Other Codes, T: Select Tool"),
    Code("M6", M_TOOL, change_tool, "tool change", m_codes("M6")),
    Code("M61", M_TOOL, name_tool, "tool number", m_codes("M61")),
    Code("G43", LENGTH, table_length, "tool length", g_codes("G43")),
    Code("G43.1", LENGTH, length_of_z, "tool length in the block", g_codes("G43.1"), takes_axes=True),
    Code(
        HOLDS_TIP, LENGTH, hold_tip, "tool centre point control",
        "Fanuc, operator's manual of the series 30i, Tool center point control (G43.4)",
        controls=("generic", "linuxcnc", "fanuc"),
    ),
    Code("G49", LENGTH, no_length, "tool length off", g_codes("G49")),
)  # fmt: skip
ALIASES = (
    Alias(
        "G234", HOLDS_TIP, "tool centre point control (Haas)", "Haas, mill operator's manual, G234", ("haas",),
        label="tool centre point control (Haas)",
    ),
)  # fmt: skip
