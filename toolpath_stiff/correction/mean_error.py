"""The paper's own estimation: the strut law that makes the mean relative error smallest.

Clinton, Zhang and Wavering (1997) choose the strut's stiffness at two lengths so that |model - measured| / measured,
averaged over all readings, is smallest. The objective has a kink wherever the model meets a reading: a search without
derivatives (Nelder and Mead 1965) from several starts; the paper searched one variable at a time.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.correction.result import Update
from toolpath_stiff.correction.steps import LadderStep
from toolpath_stiff.correction.task import UpdateTask
from toolpath_stiff.diagnosis.diagnose import check_measured
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.errors import AS_GIVEN, LAW_REFITTED
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.fits import baseline
from toolpath_stiff.inference.left_out import HeldOut

STARTS, START_SPREAD = 6, 0.2  # sd of the starts' logarithms: a law wrong by 20 %
FINE, ROUGH = 1e-7, 1e-5  # of the law; a resampled search scatters a thousand times as much
SAME = 1e-5  # of the mean error: two ends this close count as one minimum
RESAMPLES = 200


def update_by_mean_error(task: UpdateTask) -> Update:
    """The strut law with the smallest mean error, its errors at left-out points and its uncertainty.

    Noise is for the noise floor only: the objective does not know of it. Standard deviations by the bootstrap over
    points (Efron and Tibshirani 1993, chapter 6). Raises `InputError` where more is asked than a law.
    """
    if task.add or task.auto or not task.strut_law:
        fault = "--objective mean-error is the paper's own estimation, of the strut law alone"
        raise InputError(fault, expected="--strut-law, without --add and --auto")
    task = replace(task, data=task.data.of_tip)
    check_measured(task.data, "for a law of two constants", fewest=3)
    problem, rng, (as_given, refitted) = task.problem, np.random.default_rng(task.seed), baseline(task.problem)
    starts = [np.zeros(2), *rng.normal(0.0, START_SPREAD, (STARTS - 1, 2))]
    each, labels = np.ones(len(task.data)), np.unique(task.data.point)
    task.progress("searching from several starts")
    # Search again from the end of the first search: a simplex can collapse on a kink.
    ends = [_searched(problem, _searched(problem, start, each, FINE), each, FINE) for start in starts]
    errors = np.array([_error(problem, end, each) for end in ends])
    law = ends[int(np.argmin(errors))]
    task.progress("leaving points out, drawing points anew")
    residual, left_out = (problem.observed - problem.predictor.log_stiffness(law), np.full(len(each), np.nan))
    for out in (task.data.point == label for label in labels if len(labels) > 2):
        others = _searched(problem, law, (~out).astype(float), ROUGH)
        left_out[out] = (problem.observed - problem.predictor.log_stiffness(others))[out]
    which, rng = np.searchsorted(labels, task.data.point), np.random.default_rng(task.seed)
    counts = [np.bincount(rng.integers(len(labels), size=len(labels)), minlength=len(labels)) for _ in range(RESAMPLES)]
    spread = np.cov(np.array([_searched(problem, law, count[which].astype(float), ROUGH) for count in counts]).T)
    columns = problem.predictor.law_columns(problem.observed - residual, law)
    fit = replace(refitted, law=law, residual=residual, jacobian=columns, covariance=spread)
    held = HeldOut(left_out, np.zeros((0, 2)), task.data.point)
    steps = (
        LadderStep.of(AS_GIVEN, as_given, task.data),
        LadderStep.of("strut law by mean error", fit, task.data, held),
    )
    search = {"end_errors_percent": np.round(100.0 * errors, 4).tolist()}
    agreeing = int((errors <= errors.min() * (1.0 + SAME)).sum())
    ladder_end = LadderStep.of(LAW_REFITTED, refitted, task.data)
    return Update(task, steps, ladder_end, search={**search, "agreeing": agreeing})


def _error(problem: Problem, law: FloatArray, weight: FloatArray) -> float:
    """Mean |model - measured| / measured, weighted by (n,)."""
    ratio = np.exp(-problem.observed) / problem.compliance(law, np.zeros(1))
    return float(np.average(np.abs(ratio - 1.0), weights=weight))


def _searched(problem: Problem, start: FloatArray, weight: FloatArray, fine: float) -> FloatArray:
    """(2,) logarithms of the law with the smallest mean error near a start; both equal for a constant law."""
    from scipy.optimize import minimize

    free = 1 if problem.predictor.machine.strut_law.constant else 2
    options: Any = {
        "xatol": fine,
        "fatol": 1e-3 * fine,
        "initial_simplex": start[:free] + 0.05 * np.eye(free + 1, free, -1),
    }

    def error(law: FloatArray) -> float:
        return _error(problem, np.resize(law, 2), weight)

    return np.resize(minimize(error, start[:free], method="Nelder-Mead", options=options).x, 2)
