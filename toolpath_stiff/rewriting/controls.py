"""Two controls side by side: one executes the untouched program at the placement, one the written program.

Words are chosen so that `out`, at the original origin, arrives where the placement takes `source`. Because `out`
executes the very text that is written, roundings never add up, not even in G91, and work offsets, G92, G52, G10 and
tool lengths need no rewriting: whatever they make of the numbers, `out` does the same. Every written block is checked.

Edits replace, add and take out words of one line; everything else of it stays as it stands.

The turn of the work: points, rotary words, directions of the placed path; moves cut into pieces. mm, degrees.

The untouched program at the placement (o, Q) puts the set-up point p at o + Q p; the written one, at the original
origin (oo, Qo), must put its own point there: p_new = Qo^T (Q p + o - oo). Orientations follow the rule of `path`,
undone with the original: R_new = Qo^T Q R Rz(-C) Rz(Co). A block's moves are compared with those of the written block
in the same way.

Cut into pieces are arcs that no plane expresses any more, and turns of the tool that words express at ends only; they
are in the set-up frame of the untouched program.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes import MOTION, PLANE
from toolpath_stiff.nc.interpreter import execute
from toolpath_stiff.nc.moves import RAPID, Arc, Recorder
from toolpath_stiff.nc.state import CurrentBlock, Segment, State
from toolpath_stiff.nc.words import AXES, Block, Word, read_block
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_about_z, rotation_matrices
from toolpath_stiff.units import MM_PER_INCH, ShopPose

SAME = 1e-9  # mm, inch or degrees: a word whose number changes by less keeps its text
FEED_DECIMALS = 6

# Added words go behind the last word present of those that come before them here.
ORDER = ("G", "X", "Y", "Z", "A", "B", "C", "I", "J", "K", "R", "Q", "P", "L", "F")
NUMBERS = frozenset("XYZABCIJKR")
NOISE = 1e-12  # of a direction cosine: what is left of 0 or 1 after cosines and products
UPRIGHT = 1e-9  # degrees; smaller tilts are rounding
LARGEST_CHORD = math.pi / 2.0  # of a circle, whatever the tolerance

# A control interpolates A, B and C; between its ends a turned move leans a little otherwise. So little changes a
# stiffness by parts in ten thousand at most, as a radian changes it by about itself.
LEAN = 0.01
LEVER = 100.0  # mm along the tool at which a tolerance in mm is one in degrees
BETWEEN = np.array([0.25, 0.5, 0.75])


# -- a line ------------------------------------------------------------------------------------------------------------


class LineEdit:
    """A line, cut into its words and what stands between them (blanks, comments, the N word).

    Parameters
    ----------
    text, block
        The line without its end, and the words read from it.
    decimals
        Of the numbers written.
    """

    def __init__(self, text: str, block: Block, decimals: int) -> None:
        self.block, self.decimals = block, decimals
        self._words = list(block.words)
        self._texts = [word.text for word in block.words]
        ends = [0, *(word.column - 1 + len(word.text) for word in block.words)]
        starts = [*(word.column - 1 for word in block.words), len(text)]
        self._gaps = [text[end:start] for end, start in zip(ends, starts, strict=True)]
        packed = len(self._gaps) > 2 and "" in self._gaps[1:-1]
        self._between = "" if packed else " "
        self._points = any("." in word.text for word in block.words if word.letter in NUMBERS)
        self._lower = bool(block.words) and block.words[0].text[0].islower()

    def word(self, letter: str) -> Word | None:
        """The block's word of a letter other than G and M; None if it has none."""
        return next((word for word in self._words if word.letter == letter), None)

    def write(self, letter: str, value: float, decimals: int | None = None) -> None:
        """Give a word another number, or add the word."""
        word = self.word(letter)
        text = self._number(value, self.decimals if decimals is None else decimals)
        if word is None:
            self._add(letter, (letter.lower() if self._lower else letter) + text)
        elif abs(value - word.value) > SAME:
            self.replace(word, word.text[0] + text)

    def replace(self, word: Word, text: str) -> None:
        """Put other text in a word's place."""
        self._texts[self._words.index(word)] = text

    def add_code(self, code: str) -> None:
        """Add a G code, `G1` say, before the other words."""
        self._add("G", code.lower() if self._lower else code)

    def remove(self, letters: Iterable[str]) -> None:
        """Take out the words of these letters."""
        for letter in letters:
            word = self.word(letter)
            if word is not None:
                self.cut(word)

    def cut(self, word: Word) -> None:
        """Take out a word, and the blanks beside it that are then one too many."""
        at = self._words.index(word)
        del self._words[at], self._texts[at]
        before, after = self._gaps[at], self._gaps.pop(at + 1)
        if not before.strip() and at > 0:
            self._gaps[at] = after
        elif not after.strip():
            self._gaps[at] = before
        else:
            self._gaps[at] = before + after

    def render(self) -> str:
        """The line as edited."""
        return "".join(gap + text for gap, text in zip(self._gaps, [*self._texts, ""], strict=True))

    def next_line(self, lead: str) -> LineEdit:
        """A further line in this one's style, with no words yet; `lead` stands before them."""
        line = LineEdit(lead, Block(self.block.line, ()), self.decimals)
        line._between, line._points, line._lower = self._between, self._points, self._lower
        return line

    @property
    def moves(self) -> bool:
        """Whether the line holds an axis word."""
        return any(word.letter in AXES for word in self._words)

    def _add(self, letter: str, text: str) -> None:
        rank = ORDER.index(letter)
        added = Word(letter, 0.0, 0, text)
        ranked = [(ORDER.index(w.letter), i) for i, w in enumerate(self._words) if w.letter in NUMBERS]
        before, after = [i for r, i in ranked if r < rank], [i for r, i in ranked if r > rank]
        codes = [i for i, w in enumerate(self._words) if w.letter == "G"]
        if letter == "G":
            at = 0
        elif before:
            at = before[-1] + 1
        elif after:
            at = after[0]
        else:
            at = codes[-1] + 1 if codes else len(self._words)
        self._words.insert(at, added)
        self._texts.insert(at, text)
        if at == 0:  # what stands before the first word stays there
            self._gaps.insert(1, self._between if len(self._words) > 1 else "")
        else:
            self._gaps.insert(at, self._between)

    def _number(self, value: float, decimals: int) -> str:
        """Fixed digits without idle zeros; a whole number keeps its point where the block writes points.

        A control that counts `X9` in its least increment reads `X9.` right, so the block's own style is kept.
        """
        text = f"{value:.{decimals}f}"
        text = text.rstrip("0") if "." in text else text
        if not text.strip("-0."):
            text = "0."
        return text if self._points else text.removesuffix(".")


