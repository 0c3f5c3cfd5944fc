"""Covariances between readings by their columns, and the few features that stand for one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray

LEFT = 1e-10  # share of a covariance's variance that its features may leave


@dataclass(frozen=True)
class Kernel:
    """A covariance between n readings by its columns: `column(i)` (n,), and its `diagonal` (n,)."""

    column: Callable[[int], FloatArray]
    diagonal: FloatArray

    def __mul__(self, other: Kernel) -> Kernel:
        """Element by element, which is a covariance again (Schur's product theorem)."""
        return Kernel(lambda i: self.column(i) * other.column(i), self.diagonal * other.diagonal)

    @property
    def varies(self) -> bool:
        """Whether it is finite, and more than one number throughout."""
        first, scale = self.column(0), float(self.diagonal.mean())
        finite = np.isfinite(first).all() and np.isfinite(self.diagonal).all()
        off = max(np.abs(first - self.diagonal[0]).max(), np.abs(self.diagonal - self.diagonal[0]).max())
        return bool(finite and scale > 1e-12 and off > 1e-9 * scale)

    def features(self, most: int) -> FloatArray:
        """(n, r) L with L L^T the covariance, scaled to a mean diagonal of 1.

        By Cholesky's factorisation with complete pivoting: features of the readings that are known least come first
        (Higham 2002, Accuracy and Stability of Numerical Algorithms, 10.3).
        """
        scale = float(self.diagonal.mean())
        left = self.diagonal / scale
        rows = np.empty((min(most, len(left)), len(left)))
        for r in range(len(rows)):
            pivot = int(np.argmax(left))
            if left.sum() <= LEFT * len(left) or left[pivot] <= 0.0:
                return rows[:r].T
            column = self.column(pivot) / scale - rows[:r, pivot] @ rows[:r]
            rows[r] = column / np.sqrt(left[pivot])
            left = np.maximum(left - rows[r] ** 2, 0.0)
            left[pivot] = 0.0
        return rows.T


def gaussian_kernel(x: FloatArray) -> Kernel:
    """Smooth in x (n, k), whose range is 1."""
    return Kernel(lambda i: np.exp(-0.5 * ((x - x[i]) ** 2).sum(axis=1)), np.ones(len(x)))


def linear_kernel(x: FloatArray, power: int = 1) -> Kernel:
    """Linear in x (n, k), or a power of that."""
    return Kernel(lambda i: (x @ x[i]) ** power, (x**2).sum(axis=1) ** power)


def same_kernel(labels: NDArray[Any]) -> Kernel:
    """Alike for readings with the same label (n,)."""
    return Kernel(lambda i: (labels == labels[i]).astype(float), np.ones(len(labels)))
