"""Array types, each defined once by its kind of number; shapes are given in the docstrings."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.signedinteger[Any]]  # of any width
BoolArray = NDArray[np.bool_]
TextArray = NDArray[np.str_]
AnyArray = NDArray[Any]


def product(left: FloatArray, right: FloatArray) -> FloatArray:
    """(..., m, n) matrix product of (..., m, j) and (..., j, n), identical to the last bit on every processor.

    BLAS adds in another order on another one, and a search amplifies the last bit. For a small j it costs little.
    """
    total = left[..., :, 0, None] * right[..., None, 0, :]
    for i in range(1, left.shape[-1]):
        total += left[..., :, i, None] * right[..., None, i, :]
    return np.asarray(total)


def norms(vectors: FloatArray) -> FloatArray:
    """(n,) lengths of vectors (n, 3), equal to those of numpy's norm to the last bit and five times as fast."""
    x, y, z = vectors.T
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def numbered(counts: IntArray) -> tuple[IntArray, IntArray]:
    """(k,) row numbers, each repeated as often as its count says, and (k,) positions 0, 1 ... within each row."""
    row = np.repeat(np.arange(len(counts)), counts)
    return row, np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)


def portions(counts: IntArray, most: int) -> Iterator[slice]:
    """Slices of rows whose `counts` add up to at most `most`; each slice has at least one row."""
    ends = np.cumsum(counts)
    first, before = 0, 0
    while first < len(ends):
        end = max(int(np.searchsorted(ends, before + most, side="right")), first + 1)
        yield slice(first, end)
        first, before = end, int(ends[end - 1])


@dataclass(frozen=True)
class ArrayColumns:
    """Columns of arrays with one row for each thing described; a field that is not an array holds for all rows."""

    def take(self, rows: IntArray | BoolArray | slice) -> Self:
        """The chosen rows of every column."""
        return replace(self, **{name: values[rows] for name, values in self._arrays().items()})

    def _arrays(self) -> dict[str, AnyArray]:
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: values for name, values in columns.items() if isinstance(values, np.ndarray)}

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Rows of all parts, one part after the other."""
        names = parts[0]._arrays()
        return replace(parts[0], **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})
