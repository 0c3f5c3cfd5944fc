"""Words of a cutter-location file that move the tool: points, and circles that the next point ends."""

import math
import re
from dataclasses import replace

from toolpath_stiff.nc.cutter_location import circles
from toolpath_stiff.nc.cutter_location.circles import VERTICAL, Circle
from toolpath_stiff.nc.cutter_location.state import CutterLocationState, drill, move, stand
from toolpath_stiff.nc.cutter_location.statements import MajorStatement, is_number, number
from toolpath_stiff.nc.cutter_location.tool_axes import angle_of, unit_axis
from toolpath_stiff.nc.geometry import Vector
from toolpath_stiff.nc.moves import ARC, FEED, RAPID, Remark

HOME = "home is the control's: the way there is not part of the path"
CIRCLE_AXIS = "a circle's axis"
ROUNDING = 1e-3  # rad, of the arcs that make a whole turn
GEOMETRY = re.compile(r"\(\s*(CIRCLE|CYLNDR|LINE)\s*/([^()]*)\)", re.IGNORECASE)
PLANE = re.compile(r"\(\s*PLANE\s*/\s*PERPTO\s*,.*\)", re.IGNORECASE)
POINT = re.compile(r"\(\s*POINT\s*/([^()]*)\)", re.IGNORECASE)


def goto(state: CutterLocationState, statement: MajorStatement) -> None:
    """A point; on a circle several points, too."""
    numbers = [state.number(argument) for argument in statement.arguments]
    if len(numbers) in (3, 6):
        to_point(state, numbers)
    elif state.circle is not None and len(numbers) >= 9 and len(numbers) % 3 == 0 and not state.multax:
        targets = [state.scaled(numbers[i : i + 3]) for i in range(0, len(numbers), 3)]
        _arc_through(state, targets, state.next_axis)
    else:
        raise state.fail(f"GOTO/ with {len(numbers)} numbers", "x,y,z or x,y,z,i,j,k")


def more_points(state: CutterLocationState, statement: MajorStatement) -> None:
    """A line of numbers alone after GOTO: the next point (Creo writes arcs so)."""
    if state.last_word != "GOTO":
        raise state.fail(f"{statement.text[:30]!r} is not a statement", "a word, / and its arguments")
    state.circle = state.followed
    to_point(state, state.numbers(statement, 3, 6))


def to_point(state: CutterLocationState, numbers: list[float]) -> None:
    """A point, with its tool axis or the one in force: the end of a move or an arc, or a hole."""
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
    if len(numbers) == 6:
        axis = unit_axis(numbers[3:])
        if state.multax is False and axis != VERTICAL:
            raise state.fail("a tilted tool axis after MULTAX/OFF", "MULTAX/ON before it, or x,y,z alone")
        state.next_axis, state.axis_known = axis, True
        return axis
    if not state.axis_known:
        raise state.fail("a point without its tool axis after MULTAX/OFF and a tilted tool", "x,y,z,i,j,k or TLAXIS")
    return state.next_axis


def _go(state: CutterLocationState, target: Vector, axis: Vector) -> None:
    motion = RAPID if state.rapid else FEED
    state.rapid, state.followed, state.direction = 0, None, None
    move(state, motion, target, axis)


def godlta(state: CutterLocationState, statement: MajorStatement) -> None:
    """A point by its distance from the last one."""
    if state.point is None:
        raise state.fail("GODLTA/ before any point", "FROM/ or GOTO/ before it")
    numbers = state.numbers(statement, 3, 6)
    if state.circle is not None or state.hole is not None:
        raise state.fail("GODLTA/ on a circle or in a cycle", "GOTO/")
    axis = _axis_of(state, numbers)
    x, y, z = (p + d for p, d in zip(state.point, state.scaled(numbers[:3]), strict=True))
    _go(state, (x, y, z), axis)


