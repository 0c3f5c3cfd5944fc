"""Plain lines of CAM programs, many at a time: a G0 to G3, X Y Z A B C, I J K R, F, S, an N word.

Most of a big program is such lines. `plain_words` reads them many times faster than `words.read_block` reads blocks; a
line that it does not take as a whole is not plain and is left to `read_block`, with every error.

The lines become moves by the codes' own rules (`codes`, `frames`) on arrays, digit for digit. Here is only what a mode
does along lines: a word holds until the next one. What a number, a feed, a point, an arc means is decided by the
functions that the interpreter calls. A line about which there is anything to say (a word that nothing takes, an arc
that does not fit) ends the run before it: the interpreter then executes it and reports it. mm, degrees, mm/min inside.
"""

from collections.abc import Sequence

from toolpath_stiff.nc.codes.increments import notice_lengths
from toolpath_stiff.nc.plain_moves import Lines
from toolpath_stiff.nc.plain_words import BARE, POINTED, PlainWords, lex
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.words import read_block

FEWEST = 8  # lines; below, one by one is as fast
CHUNK = 8192  # lines: their words fit into a processor's cache


class PlainRun:
    """Executes runs of plain lines of a program on the state of a control."""

    def __init__(self, state: State, lines: Sequence[str], name: str) -> None:
        self.state, self.lines, self.name = state, lines, name
        self._pause = 0  # the line before which another run is not worth trying
        self._start, self._words = -CHUNK, lex([""])[0]  # the chunk
        self._others = [0]  # its lines that are not plain, and its end, in falling order

    def execute(self, first: int) -> PlainWords | None:
        """Execute plain lines from `first` (from 0); returns the words of those that were, None if there are none."""
        if not self._start <= first < self._start + CHUNK:
            words, others = lex(self.lines[first : first + CHUNK])
            self._start, self._words = first, words
            self._others = [first + len(words.code), *(first + others[::-1]).tolist()]
        while self._others[-1] < first:
            self._others.pop()
        end = self._others[-1]
        if end - first < FEWEST or first < self._pause or not _suits(self.state):
            return None
        words = self._words.part(first - self._start, end - self._start)
        done = Lines(self.state, words).execute(first)
        if done < FEWEST:
            self._pause = first + done + 4 * FEWEST
        if not done:
            return None
        self._notice_lengths(first, words, done)
        return words.part(0, done)

    def _notice_lengths(self, first: int, words: PlainWords, done: int) -> None:
        """As `increments.read_numbers`, of all lines executed: the first of each form decides."""
        state = self.state
        if state.dialect.increments:
            return
        wanted = [form for form, known in ((BARE, state.bare), (POINTED, state.pointed)) if not known]
        firsts = ([int(rows.argmax()) for rows in words.lengths(form, done) if rows.any()] for form in wanted)
        for row in sorted({min(rows) + first for rows in firsts if rows}):
            notice_lengths(state, row + 1, read_block(self.lines[row], row + 1, self.name).words)


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
        and not frames.rotated
    )
