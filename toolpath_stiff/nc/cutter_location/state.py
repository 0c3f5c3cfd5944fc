"""The state of a cutter-location file being read, what a word is, and the moves of the tool tip that words record.

A word is a function of the state and its statement. Moves go straight, along circles and into holes, with the tool axis
turning meanwhile; they begin where the tool stands and belong to the line of the statement being executed. They raise
`AxisError` and `ArcError`, which know no line, and `InputError`, which does. mm, degrees, mm/min.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.hints import both_names
from toolpath_stiff.nc.cutter_location import geometry
from toolpath_stiff.nc.cutter_location.geometry import VERTICAL, Circle
from toolpath_stiff.nc.cutter_location.statements import Statement, number_of
from toolpath_stiff.nc.geometry import Drilling, Vector, strokes
from toolpath_stiff.nc.moves import ARC, CYCLE, RAPID, Arc, Recorder, ToolUse
from toolpath_stiff.nc.tables import LARGEST_MM, ToolEntry, tool_of

if TYPE_CHECKING:
    from toolpath_stiff.nc.cutter_location.statements import Argument


@dataclass(frozen=True)
class Cycle:
    """A drilling cycle: the hole, heights from the GOTO point in mm; its feed in mm/min or mm per revolution."""

    hole: Drilling
    feed: float
    per_revolution: bool


@dataclass
class Noted:
    """A word that was not acted upon: where it stands first, and how often."""

    statement: Statement
    reason: str
    count: int = 1

    @property
    def times(self) -> str:
        """How often, for a message; empty if once."""
        return f" ({self.count} times)" if self.count > 1 else ""


@dataclass
class State:
    """What is in force after the statements so far; every word is a function of this and its statement."""

    name: str  # of the file, for messages
    tools: dict[int, ToolEntry] | None
    statement: Statement = field(default_factory=lambda: Statement(1, 1, ""))  # being executed
    last_word: str = ""  # of the statement before
    ended: bool = False

    # Units, feed, spindle.
    scale: float = 1.0  # mm of the length unit
    units_said: bool = False
    feed: float | None = None  # mm/min, or mm per revolution
    per_revolution: bool = False
    speed: float = 0.0
    revolutions: float = 0.0  # that SPINDL/ON goes back to
    frames: dict[str, tuple[float, ...]] = field(default_factory=dict)  # who names a coordinate system: its numbers

    # The tool.
    tool: int = 0
    tool_length: float = math.nan
    diameter: float = math.nan
    tool_name: str = ""
    cutter_at: int = 0  # moves before the last CUTTER

    # Where the tool stands.
    point: Vector | None = None
    axis: Vector = VERTICAL
    angles: tuple[float, float] = (0.0, 0.0)
    heading: Vector | None = None  # direction of the straight move before

    # What the next motion is.
    rapid: int = 0  # line of the RAPID that waits for its motion
    multax: bool | None = None
    next_axis: Vector = VERTICAL  # of a point that gives none
    axis_said: bool = True  # false where MULTAX/OFF leaves open how the tool stands
    direction: Vector | None = None  # of INDIRV
    circle: Circle | None = None  # waits for its GOTO
    circle_line: int = 0
    followed: Circle | None = None  # whose arc the last GOTO made
    swept: float = 0.0  # rad, along that circle
    cycle: Cycle | None = None

    # What was found.
    recorder: Recorder = field(default_factory=Recorder)
    used_tools: dict[int, ToolUse] = field(default_factory=dict)
    marks: list[tuple[int, str]] = field(default_factory=list)  # line and name of each operation
    assumptions: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    noted: dict[str, Noted] = field(default_factory=dict)
    doubtful: dict[str, Noted] = field(default_factory=dict)
    smooth: int = 0  # arcs that a straight move enters smoothly, and would turn back into
    unsmooth: int = 0
    first_unsmooth: int = 0

    def fail(self, found: str, expected: str = "", hint: str = "", at: Argument | None = None) -> InputError:
        """The error for the statement being executed."""
        place = at or self.statement
        return ProgramError(
            found, expected=expected, hint=hint, file=self.name, line=place.line, column=max(place.column, 1)
        )

    def note(self, table: dict[str, Noted], reason: str) -> None:
        """Note in a table that the word being executed is not acted upon."""
        word = self.statement.word
        if word in table:
            table[word].count += 1
        else:
            table[word] = Noted(self.statement, reason)

    def assume(self, text: str) -> None:
        """Note an assumption, once."""
        if text not in self.assumptions:
            self.assumptions.append(text)

    def number(self, argument: Argument, what: str = "a number") -> float:
        """The number of an argument. Raises `InputError`."""
        return number_of(argument, self.name, what)

    def numbers(self, statement: Statement, *counts: int) -> list[float]:
        """All arguments as numbers; there must be one of `counts` of them."""
        numbers = [self.number(argument) for argument in statement.arguments]
        if len(numbers) not in counts:
            expected = " or ".join(str(count) for count in counts)
            raise self.fail(f"{statement.word}/ with {len(numbers)} numbers", f"{expected} numbers")
        return numbers

    def scaled(self, numbers: list[float]) -> Vector:
        """The point of three numbers of the file, in mm."""
        scale = self.scale
        x, y, z = numbers[0] * scale, numbers[1] * scale, numbers[2] * scale
        if max(abs(x), abs(y), abs(z)) > LARGEST_MM:
            raise self.fail(f"a point at {x:g}, {y:g}, {z:g} mm", f"within {LARGEST_MM:g} mm")
        return (x, y, z)

    def no_circle(self, what: str) -> None:
        """Refuse `what` while a circle waits for its GOTO."""
        if self.circle is not None:
            raise self.fail(f"{what} while the circle of line {self.circle_line} waits for its GOTO", "GOTO/")

    def feed_per_minute(self, feed: float, per_revolution: bool) -> float:
        """mm/min of a feed that may be per revolution."""
        if not per_revolution:
            return feed
        if not self.speed > 0.0:
            raise self.fail("a feed per revolution without a spindle speed", "SPINDL/ with RPM before it")
        return feed * self.speed


Act = Callable[[State, Statement], None]


# What becomes of a word.
READ, LISTED, DOUBTFUL, REFUSED = "read", "listed", "listed, with a warning", "refused"


# Who writes it.
ALL, CREO, NX, CATIA, AUTODESK, CAMPLETE = "all", "Creo", "NX", "CATIA", "Autodesk", "Autodesk for CAMplete"


# Where it is described.
ISO, APT = "ISO 4343", "ISO 4342, the APT language"


PTC, SIEMENS = 'PTC, "Supported CL Data Commands"', 'Siemens NX, "CLSF Manager"'


DASSAULT, POSTS = "Dassault, CATIA's help on APT import", "Autodesk's APT posts"


VERICUT, MANUALS = 'Vericut, "Supported APT-CLS NC Program Records"', "manuals of post processors"


@dataclass(frozen=True)
class Word:
    """A major word of a statement.

    Attributes
    ----------
    name
        Upper case; "" is a line of numbers alone.
    act
        Executes a statement of it.
    meaning
        What it is taken for, as `tps check` lists it; of a refused word what it does.
    written_by, source
        Which CAM systems write it, "" where that is not known; where it is described.
    form
        The arguments that are read, as the documentation shows them.
    kind
        READ, LISTED, DOUBTFUL or REFUSED: what becomes of it.
    """

    name: str
    act: Act
    meaning: str
    written_by: str
    source: str
    form: str = ""
    kind: str = READ


FIRST_POINT = "the path begins at the file's first point; where the tool comes from is not given (no FROM)"


FREE_YAW = "the turn of the tool about its own axis (yaw) is free in a cutter-location file; it is 0"


TURN_FEED = "where the tool turns about its standing tip, a feed of 1 mm/min counts as 1 degree per minute"


PECKS = "a drilling cycle with STEP or INCR ends its rapids 0.254 mm above the last depth, as LinuxCNC does"


NOT_MOVED = (False, False)


def stand(state: State, point: Vector, axis: Vector) -> None:
    """The tool stands somewhere; how it got there is not part of the path."""
    state.point, state.axis, state.heading = point, axis, None
    state.angles = geometry.angles_near(axis, state.angles)
    if axis != VERTICAL:
        state.assume(FREE_YAW)


def straight(state: State, motion: int, target: Vector, axis: Vector) -> None:
    """A straight move of the tip to a point, where the tool has an axis."""
    start = state.point
    if start is None:
        stand(state, target, axis)
        state.assume(FIRST_POINT)
        return
    if axis == state.axis:
        if target != start:
            _add(state, motion, target, state.angles, _feed(state, motion))
            state.heading = geometry.minus(target, start)
        return
    whole = geometry.minus(target, start)
    _turning(state, motion, target, axis, lambda share: geometry.along(start, whole, share), None)
    state.heading = whole if target != start else state.heading


def circular(state: State, circle: Circle, target: Vector, axis: Vector) -> float:
    """A move of the tip along a circle; its sweep in rad."""
    start = state.point
    assert start is not None
    arc = geometry.arc_to(circle, start, target)
    if axis == state.axis:
        _add(state, ARC, target, state.angles, _feed(state, ARC), arc)
    else:
        _turning(state, ARC, target, axis, lambda share: geometry.part_of(arc, start, target, share), arc)
    state.heading = None
    return arc.sweep


def drill(state: State, target: Vector, axis: Vector, hole: Drilling, feed: float) -> None:
    """A drilled hole at a point: heights of `hole` count from the point, along the tool axis."""
    start = state.point
    if start is None:
        start = geometry.along(target, axis, hole.clear)
        stand(state, start, axis)
        state.assume(FIRST_POINT)
    here = geometry.dot(geometry.minus(start, target), state.axis)
    level = max(here, hole.clear, hole.retract)
    # Up to the level of the holes first, where the tool is below it; then across, then down.
    _to_height(state, RAPID, geometry.along(start, state.axis, -here), level, math.nan)
    for height, motion, dwell in [
        (level, RAPID, 0.0),
        (hole.retract, RAPID, 0.0),
        *((stroke.height, CYCLE if stroke.feed else RAPID, stroke.dwell) for stroke in strokes(hole)),
    ]:
        _to_height(state, motion, target, height, feed)
        if dwell:
            state.recorder.add_dwell(dwell)
    if hole.peck:
        state.assume(PECKS)
    state.heading = None


def _to_height(state: State, motion: int, target: Vector, height: float, feed: float) -> None:
    point = geometry.along(target, state.axis, height)
    if state.point is not None and math.dist(point, state.point) > 1e-9:
        _add(state, motion, point, state.angles, feed)


def _turning(
    state: State, motion: int, target: Vector, axis: Vector, point_at: Callable[[float], Vector], arc: Arc | None
) -> None:
    """A move whose tool axis turns, in as many parts as keep the axis near its great circle."""
    first, angles = state.axis, state.angles
    parts = geometry.division(first, axis)
    still = arc is None and state.point == target
    feed = _feed(state, motion)
    if still and motion != RAPID:
        state.assume(TURN_FEED)
    state.assume(FREE_YAW)
    for part in range(1, parts + 1):
        share = part / parts
        end = target if part == parts or still else point_at(share)
        turned = axis if part == parts else geometry.on_great_circle(first, axis, share)
        angles = geometry.angles_near(turned, angles)
        piece = None
        if arc is not None:
            climb = geometry.dot(geometry.minus(target, arc.center), arc.normal)
            center = geometry.along(arc.center, arc.normal, climb * (part - 1) / parts)
            piece = Arc(center, arc.normal, arc.sweep / parts)
        _add(state, motion, end, angles, feed, piece)
    state.axis = axis


def _add(
    state: State, motion: int, end: Vector, angles: tuple[float, float], feed: float, arc: Arc | None = None
) -> None:
    assert state.point is not None
    start = [*state.point, *state.angles, 0.0]
    tool, line = state.tool, state.statement.line
    added = state.recorder.add(line, motion, start, [*end, *angles, 0.0], feed, tool, state.tool_length, NOT_MOVED, arc)
    state.point, state.angles = end, angles
    if added and tool not in state.used_tools:
        state.used_tools[tool] = _tool_use(state)


def _tool_use(state: State) -> ToolUse:
    """The tool in the spindle; the tool table wins over the file."""
    entry = tool_of(state.tools, state.tool)
    diameter = state.diameter if math.isnan(entry.diameter) else entry.diameter
    remark = entry.remark or state.tool_name
    return replace(entry, length=state.tool_length, diameter=diameter, remark=remark).in_use()


def _feed(state: State, motion: int) -> float:
    """mm/min; for a tip that stands still the same number of degrees per minute."""
    if motion == RAPID:
        return math.nan
    if state.feed is None:
        raise state.fail(
            "a cut before any feed",
            f"FEDRAT/ with a feed above 0, or {both_names('--feed', 'MM_PER_MIN')} for such cuts",
        )
    return state.feed_per_minute(state.feed, state.per_revolution)
