"""Compliant bodies of a chain: a spring in one of its frames, or a beam between two of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.chain import FixedFrame, Frame, applied, rows_of
from toolpath_stiff.machine.elements import Element, Spring, beam_axes, beam_compliance


@dataclass(frozen=True)
class Body:
    """A spring fixed in a frame.

    Attributes
    ----------
    element
        Its name and place in the load path.
    frame
        Number of its frame, 0 the base, the last one the tool's tip or the work.
    place
        In that frame.
    compliance
        (6,) m/N, rad/(N m).
    """

    element: Element
    frame: int
    place: FixedFrame
    compliance: FloatArray

    @property
    def carrier(self) -> int:
        """Number of the first frame that it carries."""
        return self.frame

    def spring(self, frames: Sequence[Frame]) -> Spring:
        """The spring at n poses, from the frames of its side."""
        frame = frames[self.frame]
        return Spring(frame.point(self.place.origin), frame.turn(self.place.axes), self.compliance)


@dataclass(frozen=True)
class SpanningBeam:
    """A beam between points of two frames, whose length changes with the joints between them.

    `start` and `end` are (3,) m in frames number `frames`; `near_z` is a direction (3,) in the first of them;
    `stiffness` as `beam_compliance` takes it.
    """

    element: Element
    frames: tuple[int, int]
    start: FloatArray
    end: FloatArray
    near_z: FloatArray
    stiffness: Sequence[float]

    @property
    def carrier(self) -> int:
        """Number of the first frame that it carries."""
        return max(self.frames)

    def spring(self, frames: Sequence[Frame]) -> Spring:
        """The beam as a spring at its middle, at n poses."""
        first, second = (frames[i] for i in self.frames)
        start, end = np.atleast_2d(first.point(self.start)), np.atleast_2d(second.point(self.end))
        along = end - start
        axes = beam_axes(along, rows_of(applied(first.axes, self.near_z)))
        return Spring(start + 0.5 * along, axes, beam_compliance(np.linalg.norm(along, axis=1), self.stiffness))
