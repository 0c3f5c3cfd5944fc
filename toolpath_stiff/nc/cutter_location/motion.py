"""Words of a cutter-location file that move the tool: points, and circles that the next point ends."""

import math
import re

from toolpath_stiff.nc.cutter_location import circles
from toolpath_stiff.nc.cutter_location.circles import VERTICAL, Circle
from toolpath_stiff.nc.cutter_location.state import CutterLocationState, drill, move, stand
from toolpath_stiff.nc.cutter_location.statements import MajorStatement, is_number, number
from toolpath_stiff.nc.geometry import Vector, cross
from toolpath_stiff.nc.moves import ARC, FEED, RAPID, Remark
from toolpath_stiff.nc.tool_axes import angle_of, unit_axis

HOME = "home is the control's: the way there is not part of the path"
CIRCLE_AXIS = "a circle's axis"
ROUNDING = 1e-3  # rad, of the arcs that make a whole turn
# Elements that TLON,GOFWD/ follows and ends at: a line, or the plane through two points (CATIA).
_POINT = r"\(\s*POINT\s*/([^()]*)\)"
CIRCLE = re.compile(r"\(\s*(?:CIRCLE|CYLNDR)\s*/([^()]*)\)", re.IGNORECASE)
END = re.compile(r"\(\s*LINE\s*/([^()]*)\)", re.IGNORECASE)
PLANE = re.compile(rf"\(\s*PLANE\s*/\s*PERPTO\s*,.*{_POINT}\s*,\s*{_POINT}\s*\)", re.IGNORECASE)


def goto(state: CutterLocationState, statement: MajorStatement) -> None:
    """Go to a point; on a circle also through several points."""
    numbers = [state.number(argument) for argument in statement.arguments]
    if len(numbers) in (3, 6):
        to_point(state, numbers)
    elif state.circle is not None and len(numbers) >= 9 and len(numbers) % 3 == 0 and not state.multax:
        targets = [state.scaled(numbers[i : i + 3]) for i in range(0, len(numbers), 3)]
        _arc_through(state, targets, _axis_of(state, []))
    else:
        raise state.fail(f"GOTO/ with {len(numbers)} numbers", "x,y,z or x,y,z,i,j,k")


def more_points(state: CutterLocationState, statement: MajorStatement) -> None:
    """Take a line of numbers alone after GOTO as the next point (Creo writes arcs so)."""
    state.refuse_if(state.last_word != "GOTO", f"{statement.text[:30]!r} is not a statement", "a word, /, arguments")
    state.circle = state.followed
    to_point(state, state.numbers(statement, 3, 6))


def to_point(state: CutterLocationState, numbers: list[float]) -> None:
    """Go to a point with its own tool axis or the one in force: the end of a move or an arc, or a hole."""
    axis = _axis_of(state, numbers)
    target = state.scaled(numbers[:3])
    if state.circle is not None:
        _arc_through(state, [target], axis)
    elif state.hole is not None:
        state.rapid, state.followed = 0, None
        drill(state, target, axis, state.hole)
    else:
        _go(state, target, axis)


def _axis_of(state: CutterLocationState, numbers: list[float]) -> Vector:
    """Tool axis given with a point, or the one in force."""
    if len(numbers) == 6:
        axis = unit_axis(numbers[3:])
        tilted = state.multax is False and axis != VERTICAL
        state.refuse_if(tilted, "a tilted tool axis after MULTAX/OFF", "MULTAX/ON before it, or x,y,z alone")
        state.next_axis = axis
    if state.next_axis is None:
        raise state.fail("a point without its tool axis after MULTAX/OFF and a tilted tool", "x,y,z,i,j,k or TLAXIS")
    return state.next_axis


def _go(state: CutterLocationState, target: Vector, axis: Vector) -> None:
    motion = RAPID if state.rapid else FEED
    state.rapid, state.followed, state.direction = 0, None, None
    move(state, motion, target, axis)


def godlta(state: CutterLocationState, statement: MajorStatement) -> None:
    """Go to a point by its distance from the last one."""
    if state.point is None:
        raise state.fail("GODLTA/ before any point", "FROM/ or GOTO/ before it")
    numbers = state.numbers(statement, 3, 6)
    state.refuse_if(state.circle or state.hole, "GODLTA/ on a circle or in a cycle", "GOTO/")
    axis = _axis_of(state, numbers)
    x, y, z = (p + d for p, d in zip(state.point, state.scaled(numbers[:3]), strict=True))
    _go(state, (x, y, z), axis)


def from_(state: CutterLocationState, statement: MajorStatement) -> None:
    """Set the point at which the tool stands."""
    numbers = state.numbers(statement, 3, 6)
    axis = _axis_of(state, numbers)
    if len(state.recorder):
        text = "FROM within the path: the tool is assumed to be there; the way to this point is not given"
        state.warnings.append(Remark(text, statement.line))
    state.no_circle("FROM/")
    stand(state, state.scaled(numbers[:3]), axis)


def gohome(state: CutterLocationState, statement: MajorStatement) -> None:
    """Go home: NX gives the point; without one it is the control's."""
    if statement.arguments:
        to_point(state, state.numbers(statement, 3, 6))
        return
    state.no_circle("GOHOME")
    state.rapid = 0
    state.note(HOME, doubtful=True)


def rapid(state: CutterLocationState, statement: MajorStatement) -> None:
    """Make the next motion, and no other, rapid."""
    state.refuse_if(statement.arguments, statement.shown, "RAPID alone")
    state.no_circle("RAPID")
    state.refuse_if(state.hole, "RAPID within a drilling cycle: is the next point a hole?", "CYCLE/OFF before it")
    state.rapid = statement.line