def from_(state: CutterLocationState, statement: MajorStatement) -> None:
    """The point at which the tool stands."""
    numbers = state.numbers(statement, 3, 6)
    axis = _axis_of(state, numbers)
    if len(state.recorder):
        text = "FROM within the path: the tool is taken to stand there; how it got there is not given"
        state.warnings.append(Remark(text, statement.line))
    state.no_circle("FROM/")
    stand(state, state.scaled(numbers[:3]), axis)


def gohome(state: CutterLocationState, statement: MajorStatement) -> None:
    """NX gives the point of home; without one it is the control's."""
    if statement.arguments:
        to_point(state, state.numbers(statement, 3, 6))
        return
    state.no_circle("GOHOME")
    state.rapid = 0
    state.note(HOME, doubtful=True)


def rapid(state: CutterLocationState, statement: MajorStatement) -> None:
    """The next motion, and no other, is rapid."""
    if statement.arguments:
        raise state.fail(statement.shown, "RAPID alone")
    if state.circle is not None:
        raise state.fail("RAPID before the GOTO of a circle", "an arc at a feed")
    if state.hole is not None:
        raise state.fail("RAPID within a drilling cycle: is the next point a hole?", "CYCLE/OFF before it")
    state.rapid = statement.line


def circle(state: CutterLocationState, statement: MajorStatement) -> None:
    """A circle in the forms of PTC, NX and APT."""
    times = 1
    arguments = statement.arguments
    if len(arguments) > 2 and arguments[-2].upper() == "TIMES":
        count = state.number(arguments[-1])
        if count != int(count) or not 1 <= count <= 10000:
            raise state.fail(statement.shown, "TIMES and a whole number of turns")
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
        axis, radius = unit_axis(numbers[3:6], CIRCLE_AXIS), numbers[6] if len(numbers) > 6 else math.nan
        if len(numbers) == 11:
            axis = (-axis[0], -axis[1], -axis[2])
    _await_circle(state, Circle(center, axis, radius * state.scale, times))


def movarc(state: CutterLocationState, statement: MajorStatement) -> None:
    """A circle by the right hand, and the angle that is cut."""
    if len(statement.words) != 9 or statement.words[7] != "ANGLE":
        raise state.fail(statement.shown, "MOVARC/x,y,z,i,j,k,r,ANGLE,a")
    *arguments, _, last = statement.arguments
    numbers, angle = [state.number(argument) for argument in arguments], state.number(last)
    if not 0.0 < angle <= 3.6e6:
        raise state.fail(f"an arc of {angle:g} degrees", "an angle above 0")
    axis = unit_axis(numbers[3:6], CIRCLE_AXIS)
    _await_circle(state, Circle(state.scaled(numbers[:3]), axis, numbers[6] * state.scale, sweep=angle))


def indirv(state: CutterLocationState, statement: MajorStatement) -> None:
    """The direction at the start, which says which way round."""
    x, y, z = state.numbers(statement, 3)
    state.direction = (x, y, z)


def _await_circle(state: CutterLocationState, circle: Circle) -> Circle:
    """The circle that the next point ends, turned as INDIRV says."""
    if state.rapid:
        raise state.fail(f"an arc after the RAPID of line {state.rapid}", "a rapid to a point, or an arc at a feed")
    if state.hole is not None:
        raise state.fail("an arc within a drilling cycle", "CYCLE/OFF before it")
    state.no_circle("a circle")
    if state.point is None:
        raise state.fail("an arc before any point", "FROM/ or GOTO/ before it")
    if state.direction is not None:
        axis = circles.turned_as(circle.center, circle.axis, state.point, state.direction)
        circle, state.direction = replace(circle, axis=axis), None
    state.circle, state.circle_line, state.swept = circle, state.statement.line, 0.0
    # A straight move goes on into an arc smoothly, as it nearly always does, or would turn back.
    tangent = circles.cross(circle.axis, circles.minus(state.point, circle.center))
    angle = angle_of(tangent, state.heading) if state.heading is not None else math.nan
    if angle < circles.SMOOTH_DEG:
        state.smooth += 1
    elif angle > 180.0 - circles.SMOOTH_DEG:
        state.unsmooth += 1
        state.first_unsmooth = state.first_unsmooth or state.statement.line
    return circle


