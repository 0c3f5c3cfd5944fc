"""Cells of boxes in a grid."""

from collections.abc import Iterator

from toolpath_stiff.arrays import IntArray, numbered, portions

PORTION = 20_000  # entries at a time: the arrays stay in the processor's cache


def cells_of_boxes(low: IntArray, high: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Cells of boxes from `low` to `high` (n, d), both included, in portions: (k,) box and (k, d) cell."""
    wide = high - low + 1
    counts = wide.prod(axis=1)
    for rows in portions(counts, PORTION):
        box, index = numbered(counts[rows])
        box += rows.start
        cell = low[box]
        for axis in range(low.shape[1] - 1, -1, -1):
            cell[:, axis] += index % wide[box, axis]
            index //= wide[box, axis]
        yield box, cell
