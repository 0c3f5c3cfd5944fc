"""Work offsets: G54 to G59.3, G54.1, G154, G110 to G129."""

from toolpath_stiff.nc.codes.code import FANUC, HAAS, Code, family, g_codes
from toolpath_stiff.nc.codes.polar import forget_polar
from toolpath_stiff.nc.codes.unsettled import refuse_while_rotated, zero_moved
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import ADDITIONAL_OFFSETS, WORK_OFFSETS
from toolpath_stiff.nc.words import Word

FIRST_NUMBERED = 110  # G110 to G129


def work_offset(state: State, block: CurrentBlock, code: str) -> None:
    """G54 to G59.3: that work offset from here on; G54 P of Fanuc's controls is G54.1 P."""
    word = block.codes[code]
    if code == "G54" and "P" in block.values and state.dialect.name == "fanuc":
        _additional(state, block, word, "G54.1", block.whole("P", word))
        return
    _other_offset(state, block, word, WORK_OFFSETS.index(code))


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
        hint = f'give it in the controller file: [offsets] "{code} P{number}" = [x, y, z]'
        raise block.fail(word, f"is {code} P{number}, an offset that nothing defines", hint=hint)
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


_FANUC = f"{FANUC}, Additional workpiece coordinate systems (G54.1)"
_STANDARD = {code: f"work offset {number}" for number, code in enumerate(WORK_OFFSETS, 1)}
_NUMBERED = {
    f"G{number}": "additional work offset (Haas: G154 P1 to P20)"
    for number in range(FIRST_NUMBERED, FIRST_NUMBERED + 20)
}
WORK_OFFSET_CODES = (
    *family(_STANDARD, "work offset", work_offset, g_codes("G54-G59.3")),
    Code("G54.1", "work offset", additional_offset, "additional work offset", _FANUC, ("generic", "fanuc")),
    Code(
        "G154", "work offset", additional_offset, "additional work offset (Haas)", f"{HAAS}, G154", ("generic", "haas")
    ),
    *family(_NUMBERED, "work offset", numbered_offset, f"{HAAS}, G110-G129", ("haas",)),
)
