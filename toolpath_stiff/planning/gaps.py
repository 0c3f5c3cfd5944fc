"""Value of visits for telling rivals apart: gap between two rivals, expected outcome among all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.defaults import CLAMPING
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.judgement import NAMED
from toolpath_stiff.planning.forecasts import Forecast
from toolpath_stiff.planning.visits import Visits

DRAWS = 400  # simulated results a rival


@dataclass(frozen=True)
class ReadingNoise:
    """Scatter of ln readings: relative sd of a reading and of a clamping, and the machine's as a factor (m, k)."""

    repeat: float
    clamping: float
    machine: FloatArray

    def shared_out(self, repeats: float) -> ReadingNoise:
        """Noise of the mean of `repeats` re-clamped readings; the machine's part does not shrink."""
        return ReadingNoise(self.repeat / np.sqrt(repeats), self.clamping / np.sqrt(repeats), self.machine)


def repeat_and_clamping(relative: float | tuple[float, float]) -> tuple[float, float]:
    """Relative sd of a reading and of a clamping, as given or split from the total of a reading.

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
    """Contributions of v visits to the gap of a pair of rivals: a (v,), h (v, q), M (v, q, q)."""

    a: FloatArray
    h: FloatArray
    M: FloatArray

    def gap(self, chosen: Sequence[int] | IntArray) -> float:
        """Gap after the chosen visits, in standard deviations."""
        index = np.asarray(chosen, dtype=np.int64)
        return float(_gap(self.a[index].sum(), self.h[index].sum(axis=0), self.M[index].sum(axis=0)))

    def gaps_with(self, chosen: Sequence[int] | IntArray) -> FloatArray:
        """(v,) gap after the chosen visits and one more, for every visit that could be added."""
        index = np.asarray(chosen, dtype=np.int64)
        sums = self.a[index].sum(), self.h[index].sum(axis=0), self.M[index].sum(axis=0)
        return _gap(self.a + sums[0], self.h + sums[1], self.M + sums[2])


def _gap(a: FloatArray, h: FloatArray, M: FloatArray) -> FloatArray:
    solved = np.linalg.solve(np.eye(h.shape[-1]) + M, h[..., None])[..., 0]
    return np.asarray(np.sqrt(np.maximum(a - (h * solved).sum(axis=-1), 0.0)))


def pair_shares(visits: Visits, first: Forecast, second: Forecast, noise: ReadingNoise) -> GapShares:
    """Contributions of the visits to the gap of two rivals."""
    difference = first.mean - second.mean
    F = np.concatenate([first.factor, second.factor, np.sqrt(2.0) * noise.machine], axis=1)
    columns = np.concatenate([difference[:, None], F], axis=1)[visits.members]
    starts, counts, q = visits.starts, visits.counts, columns.shape[1]
    products = np.empty((len(counts), q, q))
    for count in np.unique(counts).tolist():  # all visits with the same number of rows at once
        alike = np.flatnonzero(counts == count)
        rows = columns[starts[alike, None] + np.arange(count)]
        products[alike] = np.swapaxes(rows, 1, 2) @ rows
    sums = np.add.reduceat(columns, starts, axis=0)
    # Inverse of 2 (r^2 1 + c^2 11^T) by Sherman and Morrison.
    common = noise.clamping**2 / (noise.repeat**2 + counts * noise.clamping**2)
    form = (products - common[:, None, None] * sums[:, :, None] * sums[:, None, :]) / (2.0 * noise.repeat**2)
    return GapShares(form[:, 0, 0], form[:, 1:, 0], form[:, 1:, 1:])


@dataclass(frozen=True)
class Expectation:
    """Expected outcome of a set of readings.

    Attributes
    ----------
    truth
        Mean probability of the truth.
    settled
        How often the verdict is settled: one rival has the probability from which a diagnosis names it (`NAMED`).
    """

    truth: float
    settled: float


def expected_outcome(
    forecasts: Sequence[Forecast], rows: IntArray, visit_of: IntArray, noise: ReadingNoise, seed: int
) -> Expectation:
    """Simulate the readings under every rival in turn and judge them by Bayes' rule.

    All rivals scatter by the mean of their covariances here, as in the gap: that one rival is vaguer than another is
    a matter of its prior, and not counted on.

    Parameters
    ----------
    forecasts
        Of all readings; their weights add up to 1.
    rows, visit_of
        (k,) the readings taken, and the number of the visit each belongs to.
    noise
        Of these readings.
    seed
        Of the draws.
    """
    from scipy.linalg import solve_triangular

    weights = np.array([forecast.weight for forecast in forecasts])
    covariance = noise.repeat**2 * np.eye(len(rows)) + noise.clamping**2 * (visit_of[:, None] == visit_of)
    for factor, weight in [(noise.machine, 1.0), *((f.factor, f.weight) for f in forecasts)]:
        covariance += weight * factor[rows] @ factor[rows].T
    means = np.stack([forecast.mean[rows] for forecast in forecasts], axis=1)
    whitened = solve_triangular(np.linalg.cholesky(covariance), means, lower=True).T
    standard = np.random.default_rng(seed).standard_normal((DRAWS, len(rows)))
    truth = settled = 0.0
    for i, weight in enumerate(weights):
        # Log likelihoods -|z + (m_i - m_j)|^2 / 2 for every j, z standard normal.
        apart = whitened[i] - whitened
        logs = np.log(weights) - 0.5 * (apart**2).sum(axis=1) - standard @ apart.T
        probability = np.exp(logs - logs.max(axis=1, keepdims=True))
        probability /= probability.sum(axis=1, keepdims=True)
        truth += weight * float(probability[:, i].mean())
        settled += weight * float((probability.max(axis=1) >= NAMED).mean())
    return Expectation(truth, settled)
