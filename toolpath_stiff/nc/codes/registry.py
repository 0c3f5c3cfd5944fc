"""The table of codes, and what the user is told of each. A new code is a row beside its function, in one of the files.

Codes and modal groups follow LinuxCNC (its manual, "G-Code Overview", modal groups), because its interpreter is what
the results are compared with; polar words and rotation, which it does not have, follow Fanuc's controls. Codes that
leave the path alone, and codes that are refused with the reason, have their rows here.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from toolpath_stiff.nc.codes.code import Alias, Code, Refused, code_name, g_codes, holds_anyway, m_codes
from toolpath_stiff.nc.codes.cutter import CUTTER_CODES
from toolpath_stiff.nc.codes.drilling import DRILLING_CODES
from toolpath_stiff.nc.codes.modes import FEED_CODES, FLOW_CODES, MODE_ALIASES, MODE_CODES
from toolpath_stiff.nc.codes.motion import ARC_CODES, CORNER_CODES, STRAIGHT_CODES
from toolpath_stiff.nc.codes.offsets import OFFSET_CODES
from toolpath_stiff.nc.codes.other_controls import OTHER_CODES, OTHER_REFUSED
from toolpath_stiff.nc.codes.points import POLAR_CODES, ROTATION_CODES
from toolpath_stiff.nc.codes.saved import SAVED_CODES
from toolpath_stiff.nc.codes.synchronised import SYNCHRONISED_CODES
from toolpath_stiff.nc.codes.tools import TOOL_ALIASES, TOOL_CODES
from toolpath_stiff.nc.state import LATHE_HINT, POINT_WORDS, CurrentBlock, State

WAIT_FOR_INPUT = 66  # LinuxCNC, M-Codes, M66: P or E, and L with the kind of wait


def path_control(state: State, block: CurrentBlock, code: str) -> None:
    """G61, G61.1, G64: P and Q are tolerances of the blending, which does not enter."""
    block.take("P")
    block.take("Q")


def m_parameters(state: State, block: CurrentBlock) -> None:
    """M codes may carry P, Q, E, R, S words, M66 an L too; unless the block moves, these are theirs."""
    moves = "motion" in block.groups or "non-modal" in block.groups or any(block.has(letter) for letter in POINT_WORDS)
    if not moves:
        waits = any(word.letter == "M" and word.value == WAIT_FOR_INPUT for word in block.block.words)
        for letter in "PQERSL" if waits else "PQERS":
            block.take(letter)


def look_ahead(state: State, block: CurrentBlock, code: str) -> None:
    """G5 P, G5.1 Q, G8 P, G103 P, G187 P E: how a control plans ahead. With other words G5 and G5.1 are splines."""
    letters = {word.letter for word in block.block.words} - {"G", "M", "F", "S", "T"}
    taken = PLANNING[code]
    if code in SPLINES and (letters - set(taken) or not letters):
        raise block.fail(code, "is a spline, which is not supported", hint=_LINES_AND_ARCS)
    for letter in taken:
        if block.take(letter) is not None and code == "G8":  # alone it is a mode of lathes that holds anyway
            state.note(block.line, block.codes[code], _PLANNING)


def scaling_off(state: State, block: CurrentBlock, code: str) -> None:
    """G50 alone; with S or axis words it is a lathe's."""
    letter = next((letter for letter in "SXYZUVW" if letter in block.values), None)
    if letter is not None:
        raise block.fail(
            code,
            f"with {letter} is a lathe's code (the limit of its speed, or a shift), and a lathe's X is a diameter",
            hint=LATHE_HINT,
        )


def dynamic_offset(state: State, block: CurrentBlock, code: str) -> None:
    """G254: the work offset follows the part where a rotary axis is turned; G255: no longer."""
    if code == "G254":
        state.warnings.append(
            f"line {block.line}: {block.codes[code].text} makes the work offset follow the part where a rotary axis is "
            "turned, which is not acted upon"
        )


