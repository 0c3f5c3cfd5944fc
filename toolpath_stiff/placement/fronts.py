"""Fronts of placements: what nothing beats in mean, range and weakest place, thinned; the best ones apart."""

from __future__ import annotations

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.placement.evaluator import PlacementFigures
from toolpath_stiff.placement.goals import Bounds


def front_rows(figures: PlacementFigures, kept: BoolArray) -> IntArray:
    """Rows of those kept that no other beats in all of mean, range and weakest, by rising mean; equals stand once."""
    rows = np.flatnonzero(kept & np.isfinite(figures.mean))
    values, first = np.unique(figures.objectives[rows], axis=0, return_index=True)
    rows = rows[first]
    no_worse = np.asarray((values[:, None] >= values[None]).all(axis=2))  # [i, j]: i is at least as good as j in all
    no_worse[np.diag_indices(len(rows))] = False
    return np.asarray(rows[~no_worse.any(axis=0)], dtype=np.int64)


def thin(objectives: FloatArray, rows: IntArray, points: int, best: int = -1) -> IntArray:
    """At most `points` of rows (n,) with objectives (n, 3), spread over the front by farthest-point choice.

    Its ends and the row `best` come first.
    """
    if len(rows) <= points:
        return rows
    scaled = (objectives - objectives.min(axis=0)) / np.maximum(np.ptp(objectives, axis=0), 1e-12)
    chosen = list(dict.fromkeys([*np.flatnonzero(rows == best), *scaled.argmax(axis=0)]))[:points]
    distance = np.min([((scaled - scaled[i]) ** 2).sum(axis=1) for i in chosen], axis=0)
    while len(chosen) < points:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, ((scaled - scaled[chosen[-1]]) ** 2).sum(axis=1))
    return np.asarray(rows[np.sort(np.array(chosen))])


def apart(bounds: Bounds, placements: FloatArray, count: int, distance: float = 0.1) -> list[int]:
    """Rows of ranked placements: the first, and the best of the others that are not beside one chosen.

    `distance` in shares of the ranges.
    """
    unit, whole_turn = bounds.unit(placements), bounds.round[bounds.free]
    chosen: list[int] = []
    for i in range(len(unit)):
        away = np.abs(unit[chosen] - unit[i])
        away = np.where(whole_turn, np.minimum(away, 1.0 - away), away)
        if (away.max(axis=1, initial=0.0) > distance).all():
            chosen.append(i)
        if len(chosen) == count:
            break
    return chosen
