"""Plain lines of CAM programs, many at a time: a G0 to G3, X Y Z A B C, I J K R, F, S, an N word, comments.

Most of a big program is such lines. `plain_words` reads them many times faster than `words.read_block` reads blocks; a
line that it does not take as a whole is not plain and is left to `read_block`, with every error.

The lines become moves by the codes' own rules (`codes`, `frames`) on arrays, digit for digit. Here is only what a mode
does along lines: a word holds until the next one. What a number, a feed, a point, an arc means is decided by the
functions that the interpreter calls. A line about which there is anything to say (a word that nothing takes, an arc
that does not fit) ends the run before it: the interpreter then executes it and reports it. mm, degrees, mm/min inside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.nc.codes.drilling import CYCLES
from toolpath_stiff.nc.codes.points import assume_increments, warn_of_points, watches_points
from toolpath_stiff.nc.plain_holes import drill, rows_of_hole, suits
from toolpath_stiff.nc.plain_moves import MODES, Lines
from toolpath_stiff.nc.plain_words import (
    LENGTH_LETTERS,
    NO_CODE,
    PlainLines,
    PlainWords,
    first_bare,
    has_pointed,
    is_bare,
)
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.words import read_block

FEWEST = 8  # lines; below, one by one is as fast


class PlainRun:
    """Executes runs of plain lines of a program on the state of a control."""

    def __init__(self, state: State, lines: Sequence[str], name: str) -> None:
        self.state, self.name = state, name
        self.lines = PlainLines(lines, state.dialect.semicolon)
        self._pause = 0  # the line before which another run is not worth trying

    def execute(self, first: int) -> PlainWords | None:
        """Execute plain lines from `first` (from 0); returns the words of those that were, None if there are none."""
        count = self.lines.run(first)
        if count < FEWEST or first < self._pause or not _suits(self.state):
            return None
        words = self.lines.words(first, count)
        if self.state.motion not in MODES and words.code[0] == NO_CODE and words.count[0]:
            done = self._holes(first, words)
        else:
            lines = Lines(self.state, words)
            done = lines.execute(first)
            if done < FEWEST:
                self._pause = first + done + 4 * FEWEST
            self._watch_points(first, words, done)
        return words.part(0, done) if done else None

    def _holes(self, first: int, words: PlainWords) -> int:
        """Drill holes like that of the line before; returns how many lines were executed."""
        state = self.state
        if state.motion not in CYCLES or not self.lines.has(first - 1) or not suits(state):
            return 0
        hole = rows_of_hole(state.recorder, first)
        others = np.flatnonzero(~words.are_places())
        count = int(others[0]) if len(others) else len(words)
        if hole is None or not self.lines.words(first - 1, 1).are_places().all() or not count:
            return 0
        lines = Lines(state, words.part(0, count))
        places = lines.places()
        if not len(places):
            return 0
        drill(state, hole, first + 1, places)
        if state.dialect.increments and lines.counted[: len(places)].any():
            assume_increments(state)
        self._watch_points(first, words, len(places))
        return len(places)

    def _watch_points(self, first: int, plain: PlainWords, done: int) -> None:
        """As `points.read_numbers`, of all lines executed."""
        state = self.state
        if not watches_points(state):
            return
        state.pointed = state.pointed or has_pointed(plain, done)
        row = first_bare(plain, done) if state.bare is None else None
        if row is not None:
            words = read_block(self.lines.lines[first + row], first + row + 1, self.name, state.dialect.semicolon).words
            word = next(w for w in words if w.letter in LENGTH_LETTERS and is_bare("".join(w.text[1:].split())))
            state.bare = (first + row + 1, word)
        warn_of_points(state)


def _suits(state: State) -> bool:
    """Whether the modes in force leave plain words their plain meaning."""
    frames = state.frames
    return (
        state.feed_mode in ("G93", "G94")
        and state.polar is None
        and state.unsettled is None
        and state.corner is None
        and state.cutter is None
        and state.beside is None
        and not state.height_lost
        and not state.arc_absolute
        and not frames.bound
    )
