"""Two gates: is a model good enough, and is a candidate better than the best of many would be by chance.

Both by parametric bootstrap: readings are simulated from the noise model at the fit, wild ones and the uncertainty of
the noise itself included, and go through the same linearised refit and the same search for wild readings as the real
ones. Compared are

- the weighted sum of squares, chi-square's place without its assumptions;
- structure: the score statistic of each form of discrepancy (locally most powerful for a little of that form; Lin 1997,
  Variance component testing in generalised linear models with random effects), the largest of all forms;
- for the base model, the largest gain that any candidate achieves.

The bootstrapped distribution of the smallest p value makes one test of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.updating.inference.evidence import Problem
from toolpath_stiff.updating.inference.noise import Noise
from toolpath_stiff.updating.inference.prediction import Predictor

FloatArray = NDArray[np.float64]

DRAWS = 400
WILD_SQUARED = 11.3  # squared deleted residual beyond which a reading is set aside; pays the price of `scatter`
MOST_WILD = 0.05
HOPELESS = 1.3  # times the largest simulated sum of squares


@dataclass(frozen=True)
class Gate:
    """Outcome of the absolute test of one fit.

    Attributes
    ----------
    probability
        Of residuals that look worse than these if the model were right.
    squares, simulated
        Weighted sum of squares, and (DRAWS,) simulated ones.
    structure_probability, worst
        Of the structure alone; the form that sticks out most, in words.
    gain_probability
        Of the largest gain of any candidate; 1 where it was not asked.
    gain_threshold
        Gain that the best of all candidates reaches by chance in one campaign of twenty; 0 where it was not asked.
    """

    probability: float
    squares: float
    simulated: FloatArray
    squares_probability: float
    structure_probability: float
    worst: str
    gain_probability: float = 1.0
    gain_threshold: float = 0.0


@dataclass(frozen=True)
class Simulator:
    """Simulated scatter of ln readings, shared by all tests of one data set.

    Attributes
    ----------
    draws
        (DRAWS, n) scatter, each already divided by the error of its noise estimate.
    """

    draws: FloatArray

    @classmethod
    def of(cls, noise: Noise, covariance: FloatArray, seed: int, draws: int = DRAWS) -> Simulator:
        """From a noise model and its covariance (n, n)."""
        rng = np.random.default_rng(seed)
        n = len(covariance)
        rest = covariance - np.diag(noise.repeat**2)
        values, vectors = np.linalg.eigh(0.5 * (rest + rest.T))
        shared = rng.standard_normal((draws, n)) * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
        wide = np.where(rng.random((draws, n)) < noise.outliers, noise.outlier_width, 1.0)
        scatter = shared + noise.repeat * wide * rng.standard_normal((draws, n))
        if np.isfinite(noise.freedom):
            scatter = scatter / np.sqrt(rng.chisquare(noise.freedom, draws) / noise.freedom)[:, None]
        return cls(scatter)


def set_wild_aside(pulls: FloatArray, projected: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pulls P r (s, n) as if the wild readings were not there, and the number of these (s,)."""
    diagonal = np.maximum(np.diag(projected), 1e-12)
    squared = pulls**2 / diagonal
    most = max(1, int(MOST_WILD * pulls.shape[1]))
    out, count = pulls.copy(), np.zeros(len(pulls))
    for s in np.flatnonzero((squared > WILD_SQUARED).any(axis=1)):
        rows = np.flatnonzero(squared[s] > WILD_SQUARED)
        rows = rows[np.argsort(-squared[s, rows])][:most]
        block = projected[np.ix_(rows, rows)]
        out[s] = pulls[s] - projected[:, rows] @ np.linalg.lstsq(block, pulls[s, rows], rcond=None)[0]
        count[s] = len(rows)
    return out, count


class Structure:
    """Fit statistics of the forms of discrepancy for one fit, as surprises: -ln of a tail probability.

    r^T P K P r is a weighted sum of chi-squares; its tail is that of one scaled chi-square with the same mean and
    variance (Satterthwaite 1946). The bootstrap corrects what the approximation gets wrong.
    """

    def __init__(self, forms: Mapping[str, FloatArray], projected: FloatArray) -> None:
        self.names = tuple(forms)
        self.forms = tuple(forms.values())
        self.means, self.variances = [], []
        for form in self.forms:
            product = projected @ form
            self.means.append(float(np.trace(product)))
            self.variances.append(float(max(2.0 * (product * product.T).sum(), 1e-300)))

    def surprises(self, pulls: FloatArray) -> FloatArray:
        """(s, forms) of pulls (s, n)."""
        columns = []
        for form, mean, variance in zip(self.forms, self.means, self.variances, strict=True):
            value = np.einsum("si,si->s", pulls @ form, pulls)
            columns.append(_surprise(value * 2.0 * mean / variance, 2.0 * mean**2 / variance))
        return np.stack(columns, axis=1) if columns else np.zeros((len(pulls), 1))


