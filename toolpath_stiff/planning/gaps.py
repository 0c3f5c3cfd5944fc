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


@dataclass(frozen=True, eq=False)
class GapShares:
    """What v visits add to the gap of a pair of rivals: the distance of their forecasts in standard deviations.

    Attributes
    ----------
    visits, noise
        Made of m readings, and how these scatter.
    difference, factor
        (m,) of the two forecasts of ln k; (m, q) of the covariance of that difference which all visits share.
    """

    visits: Visits
    noise: ReadingNoise
    difference: FloatArray
    factor: FloatArray

    def gap(self, chosen: Sequence[int] | IntArray) -> float:
        """Gap after the chosen visits, in standard deviations."""
        return float(np.sqrt(self._after(chosen)[0]))

    def squares_with(self, chosen: Sequence[int] | IntArray) -> FloatArray:
        """(v,) square of the gap after the chosen visits and one more, for every visit that could be added.

        By the chain rule: one more adds e^T C^-1 e, with e by how much its readings still differ once the chosen ones
        are known, and C the covariance of that.
        """
        square, explained, root = self._after(chosen)
        left, open_factor = self.difference - self.factor @ explained, self.factor @ root
        counts, squares = self.visits.counts, np.empty(len(self.visits))
        for count in np.unique(counts).tolist():  # all visits with the same number of readings at once
            alike = np.flatnonzero(counts == count)
            rows = self.visits.members[self.visits.starts[alike, None] + np.arange(count)]
            open_rows, left_rows = open_factor[rows], left[rows][..., None]
            scatter = 2.0 * (self.noise.repeat**2 * np.eye(count) + self.noise.clamping**2)
            covariance = scatter + open_rows @ np.swapaxes(open_rows, 1, 2)
            squares[alike] = square + (left_rows * np.linalg.solve(covariance, left_rows))[..., 0].sum(axis=1)
        return squares

    def _after(self, chosen: Sequence[int] | IntArray) -> tuple[float, FloatArray, FloatArray]:
        """Square of the gap after the chosen visits; (q,) what they explain of `factor`, and (q, q) a root of the rest.

        With M and h the sums of F^T N^-1 F and F^T N^-1 d over visits: (1 + M)^-1 h, and R R^T = (1 + M)^-1.
        """
        information, pull, square = np.eye(self.factor.shape[1]), np.zeros(self.factor.shape[1]), 0.0
        for visit in np.asarray(chosen, dtype=np.int64).tolist():
            rows = self.visits.members[self.visits.starts[visit] :][: self.visits.counts[visit]]
            factor, difference = self.factor[rows], self.difference[rows]
            both, (r, c) = np.column_stack([factor, difference]), (self.noise.repeat, self.noise.clamping)
            # Times the inverse of N = 2 (r^2 1 + c^2 11^T) by Sherman and Morrison.
            weighted = (both - c**2 / (r**2 + len(rows) * c**2) * both.sum(axis=0)) / (2.0 * r**2)
            information, pull = information + factor.T @ weighted[:, :-1], pull + factor.T @ weighted[:, -1]
            square += float(difference @ weighted[:, -1])
        explained = np.linalg.solve(information, pull)
        root = np.linalg.inv(np.linalg.cholesky(information)).T
        return max(square - float(pull @ explained), 0.0), np.asarray(explained), root


def pair_shares(visits: Visits, first: Forecast, second: Forecast, noise: ReadingNoise) -> GapShares:
    """Contributions of the visits to the gap of two rivals."""
    factor = np.concatenate([first.factor, second.factor, np.sqrt(2.0) * noise.machine], axis=1)
    return GapShares(visits, noise, first.mean - second.mean, factor)


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
