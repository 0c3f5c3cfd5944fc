"""The yardstick of a description: what a smooth unknown one reaches at points that it has not seen.

The discrepancy as a Gaussian process with one of the forms of covariance of `inference.gates` (Kennedy and O'Hagan
2001, Bayesian calibration of computer models), its amplitude the likeliest; left-out points in closed form.
"""

from __future__ import annotations

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.covariances import Groups
from toolpath_stiff.inference.discrepancies import POINT_TO_POINT, discrepancy_forms
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.hypotheses import AMPLITUDES

GENERAL = ("smooth over the workspace, different by direction", "linear over the workspace, different by direction")


def smooth_rms(problem: Problem, fit: Fit, form: str) -> float:
    """Rms of (modelled - measured) / measured at left-out points; nan with too few points.

    Of the likeliest form: `form`, the one that stands out most, in words, or what is smooth over the workspace.
    """
    points = Groups.by(problem.predictor.data.point)
    if points.count < 3:
        return float("nan")
    precision = fit.projected
    best: tuple[float, FloatArray, float] | None = None
    pull = precision.times(fit.residual)
    forms = discrepancy_forms(problem.predictor)
    for words in dict.fromkeys((form, *GENERAL)):
        if words not in forms or words == POINT_TO_POINT:  # of which nothing is known from another point
            continue
        features = forms[words]
        inner = precision.times(features.T) @ features
        values, turn = np.linalg.eigh(inner)
        turned = (turn.T @ (features.T @ pull)) ** 2
        squared = AMPLITUDES[:, None] ** 2 * np.maximum(values, 0.0)
        gains = 0.5 * (AMPLITUDES[:, None] ** 2 * turned / (1.0 + squared) - np.log1p(squared)).sum(axis=1)
        likeliest = int(np.argmax(gains))
        if best is None or gains[likeliest] > best[0]:
            best = float(gains[likeliest]), features, float(AMPLITUDES[likeliest])
    if best is None:
        return float("nan")
    _, features, amplitude = best
    whole = precision.beside(amplitude * features.T, np.eye(features.shape[1]))
    pulls, residual = whole.times(fit.residual), np.zeros(len(fit.residual))
    for out in points.members():
        residual[out] = np.linalg.solve(whole.block(out), pulls[out])
    return float(np.sqrt(np.mean(np.expm1(-residual) ** 2)))
