"""The moves of plain lines, many at a time: words in columns to what they make of the state of a control.

By the codes' own rules (`codes`, `frames`) on arrays, digit for digit. Here is only what a mode does along lines: a
word holds until the next one. mm, degrees, mm/min inside.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes.modes import SLOWEST, bare_feed_is_open, length_of_move, rotary_feed
from toolpath_stiff.nc.codes.motion import ARCS, STILL, note_tool, sweep_about
from toolpath_stiff.nc.codes.points import ANGLES, LINEAR, assume_increments, coordinate, increment
from toolpath_stiff.nc.codes.registry import CODES
from toolpath_stiff.nc.moves import ARC, FEED, RAPID, Arcs, MovesInMm
from toolpath_stiff.nc.plain_holes import LEAST
from toolpath_stiff.nc.plain_words import BARE, FIRST_F, LAST_F, LETTERS, NO_CODE, NONE, PlainWords
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.tables import LARGEST_MM, LARGEST_WORD
from toolpath_stiff.nc.words import AXES

MODE_NAMES = tuple(name for name, code in CODES.items() if code.many)  # by the digit that `plain_lines` reads


MODES = {name: digit for digit, name in enumerate(MODE_NAMES)}


NO_MODE = -1


CLOCKWISE = MODES[ARCS[0]]


class Lines:
    """The words of lines in columns, and what they make of the state; the line `end` is left to the interpreter."""

    def __init__(self, state: State, words: PlainWords) -> None:
        self.state, self.words = state, words
        self.n = self.end = len(words)
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
        """Leave the first such line, and all after it, to the interpreter."""
        if where.any():
            self.end = min(self.end, int(np.argmax(where)))

    def _count_increments(self) -> None:
        for letter in self.values:
            bare = (self.words.forms[letter] == BARE) & (self.values[letter] != 0.0)
            unit = increment(letter in ANGLES, self.state.inch)
            self.values[letter] = np.where(bare, self.values[letter] * unit, self.values[letter])
            self.counted |= bare

    def execute(self, first: int) -> int:
        """Move; returns how many lines were executed. `first`: the first one's number, from 0."""
        self._modes()
        axes, centers = self._any(AXES), self._any(geometry.CENTER_LETTERS)
        is_arc = self.mode >= CLOCKWISE
        self._stop(~is_arc & centers)
        self._stop((self.mode == NO_MODE) & axes)
        arc = is_arc & (axes | centers | self.coded)
        moving = (axes & (self.mode != NO_MODE)) | arc
        self.cutting = moving & (self.mode != MODES["G0"])
        self._feed_words()
        self._stop(self._no_feed())
        if not moving[: self.end].any():
            return self._leave(None)
        control = self._turned(moving) if self.state.frames.rotated else self._control()
        start, end = self._set_up(control)
        arcs = self._arcs(np.flatnonzero(arc[: self.end]), control)
        done = slice(self.end)
        self._record(first, start[done], end[done], arcs, moving[done], arc[done])
        return self._leave(control if moving[done].any() else None)

    def _record(
        self, first: int, start: FloatArray, end: FloatArray, arcs: Arcs, moving: BoolArray, arc: BoolArray
    ) -> None:
        """Hand over the moves of the lines that are done, those that go anywhere."""
        state = self.state
        kept = moving & (np.logical_or.reduce([start[:, axis] != end[:, axis] for axis in range(6)]) | arc)
        feed = self._feeds(start, end, arcs, moving)
        rows = np.flatnonzero(kept)
        motion = np.where(arc, ARC, np.where(self.mode[: self.end] == MODES["G1"], FEED, RAPID))[rows]
        place = np.cumsum(kept) - 1
        state.recorder.add_many(
            MovesInMm(
                line=rows + (first + 1),
                motion=motion,
                start=start[rows],
                end=end[rows],
                arcs=replace(arcs, rows=place[arcs.rows]),
                feed=np.where(motion == RAPID, math.nan, feed[rows]),
                dwell=np.zeros(len(rows)),
                tool=np.full(len(rows), state.tool),
                tool_length=np.full(len(rows), state.tool_length),
                from_machine=np.zeros((len(rows), 2), dtype=bool),
            )
        )
        if len(rows):
            note_tool(state)

    def _modes(self) -> None:
        """The motion mode of each line."""
        self.coded = self.words.code != NO_CODE
        before = MODES.get(self.state.motion or "", NO_MODE)
        self.mode = np.concatenate([[before], self.words.code[self.coded]])[np.cumsum(self.coded)]

    def _any(self, letters: str) -> BoolArray:
        columns = [self.given[letter] for letter in letters if letter in self.given]
        return np.asarray(np.logical_or.reduce([np.zeros(self.n, dtype=bool), *columns]))

    def _feed_words(self) -> None:
        """F in force on each line, and the line that set it (-1: a line before these)."""
        state = self.state
        has_feed, values, bare = np.zeros(self.n, dtype=bool), np.full(self.n, math.nan), np.zeros(self.n, dtype=bool)
        for key in (FIRST_F, LAST_F):
            if key in self.words.forms:
                form = self.words.forms[key]
                self._stop(has_feed & (form != NONE))  # a second one
                values = np.where(has_feed, values, self.words.values[key])
                has_feed, bare = has_feed | (form != NONE), bare | (form == BARE)
        order = np.cumsum(has_feed)
        self.feed_row = np.concatenate([[-1], np.flatnonzero(has_feed)])[order]
        before = math.nan if state.feed is None else state.feed
        self.feed = np.concatenate([[before], values[has_feed] * state.feed_scale])[order]
        self._stop((self.feed < SLOWEST) | (self.feed > LARGEST_WORD))
        if bare_feed_is_open(state):
            self._stop(bare)

    def _no_feed(self) -> BoolArray:
        """Cutting lines without a feed."""
        if self.state.feed_mode == "G94":
            return np.asarray(self.cutting & np.isnan(self.feed))
        rows = np.flatnonzero(self.cutting)  # G93: each needs its own
        missing = np.zeros(self.n, dtype=bool)
        used = np.concatenate([[-2], rows[:-1]])
        missing[rows] = (self.feed_row[rows] <= used) | np.isnan(self.feed[rows])
        return missing

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
                control[0, axis] = here
                control[1:, axis] = np.concatenate([[here], named])[np.cumsum(given)]
            else:
                control[:, axis] = np.cumsum(np.concatenate([[here], np.where(given, scaled, 0.0)]))
        return control

    def places(self) -> FloatArray:
        """(m, 2) X and Y in control coordinates after each of the first m lines, which all go somewhere else."""
        control = self._control()[:, :2]
        way = np.abs(np.diff(control, axis=0)).max(axis=1)
        self._stop(way < LEAST)
        return control[1 : self.end + 1]

    def _turned(self, moving: BoolArray) -> FloatArray:
        """The same where a work offset or G68 turns the program's axes: line by line, as each counts from the last."""
        state, frames = self.state, self.state.frames
        control = np.zeros((self.n + 1, 6))
        position, control[0] = frames.position, frames.position
        words = [
            (axis, self.values[letter] * (state.length_scale if letter in LINEAR else 1.0), self.given[letter])
            for axis, letter in enumerate(AXES)
            if letter in self.values
        ]
        for row in range(min(self.n, self.end)):
            if moving[row]:
                point = frames.to_program(position)
                for axis, values, given in words:
                    if given[row]:
                        point[axis] = coordinate(state, point[axis], float(values[row]))
                position = frames.to_control(point)
            control[row + 1] = position
        return control

    def _set_up(self, control: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Set-up coordinates of each line's start and end; an axis that stands keeps its number (`motion.record`)."""
        setup = np.empty_like(control)
        for axis in range(6):
            setup[:, axis] = self.state.frames.axis_to_setup(axis, control[:, axis])
        start, end = setup[:-1], setup[1:]
        still = np.abs(end - start) < STILL * np.maximum(1.0, np.abs(start))
        return start, np.where(still, start, end)

    def _arcs(self, rows: IntArray, control: FloatArray) -> Arcs:
        """The arcs of some lines; the first that is not right ends the run."""
        if not len(rows):
            return Arcs.of({})
        state = self.state
        first, second, normal = geometry.PLANES[state.plane]
        centers = geometry.CENTER_LETTERS
        letters = (AXES[first], AXES[second], centers[first], centers[second], "R", centers[normal])
        nothing = np.full(self.n, math.nan)
        words = np.stack([self.values.get(letter, nothing)[rows] for letter in letters])
        points = self._programmed(control[rows])
        middles, sweeps = self._all_arcs(rows, points[:, [first, second]], words)
        frames, center_points = state.frames, points[: len(sweeps)]
        center_points[:, [first, second]] = middles
        if frames.rotated:
            turned = [frames.to_setup(frames.to_control(point))[:3] for point in center_points.tolist()]
            middles = np.array(turned).reshape(-1, 3)
        else:
            columns = (frames.axis_to_setup(i, frames.axis_to_control(i, center_points[:, i])) for i in range(3))
            middles = np.stack([*columns], axis=1)
        vector = frames.turn_direction(geometry.normal_of(state.plane))
        return Arcs(rows[: len(sweeps)], middles, np.tile(vector, (len(sweeps), 1)), sweeps)

    def _all_arcs(self, rows: IntArray, start: FloatArray, words: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(m, 2) centres and (m,) sweeps of the first m of some lines; what is wrong with the next one ends the run.

        `words` (6, n): X, Y, I, J of the plane, R and the offset off the plane, nan where there is none.
        """
        state, scale = self.state, self.state.length_scale
        x, y, i, j, radius, off_plane = words
        end = np.stack([x, y], axis=1) * scale
        end = np.where(np.isnan(end), start, end if state.absolute else start + end)
        center = start + np.stack([np.where(np.isnan(i), 0.0, i), np.where(np.isnan(j), 0.0, j)], axis=1) * scale
        clockwise = self.mode[rows] == CLOCKWISE
        sweep = geometry.arc_sweeps(start, end, center, clockwise)
        by_radius, by_center = ~np.isnan(radius), ~(np.isnan(i) & np.isnan(j))
        unfit = (np.abs(off_plane) > 0.0) | (by_radius == by_center) | (by_radius & np.isnan(x) & np.isnan(y))
        clear = ~unfit & by_center & geometry.radii_clearly_agree(start, end, center, state.inch)
        for row in np.flatnonzero(~clear).tolist():
            (a, b), (c, d), turn = start[row].tolist(), end[row].tolist(), bool(clockwise[row])
            try:
                if unfit[row]:
                    raise geometry.ArcError("words that do not fit", "")
                if by_radius[row]:
                    center[row] = geometry.center_from_radius((a, b), (c, d), float(radius[row]) * scale, turn)
                e, f = center[row].tolist()
                sweep[row] = sweep_about((e, f), (a, b), (c, d), turn, state.inch)
            except geometry.ArcError:
                self.end = int(rows[row])
                return center[:row], sweep[:row]
        return center, sweep

    def _programmed(self, control: FloatArray) -> FloatArray:
        """Program coordinates of points (n, 6)."""
        frames = self.state.frames
        if frames.rotated:
            return np.array([frames.to_program(point) for point in control.tolist()])
        return np.stack([frames.axis_to_program(axis, control[:, axis]) for axis in range(6)], axis=1)

    def _feeds(self, start: FloatArray, end: FloatArray, arcs: Arcs, moving: BoolArray) -> FloatArray:
        """Feed of each line's move (`modes.feed_of_move`); rapids are none."""
        feed: FloatArray = self.feed[: self.end].copy()
        if self.state.feed_mode == "G94":
            standing = np.logical_and.reduce([start[:, axis] == end[:, axis] for axis in range(3)])
            standing[arcs.rows] = False
            feed[standing] = rotary_feed(self.state, feed[standing])
            return feed
        arc_of_row = arcs.by_row()
        for row in np.flatnonzero(moving & (self.mode[: self.end] != MODES["G0"])).tolist():
            feed[row] *= length_of_move(start[row].tolist(), end[row].tolist(), arc_of_row.get(row))
        return feed

    def _leave(self, control: FloatArray | None) -> int:
        """Set the state as the lines executed leave it; their number."""
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
        if state.feed_mode == "G93":
            used = self.cutting[max(int(self.feed_row[last]), 0) : self.end].any()
            state.feed = None if used or math.isnan(self.feed[last]) else float(self.feed[last])
        elif not math.isnan(self.feed[last]):
            state.feed = float(self.feed[last])
        if control is not None:
            state.frames.position = control[self.end].tolist()
            state.length_changed = state.rotation_changed = False
        return self.end