def _surprise(value: FloatArray, freedom: float) -> FloatArray:
    """-ln P(chi-square of `freedom` > value), with the leading term of its asymptote where that underflows."""
    from scipy.special import gammaincc, gammaln

    half, x = 0.5 * freedom, np.maximum(0.5 * value, 1e-300)
    tail = gammaincc(half, x)
    far = x - (half - 1.0) * np.log(x) + gammaln(half)
    with np.errstate(divide="ignore"):
        return np.asarray(np.where(tail > 1e-290, -np.log(tail), far))


def absolute_gate(
    problem: Problem,
    residual: FloatArray,
    jacobian: FloatArray,
    simulator: Simulator,
    forms: Mapping[str, FloatArray],
    signatures: Sequence[Sequence[FloatArray]] = (),
    gain: float = 0.0,
) -> Gate:
    """Test a fit, its residual (n,) and jacobian (n, 2 + p), against its own noise.

    `signatures`: for the base model, one-sided signatures (n, p) of the candidates, to judge `gain`, the largest
    twice-log-likelihood gain of any of them.
    """
    projected = problem.projected(jacobian)
    # What the linearised refit leaves of the data is their residual; the law's prior pulls as in the simulation.
    observed, wild = set_wild_aside((residual @ projected)[None], projected)
    pulls, count = set_wild_aside(simulator.draws @ projected, projected)
    squares = _quadratic(problem, pulls) + WILD_SQUARED * count
    observed_squares = float((_quadratic(problem, observed) + WILD_SQUARED * wild)[0])
    structure = Structure(forms, projected)
    seen = structure.surprises(observed)
    # Squares far beyond all simulated ones settle it; what the structure would look like by chance matters no more.
    hopeless = not signatures and observed_squares > HOPELESS * squares.max()
    simulated = np.zeros((len(pulls), seen.shape[1])) if hopeless else structure.surprises(pulls)
    # Rows: the data, then every draw; columns: what may look bad, larger is worse.
    looks = [np.concatenate([[observed_squares], squares]), np.concatenate([seen, simulated]).max(axis=1)]
    if signatures:
        looks.append(np.concatenate([[gain], largest_gain(pulls, projected, signatures)]))
    ranked = np.stack([_tail(look, look[1:]) for look in looks], axis=1)
    smallest = ranked.min(axis=1)
    probability = float(max((smallest[1:] <= smallest[0] + 1e-12).mean(), 0.5 / len(pulls)))
    worst = structure.names[int(np.argmax(seen[0]))] if structure.names else ""
    return Gate(
        probability,
        observed_squares,
        np.asarray(squares),
        float(ranked[0, 0]),
        float(ranked[0, 1]),
        worst,
        float(ranked[0, 2]) if signatures else 1.0,
        float(np.quantile(looks[2][1:], 0.95)) if signatures else 0.0,
    )


def _quadratic(problem: Problem, pulls: FloatArray) -> FloatArray:
    """(s,) r^T P r from the pulls P r: P V P = P but for the law's prior, which is next to nothing."""
    covariance = problem.covariance
    return np.asarray(np.einsum("si,si->s", pulls @ covariance, pulls))


def _tail(values: FloatArray, simulated: FloatArray) -> FloatArray:
    """(s,) share of the simulated values at or above each value; half of one where none is."""
    ordered = np.sort(simulated)
    count = len(ordered) - np.searchsorted(ordered, values - 1e-12 * np.abs(values))
    return np.asarray(np.maximum(count, 0.5) / len(ordered))


def largest_gain(pulls: FloatArray, projected: FloatArray, signatures: Sequence[Sequence[FloatArray]]) -> FloatArray:
    """(s,) largest likelihood-ratio gain over candidates; each a list of matrices (n, p) with sizes >= 0."""
    best = np.zeros(len(pulls))
    for subsets in signatures:
        for columns in subsets:
            slope = pulls @ columns
            information = columns.T @ projected @ columns
            scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
            try:
                sizes = np.linalg.solve(information / np.outer(scale, scale), (slope / scale).T).T
            except np.linalg.LinAlgError:
                continue
            gain = np.einsum("sp,sp->s", sizes, slope / scale)
            best = np.maximum(best, np.where((sizes > 0.0).all(axis=1), gain, 0.0))
    return best


