"""Tools of the plain language (TOOL CALL, TOOL DEF), and the blank (BLK FORM). mm.

HEIDENHAIN, user's manual of the iTNC 530, "Tool data", "Defining the blank form".
"""

import math

from toolpath_stiff.nc.codes.tools import change_tool, tool_number
from toolpath_stiff.nc.contouring.points import inch_tenths, outside_contour
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import ToolEntry, tool_of
from toolpath_stiff.nc.words import AXES

TOOL_PLANES = {"X!": "G19", "Y!": "G18", "Z!": "G17"}


def tool_call(state: State, block: CurrentBlock, code: str) -> None:
    """TOOL CALL: the tool with its length and radius, its axis, S and F; DL and DR add to the table's."""
    plain = state.plain
    outside_contour(state, block, "")
    plane = next((TOOL_PLANES[letter] for letter in TOOL_PLANES if block.take(letter) is not None), None)
    if plane is not None and plane != state.plane:
        block.refuse_if(plain.tilt is not None or plain.angle, None, "takes another tool axis under PLANE or cycle 10")
        state.plane, plain.pole, plain.heading = plane, None, None
    speed, rate = block.take("S"), block.take("F")
    state.speed = state.speed if speed is None else speed
    if rate is not None:
        state.feed = plain.tool_feed = rate * inch_tenths(state) or None
    number, turn = tool_number(state, block), state.turn
    longer, wider = ((block.take(word) or 0.0) * state.length_scale for word in ("DL", "DR"))
    block.take("DR2")
    if number is None and not longer and not wider:
        return
    block.refuse_if(number is None and not state.tool, None, "with DL or DR alone, and no tool", "a tool before it")
    state.selected = state.tool if number is None else number
    change_tool(state, block, "M6")
    state.turn = turn if number is None else state.turn
    entry = tool_of(state.tools, state.tool)
    plain.radius = entry.diameter / 2.0 + wider
    frames, length = state.frames, entry.length + longer
    state.tool_length = length
    block.refuse_if(plain.tilt and not math.isnan(length), None, "in a tilted plane", "PLANE RESET before it")
    frames.set_tool(0.0 if math.isnan(length) else length)
    plain.heading = None


def tool_definition(state: State, block: CurrentBlock, code: str) -> None:
    """TOOL DEF: length and radius of a tool; without them it is the next one of the magazine."""
    number, length, radius = tool_number(state, block), block.take("L"), block.take("R")
    if block.take("F") is not None:
        state.note(block.line, block.values["F"], "a feed with a tool, as simulators have it: TOOL CALL has it")
    if number is None or (length is None and radius is None):
        return
    state.tools = {} if state.tools is None else state.tools
    entry = state.tools.setdefault(number, ToolEntry(number))
    entry.length = entry.length if length is None else length * state.length_scale
    entry.diameter = entry.diameter if radius is None else 2.0 * radius * state.length_scale


def blank(state: State, block: CurrentBlock, code: str) -> None:
    """BLK FORM 0.1 and 0.2: the smallest and the largest corner of the blank, along the axes."""
    stock, scale = state.plain.stock, state.length_scale
    for letter in TOOL_PLANES:
        block.take(letter)
    lower = stock.get("BLK FORM 0.1", [math.nan] * 3)
    corner = []
    for axis, letter in enumerate(AXES[:3]):
        value, step = block.take(letter), block.take(f"I{letter}")
        corner.append(lower[axis] + step * scale if step is not None else math.nan if value is None else value * scale)
    stock[code] = corner