# -- the controls ------------------------------------------------------------------------------------------------------


DECIMALS_MM, DECIMALS_INCH = 4, 5

# Of the last decimal: an axis that its block does not name gets a word where it is off by more than rounding.
OFF = 0.75


class Controls:
    """The controls, and what is known of them.

    Attributes
    ----------
    known
        Axes that the program has put somewhere; of the others only the control knows where they stand.
    block
        The current one.
    trace
        The moves of that block as the untouched program makes them.
    notes
        What the user should know, each once.
    """

    def __init__(self, source: State, out: State, turn: Turn, decimals: int | None, linearise: float | None) -> None:
        self.source, self.out, self.turn = source, out, turn
        self.decimals, self.linearise = decimals, linearise
        self.known = [False, False, False, True, True, True]
        self.notes: list[str] = []
        self.block = Block(0, ())
        self.trace: list[Segment] = []
        source.trace = self.trace
        self._coarsest = 0.0  # mm, the last decimal of any block so far: inches round coarser than mm

    def note(self, sentence: str) -> None:
        """Say a sentence, once."""
        if sentence not in self.notes:
            self.notes.append(sentence)

    def refusal(self, found: str, hint: str = "") -> InputError:
        """Why the current block cannot be rewritten."""
        return ProgramError(found, hint=hint, file=self.source.name, line=self.block.line)

    # -- units and axes --------------------------------------------------------------------------------------------

    @property
    def digits(self) -> int:
        """Decimals of the numbers written."""
        if self.decimals is not None:
            return self.decimals
        return DECIMALS_INCH if self.out.inch else DECIMALS_MM

    @property
    def unit(self) -> float:
        """The last decimal in mm."""
        return 10.0**-self.digits * self.scale(0)

    def scale(self, axis: int) -> float:
        """Millimetres (or degrees) of a word's unit."""
        return MM_PER_INCH if self.out.inch and axis < 3 else 1.0

    @property
    def matrix(self) -> FloatArray:
        """The turn in the program axes in force."""
        return self.turn.in_program(self.out.frames.turned)

    def image(self, plane: str) -> tuple[str, float] | None:
        """The plane that a plane is turned into, and the sign of its normal; None if it is none of the three."""
        column = self.matrix[:, geometry.PLANES[plane][2]]
        for name, (_, _, normal) in geometry.PLANES.items():
            if abs(column[normal]) == 1.0:
                return name, float(column[normal])
        return None

    def _know(self, letters: Sequence[str]) -> None:
        for letter in letters:
            if letter in AXES:
                self.known[AXES.index(letter)] = True

    # -- words -----------------------------------------------------------------------------------------------------

    def plane_word(self, current: CurrentBlock | None, edit: LineEdit, before: str) -> str:
        """Turn the plane word of the block, if it has one; the plane that will be in force."""
        given = None if current is None else current.code(PLANE)
        if given is None:
            return before
        image = self.image(given[0])
        plane = image[0] if image else given[0]
        if plane != given[0]:
            edit.replace(given[1], given[1].text[0] + plane[1:])
        return plane

    def motion_word(self, current: CurrentBlock | None, edit: LineEdit, wanted: str) -> None:
        """Make sure that the block is executed in the motion mode wanted."""
        given = None if current is None else current.code(MOTION)
        if given is None:
            if self.out.motion != wanted:
                edit.add_code(wanted)
        elif given[0] != wanted:
            edit.replace(given[1], given[1].text[0] + wanted[1:])

    def target(self, control: Sequence[float]) -> list[float]:
        """Control coordinates of `out` for a point of `source` in its control coordinates."""
        return self.of_setup(self.source.frames.to_setup(list(control)))

    def of_setup(self, setup: Sequence[float]) -> list[float]:
        """Control coordinates of `out` for a point of the untouched program's set-up frame."""
        reference = self.out.frames.fix_reference()
        point = [p + r for p, r in zip(self.turn.point(setup[:3]), reference, strict=True)]
        return [*point, *self.turn.angles(setup[3:], self.out.frames.position[3:])]

    def go(
        self, edit: LineEdit, target: list[float], axes: Sequence[str], only: Sequence[int] = range(6), parts: int = 1
    ) -> None:
        """Words of the axes `only`, so that `out` goes to a point in control coordinates, in `parts` equal steps.

        `axes` are those that the untouched block names; another one gets a word only where it has to move too.
        """
        out = self.out
        there, here = out.frames.to_program(target), out.frames.to_program(out.frames.position)
        named = [AXES.index(letter) for letter in axes if letter in "XYZ"]
        matrix = self.matrix if named and not all(self.known) else None
        for axis in only:
            letter, scale = AXES[axis], self.scale(axis)
            if letter not in axes:
                coupled = axis < 3 and matrix is not None and matrix[axis, named].any()
                off = abs(there[axis] - here[axis]) > OFF * 10.0**-self.digits * scale
                if not off or not (self.known[axis] or coupled):
                    continue
            goal = there[axis] if out.absolute else (there[axis] - here[axis]) / parts
            edit.write(letter, goal / scale)

    # -- execute and check -----------------------------------------------------------------------------------------

    def emit(self, edit: LineEdit) -> str:
        """Have `out` execute the edited line; its text."""
        text = edit.render()
        try:
            block = read_block(text, self.block.line, self.source.name)
            execute(self.out, block)
        except InputError as error:
            raise self.refusal(
                f"the block, rewritten as {text.strip()!r}, would be refused: {error.found}", "give more --decimals"
            ) from None
        if self.trace:
            self._know([word.letter for word in block.words])
        return text

    def check(self, first: int, first_out: int, pieces: bool) -> None:
        """Every cutting move of the block must be the placed one to within the rounding; of `pieces` the two ends."""
        self._coarsest = unit = max(self._coarsest, self.unit)
        wanted = cutting_rows(self.source.recorder, first)
        found = cutting_rows(self.out.recorder, first_out)
        if pieces and wanted and found:
            wanted = [wanted[0]._replace(end=wanted[-1].end, arc=None)]
            found = [found[0]._replace(end=found[-1].end)]
        # The steps of a cycle with L in G91 repeat one rounding.
        repeats = next((word.value for word in self.block.words if word.letter == "L"), 1.0)
        difference = differences(self.turn, wanted, found, unit * max(repeats, 1.0))
        if difference is not None:
            raise self.refusal(
                f"the block cannot be rewritten: its cutting move {difference.words}", self._remedy(difference.kind)
            )

    def _remedy(self, kind: str) -> str:
        unknown = ", ".join(AXES[axis] for axis in range(3) if not self.known[axis])
        if unknown:
            return f"position {unknown} in rapid before the first cutting move"
        if kind in (START, AXIS):
            return "position X, Y, Z and the rotary axes in rapid before it"
        return "" if kind == END else "give more --decimals"


