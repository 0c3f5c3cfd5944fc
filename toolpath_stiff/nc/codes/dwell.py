"""G4, and words of time."""

from toolpath_stiff.nc.codes.code import FANUC, Code, g_codes
from toolpath_stiff.nc.controller import GENERIC, MILLISECONDS, SECONDS
from toolpath_stiff.nc.state import POINT_WORDS, CurrentBlock, State
from toolpath_stiff.units import SECONDS_PER_DAY


def dwells_by(state: State, block: CurrentBlock) -> str:
    """The word that holds the time of a block's G4: P; X on Fanuc's controls, S in Marlin; "" for no such word."""
    if "G4" not in block.codes:
        return ""
    letters = {"linuxcnc": "P", "generic": "PXS"}.get(state.dialect.name, "XP")
    return next((letter for letter in letters if letter in block.values), "")


def dwell(state: State, block: CurrentBlock, code: str) -> None:
    """G4: a pause, before the block's own moves."""
    letter = dwells_by(state, block)
    seconds = time_word(state, block, letter) if letter else None
    if not letter and state.dialect.name in ("generic", "fanuc") and "F" not in block.values:  # F: Siemens' seconds
        state.assume("G4 without a time is no pause: an exact stop (Fanuc), the end of the moves before it (Marlin)")
        seconds = 0.0
    if state.dialect.name == GENERIC.name and letter in ("X", "S"):
        word = block.values[letter]
        if letter == "X" and ("." not in word.text or any(block.has(axis) for axis in POINT_WORDS)):
            raise block.fail(
                word,
                "beside G4 is not certainly a time: without a point it counts milliseconds on Fanuc's controls",
                f"{word.text.rstrip('.')}. alone, for seconds",
                "name the control with --dialect",
            )
        state.assume(f"the {letter} of G4 is a time in seconds, as {'Fanuc' if letter == 'X' else 'Marlin'} means it")
    if seconds is None or not 0.0 <= seconds <= SECONDS_PER_DAY:
        raise block.fail(code, "needs its time", "P with the seconds, 0 or more")
    state.recorder.add_dwell(seconds)


def time_word(state: State, block: CurrentBlock, letter: str) -> float | None:
    """A time word in s; what its number counts is the dialect's."""
    value = block.take(letter)
    if value is None or state.dialect.dwell == SECONDS:
        return value
    written = block.as_written(letter)
    if "." not in written.text:
        return written.value / 1e3
    if letter == "P" and state.dialect.dwell == MILLISECONDS:
        raise block.fail(written, f"has a decimal point, which {state.dialect.name} does not allow", "milliseconds")
    return value


_SOURCE = f"{g_codes('G4')}; {FANUC}, Dwell (G04); Marlin, G004"
DWELL_CODES = (Code("G4", "non-modal", dwell, "dwell", _SOURCE, step="dwell"),)
