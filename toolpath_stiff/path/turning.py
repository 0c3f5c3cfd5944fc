"""The free turn about the tool's axis along a path: what a cut leaves open and a robot needs.

Candidates are turns times configurations of the joints at every pose; the least costly way through them is found by
dynamic programming over the poses (Viterbi, IEEE Transactions on Information Theory 13, 1967). Arrays in, arrays out.
"""

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray, product
from toolpath_stiff.rotations import rotation_about_z

WHOLE = 2.0 * np.pi


def turned_about_tool(rotation: FloatArray, turn: FloatArray) -> FloatArray:
    """(..., 3, 3) tool frames: `rotation` (..., 3, 3) turned about its own z by angles (...) rad."""
    return np.asarray(product(rotation, rotation_about_z(turn)))


def feed_turns(rotation: FloatArray, tangent: FloatArray) -> FloatArray:
    """(n,) rad about the tool's axis that lay its x along the feed (n, 3), without jumps of a whole turn.

    Where nothing moves, or along the axis alone, the turn stays as it was.
    """
    local = np.einsum("nij,ni->nj", rotation, tangent)
    moving = np.flatnonzero(np.hypot(local[:, 0], local[:, 1]) > 1e-6)
    if not len(moving):
        return np.zeros(len(tangent))
    turns = np.unwrap(np.arctan2(local[moving, 1], local[moving, 0]))
    return np.asarray(turns[np.clip(np.searchsorted(moving, np.arange(len(tangent)), side="right") - 1, 0, None)])


def unwound(joints: FloatArray, winds: BoolArray) -> FloatArray:
    """(n, ..., j) joint values of poses; whole turns added where `winds` (j,), so that each step is the shorter one."""
    step = np.diff(joints, axis=0)
    step = step - winds * WHOLE * np.round(step / WHOLE)
    return np.concatenate([joints[:1], joints[:1] + np.cumsum(step, axis=0)])


def room_to_wind(path: FloatArray, limits: FloatArray, winds: BoolArray) -> BoolArray:
    """(...) True where unwound values (n, ..., j), or all of them a whole turn or more away, keep to limits (j, 2)."""
    low, high = limits[:, 0] - path.min(axis=0), limits[:, 1] - path.max(axis=0)
    with np.errstate(invalid="ignore"):
        fits = np.where(winds, np.ceil(low / WHOLE) <= np.floor(high / WHOLE), (low <= 0.0) & (high >= 0.0))
    return np.asarray(fits.all(axis=-1))


def constant_costs(
    joints: FloatArray, cost: FloatArray, limits: FloatArray, winds: BoolArray, largest: float
) -> FloatArray:
    """(c, t) mean costs of configurations and turns held at all poses; inf where a pose or a step rules one out.

    Arguments as of `least_costly_way`, and the limits (j, 2) of the joints; poses that nobody reaches do not count.
    """
    some = np.isfinite(cost).any(axis=(1, 2))
    if not some.any():
        return np.full(cost.shape[1:], np.inf)
    path = unwound(joints[some], winds)
    steps = np.abs(np.diff(path, axis=0)).max(axis=(0, -1), initial=0.0)
    kept = cost[some].mean(axis=0)
    return np.where((steps <= largest) & room_to_wind(path, limits, winds), kept, np.inf)


def least_costly_way(
    joints: FloatArray, cost: FloatArray, winds: BoolArray, largest: float, weight: float, window: int
) -> tuple[IntArray, IntArray]:
    """Configuration and turn at every pose that minimise the sum of costs and weighted squared steps.

    Parameters
    ----------
    joints
        (n, c, t, j) m and rad, of c configurations and t turns round the circle.
    cost
        (n, c, t) of each; inf where it is out of reach. Poses that no candidate reaches are passed over.
    winds
        (j,) joints that have more than a whole turn: their values count but for whole turns.
    largest
        m or rad, most that a joint may move between two poses.
    weight
        Of squared steps, in units of the cost.
    window
        Most turns by which a pose may differ from the one before.

    Returns
    -------
    (n,) configurations and (n,) turns, as numbers. Where the way is broken a change is dearer than all else.
    """
    n, configurations, turns, count = joints.shape
    near = (np.arange(turns)[:, None] + np.arange(-window, window + 1)) % turns
    finite = cost[np.isfinite(cost)]
    change = 1.0 + 2.0 * n * (np.ptp(finite) if len(finite) else 0.0) + weight * n * count * WHOLE**2
    total, came = cost[0].copy(), np.zeros((n, configurations, turns), dtype=np.int64)
    last = joints[0]
    same = np.arange(configurations * turns).reshape(configurations, turns)
    for i in range(1, n):
        if not np.isfinite(cost[i]).any():
            came[i] = same  # out of reach: passed over, as if it were not on the path
            continue
        step = joints[i][:, :, None] - last[:, near]
        step -= winds * WHOLE * np.round(step / WHOLE)
        ways = total[:, near] + weight * (step**2).sum(axis=-1)
        ways[~(np.abs(step) <= largest).all(axis=-1)] = np.inf
        best = ways.argmin(axis=-1)
        least = np.take_along_axis(ways, best[..., None], axis=-1)[..., 0]
        came[i] = same[:, 0][:, None] + near[np.arange(turns), best]
        if np.isfinite(total).any():  # otherwise this is the first pose within reach
            broken = total.min() + change < least
            least, came[i][broken] = np.minimum(least, total.min() + change), int(total.argmin())
        else:
            least = np.zeros_like(cost[i])
        total, last = least + cost[i], joints[i]
    way = np.empty(n, dtype=np.int64)
    way[-1] = int(total.argmin())
    for i in range(n - 1, 0, -1):
        way[i - 1] = came[i].flat[way[i]]
    return way // turns, way % turns
