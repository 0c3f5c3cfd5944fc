"""Straight moves, arcs and drilling cycles, from the words of a block in the modes in force. mm, mm/min inside."""

from __future__ import annotations

import math

from toolpath_stiff.nc import arcs
from toolpath_stiff.nc.blocks import AXES
from toolpath_stiff.nc.coordinates import Coordinates
from toolpath_stiff.nc.cycles import SAME_HEIGHT_MM, Drilling, strokes
from toolpath_stiff.nc.dialects import GENERIC, MILLISECONDS, SECONDS, Dialect
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.moves import ARC, CYCLE, RAPID, ToolUse
from toolpath_stiff.nc.recorder import Arc, Recorder
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.nc.words import Word
from toolpath_stiff.units import MM_PER_INCH, m_from_mm

SECONDS_PER_DAY = 86400.0
MOST_STROKES = 100_000  # of one block; beyond, Q or L is a slip


class Mover(Coordinates):
    """The modal state, and the moves that it makes of words; `recorder` holds those found so far."""

    def __init__(
        self, name: str, frames: Frames, tools: dict[int, ToolEntry] | None, dialect: Dialect = GENERIC
    ) -> None:
        super().__init__(name, frames, dialect)
        self.tools = tools
        self.recorder = Recorder()
        self.used_tools: dict[int, ToolUse] = {}
        self.motion: str | None = None
        self.feed_mode = "G94"
        self.retract = dialect.retract  # G98 or G99, once said; LinuxCNC starts as in G99
        self.arc_absolute = dialect.arc_absolute
        self.feed: float | None = None
        self.speed = 0.0
        self.tool, self.selected = 0, 0
        self.renamed = False  # the tool in the spindle is M61's
        self.tool_length = math.nan
        # LinuxCNC's rs274 forgets at M6 that length or rotation changed since the last move: the next begins elsewhere.
        self.length_changed = self.height_lost = False
        self.sticky: dict[str, float] = {}
        self._heights = (True, 0.0, 0.0)  # of the last hole: whether in G90, R plane, bottom

    def _straight(
        self, motion: int, control: list[float], work: set[int], machine: set[int] | None = None, dwell: float = 0.0
    ) -> None:
        """A straight move to a point in control coordinates; `work`, `machine`: axes that were given in each."""
        self._record(motion, control, work, machine or set(), None)
        if dwell:
            self.recorder.add_dwell(dwell)

    def _record(self, motion: int, control: list[float], work: set[int], machine: set[int], arc: Arc | None) -> None:
        frames = self.frames
        self.length_changed = self.rotation_changed = False
        if self.height_lost:
            self._find_height(motion, (2 in work and self.absolute) or 2 in machine)
        start, was = frames.to_setup(frames.position), frames.bound
        for axis in work:
            frames.from_machine[axis] = False
        for axis in machine:
            frames.from_machine[axis] = True
        end = frames.to_setup(control)
        # An axis that was not asked to move keeps its number to the last digit, whatever the frames' sums say.
        for axis in range(6):
            if abs(end[axis] - start[axis]) < 1e-12 * max(1.0, abs(start[axis])):
                end[axis] = start[axis]
        feed = math.nan if motion == RAPID else self._feed_of(start, end, arc)
        added = self.recorder.add(
            self.block.line,
            motion,
            start,
            end,
            feed,
            self.tool,
            self.tool_length,
            (was, frames.bound),
            arc,
        )
        frames.position = control
        if added:
            self.note_tool()

    def _find_height(self, motion: int, named: bool) -> None:
        if motion != RAPID:
            self._know_height(None)
        self.height_lost = not named

    def _know_height(self, word: Word | None) -> None:
        """Refuse what hangs on the present height, if that is lost."""
        if self.height_lost:
            raise self.fail(
                word,
                "a cut before any Z" if word is None else "takes the present height",
                "G0 with Z before it: the tool length changed between the last move and M6, and LinuxCNC's interpreter "
                "forgets that",
            )

    def note_tool(self) -> None:
        """Keep the tool in the spindle among those that moved."""
        if self.tool in self.used_tools:
            return
        entry = (self.tools or {}).get(self.tool, ToolEntry(self.tool))
        self.used_tools[self.tool] = ToolUse(
            self.tool,
            m_from_mm(entry.length),
            m_from_mm(entry.diameter),
            entry.remark,
            m_from_mm(entry.stick_out),
            entry.material,
        )

    def _feed_of(self, start: list[float], end: list[float], arc: Arc | None) -> float:
        """Feed of a move in mm/min, or deg/min for one of the rotary axes alone."""
        if self.feed is None:
            words = [w for w in self.block.words if w.letter == "G"]
            raise self.fail(
                words[0] if words else self.block.words[0],
                "is a feed move before any feed" if self.feed_mode != "G93" else "is a feed move without F under G93",
                "F above 0",
            )
        linear = math.dist(start[:3], end[:3]) if arc is None else arc_length(arc, start, end)
        turn = max(abs(e - s) for s, e in zip(start[3:], end[3:], strict=True))
        if self.feed_mode == "G93":
            feed, self.feed = self.feed, None  # every move needs its own
            return feed * (linear if linear > 0.0 else turn)
        if self.feed_mode == "G95":
            if self.speed == 0.0:
                raise self.fail(None, "feed per revolution (G95) with the spindle at S0", "S above 0")
            return self.feed * self.speed
        if linear == 0.0:
            return self.feed / (MM_PER_INCH if self.inch else 1.0)  # degrees are degrees in inch programs too
        return self.feed

    # -- arcs --------------------------------------------------------------------------------------------------------

    def _arc(self) -> None:
        first, second, normal = arcs.PLANES[self.plane]
        clockwise = self.motion == "G2"
        frames = self.frames
        here = frames.to_program(frames.position)
        words = self._point_words()
        target = self._destination(here, words)
        start, end = (here[first], here[second]), (target[first], target[second])
        turns = self._turns()
        try:
            center = self._arc_center(start, end, clockwise, words, first, second, normal)
            arcs.check_radii(start, end, center)
        except arcs.ArcError as error:
            raise self.fail(None, error.found, error.expected) from None
        sweep = arcs.arc_sweep(start, end, center, clockwise, turns)
        middle = list(here)
        middle[first], middle[second] = center
        axis_vector = [0.0, 0.0, 0.0]
        axis_vector[normal] = 1.0
        x, y, z = frames.to_setup(frames.to_control(middle))[:3]
        turned = frames.turn_direction((axis_vector[0], axis_vector[1], axis_vector[2]))
        self._record(ARC, self._control_point(here, words), set(words), set(), Arc((x, y, z), turned, sweep))

    def _turns(self) -> int:
        turns = self.take("P")
        if turns is None:
            return 1
        if turns != int(turns) or not 1 <= turns <= 10000:
            raise self.fail(self.values["P"], "is no number of turns", "a whole number from 1")
        return int(turns)

    def _arc_center(
        self,
        start: arcs.Point2,
        end: arcs.Point2,
        clockwise: bool,
        words: dict[int, float],
        first: int,
        second: int,
        normal: int,
    ) -> arcs.Point2:
        radius = self.take("R")
        off_plane = arcs.CENTER_WORDS[normal]
        in_plane = (arcs.CENTER_WORDS[first], arcs.CENTER_WORDS[second])
        if self.has(off_plane):
            raise self.fail(self.values[off_plane], f"is off the plane {self.plane}", " and ".join(sorted(in_plane)))
        offsets = [self.take(letter) for letter in in_plane]
        if self.polar is not None and offsets != [None, None]:
            raise arcs.ArcError("an arc with I, J or K in polar mode (G16)", "R")
        if radius is not None:
            if offsets != [None, None]:
                raise self.fail(self.values["R"], "and a centre (I, J, K) are both given", "one of them")
            if not {first, second} & words.keys():
                raise arcs.ArcError("an arc with R and without an end point", "an axis word of the plane")
            return arcs.center_from_radius(start, end, radius * self.length_scale, clockwise)
        if offsets == [None, None]:
            raise arcs.ArcError("an arc without a centre", f"{in_plane[0]}, {in_plane[1]} or R")
        if self.arc_absolute:
            if None in offsets:
                raise arcs.ArcError("an absolute centre (G90.1) with one word", f"{in_plane[0]} and {in_plane[1]}")
            center = [v * self.length_scale for v in offsets if v is not None]
            middle = self.frames.to_program(self.frames.position)
            middle[first], middle[second] = center
            return (middle[first], middle[second])
        return (start[0] + (offsets[0] or 0.0) * self.length_scale, start[1] + (offsets[1] or 0.0) * self.length_scale)

    # -- cycles --------------------------------------------------------------------------------------------------------

    def _cycle(self, given: bool) -> None:
        """One block of a canned cycle: its holes, expanded."""
        code = self.motion or ""
        normal = arcs.PLANES[self.plane][2]
        repeats = self._repeats()
        self._keep_heights(code, normal)
        for letter in "RQ":
            value = self.take(letter)
            if value is not None:
                self.sticky[letter] = value * self.length_scale
        if self.has("P"):
            self.sticky["P"] = self._seconds("P") or 0.0
        words = self._point_words()
        if not words and given:
            raise self.fail(None, f"{code} without axis words", "X, Y, Z")
        if any(axis > 2 for axis in words):
            raise self.fail(None, f"{code} with rotary axes", "the rotary axes in a block before it")
        if normal in words:
            self.sticky["Z"] = words.pop(normal)
        self._check_cycle(code, normal)
        if self.sticky.setdefault("unit", self.length_scale) != self.length_scale:
            raise self.fail(
                None,
                f"{code} after a change between G20 and G21: controls differ in whether the run keeps its heights",
                "G80 before it, and R and Z anew",
            )
        frames = self.frames
        here = frames.to_program(frames.position)[normal]
        # The level from which a run of cycles began: G91's R counts from it, G98 returns to it.
        initial = self.sticky.setdefault("level", here)
        retract = self.sticky["R"] if self.absolute else self.sticky["R"] + initial
        bottom = self.sticky["Z"] if self.absolute else retract + self.sticky["Z"]
        self._heights = (self.absolute, retract, bottom)
        if retract < bottom:
            raise self.fail(None, f"{code}: R at {retract:g} mm is below the bottom at {bottom:g} mm", "R above it")
        if self.retract is None:
            self.assume("a drilling cycle before any G98 or G99 ends at its R plane (G99), as LinuxCNC starts")
        # As measured on LinuxCNC: a run that began below R goes to R first; otherwise a tool at or below R goes to the
        # level above the holes on its way to the next one.
        if initial < retract:
            self._along_normal(normal, retract, RAPID)
            here = retract
        clear = max(initial, retract) if self.retract == "G98" else retract
        level = here if here > retract + SAME_HEIGHT_MM else clear
        self._check_pecks(code, retract - bottom, repeats)
        hole = Drilling(code, bottom, retract, clear, self.sticky.get("Q", 0.0), self.sticky.get("P", 0.0))
        for number in range(repeats):
            if number and self.spoke is not None:  # each hole's polar words count from the one before
                words |= self._xy_of_spoke()
            place = self._destination(frames.to_program(frames.position), words)
            place[normal] = level
            self._straight(RAPID, frames.to_control(place), set(words))
            level = clear
            self._along_normal(normal, retract, RAPID)
            for stroke in strokes(hole):
                self._along_normal(normal, stroke.height, CYCLE if stroke.feed else RAPID, stroke.dwell)

    def _keep_heights(self, code: str, normal: int) -> None:
        """G90 or G91 since Z and R were given: Fanuc's hole stays where it is, LinuxCNC reads the numbers anew."""
        absolute, retract, bottom = self._heights
        if absolute == self.absolute or not {"R", "Z", "level"} <= self.sticky.keys():
            return
        renewed = [letter for letter in ("R", AXES[normal]) if self.has(letter)]
        keeps = True if self.polar is not None else self.dialect.keeps_heights
        if len(renewed) == 2 or keeps is False:
            return
        if keeps is None or renewed:
            raise self.fail(
                None,
                f"{code} after a change between G90 and G91: controls differ in whether the hole keeps its heights",
                f"R and {AXES[normal]} in the block",
                "" if renewed else "name the control with --dialect",
            )
        level = self.sticky["level"]
        heights = (retract, bottom) if self.absolute else (retract - level, bottom - retract)
        self.sticky["R"], self.sticky["Z"] = heights

    def _seconds(self, letter: str) -> float | None:
        """A time word in s; what its number counts is the dialect's."""
        value = self.take(letter)
        if value is None or self.dialect.dwell == SECONDS:
            return value
        written = next(word for word in self.block.words if word.letter == letter)
        if "." not in written.text:
            return written.value / 1e3
        if letter == "P" and self.dialect.dwell == MILLISECONDS:
            raise self.fail(written, f"has a decimal point, which {self.dialect.name} does not allow", "milliseconds")
        return value

    def _repeats(self) -> int:
        letter = next((letter for letter in self.dialect.cycle_repeats if self.has(letter)), None)
        if letter is None:
            return 1
        self.take(letter)
        word = next(word for word in self.block.words if word.letter == letter)  # a count, whatever a bare K length is
        if word.value != int(word.value) or not 1 <= word.value <= 10000:
            raise self.fail(word, "is no number of repeats", "a whole number from 1")
        return int(word.value)

    def _check_cycle(self, code: str, normal: int) -> None:
        axis = AXES[normal]
        for letter, what in (("Z", axis), ("R", "R")):
            if letter not in self.sticky:
                raise self.fail(None, f"{code} without {what}", f"{what} in the cycle's first block")
        if code in ("G73", "G83") and not self.sticky.get("Q", 0.0) > 0.0:
            raise self.fail(None, f"{code} without a peck", "Q above 0")
        if code in ("G82", "G89"):
            dwell = self.sticky.get("P")
            if dwell is None or not 0.0 <= dwell <= SECONDS_PER_DAY:
                raise self.fail(None, f"{code} without its dwell", "P with the seconds, 0 or more")

    def _check_pecks(self, code: str, depth: float, repeats: int) -> None:
        pecks = depth / self.sticky["Q"] if code in ("G73", "G83") else 1.0
        if pecks * repeats > MOST_STROKES:
            raise self.fail(None, f"{code} with more than {MOST_STROKES} strokes", "a larger Q, or fewer repeats")

    def _along_normal(self, normal: int, height: float, motion: int, dwell: float = 0.0) -> None:
        frames = self.frames
        place = frames.to_program(frames.position)
        if place[normal] != height:
            place[normal] = height
            self._straight(motion, frames.to_control(place), {normal})
        if dwell:
            self.recorder.add_dwell(dwell)


def arc_length(arc: Arc, start: list[float], end: list[float]) -> float:
    """Length of an arc or helix as `path.move_lengths` has it, so that G93's F is one over the move's time."""
    climb = sum((e - s) * n for s, e, n in zip(start, end, arc.normal, strict=False))
    first = math.dist(start[:3], arc.center)
    last = math.sqrt(max(math.dist(end[:3], arc.center) ** 2 - climb**2, 0.0))
    return math.hypot(arc.sweep * (first + last) / 2.0, climb, last - first)