_FANUC, _HAAS = "Fanuc, operator's manuals", "Haas, mill operator's manual"


GENERIC_HAAS = ("generic", "haas")


PLANNING = {
    "G5": "P",
    "G5.1": "QR",
    "G5.4": "Q",
    "G8": "P",
    "G103": "P",
    "G187": "PE",
}  # code -> the words that it takes


SPLINES = ("G5", "G5.1")


_PLANNING = "how the control plans ahead: the path is taken as programmed"


_LINES_AND_ARCS = "post the program with arcs and lines"


_EXACT_STOP = "exact stop: corners are taken as programmed anyway"


_COOLANT = m_codes("M7 M8 M9")


PASSIVE_CODES = (
    Code(
        "G8", "lathe diameter", look_ahead, "lathe radius mode; with P: look-ahead",
        "LinuxCNC, G-Codes, G8; Fanuc, operator's manuals, Advanced preview control (G08)", label="lathe diameter",
    ),
    Code(
        "G5", "look-ahead", look_ahead, "high-speed machining, with P alone",
        "Fanuc, operator's manuals, High speed cycle machining (G05)", listed=_PLANNING,
    ),
    Code(
        "G5.1", "look-ahead", look_ahead, "contour control, with Q alone",
        "Fanuc, operator's manuals, AI contour control (G05.1)", listed=_PLANNING,
    ),
    Code(
        "G5.4", "look-ahead", look_ahead, "high-speed control", "Fanuc, operator's manuals, HRV3 (G05.4)",
        ("generic", "fanuc"), listed=_PLANNING,
    ),
    Code("G9", "exact stop", holds_anyway, "exact stop", f"{_FANUC}, Exact stop (G09)", listed=_EXACT_STOP),
    Code("G103", "look-ahead", look_ahead, "limit of the look-ahead", f"{_HAAS}, G103", GENERIC_HAAS, listed=_PLANNING),
    Code("G187", "look-ahead", look_ahead, "smoothness", f"{_HAAS}, G187", GENERIC_HAAS, listed=_PLANNING),
    Code(
        "G254", "dynamic offset", dynamic_offset, "dynamic work offset", f"{_HAAS}, G254", GENERIC_HAAS,
        listed="the work offset follows the part",
    ),
    Code(
        "G255", "dynamic offset", dynamic_offset, "no dynamic work offset", f"{_HAAS}, G255", GENERIC_HAAS,
        listed="the work offset follows the part no longer",
    ),
    Code(
        "M29", "M rigid tapping", holds_anyway, "rigid tapping", f"{_FANUC}, Rigid tapping (M29)", ("generic", "fanuc"),
        listed="rigid tapping",
    ),
    Code(
        "G50", "scaling", scaling_off, "scaling off", "Fanuc, operator's manuals, Scaling (G50, G51)", label="scaling"
    ),
    Code("G61", "path control", path_control, "exact path", g_codes("G61"), listed=_EXACT_STOP),
    Code("G61.1", "path control", path_control, "exact stop", g_codes("G61.1"), listed=_EXACT_STOP),
    Code(
        "G64", "path control", path_control, "path blending", g_codes("G64"),
        listed="path blending: the path is taken as programmed, corners included",
    ),
    Code("M3", "M spindle", holds_anyway, "spindle on", m_codes("M3 M4 M5")),
    Code("M4", "M spindle", holds_anyway, "spindle on, reversed", m_codes("M3 M4 M5")),
    Code("M5", "M spindle", holds_anyway, "spindle off", m_codes("M3 M4 M5")),
    Code("M19", "M spindle", holds_anyway, "spindle orientation", m_codes("M19"), listed="spindle orientation"),
    Code("M7", "M coolant", holds_anyway, "mist coolant on", _COOLANT, listed="coolant"),
    Code("M8", "M coolant", holds_anyway, "flood coolant on", _COOLANT, listed="coolant"),
    Code("M9", "M coolant", holds_anyway, "coolant off", _COOLANT, listed="coolant"),
    *(
        Code(code, "M overrides", holds_anyway, "speed and feed overrides", m_codes("M48 - M53"), listed="overrides")
        for code in ("M48", "M49", "M50", "M51", "M52", "M53")
    ),
)  # fmt: skip