class Turn:
    """The rigid motion of the set-up frame that takes the original work to the placed one.

    Parameters
    ----------
    placement, original
        Origins as `--origin` takes them, but in mm and degrees.
    """

    def __init__(self, placement: ShopPose, original: ShopPose) -> None:
        new, old = (rotation_matrices(np.radians(origin[3:])) for origin in (placement, original))
        self.turn: FloatArray = _clean(old.T @ new)
        shift = np.array(placement[:3]) - np.array(original[:3])
        self.shift = shift if not any(original[3:]) else old.T @ shift
        self._yaw = rotation_about_z(np.radians(original[5] - placement[5]))
        self.turns = not np.array_equal(self.turn, np.eye(3))
        still = _clean(self.turn @ self._yaw)
        self._never_yaws = np.array_equal(still, np.eye(3))  # a turn about the vertical alone
        self._rows = [[float(v) for v in row] for row in self.turn]
        self._shift = [float(v) for v in self.shift]

    def point(self, point: Sequence[float]) -> list[float]:
        """The placed point of a point of the set-up frame, x, y, z in mm."""
        x, y, z = point
        if not self.turns:
            return [x + self._shift[0], y + self._shift[1], z + self._shift[2]]
        return [a * x + b * y + c * z + s for (a, b, c), s in zip(self._rows, self._shift, strict=True)]

    def rotations(self, abc: FloatArray) -> FloatArray:
        """(n, 3, 3) rotations R_new of programmed roll, pitch, yaw (n, 3) in degrees."""
        return self.turn @ rotation_matrices(np.radians(abc)) @ self._yaw

    def angles(self, abc: Sequence[float], near: Sequence[float]) -> list[float]:
        """Rotary words a, b, c in degrees; of the many that are the same rotation, those next to `near`."""
        if self.keeps(abc):
            return list(abc)
        a, b, c = np.degrees(roll_pitch_yaw(self.rotations(np.array([abc], dtype=float))[0]))
        same = [np.array([a, b, c]), np.array([a + 180.0, 180.0 - b, c + 180.0])]
        close = [angles - 360.0 * np.round((angles - np.array(near)) / 360.0) for angles in same]
        best = min(close, key=lambda angles: float(np.abs(angles - near).max()))
        return [float(v) for v in best]

    def keeps(self, abc: Sequence[float]) -> bool:
        """Whether rotary words stay as they are: a vertical platform never yaws with the work."""
        return self._never_yaws and (not self.turns or max(abs(abc[0]), abs(abc[1])) < UPRIGHT)

    def in_program(self, rotation: float) -> FloatArray:
        """(3, 3) turn as it looks in program axes that a work offset's rotation (degrees) turned already."""
        if not rotation or not self.turns:
            return self.turn
        inner = rotation_about_z(np.radians(rotation))
        return _clean(inner.T @ self.turn @ inner)


