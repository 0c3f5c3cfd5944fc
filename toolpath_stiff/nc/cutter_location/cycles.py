"""CYCLE/ of a cutter-location file, in pairs of a word and its value.

Read is what systems agree on: `DEPTH` or `FEDTO` counts from the GOTO point into the hole along the tool axis, `CLEAR`
from it outwards (PTC, "CL Output for Holemaking Cycles"; Autodesk's post for CAMplete; Siemens NX writes FEDTO below
zero). The rest is refused by name: numbers without words, whose order hangs on the system; RAPTO, which Creo counts
from CLEAR and others from the surface; RETURN,0 and RTRCTO,AUTO, which go to planes that are not in the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.cutter_location.statements import Argument, Statement, is_number, number_of
from toolpath_stiff.nc.cycles import Drilling

# The first word, and with which strokes it drills: those of G81, G83 (out after each peck), G73 (chip breaking).
KINDS = {"DRILL": "G81", "FACE": "G81", "CSINK": "G81", "DEEP": "G83", "BRKCHP": "G73"}
EXPAND = "have the CAM system write the moves of the cycle"
MOST_PECKS = 100_000
SECONDS_PER_DAY = 86400.0


@dataclass(frozen=True)
class Cycle:
    """A drilling cycle: the hole, heights from the GOTO point in mm; its feed in mm/min or mm per revolution."""

    hole: Drilling
    feed: float
    per_revolution: bool


def read_cycle(
    statement: Statement, name: str, scale: float, feed_units: Mapping[str, tuple[float | None, bool]]
) -> Cycle | None:
    """The cycle of a CYCLE/ statement, None for CYCLE/OFF. Raises `InputError`."""

    def fail(found: str, expected: str = "", at: Argument | None = None, hint: str = EXPAND) -> InputError:
        place = at or statement
        return InputError(found, expected=expected, hint=hint, file=name, line=place.line, column=place.column)

    arguments = list(statement.arguments)
    kind = arguments.pop(0).text.upper() if arguments else ""
    if kind in ("OFF", "NOMORE"):
        return None
    if kind not in KINDS:
        raise fail(f"CYCLE/{kind} is not supported", ", ".join(f"CYCLE/{known}" for known in (*KINDS, "OFF")))
    code = KINDS[kind]
    if arguments and arguments[0].text.upper() in ("DEEP", "BRKCHP"):  # NX, CAMplete: CYCLE/DRILL,DEEP
        code = KINDS[arguments.pop(0).text.upper()]
    values: dict[str, float] = {}
    fedto = False
    unit = ""
    for key, value in zip(arguments[::2], arguments[1::2], strict=False):
        word = key.text.upper()
        fedto = fedto or word == "FEDTO"
        word = {"FEDTO": "DEPTH", "INCR": "STEP", "RTRCTO": "RETURN"}.get(word, word)
        if is_number(word):
            raise fail(
                "a cycle of numbers without words: their order hangs on the CAM system", "pairs, as DEPTH,5", key
            )
        if word in feed_units:
            unit, word = word, "feed"
        elif word not in ("DEPTH", "CLEAR", "STEP", "RETURN", "DWELL"):
            raise fail(f"CYCLE/ with {word}, which is not supported", "DEPTH, CLEAR, STEP, DWELL, RETURN, a feed", key)
        if word in values:
            raise fail(f"{key.text} twice", "one", key)
        values[word] = number_of(value, name, f"the number of {key.text}")
    if len(arguments) % 2:
        raise fail(f"{arguments[-1].text!r} without its value", "a number", arguments[-1])
    for word in ("DEPTH", "feed", "CLEAR"):
        if word not in values:
            raise fail(f"{statement.shown} without {word}", "DEPTH, CLEAR and a feed as MMPM,100")
    depth = abs(values["DEPTH"]) * scale
    clear, back = values["CLEAR"] * scale, values.get("RETURN", values["CLEAR"]) * scale
    dwell, peck = values.get("DWELL", 0.0), values.get("STEP", 0.0) * scale
    if not depth > 0.0 or clear < 0.0 or not values["feed"] > 0.0 or not 0.0 <= dwell <= SECONDS_PER_DAY:
        raise fail(statement.shown, "DEPTH and feed above 0, CLEAR and DWELL of 0 or more", hint="")
    if "RETURN" in values and not back > 0.0:
        raise fail("RETURN,0 goes to a plane of the CAM system's", "a height above the point")
    if back < clear:
        raise fail("a return below CLEAR", "a height of CLEAR or more", hint="")
    if fedto and back != clear:
        raise fail("CLEAR and RETURN that differ beside FEDTO: Autodesk's post makes the first a coordinate", "DEPTH")
    if code == "G81" and peck:
        raise fail("STEP without DEEP or BRKCHP", "CYCLE/DEEP or CYCLE/BRKCHP", hint="")
    if code != "G81" and (not peck > 0.0 or (clear + depth) / peck > MOST_PECKS):
        raise fail(f"{statement.shown} without its STEP, or with one too small", "STEP above 0", hint="")
    if dwell and code != "G81":
        raise fail("DWELL in a cycle with pecks", "no DWELL")
    factor, per_revolution = feed_units[unit]
    feed = values["feed"] * (scale if factor is None else factor)
    return Cycle(Drilling("G82" if dwell else code, -depth, clear, back, peck, dwell), feed, per_revolution)
