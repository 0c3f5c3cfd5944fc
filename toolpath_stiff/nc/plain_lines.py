"""Plain lines of CAM programs, many at a time: a G0 to G3, X Y Z A B C, I J K R, F, S, an N word.

Most of a big program is such lines. `plain_words` reads them many times faster than `words.read_block` reads blocks; a
line that it does not take as a whole is not plain and is left to `read_block`, with every error.

The lines become moves by the codes' own rules (`codes`, `frames`) on arrays, digit for digit. Here is only what a mode
does along lines: a word holds until the next one. What a number, a feed, a point, an arc means is decided by the
functions that the interpreter calls. A line about which there is anything to say (a word that nothing takes, an arc
that does not fit) ends the run before it: the interpreter then executes it and reports it. mm, degrees, mm/min inside.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes.drilling import CYCLES
from toolpath_stiff.nc.codes.feeds import SLOWEST, bare_feed_is_open, rotary_feed
from toolpath_stiff.nc.codes.increments import ANGLES, assume_increments, increment
from toolpath_stiff.nc.codes.points import LINEAR
from toolpath_stiff.nc.codes.registry import CODES
from toolpath_stiff.nc.frames import STILL
from toolpath_stiff.nc.interpreter import suits
from toolpath_stiff.nc.moves import ARC, FEED, RAPID, WIDE, Move, Moves
from toolpath_stiff.nc.plain_words import BARE, FIRST_F, LAST_F, LETTERS, NO_CODE, NONE, PlainWords, lex
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.tables import LARGEST_MM, LARGEST_WORD
from toolpath_stiff.nc.words import AXES

MODE_NAMES = tuple(name for name, code in CODES.items() if code.many)  # by the digit that `plain_words` reads
MODES = {name: digit for digit, name in enumerate(MODE_NAMES)}
OF_HOLE = ("start", "end", "motion", "feed", "dwell", "tool", "tool_length", "spindle", "from_machine")
NO_MODE = -1
CLOCKWISE = MODES["G2"]
FEWEST = 8  # lines; below, one by one is as fast
CHUNK = 8192  # lines: their words fit into a processor's cache


class PlainRun:
    """Executes runs of plain lines of a program on the state of a control."""

    def __init__(self, state: State, lines: Sequence[str], name: str) -> None:
        self.state, self.lines, self.name = state, lines, name
        self._pause = 0  # no other run is tried before this line
        self._start, self._words = -CHUNK, lex([""])[0]  # the chunk
        self._others = [0]  # its lines that are not plain, and its end
        self.hole: tuple[int, int, object] | None = None  # the line tried last, the moves before it, and the state

    def execute(self, first: int) -> PlainWords | None:
        """Execute plain lines from `first` (from 0); returns the words of those that were, None if there are none."""
        if not self._start <= first < self._start + CHUNK:
            words, others = lex(self.lines[first : first + CHUNK])
            self._start, self._words = first, words
            self._others = [*(first + others).tolist(), first + len(words.code)]
        end = self._others[bisect_left(self._others, first)]
        if end - first < FEWEST or first < self._pause or not suits(self.state):
            return None
        words = self._words.part(first - self._start, end - self._start)
        if self.state.motion in CYCLES or self.state.plain.modal:
            done = self._drill(first, words)
        else:
            done = Lines(self.state, words).execute(first)
            self._pause = self._pause if done >= FEWEST else first + done + 4 * FEWEST
        if not done:
            return None
        return words.part(0, done)

    def _drill(self, first: int, words: PlainWords) -> int:
        """Execute holes of a modal cycle from the second one that leaves the state as it was; returns their number."""
        state, recorder = self.state, self.state.recorder
        now = (state.motion, state.frames.position[2:], state.feed, state.spindle, {**state.sticky})
        (line, before, was), self.hole = self.hole or (first, 0, None), (first + 1, len(recorder), now)
        hole = recorder.recent[before - recorder.packed :] if before >= recorder.packed else []
        if line != first or was != now or not hole or not state.absolute or state.plane != "G17":
            return 0
        there, level = hole[0].end[:2], hole[0].end[2:]
        fits = all(move.start[:2] == there == move.end[:2] and move.arc is None for move in hole[1:])
        fits &= hole[0].arc is None and hole[0].start[:2] != there and hole[0].start[2:] == level
        return Lines(state, words).drill(first, hole) if fits else 0


class Lines:
    """The words of lines in columns, and their effect on the state; the line `end` is left to the interpreter."""

    def __init__(self, state: State, words: PlainWords) -> None:
        self.state, self.words = state, words
        self.n = self.end = len(words.code)
        self.values = {letter: words.values[letter] for letter in LETTERS if letter in words.values}
        self.given = {letter: words.forms[letter] != NONE for letter in self.values}
        self.counted = np.zeros(self.n, dtype=bool)  # lines with a number that counts increments
        for letter, values in self.values.items():
            self._stop(np.abs(values) > (LARGEST_MM if letter in AXES else LARGEST_WORD))
        if "S" in words.values:
            self._stop(words.values["S"] > LARGEST_WORD)
        if state.dialect.increments:
            self._count_increments()

    def _stop(self, where: BoolArray) -> None:
        """Leave the first line where `where` is true, and all lines after it, to the interpreter."""
        if where.any():
            self.end = min(self.end, int(np.argmax(where)))

    def _count_increments(self) -> None:
        for letter in self.values:
            bare = (self.words.forms[letter] == BARE) & (self.values[letter] != 0.0)
            unit = increment(letter in ANGLES, self.state.inch)
            self.values[letter] = np.where(bare, self.values[letter] * unit, self.values[letter])
            self.counted |= bare

    def execute(self, first: int) -> int:
        """Execute the lines' moves; returns the number of lines executed. `first`: number of the first, from 0."""
        self.coded = self.words.code != NO_CODE
        before = MODES.get(self.state.motion or "", NO_MODE)
        self.mode = np.concatenate([[before], self.words.code[self.coded]])[np.cumsum(self.coded)]
        axes, centers = self._any(AXES), self._any(geometry.CENTER_LETTERS)
        is_arc = self.mode >= CLOCKWISE
        self._stop(~is_arc & centers)
        self._stop((self.mode == NO_MODE) & axes)
        arc = is_arc & (axes | centers | self.coded)
        moving = (axes & (self.mode != NO_MODE)) | arc
        self._feed_words()
        self._stop(moving & (self.mode != MODES["G0"]) & np.isnan(self.feed))
        if not moving[: self.end].any():
            return self._leave(None)
        control = self._control()
        center, sweep = self._arcs(np.flatnonzero(arc[: self.end]), control)
        self._record(first, control, (center, sweep), moving)
        return self._leave(control if moving[: self.end].any() else None)

    def drill(self, first: int, hole: Sequence[Move]) -> int:
        """Drill at the points of the lines by the moves of the hole before; returns the number of lines executed."""
        state, frames = self.state, self.state.frames
        for key, form in self.words.forms.items():
            self._stop((form != NONE) & (key not in ("X", "Y")))
        other_mode = (self.words.code != NO_CODE) & (self.words.code != MODES.get(state.motion or "", NO_MODE))
        control = self._control()
        setup = control - np.array([*frames.fix_reference(), 0.0, 0.0, 0.0])
        step, size = np.abs(np.diff(setup[:, :2], axis=0)), np.maximum(1.0, np.abs(setup[:-1, :2]))
        self._stop(other_mode | (step == 0.0).all(axis=1) | ((step > 0.0) & (step < STILL * size)).any(axis=1))
        for axis in range(6):  # elsewhere the frames' rounding adds up
            there = frames.axis_to_control(axis, frames.axis_to_program(axis, control[:, axis]))
            self._stop((there != control[:, axis])[:-1] | (there != control[:, axis])[1:])
        n, k = self.end, len(hole)
        shape = {entry: (n, 1) if entry in WIDE else n for entry in OF_HOLE}
        holes = {entry: np.tile([getattr(move, entry) for move in hole], shape[entry]) for entry in OF_HOLE}
        holes["start"][:, :2] = holes["end"][:, :2] = np.repeat(setup[1 : n + 1, :2], k, axis=0)
        holes["start"][::k, :2] = setup[:n, :2]
        line, nothing = np.repeat(np.arange(n) + (first + 1), k), np.zeros((n * k, 3))
        state.recorder.add_many(
            Moves(line=line, arc_sweep=nothing[:, 0], arc_center=nothing, arc_normal=nothing, **holes)
        )
        self.mode, self.feed = np.full(self.n, NO_MODE), np.full(self.n, math.nan)
        return self._leave(control)

    def _record(self, first: int, control: FloatArray, arc: tuple[FloatArray, FloatArray], moving: BoolArray) -> None:
        """Record the moves of the executed lines, apart from those that go nowhere."""
        state, done = self.state, slice(self.end)
        setup = control - np.array([*state.frames.fix_reference(), 0.0, 0.0, 0.0])
        start, end = setup[:-1][done], setup[1:][done]
        # An axis that does not move keeps its number (`motion.record`).
        end = np.where(np.abs(end - start) < STILL * np.maximum(1.0, np.abs(start)), start, end)
        center, sweep, feed = arc[0][done], arc[1][done], self.feed[done]
        same = [start[:, axis] == end[:, axis] for axis in range(6)]
        feed = np.where(np.logical_and.reduce(same[:3]) & (sweep == 0.0), rotary_feed(state, feed), feed)
        rows = np.flatnonzero(moving[done] & (~np.logical_and.reduce(same) | (sweep != 0.0)))
        motion = np.where(sweep != 0.0, ARC, np.where(self.mode[done] == MODES["G1"], FEED, RAPID))[rows]
        vector = state.frames.turn_direction(geometry.normal_of(state.plane))
        n = len(rows)
        state.recorder.add_many(
            Moves(
                line=rows + (first + 1),
                motion=motion,
                start=start[rows],
                end=end[rows],
                arc_sweep=sweep[rows],
                arc_center=center[rows],
                arc_normal=np.where((motion == ARC)[:, None], vector, 0.0),
                feed=np.where(motion == RAPID, math.nan, feed[rows]),
                dwell=np.zeros(n),
                tool=np.full(n, state.tool),
                tool_length=np.full(n, state.tool_length),
                spindle=self._spindle()[rows],
                from_machine=np.zeros((n, 2), dtype=bool),
            )
        )
        if n:
            state.note_tool()

    def _spindle(self) -> FloatArray:
        """Spindle speed on each line, 1/min, as `State.spindle` gives it."""
        given = self.words.values.get("S", np.full(self.n, math.nan))
        if self.state.turn == 0 or self.state.surface_speed or np.isnan(given).all():
            return np.full(self.n, self.state.spindle)
        has_speed = ~np.isnan(given)
        speeds = np.concatenate([[self.state.speed], given[has_speed]])[np.cumsum(has_speed)]
        return np.asarray(self.state.turn * speeds)

    def _any(self, letters: str) -> BoolArray:
        columns = [self.given[letter] for letter in letters if letter in self.given]
        return np.asarray(np.logical_or.reduce([np.zeros(self.n, dtype=bool), *columns]))

    def _feed_words(self) -> None:
        """Set the F in force on each line."""
        state = self.state
        has_feed, values, bare = np.zeros(self.n, dtype=bool), np.full(self.n, math.nan), np.zeros(self.n, dtype=bool)
        for key in (FIRST_F, LAST_F):
            if key in self.words.forms:
                form = self.words.forms[key]
                self._stop(has_feed & (form != NONE))  # a second one
                values = np.where(has_feed, values, self.words.values[key])
                has_feed, bare = has_feed | (form != NONE), bare | (form == BARE)
        before = math.nan if state.feed is None else state.feed
        self.feed = np.concatenate([[before], values[has_feed] * state.feed_scale])[np.cumsum(has_feed)]
        self._stop((self.feed < SLOWEST) | (self.feed > LARGEST_WORD))
        if bare_feed_is_open(state):
            self._stop(bare)

    def _control(self) -> FloatArray:
        """(n + 1, 6) control coordinates before the first line and after each (`points.control_point`)."""
        state, frames = self.state, self.state.frames
        control = np.empty((self.n + 1, 6))
        for axis, letter in enumerate(AXES):
            here = frames.position[axis]
            if letter not in self.values:
                control[:, axis] = here
                continue
            scaled = self.values[letter] * (state.length_scale if letter in LINEAR else 1.0)
            given = self.given[letter]
            if state.absolute:
                named = frames.axis_to_control(axis, scaled[given])
                control[:, axis] = np.concatenate([[here], named])[np.append(0, np.cumsum(given))]
            else:
                control[:, axis] = np.cumsum(np.concatenate([[here], np.where(given, scaled, 0.0)]))
        return control

    def _arcs(self, rows: IntArray, control: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, 3) centres in the set-up frame and (n,) sweeps, 0 off `rows`; the first arc that does not fit ends it."""
        frames, nothing = self.state.frames, np.full(self.n, math.nan)
        center, sweep = np.zeros((self.n, 3)), np.zeros(self.n)
        first, second, normal = geometry.PLANES[self.state.plane]
        centers = geometry.CENTER_LETTERS
        letters = (AXES[first], AXES[second], centers[first], centers[second], "R", centers[normal])
        words = np.stack([self.values.get(letter, nothing)[rows] for letter in letters], axis=1).tolist()
        points = np.stack([frames.axis_to_program(axis, control[rows, axis]) for axis in range(3)], axis=1)
        starts = zip(points[:, first].tolist(), points[:, second].tolist(), strict=True)  # tuples, like the ends
        clockwise = (self.mode[rows] == CLOCKWISE).tolist()
        inch, middles, sweeps = self.state.inch, list[geometry.Point2](), list[float]()
        try:
            for start, numbers, turn in zip(starts, words, clockwise, strict=True):
                end, middle = self._arc(start, numbers, turn)
                sweeps.append(geometry.sweep_about(middle, start, end, turn, inch))
                middles.append(middle)
        except geometry.GeometryError:
            self.end = int(rows[len(middles)])
        points[: len(middles), [first, second]] = np.reshape(middles, (-1, 2))
        sweep[rows[: len(middles)]] = sweeps
        setup = np.stack([frames.axis_to_control(axis, points[:, axis]) for axis in range(3)], axis=1)
        center[rows] = setup - np.array(frames.fix_reference())
        return center, sweep

    def _arc(
        self, start: geometry.Point2, words: list[float], clockwise: bool
    ) -> tuple[geometry.Point2, geometry.Point2]:
        """End and centre of an arc; `words`: X, Y, I, J of the plane, R, the offset normal to it; nan: not given."""
        (x, y, i, j, radius, off_plane), scale = words, self.state.length_scale
        no_x, no_y, no_i, no_j, by_center = map(math.isnan, words[:5])
        fits = by_center != (no_i and no_j) and not (no_x and no_y and not by_center)
        if not fits or abs(off_plane) > 0.0:
            raise geometry.GeometryError("words that do not fit", "")
        a, b = start
        over, up = (0.0, 0.0) if self.state.absolute else start
        end = (a if no_x else over + x * scale, b if no_y else up + y * scale)
        if not by_center:
            return end, geometry.center_from_radius(start, end, radius * scale, clockwise)
        return end, (a if no_i else a + i * scale, b if no_j else b + j * scale)

    def _leave(self, control: FloatArray | None) -> int:
        """Set the state to that after the executed lines; returns their number."""
        state, last = self.state, self.end - 1
        if last < 0:
            return 0
        if state.dialect.increments and self.counted[: self.end].any():
            assume_increments(state)
        if "S" in self.words.forms:
            speed_rows = np.flatnonzero(self.words.forms["S"][: self.end])
            if len(speed_rows):
                state.speed = float(self.words.values["S"][speed_rows[-1]])
        if self.mode[last] != NO_MODE:
            state.motion = MODE_NAMES[self.mode[last]]
        if not math.isnan(self.feed[last]):
            state.feed = float(self.feed[last])
        if control is not None:
            state.frames.position = control[self.end].tolist()
            state.length_changed = state.rotation_changed = False
        return self.end
