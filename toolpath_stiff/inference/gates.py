"""Two gates: a model must be good enough, and a candidate better than the best of many would be by chance.

Both by parametric bootstrap: readings are simulated from the noise model at the fit, wild ones and the uncertainty of
the noise itself included, and go through the same linearised refit and the same search for wild readings as the real
ones. Compared are

- the weighted sum of squares, chi-square's place without its assumptions;
- structure: the score statistic of each form of discrepancy (locally most powerful for a little of that form; Lin 1997,
  Variance component testing in generalised linear models with random effects), the largest of all forms;
- for the base model, the largest gain that any candidate achieves.

The bootstrapped distribution of the smallest p value makes one test of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.covariances import Covariance, Precision
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.noise import Noise, Scatter

DRAWS = 400
RIDGE = 1e-12  # added to the diagonal for readings set aside: two that a fit explains entirely would make it singular
# Squared deleted residual beyond which a reading is set aside, and share of readings that may be: what pays the price
# of `scatter` where one reading in fifty is wild.
WILD_SQUARED, MOST_WILD = 11.3, 0.05
CHANCE = 0.05  # share of campaigns in which the best of all candidates gains as much by chance
HOPELESS = 1.3  # factor on the largest simulated sum of squares beyond which a model is hopeless


@dataclass(frozen=True)
class Gate:
    """Result of the absolute test of one fit.

    Attributes
    ----------
    probability, own_probability
        Of residuals that look worse than these if the model were right; the same whatever any candidate gains.
    squares, simulated
        Weighted sum of squares, and (DRAWS,) simulated ones.
    structure_probability, worst
        Of the structure alone; the form that sticks out most, in words.
    gain_probability
        Of the largest gain of any candidate; 1 where it was not asked.
    """

    probability: float
    squares: float
    simulated: FloatArray
    squares_probability: float
    structure_probability: float
    worst: str
    own_probability: float
    gain_probability: float = 1.0


def simulate(noise: Noise, covariance: Covariance, seed: int, draws: int = DRAWS) -> FloatArray:
    """(draws, n) simulated scatter of ln readings, each draw already divided by the error of its noise estimate."""
    rng, shape = np.random.default_rng(seed), (draws, len(covariance))
    shared = covariance.draw(rng, draws)
    wide = np.where(rng.random(shape) < noise.outliers, noise.outlier_width, 1.0)
    scatter = shared + noise.repeat * wide * rng.standard_normal(shape)
    if np.isfinite(noise.freedom):
        scatter = scatter / np.sqrt(rng.chisquare(noise.freedom, draws) / noise.freedom)[:, None]
    return np.asarray(scatter)


def set_wild_aside(
    pulls: FloatArray, projected: Precision, scatter: Scatter | None = None
) -> tuple[FloatArray, FloatArray]:
    """Pulls P r (s, n) without readings that are far off the prediction of all others, and the change of residuals.

    Pulls as if the wild readings had not been taken, and what that takes off the residuals r of s sets of n readings:
    nothing but at wild readings.
    """
    beyond, share = (WILD_SQUARED, MOST_WILD) if scatter is None else (scatter.beyond, scatter.most)
    squared = pulls**2 / np.maximum(projected.diagonal, 1e-12)
    most = max(1, int(share * pulls.shape[1]))
    taken = np.zeros_like(pulls)
    count = np.minimum((squared > beyond).sum(axis=1), most)
    furthest = np.argsort(-squared, axis=1, kind="stable")[:, : count.max(initial=0)]
    for size in np.unique(count[count > 0]).tolist():
        sets = np.flatnonzero(count == size)
        rows = furthest[sets, :size]
        block = projected.block(rows) * (1.0 + RIDGE * np.eye(size))
        taken[sets[:, None], rows] = np.linalg.solve(block, np.take_along_axis(pulls[sets], rows, 1)[..., None])[..., 0]
    return pulls - projected.times(taken), taken


class Forms:
    """Forms of discrepancy under the scatter, prepared once for all fits to the same readings.

    A form is a covariance K = L L^T between readings with features L (n, r). Under the inverse covariance P = A - G^T G
    of what a fit leaves, G = X A, all that is asked of it are L^T P L = L^T A L - (G L)^T (G L), and L^T P r of
    residuals r: a fit costs some products with the few rows of X.

    Parameters
    ----------
    features
        Form in words -> (n, r).
    precision
        A, inverse covariance of the readings.
    """

    def __init__(self, features: Mapping[str, FloatArray], precision: Precision) -> None:
        self.names = tuple(features)
        solved = [precision.times(form.T).T for form in features.values()]
        self.grams = [form.T @ mine for form, mine in zip(features.values(), solved, strict=True)]  # L^T A L
        self.solved = np.ascontiguousarray(np.concatenate([*solved, np.zeros((len(precision), 0))], axis=1))  # A L
        ends = np.cumsum([0, *(form.shape[1] for form in solved)])
        self.slices = [slice(*pair) for pair in pairwise(ends.tolist())]


class FormStatistics:
    """Statistics of the forms of discrepancy for one fit, as surprises: normal deviates.

    r^T P K P r is a weighted sum of chi-squares; its tail is that of one scaled chi-square with the same mean tr(P K)
    and variance 2 tr(P K P K) (Satterthwaite 1946). The bootstrap corrects what the approximation gets wrong.
    """

    def __init__(self, forms: Forms, projected: Precision) -> None:
        self.forms, self.fitted = forms, projected.fitted
        self.removed = projected.factors[len(projected.factors) - len(self.fitted) :]  # G
        self.reached = self.fitted @ forms.solved  # G L, all forms
        inner = [self.inner(k) for k in range(len(forms.names))]
        self.means = np.array([np.trace(gram) for gram in inner])
        self.variances = np.array([max(2.0 * (gram**2).sum(), 1e-300) for gram in inner])

    def inner(self, k: int) -> FloatArray:
        """(r, r) L^T P L of form k."""
        reached = self.reached[:, self.forms.slices[k]]
        return np.asarray(self.forms.grams[k] - reached.T @ reached)

    def loads(self, residuals: FloatArray) -> FloatArray:
        """(s, all features) L^T P r of residuals (s, n)."""
        return np.asarray(residuals @ self.forms.solved - residuals @ self.removed.T @ self.reached)

    def surprises(self, loads: FloatArray) -> FloatArray:
        """(s, forms) normal deviates from loads (s, all features)."""
        if not self.forms.names:
            return np.zeros((len(loads), 1))
        value = np.stack([(loads[:, part] ** 2).sum(axis=1) for part in self.forms.slices], axis=1)
        return surprise(value * 2.0 * self.means / self.variances, 2.0 * self.means**2 / self.variances)


def surprise(value: FloatArray, freedom: FloatArray) -> FloatArray:
    """(s, k) normal deviates of chi-squares `value` (s, k) of `freedom` (k,), by their cube roots.

    Wilson and Hilferty 1931, Proceedings of the National Academy of Sciences 17, 684. Without degrees of freedom any
    value is too much.
    """
    safe = np.where(freedom > 0.0, freedom, 1.0)
    third = 2.0 / (9.0 * safe)
    deviates = (np.cbrt(np.maximum(value, 0.0) / safe) - 1.0 + third) / np.sqrt(third)
    return np.where(freedom > 0.0, deviates, np.inf)


def absolute_gate(
    problem: Problem,
    residual: FloatArray,
    jacobian: FloatArray,
    draws: FloatArray,
    forms: Forms,
    signatures: Sequence[Sequence[FloatArray]] = (),
    gain: float = 0.0,
) -> Gate:
    """Test a fit, its residual (n,) and jacobian (n, 2 + p), against its own noise.

    `signatures`: for the base model, one-sided signatures (n, p) of the candidates, to judge `gain`, the largest
    twice-log-likelihood gain of any of them.
    """
    projected, scatter = problem.projected(jacobian), problem.scatter

    def squares_of(pulls: FloatArray, taken: FloatArray) -> FloatArray:
        """(s,) r^T P r from the pulls P r, with the price of wild readings; P V P = P up to the law's small prior."""
        return np.asarray(scatter.covariance.squares(pulls) + scatter.beyond * (taken != 0.0).sum(axis=1))

    # The data's residual is that of the linearised refit, with the law's prior as in the simulation.
    observed = set_wild_aside(projected.times(residual[None]), projected, scatter)
    pulls, taken = set_wild_aside(projected.times(draws), projected, scatter)
    observed_squares, squares = float(squares_of(*observed)[0]), squares_of(pulls, taken)
    structure = FormStatistics(forms, projected)
    seen = structure.surprises(structure.loads(residual[None] - observed[1]))
    # Squares far beyond all simulated ones settle it without the structure test.
    simulated = np.zeros((len(squares), seen.shape[1]))
    if signatures or observed_squares <= HOPELESS * squares.max():
        simulated = structure.surprises(structure.loads(draws - taken))
    # Rows: the data, then every draw; columns: statistics, larger is worse.
    looks = [np.concatenate([[observed_squares], squares]), np.concatenate([seen, simulated]).max(axis=1)]
    if signatures:
        looks.append(np.concatenate([[gain], largest_gain(pulls, projected, signatures)]))
    ranked = np.stack([_tail(look, look[1:]) for look in looks], axis=1)
    smallest = np.minimum.accumulate(ranked, axis=1)[:, 1:]
    chances = np.maximum((smallest[1:] <= smallest[0] + 1e-12).mean(axis=0), 0.5 / len(squares)).tolist()
    return Gate(
        chances[-1],
        observed_squares,
        squares,
        squares_probability=float(ranked[0, 0]),
        structure_probability=float(ranked[0, 1]),
        worst=forms.names[int(np.argmax(seen[0]))] if forms.names else "",
        own_probability=chances[0],
        gain_probability=float(ranked[0, 2]) if signatures else 1.0,
    )


