"""Least squares: normal equations, Gauss-Newton steps, and bounded quadratic minimisation."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from toolpath_stiff.arrays import FloatArray

At = TypeVar("At")  # the point at which a fit stands


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations at a point: jacobian (n, q) of ln k, information (q, q), gradient (q,), priors included."""

    jacobian: FloatArray
    information: FloatArray
    gradient: FloatArray

    @property
    def scale(self) -> FloatArray:
        """(q,) scales of the unknowns, whose units may be very different."""
        return np.sqrt(np.maximum(np.diag(self.information), 1e-300))


def gauss_newton(
    start: At,
    equations: Callable[[At], NormalEquations],
    move: Callable[[At, NormalEquations], tuple[At, FloatArray] | None],
    steps: int,
    tolerance: float,
) -> tuple[At, NormalEquations]:
    """Iterate least squares step by step, on tables (`evidence`) or with the model itself (`fits`).

    Parameters
    ----------
    start
        Where to begin, whatever `equations` and `move` understand.
    equations
        The normal equations at a point.
    move
        The next point and the step (q,) that was wanted; None where no step helps.
    steps, tolerance
        At most so many, and until a step is so small in standard deviations.

    Returns
    -------
    The last point, and the equations of the last step.
    """
    point = start
    for _ in range(steps):
        here = equations(point)
        moved = move(point, here)
        if moved is None:
            break
        point, step = moved
        if np.abs(step * here.scale).max() < tolerance:
            break
    return point, here


def scaled_inverse(matrix: FloatArray) -> FloatArray:
    """Inverse of a covariance or information matrix (p, p) whose rows may have very different units."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return np.asarray(np.linalg.pinv(matrix / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale))


def bounded_step(information: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """(p,) x between `low` <= 0 and `high` >= 0 that minimises x^T H x / 2 - g^T x.

    Bounded-variable least squares by active sets (Stark and Parker 1995, Computational Statistics 10, 129): what the
    free unknowns want is gone towards until the first of them meets its bound; a bound is left where that helps.
    """
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    matrix, pull = information / np.outer(scale, scale), gradient / scale
    low, high = low * scale, high * scale
    x, held = np.zeros(len(pull)), np.zeros(len(pull), dtype=bool)
    for _ in range(10 * len(pull)):
        free, wanted = np.flatnonzero(~held), x.copy()
        if len(free):
            rest = pull[free] - matrix[np.ix_(free, np.flatnonzero(held))] @ x[held]
            wanted[free] = np.linalg.pinv(matrix[np.ix_(free, free)], rcond=1e-12, hermitian=True) @ rest
        over = np.where(wanted > high, high, np.where(wanted < low, low, wanted))
        out = wanted != over
        if out.any():
            shares = np.where(out, (over - x) / np.where(out, wanted - x, 1.0), np.inf)
            first = int(np.argmin(shares))
            x = x + shares[first] * (wanted - x)
            x[first], held[first] = over[first], True
            continue
        x, slope = wanted, pull - matrix @ wanted  # downhill
        leave = np.where(held, np.where(x >= high, -slope, slope), 0.0)
        worst = int(np.argmax(leave))
        if leave[worst] <= 1e-12 * max(float(np.abs(pull).max()), 1e-300):
            break
        held[worst] = False
    return np.asarray(x / scale)