def _clean(matrix: FloatArray) -> FloatArray:
    """Direction cosines with the noise about 0 and +-1 taken off, so that what is unturned stays so exactly."""
    whole = np.round(matrix)
    return np.where(np.abs(matrix - whole) < NOISE, whole, matrix) + 0.0


def chords(arc: Arc, start: Sequence[float], end: Sequence[float], tolerance: float) -> int:
    """Number of chords that stay within `tolerance` (mm) of an arc: r (1 - cos(step / 2)) <= tolerance."""
    radius = max(math.dist(start[:3], arc.center), _radius_at_end(arc, end))
    step = 2.0 * math.acos(max(1.0 - tolerance / radius, -1.0))
    return math.ceil(abs(arc.sweep) / min(step, LARGEST_CHORD) - 1e-9)


def _radius_at_end(arc: Arc, end: Sequence[float]) -> float:
    out = np.array(end[:3]) - np.array(arc.center)
    normal = np.array(arc.normal)
    return float(np.linalg.norm(out - (out @ normal) * normal))


def points_between(start: Sequence[float], end: Sequence[float], arc: Arc | None, count: int) -> list[list[float]]:
    """Ends (6) of `count` equal pieces of a move; the last one is its end to the last digit."""
    first, last = np.array(start), np.array(end)
    points = [list(map(float, first + i / count * (last - first))) for i in range(1, count)]
    if arc is not None:
        for i, point in enumerate(points, 1):
            point[:3] = _on_arc(arc, first[:3], last[:3], i / count)
    return [*points, list(end)]


