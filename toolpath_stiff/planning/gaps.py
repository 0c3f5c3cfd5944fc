"""Gaps: how far visits would set rivals apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.defaults import CLAMPING
from toolpath_stiff.errors import InputError
from toolpath_stiff.planning.forecasts import Forecast
from toolpath_stiff.planning.visits import Visits


@dataclass(frozen=True)
class ReadingNoise:
    """Scatter of ln readings: of each, of each clamping (relative sd), and of the machine as a factor (m, k)."""

    repeat: float
    clamping: float
    machine: FloatArray

    def shared_out(self, repeats: float) -> ReadingNoise:
        """The noise of the mean of so many re-clamped readings; the machine stays as it is."""
        return ReadingNoise(self.repeat / np.sqrt(repeats), self.clamping / np.sqrt(repeats), self.machine)


def repeat_and_clamping(relative: float | tuple[float, float]) -> tuple[float, float]:
    """Relative sd of a reading and of a clamping, from these or from that of a reading in total.

    Raises
    ------
    InputError
        A noise that cannot be.
    """
    if isinstance(relative, tuple):
        repeat, clamping = relative
    else:
        clamping = float(min(CLAMPING, relative / np.sqrt(2.0)))
        repeat = float(np.sqrt(max(relative**2 - clamping**2, 0.0)))
    if not (0.0 < repeat <= 1.0 and 0.0 <= clamping <= 1.0):
        raise InputError(f"a noise of {relative!r}", expected="more than 0 and at most 1 (100 %)")
    return repeat, clamping


@dataclass(frozen=True)
class GapShares:
    """Shares of v visits in the gap of a pair: a (v,), h (v, q), M (v, q, q)."""

    a: FloatArray
    h: FloatArray
    M: FloatArray

    def gap(self, chosen: Sequence[int] | IntArray = (), repeats: float = 1.0) -> float:
        """Gap in standard deviations after the chosen visits, each clamped and read so often."""
        index = np.asarray(chosen, dtype=np.int64)
        squared = _squared_gap(self.a[index].sum(), self.h[index].sum(axis=0), self.M[index].sum(axis=0), repeats)
        return float(np.sqrt(max(float(squared), 0.0)))

    def gaps_with(self, chosen: Sequence[int] | IntArray) -> FloatArray:
        """(v,) gaps after the chosen visits and one more, for each that it could be."""
        index = np.asarray(chosen, dtype=np.int64)
        squared = _squared_gap(
            self.a + self.a[index].sum(), self.h + self.h[index].sum(axis=0), self.M + self.M[index].sum(axis=0), 1.0
        )
        return np.asarray(np.sqrt(np.maximum(squared, 0.0)))


def _squared_gap(a: FloatArray, h: FloatArray, M: FloatArray, repeats: float) -> FloatArray:
    if h.shape[-1] == 0:
        return np.asarray(repeats * a)
    inner = np.eye(h.shape[-1]) + repeats * M
    solved = np.linalg.solve(inner, h[..., None])[..., 0]
    return np.asarray(repeats * a - repeats**2 * (h * solved).sum(axis=-1))


def _summed_products(columns: FloatArray, counts: IntArray) -> FloatArray:
    """(v, q, q) sums over each visit's rows of the products of columns (n, q); all visits with so many rows at once."""
    starts, q = np.cumsum(counts) - counts, columns.shape[1]
    products = np.empty((len(counts), q, q))
    for count in np.unique(counts).tolist():
        alike = np.flatnonzero(counts == count)
        rows = columns[starts[alike, None] + np.arange(count)]
        products[alike] = np.swapaxes(rows, 1, 2) @ rows
    return products


def pair_shares(visits: Visits, first: Forecast, second: Forecast, noise: ReadingNoise) -> GapShares:
    """Shares of the visits in the gap of two rivals."""
    difference = first.mean - second.mean
    F = np.concatenate([first.factor, second.factor, np.sqrt(2.0) * noise.machine], axis=1)
    columns = np.concatenate([difference[:, None], F], axis=1)[visits.members]
    starts, counts = visits.starts, visits.counts
    products = _summed_products(columns, counts)
    sums = np.add.reduceat(columns, starts, axis=0)
    # Inverse of 2 (r^2 1 + c^2 11^T) by Sherman and Morrison.
    common = noise.clamping**2 / (noise.repeat**2 + counts * noise.clamping**2)
    form = (products - common[:, None, None] * sums[:, :, None] * sums[:, None, :]) / (2.0 * noise.repeat**2)
    return GapShares(form[:, 0, 0], form[:, 1:, 0], form[:, 1:, 1:])
