"""State of a cutter-location file being read, and the moves of the tool tip that its words record.

Moves go straight, along circles and into holes, with the tool axis turning meanwhile; they begin where the tool stands
and belong to the line of the statement being executed. They raise `GeometryError`, which knows no line, and
`InputError`, which does. mm, degrees, mm/min.
"""

import math
from dataclasses import dataclass, field, replace

from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.courses import point_on_arc
from toolpath_stiff.nc.cutter_location.circles import VERTICAL, Circle, along, minus
from toolpath_stiff.nc.cutter_location.statements import MajorStatement, is_number, number
from toolpath_stiff.nc.geometry import Vector, dot
from toolpath_stiff.nc.moves import RAPID, Arc, Move, Remark, Unsupported
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.state import Record
from toolpath_stiff.nc.strokes import Drilling, strokes
from toolpath_stiff.nc.tables import LARGEST_MM, tool_of
from toolpath_stiff.nc.tool_axes import angles_near, division, on_great_circle

FIRST_POINT = "the path begins at the file's first point; the start position of the tool is not given (no FROM)"
FREE_YAW = "the turn of the tool about its own axis (yaw) is free in a cutter-location file; it is 0"
TURN_FEED = "where the tool turns about its stationary tip, a feed of 1 mm/min counts as 1 degree per minute"
PECKS = "a drilling cycle with STEP or INCR ends its rapids 0.254 mm above the last depth, as LinuxCNC does"
NOT_MOVED = (False, False)


@dataclass
class CutterLocationState(Record):
    """Modes in force and everything made so far; every word is a function of this and its statement."""

    statement: MajorStatement = field(default_factory=lambda: MajorStatement(1, 1, ""))  # being executed
    last_word: str = ""  # of the statement before
    ended: bool = False

    # Units, feed, spindle.
    scale: float = 1.0  # mm of the length unit
    units_given: bool = False
    per_revolution: bool = False
    turn: float = 1.0  # -1: counter-clockwise; nan: a speed of the surface
    revolutions: float = 0.0  # that SPINDL/ON goes back to
    on_contour: bool = False  # Creo's OUTPUT_ON_PROFILE: points of the contour beside CUTCOM
    frames: dict[str, tuple[float, ...]] = field(default_factory=dict)  # naming word -> its numbers

    # The tool.
    diameter: float = math.nan
    tool_name: str = ""
    moves_before_cutter: int = 0

    # Position of the tool.
    point: Vector | None = None
    axis: Vector = VERTICAL
    angles: tuple[float, float] = (0.0, 0.0)
    heading: Vector | None = None  # direction of the straight move before

    # What the next motion is.
    rapid: int = 0  # line of the RAPID that waits for its motion
    multax: bool | None = None
    next_axis: Vector | None = VERTICAL  # axis of points that give none; None: left open by MULTAX/OFF
    direction: Vector | None = None  # of INDIRV
    circle: Circle | None = None  # waits for its GOTO
    followed: Circle | None = None  # whose arc the last GOTO made
    swept: float = 0.0  # rad, along that circle
    hole: Drilling | None = None  # drilled at each point: heights from the point in mm
    hole_feed: float = 0.0  # mm/min or mm per revolution
    hole_per_revolution: bool = False
    hole_from: Vector | None = None  # tool position before the cycle, to whose height each hole returns

    # Content of the file.
    marks: list[tuple[int, str]] = field(default_factory=list)  # line and name of each operation
    doubted: dict[str, Remark] = field(default_factory=dict)  # words not acted upon that deserve a warning
    smooth: int = 0  # arcs that a straight move enters smoothly
    turning_back: list[int] = field(default_factory=list)  # lines of those into which it would turn back

    def fail(self, problem: str, expected: str = "", hint: str = "") -> ProgramError:
        """Error for the statement being executed."""
        return Place(self.name, self.statement.line, self.statement.column).fail(problem, expected, hint)

    def refuse_if(self, refused: object, problem: str, expected: str = "", hint: str = "") -> None:
        """Raise the error for the statement being executed if `refused`."""
        if refused:
            raise self.fail(problem, expected, hint)

    def note(self, reason: str, doubtful: bool = False) -> None:
        """Note that the word being executed is not acted upon; `doubtful` makes it a warning."""
        line, column, word = self.statement.line, self.statement.column, self.statement.word
        if all(noted.word != word for noted in self.unsupported):
            self.unsupported.append(Unsupported(line, column, word, reason))
        if doubtful:
            self.doubted.setdefault(word, Remark(f"{self.statement.shown}: {reason}", line))

    def number(self, argument: str, expected: str = "a number") -> float:
        """The number of an argument. Raises `InputError`."""
        value = number(argument) if is_number(argument) else math.nan
        if not abs(value) <= LARGEST_MM * 100.0:
            raise self.fail(f"{argument[:30]!r}", expected, "names need APT's processor: give the file that it writes")
        return value

    def numbers(self, statement: MajorStatement, *counts: int) -> list[float]:
        """All arguments as numbers; their count must be among `counts`."""
        numbers = [self.number(argument) for argument in statement.arguments]
        expected = f"{' or '.join(map(str, counts))} numbers"
        self.refuse_if(len(numbers) not in counts, f"{statement.word}/ with {len(numbers)} numbers", expected)
        return numbers

    def scaled(self, numbers: list[float]) -> Vector:
        """Point of three numbers of the file, in mm."""
        scale = self.scale
        x, y, z = numbers[0] * scale, numbers[1] * scale, numbers[2] * scale
        if max(abs(x), abs(y), abs(z)) > LARGEST_MM:
            raise self.fail(f"a point at {x:g}, {y:g}, {z:g} mm", f"within {LARGEST_MM:g} mm")
        return (x, y, z)

    def no_circle(self, what: str) -> None:
        """Refuse `what` while a circle waits for its GOTO."""
        if self.circle is not None:
            raise self.fail(f"{what} while the circle of line {self.circle.line} waits for its GOTO", "GOTO/")

    def feed_per_minute(self, feed: float, per_revolution: bool) -> float:
        """Feed in mm/min, from one that may be per revolution."""
        if not per_revolution:
            return feed
        no_speed = not self.speed > 0.0
        self.refuse_if(no_speed, "a feed per revolution without a spindle speed", "SPINDL/ with RPM before it")
        return feed * self.speed