# -- forms of discrepancy ----------------------------------------------------------------------------------------------
#
# Forms that a discrepancy between model and readings may take when no effect of the catalogue describes it.
#
# Each form is a covariance between readings, as of a Gaussian process (Kennedy and O'Hagan 2001, Bayesian calibration
# of computer models): smooth over the workspace, different by direction, growing with the load, one strut's own affair,
# and so on. They say that something is left in the residuals and where, never what.

# Ranges over which a smooth discrepancy stays alike; assumed: about half a workspace, half a tilting range, a few
# turns of a screw, a third of a campaign.
RANGE_POSITION, RANGE_ANGLE, RANGE_LENGTH, RANGE_ORDER = 0.25, np.radians(15.0), 0.05, 0.3


def discrepancy_forms(predictor: Predictor) -> dict[str, FloatArray]:
    """What a discrepancy may look like, in words -> covariance (n, n) with mean diagonal 1; only forms that vary."""
    data = predictor.data
    n = len(data)
    same_direction = (data.direction @ data.direction.T) ** 2
    near = np.exp(-0.5 * _squared(data.position / RANGE_POSITION))
    near = near * np.exp(-0.5 * _squared(data.angles / RANGE_ANGLE))
    place = np.concatenate([_centred(data.position / RANGE_POSITION), _centred(data.angles / RANGE_ANGLE)], axis=1)
    linear = place @ place.T
    order = np.linspace(0.0, 1.0, n)[:, None]
    in_order = np.exp(-0.5 * _squared(order / RANGE_ORDER))
    # Point by point: the same pose and tool, whatever the repeat.
    same_point = _same(data.point)
    forms = {
        "smooth over the workspace": near,
        "smooth over the workspace, different by direction": near * same_direction,
        "linear over the workspace, different by direction": linear * same_direction,
        "curved over the workspace, different by direction": linear**2 * same_direction,
        "from point to point, different by direction": same_point * same_direction,
        "in the course of the campaign": in_order,
        "in the course of the campaign, different by direction": in_order * same_direction,
        "in the course of the campaign, over the workspace": in_order * linear * same_direction,
    }
    share = predictor.strut_columns()
    lengths = predictor.strut_lengths()
    sign = np.sign(predictor.strut_forces())
    forms["of single struts in the course of the campaign"] = (share @ share.T) * in_order
    forms["of single struts with their length"] = sum(
        np.outer(share[:, i], share[:, i]) * np.exp(-0.5 * _squared(lengths[:, [i]] / RANGE_LENGTH)) for i in range(6)
    )
    forms["of struts in tension against compression"] = (share * sign) @ (share * sign).T
    forms["of single struts over the workspace"] = (share @ share.T) * near
    for name, words in (("force_N", "with the load"), ("tool_extension_mm", "with the tool length")):
        column = np.log(data.force) if name == "force_N" else data.tool_extension
        forms |= _by_column(column, words, same_direction, near)
    if "time_min" not in data.missing:
        forms |= _by_column(data.time, "with the time since zeroing", same_direction, near)
    if "temperature_C" not in data.missing:
        forms |= _by_column(data.temperature, "with the temperature", same_direction, near)
    for name, column in data.extra.items():
        forms |= _by_column(column, f"with the column {name}", same_direction, near)
    if len(set(data.setup.tolist())) > 1:
        forms["between set-ups, different by direction"] = _same(data.setup) * same_direction
    scaled = {}
    for name, form in forms.items():
        scale = float(np.trace(form)) / n
        if scale > 1e-12 and np.isfinite(form).all() and float(np.abs(form - form[0, 0]).max()) > 1e-9 * scale:
            scaled[name] = form / scale
    return scaled


def _by_column(column: FloatArray, words: str, same_direction: FloatArray, near: FloatArray) -> dict[str, FloatArray]:
    if not np.isfinite(column).all() or np.ptp(column) == 0.0:
        return {}
    centred = _centred(column[:, None] / float(np.ptp(column)))
    product = centred @ centred.T
    return {
        words: product,
        f"{words}, different by direction": product * same_direction,
        f"{words}, over the workspace": product * near * same_direction,
    }


def _squared(x: FloatArray) -> FloatArray:
    """(n, n) squared distances of rows."""
    return np.asarray(((x[:, None, :] - x[None, :, :]) ** 2).sum(axis=-1))


def _centred(x: FloatArray) -> FloatArray:
    return np.asarray(x - x.mean(axis=0))


def _same(labels: NDArray[np.str_]) -> FloatArray:
    return np.asarray(labels[:, None] == labels[None, :], dtype=float)
