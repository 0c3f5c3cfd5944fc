"""Joint values and their limits: turns of rotary joints, and distance from the limits."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray

TURN = 2.0 * np.pi


def wound(values: FloatArray, limits: FloatArray, linear: Sequence[bool], start: FloatArray | None) -> FloatArray:
    """Values (j, n) with whole turns added to rotary joints, to lie within limits (j, 2) where possible.

    Without a start each is as near to the middle of its limits as it can be. With a start (j,) the poses are a path:
    a joint goes on from pose to pose by less than half a turn, and the whole path lies within the limits if it can;
    else it turns back where it must.
    """
    wound = values.copy()
    for i, (low, high) in enumerate(limits):
        if linear[i]:
            continue
        if start is None:
            middle = 0.5 * (low + high) if np.isfinite(high - low) else 0.0
            wound[i] += TURN * np.round((middle - values[i]) / TURN)
            continue
        finite = np.flatnonzero(np.isfinite(values[i]))
        if len(finite):
            path = np.concatenate([start[i : i + 1], values[i, finite]])
            path = path[1:] - TURN * np.cumsum(np.round(np.diff(path) / TURN))
            fewest, most = np.ceil((low - path.min()) / TURN), np.floor((high - path.max()) / TURN)
            turns = np.clip(0.0, fewest, most) if fewest <= most else _turns_back(path, low, high)
            wound[i, finite] = path + TURN * turns
    return wound


def _turns_back(path: FloatArray, low: float, high: float) -> FloatArray:
    """(n,) whole turns that keep a path (n,) within limits where possible; they change where the previous ones fail."""
    least, most = np.ceil((low - path) / TURN), np.floor((high - path) / TURN)
    turns, start, kept = np.zeros(len(path)), 0, 0.0
    while (beyond := (least <= most) & ((kept < least) | (kept > most)))[start:].any():
        start += int(beyond[start:].argmax())
        kept = float(np.clip(np.round((0.5 * (low + high) - path[start]) / TURN), least[start], most[start]))
        turns[start:] = kept
    return turns


def joint_margin(values: FloatArray, limits: FloatArray) -> FloatArray:
    """(n,) distance of values (j, n) from the nearest limit as a share of its span; -inf without values."""
    low, high = limits[:, :1], limits[:, 1:]
    span = np.where(np.isfinite(high - low), high - low, 1.0)
    margin = np.minimum(values - low, high - values) / span
    return np.where(np.isnan(values).any(axis=0), -np.inf, margin.min(axis=0))
