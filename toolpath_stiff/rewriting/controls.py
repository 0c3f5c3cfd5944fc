"""Two controls side by side: one executes the untouched program at the placement, one the written program.

Words are chosen so that `out`, at the original origin, arrives where the placement takes `source`. Because `out`
executes the very text that is written, roundings never add up, not even in G91, and work offsets, G92, G52, G10 and
tool lengths need no rewriting: whatever they make of the numbers, `out` does the same. Every written block is checked.

Edits replace, add and take out words of one line; everything else of it stays unchanged.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.interpreter import execute
from toolpath_stiff.nc.moves import RAPID, Move
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES, Block, Word, read_block
from toolpath_stiff.rewriting.side_shift import Course
from toolpath_stiff.rewriting.turn import Turn, differences
from toolpath_stiff.units import MM_PER_INCH

SAME = 1e-9  # mm, inch or degrees: a word whose number changes by less keeps its text
FEED_DECIMALS = 6
# Added words go behind the last word present of those that come before them here.
ORDER = ("G", "X", "Y", "Z", "A", "B", "C", "I", "J", "K", "R", "Q", "P", "L", "F")
NUMBERS = frozenset("XYZABCIJKR")


class LineEdit:
    """A line, cut into its words and what stands between them (blanks, comments, the N word).

    Parameters
    ----------
    text, block
        The line without its end, and the words read from it.
    """

    def __init__(self, text: str, block: Block) -> None:
        self.block = block
        self._words = list(block.words)
        starts = [word.column - 1 for word in block.words]
        ends = [start + len(word.text) for start, word in zip(starts, block.words, strict=True)]
        self._texts = [word.text for word in block.words]
        self._gaps = [
            text[a:b] for a, b in zip([0, *ends], [*starts, len(text)], strict=True)
        ]  # before, after, between
        self._between = "" if "" in self._gaps[1:-1] else " "
        self._points = any("." in word.text for word in block.words if word.letter in NUMBERS)
        self._lower = bool(block.words) and block.words[0].text[0].islower()

    def word(self, letter: str) -> Word | None:
        """The block's word of a letter other than G and M; None if it has none."""
        return next((word for word in self._words if word.letter == letter), None)

    def write(self, letter: str, value: float, decimals: int) -> None:
        """Give a word another number, or add the word."""
        # Fixed digits without idle zeros; a whole number keeps its point where the block writes points: a control that
        # counts `X9` in its least increment reads `X9.` right.
        text = f"{value:.{decimals}f}"
        text = (text.rstrip("0") if "." in text else text) if text.strip("-0.") else "0."
        text = text if self._points else text.removesuffix(".")
        word = self.word(letter)
        if word is None:
            self._add(letter, (letter.lower() if self._lower else letter) + text)
        elif abs(value - word.value) > SAME:
            self._put(word, text)

    def write_code(self, code: str, word: Word | None = None) -> None:
        """Add a G code such as `G1` before the other words, or put it in place of a word."""
        if word is None:
            self._add("G", code.lower() if self._lower else code)
        else:
            self._put(word, code[1:])

    def _put(self, word: Word, text: str) -> None:
        """Replace the number in a word."""
        self._texts[self._words.index(word)] = word.text[0] + text

    def remove(self, letters: Iterable[str]) -> None:
        """Remove the words of these letters, with the blanks beside them that are then superfluous."""
        for letter in letters:
            word = self.word(letter)
            if word is not None:
                index = self._words.index(word)
                self._gaps[index : index + 2] = [self._gaps[index].rstrip() + self._gaps[index + 1]]
                del self._words[index], self._texts[index]

    def render(self) -> str:
        """The line as edited."""
        return self._gaps[0] + "".join(map("".join, zip(self._texts, self._gaps[1:], strict=True)))

    def next_line(self, lead: str) -> LineEdit:
        """A further line in the style of this one, still without words; it begins with `lead`."""
        line = LineEdit(lead, Block(self.block.line, ()))
        line._between, line._points, line._lower = self._between, self._points, self._lower
        return line

    def _add(self, letter: str, text: str) -> None:
        rank = ORDER.index(letter)
        ranks = [ORDER.index(word.letter) if word.letter in ORDER else rank for word in self._words]
        index = 1 + max((i for i, other in enumerate(ranks) if other < rank), default=-1)
        self._gaps.insert(max(index, 1), self._between if self._words else "")  # what begins the line stays there
        self._texts.insert(index, text)
        self._words.insert(index, Word(letter, 0.0, 0, text))


DECIMALS_MM, DECIMALS_INCH = 4, 5
# Of the last decimal: an axis that its block does not name gets a word where it is off by more than rounding.
OFF = 0.75