def _arc_through(state: CutterLocationState, targets: list[Vector], axis: Vector) -> None:
    """Follow the circle that waits through points; the last one ends the arc."""
    circle = state.circle
    assert circle is not None
    state.circle, state.followed = None, circle
    for target in targets:
        if state.swept and circle.sweep is not None:
            raise state.fail("a second point of an arc whose ANGLE is given", "one point")
        assert state.point is not None
        arc = circles.arc_to(circle, state.point, target)
        move(state, ARC, target, axis, arc)
        state.swept += arc.sweep
        if circle.sweep is None and state.swept > math.tau * circle.turns + ROUNDING:
            raise state.fail(
                "points of an arc that do not follow each other in its direction", "points in the order of the cut"
            )


def tlon(state: CutterLocationState, statement: MajorStatement) -> None:
    """CATIA's and Creo's arcs in APT's own words."""
    if state.direction is None:
        raise state.fail("TLON,GOFWD/ without its direction", "INDIRV/ before it")
    texts, words, which = list(statement.arguments), statement.words, 1
    if len(words) == 5 and words[2] in ("1", "2") and words[3] == "INTOF":
        texts, which = [texts[0], texts[1], texts[4]], int(words[2])
    if len(texts) != 3 or words[1] != "ON" or not texts[0].startswith("(") or not texts[2].startswith("("):
        raise state.fail(statement.shown, "TLON,GOFWD/(CIRCLE/x,y,z,r),ON,(LINE/x,y,z,x,y,z), or CATIA's (CYLNDR/...)")
    line = _line(state, texts[2])
    circle = _await_circle(state, _circle(state, texts[0]))
    assert state.point is not None
    _arc_through(state, [circles.line_meets(circle, state.point, line, which)], state.next_axis)
    state.followed = None


def _circle(state: CutterLocationState, text: str) -> Circle:
    """The circle of (CIRCLE/...) or (CYLNDR/...)."""
    word, numbers = _geometry(text)
    if word == "CIRCLE" and len(numbers) == 4:
        return Circle(state.scaled(numbers[:3]), VERTICAL, numbers[3] * state.scale)
    if word in ("CYLNDR", "CIRCLE") and len(numbers) == 7:
        axis = unit_axis(numbers[3:6], CIRCLE_AXIS)
        return Circle(state.scaled(numbers[:3]), axis, numbers[6] * state.scale)
    raise state.fail(f"TLON,GOFWD/ along {text[:40]}", "(CIRCLE/x,y,z,r) or (CYLNDR/x,y,z,i,j,k,r)")


def _line(state: CutterLocationState, text: str) -> tuple[Vector, Vector]:
    """The line up to which the tool goes: two points, of CATIA's plane the two that it goes through."""
    word, numbers = _geometry(text)
    if PLANE.fullmatch(text):
        word, numbers = "LINE", [value for point in POINT.findall(text)[-2:] for value in _numbers(point)]
    if word == "LINE" and len(numbers) == 6:
        return state.scaled(numbers[:3]), state.scaled(numbers[3:])
    raise state.fail(f"TLON,GOFWD/ up to {text[:40]}", "(LINE/x,y,z,x,y,z)")


def _geometry(text: str) -> tuple[str, list[float]]:
    """Word and numbers of a geometry in parentheses; none of what is no such circles."""
    match = GEOMETRY.fullmatch(text)
    return (match[1].upper(), _numbers(match[2])) if match else ("", [])


def _numbers(text: str) -> list[float]:
    """The numbers between commas, none if one of them is none."""
    parts = [part.strip() for part in text.split(",")]
    return [number(part) for part in parts] if all(map(is_number, parts)) else []
