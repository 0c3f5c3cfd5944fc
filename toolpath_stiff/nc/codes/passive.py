"""Codes that leave the path alone: look-ahead, spindle, coolant, overrides, zones, and modes switched off.

What Fanuc's and Haas' programs begin with ("safe start") is here: it switches off what is refused where it is on.
"""

from toolpath_stiff.nc.codes.code import FANUC, HAAS, Code, family, g_codes, holds_anyway, m_codes
from toolpath_stiff.nc.codes.feeds import turn_spindle
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.state import LATHE_HINT, CurrentBlock, State
from toolpath_stiff.nc.words import AXES

WAIT_FOR_INPUT = 66  # LinuxCNC, M-Codes, M66: P or E, and L with the kind of wait
# Code -> the words that it takes. With other words, or none, G5 and G5.1 are splines.
TAKEN = {
    "G5": "P", "G5.1": "QR", "G5.4": "Q", "G8": "P", "G103": "P", "G187": "PE", "G61": "PQ", "G61.1": "PQ", "G64": "PQ",
    "G22": (*AXES, *"IJK"), "G25": "PQRI", "G26": "PQRI",
}  # fmt: skip
SPLINES = ("G5", "G5.1")


def m_parameters(state: State, block: CurrentBlock) -> None:
    """Take P, Q, E, R, S words beside M codes (M66: L too) as the M code's, unless the block moves."""
    moves = "motion" in block.groups or "non-modal" in block.groups or any(block.has(letter) for letter in AXES)
    if not moves:
        waits = any(word.letter == "M" and word.value == WAIT_FOR_INPUT for word in block.block.words)
        for letter in "PQERSL" if waits else "PQERS":
            block.take(letter)


def take_words(state: State, block: CurrentBlock, code: str) -> None:
    """G61, G64 P Q: tolerances; G5 P, G5.1 Q, G8 P, G103 P, G187 P E: look-ahead; G22, G25, G26: zones, the spindle."""
    taken = TAKEN[code]
    letters = {word.letter for word in block.block.words} - {*"GMFST"}
    spline = code in SPLINES and (letters - {*taken} or not letters)
    block.refuse_if(spline, code, "is a spline, which is not supported", hint="post the program with arcs and lines")
    for letter in taken:
        if block.take(letter) is not None and code == "G8":  # alone it is a mode of lathes that holds anyway
            state.note(block.line, block.codes[code], _PLANNING)


def scaling_off(state: State, block: CurrentBlock, code: str) -> None:
    """G50 alone: scaling off; with S or axis words it is a lathe's code."""
    letter = next((letter for letter in "SXYZUVW" if letter in block.values), None)
    block.refuse_if(letter, code, f"with {letter} is a lathe's code, and a lathe's X is a diameter", hint=LATHE_HINT)


def dynamic_offset(state: State, block: CurrentBlock, code: str) -> None:
    """G254: the work offset follows the part where a rotary axis is turned; G255: no longer."""
    if code == "G254":
        state.warnings.append(Remark(f"{block.codes[code].text}, not acted upon: {_FOLLOWS}", block.line))


