"""Words of a cutter-location file that move the tool: points, circles that the next point ends, and CYCLE/.

A cycle comes in pairs of a word and its value. Read is what systems agree on: `DEPTH` or `FEDTO` counts from the GOTO
point into the hole along the tool axis, `CLEAR` from it outwards (PTC, "CL Output for Holemaking Cycles"; Autodesk's
post for CAMplete; Siemens NX writes FEDTO below zero). The rest is refused by name: numbers without words, whose order
depends on the system; RAPTO, which Creo counts from CLEAR and others from the surface; RETURN,0 and RTRCTO,AUTO, which
go to planes that are not in the file.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.cutter_location import geometry
from toolpath_stiff.nc.cutter_location.geometry import VERTICAL, AxisError, Circle, unit_axis
from toolpath_stiff.nc.cutter_location.modes import FEED_UNITS
from toolpath_stiff.nc.cutter_location.state import (
    ALL,
    APT,
    AUTODESK,
    CATIA,
    CREO,
    DASSAULT,
    DOUBTFUL,
    ISO,
    NX,
    PTC,
    SIEMENS,
    Cycle,
    State,
    Word,
    circular,
    stand,
    straight,
)
from toolpath_stiff.nc.cutter_location.state import drill as drill_hole
from toolpath_stiff.nc.cutter_location.statements import Argument, Nested, Statement, is_number, nested
from toolpath_stiff.nc.geometry import MOST_STROKES, Drilling, Vector
from toolpath_stiff.nc.moves import FEED, RAPID
from toolpath_stiff.units import SECONDS_PER_DAY

# -- cycles ------------------------------------------------------------------------------------------------------------

# The first word, and with which strokes it drills: those of G81, G83 (out after each peck), G73 (chip breaking), G84
# (a tap, which feeds out to CLEAR too).
KINDS = {"DRILL": "G81", "FACE": "G81", "CSINK": "G81", "DEEP": "G83", "BRKCHP": "G73", "TAP": "G84"}
PAIRS = ("DEPTH", "CLEAR", "STEP", "RETURN", "DWELL")
ALIASES = {"FEDTO": "DEPTH", "INCR": "STEP", "RTRCTO": "RETURN"}
EXPAND = "have the CAM system write the moves of the cycle"


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
    drill_hole(state, target, axis, cycle.hole, state.feed_per_minute(cycle.feed, cycle.per_revolution))


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
            state,
            "a cycle of numbers without words: their order depends on the CAM system",
            "pairs, as DEPTH,5",
            at=key,
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
    """The hole in mm, as the statement gives it."""
    values, scale = given.values, state.scale
    dwell = values.get("DWELL", 0.0)
    return Drilling(
        code="G82" if dwell and given.code == "G81" else given.code,
        bottom=-abs(values["DEPTH"]) * scale,
        retract=values["CLEAR"] * scale,
        clear=values.get("RETURN", values["CLEAR"]) * scale,
        peck=values.get("STEP", 0.0) * scale,
        dwell=dwell,
        out_at_r=given.code == "G84",
    )


def _check(state: State, given: _Given, hole: Drilling) -> None:
    """Refuse a hole that cannot be, or of which systems mean different things."""
    values, shown = given.values, state.statement.shown
    clear, back, pecks = hole.retract, hole.clear, given.code in ("G73", "G83")
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
    if pecks and (not hole.peck > 0.0 or (clear - hole.bottom) / hole.peck > MOST_STROKES):
        raise state.fail(f"{shown} without its STEP, or with one too small", "STEP above 0")
    if hole.dwell and pecks:
        raise _refusal(state, "DWELL in a cycle with pecks", "no DWELL")


CYCLE_WORDS = (Word("CYCLE", cycle, "drilling cycle", ALL, PTC, "/DRILL, DEEP, BRKCHP or TAP and pairs, or /OFF"),)


HOME = "home is the control's: the way there is not part of the path"
ROUNDING = 1e-3  # rad, of the arcs that make a whole turn


# -- points ------------------------------------------------------------------------------------------------------------


def goto(state: State, statement: Statement) -> None:
    """A point; on a circle several points, too."""
    named = next((a for a in statement.arguments if a.text[:1].isalpha() or a.text[:1] == "("), None)
    if named is not None:
        hint = "names need APT's processor: give the file of points that it writes"
        raise state.fail(f"GOTO/ to {named.text[:30]!r}", "numbers", hint, named)
    numbers = [state.number(argument) for argument in statement.arguments]
    if len(numbers) in (3, 6):
        to_point(state, numbers)
    elif state.circle is not None and len(numbers) >= 9 and len(numbers) % 3 == 0 and not state.multax:
        targets = [state.scaled(numbers[i : i + 3]) for i in range(0, len(numbers), 3)]
        _arc_through(state, targets, state.next_axis)
    else:
        raise state.fail(f"GOTO/ with {len(numbers)} numbers", "x,y,z or x,y,z,i,j,k")


def more_points(state: State, statement: Statement) -> None:
    """A line of numbers alone after GOTO: the next point (Creo writes arcs so)."""
    if state.last_word != "GOTO":
        raise state.fail(f"{statement.text[:30]!r} is not a statement", "a word, / and its arguments")
    state.circle = state.followed
    to_point(state, state.numbers(statement, 3, 6))


def to_point(state: State, numbers: list[float]) -> None:
    """A point, with its tool axis or the one in force: the end of a move or an arc, or a hole."""
    axis = _axis_of(state, numbers)
    target = state.scaled(numbers[:3])
    if state.circle is not None:
        _arc_through(state, [target], axis)
    elif state.cycle is not None:
        state.rapid, state.followed = 0, None
        drill(state, target, axis, state.cycle)
    else:
        _go(state, target, axis)


def _axis_of(state: State, numbers: list[float]) -> Vector:
    if len(numbers) == 6:
        axis = unit_axis(*numbers[3:])
        if state.multax is False and axis != VERTICAL:
            raise state.fail("a tilted tool axis after MULTAX/OFF", "MULTAX/ON before it, or x,y,z alone")
        state.next_axis, state.axis_said = axis, True
        return axis
    if not state.axis_said:
        raise state.fail("a point without its tool axis after MULTAX/OFF and a tilted tool", "x,y,z,i,j,k or TLAXIS")
    return state.next_axis


def _go(state: State, target: Vector, axis: Vector) -> None:
    motion = RAPID if state.rapid else FEED
    state.rapid, state.followed, state.direction = 0, None, None
    straight(state, motion, target, axis)


def godlta(state: State, statement: Statement) -> None:
    """A point by its distance from the last one."""
    if state.point is None:
        raise state.fail("GODLTA/ before any point", "FROM/ or GOTO/ before it")
    numbers = state.numbers(statement, 3, 6)
    if state.circle is not None or state.cycle is not None:
        raise state.fail("GODLTA/ on a circle or in a cycle", "GOTO/")
    axis = _axis_of(state, numbers)
    x, y, z = (p + d for p, d in zip(state.point, state.scaled(numbers[:3]), strict=True))
    _go(state, (x, y, z), axis)


def from_(state: State, statement: Statement) -> None:
    """Where the tool stands."""
    numbers = state.numbers(statement, 3, 6)
    axis = _axis_of(state, numbers)
    if len(state.recorder):
        state.warnings.append(
            f"line {statement.line}: FROM within the path: the tool is taken to stand there; "
            "how it got there is not given"
        )
    state.no_circle("FROM/")
    stand(state, state.scaled(numbers[:3]), axis)


def gohome(state: State, statement: Statement) -> None:
    """NX gives the point of home; without one it is the control's."""
    if statement.arguments:
        to_point(state, state.numbers(statement, 3, 6))
        return
    state.no_circle("GOHOME")
    state.rapid = 0
    state.note(state.doubtful, HOME)


