"""The softest and the stiffest direction of the tool tip where the compliance depends on the load.

Without load-dependent effects they are eigenvectors of the compliance tensor. With gaps and contacts there is no
tensor: the compliance along a direction is the secant one under the load in that direction, and its extremes are
searched on the half sphere. Gaps give it kinks, where derivatives say nothing, so the search compares values alone.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Along = Callable[[FloatArray, NDArray[np.int64]], FloatArray]

DIRECTIONS = 60  # over half a sphere: neighbours some 15 degrees apart
CLIMBS = 3  # from so many of the best
FIRST_STEP, LAST_STEP = 0.13, 1e-4  # rad; half the distance of neighbours; the compliance is then certain to 1e-6
AROUND = 6  # directions tried about the best one at each step


def half_sphere(count: int) -> FloatArray:
    """(count, 3) unit vectors spread evenly over z >= 0: a spiral that turns by the golden angle."""
    height = (np.arange(count) + 0.5) / count
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)


def extreme_directions(
    along: Along, tensor: FloatArray, softest: bool = True, across: FloatArray | None = None
) -> FloatArray:
    """Directions in which the tip gives way most, or least.

    Parameters
    ----------
    along
        Unit vectors (k, 3) and the poses (k,) at which they are meant, to compliances (k,) m/N.
    tensor
        (n, 3, 3) m/N, the compliance without what depends on the load; its eigenvectors are tried as well.
    softest
        The softest, else the stiffest direction.
    across
        (n, 3) unit vectors; only directions across these are looked at.

    Returns
    -------
    (n, 3) unit vectors whose largest component is positive.
    """
    n, sign = len(tensor), 1.0 if softest else -1.0

    def value(directions: FloatArray) -> FloatArray:
        """(n, m) of directions (n, m, 3), to be made large."""
        rows = np.repeat(np.arange(n), directions.shape[1])
        return sign * along(directions.reshape(-1, 3), rows).reshape(n, -1)

    spread = np.broadcast_to(half_sphere(DIRECTIONS), (n, DIRECTIONS, 3))
    tried = np.concatenate([spread, np.swapaxes(np.linalg.eigh(tensor)[1], 1, 2)], axis=1)
    tried = tried if across is None else _flattened(tried, across)
    found = value(tried)
    best = np.argsort(-found, axis=1, kind="stable")[:, :CLIMBS]
    directions = np.take_along_axis(tried, best[..., None], axis=1)
    reached = np.take_along_axis(found, best, axis=1)
    step = np.full(reached.shape, FIRST_STEP)
    while (step > LAST_STEP).any():
        around = _around(directions, step)
        around = around if across is None else _flattened(around, across)
        values = value(around.reshape(n, -1, 3)).reshape(n, CLIMBS, AROUND)
        better = values.argmax(axis=-1)
        top = np.take_along_axis(values, better[..., None], axis=-1)[..., 0]
        risen = top > reached
        chosen = np.take_along_axis(around, better[..., None, None], axis=2)[..., 0, :]
        directions = np.where(risen[..., None], chosen, directions)
        reached = np.where(risen, top, reached)
        step = np.where(risen, step, 0.5 * step)
    last = reached.argmax(axis=1)
    return signed(directions[np.arange(n), last])


def _around(directions: FloatArray, step: FloatArray) -> FloatArray:
    """(n, c, AROUND, 3) unit vectors at an angle of `step` (n, c) about each direction (n, c, 3)."""
    least = np.eye(3)[np.abs(directions).argmin(axis=-1)]
    one = np.cross(directions, least)
    one /= np.linalg.norm(one, axis=-1, keepdims=True)
    two = np.cross(directions, one)
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    side = one[..., None, :] * np.cos(angle)[:, None] + two[..., None, :] * np.sin(angle)[:, None]
    turned = directions[..., None, :] * np.cos(step)[..., None, None] + side * np.sin(step)[..., None, None]
    return np.asarray(turned / np.linalg.norm(turned, axis=-1, keepdims=True))


def _flattened(directions: FloatArray, across: FloatArray) -> FloatArray:
    """Unit vectors (n, ..., 3) turned into the planes across (n, 3); one along the normal becomes any in the plane."""
    normal = across.reshape(len(across), *[1] * (directions.ndim - 2), 3)
    flat = directions - (directions * normal).sum(axis=-1, keepdims=True) * normal
    length = np.linalg.norm(flat, axis=-1, keepdims=True)
    least = np.eye(3)[np.abs(normal).argmin(axis=-1)]
    other = np.cross(normal, least)
    other /= np.linalg.norm(other, axis=-1, keepdims=True)
    return np.asarray(np.where(length > 1e-6, flat / np.maximum(length, 1e-6), other))


def signed(directions: FloatArray) -> FloatArray:
    """(n, 3) the same lines with their largest component positive."""
    largest = directions[np.arange(len(directions)), np.abs(directions).argmax(axis=1)]
    return np.asarray(directions * np.where(largest < 0.0, -1.0, 1.0)[:, None])
