"""Words of a cutter-location file that say what holds from here on: units, feed, spindle, frames, tools; and pauses."""

from __future__ import annotations

import math

from toolpath_stiff.nc.cutter_location.geometry import VERTICAL, unit_axis
from toolpath_stiff.nc.cutter_location.state import (
    ALL,
    AUTODESK,
    CAMPLETE,
    CATIA,
    CREO,
    ISO,
    LISTED,
    NX,
    POSTS,
    PTC,
    REFUSED,
    SIEMENS,
    VERICUT,
    State,
    Word,
)
from toolpath_stiff.nc.cutter_location.statements import Argument, Statement, is_number
from toolpath_stiff.nc.moves import ToolUse
from toolpath_stiff.units import MM_PER_INCH, SECONDS_PER_DAY, SECONDS_PER_MINUTE

MM_PER_FOOT = 12.0 * MM_PER_INCH
# FEDRAT: mm of its unit (None: the file's length unit), and whether per revolution.
FEED_UNITS: dict[str, tuple[float | None, bool]] = {
    "MMPM": (1.0, False),
    "IPM": (MM_PER_INCH, False),
    "FPM": (MM_PER_FOOT, False),
    "PERMIN": (None, False),
    "MMPR": (1.0, True),
    "IPR": (MM_PER_INCH, True),
    "FPR": (MM_PER_FOOT, True),
    "PERREV": (None, True),
}
INCH_FEEDS = ("IPM", "IPR", "FPM", "FPR")
LENGTH_UNITS = {"MM": 1.0, "INCH": MM_PER_INCH, "INCHES": MM_PER_INCH, "IN": MM_PER_INCH}
SEVERAL_TOOLS = ToolUse(0, math.nan, math.nan, "several tools without numbers")
SAME_LENGTH_MM = 1e-3
TURNING = "turning: the points are read as those of a mill, X as a position"
COMPENSATION = "cutter compensation"
TOOL_CENTRE = "have the CAM system write the path of the tool centre"
SHIFTS = "shifts all that follows"
HEADING = "a heading or a remark"
TOOL = "about the tool; LOADTL, LOAD/TOOL and CUTTER are what counts"
_FRAME = "where the points' coordinate system lies in the part; the points are taken in that system, as program zero"
_ZERO = "the work offset of the posted program; here it is program zero"
FRAMES = {"MSYS": _FRAME, "MCS": _FRAME, "CSYS": _FRAME, "ZERO": _ZERO}


# -- units, feed, spindle ----------------------------------------------------------------------------------------------


def units(state: State, statement: Statement) -> None:
    """The length unit; before the first points, which are mm without it."""
    words = statement.words
    if len(words) != 1 or words[0] not in LENGTH_UNITS:
        raise state.fail(statement.shown, "UNITS/MM or UNITS/INCHES")
    if state.circle is not None:
        raise state.fail("UNITS/ within an arc", "UNITS/ before CIRCLE/")
    if not state.units_said and len(state.recorder) and LENGTH_UNITS[words[0]] != 1.0:
        raise state.fail("UNITS/ after the first points, which were taken as mm", "UNITS/ before any point")
    state.scale, state.units_said = LENGTH_UNITS[words[0]], True


def fedrat(state: State, statement: Statement) -> None:
    """The feed: a number, and its unit before or after it."""
    words = statement.words
    if state.rapid:
        raise state.fail(
            f"a feed after the RAPID of line {state.rapid}, before its motion",
            "one of them",
            "whether the motion is rapid is not certain",
        )
    if words and words[0] == "INVERS":
        _inverse(state, statement)
        return
    values = [argument for argument in statement.arguments if is_number(argument.text)]
    units = [word for word in words if not is_number(word)]
    if len(values) != 1 or len(units) > 1 or any(unit not in FEED_UNITS for unit in units):
        raise state.fail(statement.shown, f"FEDRAT/ with a number and one of {', '.join(FEED_UNITS)}")
    factor, state.per_revolution = FEED_UNITS[units[0]] if units else (None, False)
    if units and units[0] in INCH_FEEDS and not state.units_said:
        raise state.fail(
            f"{units[0]} in a file that names no UNITS: are its points in inches?",
            "UNITS/INCHES or UNITS/MM before it",
            "add the line at the beginning of the file",
        )
    value = state.number(values[0])
    if value < 0.0:
        raise state.fail(f"a feed of {value:g}", "a feed above 0", at=values[0])
    state.feed = value * (state.scale if factor is None else factor) or None


