"""CYCLE/ of a cutter-location file: holes drilled at the points that follow.

A cycle comes in pairs of a word and its value. Read is what systems agree on: `DEPTH` or `FEDTO` counts from the GOTO
point into the hole along the tool axis, `CLEAR` from it outwards (PTC, "CL Output for Holemaking Cycles"; Autodesk's
post for CAMplete; Siemens NX writes FEDTO below zero), and so do `RAPTO` and `RTRCTO` where there is no CLEAR (NX;
SolidWorks CAM, whose pecks are `1STPECK` and `SUBPECK`). `RTRCTO,AUTO` goes back to the height before the cycle (NX).
The rest is refused by name: numbers without words, whose order depends on the system; RAPTO beside CLEAR, from which
Creo counts it; RETURN,0, a plane that is not in the file.
"""

import math

from toolpath_stiff.nc.cutter_location.modes import FEED_UNITS
from toolpath_stiff.nc.cutter_location.state import CutterLocationState
from toolpath_stiff.nc.cutter_location.statements import MajorStatement, is_number
from toolpath_stiff.nc.strokes import MOST_STROKES, Drilling
from toolpath_stiff.units import SECONDS_PER_DAY

# The first word of a cycle, and with which strokes it drills: those of G81, G83 (out after each peck), G73 (chip
# breaking), G84 (a tap, which feeds out to CLEAR too), G85 (boring and reaming, which feed out).
KINDS = {
    "DRILL": "G81", "FACE": "G81", "CSINK": "G81", "DEEP": "G83", "DEEP2": "G83", "BRKCHP": "G73", "TAP": "G84",
    "BORE": "G85", "REAM": "G85",
}  # fmt: skip
PAIRS = ("DEPTH", "CLEAR", "STEP", "RETURN", "DWELL", "1STPECK")
ALIASES = {"FEDTO": "DEPTH", "INCR": "STEP", "SUBPECK": "STEP", "RTRCTO": "RETURN", "RAPTO": "CLEAR"}
EXPAND = "have the CAM system write the moves of the cycle"
BORES = "CYCLE/BORE and REAM feed out of the hole as they fed in"


def cycle(state: CutterLocationState, statement: MajorStatement) -> None:
    """Set the cycle for the points that follow; CYCLE/OFF ends it."""
    state.no_circle("CYCLE/")
    state.hole, arguments = None, list(statement.arguments)
    kind = arguments.pop(0).upper() if arguments else ""
    if kind in ("OFF", "NOMORE", "INIT"):
        return
    known = ", ".join(f"CYCLE/{known}" for known in (*KINDS, "OFF"))
    state.refuse_if(kind not in KINDS, f"CYCLE/{kind} is not supported", known, EXPAND)
    if arguments and arguments[0].upper() in ("DEEP", "BRKCHP"):  # NX, CAMplete: CYCLE/DRILL,DEEP
        kind = arguments.pop(0).upper()
    values, back_up = dict[str, float](), False
    for key, value in zip(arguments[::2], arguments[1::2], strict=False):
        name = _name_in_cycle(state, key)
        problem = "RAPTO beside CLEAR" if name == "CLEAR" else f"{key} twice"
        state.refuse_if(name in values, problem, "one of them", EXPAND)
        if key.upper() == "RTRCTO" and value.upper() == "AUTO":
            back_up = True
            continue
        values[name] = state.number(value, f"the number of {key}")
        if name == "feed":
            factor, state.hole_per_revolution = FEED_UNITS[key.upper()]
            state.hole_feed = values["feed"] * (factor or state.scale)
    state.refuse_if(len(arguments) % 2, f"{statement.shown}: a word without its value", "a number", EXPAND)
    if kind in ("BORE", "REAM"):
        state.assume(BORES)
    for needed in ("DEPTH", "feed", "CLEAR"):
        state.refuse_if(needed not in values, f"{statement.shown} without {needed}", "DEPTH, CLEAR, MMPM,100", EXPAND)
    _check_cycle(state, KINDS[kind], values)
    scale, dwell = state.scale, values.get("DWELL", 0.0)
    state.hole = Drilling(
        code={"G81": "G82", "G85": "G89"}.get(KINDS[kind], KINDS[kind]) if dwell else KINDS[kind],
        bottom=-abs(values["DEPTH"]) * scale,
        retract=values["CLEAR"] * scale,
        clear=values.get("RETURN", values["CLEAR"]) * scale,
        peck=values.get("STEP", 0.0) * scale,
        first=values.get("1STPECK", 0.0) * scale,
        less=math.inf if "1STPECK" in values else 0.0,
        least=values.get("STEP", 0.0) * scale,
        dwell=dwell,
        out_at_r=KINDS[kind] in ("G84", "G85"),
    )
    state.hole_from = state.point if back_up else None


def _name_in_cycle(state: CutterLocationState, key: str) -> str:
    """Quantity that the word of a pair gives: DEPTH, CLEAR, STEP, RETURN, DWELL, or "feed"."""
    name = ALIASES.get(key.upper(), key.upper())
    by_order = "a cycle of numbers without words: their order depends on the CAM system"
    state.refuse_if(is_number(name), by_order, "pairs, as DEPTH,5", EXPAND)
    expected = "DEPTH, CLEAR, STEP, DWELL, RETURN, a feed"
    unknown = name not in PAIRS and name not in FEED_UNITS
    state.refuse_if(unknown, f"CYCLE/ with {name}, which is not supported", expected, EXPAND)
    return "feed" if name in FEED_UNITS else name


def _check_cycle(state: CutterLocationState, code: str, values: dict[str, float]) -> None:
    """Refuse an impossible hole, or one that systems read differently; lengths in the file's unit."""
    shown, pecks = state.statement.shown, code in ("G73", "G83")
    depth, clear, step, dwell = (values.get(name, 0.0) for name in ("DEPTH", "CLEAR", "STEP", "DWELL"))
    back = values.get("RETURN", clear)
    wrong = not depth or clear < 0.0 or not values["feed"] > 0.0 or not 0.0 <= dwell <= SECONDS_PER_DAY
    state.refuse_if(wrong, shown, "DEPTH and feed above 0, CLEAR and DWELL of 0 or more")
    low = "RETURN" in values and (back < clear or not back > 0.0)
    state.refuse_if(low, f"RETURN,{back:g}: a plane of the CAM system's, or below CLEAR", "CLEAR or more", EXPAND)
    problem = "CLEAR and RETURN that differ beside FEDTO: Autodesk's post makes the first a coordinate"
    state.refuse_if(back != clear and {"FEDTO", "CLEAR"} <= {*state.statement.words}, problem, "DEPTH", EXPAND)
    wrong = bool(step) != pecks or (pecks and not 0.0 < (clear + abs(depth)) / step <= MOST_STROKES)
    state.refuse_if(wrong, shown, f"STEP above 0 with DEEP or BRKCHP alone, for up to {MOST_STROKES} strokes")
    state.refuse_if(dwell and pecks, "DWELL in a cycle with pecks", "no DWELL", EXPAND)
