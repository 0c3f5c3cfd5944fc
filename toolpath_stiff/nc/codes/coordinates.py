"""Position of program zero and orientation of the program's axes: work offsets, G10, shifts (G52, G92), rotation (G68).

Rotation follows Fanuc's milling controls (operator's manuals of the series 16 and 15i, "Coordinate system rotation").
Where these manuals leave the point to parameters or forbid the block, it is refused. mm and degrees.
"""

import math

from toolpath_stiff.nc.codes.code import FANUC, HAAS, Code, family, g_codes
from toolpath_stiff.nc.codes.motion import know_position
from toolpath_stiff.nc.codes.points import SAME_PLACE_MM, axis_words, forget_polar, refuse_while_rotated
from toolpath_stiff.nc.frames import Rotation
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import ADDITIONAL_OFFSETS, WORK_OFFSETS, ToolEntry, WorkOffset
from toolpath_stiff.nc.words import Word

NUMBERED = tuple(f"G{number}" for number in range(110, 130))


def work_offset(state: State, block: CurrentBlock, code: str) -> None:
    """G54 to G59.3: that work offset from here on; G54 P of Fanuc's controls is G54.1 P."""
    word = block.codes[code]
    if code == "G54" and "P" in block.values and state.dialect.name == "fanuc":
        _take_additional(state, block, word, "G54.1", block.whole("P", word))
    else:
        take_offset(state, block, word, WORK_OFFSETS.index(code))


def additional_offset(state: State, block: CurrentBlock, code: str) -> None:
    """G54.1 P, G154 P (G110 to G129: Haas' older names of P1 to P20); the controller file or G10 defines them."""
    if code in NUMBERED:
        _take_additional(state, block, block.codes[code], "G154", NUMBERED.index(code) + 1)
    else:
        _take_additional(state, block, block.codes[code], code, block.whole("P", block.codes[code]))


def _take_additional(state: State, block: CurrentBlock, word: Word, code: str, number: int | None) -> None:
    """Put an additional offset in force, by its code and its number in the controller file."""
    if number is None or number > ADDITIONAL_OFFSETS[code]:
        raise block.fail(word, "needs the number of its offset", f"P1 to P{ADDITIONAL_OFFSETS[code]}")
    if number not in state.frames.offsets.additional:
        hint = f'give it in the controller file: [offsets] "{code} P{number}" = [x, y, z]'
        raise block.fail(word, f"is {code} P{number}, an offset that nothing defines", hint=hint)
    take_offset(state, block, word, len(WORK_OFFSETS) + number - 1)


def take_offset(state: State, block: CurrentBlock, word: Word, index: int) -> None:
    """Put the work offset with an index in force."""
    frames = state.frames
    if index != frames.active:
        refuse_while_rotated(state, block, word, "takes another work offset")
        before, frames.active = frames.offsets.at(frames.active), index
        state.rotation_changed = state.rotation_changed or frames.offsets.at(index).rotation != before.rotation
        _zero_moved(state)
        forget_polar(state)


def _zero_moved(state: State) -> None:
    """Note that the zero of rotated coordinates has moved: LinuxCNC's rs274 forgets it at the next M6."""
    if state.frames.offsets.at(state.frames.active).rotation:
        state.rotation_changed = True


def set_offsets(state: State, block: CurrentBlock, code: str) -> None:
    """G10: L2 and L20 set work offsets, L1 a tool of the table; on Fanuc's and Haas' controls by their own rules."""
    fanuc = state.dialect.increments
    largest: dict[float, int] = {1: 10**9, 2: len(WORK_OFFSETS), 20: len(WORK_OFFSETS)}
    if fanuc:
        largest = {2: 6, 10: 999, 20: max(ADDITIONAL_OFFSETS[name] for name in state.dialect.additional)}
    level, number = block.take("L"), block.take("P")
    if level not in largest:
        raise block.fail(
            code, f"with L{level:g}" if level is not None else "without L", f"L{', L'.join(map(str, largest))}"
        )
    if number is None or number != int(number) or not (1 if fanuc else 0) <= number <= largest[level]:
        raise block.fail(code, f"L{level:g} needs the number of a tool or a work offset", f"P up to {largest[level]}")
    if level in (1, 10):
        _set_tool(state, block, code, int(number))
        return
    refuse_while_rotated(state, block, code, "sets a work offset")
    forget_polar(state)
    (_set_fanuc_offset if fanuc else _set_offset)(state, block, code, int(number), level == 20)


def _set_offset(state: State, block: CurrentBlock, code: str, number: int, from_here: bool) -> None:
    """L2, L20: set the numbers of an offset, or make it give the present point these numbers."""
    frames = state.frames
    additional = frames.active >= len(WORK_OFFSETS)
    block.refuse_if(number == 0 and additional, code, "P0 while an additional offset is in force", "P1 to P9")
    active, index = frames.active, frames.active if number == 0 else number - 1
    offset, rotation = frames.offsets.table[index], block.take("R")
    if rotation is not None:
        block.refuse_if(from_here, "R", "does not go with L20", "L2")
        if index == active and rotation != offset.rotation:
            state.unsettled = "G10"
        offset.rotation = rotation
    words = axis_words(state, block)
    if from_here:
        know_position(state, block, block.codes[code], words)
        frames.active = index
        here = frames.to_program(frames.position)
        wanted = frames.to_control([words.get(axis, here[axis]) for axis in range(6)])
        frames.active = active
        offset.axes[:] = [o + (p - w) for o, p, w in zip(offset.axes, frames.position, wanted, strict=True)]
    else:
        offset.axes[:] = [words.get(axis, value) for axis, value in enumerate(offset.axes)]
    offset.given = True
    if index == active:
        _zero_moved(state)


