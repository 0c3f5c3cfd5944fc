"""Codes that leave the path alone, listed or not, and codes that are refused with the reason."""

from __future__ import annotations

from toolpath_stiff.nc.blocks import POINT_WORDS, CurrentBlock
from toolpath_stiff.nc.codes.contract import (
    CUTTER,
    DIAMETER,
    M_COOLANT,
    M_OVERRIDES,
    M_SPINDLE,
    MOTION,
    ONCE,
    PATH_CONTROL,
    SCALING,
    Code,
    Refused,
    g_codes,
    holds_anyway,
    m_codes,
)
from toolpath_stiff.nc.state import State


def path_control(state: State, block: CurrentBlock, code: str) -> None:
    """G61, G61.1, G64: P and Q are tolerances of the blending, which does not enter."""
    block.take("P")
    block.take("Q")


def m_parameters(state: State, block: CurrentBlock) -> None:
    """M codes may carry P, Q, E, R, S words; unless the block moves, these are theirs."""
    moves = MOTION in block.groups or ONCE in block.groups or any(block.has(letter) for letter in POINT_WORDS)
    if not moves:
        for letter in "PQERS":
            block.take(letter)


_EXACT_STOP = "exact stop: corners are taken as programmed anyway"
_COOLANT = m_codes("M7 M8 M9")
CODES = (
    Code("G8", DIAMETER, holds_anyway, "lathe radius mode", g_codes("G8"), label=DIAMETER),
    Code("G40", CUTTER, holds_anyway, "cutter compensation off", g_codes("G40")),
    Code(
        "G50", SCALING, holds_anyway, "scaling off", "Fanuc, operator's manuals, Scaling (G50, G51)", label=SCALING
    ),
    Code("G61", PATH_CONTROL, path_control, "exact path", g_codes("G61"), listed=_EXACT_STOP),
    Code("G61.1", PATH_CONTROL, path_control, "exact stop", g_codes("G61.1"), listed=_EXACT_STOP),
    Code(
        "G64", PATH_CONTROL, path_control, "path blending", g_codes("G64"),
        listed="path blending: the path is taken as programmed, corners included",
    ),
    Code("M3", M_SPINDLE, holds_anyway, "spindle on", m_codes("M3 M4 M5")),
    Code("M4", M_SPINDLE, holds_anyway, "spindle on, reversed", m_codes("M3 M4 M5")),
    Code("M5", M_SPINDLE, holds_anyway, "spindle off", m_codes("M3 M4 M5")),
    Code("M19", M_SPINDLE, holds_anyway, "spindle orientation", m_codes("M19"), listed="spindle orientation"),
    Code("M7", M_COOLANT, holds_anyway, "mist coolant on", _COOLANT, listed="coolant"),
    Code("M8", M_COOLANT, holds_anyway, "flood coolant on", _COOLANT, listed="coolant"),
    Code("M9", M_COOLANT, holds_anyway, "coolant off", _COOLANT, listed="coolant"),
    *(
        Code(code, M_OVERRIDES, holds_anyway, "speed and feed overrides", m_codes("M48 - M53"), listed="overrides")
        for code in ("M48", "M49", "M50", "M51", "M52", "M53")
    ),
)  # fmt: skip

_LINES_AND_ARCS = "post the program with arcs and lines"
_CENTRE_PATH = "post the path of the tool centre, or give --interpreter linuxcnc"
_FANUC, _HAAS = "Fanuc, operator's manuals", "Haas, mill operator's manual"
_OTHER_PLANE = ("a plane of the U, V, W axes", "this machine has X, Y, Z, A, B, C", g_codes("G17 - G19.1"))
_PROBING = ("probing", "leave probing out", g_codes("G38.2 - G38.5"))
_CUTTER = ("cutter compensation", _CENTRE_PATH)
_POCKET = ("a pocket cycle of one control", "post the program with arcs", f"{_HAAS}, G12 and G13")
_MACRO = ("a macro call", "expand macros before analysing", f"{_FANUC}, Custom macro (G65, G66)")
_MOVES = "post the moves of the cycle"
_SAVED = ("saved modal state", "post the program without M70 to M73")
REFUSED = (
    Refused("G5", "a spline", _LINES_AND_ARCS, g_codes("G5")),
    Refused("G5.1", "a spline", _LINES_AND_ARCS, g_codes("G5.1")),
    Refused("G5.2", "a NURBS curve", _LINES_AND_ARCS, g_codes("G5.2 G5.3")),
    Refused("G5.3", "a NURBS curve", _LINES_AND_ARCS, g_codes("G5.2 G5.3")),
    Refused("G7", "lathe diameter mode", "this is a mill", g_codes("G7")),
    Refused("G12", *_POCKET),
    Refused("G13", *_POCKET),
    Refused("G17.1", *_OTHER_PLANE),
    Refused("G18.1", *_OTHER_PLANE),
    Refused("G19.1", *_OTHER_PLANE),
    Refused("G33", "spindle-synchronised motion", "leave threading out", g_codes("G33")),
    Refused("G33.1", "rigid tapping", "leave tapping out", g_codes("G33.1")),
    Refused("G38.2", *_PROBING),
    Refused("G38.3", *_PROBING),
    Refused("G38.4", *_PROBING),
    Refused("G38.5", *_PROBING),
    Refused("G41", *_CUTTER, g_codes("G41 G42")),
    Refused("G41.1", *_CUTTER, g_codes("G41.1 G42.1")),
    Refused("G42", *_CUTTER, g_codes("G41 G42")),
    Refused("G42.1", *_CUTTER, g_codes("G41.1 G42.1")),
    Refused("G43.2", "an added tool length", "put the whole length into the tool table", g_codes("G43.2")),
    Refused("G51", "scaling", "post the program at its size", f"{_FANUC}, Scaling (G50, G51)"),
    Refused("G65", *_MACRO),
    Refused("G66", *_MACRO),
    Refused(
        "G68.2", "a tilted work plane", "post X, Y, Z, A, B, C of the tool tip",
        f"{_FANUC}, Tilted working plane indexing (G68.2)",
    ),
    Refused("G72", "a lathe cycle", "this is a mill", g_codes("G71-G72")),
    Refused("G74", "left-hand tapping", "leave tapping out", g_codes("G74")),
    Refused("G76", "a threading cycle", "leave threading out", g_codes("G76")),
    Refused("G84", "right-hand tapping", "leave tapping out", g_codes("G84")),
    Refused("G86", "boring with spindle stop", _MOVES, g_codes("G86")),
    Refused("G87", "back boring", _MOVES, g_codes("G87")),
    Refused("G88", "boring with manual feed out", _MOVES, g_codes("G88")),
    *(Refused(code, *_SAVED, m_codes("M70 - M73")) for code in ("M70", "M71", "M72", "M73")),
)  # fmt: skip
