"""The cells of boxes in a grid."""

from collections.abc import Iterator

import numpy as np

from toolpath_stiff.arrays import IntArray, numbered, portions

PORTION = 20_000  # entries at a time: the arrays stay in the processor's cache


def cells_of_boxes(low: IntArray, high: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
    """(k,) box and (k, 2) cell, in portions, of boxes from `low` to `high` (n, 2), both inside."""
    wide = high - low + 1
    counts = wide.prod(axis=1)
    for rows in portions(counts, PORTION):
        box, index = numbered(counts[rows])
        box += rows.start
        yield box, low[box] + np.stack([index // wide[box, 1], index % wide[box, 1]], axis=1)