def _set_fanuc_offset(state: State, block: CurrentBlock, code: str, number: int, additional: bool) -> None:
    """Fanuc's and Haas' L2 sets G54 to G59, L20 the additional offsets.

    Sources: Fanuc's operator's manuals ("Programmable data input"), Haas' mill operator's manual (G10).
    """
    block.refuse_if(not state.absolute, code, "in incremental mode (G91), where it adds", "G90")
    offsets, words = state.frames.offsets, axis_words(state, block)
    offset = offsets.additional.setdefault(number, WorkOffset()) if additional else offsets.table[number - 1]
    offset.axes[:] = [words.get(axis, value) for axis, value in enumerate(offset.axes)]
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
    block.refuse_if(words.keys() - {2}, code, "sets other tool offsets than Z", "Z, the tool's length")
    tool.length = words.get(2, tool.length)
    tool.diameter = tool.diameter if radius is None else 2.0 * radius * state.length_scale


def shift(state: State, block: CurrentBlock, code: str) -> None:
    """G52: the shift; G92: the shift that gives the present point these numbers.

    G92.1: no shift; G92.2: none for now; G92.3: the one before G92.2.
    """
    refuse_while_rotated(state, block, code, "shifts the zero")
    forget_polar(state)
    frames = state.frames
    if code in ("G52", "G92"):
        words = axis_words(state, block)
        block.refuse_if(not words, code, "without axis words", "X, Y, Z, A, B or C")
        if code == "G92":
            know_position(state, block, block.codes[code], words)
            here = frames.to_program(frames.position)
            words = {axis: frames.g92[axis] + (here[axis] - value) for axis, value in words.items()}
        frames.g92 = [words.get(axis, value) for axis, value in enumerate(frames.g92)]
    else:
        frames.g92 = list(frames.g92_kept) if code == "G92.3" else [0.0] * 6
    if code != "G92.2":
        frames.g92_kept = list(frames.g92)
    _zero_moved(state)


def rotation(state: State, block: CurrentBlock, code: str) -> None:
    """G68 X Y R: programmed points turn about X, Y (absolute; without them about the present point). G69: rotation off.

    On Fanuc's controls incremental words between G68 and the first absolute ones turn about the tool's place at
    G68: from there on they are turned steps, as they are here.
    """
    frames = state.frames
    here = frames.to_program(frames.position)
    new = None if code == "G69" else _rotation_of(state, block, block.codes[code], here)
    if new is not None and frames.rotation is not None and frames.rotation[:2] != new[:2]:
        raise block.fail(code, "with another centre while a rotation is in force", "G69 before it")
    frames.rotation = new
    if math.dist(here[:2], frames.to_program(frames.position)[:2]) > SAME_PLACE_MM:
        state.unsettled = code


def _rotation_of(state: State, block: CurrentBlock, word: Word, here: list[float]) -> Rotation:
    present, angle = state.frames.rotation, block.take("R")
    elsewhere = state.plane != "G17" or any(block.has(letter) for letter in "ZABCIJK")
    block.refuse_if(elsewhere, word, "outside of G17, or beside Z, A, B, C, I, J, K", "G68 X Y R in G17")
    if angle is None:
        raise block.fail(word, "without its angle, which is then a parameter of the control", "R in degrees")
    block.refuse_if(present and not state.absolute, word, "in G91 under a rotation, where R may add", "G69 before it")
    center = axis_words(state, block)
    if present is not None and not center:
        return (present[0], present[1], angle)
    return (center.get(0, here[0]), center.get(1, here[1]), angle)


_FANUC = f"{FANUC}, Additional workpiece coordinate systems (G54.1)"
_G154 = {"G154": "additional work offset (Haas)"}
_STANDARD = {code: f"work offset {number}" for number, code in enumerate(WORK_OFFSETS, 1)}
_NUMBERED = dict.fromkeys(NUMBERED, "additional work offset (Haas: G154 P1 to P20)")
_ROTATION = f"{FANUC} of the series 16 and 15i, Coordinate system rotation (G68, G69)"
COORDINATE_CODES = (
    *family(_STANDARD, "work offset", work_offset, g_codes("G54-G59.3")),
    Code("G54.1", "work offset", additional_offset, "additional work offset", _FANUC, ("generic", "fanuc")),
    *family(_G154, "work offset", additional_offset, f"{HAAS}, G154", ("generic", "haas")),
    *family(_NUMBERED, "work offset", additional_offset, f"{HAAS}, G110-G129", ("haas",)),
    Code("G10", "non-modal", set_offsets, "set offsets", g_codes("G10 L1, G10 L2, G10 L20"), takes_axes=True),
    Code("G52", "non-modal", shift, "local shift", g_codes("G52"), takes_axes=True),
    Code("G92", "non-modal", shift, "shift", g_codes("G92"), takes_axes=True),
    *family({"G92.1": "no shift any more", "G92.2": "shift suspended"}, "non-modal", shift, g_codes("G92.1 G92.2")),
    Code("G92.3", "non-modal", shift, "shift restored", g_codes("G92.3")),
    Code("G68", "rotation", rotation, "rotated coordinates", _ROTATION, takes_axes=True),
    Code("G69", "rotation", rotation, "rotation off", _ROTATION),
)
