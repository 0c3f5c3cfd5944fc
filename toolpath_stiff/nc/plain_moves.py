"""Plain lines to moves, many at a time: what `Interpreter` does with each of them, on arrays, digit for digit.

A line about which there is anything to say (a word that nothing takes, an arc that does not fit) ends the run before
it: the interpreter then executes it and says so. mm, degrees, mm/min inside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.nc import arcs
from toolpath_stiff.nc.blocks import FARTHEST_MM
from toolpath_stiff.nc.coordinates import INCREMENTS
from toolpath_stiff.nc.dialects import GENERIC, INCREMENT_DEGREE, INCREMENT_INCH, INCREMENT_MM
from toolpath_stiff.nc.motion import arc_length
from toolpath_stiff.nc.moves import ARC, FEED, RAPID
from toolpath_stiff.nc.plain_lines import (
    FIRST_F,
    FIRST_LETTER,
    G_COLUMN,
    LAST_F,
    LENGTH_LETTERS,
    LETTERS,
    PlainLines,
    Row,
    first_bare,
    has_pointed,
    is_bare,
)
from toolpath_stiff.nc.recorder import Arc, MovesInMm
from toolpath_stiff.nc.words import read_block
from toolpath_stiff.units import MM_PER_INCH

if TYPE_CHECKING:
    from toolpath_stiff.nc.interpreter import Interpreter

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

FEWEST = 8  # lines; below, one by one is as fast
MODES = {"G0": 0, "G1": 1, "G2": 2, "G3": 3}
NO_MODE = -1
MODE_NAMES = tuple(MODES)


class PlainRun:
    """Executes runs of plain lines of a program on its interpreter."""

    def __init__(self, interpreter: Interpreter, lines: Sequence[str], name: str) -> None:
        self.interpreter, self.name = interpreter, name
        self.lines = PlainLines(lines, interpreter.dialect.semicolon)
        self._pause = 0  # the line before which another run is not worth trying

    def execute(self, at: int) -> list[Row]:
        """Execute plain lines from `at` (from 0); returns their words. None may be executed."""
        count = self.lines.run(at)
        if count < FEWEST or at < self._pause or not _suits(self.interpreter):
            return []
        rows = self.lines.rows(at, count)
        if self.interpreter.motion not in MODES and not rows[0][G_COLUMN] and any(rows[0]):
            return []
        block = _Lines(self.interpreter, rows)
        done = block.execute(at)
        if done < FEWEST:
            self._pause = at + done + 4 * FEWEST
        self._watch_points(at, block, done)
        return rows[:done]

    def _watch_points(self, at: int, block: _Lines, done: int) -> None:
        """As `Coordinates._watch_points`, of all lines executed."""
        state = self.interpreter
        if state.dialect.name != GENERIC.name or not (state.bare is None or not state.pointed):
            return
        columns = [block.texts[letter][:done] for letter in LENGTH_LETTERS if letter in block.texts]
        state.pointed = state.pointed or any(has_pointed(column) for column in columns)
        row = first_bare(columns) if state.bare is None else None
        if row is not None:
            words = read_block(self.lines.lines[at + row], at + row + 1, self.name, state.dialect.semicolon).words
            word = next(w for w in words if w.letter in LENGTH_LETTERS and is_bare(w.text[1:].replace(" ", "")))
            state.bare = (at + row + 1, word)
        state.warn_of_points()


def _suits(state: Interpreter) -> bool:
    """Whether the modes in force leave plain words their plain meaning."""
    frames = state.frames
    return (
        state.feed_mode in ("G93", "G94")
        and state.polar is None
        and state.unsettled is None
        and not state.height_lost
        and not state.arc_absolute
        and not frames.rotated
        and not frames.bound
    )


class _Lines:
    """The words of lines in columns, and what they make of the interpreter's state."""

    def __init__(self, state: Interpreter, rows: list[Row]) -> None:
        self.state = state
        self.n = len(rows)
        columns = list(zip(*rows, strict=True))
        self.codes: Sequence[str] = columns[G_COLUMN]
        self.feeds = (columns[FIRST_F], columns[LAST_F])
        self.texts = {
            letter: column for letter, column in zip(LETTERS, columns[FIRST_LETTER:LAST_F], strict=True) if any(column)
        }
        self.values = {
            letter: np.array([float(text) if text else math.nan for text in column])
            for letter, column in self.texts.items()
        }
        self.given = {letter: ~np.isnan(values) for letter, values in self.values.items()}
        self.counted = np.zeros(self.n, dtype=bool)
        self.end = self.n  # the first line that is left to the interpreter
        for letter in "XYZABC":
            if letter in self.values:
                self._stop(np.abs(self.values[letter]) > FARTHEST_MM)
        if state.dialect.increments:
            self._count_increments()

    def _stop(self, where: BoolArray) -> None:
        """Leave the first such line, and all after it, to the interpreter."""
        if where.any():
            self.end = min(self.end, int(np.argmax(where)))

    def _count_increments(self) -> None:
        units = dict.fromkeys(LENGTH_LETTERS, INCREMENT_INCH if self.state.inch else INCREMENT_MM)
        units.update(dict.fromkeys("ABC", INCREMENT_DEGREE))
        for letter, column in self.texts.items():
            bare = np.array([text != "" and "." not in text for text in column]) & (self.values[letter] != 0.0)
            self.values[letter] = np.where(bare, self.values[letter] * units[letter], self.values[letter])
            self.counted |= bare

    def execute(self, at: int) -> int:
        """Move; returns how many lines were executed."""
        state = self.state
        self._modes()
        axes = self._any("XYZABC")
        centers = self._any("IJKR")
        straight = (self.mode <= 1) & axes
        arc = (self.mode > 1) & (axes | centers | self.coded)
        self._stop((self.mode <= 1) & centers)
        self._stop((self.mode == NO_MODE) & axes)
        self._feed_words()
        self.cutting = ((self.mode == 1) & axes) | arc
        self._stop(self._no_feed(self.cutting))
        if not (straight | arc)[: self.end].any():
            return self._leave(None)
        control = self._control()
        start, end = self._set_up(control)
        found = self._arcs(np.flatnonzero(arc[: self.end]), control)
        moving = (straight | arc)[: self.end]
        start, end = start[: self.end], end[: self.end]
        kept = moving & ((start != end).any(axis=1) | arc[: self.end])
        feed = self._feeds(start, end, found, moving)
        rows = np.flatnonzero(kept)
        motion = np.where(arc[: self.end], ARC, np.where(self.mode[: self.end] == 1, FEED, RAPID))[rows]
        place = np.cumsum(kept) - 1
        state.recorder.add_many(
            MovesInMm(
                line=rows + (at + 1),
                motion=motion,
                start=start[rows],
                end=end[rows],
                arc_rows=[int(place[row]) for row in found],
                arcs=list(found.values()),
                feed=np.where(motion == RAPID, math.nan, feed[rows]),
                dwell=np.zeros(len(rows)),
                tool=np.full(len(rows), state.tool),
                tool_length=np.full(len(rows), state.tool_length),
                from_machine=np.zeros((len(rows), 2), dtype=bool),
            )
        )
        if len(rows):
            state.note_tool()
        return self._leave(control if moving.any() else None)

    # -- modes -----------------------------------------------------------------------------------------------------

    def _modes(self) -> None:
        """The motion mode of each line."""
        self.coded = np.array([code != "" for code in self.codes])
        codes = np.array([int(code) for code in self.codes if code], dtype=np.int64)
        before = MODES.get(self.state.motion or "", NO_MODE)
        self.mode = np.concatenate([[before], codes])[np.cumsum(self.coded)]

    def _any(self, letters: str) -> BoolArray:
        found = np.zeros(self.n, dtype=bool)
        for letter in letters:
            if letter in self.given:
                found |= self.given[letter]
        return found

    def _feed_words(self) -> None:
        """F in force on each line, and the line that said so (-1: a line before these)."""
        state = self.state
        first, last = self.feeds
        texts = (
            last if not any(first) else first if not any(last) else [a or b for a, b in zip(first, last, strict=True)]
        )
        if any(first) and any(last):
            self._stop(np.array([bool(a and b) for a, b in zip(first, last, strict=True)]))
        said = np.array([text != "" for text in texts])
        values = np.array([float(text) for text in texts if text], dtype=float)
        order = np.cumsum(said)
        self.feed_row = np.concatenate([[-1], np.flatnonzero(said)])[order]
        before = math.nan if state.feed is None else state.feed
        self.feed = np.concatenate([[before], values * state.feed_scale])[order]
        self._stop(self.feed == 0.0)
        units = "inch" if state.inch else "mm"
        if units in state.dialect.feed_needs_point and state.feed_mode != "G93":
            self._stop(np.array([text != "" and "." not in text for text in texts]))

    def _no_feed(self, cutting: BoolArray) -> BoolArray:
        """Cutting lines without a feed."""
        if self.state.feed_mode == "G94":
            return np.asarray(cutting & np.isnan(self.feed))
        rows = np.flatnonzero(cutting)  # G93: each needs its own
        missing = np.zeros(self.n, dtype=bool)
        used = np.concatenate([[-2], rows[:-1]])
        missing[rows] = (self.feed_row[rows] <= used) | np.isnan(self.feed[rows])
        return missing

    # -- points ----------------------------------------------------------------------------------------------------

    def _control(self) -> FloatArray:
        """(n + 1, 6) control coordinates before the first line and after each."""
        state = self.state
        frames = state.frames
        offset = frames.offsets.at(frames.active).axes
        control = np.empty((self.n + 1, 6))
        for axis, letter in enumerate("XYZABC"):
            if letter not in self.values:
                control[:, axis] = frames.position[axis]
                continue
            scaled = self.values[letter] * (state.length_scale if axis < 3 else 1.0)
            given = self.given[letter]
            if state.absolute:
                named = (scaled[given] + frames.g92[axis]) + offset[axis]
                control[0, axis] = frames.position[axis]
                control[1:, axis] = np.concatenate([[frames.position[axis]], named])[np.cumsum(given)]
            else:
                steps = np.concatenate([[frames.position[axis]], np.where(given, scaled, 0.0)])
                control[:, axis] = np.cumsum(steps)
        return control

    def _set_up(self, control: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Set-up coordinates of each line's start and end; an axis that stands keeps its number (`Mover._record`)."""
        setup = control.copy()
        setup[:, :3] -= self.state.frames.fix_reference()
        start, end = setup[:-1], setup[1:]
        still = np.abs(end - start) < 1e-12 * np.maximum(1.0, np.abs(start))
        return start, np.where(still, start, end)

    def _arcs(self, rows: IntArray, control: FloatArray) -> dict[int, Arc]:
        """The arcs of some lines, one by one; the first that is not right ends the run."""
        state = self.state
        frames = state.frames
        first, second, normal = arcs.PLANES[state.plane]
        vector = (float(normal == 0), float(normal == 1), float(normal == 2))
        scale = state.length_scale
        offset, shift, reference = frames.offsets.at(frames.active).axes, frames.g92, frames.fix_reference()
        letters = ("XYZ"[first], "XYZ"[second], "IJK"[first], "IJK"[second], "R", "IJK"[normal])
        nothing = np.full(self.n, math.nan)
        words = np.stack([self.values.get(letter, nothing)[rows] for letter in letters], axis=1).tolist()
        found: dict[int, Arc] = {}
        for row, here, word in zip(rows.tolist(), control[rows, :3].tolist(), words, strict=True):
            x, y, i, j, radius, off_plane = word
            point = [(c - o) - g for c, o, g in zip(here, offset, shift, strict=False)]
            start = (point[first], point[second])
            named = (x * scale, y * scale)
            end = (
                start[0] if math.isnan(x) else named[0] if state.absolute else start[0] + named[0],
                start[1] if math.isnan(y) else named[1] if state.absolute else start[1] + named[1],
            )
            clockwise = bool(self.mode[row] == 2)
            by_radius = not math.isnan(radius)
            no_center = math.isnan(i) and math.isnan(j)
            no_end = math.isnan(x) and math.isnan(y)
            if not math.isnan(off_plane) or by_radius != no_center or (by_radius and no_end):
                self.end = row
                break
            try:
                if by_radius:
                    center = arcs.center_from_radius(start, end, radius * scale, clockwise)
                else:
                    i, j = (0.0 if math.isnan(value) else value for value in (i, j))
                    center = (start[0] + i * scale, start[1] + j * scale)
                arcs.check_radii(start, end, center)
            except arcs.ArcError:
                self.end = row
                break
            point[first], point[second] = center
            a, b, c = (((p + g) + o) - r for p, g, o, r in zip(point, shift, offset, reference, strict=False))
            found[row] = Arc((a, b, c), vector, arcs.arc_sweep(start, end, center, clockwise, 1))
        return found

    # -- feeds -----------------------------------------------------------------------------------------------------

    def _feeds(self, start: FloatArray, end: FloatArray, found: dict[int, Arc], moving: BoolArray) -> FloatArray:
        """Feed of each line's move as `Mover._feed_of` has it."""
        feed = self.feed[: self.end]
        standing = (start[:, :3] == end[:, :3]).all(axis=1)
        standing[list(found)] = False
        if self.state.feed_mode == "G94":
            # Degrees are degrees in inch programs too.
            return np.asarray(np.where(standing, feed / (MM_PER_INCH if self.state.inch else 1.0), feed))
        length = np.abs(end[:, 3:] - start[:, 3:]).max(axis=1)
        for row in np.flatnonzero(moving & ~standing & (self.mode[: self.end] != RAPID)).tolist():
            ends = start[row].tolist(), end[row].tolist()
            length[row] = arc_length(found[row], *ends) if row in found else math.dist(ends[0][:3], ends[1][:3])
        return np.asarray(feed * length)

    def _leave(self, control: FloatArray | None) -> int:
        """Set the interpreter's state as the lines executed leave it."""
        state, last = self.state, self.end - 1
        if last < 0:
            return 0
        if state.dialect.increments and self.counted[: self.end].any():
            state.assume(INCREMENTS.format(state.dialect.name))
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
        state.call, state.returns = None, False
        return self.end
