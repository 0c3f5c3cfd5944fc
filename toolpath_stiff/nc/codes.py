"""What each G and M code means to a tool path: acted upon, harmless, or refused with the reason.

Codes and modal groups follow LinuxCNC (its manual, "G-Code overview", modal groups), because its interpreter is what
the results are compared with; polar words and rotation, which it does not have, follow Fanuc's controls.
"""

from __future__ import annotations

MOTION, PLANE, DISTANCE, ARC_DISTANCE = "motion", "plane", "distance", "arc distance"
UNITS, FEED_MODE, CUTTER, LENGTH = "units", "feed mode", "cutter compensation", "tool length"
OFFSET, RETRACT, ONCE = "work offset", "cycle return", "non-modal"
PATH_CONTROL, SPINDLE_MODE, DIAMETER = "path control", "spindle mode", "lathe diameter"

CYCLES = ("G73", "G81", "G82", "G83", "G85", "G89")
ARCS = ("G2", "G3")

# G codes that are acted upon, or that say what holds anyway: code -> modal group.
G_GROUPS: dict[str, str] = {
    **dict.fromkeys(("G0", "G1", *ARCS, *CYCLES, "G80"), MOTION),
    **dict.fromkeys(("G17", "G18", "G19"), PLANE),
    **dict.fromkeys(("G90", "G91"), DISTANCE),
    **dict.fromkeys(("G90.1", "G91.1"), ARC_DISTANCE),
    **dict.fromkeys(("G20", "G21"), UNITS),
    **dict.fromkeys(("G93", "G94", "G95"), FEED_MODE),
    **dict.fromkeys(("G40",), CUTTER),
    **dict.fromkeys(("G43", "G43.1", "G43.4", "G49"), LENGTH),
    **dict.fromkeys(("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"), OFFSET),
    **dict.fromkeys(("G54.1", "G154"), OFFSET),
    **dict.fromkeys(("G98", "G99"), RETRACT),
    **dict.fromkeys(("G4", "G10", "G28", "G28.1", "G30", "G30.1", "G52", "G53"), ONCE),
    **dict.fromkeys(("G92", "G92.1", "G92.2", "G92.3"), ONCE),
    **dict.fromkeys(("G61", "G61.1", "G64"), PATH_CONTROL),
    **dict.fromkeys(("G96", "G97"), SPINDLE_MODE),
    **dict.fromkeys(("G8",), DIAMETER),
    **dict.fromkeys(("G15", "G16"), "polar"),
    **dict.fromkeys(("G68", "G69"), "rotation"),
    "G50": "scaling",
}
HOLDS_TIP = "G43.4"  # tool centre point control
INCH_METRIC = {"G70": "G20", "G71": "G21"}  # where the dialect has them
ADDITIONAL_OFFSETS = {"G54.1": 300, "G154": 99}  # Fanuc's and Haas', numbered by P up to that
WORK_OFFSETS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")

# Harmless G codes: the path does not change, the user is told.
G_HARMLESS = {
    "G61": "exact stop: corners are taken as programmed anyway",
    "G61.1": "exact stop: corners are taken as programmed anyway",
    "G64": "path blending: the path is taken as programmed, corners included",
    "G96": "constant surface speed: the spindle speed does not enter",
}

CENTRE_PATH = "post the path of the tool centre, or give --interpreter linuxcnc"
# G codes that change the path, or what a force does to it, in a way that is not supported.
G_REFUSED = {
    "G5": ("a spline", "post the program with arcs and lines"),
    "G5.1": ("a spline", "post the program with arcs and lines"),
    "G5.2": ("a NURBS curve", "post the program with arcs and lines"),
    "G5.3": ("a NURBS curve", "post the program with arcs and lines"),
    "G7": ("lathe diameter mode", "this is a mill"),
    "G12": ("a pocket cycle of one control", "post the program with arcs"),
    "G13": ("a pocket cycle of one control", "post the program with arcs"),
    "G17.1": ("a plane of the U, V, W axes", "this machine has X, Y, Z, A, B, C"),
    "G18.1": ("a plane of the U, V, W axes", "this machine has X, Y, Z, A, B, C"),
    "G19.1": ("a plane of the U, V, W axes", "this machine has X, Y, Z, A, B, C"),
    "G33": ("spindle-synchronised motion", "leave threading out"),
    "G33.1": ("rigid tapping", "leave tapping out"),
    "G38.2": ("probing", "leave probing out"),
    "G38.3": ("probing", "leave probing out"),
    "G38.4": ("probing", "leave probing out"),
    "G38.5": ("probing", "leave probing out"),
    "G41": ("cutter compensation", CENTRE_PATH),
    "G41.1": ("cutter compensation", CENTRE_PATH),
    "G42": ("cutter compensation", CENTRE_PATH),
    "G42.1": ("cutter compensation", CENTRE_PATH),
    "G43.2": ("an added tool length", "put the whole length into the tool table"),
    "G51": ("scaling", "post the program at its size"),
    "G65": ("a macro call", "expand macros before analysing"),
    "G66": ("a macro call", "expand macros before analysing"),
    "G68.2": ("a tilted work plane", "post X, Y, Z, A, B, C of the tool tip"),
    "G72": ("a lathe cycle", "this is a mill"),
    "G74": ("left-hand tapping", "leave tapping out"),
    "G76": ("a threading cycle", "leave threading out"),
    "G84": ("right-hand tapping", "leave tapping out"),
    "G86": ("boring with spindle stop", "post the moves of the cycle"),
    "G87": ("back boring", "post the moves of the cycle"),
    "G88": ("boring with manual feed out", "post the moves of the cycle"),
}

