"""Grids of cells: portions of work that fit the cache, and the cells of boxes."""

from collections.abc import Iterator

import numpy as np

from toolpath_stiff.arrays import IntArray

PORTION = 20_000  # entries at a time


def portions(counts: IntArray) -> Iterator[slice]:
    """Slices of rows with so many entries each: at least a row, and no more entries than a portion."""
    ends = np.cumsum(counts)
    first, before = 0, 0
    while first < len(ends):
        end = max(int(np.searchsorted(ends, before + PORTION, side="right")), first + 1)
        yield slice(first, end)
        first, before = end, int(ends[end - 1])


def cells_of_boxes(low: IntArray, high: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
    """(k,) box and (k, 2) cell, in portions, of boxes from `low` to `high` (n, 2), both inside."""
    wide = high - low + 1
    counts = wide.prod(axis=1)
    for rows in portions(counts):
        some = counts[rows]
        box = np.repeat(np.arange(rows.start, rows.stop), some)
        index = np.arange(len(box)) - np.repeat(np.cumsum(some) - some, some)
        yield box, low[box] + np.stack([index // wide[box, 1], index % wide[box, 1]], axis=1)
