"""Tools: T, M6, M61; their length and tool centre point control: G43, G43.1, G43.4, G49. mm, degrees inside."""

import math

from toolpath_stiff.nc.codes.code import HAAS, Code, g_codes, m_codes
from toolpath_stiff.nc.posted import switched
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import tool_of, tool_table_hint

HOLDS_TIP = "G43.4"  # tool centre point control
HOLDS_HINT = (
    "post X, Y, Z, A, B, C of the tip, or name the machine it is posted for ([kinematics] of a controller file)"
)
FIRST_NAMED = 10_001  # number given to the first tool called by name
ADD_IT = "add it to the tool table (--tools FILE)"


def tool_word(state: State, block: CurrentBlock, code: str) -> None:
    """T: the tool that the next M6 takes."""
    state.selected = int(block.take("T") or 0)


def tool_number(state: State, block: CurrentBlock) -> int | None:
    """Number of the tool in a statement: as given, or by its name in the tool table (or in order of appearance)."""
    name, value = block.values.get('"'), block.take("#")
    if block.take('"') is None or name is None:
        block.refuse_if(value is not None and (value != int(value) or value < 0), "#", "is no tool", "a whole number")
        return None if value is None else int(value)
    table = {entry.remark.upper(): number for number, entry in (state.tools or {}).items()}
    names = state.plain.names
    number = table.get(name.text) or names.setdefault(name.text, FIRST_NAMED + len(names))
    if name.text not in table:
        state.assume(f'the tool "{name.text}" has the number {number} here')
    return number


def change_tool(state: State, block: CurrentBlock, code: str) -> None:
    """M6: the selected tool into the spindle. M61 Q: the tool there has that number; what T has selected stays."""
    number = state.selected if code == "M6" else block.whole("Q", block.codes[code], 0)
    if number is None:
        raise block.fail(code, "needs the tool number", "Q with a whole number")
    state.tool, state.renamed = number, code == "M61"
    if code == "M6":
        state.turn = 0  # LinuxCNC, M-Codes, M6: "the spindle will be stopped"
    # State that LinuxCNC's rs274 forgets at a tool change.
    state.height_lost = state.height_lost or state.length_changed
    if state.rotation_changed:
        state.unsettled = "G10"
    if state.beside is not None:  # it then counts from the tool centre's place
        state.frames.position = [p + b for p, b in zip(state.frames.position, state.beside, strict=True)]
        state.beside = None


def list_numbers(state: State, block: CurrentBlock) -> None:
    """D and H beside a tool change or tool length: list offset numbers that nothing in the block uses."""
    changes = "M tool change" in block.groups or "T" in block.values
    if block.has("D") and (changes or "tool length" in block.groups):
        block.take("D")
        state.note(block.line, block.values["D"], "the number of a radius offset, which acts only with G41 and G42")
    if block.has("H") and (changes or "G49" in block.codes):
        has_length = not math.isnan(state.tool_length)
        block.refuse_if(has_length, "H", "without G43, while a tool length is in force", "G43 beside it")
        state.named_length = block.take("H")
        state.note(block.line, block.values["H"], "the number of a tool length, which acts only with G43")


def tool_length(state: State, block: CurrentBlock, code: str) -> None:
    """G43 H: the tool's length from the table, of H or of the tool in the spindle; G43.1 Z: of the block; G49: none.

    G43.4 H: as G43, and X, Y, Z are those of the tip on the part while the rotary axes turn.
    """
    frames, length = state.frames, math.nan
    block.refuse_if(code == HOLDS_TIP and frames.posted is None, code, "is tool centre point control", hint=HOLDS_HINT)
    hold_tip(state, block, code, False)
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
        hold_tip(state, block, code, True)


def hold_tip(state: State, block: CurrentBlock, code: str, hold: bool) -> None:
    """Switch tool centre point control: the machine does not move, the numbers of the present point change."""
    frames = state.frames
    if frames.posted is None or (not frames.posted.tcp and frames.tip_held == hold):
        return
    if not frames.posted.tcp:
        frames.tip_held = hold
        state.tip_held.append((len(state.recorder), hold))
    if not any(frames.position[3 + axis.column] for axis in frames.posted.axes):
        return
    if frames.posted.tcp or (frames.bound and frames.source != "program"):
        frames.from_machine[:3] = [True] * 3  # unknown until X, Y and Z are given
        return
    length = tool_of(state.tools, state.tool).length if math.isnan(state.tool_length) else state.tool_length
    position = switched(frames, length, hold)
    block.refuse_if(any(map(math.isnan, position)), code, "with a tilted head needs the tool's length", hint=ADD_IT)
    frames.position = position


def _length_in_table(state: State, block: CurrentBlock, code: str) -> float:
    """Length of the tool given by G43's H, or of the one in the spindle."""
    number = block.whole("H", block.codes[code], 0)
    if number == 0 and state.dialect.increments:
        return math.nan
    problem, hint = "is no offset on some controls, on LinuxCNC that of the tool", "name the control with --dialect"
    block.refuse_if(number == 0 and state.dialect.name != "linuxcnc", "H", problem, "H or G49", hint)
    other = not number and (state.renamed or state.named_length not in (None, state.tool))
    problem = "without H after M61, or after another H: controls differ in whose length it takes"
    block.refuse_if(other, code, problem, f"G43 H{state.tool}, or T and M6")
    tool = number or state.tool  # LinuxCNC's H0 too (find_tool_pocket(0))
    if state.tools is None:
        problem = f"needs the length of tool {tool}, and there is no tool table"
        raise block.fail(code, problem, hint=tool_table_hint(tool))
    length = tool_of(state.tools, tool).length
    block.refuse_if(math.isnan(length), code, f"needs the length of tool {tool}", hint=ADD_IT)
    return length


_TCP = "Fanuc, operator's manual of the series 30i, Tool center point control (G43.4)"
TOOL_CODES = (
    Code("T", "T", tool_word, "the tool of the next M6", "LinuxCNC, Other Codes, T: Select Tool"),
    Code("M6", "M tool change", change_tool, "tool change", m_codes("M6")),
    Code("M61", "M tool change", change_tool, "tool number", m_codes("M61")),
    Code("G43", "tool length", tool_length, "tool length", g_codes("G43")),
    Code("G43.1", "tool length", tool_length, "tool length in the block", g_codes("G43.1"), takes_axes=True),
    Code(HOLDS_TIP, "tool length", tool_length, "tool centre point control", _TCP, ("generic", "linuxcnc", "fanuc")),
    Code("G234", "tool length", tool_length, "tool centre point control (Haas), as G43.4", f"{HAAS}, G234", ("haas",)),
    Code("G49", "tool length", tool_length, "tool length off", g_codes("G49")),
)
