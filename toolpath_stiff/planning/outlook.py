"""The outlook of visits: readings simulated under every rival, judged by Bayes' rule."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import IntArray
from toolpath_stiff.inference.judgement import NAMED
from toolpath_stiff.planning.forecasts import Forecast
from toolpath_stiff.planning.gaps import ReadingNoise

SETTLED = 0.95  # probability of one rival at which visits are enough: on the safe side of a diagnosis's `NAMED`
DRAWS = 400  # simulated results a rival


def percent(share: float) -> str:
    """Never "100 %" or "0 %" for what is only expected."""
    if share > 0.99:
        return "more than 99 %"
    return "less than 1 %" if share < 0.01 else f"{100 * share:.0f} %"


@dataclass(frozen=True)
class Expectation:
    """Expected outcome of readings.

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