def _on_arc(arc: Arc, start: FloatArray, end: FloatArray, u: float) -> list[float]:
    """Point at the share u of an arc, helix or spiral: radius and height change evenly, as in `path`."""
    center, normal = np.array(arc.center), np.array(arc.normal)
    outward = start - center
    climb = float((end - start) @ normal)
    lift = float(outward @ normal)
    outward = outward - lift * normal
    radius = float(np.linalg.norm(outward))
    growth = _radius_at_end(arc, list(end)) - radius
    e1 = outward / radius
    e2 = np.cross(normal, e1)
    angle = u * arc.sweep
    point = center + (radius + u * growth) * (math.cos(angle) * e1 + math.sin(angle) * e2) + (lift + u * climb) * normal
    return [float(v) for v in point]


def lean(turn: Turn, programmed: Sequence[Sequence[float]], written: Sequence[Sequence[float]]) -> float:
    """Largest angle (degrees) between the tool as placed and as written, midway in a move; rotary words of both ends.

    Both controls go evenly from the first angles to the last; only at the ends are these the same rotation.
    """
    (a0, a1), (w0, w1) = np.array(programmed, dtype=float), np.array(written, dtype=float)
    wanted = turn.rotations(a0 + BETWEEN[:, None] * (a1 - a0))
    found = rotation_matrices(np.radians(w0 + BETWEEN[:, None] * (w1 - w0)))
    return max(angle_between(one, other) for one, other in zip(wanted, found, strict=True))


def angle_between(first: FloatArray, second: FloatArray) -> float:
    """Angle in degrees between two rotations; exact for small ones, where the cosine has no digits left."""
    chord = float(np.linalg.norm(first - second)) / (2.0 * math.sqrt(2.0))
    return 2.0 * math.degrees(math.asin(min(chord, 1.0)))


# -- comparing ---------------------------------------------------------------------------------------------------------

