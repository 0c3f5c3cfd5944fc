"""What is to be expected of visits: readings simulated under every rival, judged by Bayes' rule."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import IntArray
from toolpath_stiff.inference.judgement import NAMED
from toolpath_stiff.planning.forecasts import Forecast
from toolpath_stiff.planning.gaps import ReadingNoise
from toolpath_stiff.planning.visits import Visits

SETTLED = 0.95  # probability of one rival at which visits are enough: on the safe side of a diagnosis's `NAMED`
MOST_REPEATS = 64
DRAWS = 400  # simulated results a rival


@dataclass(frozen=True)
class Expectation:
    """What is to be expected of readings.

    Attributes
    ----------
    truth
        Mean probability of the truth.
    settled
        How often the verdict is settled: one rival has the probability from which a diagnosis names it (`NAMED`).
    settled_if
        The same for each rival in turn, were it the truth; `settled` is their mean by the rivals' weights.
    """

    truth: float
    settled: float
    settled_if: tuple[float, ...] = ()


def expected_outcome(
    forecasts: Sequence[Forecast],
    rows: IntArray,
    visit_of: IntArray,
    noise: ReadingNoise,
    seed: int,
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

    rng = np.random.default_rng(seed)
    weights = np.array([forecast.weight for forecast in forecasts])
    same = visit_of[:, None] == visit_of[None, :]
    covariance = noise.repeat**2 * np.eye(len(rows)) + noise.clamping**2 * same
    for factor, weight in [(noise.machine, 1.0), *((f.factor, f.weight) for f in forecasts)]:
        covariance += weight * factor[rows] @ factor[rows].T
    means = np.stack([forecast.mean[rows] for forecast in forecasts], axis=1)
    whitened = solve_triangular(np.linalg.cholesky(covariance), means, lower=True).T
    standard = rng.standard_normal((DRAWS, len(rows)))
    truth, settled = 0.0, []
    for i, weight in enumerate(weights):
        # Of -|z + (m_i - m_j)|^2 / 2 for every j, z standard normal.
        apart = whitened[i] - whitened
        logs = np.log(weights) - 0.5 * (apart**2).sum(axis=1) - standard @ apart.T
        probability = np.exp(logs - logs.max(axis=1, keepdims=True))
        probability /= probability.sum(axis=1, keepdims=True)
        truth += weight * float(probability[:, i].mean())
        settled.append(float((probability.max(axis=1) >= NAMED).mean()))
    return Expectation(truth, float(weights @ settled), tuple(settled))


@dataclass(frozen=True)
class Outlook:
    """What visits promise, in the order in which they were picked."""

    visits: Visits
    picked: Sequence[int]
    forecasts: Sequence[Forecast]
    noise: ReadingNoise
    seed: int

    def after(self, count: int | None = None, repeats: int = 1) -> Expectation:
        """What is to be expected of the first visits (None: all), each made so often."""
        rows = [self.visits.rows(visit) for visit in self.picked[:count]]
        visit_of = np.repeat(np.arange(len(rows)), [len(some) for some in rows])
        noise = self.noise.shared_out(repeats)
        return expected_outcome(self.forecasts, np.concatenate(rows), visit_of, noise, self.seed)

    def enough(self) -> int | None:
        """How many of the visits, the first ones, should settle the question; None: not all of them."""
        counts = range(1, len(self.picked) + 1)
        return next((count for count in counts if self.after(count).truth >= SETTLED), None)

    def repeats_needed(self) -> int | None:
        """How often each visit must be made, clamped anew, to settle the question; None: not `MOST_REPEATS` times."""

        def settles(repeats: int) -> bool:
            return self.after(repeats=repeats).truth >= SETTLED

        if settles(1):
            return 1
        if not settles(MOST_REPEATS):
            return None
        return bisect_left(range(MOST_REPEATS + 1), True, lo=1, hi=MOST_REPEATS, key=settles)
