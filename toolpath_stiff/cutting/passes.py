"""Walls made by several passes: at each height the deepest pass determines the wall that remains.

The second level of a pocket passes the wall of the first along all of its height. Where the first left material, the
second takes it off as far as it stands aside itself; where the first cut too deep, nothing puts it back. So the error
of a wall is the least of those of all passes that come as close to the part; the last one owns it.
"""

from collections.abc import Mapping

import numpy as np

from toolpath_stiff.arrays import AnyArray, FloatArray, IntArray
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.surface_error import HEIGHTS, shares
from toolpath_stiff.cutting.tip import walls_beside
from toolpath_stiff.path.sampling import Samples

BLOCK = 16_384  # walls at a time
MOST_PASSES = 8  # nearest places of earlier passes that are checked for each of the last
ALIKE = 10.0  # steps along the wall that count as much as a radian of its normal
SAME = 1e-7  # m, ranges of height closer than this are one


def walls_of_all_passes(
    samples: Samples,
    tilt: IntArray,
    cutters: Mapping[int, Cutter],
    made: FloatArray,
    own: FloatArray,
    profiles: AnyArray,
    step: float,
) -> None:
    """Convert, in place, profiles that each pass makes into those of the walls that remain; nan: no wall.

    Parameters
    ----------
    samples, tilt, cutters, step
        In the frames of their tilts (n,), at most `step` (m) apart.
    made, own
        (n, 2, 2) m above the tip: walls that a pass makes, even if a later one comes as close; those that it owns.
    profiles
        (n, 2, HEIGHTS) m, errors of what each pass makes, from its lower to its upper end.
    """
    owners, walls = np.nonzero(np.isfinite(own).all(axis=2))
    shared = np.isfinite(made).all(axis=2) & ~(np.abs(made - own).max(axis=2) <= SAME)
    rows, sides = np.nonzero(shared)
    apart = 2.0 * max(cutter.radius for cutter in cutters.values())

    def places(rows: IntArray, sides: IntArray) -> FloatArray:
        parts = [np.empty((0, 5))]
        for begin in range(0, len(rows), BLOCK):
            some, side = rows[begin : begin + BLOCK], sides[begin : begin + BLOCK]
            foot, into = (of[:, :2] for of in walls_beside(samples, cutters, some, side))
            # Walls with another normal count as far away, those of another tilt as farther.
            parts.append(np.column_stack([foot, ALIKE * step * into, tilt[some]]))
        return np.concatenate(parts)

    tree = None
    if len(rows) and len(owners):
        from scipy.spatial import cKDTree

        tree = cKDTree(places(rows, sides))
    # From the last backward: for earlier passes the wall they made counts, not the part of it that remains.
    for begin in range((len(owners) - 1) // BLOCK * BLOCK, -1, -BLOCK):
        last, wall = owners[begin : begin + BLOCK], walls[begin : begin + BLOCK]
        low, high = own[last, wall, :, None].swapaxes(0, 1)
        heights = low + (high - low) * shares()[0]
        left = profile_at(profiles[last, wall], made[last, wall], heights)
        near: IntArray = np.zeros((len(last), 0), dtype=np.int64)
        if tree is not None:
            near = np.asarray(tree.query(places(last, wall), MOST_PASSES, distance_upper_bound=step)[1])
        for column in near.T:
            known = np.flatnonzero(column < len(rows))
            known = known[samples.s[last[known]] - samples.s[rows[column[known]]] > apart]
            earlier, side = rows[column[known]], sides[column[known]]
            climb = samples.position[last[known], 2] - samples.position[earlier, 2]
            other = profile_at(profiles[earlier, side], made[earlier, side], heights[known] + climb[:, None])
            left[known] = np.fmin(left[known], other)
        profiles[last, wall] = left
    profiles[~np.isfinite(own).all(axis=2)] = np.nan


def profile_at(profiles: AnyArray, ranges: FloatArray, heights: FloatArray) -> FloatArray:
    """(m, h) errors at heights (m, h), from profiles (m, HEIGHTS) over ranges (m, 2); nan outside these."""
    nodes, low, span = shares()[0], ranges[:, :1], np.maximum(ranges[:, 1:] - ranges[:, :1], SAME)
    share = (heights - low) / span
    place = np.clip(np.searchsorted(nodes, share) - 1, 0, HEIGHTS - 2)
    part = (share - nodes[place]) / (nodes[place + 1] - nodes[place])
    first, second = (np.take_along_axis(profiles, at, axis=1) for at in (place, place + 1))
    within = np.abs(heights - low - 0.5 * span) <= 0.5 * span + SAME
    return np.where(within, first + np.clip(part, 0.0, 1.0) * (second - first), np.nan)
