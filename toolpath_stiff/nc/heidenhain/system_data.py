"""Data of the control that programs read (FN 18: SYSREAD), as far as program and tool table give them.

HEIDENHAIN, user's manuals of the iTNC 530 and the TNC 640, "FN 18: SYSREAD", "System data". Lengths are mm in inch
programs too. Where the tool stands (ID 240, 270) is not among them: programs read it after a move by hand.
"""

import math
import re
from collections.abc import Callable

from toolpath_stiff.nc.codes.tools import FIRST_NAMED
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.tables import tool_of

SYSREAD = re.compile(r"\s*SYSREAD\s*(Q[LR]?\d+)\s*=\s*ID\s*(\d+)\s*NR\s*(\d+)(?:\s*IDX\s*(\d+|Q[LR]?\d+))?\s*$")
WITH_OVERSIZE = 3  # IDX of ID 200: with DL and DR of TOOL CALL


def _tool(state: State, index: int) -> float:
    return float(state.tool) if 0 < state.tool < FIRST_NAMED else math.nan


def _length(state: State, index: int) -> float:
    return state.tool_length if index == WITH_OVERSIZE else tool_of(state.tools, state.tool).length


def _radius(state: State, index: int) -> float:
    return state.plain.radius if index == WITH_OVERSIZE else tool_of(state.tools, state.tool).diameter / 2.0


def _shift(state: State, index: int) -> float:
    known = state.plain.tilt is None and not state.plain.doubt and 1 <= index <= 3
    return state.plain.shift[index - 1] if known else math.nan


# Group (ID) and number (NR) -> function of the index (IDX; 0: none), nan for unknown values.
SYSTEM_DATA: dict[tuple[int, int], Callable[[State, int], float]] = {
    (20, 1): _tool, (60, 1): _tool,
    (20, 3): lambda state, index: float(("G19", "G18", "G17").index(state.plane)),
    (20, 4): lambda state, index: state.speed or math.nan,
    (50, 1): lambda state, index: tool_of(state.tools, index).length,
    (50, 2): lambda state, index: tool_of(state.tools, index).diameter / 2.0,
    (200, 1): _radius, (200, 2): _length,
    (210, 2): lambda state, index: state.plain.angle,
    (210, 4): lambda state, index: state.plain.scale if 1 <= index <= 3 else math.nan,
    (220, 2): _shift,
}  # fmt: skip


def system_value(state: State, group: str, number: str, index: float) -> float:
    """Value that FN 18 reads; nan if unknown.

    Examples
    --------
    >>> from toolpath_stiff.nc.controller import UNKNOWN_CONTROL
    >>> from toolpath_stiff.nc.request import Request
    >>> state = Request((), "part.h", controller=UNKNOWN_CONTROL).start()
    >>> system_value(state, "210", "2", 0), system_value(state, "230", "3", 3)
    (0.0, nan)
    """
    value = SYSTEM_DATA.get((int(group), int(number)))
    return math.nan if value is None or math.isnan(index) else value(state, int(index))