def circle(state: CutterLocationState, statement: MajorStatement) -> None:
    """Take a circle in the forms of PTC, NX and APT."""
    _await_circle(state, [state.number(argument) for argument in statement.arguments])


def movarc(state: CutterLocationState, statement: MajorStatement) -> None:
    """Take a circle by the right hand, and the angle that is cut."""
    state.refuse_if(
        statement.words[7:8] != ["ANGLE"] or statement.words[9:], statement.shown, "MOVARC/x,y,z,i,j,k,r,ANGLE,a"
    )
    *arguments, _, last = statement.arguments
    angle = state.number(last)
    state.refuse_if(not 0.0 < angle <= 3.6e6, f"an arc of {angle:g} degrees", "an angle above 0")
    _await_circle(state, [state.number(argument) for argument in arguments], sweep=angle)


def indirv(state: CutterLocationState, statement: MajorStatement) -> None:
    """Take the direction at the start, which decides the sense of rotation."""
    x, y, z = state.numbers(statement, 3)
    state.direction = (x, y, z)


def _await_circle(state: CutterLocationState, numbers: list[float], sweep: float | None = None) -> Circle:
    """Set the circle that the next point ends, turned as INDIRV says."""
    state.refuse_if(state.rapid, f"an arc after the RAPID of line {state.rapid}", "a rapid to a point")
    state.refuse_if(state.hole, "an arc within a drilling cycle", "CYCLE/OFF before it")
    state.no_circle("a circle")
    if state.point is None:
        raise state.fail("an arc before any point", "FROM/ or GOTO/ before it")
    forms = "x,y,z,i,j,k,r or NX' x,y,z,i,j,k,r,t,f,d,e or x,y,z,r"
    state.refuse_if(len(numbers) not in (4, 6, 7, 11), f"{state.statement.word}/ with {len(numbers)} numbers", forms)
    no_way_round = len(numbers) == 4 and state.direction is None
    state.refuse_if(no_way_round, "CIRCLE/x,y,z,r, which does not say which way round", "INDIRV/ before it, or i,j,k")
    center = state.scaled(numbers[:3])
    axis = VERTICAL if len(numbers) == 4 else unit_axis(numbers[3:6], CIRCLE_AXIS)
    if len(numbers) == 11:
        axis = (-axis[0], -axis[1], -axis[2])
    if state.direction is not None:
        axis, state.direction = circles.turned_as(center, axis, state.point, state.direction), None
    radius = numbers[3] if len(numbers) == 4 else (*numbers[6:7], math.nan)[0]
    state.circle = Circle(center, axis, radius * state.scale, state.statement.line, sweep)
    state.swept = 0.0
    # A straight move enters the arc smoothly, as it nearly always does, or would turn back.
    tangent = cross(axis, circles.minus(state.point, center))
    angle = angle_of(tangent, state.heading) if state.heading is not None else math.nan
    state.smooth += angle < circles.SMOOTH_DEG
    if angle > 180.0 - circles.SMOOTH_DEG:
        state.turning_back.append(state.statement.line)
    return state.circle


def _arc_through(state: CutterLocationState, targets: list[Vector], axis: Vector) -> None:
    """Follow the waiting circle through points; the last one ends the arc."""
    circle = state.circle
    assert circle is not None
    state.circle, state.followed = None, circle
    for target in targets:
        state.refuse_if(state.swept and circle.sweep, "a second point of an arc whose ANGLE is given", "one point")
        assert state.point is not None
        arc = circles.arc_to(circle, state.point, target)
        move(state, ARC, target, axis, arc)
        state.swept += arc.sweep
        problem = "points of an arc that do not follow each other in its direction"
        beyond = circle.sweep is None and state.swept > math.tau + ROUNDING
        state.refuse_if(beyond, problem, "points in the order of the cut")


def tlon(state: CutterLocationState, statement: MajorStatement) -> None:
    """Arcs of CATIA and Creo in APT's own words."""
    state.refuse_if(state.direction is None, "TLON,GOFWD/ without its direction", "INDIRV/ before it")
    texts, words, which = list(statement.arguments), statement.words, 1
    if len(words) == 5 and words[2] in ("1", "2") and words[3] == "INTOF":
        texts, which = [texts[0], texts[1], texts[4]], int(words[2])
    state.refuse_if(
        len(texts) != 3 or words[1] != "ON" or not texts[0].startswith("(") or not texts[2].startswith("("),
        statement.shown,
        "TLON,GOFWD/(CIRCLE/x,y,z,r),ON,(LINE/x,y,z,x,y,z), or CATIA's (CYLNDR/...)",
    )
    ends = _numbers(END.fullmatch(texts[2]) or PLANE.fullmatch(texts[2]))
    state.refuse_if(len(ends) != 6, f"TLON,GOFWD/ up to {texts[2][:40]}", "(LINE/x,y,z,x,y,z)")
    numbers = _numbers(CIRCLE.fullmatch(texts[0]))
    state.refuse_if(len(numbers) not in (4, 7), f"TLON,GOFWD/ along {texts[0][:40]}", "(CIRCLE/x,y,z,r), (CYLNDR/...)")
    circle = _await_circle(state, numbers)
    assert state.point is not None
    line = state.scaled(ends[:3]), state.scaled(ends[3:])
    _arc_through(state, [circles.line_meets(circle, state.point, line, which)], _axis_of(state, []))
    state.followed = None


def _numbers(geometry: re.Match[str] | None) -> list[float]:
    """Numbers of a geometry in parentheses; empty if there is no such geometry."""
    texts = [part.strip() for group in geometry.groups() for part in group.split(",")] if geometry else []
    return [number(text) for text in texts] if all(map(is_number, texts)) else []
