"""Work offsets and shifts: G54 to G59.3, G54.1, G154; G10; G52 and G92. mm, degrees inside."""

from __future__ import annotations

from toolpath_stiff.nc.codes.code import Code, g_codes
from toolpath_stiff.nc.codes.motion import know_position
from toolpath_stiff.nc.codes.points import axis_words, forget_polar, refuse_while_rotated, zero_moved
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import ADDITIONAL_OFFSETS, WORK_OFFSETS, ToolEntry, WorkOffset
from toolpath_stiff.nc.words import Word

FIRST_NUMBERED = 110  # G110 to G129


def work_offset(state: State, block: CurrentBlock, code: str) -> None:
    """G54 to G59.3: that work offset from here on; G54 P of Fanuc's controls is G54.1 P."""
    if code == "G54" and "P" in block.values and state.dialect.name == "fanuc":
        _additional(state, block, block.codes[code], "G54.1", block.whole("P", block.codes[code]))
        return
    _other_offset(state, block, block.codes[code], WORK_OFFSETS.index(code))


def additional_offset(state: State, block: CurrentBlock, code: str) -> None:
    """G54.1 P and G154 P: an additional offset; the controller file or G10 must have defined it."""
    if code not in state.dialect.additional:
        known = f"{' or '.join(state.dialect.additional)} P" if state.dialect.additional else "G54 to G59.3"
        raise block.fail(code, f"is not a code of the dialect {state.dialect.name}", known)
    _additional(state, block, block.codes[code], code, block.whole("P", block.codes[code]))


def numbered_offset(state: State, block: CurrentBlock, code: str) -> None:
    """G110 to G129: Haas' older names of G154 P1 to P20."""
    if state.dialect.name != "haas":
        raise block.fail(code, "is a work offset of Haas' controls", hint="name the control with --dialect")
    _additional(state, block, block.codes[code], "G154", int(code[1:]) - FIRST_NUMBERED + 1)


def _additional(state: State, block: CurrentBlock, word: Word, code: str, number: int | None) -> None:
    """An additional offset, by the code and the number that the controller file has it under."""
    if number is None or number > ADDITIONAL_OFFSETS[code]:
        raise block.fail(word, "needs the number of its offset", f"P1 to P{ADDITIONAL_OFFSETS[code]}")
    if number not in state.frames.offsets.additional:
        raise block.fail(
            word,
            f"is {code} P{number}, an offset that nothing defines",
            hint=f'give it in the controller file: [offsets] "{code} P{number}" = [x, y, z]',
        )
    _other_offset(state, block, word, len(WORK_OFFSETS) + number - 1)


def _other_offset(state: State, block: CurrentBlock, word: Word, index: int) -> None:
    if index != state.frames.active:
        refuse_while_rotated(state, block, word, "takes another work offset")
        take_offset(state, index)


def take_offset(state: State, index: int) -> None:
    """The work offset of an index from here on."""
    frames = state.frames
    if index != frames.active:
        turned = frames.offsets.at(index).rotation != frames.offsets.at(frames.active).rotation
        state.rotation_changed = state.rotation_changed or turned
        frames.active = index
        zero_moved(state)
        forget_polar(state)


def set_offsets(state: State, block: CurrentBlock, code: str) -> None:
    """G10: L2 and L20 set work offsets, L1 a tool of the table; on Fanuc's and Haas' controls as they have it."""
    word, level, number = block.codes[code], block.take("L"), block.take("P")
    if state.dialect.increments:
        _fanuc_g10(state, block, word, level, number)
    elif level == 1:
        _set_tool(state, block, word, number)
    elif level in (2, 20):
        _set_offset(state, block, word, level, number)
    else:
        raise block.fail(word, f"with L{level:g}" if level is not None else "without L", "L2, L20 (offsets) or L1")


def _set_offset(state: State, block: CurrentBlock, word: Word, level: float | None, number: float | None) -> None:
    """G10 L2, L20: the numbers of an offset, or of the present point in it."""
    frames = state.frames
    if number == 0 and frames.active >= len(WORK_OFFSETS):
        raise block.fail(word, "P0 while an additional offset is in force", "P1 to P9")
    refuse_while_rotated(state, block, word, "sets a work offset")
    forget_polar(state)
    if number is None or number != int(number) or not 0 <= number <= len(WORK_OFFSETS):
        raise block.fail(word, "needs the work offset", f"P0 (the active one) or P1 to P{len(WORK_OFFSETS)}")
    index = frames.active if number == 0 else int(number) - 1
    offset = frames.offsets.table[index]
    rotation = block.take("R")
    if rotation is not None:
        if level == 20:
            raise block.fail("R", "does not go with L20", "L2")
        if index == frames.active and rotation != offset.rotation:
            state.unsettled = "G10"
        offset.rotation = rotation
    words = axis_words(state, block)
    if level == 20:
        know_position(state, block, word, words)
        _offset_from_here(state, index, words)
    else:
        for axis, value in words.items():
            offset.axes[axis] = value
    offset.given = True
    if index == frames.active:
        zero_moved(state)


def _offset_from_here(state: State, index: int, words: dict[int, float]) -> None:
    """L20: choose the offset so that the present point gets these coordinates."""
    frames = state.frames
    active, frames.active = frames.active, index
    here = frames.to_program(frames.position)
    wanted = [words.get(axis, here[axis]) for axis in range(6)]
    shift = [c - w for c, w in zip(frames.position, frames.to_control(wanted), strict=True)]
    frames.active = active
    for axis in range(6):
        frames.offsets.table[index].axes[axis] += shift[axis]