# In units of the last decimal written. Ends: half a unit per axis, three axes, and the same of the start; a centre
# given by I, J, K adds that of its own words, one given by R what `blocks.NEAR` allows.
END_UNITS, CENTER_UNITS = 2.0, 6.0
SHORTEST_UNITS = 4.0
START, END, AXIS, SHAPE = "start", "end", "tool axis", "shape"


class Row(NamedTuple):
    """A recorded cutting move: ends (6), arc."""

    start: list[float]
    end: list[float]
    arc: Arc | None


def cutting_rows(recorder: Recorder, first: int) -> list[Row]:
    """Cutting moves recorded from `first` on."""
    return [
        Row(recorder.start[i], recorder.end[i], recorder.arc[i])
        for i in range(first, len(recorder.line))
        if recorder.motion[i] != RAPID
    ]


class Difference(NamedTuple):
    """How a written cutting move differs from the placed one: in what (`START`, `END`, `AXIS`, `SHAPE`), in words."""

    kind: str
    words: str


def differences(turn: Turn, wanted: list[Row], found: list[Row], unit: float) -> Difference | None:
    """How the written cutting moves of a block differ from the placed ones beyond the rounding to `unit` mm.

    Straight moves of a few units may vanish by rounding, or come to be.
    """
    left, right = list(wanted), list(found)
    while left and right:
        what = difference(turn, left[0], right[0], unit)
        if what is None:
            del left[0], right[0]
        elif _short(left[0], unit):
            del left[0]
        elif _short(right[0], unit):
            del right[0]
        else:
            return what
    if all(_short(row, unit) for row in (*left, *right)):
        return None
    return Difference(SHAPE, f"would be {len(found)} moves and not {len(wanted)}")


def _short(row: Row, unit: float) -> bool:
    return row.arc is None and max(abs(e - s) for s, e in zip(row.start, row.end, strict=True)) < SHORTEST_UNITS * unit


def difference(turn: Turn, wanted: Row, found: Row, unit: float) -> Difference | None:
    """How a written cutting move differs from the placed one beyond the rounding to `unit` mm.

    For the steps of one word, as those of a cycle with L in G91, `unit` is that of all of them.
    """
    ends = ((wanted.start, found.start, START), (wanted.end, found.end, END))
    for placed, written, kind in ends:
        target, point = turn.point(placed[:3]), written[:3]
        apart = math.dist(target, point)
        if apart > END_UNITS * unit:
            return Difference(kind, f"{kind}s {apart:.4g} mm off")
    for placed, written, _ in ends:
        if placed[3:] == written[3:] and turn.keeps(placed[3:]):
            continue
        goal = turn.rotations(np.array([placed[3:]]))[0]
        angle = angle_between(goal, rotation_matrices(np.radians(written[3:])))
        if angle > END_UNITS * unit:
            return Difference(AXIS, f"has its tool axis {angle:.4g} degrees off")
    if wanted.arc is None or found.arc is None:
        return None if wanted.arc is found.arc else Difference(SHAPE, "is another kind of move")
    return _arc_difference(turn, wanted.arc, found, unit)


def _arc_difference(turn: Turn, arc: Arc, found: Row, unit: float) -> Difference | None:
    assert found.arc is not None
    normal = turn.turn @ np.array(arc.normal)
    sense = float(normal @ np.array(found.arc.normal))
    if abs(abs(sense) - 1.0) > 1e-9:
        return Difference(SHAPE, "lies in another plane")
    apart = np.array(turn.point(arc.center)) - np.array(found.arc.center)
    off = float(np.linalg.norm(apart - (apart @ normal) * normal))
    if off > CENTER_UNITS * unit:
        return Difference(SHAPE, f"has its centre {off:.4g} mm off")
    radius = math.dist(found.start[:3], found.arc.center)
    swept = abs(arc.sweep - math.copysign(1.0, sense) * found.arc.sweep)
    if swept * radius > 4.0 * CENTER_UNITS * unit:
        return Difference(SHAPE, f"has its sweep {math.degrees(swept):.4g} degrees off")
    return None
