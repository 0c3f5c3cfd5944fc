"""Modal words of a cutter-location file: units, feed, spindle, frames, tools; and pauses."""

import math

from toolpath_stiff.nc.cutter_location.circles import VERTICAL
from toolpath_stiff.nc.cutter_location.state import CutterLocationState
from toolpath_stiff.nc.cutter_location.statements import MajorStatement, is_number
from toolpath_stiff.nc.tables import ToolEntry, tool_of
from toolpath_stiff.nc.tool_axes import unit_axis
from toolpath_stiff.units import MM_PER_INCH, SECONDS_PER_DAY, SECONDS_PER_MINUTE

MM_PER_FOOT = 12.0 * MM_PER_INCH
# FEDRAT: mm of its unit (None: the file's length unit), and whether per revolution.
FEED_UNITS: dict[str, tuple[float | None, bool]] = {
    "MMPM": (1.0, False), "IPM": (MM_PER_INCH, False), "FPM": (MM_PER_FOOT, False), "PERMIN": (None, False),
    "MMPR": (1.0, True), "IPR": (MM_PER_INCH, True), "FPR": (MM_PER_FOOT, True), "PERREV": (None, True),
}  # fmt: skip
INCH_FEEDS = {"IPM", "IPR", "FPM", "FPR"}
LENGTH_UNITS = {"MM": 1.0, "INCH": MM_PER_INCH, "INCHES": MM_PER_INCH, "IN": MM_PER_INCH}
COMPENSATES = (
    "cutter compensation by the control: the points are taken as those of the tool's centre; where the CAM system "
    "writes the contour, the path is off by the tool's radius"
)
SEVERAL_TOOLS = ToolEntry(0, remark="several tools without numbers")
TURNING = "turning: the points are read as those of a mill, X as a position"
HEADING = "a heading or a remark"
TOOL = "about the tool; LOADTL, LOAD/TOOL and CUTTER are what counts"
_FRAME = "where the points' coordinate system lies in the part; the points are taken in that system, as program zero"
_ZERO = "the work offset of the posted program; here it is program zero"
FRAMES = {"MSYS": _FRAME, "MCS": _FRAME, "CSYS": _FRAME, "ZERO": _ZERO}


def units(state: CutterLocationState, statement: MajorStatement) -> None:
    """Set the length unit; inches after the first points are refused, as those were taken as mm."""
    scale = LENGTH_UNITS.get(",".join(statement.words))
    if scale is None:
        raise state.fail(statement.shown, "UNITS/MM or UNITS/INCHES")
    state.no_circle("UNITS/")
    late = not state.units_given and len(state.recorder) and scale != 1.0
    state.refuse_if(late, "UNITS/ after the first points, which were taken as mm", "UNITS/ before any point")
    state.scale, state.units_given = scale, True


def fedrat(state: CutterLocationState, statement: MajorStatement) -> None:
    """The feed: a number, and its unit before or after it."""
    words = statement.words
    problem = f"a feed after the RAPID of line {state.rapid}, before its motion"
    state.refuse_if(state.rapid, problem, "one of them", "whether the motion is rapid is not certain")
    if words[:1] == ["INVERS"]:  # Creo: whether the post makes inverse-time feeds; the numbers stay per minute
        state.refuse_if(words[1:] not in (["AUTO"], ["OFF"]), statement.shown, "a feed per minute or per revolution")
        state.note("how the post processor writes feeds")
        return
    values = [word for word in words if is_number(word)]
    units = [word for word in words if not is_number(word)]
    wrong = len(values) != 1 or len(units) > 1 or not FEED_UNITS.keys() >= set(units)
    state.refuse_if(wrong, statement.shown, f"FEDRAT/ with a number and one of {', '.join(FEED_UNITS)}")
    problem = f"{', '.join(units)} in a file that names no UNITS: are its points in inches?"
    expected, hint = "UNITS/INCHES or UNITS/MM before it", "add the line at the beginning of the file"
    state.refuse_if(not state.units_given and INCH_FEEDS.intersection(units), problem, expected, hint)
    value = state.number(values[0])
    state.refuse_if(value < 0.0, f"a feed of {value:g}", "a feed above 0")
    factor, state.per_revolution = FEED_UNITS[units[0]] if units else (None, False)
    state.feed = value * (factor or state.scale) or None


def spindl(state: CutterLocationState, statement: MajorStatement) -> None:
    """Set the revolutions per minute, and whether the spindle turns; surface speeds are only listed."""
    words = statement.words
    if "OFF" in words or "STOP" in words:
        state.speed = 0.0
        return
    if words != ["ON"]:
        state.turn = -1.0 if "CCLW" in words else 1.0
    numbers = [index for index, word in enumerate(words) if is_number(word)]
    speeds = [index for index in numbers if index == 0 or words[index - 1] in ("RPM", "CLW", "CCLW", "SFM", "SMM")]
    if "SFM" in words or "SMM" in words or (numbers and not speeds):
        state.note("a speed that is not a number of revolutions")
        state.revolutions, state.turn = 0.0, math.nan
    elif speeds:
        state.revolutions = abs(state.number(statement.arguments[speeds[0]]))
    state.speed = state.revolutions


def delay(state: CutterLocationState, statement: MajorStatement) -> None:
    """A pause in seconds, or in revolutions and REV."""
    words = statement.words
    state.refuse_if(words[1:] not in ([], ["REV"]), statement.shown, "the seconds, or the revolutions and REV")
    time = state.number(statement.arguments[0]) if words else math.nan
    if words[1:]:
        state.refuse_if(not state.speed > 0.0, "a pause in revolutions without a spindle speed", "SPINDL/ with RPM")
        time *= SECONDS_PER_MINUTE / state.speed
    state.refuse_if(not 0.0 <= time <= SECONDS_PER_DAY, statement.shown, "the seconds, 0 or more")
    state.recorder.add_dwell(time)