def _fanuc_g10(state: State, block: CurrentBlock, word: Word, level: float | None, number: float | None) -> None:
    """Fanuc's and Haas' G10: L2 sets G54 to G59, L20 the additional offsets, L10 the length of the tool of an H.

    Sources: Fanuc's operator's manuals ("Programmable data input"), Haas' mill operator's manual (G10).
    """
    if level not in (2, 10, 20):
        raise block.fail(word, f"with L{level:g}" if level is not None else "without L", "L2, L20 or L10")
    most = {2: 6, 10: 999, 20: max(ADDITIONAL_OFFSETS[code] for code in state.dialect.additional)}[int(level)]
    if number is None or number != int(number) or not 1 <= number <= most:
        raise block.fail(word, f"L{level:g} without a number that it knows", f"P1 to P{most}")
    if not state.absolute:
        raise block.fail(word, "in incremental mode (G91), where it adds", "G90")
    if level == 10:
        length = block.take("R")
        if length is None:
            raise block.fail(word, "L10 without the length", "R")
        _tool_of_table(state, int(number)).length = length * state.length_scale
        return
    refuse_while_rotated(state, block, word, "sets a work offset")
    forget_polar(state)
    offsets = state.frames.offsets
    index = int(number) - 1
    offset = offsets.table[index] if level == 2 else offsets.additional.setdefault(index + 1, WorkOffset())
    for axis, value in axis_words(state, block).items():
        offset.axes[axis] = value
    offset.given = True


def _set_tool(state: State, block: CurrentBlock, word: Word, number: float | None) -> None:
    """G10 L1: length and radius of a tool."""
    if number is None or number != int(number) or number < 0:
        raise block.fail(word, "needs the tool number", "P with a whole number")
    words = axis_words(state, block)
    radius = block.take("R")
    if any(axis != 2 for axis in words):
        raise block.fail(word, "sets other tool offsets than Z", "Z, the tool's length")
    tool = _tool_of_table(state, int(number))
    tool.length = words.get(2, tool.length)
    tool.diameter = tool.diameter if radius is None else 2.0 * radius * state.length_scale


def _tool_of_table(state: State, number: int) -> ToolEntry:
    state.tools = {} if state.tools is None else state.tools
    return state.tools.setdefault(number, ToolEntry(number))


def local_shift(state: State, block: CurrentBlock, code: str) -> None:
    """G52: a shift of program coordinates, on top of the work offset."""
    words = _words_of_shift(state, block, code)
    for axis, value in words.items():
        state.frames.g92[axis] = value
    _keep_shift(state)


def present_point(state: State, block: CurrentBlock, code: str) -> None:
    """G92: the shift that gives the present point these numbers."""
    words = _words_of_shift(state, block, code)
    know_position(state, block, block.codes[code], words)
    frames = state.frames
    here = frames.to_program(frames.position)
    for axis, value in words.items():
        frames.g92[axis] += here[axis] - value
    _keep_shift(state)


def _words_of_shift(state: State, block: CurrentBlock, code: str) -> dict[int, float]:
    word = block.codes[code]
    refuse_while_rotated(state, block, word, "shifts the zero")
    forget_polar(state)
    words = axis_words(state, block)
    if not words:
        raise block.fail(word, "without axis words", "X, Y, Z, A, B or C")
    return words


def _keep_shift(state: State) -> None:
    state.frames.g92_kept = list(state.frames.g92)
    zero_moved(state)


def shift_state(state: State, block: CurrentBlock, code: str) -> None:
    """G92.1: no shift; G92.2: none for now; G92.3: the one before G92.2."""
    refuse_while_rotated(state, block, block.codes[code], "shifts the zero")
    forget_polar(state)
    zero_moved(state)
    frames = state.frames
    if code == "G92.3":
        frames.g92 = list(frames.g92_kept)
        return
    frames.g92 = [0.0] * 6
    if code == "G92.1":
        frames.g92_kept = [0.0] * 6


OFFSET_CODES = (
    *(
        Code(code, "work offset", work_offset, f"work offset {number}", g_codes("G54-G59.3"), label="work offset")
        for number, code in enumerate(WORK_OFFSETS, 1)
    ),
    Code(
        "G54.1", "work offset", additional_offset, "additional work offset",
        "Fanuc, operator's manuals, Additional workpiece coordinate systems (G54.1)", controls=("generic", "fanuc"),
    ),
    Code(
        "G154", "work offset", additional_offset, "additional work offset (Haas)", "Haas, mill operator's manual, G154",
        controls=("generic", "haas"),
    ),
    *(
        Code(
            f"G{number}", "work offset", numbered_offset, "additional work offset (Haas: G154 P1 to P20)",
            "Haas, mill operator's manual, G110-G129", ("haas",), label="work offset",
        )
        for number in range(FIRST_NUMBERED, FIRST_NUMBERED + 20)
    ),
    Code("G10", "non-modal", set_offsets, "set offsets", g_codes("G10 L1, G10 L2, G10 L20"), takes_axes=True),
    Code("G52", "non-modal", local_shift, "local shift", g_codes("G52"), takes_axes=True),
    Code("G92", "non-modal", present_point, "shift", g_codes("G92"), takes_axes=True),
    Code("G92.1", "non-modal", shift_state, "no shift any more", g_codes("G92.1 G92.2"), label="non-modal"),
    Code("G92.2", "non-modal", shift_state, "shift suspended", g_codes("G92.1 G92.2"), label="non-modal"),
    Code("G92.3", "non-modal", shift_state, "shift restored", g_codes("G92.3"), label="non-modal"),
)  # fmt: skip
