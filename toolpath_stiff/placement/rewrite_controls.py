"""Two controls side by side: one executes the untouched program at the placement, one the written program.

Words are chosen so that `out`, at the original origin, arrives where the placement takes `source`. Because `out`
executes the very text that is written, roundings never add up, in G91 neither, and work offsets, G92, G52, G10 and tool
lengths need no rewriting: whatever they make of the numbers, `out` does the same. Every written block is checked.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc import arcs
from toolpath_stiff.nc.blocks import AXES, Codes
from toolpath_stiff.nc.codes import MOTION, PLANE
from toolpath_stiff.nc.interpreter import Interpreter
from toolpath_stiff.nc.words import read_block
from toolpath_stiff.placement.rewrite_trace import Tracer, cutting_rows, differences
from toolpath_stiff.placement.rewrite_turn import Turn
from toolpath_stiff.placement.rewrite_words import LineEdit
from toolpath_stiff.units import MM_PER_INCH

FloatArray = NDArray[np.float64]

DECIMALS_MM, DECIMALS_INCH = 4, 5
# Of the last decimal: an axis that its block does not name gets a word where it is off by more than rounding.
OFF = 0.75


class Controls:
    """The controls, and what is known of them.

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
        self._coarsest = 0.0  # mm, the last decimal of any block so far: inches round coarser than mm

    def _note(self, sentence: str) -> None:
        if sentence not in self.notes:
            self.notes.append(sentence)

    def _refusal(self, found: str, hint: str = "") -> InputError:
        block = self.source.block
        return InputError(found, hint=hint, file=self.source.name, line=block.line)

    # -- units and axes --------------------------------------------------------------------------------------------

    @property
    def _digits(self) -> int:
        if self.decimals is not None:
            return self.decimals
        return DECIMALS_INCH if self.out.inch else DECIMALS_MM

    @property
    def _unit(self) -> float:
        """The last decimal in mm."""
        return 10.0**-self._digits * self._scale(0)

    def _scale(self, axis: int) -> float:
        """Millimetres (or degrees) of a word's unit."""
        return MM_PER_INCH if self.out.inch and axis < 3 else 1.0

    @property
    def _matrix(self) -> FloatArray:
        """The turn in the program axes in force."""
        return self.turn.in_program(self.out.frames.turned)

    def _image(self, plane: str) -> tuple[str, float] | None:
        """The plane that a plane is turned into, and the sign of its normal; None if it is none of the three."""
        column = self._matrix[:, arcs.PLANES[plane][2]]
        for name, (_, _, normal) in arcs.PLANES.items():
            if abs(column[normal]) == 1.0:
                return name, float(column[normal])
        return None

    def _know(self, letters: Sequence[str]) -> None:
        for letter in letters:
            if letter in AXES:
                self.known[AXES.index(letter)] = True

    # -- words -----------------------------------------------------------------------------------------------------

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

    def _motion_word(self, codes: Codes, edit: LineEdit, wanted: str) -> None:
        """See to it that the block is executed in the motion mode wanted."""
        given = codes.groups.get(MOTION)
        if given is None:
            if self.out.motion != wanted:
                edit.add_code(wanted)
        elif given[0] != wanted:
            edit.replace(given[1], given[1].text[0] + wanted[1:])

    def _target(self, control: Sequence[float]) -> list[float]:
        """Control coordinates of `out` for a point of `source` in its control coordinates."""
        return self._of_setup(self.source.frames.to_setup(list(control)))

    def _of_setup(self, setup: Sequence[float]) -> list[float]:
        """Control coordinates of `out` for a point of the untouched program's set-up frame."""
        reference = self.out.frames.fix_reference()
        point = [p + r for p, r in zip(self.turn.point(setup[:3]), reference, strict=True)]
        return [*point, *self.turn.angles(setup[3:], self.out.frames.position[3:])]

    def _go(
        self, edit: LineEdit, target: list[float], axes: Sequence[str], only: Sequence[int] = range(6), parts: int = 1
    ) -> None:
        """Words of the axes `only`, so that `out` goes to a point in control coordinates, in `parts` equal steps.

        `axes` are those that the untouched block names; another one gets a word only where it has to move too.
        """
        out = self.out
        there, here = out.frames.to_program(target), out.frames.to_program(out.frames.position)
        named = [AXES.index(letter) for letter in axes if letter in "XYZ"]
        matrix = self._matrix if named and not all(self.known) else None
        for axis in only:
            letter, scale = AXES[axis], self._scale(axis)
            if letter not in axes:
                coupled = axis < 3 and matrix is not None and matrix[axis, named].any()
                off = abs(there[axis] - here[axis]) > OFF * 10.0**-self._digits * scale
                if not off or not (self.known[axis] or coupled):
                    continue
            goal = there[axis] if out.absolute else (there[axis] - here[axis]) / parts
            edit.write(letter, goal / scale)

    # -- execute and check -----------------------------------------------------------------------------------------

    def _emit(self, edit: LineEdit) -> str:
        """Have `out` execute the edited line; its text."""
        text = edit.render()
        try:
            block = read_block(text, self.source.block.line, self.source.name)
            self.out.execute(block)
        except InputError as error:
            raise self._refusal(
                f"the block, rewritten as {text.strip()!r}, would be refused: {error.found}", "give more --decimals"
            ) from None
        if self.source.segments:
            self._know([word.letter for word in block.words])
        return text

    def _check(self, first: int, first_out: int, pieces: bool) -> None:
        """Every cutting move of the block must be the placed one to within the rounding; of `pieces` the two ends."""
        self._coarsest = unit = max(self._coarsest, self._unit)
        wanted = cutting_rows(self.source.recorder, first)
        found = cutting_rows(self.out.recorder, first_out)
        if pieces and wanted and found:
            wanted = [wanted[0]._replace(end=wanted[-1].end, arc=None)]
            found = [found[0]._replace(end=found[-1].end)]
        # The steps of a cycle with L in G91 repeat one rounding.
        repeats = next((word.value for word in self.source.block.words if word.letter == "L"), 1.0)
        what = differences(self.turn, wanted, found, unit * max(repeats, 1.0))
        if what:
            raise self._refusal(f"the block cannot be rewritten: its cutting move {what}", self._remedy(what))

    def _remedy(self, what: str) -> str:
        unknown = ", ".join(AXES[axis] for axis in range(3) if not self.known[axis])
        if unknown:
            return f"position {unknown} in rapid before the first cutting move"
        if what.startswith(("starts", "leans")):
            return "position X, Y, Z and the rotary axes in rapid before it"
        return "" if what.startswith("ends") else "give more --decimals"