_OTHER_PLANE = ("a plane of the U, V, W axes", "this machine has X, Y, Z, A, B, C", g_codes("G17 - G19.1"))


_PROBING = ("probing", "leave probing out", g_codes("G38.2 - G38.5"))


_POCKET = (
    "a circular pocket, whose way to its circles and between them is drawn in the manual without numbers",
    "post the program with arcs",
    f"{_HAAS}, G12 and G13",
)


_POLAR_PLANE = (
    "milling in polar coordinates on a rotary axis",
    "post X, Y, Z of the tool tip",
    f"{_FANUC}, Polar coordinate interpolation (G12.1, G13.1)",
)


_LATHE_CYCLE = ("a lathe cycle", "this is a mill", g_codes("G70 Lathe finishing cycle; G71 G72 Lathe roughing cycles"))


_MOVES = "post the moves of the cycle"


REFUSED_CODES = (
    Refused("G5.2", "a NURBS curve", _LINES_AND_ARCS, g_codes("G5.2 G5.3")),
    Refused("G5.3", "a NURBS curve", _LINES_AND_ARCS, g_codes("G5.2 G5.3")),
    Refused("G7", "lathe diameter mode", "this is a mill", g_codes("G7")),
    Refused("G12", *_POCKET),
    Refused("G12.1", *_POLAR_PLANE),
    Refused("G13", *_POCKET),
    Refused("G17.1", *_OTHER_PLANE),
    Refused("G18.1", *_OTHER_PLANE),
    Refused("G19.1", *_OTHER_PLANE),
    Refused("G38.2", *_PROBING),
    Refused("G38.3", *_PROBING),
    Refused("G38.4", *_PROBING),
    Refused("G38.5", *_PROBING),
    Refused("G43.2", "an added tool length", "put the whole length into the tool table", g_codes("G43.2")),
    Refused("G51", "scaling", "post the program at its size", f"{_FANUC}, Scaling (G50, G51)"),
    Refused(
        "G68.2", "a tilted work plane", "post X, Y, Z, A, B, C of the tool tip",
        f"{_FANUC}, Tilted working plane indexing (G68.2)",
    ),
    *(Refused(code, *_LATHE_CYCLE) for code in ("G71.1", "G71.2", "G72", "G72.1", "G72.2")),
    Refused(
        "G150", "a pocket cycle of one control, around a subprogram's contour", "post the program with lines and arcs",
        f"{_HAAS}, G150",
    ),
    *OTHER_REFUSED,
    Refused("G87", "back boring", _MOVES, g_codes("G87")),
    Refused("G88", "boring with manual feed out", _MOVES, g_codes("G88")),
)  # fmt: skip


UNDERSTOOD = (
    *STRAIGHT_CODES, *ARC_CODES, *DRILLING_CODES, *MODE_CODES, *POLAR_CODES, *ROTATION_CODES, *OFFSET_CODES,
    *FEED_CODES, *TOOL_CODES, *FLOW_CODES, *CUTTER_CODES, *SAVED_CODES, *SYNCHRONISED_CODES, *PASSIVE_CODES,
    *CORNER_CODES, *OTHER_CODES,
)  # fmt: skip


def table(codes: Iterable[Code]) -> dict[str, Code]:
    """Name -> code. Raises `ValueError` for a name that is there twice."""
    codes_by_name: dict[str, Code] = {}
    for code in codes:
        if code.name in codes_by_name:
            raise ValueError(f"{code.name} is in the table twice")
        codes_by_name[code.name] = code
    return codes_by_name


CODES: dict[str, Code] = table(UNDERSTOOD)


