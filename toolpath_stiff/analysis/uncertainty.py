"""How far the uncertainty of a machine's fitted parameters reaches into the stiffness along a path.

A linear propagation (JCGM 100:2008, Guide to the expression of uncertainty in measurement, equation 13): the covariance
of the parameters between two slopes of the stiffness, which are differences of whole evaluations.
"""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.evaluation import evaluate
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.path.sampling import Samples
from toolpath_stiff.stiffness.model import StiffnessModel, idle_effects, with_parameter_moved
from toolpath_stiff.units import n_per_mm_from_n_per_m

STEP = 0.01  # of a standard deviation, for differences: stiffness bends little over it, and rounding stays far below


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


def parameter_band(
    model: StiffnessModel, samples: Samples, load: Load, force: float, stiffness: FloatArray
) -> ParameterBand | None:
    """The band of a path, given its stiffness (n,); None where the machine file states no uncertainty of what acts."""
    uncertainty = model.given.uncertainty if model.given is not None else None
    idle = {active.effect.name for active in model.instruments} | idle_effects(model).keys()
    sd = {} if uncertainty is None else dict(zip(uncertainty.names, uncertainty.sd.tolist(), strict=True))
    kept = [i for i, (name, size) in enumerate(sd.items()) if size > 0.0 and name.partition(".")[0] not in idle]
    if uncertainty is None or not kept:
        return None

    def slope(name: str) -> FloatArray:
        """(n,) N/m per standard deviation of one parameter, away from a bound that is near."""
        for step in (STEP, -STEP):
            with suppress(InputError):
                moved = with_parameter_moved(model, name, step * sd[name])
                path = (samples.position, samples.abc, samples.tangent, samples.tool_length)
                return np.asarray((evaluate(moved, *path, load, force).stiffness - stiffness) / step)
        raise InputError(
            f"[uncertainty]: {name} has no room between its bounds for a standard deviation of {sd[name]:g}"
        )

    names = tuple(uncertainty.names[i] for i in kept)
    correlation = np.asarray(uncertainty.correlation[np.ix_(kept, kept)])
    return ParameterBand(names, np.stack([slope(name) for name in names], axis=1), correlation)


def band_figures(band: ParameterBand, stiffness: FloatArray, weight: FloatArray) -> Document | None:
    """Standard deviations and 95 % intervals of mean and smallest stiffness of samples (n,) that have a weight."""
    if not weight.any():
        return None
    low = int(np.argmin(np.where(weight > 0.0, stiffness, np.inf)))
    mean = float(np.average(stiffness[weight > 0.0], weights=weight[weight > 0.0]))
    figures: dict[str, object] = {"parameters": list(band.names)}
    for name, value, sd in (
        ("mean", mean, band.deviation_of_mean(weight)),
        ("min", float(stiffness[low]), float(band.deviation[low])),
    ):
        ends = (value - defaults.NORMAL_95 * sd, value + defaults.NORMAL_95 * sd)
        figures[f"{name}_sd_N_per_mm"] = n_per_mm_from_n_per_m(sd)
        figures[f"{name}_95_N_per_mm"] = [n_per_mm_from_n_per_m(end) for end in ends]
    return figures
