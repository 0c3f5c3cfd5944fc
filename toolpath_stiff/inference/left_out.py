"""Residuals at points left out of a fit in turn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray, TextArray
from toolpath_stiff.inference.covariances import Groups, Precision
from toolpath_stiff.inference.evidence import Fit, law_prior, relative_errors

SAME_ERROR = 1e-10  # relative, of a stiffness; rounding makes 1e-14


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
    linear
        As of `Fit`.
    """

    residual: FloatArray
    moves: FloatArray
    point: TextArray
    linear: bool = False

    @property
    def errors(self) -> FloatArray:
        """(n,) |modelled - measured| / measured."""
        return np.abs(relative_errors(self.residual, self.linear))

    def of_readings(self, rows: BoolArray) -> HeldOut:
        """Held-out residuals of some of the readings."""
        return HeldOut(self.residual[rows], self.moves, self.point[rows], self.linear)

    @property
    def mean_error(self) -> float:
        """Mean of `errors`."""
        return float(self.errors.mean())

    @property
    def rms(self) -> float:
        """Root mean square of (modelled - measured) / measured."""
        return float(np.sqrt(np.mean(relative_errors(self.residual, self.linear) ** 2)))


def of_readings(fit: Fit, rows: BoolArray) -> Fit:
    """A fit with the residuals of some of its readings only: for counting errors, not for further fitting."""
    return fit if rows.all() else replace(fit, residual=fit.residual[rows], jacobian=fit.jacobian[rows])


def held_out(fit: Fit, point: TextArray) -> HeldOut:
    """Residuals with each point left out in turn; all nan with fewer than three points."""
    points = Groups.by(point)
    residual = np.full(len(fit.residual), np.nan)
    moves = np.zeros((points.count, fit.jacobian.shape[1]))
    if points.count < 3:
        return HeldOut(residual, moves, point, fit.linear)
    precision, prior = fit.scatter.precision, law_prior(fit.jacobian.shape[1], fit.law_free)
    scale = np.sqrt(np.maximum(precision.squares(fit.jacobian.T) + np.diag(prior), 1e-300))
    for which, out, products in products_without(precision, fit.jacobian / scale, fit.residual, points):
        pull = products[..., -1]
        pull[:, :2] -= (prior[:2, :2] @ fit.law) / scale[:2]
        information = products[..., :-1] + prior / np.outer(scale, scale)
        moves[which] = (np.linalg.pinv(information, hermitian=True) @ pull[..., None])[..., 0] / scale
        residual[out] = fit.residual[out] - (fit.jacobian[out] @ moves[which][..., None])[..., 0]
    return HeldOut(residual, moves, point, fit.linear)


def products_without(
    precision: Precision, columns: FloatArray, residual: FloatArray, points: Groups
) -> Iterator[tuple[IntArray, IntArray, FloatArray]]:
    """Products with each point left out in turn, by point size k: the points (m,), their readings (m, k), products.

    The products are (m, p, p + 1) J^T A [J, r] of the readings that stay. Their inverse covariance is the Schur
    complement A_ss - A_so A_oo^-1 A_os of the inverse covariance of all, of which the products need the readings that
    are left out only: J^T A J - (A J)_o^T A_oo^-1 (A J)_o.
    """
    solved = precision.times(np.concatenate([columns.T, residual[None]]))
    whole = solved[:-1] @ np.concatenate([columns, residual[:, None]], axis=1)
    for which, out in points.by_size():
        part = np.moveaxis(solved[:, out], 0, 1)  # (m, p + 1, k)
        yield which, out, whole - part[:, :-1] @ np.linalg.solve(precision.block(out), np.swapaxes(part, 1, 2))


def error_falls(before: HeldOut, after: HeldOut) -> FloatArray:
    """(n,) fall of each reading's held-out error; 0 if it is within rounding, whose sign depends on the processor."""
    falls = before.errors - after.errors
    return np.asarray(np.where(np.abs(falls) < SAME_ERROR, 0.0, falls))


def gain_in_standard_errors(before: HeldOut, after: HeldOut) -> float:
    """Mean fall of the held-out error over its standard error, paired by point; nan with fewer than three points."""
    labels, fallen = np.unique(before.point), error_falls(before, after)
    falls = np.array([fallen[before.point == label].mean() for label in labels])
    if len(labels) < 3 or not np.isfinite(falls).all():
        return float("nan")
    error = float(falls.std(ddof=1)) / np.sqrt(len(falls))
    return float(falls.mean() / error) if error > 0.0 else 0.0
