"""Cubic splines through a few knots: twice continuously differentiable, and a single cubic over each two end pieces.

de Boor 1978, A Practical Guide to Splines, chapter IV ("not-a-knot"). With three knots that is a parabola, with two a
line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray


@dataclass(frozen=True)
class Spline:
    """Values (g, n) and slopes (g, n) at knots (g,) in rising order."""

    knots: FloatArray
    values: FloatArray
    slopes: FloatArray

    @classmethod
    def through(cls, knots: FloatArray, values: FloatArray) -> Spline:
        """The spline through values (g, n) at knots (g,), at least two."""
        return cls(knots, values, _slopes(knots, values))

    def __call__(self, positions: FloatArray) -> FloatArray:
        """(..., n) at positions (...,); beyond the ends the last pieces go on."""
        piece = np.clip(np.searchsorted(self.knots, positions, side="right") - 1, 0, len(self.knots) - 2)
        step = (self.knots[piece + 1] - self.knots[piece])[..., None]
        share = (positions - self.knots[piece])[..., None] / step
        rest = 1.0 - share
        start, end = self.values[piece], self.values[piece + 1]
        bend = rest * (self.slopes[piece] * step - (end - start)) - share * (
            self.slopes[piece + 1] * step - end + start
        )
        return np.asarray(start + share * ((end - start) + rest * bend))


def _slopes(knots: FloatArray, values: FloatArray) -> FloatArray:
    """(g, n) slopes that make second derivatives agree, and third ones next to the ends."""
    step = np.diff(knots)
    rise = np.diff(values, axis=0) / step[:, None]
    count = len(knots)
    if count == 2:
        return np.repeat(rise, 2, axis=0)
    if count == 3:
        middle = (step[1] * rise[0] + step[0] * rise[1]) / (step[0] + step[1])
        return np.stack([2.0 * rise[0] - middle, middle, 2.0 * rise[1] - middle])
    system, right = np.zeros((count, count)), np.zeros((count, values.shape[1]))
    inner = np.arange(1, count - 1)
    system[inner, inner - 1] = step[1:]
    system[inner, inner] = 2.0 * (step[:-1] + step[1:])
    system[inner, inner + 1] = step[:-1]
    right[1:-1] = 3.0 * (step[1:, None] * rise[:-1] + step[:-1, None] * rise[1:])
    for end, near, (first, second) in ((0, 1, (0, 1)), (-1, -2, (-1, -2))):
        both = step[first] + step[second]
        system[end, end], system[end, near] = step[second], both
        right[end] = ((step[first] + 2.0 * both) * step[second] * rise[first] + step[first] ** 2 * rise[second]) / both
    return np.asarray(np.linalg.solve(system, right))