M_STOP, M_TOOL, M_SPINDLE, M_COOLANT = "stop", "tool change", "spindle", "coolant"
M_SUBPROGRAM = "subprogram"
# M codes that are acted upon, or that no tool path depends on and every program has.
M_GROUPS: dict[str, str] = {
    **dict.fromkeys(("M0", "M1", "M2", "M30", "M60"), M_STOP),
    **dict.fromkeys(("M6", "M61"), M_TOOL),
    **dict.fromkeys(("M3", "M4", "M5", "M19"), M_SPINDLE),
    **dict.fromkeys(("M7", "M8", "M9"), M_COOLANT),
    **dict.fromkeys(("M97", "M98", "M99"), M_SUBPROGRAM),
    **dict.fromkeys(("M48", "M49", "M50", "M51", "M52", "M53"), "overrides"),
}
M_QUIET = ("M0", "M1", "M2", "M30", "M60", "M6", "M61", "M3", "M4", "M5", "M97", "M98", "M99")
M_HARMLESS = {
    "M7": "coolant",
    "M8": "coolant",
    "M9": "coolant",
    "M19": "spindle orientation",
    "M48": "overrides",
    "M49": "overrides",
    "M50": "overrides",
    "M51": "overrides",
    "M52": "overrides",
    "M53": "overrides",
}
M_REFUSED = {
    "M70": ("saved modal state", "post the program without M70 to M73"),
    "M71": ("saved modal state", "post the program without M70 to M73"),
    "M72": ("saved modal state", "post the program without M70 to M73"),
    "M73": ("saved modal state", "post the program without M70 to M73"),
}


def code_name(letter: str, value: float) -> str:
    """`G` and 59.3 to "G59.3", `G` and 1.0 to "G1"."""
    return f"{letter}{value:g}"


MEANINGS = {
    "G0": "rapid", "G1": "feed", "G2": "clockwise arc", "G3": "counter-clockwise arc", "G4": "dwell",
    "G10": "set offsets", "G15": "Cartesian words", "G16": "polar words", "G17": "plane XY", "G18": "plane ZX",
    "G19": "plane YZ", "G20": "inch", "G21": "mm", "G28": "to the first reference point",
    "G30": "to the second reference point", "G40": "cutter compensation off", "G43": "tool length",
    "G43.1": "tool length in the block", "G43.4": "tool centre point control",
    "G234": "tool centre point control (Haas)",
    "G49": "tool length off", "G52": "local shift", "G53": "machine coordinates",
    "G54.1": "additional work offset", "G154": "additional work offset (Haas)",
    "G68": "rotated coordinates", "G69": "rotation off", "G73": "chip-breaking drilling", "G80": "motion mode off",
    "G81": "drilling", "G82": "drilling with dwell", "G83": "peck drilling", "G85": "boring, feed out",
    "G89": "boring with dwell, feed out", "G90": "absolute", "G91": "incremental", "G90.1": "absolute arc centres",
    "G91.1": "incremental arc centres", "G92": "shift", "G93": "inverse-time feed", "G94": "feed per minute",
    "G95": "feed per revolution", "G98": "cycles return to their level", "G99": "cycles return to R",
    "M0": "stop", "M1": "optional stop", "M2": "end", "M30": "end", "M60": "stop", "M3": "spindle on",
    "M4": "spindle on, reversed", "M5": "spindle off", "M6": "tool change", "M61": "tool number",
    "M97": "call by line number (Haas)", "M98": "subprogram call", "M99": "subprogram end",
}  # fmt: skip
# What a code that is not acted upon would change, by its beginning.
CHANGES = (
    (("G41", "G42"), "the whole path, by the tool's radius"),
    (("G5 ", "G5.", "G05"), "the path between its points"),
    (("G43.4", "G43.5"), "the path of the tip wherever a rotary axis moves"),
    (("G43.2",), "the height of the tip"),
    (("G51",), "the size of the path"),
    (("G68.2",), "the whole path: it is turned in space"),
    (("G65", "G66", "M97", "M98", "O word"), "the path by whatever is called"),
    (("G33", "G74", "G76", "G84"), "the path by the thread's moves"),
    (("G86", "G87", "G88", "G12", "G13", "G70", "G71", "G72"), "the path by the cycle's moves"),
    (("G38",), "where the tool stops, which only the machine knows"),
    (("G61", "G64"), "corners, which a control rounds or stops at, and so the time"),
    (("G7 ",), "the size of X"),
    (("G96", "M48", "M49", "M50", "M51", "M52", "M53"), "speeds and times"),
    (("variables", "expressions"), "every coordinate that depends on them"),
)
QUIET_M = ("M7", "M8", "M9", "M19")


def code_meaning(code: str) -> str:
    """What a code is taken for, in a few words."""
    if code in MEANINGS:
        return MEANINGS[code]
    if code in G_REFUSED or code in M_REFUSED:
        return (G_REFUSED.get(code) or M_REFUSED[code])[0] + ": not supported"
    if code in G_HARMLESS or code in M_HARMLESS:
        return (G_HARMLESS.get(code) or M_HARMLESS[code]) + ": not acted upon"
    group = G_GROUPS.get(code)
    if group is not None:
        return group
    return "not known" if code.startswith("G") else "an M code of one control: not acted upon"


def would_change(text: str) -> str:
    """What the word at the beginning of `text` would change of the path or its time; "" if nothing is known."""
    for beginnings, changes in CHANGES:
        if (text + " ").startswith(beginnings):
            return changes
    word = text.split(" ", maxsplit=1)[0]
    if word.startswith("M") and word[1:].isdigit() and f"M{int(word[1:])}" not in (*QUIET_M, *M_GROUPS):
        return "what is not known: it may run anything on its control"
    return ""