def _inverse(state: State, statement: Statement) -> None:
    """Creo: whether the post makes inverse-time feeds of them; the numbers stay per minute."""
    if statement.words[1:] not in (["AUTO"], ["OFF"]):
        raise state.fail(statement.shown, "a feed per minute or per revolution")
    state.note(state.noted, "how the post processor writes feeds")


def spindl(state: State, statement: Statement) -> None:
    """Revolutions per minute, and whether the spindle turns; surface speeds are listed."""
    words = statement.words
    if "OFF" in words or "STOP" in words:
        state.speed = 0.0
        return
    before = ("RPM", "CLW", "CCLW", "SFM", "SMM")
    found = [place for place, word in enumerate(words) if is_number(word)]
    speeds = [place for place in found if place == 0 or words[place - 1] in before]
    if "SFM" in words or "SMM" in words or (found and not speeds):
        state.note(state.noted, "a speed that is not a number of revolutions")
        state.revolutions = 0.0
    elif speeds:
        state.revolutions = abs(state.number(statement.arguments[speeds[0]]))
    state.speed = state.revolutions


def delay(state: State, statement: Statement) -> None:
    """A pause in seconds, or in revolutions and REV."""
    words = statement.words
    if words[1:] not in ([], ["REV"]):
        raise state.fail(statement.shown, "the seconds, or the revolutions and REV")
    time = state.number(statement.arguments[0]) if words else math.nan
    if words[1:]:
        if not state.speed > 0.0:
            raise state.fail("a pause in revolutions without a spindle speed", "SPINDL/ with RPM before it")
        time *= SECONDS_PER_MINUTE / state.speed
    if not 0.0 <= time <= SECONDS_PER_DAY:
        raise state.fail(statement.shown, "the seconds, 0 or more")
    state.recorder.add_dwell(time)


# -- tool axis, coordinate systems -------------------------------------------------------------------------------------


def multax(state: State, statement: Statement) -> None:
    """Points carry a tool axis; after MULTAX/OFF a tilted tool must be given again."""
    words = statement.words
    if words not in ([], ["ON"], ["OFF"]):
        raise state.fail(statement.shown, "MULTAX, MULTAX/ON or MULTAX/OFF")
    state.multax = words != ["OFF"]
    if not state.multax and state.next_axis != VERTICAL:
        state.axis_said = False


def tlaxis(state: State, statement: Statement) -> None:
    """The tool axis of points that give none."""
    x, y, z = state.numbers(statement, 3)
    state.next_axis, state.axis_said = unit_axis(x, y, z), True


def frame_word(state: State, statement: Statement) -> None:
    """A second, different one is refused."""
    numbers = tuple(state.number(a) for a in statement.arguments if is_number(a.text))
    one_frame(state, statement.word, numbers, statement.shown)
    state.note(state.noted, FRAMES[statement.word])


def one_frame(state: State, kind: str, numbers: tuple[float, ...], shown: str) -> None:
    """Points of one coordinate system only; `kind` says who names it, the numbers where it lies."""
    before = state.frames.get(kind, numbers)
    same = len(before) == len(numbers) and all(abs(a - b) < 1e-6 for a, b in zip(before, numbers, strict=True))
    if not same and state.point is not None:
        raise state.fail(
            f"{shown}: another coordinate system than the one before",
            "one system for the whole file",
            "write each of them to a file of its own",
        )
    state.frames[kind] = numbers


