"""Moves from the canonical commands that `rs274` prints.

Motions are given in program coordinates of the controlled point, in the active length unit; the frame is printed when
it changes. As measured (2.9): world = Rz(rotation) (program + g92) + g5x, spindle nose = world + tool length, and the
nose stands still when frame or tool length change. ARC_FEED has end 1, end 2, centre 1, centre 2, turns, axis end, a, b
and c; NURBS moves have no points. mm, degrees, mm/min inside, as in the built-in reader.

A line of the copy carries its number as a comment, which stays in order with the moves; the N word that is printed too
is that of the line being read, which cutter compensation reads ahead.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.kinematics import PostedKinematics
from toolpath_stiff.nc.linuxcnc import program_words
from toolpath_stiff.nc.linuxcnc.inputs import UNKNOWN_LENGTH_MM, Line
from toolpath_stiff.nc.moves import ARC, CYCLE, FEED, RAPID, Arc, Jump, Move
from toolpath_stiff.nc.request import ZERO
from toolpath_stiff.nc.state import Record
from toolpath_stiff.nc.tables import Offsets, tool_table_hint
from toolpath_stiff.nc.words import AXES
from toolpath_stiff.units import MM_PER_INCH

CALL = re.compile(r"^ *\d+ +N(?:\.+|(\d+)) *([A-Z][A-Z0-9_]*)\((.*)\) *$", re.MULTILINE)
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")
TURNS = {"START_SPINDLE_CLOCKWISE": 1, "START_SPINDLE_COUNTERCLOCKWISE": -1, "STOP_SPINDLE_TURNING": 0}
PLANES = {"XY": "G17", "XZ": "G18", "YZ": "G19"}
LENGTH_UNKNOWN_BELOW_MM = 0.9 * UNKNOWN_LENGTH_MM
SAME_PLACE = 2e-4  # two units in the last place printed, in the unit in force
ROUNDING = 1e-6  # far less than one of them

Vector = list[float]


@dataclass
class Follower(Record):
    """Interpreter of the canonical commands; `recorder` holds the moves in control coordinates less the `reference`.

    Here `feed` is mm/min or mm/rev, degrees/min where only rotary axes move.

    A command of LinuxCNC's canonical interface (src/emc/nml_intf/canon.hh), as `rs274` spells it, is a method, `_on_`
    before its name, which is given the text between its parentheses.
    """

    lines: Sequence[Line]
    posted: PostedKinematics | None
    numbers: Sequence[int]  # of the tools, in the order of their table
    reference: Sequence[float] = (0.0, 0.0, 0.0)
    jumps: list[Jump] = field(default_factory=list)
    first_motion: int | None = None

    scale: float = 1.0
    plane: str = "G17"
    feed_scale: float = 1.0
    feed_line: int = 0
    per_revolution: bool = False
    synchronised: float = 0.0
    turn: int = 0  # of the spindle: 1 clockwise, -1 the other way
    surface_speed: bool = False
    line: int = 0  # line that moves; 0: before the program
    reading: int = 0
    cycle: bool = False
    frame_changed: bool = False
    turned_by: int = 0
    raised: float = 0.0  # mm added to Z by changes of tool length since the last move
    lost: float = 0.0  # the same, forgotten by rs274 at a tool change
    moves_of_line: int = 0
    incremental: bool = False
    given: dict[str, float] = field(default_factory=dict)  # X, Y, Z of plain blocks, to the program's last digit
    steps: dict[str, float] = field(default_factory=dict)  # steps of this line from the point given before

    def __post_init__(self) -> None:
        self.frames = Frames(Offsets(), None, ZERO, posted=self.posted)  # whatever offset is in force is its G54
        self.fine = any(program_words.FINE_WORD.search(line.words) for line in self.lines)
        self.passed = [0]  # number of first lines that a run without jumps passes
        for line in self.lines:
            shows = line.words.strip("%") and not line.optional and not program_words.LEAVES.match(line.words)
            self.passed.append(self.passed[-1] + bool(shows))

    def follow(self, text: str) -> None:
        """Take every command. Raises `InputError` for what has no path: probing, splines, tools of unknown length."""
        for match in CALL.finditer(text):
            number, name, inner = match.groups()
            action = getattr(self, f"_on_{name.lower()}", None)
            if action is not None or name in program_words.REFUSED:
                self.reading = self.reading if number is None else int(number)
            if name in program_words.REFUSED:
                raise self.fail(*program_words.REFUSED[name])
            if action is not None:
                action(inner)
            self.turn = TURNS.get(name, self.turn)

    def fail(self, problem: str, expected: str = "", hint: str = "", line: int | None = None) -> InputError:
        """Error at a line of the program, by default at the line being read."""
        line = self.reading if line is None else line
        return ProgramError(problem, expected=expected, hint=hint, file=self.name, line=line or None)

    def _words(self, line: int) -> str:
        return self.lines[line - 1].plain if line else ""

    def _point(self, inner: str) -> Vector:
        """X, Y, Z as printed in mm, A, B, C in degrees."""
        return [v * self.scale if i < 3 else v for i, v in enumerate(_numbers(inner)[:6])]

    def _on_comment(self, inner: str) -> None:
        text = inner.strip('"')
        if text.isdigit():
            self._note_jump(int(text))
            self.line, self.moves_of_line = int(text), 0
            self._note_numbers(self.lines[self.line - 1])
            codes = program_words.MOTION_CODE.findall(self._words(self.line))
            if codes:
                self.cycle = codes[-1] in program_words.CYCLE_CODES
        elif text.startswith("interpreter: cutter radius compensation on"):
            self._check_diameter()

    def _note_jump(self, line: int) -> None:
        """Note a loop, condition or call: the line that the run left, or the line after which it goes on."""
        if line > self.line and self.passed[line - 1] == self.passed[self.line]:
            return
        left, after = self.line + 1, line - 1
        while left < len(self.lines) and not self.lines[left - 1].words:
            left += 1
        while after > 1 and not self.lines[after - 1].words:
            after -= 1
        left = left if program_words.LEAVES.match(self.lines[left - 1].words) else self.line
        after = after if program_words.LEAVES.match(self.lines[after - 1].words) else line - 1
        self.jumps.append(Jump(len(self.recorder), left, after))

    def _note_numbers(self, line: Line) -> None:
        for mode in program_words.DISTANCE_MODE.findall(line.plain):
            self.incremental = mode == "1"
        here, before = line.coordinates or {}, dict.fromkeys("XYZ", 0.0) if self.incremental else self.given
        self.steps = {axis: value - before.get(axis, math.nan) for axis, value in here.items()}
        self.given = {} if self.incremental or line.coordinates is None else self.given | here

    def _on_use_length_units(self, inner: str) -> None:
        scale = MM_PER_INCH if "INCH" in inner else 1.0
        if scale != self.scale and self.frames.tool:
            problem = "G20 or G21 changes the unit while a tool length is in force: LinuxCNC's rs274 loses the length"
            raise self.fail(problem, "G49 before it")
        self.frame_changed = True
        self.scale = scale
        if self.feed_line == self.reading:  # `G20 F20`: rs274 takes F first, controls mean inches
            self.feed_scale = scale

    def _on_set_g5x_offset(self, inner: str) -> None:
        self.frames.offsets.table[0].axes = self._point(inner.partition(",")[2])
        self.frame_changed = True

    def _on_set_g92_offset(self, inner: str) -> None:
        self.frames.g92 = self._point(inner)
        self.frame_changed = True

    def _on_set_xy_rotation(self, inner: str) -> None:
        rotation, offset = _numbers(inner)[0], self.frames.offsets.table[0]
        # G10 that turns the offset in force: rs274 keeps the old numbers of axes that the next move does not name.
        if rotation != offset.rotation and "G10" in self._words(self.reading):
            self.turned_by = self.reading
        offset.rotation = rotation
        self.frame_changed = True

    def _tool_named(self, letter: str) -> int:
        """Tool of an H or D word; for 0 or none, the one in the spindle."""
        named = re.search(rf"{letter}0*(\d+)(?![\d.])", self._words(self.reading))
        return int(named[1] if named else 0) or self.tool

    def _on_use_tool_length_offset(self, inner: str) -> None:
        x, y, z, *rest = (v * self.scale for v in _numbers(inner))
        if x or y or any(rest):
            raise self.fail("a tool offset in other directions than Z", "a length along Z alone")
        if z < LENGTH_UNKNOWN_BELOW_MM:
            missing = "and there is no tool table" if self.tools is None else "which the tool table does not give"
            named = tool_table_hint(self._tool_named("H"))
            hint = named if self.tools is None else "give it in a tool table (--tools FILE)"
            raise self.fail(f"G43 needs a tool's length, {missing}", hint=hint)
        self.raised += self.frames.tool - z
        self.frames.set_tool(z)
        cancelled = z == 0.0 and "G49" in self._words(self.reading)
        self.tool_length = math.nan if cancelled or not self.reading else z
        self.frame_changed = True

    def _check_diameter(self) -> None:
        """Refuse a tool without a diameter in the table: rs274 takes 0, and would compensate by zero."""
        words = self._words(self.reading)
        if "G41.1" in words or "G42.1" in words:
            return
        if "D" in words and not re.search(r"D\d+(?![\d.])", words):
            raise self.fail("the tool of G41 or G42 is computed", "D with a tool's number, or G41.1")
        number = self._tool_named("D")
        tool = (self.tools or {}).get(number)
        if tool is None or math.isnan(tool.diameter):
            hint = "give it in a tool table (--tools FILE)"
            raise self.fail(f"cutter compensation needs the diameter of tool {number}", hint=hint)

    def _on_change_tool(self, inner: str) -> None:
        place = int(_numbers(inner)[0])
        self.tool = self.numbers[place - 1] if place else 0
        self.lost, self.raised = self.lost + self.raised, 0.0

    def _on_select_plane(self, inner: str) -> None:
        name = inner.removeprefix("CANON_PLANE_")
        self.plane = PLANES.get(name, name)

    def _on_set_feed_rate(self, inner: str) -> None:
        self.feed, self.feed_scale, self.feed_line = _numbers(inner)[0], self.scale, self.reading

    def _on_set_feed_mode(self, inner: str) -> None:
        self.per_revolution = _numbers(inner)[-1] != 0.0

    def _on_set_spindle_speed(self, inner: str) -> None:
        self.speed = _numbers(inner)[-1]

    def _on_set_spindle_mode(self, inner: str) -> None:
        self.surface_speed = _numbers(inner)[-1] != 0.0

    def _on_start_speed_feed_sync(self, inner: str) -> None:
        self.synchronised = abs(_numbers(inner)[0]) * self.scale

    def _on_stop_speed_feed_synch(self, _: str) -> None:
        self.synchronised = 0.0

    def _feed_of(self, start: Vector, end: Vector, arc: bool) -> float:
        """Feed in mm/min, or deg/min if only rotary axes move."""
        feed = self.feed or 0.0
        if self.synchronised or self.per_revolution:
            if self.speed == 0.0:
                raise self.fail("a feed per revolution with the spindle at S0", "S above 0", line=self.line)
            return (self.synchronised or feed * self.feed_scale) * self.speed
        return feed * (1.0 if not arc and start[:3] == end[:3] else self.feed_scale)

    def _on_dwell(self, inner: str) -> None:
        self.recorder.add_dwell(_numbers(inner)[0])

    def _on_straight_traverse(self, inner: str) -> None:
        self._move(RAPID, self._point(inner))

    def _on_straight_feed(self, inner: str) -> None:
        self._move(CYCLE if self.cycle else FEED, self._point(inner))

    def _on_rigid_tap(self, inner: str) -> None:
        """Record a rigid tap: down and, with the spindle reversed, back."""
        here = self.frames.to_program(self.frames.position)
        self._move(CYCLE, [*self._point(inner)[:3], *here[3:]])
        self._move(CYCLE, here)

    def _on_arc_feed(self, inner: str) -> None:
        e1, e2, c1, c2, turns, axis_end, *rotary = _numbers(inner)
        scale = self.scale
        if self.plane not in geometry.PLANES:
            raise self.fail(f"an arc in the plane {self.plane}", "G17, G18 or G19", line=self.line)
        first, second, normal = geometry.PLANES[self.plane]
        end = [0.0, 0.0, 0.0, *rotary]
        end[first], end[second], end[normal] = e1 * scale, e2 * scale, axis_end * scale
        self._move(ARC, end, (c1 * scale, c2 * scale, turns))

    def _move(self, motion: int, target: Vector, arc: tuple[float, float, float] | None = None) -> None:
        """Record a move to a point in program coordinates; an arc with its centre in the plane and its turns."""
        end = self.frames.to_control(target)
        if self.lost and self.line:
            self._find_height(end)
        self.raised = 0.0
        start, self.frames.position = self.frames.position, end
        if self.line == 0:  # a move that the copy puts before the program
            self.frame_changed = False
            return
        if self.first_motion is None:
            self.first_motion = self.line
        if self.turned_by and not {"X", "Y"} <= set(self._words(self.line)):
            problem = "G10 turns the work offset in force: LinuxCNC's rs274 would take the old numbers of X and Y"
            raise self.fail(problem, "X and Y in the move that follows", line=self.turned_by)
        self.turned_by = 0
        if self.frame_changed:  # the same place in other numbers, up to the digits printed
            near = SAME_PLACE * self.scale
            start = [e if abs(e - s) < near else s for s, e in zip(start, end, strict=True)]
            self.frame_changed = False
        centred = self._arc(start, end, *arc) if arc else None
        shift = (*self.reference, 0.0, 0.0, 0.0)
        start = [value - zero for value, zero in zip(start, shift, strict=True)]
        end = [value - zero for value, zero in zip(end, shift, strict=True)]
        feed = math.nan if motion == RAPID else self._feed_of(start, end, arc is not None)
        flags = self._machine_flags(start, end)
        spindle = math.nan if self.turn and self.surface_speed else self.turn * self.speed
        move = Move(self.line, motion, start, end, feed, self.tool, self.tool_length, spindle, flags, centred)
        if self.recorder.add(move):
            self.note_tool()

    def _arc(self, start: Vector, end: Vector, c1: float, c2: float, turns: float) -> Arc:
        frames, (first, second, _) = self.frames, geometry.PLANES[self.plane]
        # In the plane the sweep is that of program coordinates, before any rotation.
        here, there = frames.to_program(start), frames.to_program(end)
        apart = max(abs(here[axis] - there[axis]) for axis in (first, second)) / self.scale
        if apart < SAME_PLACE:
            there = self._end_in_words(here, apart, (first, second))
        middle = list(here)
        middle[first], middle[second] = c1, c2
        beginning, ending, center = ((point[first], point[second]) for point in (here, there, middle))
        sweep = geometry.arc_sweep(beginning, ending, center, turns < 0, int(abs(turns)) or 1)
        try:
            geometry.check_bulge(math.dist(beginning, center), sweep)
        except geometry.GeometryError as error:
            raise self.fail(error.found, error.expected, line=self.line) from None
        x, y, z = (c - r for c, r in zip(frames.to_control(middle), self.reference, strict=False))
        return Arc((x, y, z), frames.turn_direction(geometry.normal_of(self.plane)), sweep)

    def _end_in_words(self, here: Vector, apart: float, axes: tuple[int, int]) -> Vector:
        """End of an arc that rs274 prints equal to its start: a full circle, or an arc shorter than its digits."""
        named, end = self.lines[self.line - 1].named, list(here)
        for axis in axes:
            if (name := AXES[axis]) in named:
                end[axis] += self.steps.get(name, math.nan) * self.scale
        if all(abs(end[axis] - here[axis]) <= SAME_PLACE * self.scale for axis in axes):
            return end
        if apart > ROUNDING or self.fine:  # computed, or compensated
            problem = "an arc that may be a full circle, or shorter than the digits that rs274 prints"
            expected = "no more than four decimals, or a full circle without its end words"
            raise self.fail(problem, expected, line=self.line)
        return here

    def _find_height(self, end: Vector) -> None:
        """Handle a change of tool length: until a move names Z, rs274 prints the number Z had before."""
        words = self._words(self.line)
        named = "Z" in self.lines[self.line - 1].named
        if self.cycle or (named and self.incremental) or (program_words.HOME_MOVE.search(words) and not named):
            problem = "a move from a height that rs274 has lost: the tool length changed between the last move and M6"
            raise self.fail(problem, "G90 G0 with Z before it", line=self.line)
        if named:
            self.lost = 0.0
        else:
            end[2] += self.lost

    def _machine_flags(self, start: Vector, end: Vector) -> tuple[bool, bool]:
        """Two flags: start and end were given in machine coordinates (G53, G28, G30), axis by axis as in `Frames`."""
        if self.cycle and start == end:
            return (False, False)
        was = self.frames.bound
        words = self._words(self.line)
        named = {AXES.index(letter) for letter in self.lines[self.line - 1].named}
        named |= {0, 1} if {"@", "^"} & set(words) else set()
        machine = bool(program_words.MACHINE_MOVE.search(words))
        if program_words.HOME_MOVE.search(words):  # first to the intermediate point, then home
            machine = self.moves_of_line > 0
            named = named or (set(range(6)) if machine else set())
        self.moves_of_line += 1
        # To the hole at the old height, or along the normal.
        if self.cycle and not program_words.HOME_MOVE.search(words):
            normal = geometry.PLANES[self.plane][2]
            along = all(start[axis] == end[axis] for axis in range(6) if axis != normal)
            named = {normal} if along else named - {normal}
        for axis in named:
            self.frames.from_machine[axis] = machine
        return (was, self.frames.bound)


def _numbers(inner: str) -> Vector:
    return [float(value) for value in NUMBER.findall(inner)]
