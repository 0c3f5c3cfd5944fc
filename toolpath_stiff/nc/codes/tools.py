"""Tools: T, M6, M61; the numbers of offsets beside them."""

import math

from toolpath_stiff.nc.codes.code import Code, m_codes
from toolpath_stiff.nc.state import CurrentBlock, State


def tool_word(state: State, block: CurrentBlock, code: str) -> None:
    """T: the tool that the next M6 takes."""
    state.selected = int(block.take("T") or 0)


def change_tool(state: State, block: CurrentBlock, code: str) -> None:
    """M6: the selected tool into the spindle. M61 Q: the tool there has that number; what T has selected stays."""
    if code == "M6":
        state.tool, state.renamed = state.selected, False
    else:
        number = block.take("Q")
        if number is None or number < 0 or number != int(number):
            raise block.fail(code, "needs the tool number", "Q with a whole number")
        state.tool, state.renamed = int(number), True
    # What LinuxCNC's rs274 forgets at a tool change.
    state.height_lost = state.height_lost or state.length_changed
    if state.rotation_changed:
        state.unsettled = "G10"
    if state.beside is not None:  # it then counts from where the tool centre stands
        frames = state.frames
        frames.position = [coordinate + b for coordinate, b in zip(frames.position, state.beside, strict=True)]
        state.beside = None


def list_numbers(state: State, block: CurrentBlock) -> None:
    """D and H beside a tool change or a tool length: numbers of offsets that nothing of the block uses."""
    changes = "M tool change" in block.groups or "T" in block.values
    if block.has("D") and (changes or "tool length" in block.groups):
        block.take("D")
        state.note(block.line, block.values["D"], "the number of a radius offset, which acts with G41 and G42 alone")
    if not block.has("H") or not (changes or "G49" in block.codes):
        return
    if not math.isnan(state.tool_length):
        raise block.fail("H", "without G43, while a tool length is in force", "G43 beside it")
    state.named_length = block.take("H")
    state.note(block.line, block.values["H"], "the number of a tool length, which acts with G43 alone")


TOOL_CODES = (
    Code("T", "T", tool_word, "the tool of the next M6", "LinuxCNC, Other Codes, T: Select Tool"),
    Code("M6", "M tool change", change_tool, "tool change", m_codes("M6")),
    Code("M61", "M tool change", change_tool, "tool number", m_codes("M61")),
)
