"""Uncertainty of the stiffness along a path on a machine that was fitted to measurements.

A linear propagation (JCGM 100:2008, Guide to the expression of uncertainty in measurement, equation 13): the errors of
the parameters times slopes of the stiffness, which are differences of whole evaluations; where the machine file states
them (`[uncertainty.errors]`), beside the errors of struts and joints, which belong to the machine and which the
parameters have partly taken up, and what the model lacks.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.evaluation import evaluate
from toolpath_stiff.analysis.loads import Load, load_directions
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.documents import Document, certain
from toolpath_stiff.machine.error_model import FEW, GEOMETRY, alike, coordinates
from toolpath_stiff.path.sampling import Samples
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.geometry_slopes import geometry_slopes
from toolpath_stiff.stiffness.model import StiffnessModel, parameter_slopes
from toolpath_stiff.units import n_per_mm_from_n_per_m

BLOCK = 8192  # samples processed at a time
MOST_OF_MEAN = 400  # samples used to find how far the model's form error averages out along a path
# Draws of the whole path, and places drawn, one a piece of it; standard deviations within which a sample may be the
# lowest; share of its variance that the form of each sample has for itself, for a factor that exists.
DRAWS, MOST_OF_LOWEST, FARTHEST, RIDGE = 1000, 200, 4.0, 1e-9
TAILS, TINY = (0.025, 0.975), 1e-300


@dataclass(frozen=True)
class ParameterBand:
    """Uncertainty of the stiffness of n samples.

    Attributes
    ----------
    names
        Of the p fitted parameters, as in machine files.
    factors
        (n, r) N/m by which the stiffness changes with each of r independent errors; nan out of reach.
    form
        (n,) N/m, standard deviation of what the model lacks; 0 unless stated.
    few
        (n,) few readings near there.
    place, direction
        (n, 6) `coordinates` and (n, 3) unit vectors of the load.
    """

    names: tuple[str, ...]
    factors: FloatArray
    form: FloatArray
    few: BoolArray
    place: FloatArray
    direction: FloatArray

    @property
    def deviation(self) -> FloatArray:
        """(n,) N/m, standard deviation of the stiffness of each sample."""
        return np.asarray(np.sqrt((self.factors**2).sum(axis=1) + self.form**2))

    def deviation_of_mean(self, weight: FloatArray) -> float:
        """N/m, standard deviation of the mean stiffness of samples with weights (n,).

        Errors of parameters do not average out; what the model lacks does as far as poses and directions differ.
        """
        counted = np.flatnonzero(weight > 0.0)
        mean = weight[counted] @ self.factors[counted] / weight.sum()
        few = counted[np.linspace(0, len(counted) - 1, min(len(counted), MOST_OF_MEAN)).round().astype(np.int64)]
        parts = weight[few] * self.form[few] / weight[few].sum()
        return float(np.sqrt(mean @ mean + parts @ alike(self.place[few], self.direction[few]) @ parts))

    def of_lowest(self, stiffness: FloatArray, weight: FloatArray) -> tuple[float, FloatArray]:
        """Standard deviation, N/m, and (2,) 95 % interval of the lowest stiffness of samples with weights (n,).

        Wherever it lies: each draw is of all errors along the whole path at once, and its minimum counts. As far as it
        goes along with the sample that is the lowest as modelled, that one's quantiles, which are known, replace those
        of its draws (a control variate; Asmussen and Glynn 2007, Stochastic Simulation, V.2).
        """
        counted = np.flatnonzero(weight > 0.0)
        k, deviation = stiffness[counted], self.deviation[counted]
        low = int(np.argmin(k))
        likely = counted[k - FARTHEST * deviation <= k[low] + FARTHEST * deviation[low]]
        pieces = np.array_split(likely, min(len(likely), MOST_OF_LOWEST))
        rows = np.array([piece[np.argmin(stiffness[piece])] for piece in pieces])
        correlation = alike(self.place[rows], self.direction[rows]) + RIDGE * np.eye(len(rows))
        by_form = self.form[rows, None] * np.linalg.cholesky(correlation)
        errors = np.concatenate([self.factors[rows], by_form], axis=1)
        drawn = stiffness[rows] + np.random.default_rng(0).standard_normal((DRAWS, errors.shape[1])) @ errors.T
        lowest, there = drawn.min(axis=1), drawn[:, int(np.argmin(stiffness[rows]))]
        (own, both), (_, of_there) = np.cov(lowest, there, bias=True)
        along = float(both / np.sqrt(max(own * of_there, TINY)))
        known = k[low] + defaults.NORMAL_95 * deviation[low] * np.array([-1.0, 1.0])
        ends = np.quantile(lowest, TAILS) + along * (known - np.quantile(there, TAILS))
        return float(np.sqrt(own) + along * (deviation[low] - np.sqrt(of_there))), ends


def parameter_band(
    model: StiffnessModel, samples: Samples, load: Load, force: float, stiffness: FloatArray
) -> ParameterBand | None:
    """Band of a path, given its stiffness (n,); None if the machine file states no uncertainty of what acts."""
    path = (samples.position, samples.abc, samples.tangent, samples.tool_length)
    slopes_of = parameter_slopes(model, lambda moved: evaluate(moved, *path, load, force).stiffness, stiffness)
    uncertainty = model.given.uncertainty if model.given is not None else None
    if uncertainty is None or not slopes_of:
        return None
    kept, names = [*slopes_of], tuple(uncertainty.names[i] for i in slopes_of)
    slopes = np.stack([*slopes_of.values()], axis=1)
    place = coordinates(samples.position, samples.abc)
    if uncertainty.errors is None:
        values, vectors = np.linalg.eigh(uncertainty.correlation[np.ix_(kept, kept)])
        factors = slopes @ (vectors * np.sqrt(np.maximum(values, 0.0)))
        n = len(slopes)
        return ParameterBand(names, factors, np.zeros(n), np.zeros(n, dtype=bool), place, np.zeros((n, 3)))
    errors, direction = uncertainty.errors.of(kept), np.zeros_like(samples.position)
    factors = slopes @ errors.loadings
    for rows in _blocks(np.flatnonzero(np.isfinite(stiffness))):
        turn, tools = rotation_matrices(samples.abc[rows]), np.broadcast_to(samples.tool_length, len(place))[rows]
        compliance = core.tip_compliance(model, samples.position[rows], turn, tools, force)
        direction[rows] = load_directions(load, compliance, samples.position[rows], turn, samples.tangent[rows])[0]
        paths = core.load_paths(model, samples.position[rows], turn, tools, force)
        by_geometry = np.concatenate([geometry_slopes(model, path, direction[rows][some]) for some, path in paths])
        factors[rows, -GEOMETRY:] -= stiffness[rows, None] * errors.of_geometry(by_geometry)
    if by_load := errors.of_load(force):
        factors = np.column_stack([factors, by_load * stiffness])
    near = errors.nearness(place)
    return ParameterBand(names, factors, stiffness * errors.form(near), near < FEW, place, direction)


def _blocks(rows: IntArray) -> Iterator[IntArray]:
    yield from (rows[start : start + BLOCK] for start in range(0, len(rows), BLOCK))


def band_figures(band: ParameterBand, stiffness: FloatArray, weight: FloatArray) -> Document | None:
    """Standard deviations and 95 % intervals of mean and lowest stiffness of the weighted samples (n,)."""
    if not weight.any():
        return None
    low = int(np.argmin(np.where(weight > 0.0, stiffness, np.inf)))
    mean = float(np.average(stiffness[weight > 0.0], weights=weight[weight > 0.0]))
    of_mean = band.deviation_of_mean(weight)
    reach = defaults.NORMAL_95 * of_mean
    figures: dict[str, object] = {"parameters": list(band.names)}
    for name, (sd, ends) in (
        ("mean", (of_mean, np.array([mean - reach, mean + reach]))),
        ("min", band.of_lowest(stiffness, weight)),
    ):
        figures[f"{name}_sd_N_per_mm"] = certain(n_per_mm_from_n_per_m(sd))
        figures[f"{name}_95_N_per_mm"] = certain(n_per_mm_from_n_per_m(ends).tolist())
    few = float(weight[band.few].sum() / weight.sum())
    figures |= {"few_readings_share": few, "few_readings_at_min": bool(band.few[low])}
    return {**figures, "form_known": bool(band.form[low] > 0.0)}