def rapid(state: State, statement: Statement) -> None:
    """The next motion, and no other, is rapid."""
    if statement.arguments:
        raise state.fail(statement.shown, "RAPID alone")
    if state.circle is not None:
        raise state.fail("RAPID before the GOTO of a circle", "an arc at a feed")
    if state.cycle is not None:
        raise state.fail("RAPID within a drilling cycle: is the next point a hole?", "CYCLE/OFF before it")
    state.rapid = statement.line


# -- circles -----------------------------------------------------------------------------------------------------------


def circle(state: State, statement: Statement) -> None:
    """A circle in the forms of PTC, NX and APT."""
    times = 1
    arguments = statement.arguments
    if len(arguments) > 2 and arguments[-2].text.upper() == "TIMES":
        count = state.number(arguments[-1], "a whole number of turns")
        if count != int(count) or not 1 <= count <= 10000:
            raise state.fail("CIRCLE/ ... TIMES", "a whole number of turns", at=arguments[-1])
        times, arguments = int(count), arguments[:-2]
    numbers = [state.number(argument) for argument in arguments]
    if len(numbers) not in (4, 6, 7, 11):
        raise state.fail(
            f"CIRCLE/ with {len(numbers)} numbers", "x,y,z,i,j,k,r or NX' x,y,z,i,j,k,r,t,f,d,e or x,y,z,r"
        )
    center = state.scaled(numbers[:3])
    if len(numbers) == 4:
        axis, radius = VERTICAL, numbers[3]
        if state.direction is None:
            raise state.fail("CIRCLE/x,y,z,r, which does not say which way round", "INDIRV/ before it, or i,j,k")
    else:
        axis, radius = _circle_axis(state, numbers[3:6]), numbers[6] if len(numbers) > 6 else math.nan
        if len(numbers) == 11:
            axis = (-axis[0], -axis[1], -axis[2])
    _await_circle(state, Circle(center, axis, radius * state.scale, times))


