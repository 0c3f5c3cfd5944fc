"""The sampled path: one row a sample, SI units."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Samples:
    """Columns over n samples along the true path, in machine coordinates.

    Every move has samples at both of its ends, so a corner appears twice: once as the end of a move, with
    that move's tangent, and once as the start of the next, with the next one's. This is the rule for the
    tangent at corners.

    Attributes
    ----------
    move
        (n,) row of the move in `Moves`.
    line, motion, tool
        (n,) as in `Moves`.
    tool_length
        (n,) m; nan: the machine's reference tool.
    s
        (n,) m, length of tip path from the program's start, rapids included.
    t
        (n,) s, time from the program's start, dwells included.
    position
        (n, 3) m, tool tip.
    abc
        (n, 3) rad, roll, pitch, yaw of the platform.
    tangent
        (n, 3) unit vector of the tip's motion; 0 where only rotary axes move.
    weight
        (n,) m, the length of cutting path that the sample stands for (trapezoidal rule within its move);
        0 for rapids and for moves of the rotary axes alone.
    feed
        (n,) m/s; nan for rapids.
    """

    move: IntArray
    line: IntArray
    motion: IntArray
    tool: IntArray
    tool_length: FloatArray
    s: FloatArray
    t: FloatArray
    position: FloatArray
    abc: FloatArray
    tangent: FloatArray
    weight: FloatArray
    feed: FloatArray

    def __len__(self) -> int:
        return len(self.line)

    @property
    def cutting(self) -> BoolArray:
        """(n,) samples that count in the statistics: not of a rapid."""
        return np.asarray(self.motion != 0)

    def take(self, index: IntArray | BoolArray | slice) -> Samples:
        """The samples at `index` (integers, a mask or a slice)."""
        return Samples(**{f.name: getattr(self, f.name)[index] for f in fields(self)})
