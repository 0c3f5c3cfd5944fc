"""How far the uncertainty of a machine's fitted parameters reaches into the stiffness along a path.

Linear propagation (JCGM 100:2008, Guide to the expression of uncertainty in measurement, equation 13): the covariance
of the parameters between two slopes of the stiffness, which are differences of whole evaluations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.evaluate import evaluate
from toolpath_stiff.errors import InputError
from toolpath_stiff.stiffness.acting import idle_effects
from toolpath_stiff.stiffness.model import StiffnessModel, with_parameter_moved
from toolpath_stiff.units import n_per_mm_from_n_per_m

if TYPE_CHECKING:
    from toolpath_stiff.analysis.path_analysis import Analysis

FloatArray = NDArray[np.float64]

STEP = 0.01  # of a standard deviation, for differences: stiffness bends little over it, and rounding stays far below
NORMAL_95 = 1.959964  # two-sided 95 % quantile of the normal distribution


@dataclass(frozen=True)
class ParameterBand:
    """Uncertainty of the stiffness of n samples that comes from p fitted parameters.

    Attributes
    ----------
    names
        Of the parameters, as in machine files.
    slopes
        (n, p) N/m by which the stiffness changes with one standard deviation of each; nan out of reach.
    correlation
        (p, p) of the parameters.
    """

    names: tuple[str, ...]
    slopes: FloatArray
    correlation: FloatArray

    @property
    def deviation(self) -> FloatArray:
        """(n,) N/m, standard deviation of the stiffness of each sample."""
        squared = np.einsum("ni,ij,nj->n", self.slopes, self.correlation, self.slopes)
        return np.asarray(np.sqrt(np.maximum(squared, 0.0)))

    def deviation_of_mean(self, weight: FloatArray) -> float:
        """N/m, standard deviation of the mean stiffness of samples with weights (n,); the errors do not average out."""
        slope: FloatArray = weight[weight > 0.0] @ self.slopes[weight > 0.0] / weight.sum()
        return float(np.sqrt(max(float(slope @ self.correlation @ slope), 0.0)))


def parameter_band(analysis: Analysis) -> ParameterBand | None:
    """The band of an analysis; None where the machine file has no `[uncertainty]`, or none that acts on the machine."""
    given = analysis.model.given
    uncertainty = given.uncertainty if given is not None else None
    if uncertainty is None:
        return None
    idle = {active.effect.name for active in analysis.model.instruments}
    idle |= {one.effect for one in idle_effects(analysis.model)}
    kept = [
        i
        for i, (name, sd) in enumerate(zip(uncertainty.names, uncertainty.sd, strict=True))
        if sd > 0.0 and name.partition(".")[0] not in idle
    ]
    if not kept:
        return None
    slopes = [_slope(analysis, uncertainty.names[i], float(uncertainty.sd[i])) for i in kept]
    return ParameterBand(
        tuple(uncertainty.names[i] for i in kept),
        np.stack(slopes, axis=1),
        np.asarray(uncertainty.correlation[np.ix_(kept, kept)]),
    )


def _slope(analysis: Analysis, name: str, sd: float) -> FloatArray:
    """(n,) N/m per standard deviation of one parameter, away from a bound that is near."""
    for step in (STEP, -STEP):
        try:
            moved = with_parameter_moved(analysis.model, name, step * sd)
        except InputError:
            continue
        return np.asarray((_stiffness(analysis, moved) - analysis.at.stiffness) / step)
    raise InputError(f"[uncertainty]: {name} has no room between its bounds for a standard deviation of {sd:g}")


def _stiffness(analysis: Analysis, model: StiffnessModel) -> FloatArray:
    samples = analysis.samples
    at = evaluate(
        model, samples.position, samples.abc, samples.tangent, samples.tool_length, analysis.load, analysis.force
    )
    return at.stiffness


def band_figures(analysis: Analysis) -> dict[str, Any] | None:
    """The headline figures of `summary.json`: standard deviations and 95 % intervals in N/mm; None without a band."""
    band, about = analysis.parameter_band, analysis.headline
    if band is None or not about.any():
        return None
    stiffness, weight = analysis.at.stiffness, np.where(about, analysis.samples.weight, 0.0)
    relative = np.where(about, band.deviation / stiffness, 0.0)
    mean, mean_sd = float(np.average(stiffness[about], weights=weight[about])), band.deviation_of_mean(weight)
    row = int(np.argmin(np.where(about, stiffness, np.inf)))
    widest = int(np.argmax(relative))
    return {
        "parameters": list(band.names),
        "mean_sd_N_per_mm": n_per_mm_from_n_per_m(mean_sd),
        "mean_95_N_per_mm": _interval(mean, mean_sd),
        "min_sd_N_per_mm": n_per_mm_from_n_per_m(float(band.deviation[row])),
        "min_95_N_per_mm": _interval(float(stiffness[row]), float(band.deviation[row])),
        "largest_sd_percent": 100.0 * float(relative[widest]),
        "largest_sd_line": int(analysis.samples.line[widest]),
    }


def _interval(value: float, sd: float) -> list[float]:
    return [n_per_mm_from_n_per_m(value + sign * NORMAL_95 * sd) for sign in (-1.0, 1.0)]