def _circle_axis(state: State, numbers: list[float]) -> Vector:
    try:
        return unit_axis(*numbers)
    except AxisError as error:
        raise state.fail(error.found.replace("a tool axis", "a circle's axis"), error.expected) from None


def movarc(state: State, statement: Statement) -> None:
    """A circle by the right hand, and the angle that is cut."""
    words = statement.words
    if len(words) != 9 or words[7] != "ANGLE":
        raise state.fail(statement.shown, "MOVARC/x,y,z,i,j,k,r,ANGLE,a")
    numbers = [state.number(a) for a in (*statement.arguments[:7], statement.arguments[8])]
    if not 0.0 < numbers[7] <= 3.6e6:
        raise state.fail(f"an arc of {numbers[7]:g} degrees", "an angle above 0", at=statement.arguments[8])
    axis = _circle_axis(state, numbers[3:6])
    center = state.scaled(numbers[:3])
    _await_circle(state, Circle(center, axis, numbers[6] * state.scale, sweep=numbers[7]))


def indirv(state: State, statement: Statement) -> None:
    """The direction at the start, which says which way round."""
    x, y, z = state.numbers(statement, 3)
    state.direction = (x, y, z)


def _await_circle(state: State, circle: Circle) -> Circle:
    """The circle that the next point ends, turned as INDIRV says."""
    if state.rapid:
        raise state.fail(f"an arc after the RAPID of line {state.rapid}", "a rapid to a point, or an arc at a feed")
    if state.cycle is not None:
        raise state.fail("an arc within a drilling cycle", "CYCLE/OFF before it")
    if state.circle is not None:
        raise state.fail(f"a circle while the one of line {state.circle_line} waits for its GOTO", "GOTO/")
    if state.point is None:
        raise state.fail("an arc before any point", "FROM/ or GOTO/ before it")
    if state.direction is not None:
        axis = geometry.turned_as(circle.center, circle.axis, state.point, state.direction)
        circle = replace(circle, axis=axis)
        state.direction = None
    state.circle, state.circle_line, state.swept = circle, state.statement.line, 0.0
    _note_entry(state, circle, state.point)
    return circle


def _note_entry(state: State, circle: Circle, start: Vector) -> None:
    """Count whether a straight move goes on into an arc smoothly, as it nearly always does, or would turn back."""
    if state.heading is None:
        return
    tangent = geometry.cross(circle.axis, geometry.minus(start, circle.center))
    sizes = [math.sqrt(geometry.dot(vector, vector)) for vector in (tangent, state.heading)]
    if min(sizes) < 1e-9:
        return
    x, y, z = (t / sizes[0] for t in tangent)
    u, v, w = (d / sizes[1] for d in state.heading)
    angle = geometry.angle_between((x, y, z), (u, v, w))
    if angle < geometry.SMOOTH_DEG:
        state.smooth += 1
    elif angle > 180.0 - geometry.SMOOTH_DEG:
        state.unsmooth += 1
        state.first_unsmooth = state.first_unsmooth or state.statement.line


def _arc_through(state: State, targets: list[Vector], axis: Vector) -> None:
    """Follow the circle that waits through points; the last one ends the arc."""
    circle = state.circle
    assert circle is not None
    state.circle, state.followed = None, circle
    for target in targets:
        if state.swept and circle.sweep is not None:
            raise state.fail("a second point of an arc whose ANGLE is given", "one point")
        state.swept += circular(state, circle, target, axis)
        if circle.sweep is None and state.swept > math.tau * circle.turns + ROUNDING:
            raise state.fail(
                "points of an arc that do not follow each other in its direction", "points in the order of the cut"
            )


