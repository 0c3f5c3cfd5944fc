"""Tools of Siemens' language (T, M6, D), and the blank (WORKPIECE). mm.

SIEMENS, SINUMERIK 840D sl, Programming Manual Fundamentals, "Tool change", "Tool offsets"; Operating Manual Milling,
"Blank input".
"""

import math
import re

from toolpath_stiff.nc.codes.tools import change_tool, tool_number
from toolpath_stiff.nc.contouring.points import outside_contour
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import ToolEntry, tool_of

ONE_EDGE = "cutting edges beyond D1 have the length and the diameter of the tool in the table"
TOOL_DATA = re.compile(r"\$TC_DP([1236])\[(\d+),1\]")  # type, edge position, length, radius of the first edge
BY_T = "T changes the tool: the program has no M6"


def set_data(state: State, name: str, value: float) -> bool:
    """Set a tool's length ($TC_DP3) or radius ($TC_DP6), mm, if a variable is one; True if it is data of a tool."""
    data = TOOL_DATA.fullmatch(name)
    if data is None:
        return False
    state.tools = {} if state.tools is None else state.tools
    entry = state.tools.setdefault(int(data[2]), ToolEntry(int(data[2])))
    if data[1] == "3":
        entry.length = value
    elif data[1] == "6":
        entry.diameter = 2.0 * value
    return True


def select(state: State, block: CurrentBlock, code: str) -> None:
    """T: the tool for the next M6; in a program without M6 it is changed at once."""
    number = tool_number(state, block)
    block.take("T")
    block.refuse_if(number is None, "T", "is no tool", 'T1, T="MILL"')
    state.selected = number or 0
    if state.plain.changes_by_t:
        state.assume(BY_T)
        change(state, block, "M6")


def change(state: State, block: CurrentBlock, code: str) -> None:
    """M6: change to the tool that T named, with its first cutting edge."""
    outside_contour(state, block, "another tool")
    turn = state.turn
    change_tool(state, block, "M6")
    state.turn = turn if state.plain.changes_by_t else 0
    _put(state, block, 1)


def edge(state: State, block: CurrentBlock, code: str) -> None:
    """D: the cutting edge whose length and radius apply; D0: none."""
    number = block.whole("D", block.values["D"], 0) or 0
    if number > 1:
        state.assume(ONE_EDGE)
    _put(state, block, number)


def _put(state: State, block: CurrentBlock, number: int) -> None:
    entry, plain = tool_of(state.tools, state.tool), state.plain
    length = entry.length if number else math.nan
    new = 0.0 if math.isnan(length) else length
    other = plain.tilt is not None or state.plane != "G17"
    problem = "changes the tool's length in a swivelled plane, or with another tool axis than Z"
    block.refuse_if(other and new != state.frames.tool, None, problem, "CYCLE800() and G17 before it")
    block.refuse_if(state.cutter is not None, "D", "while G41 or G42 is on", "G40 before it")
    state.tool_length, plain.radius = length, entry.diameter / 2.0 if number else 0.0
    state.frames.set_tool(new)


def blank(state: State, block: CurrentBlock, code: str) -> None:
    """WORKPIECE of a box: mode bits 4 and 5 say whether its second corner is absolute, bit 6 whether its bottom is."""
    scale, values = state.length_scale, [block.take(name) for name in ("Z0", "Z1", "ZB", "X0", "Y0", "X1", "Y1")]
    mode, form = int(block.take("MODE") or 0), block.values.get("FORM")
    block.free.clear()
    if form is None or form.text != "BOX" or None in values[:2] + values[3:]:
        state.note(block.line, block.block.words[0], "the blank, which is not taken")
        return
    top, bottom, _, x0, y0, x1, y1 = (0.0 if value is None else value for value in values)
    first = (x0, y0, top)
    second = [
        value if mode >> bit & 1 else start + value
        for value, bit, start in zip((x1, y1, bottom), (4, 5, 6), first, strict=True)
    ]
    for name, corner in (("lower", map(min, first, second)), ("upper", map(max, first, second))):
        state.plain.stock[name] = [value * scale for value in corner]
