"""The paper's own estimation: the strut law that makes the mean relative error smallest.

Clinton, Zhang and Wavering (1997) choose the strut's stiffness at two lengths so that |model - measured| / measured,
averaged over all readings, is smallest. The objective has a kink wherever the model meets a reading: a search without
derivatives (Nelder and Mead 1965) from several starts; the paper searched one variable at a time.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.diagnosis.diagnose import check_measured
from toolpath_stiff.inference.prediction import NO_CHANGE, Predictor, at_both_ends, scaled_law
from toolpath_stiff.machine.model import StrutLaw

STARTS = 6
START_SPREAD = 0.2  # sd of the starts' logarithms: a law wrong by 20 %
FIRST_STEPS = 0.05 * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
FINE, ROUGH = (1e-7, 1e-10), (1e-5, 1e-7)  # law and mean error; a resampled search scatters a thousand times as much
SAME = 1e-5  # of the mean error: two ends that close are one minimum
RESAMPLES = 200


@dataclass(frozen=True)
class StrutLawSearch:
    """Result of the search.

    Attributes
    ----------
    law
        (2,) logarithms of the factors on the machine's strut law.
    strut_law
        The law found.
    error, error_before
        Mean |model - measured| / measured with it, and with the machine's own law.
    starts, ends
        (s, 2) logarithms where each search began and ended.
    end_errors
        (s,) mean error at each end.
    """

    law: FloatArray
    strut_law: StrutLaw
    error: float
    error_before: float
    starts: FloatArray
    ends: FloatArray
    end_errors: FloatArray

    @property
    def agreeing(self) -> int:
        """How many searches ended at the smallest error found."""
        return int((self.end_errors <= self.error * (1.0 + SAME)).sum())


def mean_error(predictor: Predictor, law: ArrayLike = NO_CHANGE) -> float:
    """Mean |model - measured| / measured as the paper counts it; inf where the law leaves a strut no stiffness."""
    ratio = np.exp(predictor.log_stiffness(law)) / predictor.data.stiffness
    error = float(np.abs(ratio - 1.0).mean())
    return error if np.isfinite(error) else np.inf


def minimise_mean_error(predictor: Predictor, seed: int = 0, starts: int = STARTS) -> StrutLawSearch:
    """The strut law with the smallest mean error.

    Parameters
    ----------
    predictor
        Machine and n readings.
    seed
        Of the starts; the first one is always the machine's own law.
    starts
        How many searches.

    Raises
    ------
    InputError
        A reading without a stiffness, or fewer than three.
    """
    check_measured(predictor.data, "for a law of two constants", fewest=3)
    rng, given = np.random.default_rng(seed), predictor.machine.strut_law
    drawn = rng.normal(0.0, START_SPREAD, (starts - 1, 2))
    begin = at_both_ends(given, np.concatenate([np.zeros((1, 2)), drawn]))
    objective = _objective(predictor)
    # A second search from the first one's end: a simplex can collapse on a kink.
    laws = [_downhill(objective, _downhill(objective, start, *FINE), *FINE) for start in begin]
    errors = np.array([mean_error(predictor, law) for law in laws])
    ends, best = at_both_ends(given, np.array(laws)), int(np.argmin(errors))
    return StrutLawSearch(
        law=ends[best],
        strut_law=scaled_law(given, ends[best]),
        error=float(errors[best]),
        error_before=mean_error(predictor),
        starts=begin,
        ends=ends,
        end_errors=errors,
    )


def _downhill(objective: Callable[[FloatArray], float], start: FloatArray, xatol: float, fatol: float) -> FloatArray:
    from scipy.optimize import minimize

    options: Any = {"xatol": xatol, "fatol": fatol, "initial_simplex": start + FIRST_STEPS}
    return np.asarray(minimize(objective, start, method="Nelder-Mead", options=options).x)


def _objective(predictor: Predictor, weight: FloatArray | None = None) -> Callable[[FloatArray], float]:
    """Mean error as a function of the law, each reading with its weight (n,).

    Of a machine without further effects the struts alone are computed anew: its platform bars are in series.
    """
    measured = predictor.data.stiffness
    weight = np.full(len(measured), 1.0 / len(measured)) if weight is None else weight / weight.sum()
    plain = predictor.base.is_plain and not predictor.base.instruments
    rest = np.exp(-predictor.log_stiffness()) - predictor.strut_part() if plain else None

    def objective(law: FloatArray) -> float:
        if rest is None:
            ratio = np.exp(predictor.log_stiffness(law)) / measured
        else:
            ratio = 1.0 / (measured * (predictor.strut_part(law) + rest))
        error = float(weight @ np.abs(ratio - 1.0))
        return error if np.isfinite(error) and (ratio > 0.0).all() else np.inf

    return objective


def leave_points_out(predictor: Predictor, law: FloatArray) -> FloatArray:
    """(n,) ln measured - ln modelled, each reading by the law with the smallest mean error over the other points.

    nan with fewer than three points.
    """
    data, labels = predictor.data, np.unique(predictor.data.point)
    residual = np.full(len(data), np.nan)
    for label in labels if len(labels) > 2 else ():
        out = data.point == label
        others = _downhill(_objective(predictor, (~out).astype(float)), law, *ROUGH)
        residual[out] = np.log(data.stiffness[out]) - predictor.log_stiffness(others)[out]
    return residual


def resampled_covariance(predictor: Predictor, law: FloatArray, seed: int = 0) -> FloatArray:
    """(2, 2) covariance of the law: the bootstrap over points (Efron and Tibshirani 1993, chapter 6)."""
    labels, which = np.unique(predictor.data.point, return_inverse=True)
    rng, laws = np.random.default_rng(seed), []
    for _ in range(RESAMPLES):
        count = np.bincount(rng.integers(len(labels), size=len(labels)), minlength=len(labels))
        laws.append(_downhill(_objective(predictor, count[which.reshape(-1)].astype(float)), law, *ROUGH))
    return np.asarray(np.cov(np.array(laws).T))