def tlon(state: State, statement: Statement) -> None:
    """CATIA's and Creo's arcs in APT's own words."""
    if state.direction is None:
        raise state.fail("TLON,GOFWD/ without its direction", "INDIRV/ before it")
    geometries = [nested(argument.text) or argument.text.upper() for argument in statement.arguments]
    which = 1
    if len(geometries) == 5 and geometries[2] in ("1", "2") and geometries[3] == "INTOF":
        which = int(str(geometries[2]))
        geometries = [geometries[0], geometries[1], geometries[4]]
    if (
        len(geometries) != 3
        or geometries[1] != "ON"
        or isinstance(geometries[0], str)
        or isinstance(geometries[2], str)
    ):
        raise state.fail(statement.shown, "TLON,GOFWD/(CIRCLE/x,y,z,r),ON,(LINE/x,y,z,x,y,z), or CATIA's (CYLNDR/...)")
    circle = _tlon_circle(state, geometries[0])
    line = _tlon_line(state, geometries[2])
    circle = _await_circle(state, circle)
    assert state.point is not None
    _arc_through(state, [geometry.line_meets(circle, state.point, line, which)], state.next_axis)
    state.followed = None


def _tlon_circle(state: State, given: Nested) -> Circle:
    numbers = [value for value in given[1] if isinstance(value, float)]
    if given[0] == "CIRCLE" and len(given[1]) == len(numbers) == 4:
        return Circle(state.scaled(numbers[:3]), VERTICAL, numbers[3] * state.scale)
    if given[0] in ("CYLNDR", "CIRCLE") and len(given[1]) == len(numbers) == 7:
        axis = _circle_axis(state, numbers[3:6])
        return Circle(state.scaled(numbers[:3]), axis, numbers[6] * state.scale)
    raise state.fail(f"TLON,GOFWD/ along ({given[0]}/...)", "(CIRCLE/x,y,z,r) or (CYLNDR/x,y,z,i,j,k,r)")


def _tlon_line(state: State, given: Nested) -> tuple[Vector, Vector]:
    """The line up to which the tool goes: two points, of CATIA's plane the two that it goes through."""
    numbers = [value for value in given[1] if isinstance(value, float)]
    if given[0] == "LINE" and len(given[1]) == len(numbers) == 6:
        return state.scaled(numbers[:3]), state.scaled(numbers[3:])
    points = [value for value in given[1] if isinstance(value, tuple) and value[0] == "POINT"]
    if given[0] == "PLANE" and given[1][0] == "PERPTO" and len(given[1]) == 4 and len(points) == 2:
        ends = [[value for value in point[1] if isinstance(value, float)] for point in points]
        if all(len(end) == 3 for end in ends):
            return state.scaled(ends[0]), state.scaled(ends[1])
    raise state.fail(f"TLON,GOFWD/ up to ({given[0]}/...)", "(LINE/x,y,z,x,y,z)")


_POINT = "/x,y,z[,i,j,k]"
_FOLLOWS = "the next motion follows a circle"
MOTION_WORDS = (
    Word("GOTO", goto, "the tool moves to a point", ALL, ISO, _POINT),
    Word("", more_points, "further points of the GOTO before it", CREO, PTC, "x,y,z[,i,j,k]"),
    Word("GODLTA", godlta, "the tool moves by a distance", "", ISO, _POINT),
    Word("FROM", from_, "the tool stands at a point", ALL, ISO, _POINT),
    Word("RAPID", rapid, "the next motion is rapid", ALL, ISO),
    Word("GOHOME", gohome, HOME, NX, SIEMENS, " without a point", DOUBTFUL),
    Word("CIRCLE", circle, _FOLLOWS, f"{CREO}, {NX}, {AUTODESK}", f"{PTC}; {SIEMENS}", "/x,y,z,i,j,k[,r[,t,f,d,e]]"),
    Word("MOVARC", movarc, _FOLLOWS, AUTODESK, ISO, "/x,y,z,i,j,k,r,ANGLE,a"),
    Word("INDIRV", indirv, "direction in which the next circle begins", f"{CATIA}, {CREO}", APT, "/i,j,k"),
    Word("TLON,GOFWD", tlon, "the tool moves along a circle", f"{CATIA}, {CREO}", DASSAULT, "/(...),ON,(...)"),
)
