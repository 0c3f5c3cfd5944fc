"""The finished part as quadrangles with the error on each: for pictures, the page and a file to take away."""

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.cutting.cut import Cut

Quads = tuple[FloatArray, FloatArray, IntArray]


def surface_of(cut: Cut) -> Quads:
    """Walls and floors of the finished part in the set-up frame.

    Returns
    -------
    quads, error, sample
        (m, 4, 3) m; (m,) m, nan where nothing was cut; (m,) the sample that made it, -1: the stock's own surface.
    """
    parts = [_walls(cut, side) for side in (0, 1)]
    quads, error, sample = (np.concatenate(column) for column in zip(*parts, strict=True))
    return quads, error, sample


def _walls(cut: Cut, side: int) -> Quads:
    """A strip between each two samples of a move that leave the wall of a side."""
    samples = cut.samples
    made = np.isfinite(cut.errors[:, side]) & (samples.weight > 0.0)
    rows = np.flatnonzero(made[:-1] & made[1:] & (samples.move[:-1] == samples.move[1:]))
    radius = np.zeros(len(samples))
    for number, cutter in cut.cutters.items():
        radius[samples.tool == number] = cutter.radius
    outward = (1.0, -1.0)[side] * radius
    ends = []
    for row in (rows, rows + 1):
        along = samples.tangent[row, :2] / np.linalg.norm(samples.tangent[row, :2], axis=1)[:, None]
        beside = outward[row, None] * np.stack([-along[:, 1], along[:, 0], np.zeros(len(row))], axis=1)
        foot = samples.position[row] + beside
        ends.append([foot + cut.wall_heights[row, side, end, None] * np.array([0.0, 0.0, 1.0]) for end in (0, 1)])
    (low, high), (next_low, next_high) = ends
    quads = np.stack([low, next_low, next_high, high], axis=1)
    return quads, 0.5 * (cut.errors[rows, side] + cut.errors[rows + 1, side]), rows
