"""The finished part as quadrangles with their error: for pictures, the page and a file to take away."""

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray, IntArray, product
from toolpath_stiff.cutting.cut import Cut
from toolpath_stiff.cutting.final_surface import finished_surface
from toolpath_stiff.cutting.tip import axes_at, walls_beside
from toolpath_stiff.rotations import rotation_matrices

Quads = tuple[FloatArray, FloatArray, IntArray]
STEEP = 2.0  # rise over width of a cell beyond which it is a wall, drawn by its own quadrangles


def surface_of(cut: Cut, most: int) -> Quads:
    """Walls and floors of the finished part in the set-up frame, not many more than `most` quadrangles of each.

    Returns
    -------
    quads, error, sample
        (m, 4, 3) m; (m,) m, nan where nothing was cut; (m,) the sample that made it, -1: the stock's own surface.
    """
    parts = [_walls(cut, 0, most), _walls(cut, 1, most), _floors(cut, most)]
    quads, error, sample = (np.concatenate(column) for column in zip(*parts, strict=True))
    return quads, error, sample


def in_machine(points: FloatArray, origin: ArrayLike) -> FloatArray:
    """(k, 3) m in machine coordinates, from points of the set-up frame whose zero is at `origin` (m, rad)."""
    zero = np.asarray(origin, dtype=float)
    return np.asarray(product(points, rotation_matrices(zero[3:]).T) + zero[:3])


def error_limit(cut: Cut) -> float:
    """End of a colour scale, m: limit that 99 % of the walls keep, or of the floors if that is larger."""
    known = [np.abs(error[np.isfinite(error)]) for error in (cut.wall_mean, cut.errors[:, 2])]
    return max([1e-9, *(float(np.quantile(size, 0.99)) for size in known if len(size))])


def _walls(cut: Cut, side: int, most: int) -> Quads:
    """Strips between samples of a move that leave a side's wall; of several at a place, the largest error."""
    samples = cut.samples
    made = np.isfinite(cut.errors[:, side]) & (samples.weight > 0.0)
    rows = np.flatnonzero(made[:-1] & made[1:] & (samples.move[:-1] == samples.move[1:]))
    if not len(rows):
        return np.empty((0, 4, 3)), np.empty(0), rows
    many = -(-len(rows) // most)
    starts = (np.diff(rows, prepend=-2) != 1) | (np.diff(samples.move[rows], prepend=-1) != 0)
    starts |= np.arange(len(rows)) % many == 0
    first = np.flatnonzero(starts)
    last = np.append(first[1:], len(rows)) - 1
    error = 0.5 * (cut.errors[rows, side] + cut.errors[rows + 1, side])
    low, high = np.minimum.reduceat(error, first), np.maximum.reduceat(error, first)
    error = np.where(-low > high, low, high)
    ends = [_foot_and_top(cut, side, row) for row in (rows[first], rows[last] + 1)]
    (low_point, high_point), (next_low, next_high) = ends
    return np.stack([low_point, next_low, next_high, high_point], axis=1), error, rows[first]


def _foot_and_top(cut: Cut, side: int, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """(k, 3) m each, lowest and highest point of the wall beside some samples."""
    foot, _ = walls_beside(cut.samples, cut.cutters, rows, np.full(len(rows), side))
    up, heights = axes_at(cut.samples.take(rows))[:, :, 2], cut.wall_heights[rows, side]
    return foot + heights[:, :1] * up, foot + heights[:, 1:] * up


def _floors(cut: Cut, most: int) -> Quads:
    """Cells of the surface, seen from above, that are not walls."""
    size = cut.work.stock.cell * cut.work.stock.top.shape
    x, y, top, owner = finished_surface(cut.work, cut.samples, float(np.sqrt(size.prod() / most)))
    corners = [(slice(None, -1), slice(None, -1)), (slice(1, None), slice(None, -1)), (slice(1, None), slice(1, None))]
    corners.append((slice(None, -1), slice(1, None)))
    height = np.stack([top[corner] for corner in corners], axis=-1)
    known = np.asarray(np.isfinite(height).all(axis=-1))
    i, j = np.nonzero(known & (np.ptp(np.where(known[..., None], height, 0.0), axis=-1) <= STEEP * (x[1] - x[0])))
    places = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
    quads = np.stack([np.stack([x[a], y[b], top[a, b]], axis=1) for a, b in places], axis=1)
    sample = owner[i, j]
    return quads, np.where(sample < 0, np.nan, cut.errors[np.maximum(sample, 0), 2]), sample