def multax(state: CutterLocationState, statement: MajorStatement) -> None:
    """Points carry a tool axis; after MULTAX/OFF the axis of a tilted tool must be given again."""
    words = statement.words
    state.refuse_if(words not in ([], ["ON"], ["OFF"]), statement.shown, "MULTAX, MULTAX/ON or MULTAX/OFF")
    state.multax = words != ["OFF"]
    if not state.multax and state.next_axis != VERTICAL:
        state.next_axis = None


def tlaxis(state: CutterLocationState, statement: MajorStatement) -> None:
    """Set the tool axis of points that give none."""
    state.next_axis = unit_axis(state.numbers(statement, 3))


def frame_word(state: CutterLocationState, statement: MajorStatement) -> None:
    """Take a coordinate system; a second, different one is refused."""
    numbers = (state.number(argument) for argument in statement.arguments if is_number(argument))
    one_frame(state, statement.word, tuple(numbers), statement.shown)
    state.note(FRAMES[statement.word])


def one_frame(state: CutterLocationState, kind: str, numbers: tuple[float, ...], shown: str) -> None:
    """Allow points of one coordinate system only; `kind` says which word names it, the numbers where it lies."""
    before = state.frames.get(kind, numbers)
    same = len(before) == len(numbers) and all(abs(a - b) < 1e-6 for a, b in zip(before, numbers, strict=True))
    if not same and state.point is not None:
        problem, hint = f"{shown}: another coordinate system than the one before", "write each to a file of its own"
        raise state.fail(problem, "one system for the whole file", hint)
    state.frames[kind] = numbers


def cutcom(state: CutterLocationState, statement: MajorStatement) -> None:
    """Compensation by the control: the points of such a file are the tool's, the compensation is for wear."""
    words, (what, *_) = statement.words, (*statement.words, "")
    state.refuse_if(what not in ("OFF", "ON", "LEFT", "RIGHT"), statement.shown, "CUTCOM/LEFT, RIGHT, ON or OFF")
    harmless = what == "OFF" or "LENGTH" in words
    problem = f"{statement.shown} beside points of the contour (OUTPUT_ON_PROFILE)"
    state.refuse_if(state.on_contour and not harmless, problem, "points of the tool's centre (OUTPUT_ON_CENTER)")
    state.note("compensation off, or of the length" if harmless else COMPENSATES, doubtful=not harmless)


def mode(state: CutterLocationState, statement: MajorStatement) -> None:
    """Set milling; turning is doubted, but its points are read."""
    state.refuse_if(statement.words not in (["MILL"], ["TURN"]), statement.shown, "MODE/MILL or MODE/TURN")
    turns = statement.words == ["TURN"]
    state.note(TURNING if turns else "milling", doubtful=turns)


def loadtl(state: CutterLocationState, statement: MajorStatement) -> None:
    """Change the tool: its number (after TOOL in NX' LOAD/), and perhaps LENGTH and the length."""
    words, given = statement.words, statement.arguments
    if statement.word == "LOAD":
        state.refuse_if(words[:1] != ["TOOL"] or len(words) < 2, statement.shown, "LOAD/TOOL, and the tool's number")
        given = given[1:]
    state.refuse_if(not given, "LOADTL without a tool", "LOADTL/ and the tool's number")
    number = state.number(given[0], "the tool's number")
    state.refuse_if(number != int(number) or not 0 <= number < 1e9, f"tool {given[0]}", "a whole number")
    state.no_circle(f"{statement.word}/")
    length = tool_of(state.tools, int(number)).length
    if "LENGTH" in words[:-1] and (stated := state.number(words[words.index("LENGTH") + 1]) * state.scale) > 0.0:
        state.assume("the LENGTH of LOADTL is the tool's length from spindle nose to tip; --tools takes precedence")
        length = stated if math.isnan(length) else length
    if len(state.recorder) > state.moves_before_cutter:  # a CUTTER since the last move belongs to this tool
        state.diameter = math.nan
    state.tool, state.tool_length = int(number), length


def cutter(state: CutterLocationState, statement: MajorStatement) -> None:
    """Set the diameter: the first number, in all of APT's forms of CUTTER/; in TLDATA/ after the kind of tool."""
    given = statement.arguments[:1] if statement.word == "CUTTER" else statement.arguments
    first = next((argument for argument in given if is_number(argument)), None)
    if first is not None:
        diameter = state.number(first) * state.scale
        state.diameter = diameter if diameter > 0.0 else math.nan
        state.moves_before_cutter = len(state.recorder)


def heading(state: CutterLocationState, statement: MajorStatement) -> None:
    """Take the name of an operation; after TOOL PATH/ perhaps also its tool."""
    if statement.arguments:
        state.marks.append((statement.line, statement.arguments[0]))
    if statement.word == "TOOL PATH":
        state.no_circle("TOOL PATH/")
        words = statement.words
        if "TOOL" in words[1:-1]:
            name = statement.arguments[words.index("TOOL", 1) + 1]
            if state.tool == 0 and 0 in state.used_tools and name != state.tool_name:
                state.used_tools[0] = SEVERAL_TOOLS
            state.tool_name = name
    state.note(HEADING)


def fini(state: CutterLocationState, statement: MajorStatement) -> None:
    """End the file: what follows is not read."""
    state.no_circle("FINI")
    state.ended = True