def shift(state: State, statement: Statement) -> None:
    """Refused unless it is zero."""
    if statement.arguments and all(is_number(word) for word in statement.words):
        numbers = [state.number(argument) for argument in statement.arguments]
        if len(numbers) == 3 and not any(numbers):
            state.note(state.noted, "a shift of zero")
            return
    hint = "have the CAM system write the points where they are cut"
    raise state.fail(f"{statement.shown} {SHIFTS}, which is not supported", "0,0,0", hint)


def cutcom(state: State, statement: Statement) -> None:
    """Refused unless it is off."""
    if statement.words != ["OFF"]:
        raise state.fail(f"{statement.shown} is {COMPENSATION}, which is not supported", "", TOOL_CENTRE)
    state.note(state.noted, "cutter compensation is off")


def mode(state: State, statement: Statement) -> None:
    """Milling; turning is doubted: its points are read all the same."""
    if statement.words == ["TURN"]:
        state.note(state.doubtful, TURNING)
        return
    if statement.words != ["MILL"]:
        raise state.fail(statement.shown, "MODE/MILL or MODE/TURN")
    state.note(state.noted, "milling")


# -- tools -------------------------------------------------------------------------------------------------------------


def loadtl(state: State, statement: Statement) -> None:
    """Another tool: its number, and perhaps LENGTH and the length."""
    if not statement.arguments:
        raise state.fail("LOADTL without a tool", "LOADTL/ and the tool's number")
    _change_tool(state, statement, statement.arguments[0])


def load(state: State, statement: Statement) -> None:
    """NX' LOAD/TOOL and the number."""
    words = statement.words
    if words[:1] != ["TOOL"] or len(words) < 2:
        raise state.fail(statement.shown, "LOAD/TOOL, and the tool's number")
    _change_tool(state, statement, statement.arguments[1])


def _change_tool(state: State, statement: Statement, given: Argument) -> None:
    number = state.number(given, "the tool's number")
    if number != int(number) or not 0 <= number < 1e9:
        raise state.fail(f"tool {given.text}", "a whole number", at=given)
    state.no_circle(f"{statement.word}/")
    words = statement.words
    length = math.nan
    if "LENGTH" in words and words.index("LENGTH") + 1 < len(words):
        length = state.number(statement.arguments[words.index("LENGTH") + 1]) * state.scale
        length = length if length > 0.0 else math.nan
    length = _length_of(state, int(number), length)
    if len(state.recorder) > state.cutter_at:  # a CUTTER between the last move and this is its own
        state.diameter = math.nan
    state.tool, state.tool_length = int(number), length


def _length_of(state: State, number: int, said: float) -> float:
    """The tool table's length, or what the file says; nan: the machine's reference tool."""
    entry = (state.tools or {}).get(number)
    if entry is None or math.isnan(entry.length):
        if not math.isnan(said):
            state.assume("the LENGTH of LOADTL is the tool's length from spindle nose to tip; --tools takes precedence")
        return said
    if abs(said - entry.length) > SAME_LENGTH_MM:
        state.assume(f"tool {number}: the tool table's length {entry.length:g} mm, not LOADTL's {said:g} mm")
    return entry.length


def toolno(state: State, statement: Statement) -> None:
    """Listed; a turning tool is doubted."""
    if "TURN" in statement.words:
        state.note(state.doubtful, TURNING)
    else:
        state.note(state.noted, TOOL)


def cutter(state: State, statement: Statement) -> None:
    """The first number is the diameter, in all of APT's forms."""
    first = statement.arguments[0] if statement.arguments else None
    if first is not None and is_number(first.text):
        _diameter(state, first)


def tldata(state: State, statement: Statement) -> None:
    """The first number, after the kind of tool."""
    first = next((argument for argument in statement.arguments if is_number(argument.text)), None)
    if first is not None:
        _diameter(state, first)


