"""CYCLE/ of a cutter-location file, in pairs of a word and its value, and the holes that it drills.

Read is what systems agree on: `DEPTH` or `FEDTO` counts from the GOTO point into the hole along the tool axis, `CLEAR`
from it outwards (PTC, "CL Output for Holemaking Cycles"; Autodesk's post for CAMplete; Siemens NX writes FEDTO below
zero). The rest is refused by name: numbers without words, whose order hangs on the system; RAPTO, which Creo counts
from CLEAR and others from the surface; RETURN,0 and RTRCTO,AUTO, which go to planes that are not in the file.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.cutter_location import tool_path
from toolpath_stiff.nc.cutter_location.geometry import Vector
from toolpath_stiff.nc.cutter_location.modes import FEED_UNITS, SECONDS_PER_DAY
from toolpath_stiff.nc.cutter_location.state import ALL, PTC, Cycle, State, Word
from toolpath_stiff.nc.cutter_location.statements import Argument, Statement, is_number
from toolpath_stiff.nc.cycles import Drilling

# The first word, and with which strokes it drills: those of G81, G83 (out after each peck), G73 (chip breaking).
KINDS = {"DRILL": "G81", "FACE": "G81", "CSINK": "G81", "DEEP": "G83", "BRKCHP": "G73"}
PAIRS = ("DEPTH", "CLEAR", "STEP", "RETURN", "DWELL")
ALIASES = {"FEDTO": "DEPTH", "INCR": "STEP", "RTRCTO": "RETURN"}
EXPAND = "have the CAM system write the moves of the cycle"
MOST_PECKS = 100_000


@dataclass
class _Given:
    """What a CYCLE/ says: strokes as of a G code, numbers in the file's unit by word, the unit of its feed."""

    code: str
    values: dict[str, float] = field(default_factory=dict)
    unit: str = ""
    fedto: bool = False


def cycle(state: State, statement: Statement) -> None:
    """The cycle that the next points drill; CYCLE/OFF ends it."""
    state.no_circle("CYCLE/")
    state.cycle = _read(state, statement)


def drill(state: State, target: Vector, axis: Vector, cycle: Cycle) -> None:
    """A hole of the cycle in force at a point."""
    if state.point is not None and axis != state.axis:
        raise state.fail(
            "a hole with another tool axis than the move before", "a GOTO/ before the cycle that turns the tool"
        )
    tool_path.drill(state, target, axis, cycle.hole, state.feed_per_minute(cycle.feed, cycle.per_revolution))


def _read(state: State, statement: Statement) -> Cycle | None:
    """The cycle of a statement, None for CYCLE/OFF. Raises `InputError`."""
    arguments = list(statement.arguments)
    kind = arguments.pop(0).text.upper() if arguments else ""
    if kind in ("OFF", "NOMORE"):
        return None
    if kind not in KINDS:
        raise _refusal(
            state, f"CYCLE/{kind} is not supported", ", ".join(f"CYCLE/{known}" for known in (*KINDS, "OFF"))
        )
    if arguments and arguments[0].text.upper() in ("DEEP", "BRKCHP"):  # NX, CAMplete: CYCLE/DRILL,DEEP
        kind = arguments.pop(0).text.upper()
    given = _Given(KINDS[kind])
    for key, value in zip(arguments[::2], arguments[1::2], strict=False):
        _take_pair(state, given, key, value)
    if len(arguments) % 2:
        raise _refusal(state, f"{arguments[-1].text!r} without its value", "a number", at=arguments[-1])
    for needed in ("DEPTH", "feed", "CLEAR"):
        if needed not in given.values:
            raise _refusal(state, f"{statement.shown} without {needed}", "DEPTH, CLEAR and a feed as MMPM,100")
    hole = _hole(state, given)
    _check(state, given, hole)
    factor, per_revolution = FEED_UNITS[given.unit]
    return Cycle(hole, given.values["feed"] * (state.scale if factor is None else factor), per_revolution)


def _refusal(
    state: State, found: str, expected: str = "", hint: str = EXPAND, at: Argument | None = None
) -> InputError:
    return state.fail(found, expected, hint, at)


def _take_pair(state: State, given: _Given, key: Argument, value: Argument) -> None:
    name = key.text.upper()
    given.fedto = given.fedto or name == "FEDTO"
    name = ALIASES.get(name, name)
    if is_number(name):
        raise _refusal(
            state, "a cycle of numbers without words: their order hangs on the CAM system", "pairs, as DEPTH,5", at=key
        )
    if name in FEED_UNITS:
        given.unit, name = name, "feed"
    elif name not in PAIRS:
        raise _refusal(
            state, f"CYCLE/ with {name}, which is not supported", "DEPTH, CLEAR, STEP, DWELL, RETURN, a feed", at=key
        )
    if name in given.values:
        raise _refusal(state, f"{key.text} twice", "one", at=key)
    given.values[name] = state.number(value, f"the number of {key.text}")


def _hole(state: State, given: _Given) -> Drilling:
    """The hole in mm, as it is said."""
    values, scale = given.values, state.scale
    dwell = values.get("DWELL", 0.0)
    return Drilling(
        code="G82" if dwell else given.code,
        bottom=-abs(values["DEPTH"]) * scale,
        retract=values["CLEAR"] * scale,
        clear=values.get("RETURN", values["CLEAR"]) * scale,
        peck=values.get("STEP", 0.0) * scale,
        dwell=dwell,
    )


def _check(state: State, given: _Given, hole: Drilling) -> None:
    """Refuse a hole that cannot be, or of which systems mean different things."""
    values, shown = given.values, state.statement.shown
    clear, back, pecks = hole.retract, hole.clear, given.code != "G81"
    if not hole.bottom < 0.0 or clear < 0.0 or not values["feed"] > 0.0 or not 0.0 <= hole.dwell <= SECONDS_PER_DAY:
        raise state.fail(shown, "DEPTH and feed above 0, CLEAR and DWELL of 0 or more")
    if "RETURN" in values and not back > 0.0:
        raise _refusal(state, "RETURN,0 goes to a plane of the CAM system's", "a height above the point")
    if back < clear:
        raise state.fail("a return below CLEAR", "a height of CLEAR or more")
    if given.fedto and back != clear:
        raise _refusal(
            state, "CLEAR and RETURN that differ beside FEDTO: Autodesk's post makes the first a coordinate", "DEPTH"
        )
    if hole.peck and not pecks:
        raise state.fail("STEP without DEEP or BRKCHP", "CYCLE/DEEP or CYCLE/BRKCHP")
    if pecks and (not hole.peck > 0.0 or (clear - hole.bottom) / hole.peck > MOST_PECKS):
        raise state.fail(f"{shown} without its STEP, or with one too small", "STEP above 0")
    if hole.dwell and pecks:
        raise _refusal(state, "DWELL in a cycle with pecks", "no DWELL")


WORDS = (Word("CYCLE", cycle, "drilling cycle", ALL, PTC, "/DRILL, DEEP or BRKCHP and pairs, or /OFF"),)