class Controls:
    """The two controls and what is known of their state.

    Attributes
    ----------
    known
        Letters of axes that the program has put somewhere; of the others only the control knows where they stand.
    edit, axes
        The line of the current block as it will be, the letters of the axes that it names.
    current
        The words of the block by what they do; None for a further line in its place.
    trace
        The moves of that block as the untouched program makes them.
    notes
        What the user should know.
    courses
        Where moves go instead, by the row of the untouched program's move; None: the program is placed elsewhere.
    row_of
        Of each move of the written program, the row of the move in whose place it stands.
    fixed
        Rows that no course may change, with the reason.
    """

    def __init__(self, source: State, out: State, turn: Turn, decimals: int | None, linearise: float | None) -> None:
        self.source, self.out, self.turn = source, out, turn
        self.decimals, self.linearise = decimals, linearise
        self.known = set("ABC")
        self.notes: set[str] = set()
        self.courses: Mapping[int, Course] | None = None
        self.row_of: list[int] = []
        self.fixed: dict[int, str] = {}
        self.edit = LineEdit("", Block(0, ()))
        self.current: CurrentBlock | None = None
        self.axes: list[str] = []
        self.trace: list[Move] = []
        source.trace = self.trace

    def refusal(self, problem: str, hint: str = "") -> InputError:
        """The error for the current block, which cannot be rewritten."""
        return ProgramError(problem, hint=hint, file=self.source.name, line=self.edit.block.line)

    def refuse_if(self, refused: object, problem: str, hint: str) -> None:
        """Raise the error for the current block, if it is to be refused."""
        if refused:
            raise self.refusal(problem, hint)

    @property
    def digits(self) -> int:
        """Decimals of the numbers written."""
        return self.decimals or (DECIMALS_INCH if self.out.inch else DECIMALS_MM)

    @property
    def unit(self) -> float:
        """Size in mm of the last decimal written."""
        return 10.0**-self.digits * self.scale(0)

    def scale(self, axis: int) -> float:
        """Millimetres (or degrees) of a word's unit."""
        return MM_PER_INCH if self.out.inch and axis < 3 else 1.0

    @property
    def matrix(self) -> FloatArray:
        """Turn of the work in the program axes in force."""
        return self.turn.in_program(self.out.frames.turned)

    def image(self, plane: str) -> tuple[str, float] | None:
        """Plane into which a plane is turned, and the sign of its normal; None unless it is one of G17 to G19."""
        column = self.matrix[:, geometry.PLANES[plane][2]]
        images = [(name, float(column[axes[2]])) for name, axes in geometry.PLANES.items()]
        return next(((name, sign) for name, sign in images if abs(sign) == 1.0), None)

    def plane_word(self, before: str) -> str:
        """Turn the block's plane word, if it has one, and return the plane that will then be in force."""
        given = self.current.code("plane") if self.current else None
        if given is None:
            return before
        plane = (self.image(given[0]) or given)[0]
        if plane != given[0]:
            self.edit.write_code(plane, given[1])
        return plane

    def motion_word(self, wanted: str) -> None:
        """Make sure that the block runs in the motion mode `wanted`."""
        mode, word = (self.current.code("motion") if self.current else None) or (self.out.motion, None)
        if mode != wanted:
            self.edit.write_code(wanted, word)

    def target(self, control: Sequence[float]) -> list[float]:
        """Control coordinates of `out` for a point of `source` in its control coordinates."""
        return self.of_setup(self.source.frames.to_setup(list(control)))

    def of_setup(self, setup: Sequence[float]) -> list[float]:
        """Control coordinates of `out` for a point of the untouched program's set-up frame."""
        reference = self.out.frames.fix_reference()
        point = [p + r for p, r in zip(self.turn.point(setup[:3]), reference, strict=True)]
        return [*point, *self.turn.angles(setup[3:], self.out.frames.position[3:])]

    def go(self, target: list[float], axes: Sequence[str], only: Sequence[int] = range(6), parts: int = 1) -> None:
        """Write words of the axes `only` that take `out` to a point in control coordinates, in `parts` equal steps.

        `axes` are those that the untouched block names; another one gets a word only where it has to move too.
        """
        out = self.out
        there, here = out.frames.to_program(target), out.frames.to_program(out.frames.position)
        named = [AXES.index(letter) for letter in axes if letter in "XYZ"]
        matrix = self.matrix if named and not self.known.issuperset("XYZ") else None
        for axis in only:
            letter, scale = AXES[axis], self.scale(axis)
            if letter not in axes:
                coupled = axis < 3 and matrix is not None and matrix[axis, named].any()
                off = abs(there[axis] - here[axis]) > OFF * 10.0**-self.digits * scale
                if not off or not (letter in self.known or coupled):
                    continue
            goal = there[axis] if out.absolute else (there[axis] - here[axis]) / parts
            self.edit.write(letter, goal / scale, self.digits)

    def emit(self) -> str:
        """Execute the edited line on `out` and return its text."""
        text = self.edit.render()
        try:
            block = read_block(text, self.edit.block.line, self.source.name)
            execute(self.out, block)
        except InputError as error:
            raise self.refusal(
                f"the block, rewritten as {text.strip()!r}, would be refused: {error.found}", "give more --decimals"
            ) from None
        if self.trace:
            self.known.update(word.letter for word in block.words)
        return text

    def check(self, first: int, first_out: int, pieces: bool) -> None:
        """Check that each cutting move of the block is the placed one within rounding; of `pieces`, only their ends."""
        source, out = self.source.recorder.recent[first:], self.out.recorder.recent[first_out:]
        rows = range(first, first + len(source))
        self.row_of += rows if len(source) == len(out) else [first] * len(out)
        if self.courses and first in self.courses and source:
            source = [replace(source[0], start=start, end=end, arc=arc) for start, end, arc in self.courses[first]]
            pieces = False
        wanted, written = ([move for move in moves if move.motion != RAPID] for moves in (source, out))
        if pieces and len(wanted) == 1 and written:
            wanted = [replace(wanted[0], arc=None)]
            written = [replace(written[0], end=written[-1].end)]
        # The steps of a cycle with L in G91 repeat one rounding.
        repeats = next((word.value for word in self.edit.block.words if word.letter == "L"), 1.0)
        difference = differences(self.turn, wanted, written, self.unit * max(repeats, 1.0))
        unknown = ", ".join(letter for letter in "XYZ" if letter not in self.known)
        place = f"position {unknown} in rapid before the first cutting move"
        hint = place if unknown else "give more --decimals, or position X, Y, Z and the rotary axes in rapid before it"
        self.refuse_if(difference, f"the block cannot be rewritten: its cutting move {difference}", hint)
