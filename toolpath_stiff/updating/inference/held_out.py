"""Errors at points that the fit has not seen: each measuring point is left out in turn.

Leaving a point out moves law and sizes by one Gauss-Newton step from the full fit, with the covariance of the readings
that stay: exact for a linear model, good for the small moves that one point makes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.updating.inference.evidence import LAW_PRIOR
from toolpath_stiff.updating.inference.fit import Fit

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class HeldOut:
    """Residuals at left-out points.

    Attributes
    ----------
    residual
        (n,) ln measured - ln modelled, each by the fit without its point.
    moves
        (points, 2 + free) by how much law and sizes moved.
    point
        (n,) labels of the points.
    """

    residual: FloatArray
    moves: FloatArray
    point: NDArray[np.str_]

    @property
    def errors(self) -> FloatArray:
        """(n,) |modelled - measured| / measured."""
        return np.abs(np.expm1(-self.residual))

    @property
    def mean_error(self) -> float:
        """Mean of `errors`."""
        return float(self.errors.mean())

    @property
    def rms(self) -> float:
        """Root mean square of (modelled - measured) / measured."""
        return float(np.sqrt(np.mean(np.expm1(-self.residual) ** 2)))


def held_out(fit: Fit, point: NDArray[np.str_]) -> HeldOut:
    """Leave each point out in turn; with fewer than three points nothing can be left out and all is nan."""
    labels = np.unique(point)
    residual = np.full(len(fit.residual), np.nan)
    moves = np.zeros((len(labels), fit.jacobian.shape[1]))
    if len(labels) < 3:
        return HeldOut(residual, moves, point)
    prior = np.zeros((fit.jacobian.shape[1],) * 2)
    prior[:2, :2] = np.eye(2) * (1.0 / LAW_PRIOR**2 if fit.law_free else 1e12)
    scale = np.maximum(np.sqrt(np.diag(fit.jacobian.T @ fit.scatter.inverse @ fit.jacobian + prior)), 1e-300)
    for k, label in enumerate(labels):
        out = point == label
        inverse = _inverse_without(fit.scatter.inverse, out)
        columns = fit.jacobian[~out] / scale
        information = columns.T @ inverse @ columns + prior / np.outer(scale, scale)
        pull = columns.T @ (inverse @ fit.residual[~out])
        pull[:2] -= (prior[:2, :2] @ fit.law) / scale[:2]
        moves[k] = np.linalg.pinv(information, hermitian=True) @ pull / scale
        residual[out] = fit.residual[out] - fit.jacobian[out] @ moves[k]
    return HeldOut(residual, moves, point)


def _inverse_without(inverse: FloatArray, out: NDArray[np.bool_]) -> FloatArray:
    """Inverse of the covariance of the readings that stay, from the inverse of all: the Schur complement."""
    stay = ~out
    across = inverse[np.ix_(stay, out)]
    return np.asarray(inverse[np.ix_(stay, stay)] - across @ np.linalg.solve(inverse[np.ix_(out, out)], across.T))


def gain_in_standard_errors(before: HeldOut, after: HeldOut) -> float:
    """Mean fall of the held-out error over its standard error, paired by point; nan with fewer than three points."""
    labels = np.unique(before.point)
    falls = np.array([(before.errors - after.errors)[before.point == label].mean() for label in labels])
    if len(labels) < 3 or not np.isfinite(falls).all():
        return float("nan")
    error = float(falls.std(ddof=1)) / np.sqrt(len(falls))
    return float(falls.mean() / error) if error > 0.0 else 0.0
