"""Work offsets, shifts and tool lengths. mm, degrees inside.

G54 to G59.3, G54.1, G154; G10; G52 and G92; T, M6, M61; G43, G43.1, G43.4, G49.
"""

from __future__ import annotations

import math

from toolpath_stiff.nc.codes.code import Alias, Code, g_codes, m_codes
from toolpath_stiff.nc.codes.motion import know_position
from toolpath_stiff.nc.codes.points import axis_words, forget_polar, refuse_while_rotated, zero_moved
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import ADDITIONAL_OFFSETS, WORK_OFFSETS, ToolEntry, WorkOffset, tool_of, tool_table_hint
from toolpath_stiff.nc.words import Word

FIRST_NUMBERED = 110  # G110 to G129

# -- work offsets ------------------------------------------------------------------------------------------------------


def work_offset(state: State, block: CurrentBlock, code: str) -> None:
    """G54 to G59.3: that work offset from here on; G54 P of Fanuc's controls is G54.1 P."""
    if code == "G54" and "P" in block.values and state.dialect.name == "fanuc":
        _additional(state, block, block.codes[code], "G54.1", block.whole("P", block.codes[code]))
        return
    _other_offset(state, block, block.codes[code], WORK_OFFSETS.index(code))


def additional_offset(state: State, block: CurrentBlock, code: str) -> None:
    """G54.1 P and G154 P: an additional offset; the controller file or G10 must have defined it."""
    word = block.codes[code]
    if code not in state.dialect.additional:
        known = " or ".join(state.dialect.additional)
        raise block.fail(
            word, f"is not a code of the dialect {state.dialect.name}", f"{known} P" if known else "G54 to G59.3"
        )
    _additional(state, block, word, code, block.whole("P", word))


def numbered_offset(state: State, block: CurrentBlock, code: str) -> None:
    """G110 to G129: Haas' older names of G154 P1 to P20."""
    word = block.codes[code]
    if state.dialect.name != "haas":
        raise block.fail(word, "is a work offset of Haas' controls", hint="name the control with --dialect")
    _additional(state, block, word, "G154", int(code[1:]) - FIRST_NUMBERED + 1)


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


# -- G10 -------------------------------------------------------------------------------------------------------------


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


# -- shifts ----------------------------------------------------------------------------------------------------------


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


# -- tools and their lengths -------------------------------------------------------------------------------------------

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
        frames.position = [at + b for at, b in zip(frames.position, state.beside, strict=True)]
        state.beside = None


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
    from toolpath_stiff.nc.posted import switched

    length = state.tool_length
    if math.isnan(length):
        length = tool_of(state.tools, state.tool).length
    position = switched(frames, length, hold)
    if any(map(math.isnan, position)):
        raise block.fail(word, "with a tilted head needs the tool's length", hint="add it to the tool table")
    frames.position = position


def _length_in_table(state: State, block: CurrentBlock, word: Word) -> float:
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
        raise block.fail(word, f"without H after H{state.named_length:g}: {differ}", "H")
    if number is None and state.renamed:
        raise block.fail(word, f"without H after M61: {differ}", f"G43 H{tool}, or T and M6")
    if number is not None and (number < 0 or number != int(number)):
        raise block.fail("H", "is not a tool number", "a whole number")
    if state.tools is None:
        raise block.fail(
            word,
            f"needs the length of tool {tool}, and there is no tool table",
            hint=tool_table_hint(tool),
        )
    if tool not in state.tools or math.isnan(state.tools[tool].length):
        raise block.fail(word, f"needs the length of tool {tool}", hint="add it to the tool table (--tools FILE)")
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
