"""Types of arrays, each once. They say the kind of number; the shapes stand in the docstrings."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
TextArray = NDArray[np.str_]
AnyArray = NDArray[Any]


def product(left: FloatArray, right: FloatArray) -> FloatArray:
    """(..., m, n) matrix product of (..., m, j) and (..., j, n), the same to the last bit on every processor.

    BLAS adds in another order on another one, and a search amplifies the last bit. For a small j it costs little.
    """
    total = left[..., :, 0, None] * right[..., None, 0, :]
    for i in range(1, left.shape[-1]):
        total += left[..., :, i, None] * right[..., None, i, :]
    return np.asarray(total)