REFUSED: dict[str, Refused] = {code.name: code for code in REFUSED_CODES}


ALIASES: dict[str, Alias] = {alias.name: alias for alias in (*MODE_ALIASES, *TOOL_ALIASES)}


INCH_METRIC = {alias.name: alias.code for alias in MODE_ALIASES}  # where the dialect has them


LISTED = {code.name: code.listed for code in CODES.values() if code.listed}


# What a code that is not read would change.
CHANGES = {
    "G41 G41.1 G42 G42.1": "the whole path, by the tool's radius",
    "G5 G5.1 G5.2 G5.3": "the path between its points",
    "G43.4 G43.5": "the path of the tip wherever a rotary axis moves",
    "G43.2": "the height of the tip",
    "G51": "the size of the path",
    "G68.2": "the whole path: it is turned in space",
    "M97 M98": "the path by whatever is called",
    "G33 G33.1 G76": "the path by the thread's moves",
    "G87 G88 G12 G13 G150 G70 G71 G71.1 G71.2 G72 G72.1 G72.2": "the path by the cycle's moves",
    "G12.1": "the whole path: X and C are polar",
    "G51.1 G101": "the whole path: it is mirrored",
    "G47": "the path by the engraving's moves",
    "G44": "the height of the tip",
    "G53.1 G107": "the whole path, turned with a rotary axis",
    "G31": "where the tool stops, which only the machine knows",
    "M72 M73": "whatever depends on the modes in force",
    "G38.2 G38.3 G38.4 G38.5": "where the tool stops, which only the machine knows",
    "G7": "the size of X",
}


BY_CODE = {code: changes for codes, changes in CHANGES.items() for code in codes.split()}


# What a code that is read and not acted upon would change.
LISTED_CHANGES = {
    **dict.fromkeys(("G61", "G61.1", "G64", "G9"), "corners, which a control rounds or stops at, and so the time"),
    **dict.fromkeys(("G96", "M48", "M49", "M50", "M51", "M52", "M53"), "speeds and times"),
    **dict.fromkeys(("G5", "G5.1", "G5.4", "G8", "G103", "G187"), "corners, by the control's tolerance, and the time"),
    "G254": "where the part is, wherever a rotary axis is turned",
}


BY_TEXT = {
    "O word": "the path by whatever is called",
    **dict.fromkeys(("variables", "expressions"), "every coordinate that depends on them"),
}


FIRST_CODE = re.compile(r"([GMgm]) *0*(\d{1,9}(?:\.\d)?)(?![\d.])")


def code_meaning(name: str) -> str:
    """What a code is taken for, in a few words.

    Examples
    --------
    >>> code_meaning("G2"), code_meaning("M8"), code_meaning("G87")
    ('clockwise arc', 'coolant: not acted upon', 'back boring: not supported')
    """
    if name in CODES:
        code = CODES[name]
        return f"{code.listed}: not acted upon" if code.listed else code.label or code.meaning
    if name in REFUSED:
        return f"{REFUSED[name].what}: not supported"
    if name in ALIASES and ALIASES[name].label:
        return ALIASES[name].label
    return "not known" if name.startswith("G") else "an M code of one control: not acted upon"


def would_change(text: str, listed: bool = False) -> str:
    """What the word at the beginning of `text` would change of the path or its time; "" if nothing is known.

    `listed`: it was read and is not acted upon; else it was refused.

    Examples
    --------
    >>> would_change("G41 D1")
    "the whole path, by the tool's radius"
    >>> would_change("G419 is not a G code that is known")
    ''
    """
    first_code = FIRST_CODE.match(text)
    if first_code is None:
        return next((changes for beginning, changes in BY_TEXT.items() if text.startswith(beginning)), "")
    code = code_name(first_code[1].upper(), float(first_code[2]))
    if code[0] == "M" and code not in CODES and code not in REFUSED:
        return "what is not known: it may run anything on its control"
    return (LISTED_CHANGES if listed else BY_CODE).get(code, "")
