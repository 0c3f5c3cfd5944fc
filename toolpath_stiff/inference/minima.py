"""Least values of small problems, without loading an optimiser for each of them.

`bounded_minimum` is Brent's search along a line, `bounded_step` the active sets of bounded-variable least squares. The
package has both at hand nowhere else, and importing them costs as much as a diagnosis spends on its gates.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from toolpath_stiff.arrays import FloatArray

GOLDEN = 0.5 * (3.0 - np.sqrt(5.0))


ROOT_EPSILON = float(np.sqrt(np.finfo(float).eps))


MOST_EVALUATIONS = 500


def bounded_minimum(function: Callable[[float], float], low: float, high: float, tolerance: float = 1e-5) -> float:
    """Where a function of one variable is least between two ends, by golden sections and parabolas.

    Brent 1973, Algorithms for Minimization without Derivatives, chapter 5 (`localmin`).
    """
    best = second = third = low + GOLDEN * (high - low)
    at_best = at_second = at_third = function(best)
    step = before = 0.0
    for _ in range(MOST_EVALUATIONS):
        middle = 0.5 * (low + high)
        least = ROOT_EPSILON * abs(best) + tolerance / 3.0
        if abs(best - middle) <= 2.0 * least - 0.5 * (high - low):
            break
        parabola = False
        if abs(before) > least:
            r = (best - second) * (at_best - at_third)
            q = (best - third) * (at_best - at_second)
            p = (best - third) * q - (best - second) * r
            q = 2.0 * (q - r)
            p, q = (-p, q) if q > 0.0 else (p, -q)
            before, last = step, before
            if abs(p) < abs(0.5 * q * last) and q * (low - best) < p < q * (high - best):
                parabola, step = True, p / q
                if min(best + step - low, high - best - step) < 2.0 * least:
                    step = least if middle >= best else -least
        if not parabola:
            before = (low if best >= middle else high) - best
            step = GOLDEN * before
        trial = best + (step if abs(step) >= least else least if step >= 0.0 else -least)
        value = function(trial)
        if value <= at_best:
            low, high = (best, high) if trial >= best else (low, best)
            third, at_third, second, at_second, best, at_best = second, at_second, best, at_best, trial, value
        else:
            low, high = (trial, high) if trial < best else (low, trial)
            if value <= at_second or second == best:
                third, at_third, second, at_second = second, at_second, trial, value
            elif value <= at_third or third in (best, second):
                third, at_third = trial, value
    return float(best)


def bounded_step(information: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """(p,) x between `low` <= 0 and `high` >= 0 at which x^T H x / 2 - g^T x is least.

    Bounded-variable least squares by active sets (Stark and Parker 1995, Computational Statistics 10, 129): what the
    free unknowns want is gone towards until the first of them meets its bound; a bound is left where that helps.
    """
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    matrix, pull = information / np.outer(scale, scale), gradient / scale
    low, high = low * scale, high * scale
    x, held = np.zeros(len(pull)), np.zeros(len(pull), dtype=bool)
    for _ in range(10 * len(pull)):
        free = np.flatnonzero(~held)
        wanted = x.copy()
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
        x = wanted
        slope = pull - matrix @ x  # downhill
        leave = np.where(held, np.where(x >= high, -slope, slope), 0.0)
        worst = int(np.argmax(leave))
        if leave[worst] <= 1e-12 * max(float(np.abs(pull).max()), 1e-300):
            break
        held[worst] = False
    return np.asarray(x / scale)
