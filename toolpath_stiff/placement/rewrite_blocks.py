"""One block of a program, written for another placement: which words get which numbers.

The rewriter runs two controls side by side: `source` executes the untouched program at the placement, `out` the
written one at the original origin. Words are chosen so that `out` arrives where the placement takes `source`; because
`out` executes the very text that is written, roundings never add up, in G91 neither, and work offsets, G92, G52, G10,
tool lengths need no rewriting: whatever they make of the numbers, `out` does the same. Every written block is checked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc import arcs
from toolpath_stiff.nc.blocks import AXES, Codes
from toolpath_stiff.nc.codes import ARCS, CYCLES, MOTION, PLANE
from toolpath_stiff.nc.interpreter import USES_AXES, Interpreter
from toolpath_stiff.nc.words import Block, read_block
from toolpath_stiff.placement.rewrite_trace import Tracer, cutting_rows, difference
from toolpath_stiff.placement.rewrite_turn import Turn
from toolpath_stiff.placement.rewrite_words import LineEdit
from toolpath_stiff.units import MM_PER_INCH

FloatArray = NDArray[np.float64]

DECIMALS_MM, DECIMALS_INCH = 4, 5
# Of the last decimal: an axis that its block does not name gets a word where it is off by more than rounding.
OFF = 0.75
NEAR = 2.0  # units by which the centre of an arc given by R may miss its place; beyond, I, J, K are written


class Rewriter:
    """Both controls, and what was done so far.

    Attributes
    ----------
    known
        Axes that the program has put somewhere; of the others only the control knows where they stand.
    notes
        What the user should hear of, each once.
    """

    def __init__(
        self, source: Tracer, out: Interpreter, turn: Turn, decimals: int | None, linearise: float | None
    ) -> None:
        self.source, self.out, self.turn = source, out, turn
        self.decimals, self.linearise = decimals, linearise
        self.known = [False, False, False, True, True, True]
        self.notes: list[str] = []

    def block(self, block: Block, text: str) -> tuple[list[str], bool]:
        """The lines that take a block's place, and whether the program goes on."""
        if not block.words:
            return [text], True
        source, out = self.source, self.out
        source.segments = []
        first, first_out = len(source.recorder.line), len(out.recorder.line)
        codes = source.begin(block)
        axes = [letter for letter in AXES if source.has(letter)]
        plane_before = out.plane
        out.begin(block)
        goes_on = source.finish(codes)
        edit = LineEdit(text, block, self._decimals)
        wanted_plane = self._plane_word(codes, edit, plane_before)
        lines = self._lines(codes, edit, axes, wanted_plane)
        self._check(first, first_out)
        return lines, goes_on

    # -- modes ---------------------------------------------------------------------------------------------------

    @property
    def _decimals(self) -> int:
        if self.decimals is not None:
            return self.decimals
        return DECIMALS_INCH if self.out.inch else DECIMALS_MM

    @property
    def _unit(self) -> float:
        """The last decimal in mm."""
        return 10.0**-self._decimals * (MM_PER_INCH if self.out.inch else 1.0)

    def _scale(self, axis: int) -> float:
        return MM_PER_INCH if self.out.inch and axis < 3 else 1.0

    @property
    def _matrix(self) -> FloatArray:
        """The turn in the program axes in force."""
        frames = self.out.frames
        return self.turn.in_program(frames.offsets.table[frames.active].rotation)

    def _image(self, plane: str) -> tuple[str, float] | None:
        """The plane that a plane is turned into, and the sign of its normal; None if it is none of the three."""
        column = self._matrix[:, arcs.PLANES[plane][2]]
        for name, (_, _, normal) in arcs.PLANES.items():
            if abs(column[normal]) == 1.0:
                return name, float(column[normal])
        return None

    def _plane_word(self, codes: Codes, edit: LineEdit, before: str) -> str:
        """Turn the plane word of the block, if it has one; the plane that will be in force."""
        given = codes.groups.get(PLANE)
        if given is None:
            return before
        image = self._image(given[0])
        plane = image[0] if image else given[0]
        if plane != given[0]:
            edit.replace(given[1], given[1].text[0] + plane[1:])
        return plane

    # -- kinds of block ---------------------------------------------------------------------------------------------

    def _lines(self, codes: Codes, edit: LineEdit, axes: list[str], plane: str) -> list[str]:
        source = self.source
        once = [code for code, _ in codes.once]
        if not source.segments or "G53" in once:
            self._know(axes if "G53" in once else [])
            return [self._emit(edit)]
        if any(code in USES_AXES for code in once):
            self._home(edit, axes)
        elif source.motion in CYCLES:
            self._cycle(codes, edit, axes, plane)
        elif source.segments[-1].arc is not None:
            self._arc(codes, edit, axes, plane)
        else:
            self._motion_word(codes, edit, source.motion or "")
            self._go(edit, self._target(source.segments[-1].end), axes)
        return [self._emit(edit)]

    def _target(self, control: Sequence[float]) -> list[float]:
        """Control coordinates of `out` for a point of `source` in its control coordinates."""
        setup = self.source.frames.to_setup(list(control))
        reference = self.out.frames.fix_reference()
        point = [p + r for p, r in zip(self.turn.point(setup[:3]), reference, strict=True)]
        return [*point, *self.turn.angles(setup[3:], self.out.frames.position[3:])]

    def _motion_word(self, codes: Codes, edit: LineEdit, wanted: str) -> None:
        """See to it that the block is executed in the motion mode wanted."""
        given = codes.groups.get(MOTION)
        if given is None:
            if self.out.motion != wanted:
                edit.add_code(wanted)
        elif given[0] != wanted:
            edit.replace(given[1], given[1].text[0] + wanted[1:])

    def _plane_for(self, edit: LineEdit, wanted: str, in_force: str) -> None:
        if wanted != in_force:
            edit.add_code(wanted)

    def _go(
        self, edit: LineEdit, target: list[float], axes: Sequence[str], only: Sequence[int] = range(6), parts: int = 1
    ) -> None:
        """Words of the axes `only`, so that `out` goes to a point in control coordinates, in `parts` equal steps."""
        out = self.out
        there, here = out.frames.to_program(target), out.frames.to_program(out.frames.position)
        matrix = self._matrix
        for axis in only:
            letter = AXES[axis]
            coupled = axis < 3 and any(matrix[axis, AXES.index(other)] for other in axes if other in "XYZ")
            if letter not in axes:
                if not (self.known[axis] or coupled):
                    continue
                if abs(there[axis] - here[axis]) <= OFF * 10.0**-self._decimals * self._scale(axis):
                    continue
            goal = there[axis] if out.absolute else (there[axis] - here[axis]) / parts
            edit.write(letter, goal / self._scale(axis))

    def _home(self, edit: LineEdit, axes: list[str]) -> None:
        """G28, G30: the intermediate point moves with the work, the reference point does not."""
        if not axes:
            return
        if "G28" not in [w.letter + f"{w.value:g}" for w in edit.block.words] and not self.source.segments:
            return
        coupling = self._matrix != 0.0
        named = [AXES.index(letter) for letter in axes]
        for axis in range(3):
            partners = [other for other in range(3) if coupling[axis, other] or coupling[other, axis]]
            if axis in named and any(other not in named for other in partners):
                missing = " and ".join(AXES[other] for other in partners if other not in named)
                raise self._refusal(
                    f"sends {AXES[axis]} home without {missing}, and with the work turned these are no axes",
                    "name every axis that the turn mixes, or none",
                )
        self._go(edit, self._target(self.source.segments[0].end), axes, only=named)
        self._know(axes)

    def _arc(self, codes: Codes, edit: LineEdit, axes: list[str], plane: str) -> None:
        source, out = self.source, self.out
        image = self._image(source.plane)
        arc = source.segments[-1].arc
        assert arc is not None
        if image is None:
            raise self._refusal(
                f"an arc of {source.plane}, turned, lies in none of the planes G17, G18, G19",
                "linearise it with --linearise MM",
            )
        name, sign = image
        self._plane_for(edit, name, plane)
        code = source.motion if sign > 0.0 else ARCS[1 - ARCS.index(source.motion or "")]
        self._motion_word(codes, edit, code or "")
        first, second, normal = arcs.PLANES[name]
        target = self._target(source.segments[-1].end)
        full = math.isclose(abs(arc.sweep) % math.tau, 0.0, abs_tol=1e-9) or math.isclose(
            abs(arc.sweep) % math.tau, math.tau, abs_tol=1e-9
        )
        if full:  # ends on its own start to the last digit, or it is no circle
            edit.remove(letter for letter in (AXES[first], AXES[second]))
            in_plane = [letter for letter in axes if AXES.index(letter) in (first, second)]
            self._go(edit, target, [a for a in axes if a not in in_plane], only=[normal, 3, 4, 5])
        else:
            self._go(edit, target, axes)
        self._center(edit, arc.center, code == "G2", (first, second))

    def _center(self, edit: LineEdit, center: Sequence[float], clockwise: bool, plane: tuple[int, int]) -> None:
        """I, J, K of the centre (set-up frame of `source`); R stays where it says the same."""
        out = self.out
        reference = out.frames.fix_reference()
        middle = [p + r for p, r in zip(self.turn.point(center), reference, strict=True)]
        there = out.frames.to_program([*middle, *out.frames.position[3:]])
        here = out.frames.to_program(out.frames.position)
        if edit.word("R") is not None:
            if self._radius_is_enough(edit, here, there, clockwise, plane):
                return
            edit.remove("R")
        for axis in plane:
            letter = arcs.CENTER_WORDS[axis]
            value = (there[axis] if out.arc_absolute else there[axis] - here[axis]) / self._scale(axis)
            if edit.word(letter) is not None or out.arc_absolute or abs(value) > OFF * 10.0**-self._decimals:
                edit.write(letter, value)
        for letter in arcs.CENTER_WORDS:
            if letter not in [arcs.CENTER_WORDS[axis] for axis in plane]:
                edit.remove(letter)

    def _radius_is_enough(
        self, edit: LineEdit, here: Sequence[float], center: Sequence[float], clockwise: bool, plane: tuple[int, int]
    ) -> bool:
        """Whether R with the rounded ends puts the centre where it belongs; near half circles it does not."""
        radius = edit.word("R")
        assert radius is not None
        end = self._end_of(edit, here)
        first, second = plane
        try:
            found = arcs.center_from_radius(
                (here[first], here[second]), (end[first], end[second]), radius.value * self._scale(first), clockwise
            )
        except arcs.ArcError:
            return False
        return math.dist(found, (center[first], center[second])) <= NEAR * self._unit

    def _end_of(self, edit: LineEdit, here: Sequence[float]) -> list[float]:
        """Program coordinates of the end that the edited axis words ask for."""
        words = read_block(edit.render(), self.source.block.line, self.source.name).words
        end = list(here)
        for word in words:
            if word.letter in AXES:
                axis = AXES.index(word.letter)
                value = word.value * self._scale(axis)
                end[axis] = value if self.out.absolute else here[axis] + value
        return end

    def _cycle(self, codes: Codes, edit: LineEdit, axes: list[str], plane: str) -> None:
        source, out = self.source, self.out
        first, second, normal = arcs.PLANES[source.plane]
        if self._matrix[normal, normal] != 1.0:
            raise self._refusal(
                f"{source.motion} drills along {AXES[normal]} of the work, which the tilt turns out of the axis",
                "write its moves with --linearise MM",
            )
        self._plane_for(edit, source.plane, plane)
        self._motion_word(codes, edit, source.motion or "")
        repeats = edit.word("L")
        target = self._target(source.segments[-1].end)
        holes = [letter for letter in axes if AXES.index(letter) != normal]
        self._go(edit, target, holes, only=[first, second], parts=int(repeats.value) if repeats else 1)
        letter_of = {"Z": AXES[normal], "R": "R"}
        for key, letter in letter_of.items():
            value = source.sticky[key]
            if source.absolute:
                place = source.frames.to_program(source.frames.position)
                place[normal] = value
                value = out.frames.to_program(self._target(source.frames.to_control(place)))[normal]
            if edit.word(letter) or abs(value - out.sticky.get(key, math.inf)) > OFF * self._unit:
                edit.write(letter, value / self._scale(normal))

    # -- execute and check ---------------------------------------------------------------------------------------------

    def _emit(self, edit: LineEdit) -> str:
        """Have `out` execute the edited line; its text."""
        text = edit.render()
        line = self.source.block.line
        try:
            block = read_block(text, line, self.source.name)
            self.out.execute(block)
        except InputError as error:
            raise self._refusal(f"as rewritten ({text.strip()!r}) would be refused: {error.found}", "more --decimals") from None
        self._know([word.letter for word in block.words] if self.source.segments else [])
        return text

    def _know(self, letters: Sequence[str]) -> None:
        for letter in letters:
            if letter in AXES:
                self.known[AXES.index(letter)] = True

    def _check(self, first: int, first_out: int) -> None:
        """Every cutting move of the block must be the placed one to within the rounding."""
        shortest = 3.0 * self._unit
        wanted = list(cutting_rows(self.source.recorder, first, shortest))
        found = list(cutting_rows(self.out.recorder, first_out, shortest))
        if len(wanted) != len(found):
            raise self._refusal(f"would make {len(found)} cutting moves, and not {len(wanted)}", "more --decimals")
        repeats = next((word.value for word in self.source.block.words if word.letter == "L"), 1.0)
        for one, other in zip(wanted, found, strict=True):
            what = difference(self.turn, one, other, self._unit * max(repeats, 1.0))
            if what:
                unknown = [AXES[axis] for axis in range(3) if not self.known[axis]]
                raise self._refusal(
                    f"cannot be rewritten: the move {what}",
                    f"position {', '.join(unknown)} in rapid before the first cutting move" if unknown else "",
                )

    def _refusal(self, found: str, hint: str = "") -> InputError:
        block = self.source.block
        return InputError(f"this block {found}", hint=hint, file=self.source.name, line=block.line)