_PLANNING = "how the control plans ahead: the path is taken as programmed"
_EXACT = "exact stop: corners are taken as programmed anyway"
_BLENDED = "path blending: the path is taken as programmed, corners included"
_FOLLOWS = "the work offset follows the part where a rotary axis is turned"
_OFF = "none is on, since switching it on is refused"
_ZONE, _SPEED = "the zone that the tool must not enter", "the spindle's speed"
FANUC_ONLY, HAAS_ONLY = ("generic", "fanuc"), ("generic", "haas")
_SPINDLE = {"M3": "spindle on", "M4": "spindle on, reversed", "M5": "spindle off"}
_BOTH = {"M13": "spindle on, with coolant", "M14": "spindle on, reversed, with coolant"}
_COOLANT = {"M7": "mist coolant on", "M8": "flood coolant on", "M9": "coolant off"}
_OVERRIDES = dict.fromkeys(("M48", "M49", "M50", "M51", "M52", "M53"), "speed and feed overrides")
_WATCHED = {"G25": "spindle speed not watched", "G26": "spindle speed watched"}
_DYNAMIC = {"G254": "dynamic work offset", "G255": "no dynamic work offset"}
_G13 = f"{FANUC}, G13.1"
_AHEAD = {"G103": "limit of the look-ahead", "G187": "smoothness"}
PASSIVE_CODES = (
    Code("G8", "lathe diameter", take_words, "lathe radius mode; with P: look-ahead", f"{g_codes('G8')}; {FANUC}, G08"),
    Code("G5", "look-ahead", take_words, "high-speed machining, with P alone", f"{FANUC}, G05", listed=_PLANNING),
    Code("G5.1", "look-ahead", take_words, "contour control, with Q alone", f"{FANUC}, G05.1", listed=_PLANNING),
    Code("G5.4", "look-ahead", take_words, "high-speed control", f"{FANUC}, G05.4", FANUC_ONLY, listed=_PLANNING),
    *family(_AHEAD, "look-ahead", take_words, f"{HAAS}, G103, G187", HAAS_ONLY, _PLANNING),
    Code("G9", "exact stop", holds_anyway, "exact stop", f"{FANUC}, Exact stop (G09)", listed=_EXACT),
    *family(_DYNAMIC, "dynamic offset", dynamic_offset, f"{HAAS}, G254, G255", HAAS_ONLY, _FOLLOWS),
    *family({"M29": "rigid tapping"}, "M rigid tapping", holds_anyway, f"{FANUC}, M29", FANUC_ONLY, "rigid tapping"),
    Code("G50", "scaling", scaling_off, "scaling off", f"{FANUC}, Scaling (G50, G51)"),
    Code("G61", "path control", take_words, "exact path", g_codes("G61"), listed=_EXACT),
    Code("G61.1", "path control", take_words, "exact stop", g_codes("G61.1"), listed=_EXACT),
    Code("G64", "path control", take_words, "path blending", g_codes("G64"), listed=_BLENDED),
    *family(_SPINDLE, "M spindle", turn_spindle, m_codes("M3 M4 M5")),
    Code("M19", "M spindle", turn_spindle, "spindle orientation", m_codes("M19"), listed="spindle orientation"),
    *family(_BOTH, "M spindle", turn_spindle, f"{FANUC}, builders' M codes", FANUC_ONLY, listed="coolant"),
    *family(_COOLANT, "M coolant", holds_anyway, m_codes("M7 M8 M9"), listed="coolant"),
    *family(_OVERRIDES, "M overrides", holds_anyway, m_codes("M48 - M53"), listed="overrides"),
    *family({"G13.1": "polar interpolation off"}, "polar interpolation", holds_anyway, _G13, FANUC_ONLY, _OFF),
    Code("G50.1", "mirror image", holds_anyway, "mirror image off", f"{FANUC}, G50.1", FANUC_ONLY, listed=_OFF),
    Code("G100", "mirror image", holds_anyway, "mirror image off", f"{HAAS}, G100", HAAS_ONLY, listed=_OFF),
    Code("G22", "stroke check", take_words, "stored stroke check on", f"{FANUC}, G22", FANUC_ONLY, None, True, _ZONE),
    Code("G23", "stroke check", holds_anyway, "stored stroke check off", f"{FANUC}, G23", FANUC_ONLY, listed=_ZONE),
    *family(_WATCHED, "speed watch", take_words, f"{FANUC}, G25, G26", FANUC_ONLY, _SPEED),
    *family({"G62": "corner override"}, "path control", holds_anyway, f"{FANUC}, G62", FANUC_ONLY, "slower feed"),
    *family({"G63": "tapping mode"}, "path control", holds_anyway, f"{FANUC}, G63", FANUC_ONLY, "no override"),
)
