"""G10: work offsets and tools set by the program, as LinuxCNC or as Fanuc and Haas have it. mm, degrees."""

from toolpath_stiff.nc.codes.code import Code, g_codes
from toolpath_stiff.nc.codes.motion import know_position
from toolpath_stiff.nc.codes.points import axis_words
from toolpath_stiff.nc.codes.polar import forget_polar
from toolpath_stiff.nc.codes.unsettled import refuse_while_rotated, zero_moved
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import ADDITIONAL_OFFSETS, WORK_OFFSETS, ToolEntry, WorkOffset


def set_offsets(state: State, block: CurrentBlock, code: str) -> None:
    """G10: L2 and L20 set work offsets, L1 a tool of the table; on Fanuc's and Haas' controls as they have it."""
    fanuc = state.dialect.increments
    numbers: dict[float, int] = {1: 10**9, 2: len(WORK_OFFSETS), 20: len(WORK_OFFSETS)}
    if fanuc:
        numbers = {2: 6, 10: 999, 20: max(ADDITIONAL_OFFSETS[name] for name in state.dialect.additional)}
    level, number = block.take("L"), block.take("P")
    if level not in numbers:
        expected = f"L{', L'.join(str(known) for known in numbers)}"
        raise block.fail(code, f"with L{level:g}" if level is not None else "without L", expected)
    if number is None or number != int(number) or not (1 if fanuc else 0) <= number <= numbers[level]:
        raise block.fail(code, f"L{level:g} needs the number of a tool or a work offset", f"P up to {numbers[level]}")
    if level == 1 or (fanuc and level == 10):
        _set_tool(state, block, code, int(number))
        return
    refuse_while_rotated(state, block, code, "sets a work offset")
    forget_polar(state)
    (_set_fanuc_offset if fanuc else _set_offset)(state, block, code, int(number), level == 20)


def _set_offset(state: State, block: CurrentBlock, code: str, number: int, from_here: bool) -> None:
    """L2, L20: the numbers of an offset, or of the present point in it."""
    frames = state.frames
    if number == 0 and frames.active >= len(WORK_OFFSETS):
        raise block.fail(code, "P0 while an additional offset is in force", "P1 to P9")
    index = frames.active if number == 0 else number - 1
    offset = frames.offsets.table[index]
    rotation = block.take("R")
    if rotation is not None:
        if from_here:
            raise block.fail("R", "does not go with L20", "L2")
        if index == frames.active and rotation != offset.rotation:
            state.unsettled = "G10"
        offset.rotation = rotation
    words = axis_words(state, block)
    if from_here:
        know_position(state, block, block.codes[code], words)
        active, frames.active = frames.active, index
        here = frames.to_program(frames.position)
        wanted = frames.to_control([words.get(axis, here[axis]) for axis in range(6)])
        frames.active = active
        for axis in range(6):
            offset.axes[axis] += frames.position[axis] - wanted[axis]
    else:
        for axis, value in words.items():
            offset.axes[axis] = value
    offset.given = True
    if index == frames.active:
        zero_moved(state)


def _set_fanuc_offset(state: State, block: CurrentBlock, code: str, number: int, additional: bool) -> None:
    """Fanuc's and Haas' L2 sets G54 to G59, L20 the additional offsets.

    Sources: Fanuc's operator's manuals ("Programmable data input"), Haas' mill operator's manual (G10).
    """
    if not state.absolute:
        raise block.fail(code, "in incremental mode (G91), where it adds", "G90")
    offsets = state.frames.offsets
    offset = offsets.additional.setdefault(number, WorkOffset()) if additional else offsets.table[number - 1]
    for axis, value in axis_words(state, block).items():
        offset.axes[axis] = value
    offset.given = True


def _set_tool(state: State, block: CurrentBlock, code: str, number: int) -> None:
    """L1: length (Z) and radius (R) of a tool; L10 of Fanuc's and Haas' controls: its length (R)."""
    state.tools = {} if state.tools is None else state.tools
    tool = state.tools.setdefault(number, ToolEntry(number))
    words, radius = axis_words(state, block), block.take("R")
    if state.dialect.increments:
        if radius is None or words or not state.absolute:
            raise block.fail(code, "L10 without the length, or in incremental mode (G91), where it adds", "R, in G90")
        tool.length = radius * state.length_scale
        return
    if any(axis != 2 for axis in words):
        raise block.fail(code, "sets other tool offsets than Z", "Z, the tool's length")
    tool.length = words.get(2, tool.length)
    tool.diameter = tool.diameter if radius is None else 2.0 * radius * state.length_scale


SET_OFFSET_CODES = (
    Code("G10", "non-modal", set_offsets, "set offsets", g_codes("G10 L1, G10 L2, G10 L20"), takes_axes=True),
)