def stand(state: CutterLocationState, point: Vector, axis: Vector) -> None:
    """Put the tool at a point; its way there is not part of the path."""
    state.point, state.axis, state.heading = point, axis, None
    state.angles = angles_near(axis, state.angles)
    if axis != VERTICAL:
        state.assume(FREE_YAW)


def move(state: CutterLocationState, motion: int, target: Vector, axis: Vector, arc: Arc | None = None) -> None:
    """Record a move of the tip to a point, straight or along an arc, at the end of which the tool has `axis`.

    Where the axis turns, in as many parts as keep it near its great circle.
    """
    start, first, angles = state.point, state.axis, state.angles
    if start is None:
        stand(state, target, axis)
        state.assume(FIRST_POINT)
        return
    turns, still = axis != first, target == start
    if still and not turns and arc is None:
        return
    parts = division(first, axis) if turns else 1
    feed = math.nan
    if motion != RAPID:
        if state.feed is None:
            raise state.fail("a cut before any feed", "FEDRAT/ with a feed above 0, or --feed MM_PER_MIN for such cuts")
        # If the tip stands still, the same number as degrees per minute.
        feed = state.feed_per_minute(state.feed, state.per_revolution)
        if still and arc is None:
            state.assume(TURN_FEED)
    if turns:
        state.assume(FREE_YAW)
    whole = minus(target, start)
    for part in range(1, parts + 1):
        share, end, turned, piece = part / parts, target, axis, arc
        if part < parts:
            end = point_on_arc(arc, start, target, share) if arc else along(start, whole, share)
            turned = on_great_circle(first, axis, share)
        if turns:
            angles = angles_near(turned, angles)
        if arc is not None and parts > 1:
            climb = dot(minus(target, arc.center), arc.normal)
            piece = replace(
                arc, center=along(arc.center, arc.normal, climb * (part - 1) / parts), sweep=arc.sweep / parts
            )
        _add(state, motion, end, angles, feed, piece)
    state.axis = axis
    state.heading = None if arc is not None else state.heading if still else whole


def drill(state: CutterLocationState, target: Vector, axis: Vector, hole: Drilling) -> None:
    """Record the hole of the cycle in force at a point, along the tool axis."""
    leans = state.point is not None and axis != state.axis
    expected = "a GOTO/ before the cycle that turns the tool"
    state.refuse_if(leans, "a hole with another tool axis than the move before", expected)
    feed = state.feed_per_minute(state.hole_feed, state.hole_per_revolution)
    if state.hole_from is not None:
        hole = replace(hole, clear=max(hole.retract, dot(minus(state.hole_from, target), axis)))
    if state.point is None:
        stand(state, along(target, axis, hole.clear), axis)
        state.assume(FIRST_POINT)
    assert state.point is not None
    height = dot(minus(state.point, target), state.axis)
    level = max(height, hole.clear, hole.retract)
    # If the tool is below the level of the holes, up to it first; then across, then down.
    stops = [
        (along(state.point, axis, -height), level, RAPID, 0.0),
        (target, level, RAPID, 0.0),
        (target, hole.retract, RAPID, 0.0),
        *((target, *stroke) for stroke in strokes(hole)),
    ]
    for foot, above, motion, dwell in stops:
        point = along(foot, axis, above)
        if math.dist(point, state.point) > 1e-9:
            _add(state, motion, point, state.angles, feed)
        if dwell:
            state.recorder.add_dwell(dwell)
    if hole.peck:
        state.assume(PECKS)
    state.heading = None


def _add(
    state: CutterLocationState,
    motion: int,
    end: Vector,
    angles: tuple[float, float],
    feed: float,
    arc: Arc | None = None,
) -> None:
    assert state.point is not None
    start = [*state.point, *state.angles, 0.0]
    tool, there, spindle = state.tool, [*end, *angles, 0.0], state.turn * state.speed
    move = Move(state.statement.line, motion, start, there, feed, tool, state.tool_length, spindle, NOT_MOVED, arc)
    added = state.recorder.add(move)
    state.point, state.angles = end, angles
    if added and tool not in state.used_tools:  # the tool table wins over the file
        entry = tool_of(state.tools, tool)
        diameter = state.diameter if math.isnan(entry.diameter) else entry.diameter
        remark = entry.remark or state.tool_name
        state.used_tools[tool] = replace(entry, length=state.tool_length, diameter=diameter, remark=remark)