def gain_threshold(
    problem: Problem, jacobian: FloatArray, draws: FloatArray, signatures: Sequence[Sequence[FloatArray]]
) -> float:
    """Gain in twice the log likelihood that the best of all candidates reaches by chance in one campaign of twenty."""
    projected = problem.projected(jacobian)
    pulls, _ = set_wild_aside(projected.times(draws), projected, problem.scatter)
    return float(np.quantile(largest_gain(pulls, projected, signatures), 1.0 - CHANCE))


def _tail(values: FloatArray, simulated: FloatArray) -> FloatArray:
    """(s,) share of simulated values at or above each value; half of one count if there are none."""
    ordered = np.sort(simulated)
    count = len(ordered) - np.searchsorted(ordered, values - 1e-12 * np.abs(values))
    return np.asarray(np.maximum(count, 0.5) / len(ordered))


def largest_gain(pulls: FloatArray, projected: Precision, signatures: Sequence[Sequence[FloatArray]]) -> FloatArray:
    """(s,) largest likelihood-ratio gain over candidates; each a list of matrices (n, p) with sizes >= 0."""
    best = np.zeros(len(pulls))
    for columns in (columns for subsets in signatures for columns in subsets):
        information = projected.times(columns.T) @ columns
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        slope = pulls @ columns / scale
        try:
            sizes = np.linalg.solve(information / np.outer(scale, scale), slope.T).T
        except np.linalg.LinAlgError:
            continue
        gain = np.einsum("sp,sp->s", sizes, slope)
        best = np.maximum(best, np.where((sizes > 0.0).all(axis=1), gain, 0.0))
    return best