def _diameter(state: State, argument: Argument) -> None:
    diameter = state.number(argument) * state.scale
    state.diameter = diameter if diameter > 0.0 else math.nan
    state.cutter_at = len(state.recorder)


# -- operations, the end -----------------------------------------------------------------------------------------------


def heading(state: State, statement: Statement) -> None:
    """The name of an operation."""
    if statement.arguments:
        state.marks.append((statement.line, statement.arguments[0].text))
    state.note(state.noted, HEADING)


def tool_path(state: State, statement: Statement) -> None:
    """The name of an operation, and of its tool."""
    if statement.arguments:
        state.marks.append((statement.line, statement.arguments[0].text))
    state.no_circle("TOOL PATH/")
    words = statement.words
    if "TOOL" in words[1:-1]:
        name = statement.arguments[words.index("TOOL", 1) + 1].text
        if state.tool == 0 and 0 in state.used_tools and name != state.tool_name:
            state.used_tools[0] = SEVERAL_TOOLS
        state.tool_name = name
    state.note(state.noted, HEADING)


def fini(state: State, statement: Statement) -> None:
    """What follows is not read."""
    state.no_circle("FINI")
    state.ended = True


_MOST = f"{CATIA}, {CREO}, {AUTODESK}"
MODE_WORDS = (
    Word("FEDRAT", fedrat, "feed", ALL, ISO, "/number[,unit] or unit,number"),
    Word("SPINDL", spindl, "spindle speed", ALL, ISO),
    Word("UNITS", units, "length unit", f"{CREO}, {AUTODESK}", ISO, "/MM or INCHES"),
    Word("UNIT", units, "length unit", "", ISO, "/MM or INCHES"),
    Word("MULTAX", multax, "whether points carry a tool axis", _MOST, ISO, "[/ON or OFF]"),
    Word("TLAXIS", tlaxis, "tool axis", "", ISO, "/i,j,k"),
    Word("LOADTL", loadtl, "tool change", _MOST, PTC, "/n[,LENGTH,l]"),
    Word("LOAD", load, "tool change", NX, SIEMENS, "/TOOL,n"),
    Word("CUTTER", cutter, "tool diameter", _MOST, ISO, "/d"),
    Word("TLDATA", tldata, "tool diameter", NX, SIEMENS, "/kind,d"),
    Word("DELAY", delay, "pause", ALL, ISO, "/seconds or revolutions,REV"),
    Word("DWELL", delay, "pause", "", ISO, "/seconds or revolutions,REV"),
    Word("MODE", mode, "milling; turning is read alike", AUTODESK, POSTS, "/MILL or TURN"),
    Word("CUTCOM", cutcom, COMPENSATION, f"{CATIA}, {CREO}", ISO, "/OFF"),
    Word("FINI", fini, "end of the file", _MOST, ISO),
    Word("TOOL PATH", tool_path, HEADING, NX, SIEMENS, "/name,TOOL,tool", LISTED),
    Word("CSI_TOOL_PATH", heading, HEADING, CAMPLETE, POSTS, "/name", LISTED),
    Word("TOOLNO", toolno, TOOL, CATIA, ISO, kind=LISTED),
    Word("MSYS", frame_word, FRAMES["MSYS"], NX, SIEMENS, kind=LISTED),
    Word("MCS", frame_word, FRAMES["MCS"], AUTODESK, POSTS, kind=LISTED),
    Word("CSYS", frame_word, FRAMES["CSYS"], "", VERICUT, kind=LISTED),
    Word("ZERO", frame_word, FRAMES["ZERO"], AUTODESK, POSTS, kind=LISTED),
    Word("TRANS", shift, SHIFTS, "", ISO, "/x,y,z other than 0,0,0", REFUSED),
    Word("ORIGIN", shift, SHIFTS, "", ISO, "/x,y,z other than 0,0,0", REFUSED),
)
