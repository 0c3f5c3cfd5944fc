"""What SciPy has and costs more to load than a diagnosis takes: least values, cubic splines, tails of distributions.

`bounded_minimum` is Brent's search along a line, `bounded_step` the active sets of bounded-variable least squares.
`Spline` goes through a few knots, twice continuously differentiable, with a single cubic over each two end pieces (de
Boor 1978, A Practical Guide to Splines, chapter IV, "not-a-knot"); with three knots that is a parabola, with two a
line. `normal_below` and `surprise` are tails of the normal and of the chi-square distribution.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray

GOLDEN = 0.5 * (3.0 - np.sqrt(5.0))
ROOT_EPSILON = float(np.sqrt(np.finfo(float).eps))
MOST_EVALUATIONS = 500
MOST_TERMS = 10_000  # next to x = a about 6 sqrt(a) terms are needed
SMALL = 1e-15  # share that the terms left out may have
TOGETHER = 8  # terms between two looks at who needs more
LEAST = 1e-300


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
        found = function(trial)
        if found <= at_best:
            low, high = (best, high) if trial >= best else (low, best)
            third, at_third, second, at_second, best, at_best = second, at_second, best, at_best, trial, found
        else:
            low, high = (trial, high) if trial < best else (low, trial)
            if found <= at_second or second == best:
                third, at_third, second, at_second = second, at_second, trial, found
            elif found <= at_third or third in (best, second):
                third, at_third = trial, found
    return float(best)


def bounded_step(information: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """(p,) x between `low` <= 0 and `high` >= 0 at which x^T H x / 2 - g^T x is least.

    Bounded-variable least squares by active sets (Stark and Parker 1995, Computational Statistics 10, 129): what the
    free unknowns want is gone towards until the first of them meets its bound; a bound is left where that helps.
    """
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    matrix, pull = information / np.outer(scale, scale), gradient / scale
    low, high = low * scale, high * scale
    at, held = np.zeros(len(pull)), np.zeros(len(pull), dtype=bool)
    for _ in range(10 * len(pull)):
        free = np.flatnonzero(~held)
        wanted = at.copy()
        if len(free):
            rest = pull[free] - matrix[np.ix_(free, np.flatnonzero(held))] @ at[held]
            wanted[free] = np.linalg.pinv(matrix[np.ix_(free, free)], rcond=1e-12, hermitian=True) @ rest
        over = np.where(wanted > high, high, np.where(wanted < low, low, wanted))
        out = wanted != over
        if out.any():
            shares = np.where(out, (over - at) / np.where(out, wanted - at, 1.0), np.inf)
            first = int(np.argmin(shares))
            at = at + shares[first] * (wanted - at)
            at[first], held[first] = over[first], True
            continue
        at = wanted
        slope = pull - matrix @ at  # downhill
        leave = np.where(held, np.where(at >= high, -slope, slope), 0.0)
        worst = int(np.argmax(leave))
        if leave[worst] <= 1e-12 * max(float(np.abs(pull).max()), 1e-300):
            break
        held[worst] = False
    return np.asarray(at / scale)


@dataclass(frozen=True)
class Spline:
    """Values (g, n) and slopes (g, n) at knots (g,) in rising order."""

    knots: FloatArray
    values: FloatArray
    slopes: FloatArray

    @classmethod
    def through(cls, knots: FloatArray, values: FloatArray) -> Spline:
        """The spline through values (g, n) at knots (g,), at least two."""
        return cls(knots, values, _slopes(knots, values))

    def __call__(self, at: FloatArray) -> FloatArray:
        """(..., n) at positions (...,); beyond the ends the last pieces go on."""
        piece = np.clip(np.searchsorted(self.knots, at, side="right") - 1, 0, len(self.knots) - 2)
        step = (self.knots[piece + 1] - self.knots[piece])[..., None]
        share = (at - self.knots[piece])[..., None] / step
        rest = 1.0 - share
        start, end = self.values[piece], self.values[piece + 1]
        bend = rest * (self.slopes[piece] * step - (end - start)) - share * (
            self.slopes[piece + 1] * step - end + start
        )
        return np.asarray(start + share * ((end - start) + rest * bend))


def _slopes(knots: FloatArray, values: FloatArray) -> FloatArray:
    """(g, n) slopes that make second derivatives agree, and third ones next to the ends."""
    step = np.diff(knots)
    rise = np.diff(values, axis=0) / step[:, None]
    count = len(knots)
    if count == 2:
        return np.repeat(rise, 2, axis=0)
    if count == 3:
        middle = (step[1] * rise[0] + step[0] * rise[1]) / (step[0] + step[1])
        return np.stack([2.0 * rise[0] - middle, middle, 2.0 * rise[1] - middle])
    system, right = np.zeros((count, count)), np.zeros((count, values.shape[1]))
    inner = np.arange(1, count - 1)
    system[inner, inner - 1] = step[1:]
    system[inner, inner] = 2.0 * (step[:-1] + step[1:])
    system[inner, inner + 1] = step[:-1]
    right[1:-1] = 3.0 * (step[1:, None] * rise[:-1] + step[:-1, None] * rise[1:])
    for end, near, (first, second) in ((0, 1, (0, 1)), (-1, -2, (-1, -2))):
        both = step[first] + step[second]
        system[end, end], system[end, near] = step[second], both
        right[end] = ((step[first] + 2.0 * both) * step[second] * rise[first] + step[first] ** 2 * rise[second]) / both
    return np.asarray(np.linalg.solve(system, right))


def normal_below(x: float) -> float:
    """P(X < x) of a standard normal variable."""
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


def surprise(value: FloatArray, freedom: FloatArray) -> FloatArray:
    """(s, k) -ln P(chi-square of `freedom` (k,) > value (s, k)), not rounded to infinity far out.

    P is the incomplete gamma function Q(a, x), a = freedom / 2, x = value / 2: by the series of 1 - Q below x = a + 1,
    by its continued fraction above (NIST Digital Library of Mathematical Functions, 8.11.4 and 8.9.2).
    """
    x = np.maximum(0.5 * value, LEAST)
    a = np.broadcast_to(0.5 * freedom, x.shape)
    log_gamma = np.array([math.lgamma(half) if half > 0.0 else math.inf for half in (0.5 * freedom).tolist()])
    front = np.broadcast_to(log_gamma, x.shape) + x - a * np.log(x)  # -ln(x^a e^-x / Gamma(a))
    near = x < a + 1.0
    found = np.empty(x.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        found[near] = -np.log1p(-np.minimum(_series(a[near], x[near]) * np.exp(-front[near]), 1.0))
    found[~near] = front[~near] - np.log(_fraction(a[~near], x[~near]))
    return np.where(np.isnan(found), np.inf, found)  # no degrees of freedom: any value is too much


def _series(a: FloatArray, x: FloatArray) -> FloatArray:
    """(m,) sum over k of x^k / (a (a + 1) .. (a + k))."""
    with np.errstate(divide="ignore"):
        term = 1.0 / a
    total = term.copy()
    rows = np.arange(len(x))  # where there is more to add
    for k in range(1, MOST_TERMS):
        term = term * (x / (a + k))
        total[rows] += term
        if k % TOGETHER == 0:
            more = term > SMALL * total[rows]
            rows, term, a, x = rows[more], term[more], a[more], x[more]
            if not len(rows):
                break
    return total


def _fraction(a: FloatArray, x: FloatArray) -> FloatArray:
    """(m,) 1 / (x + 1 - a - 1 (1 - a) / (x + 3 - a - 2 (2 - a) / (x + 5 - a - ..))).

    Forwards, by the ratios of successive numerators and denominators (Lentz 1976, Applied Optics 15, 668); none of
    them is 0 where x > a + 1.
    """
    below = x + 1.0 - a
    inverse = 1.0 / below
    total, ratio = inverse.copy(), np.full(x.shape, np.inf)
    rows = np.arange(len(x))  # where it still changes
    for k in range(1, MOST_TERMS):
        share = k * (a - k)
        below = below + 2.0
        inverse = 1.0 / (below + share * inverse)
        ratio = below + share / ratio
        factor = inverse * ratio
        total[rows] *= factor
        if k % TOGETHER == 0:
            more = np.abs(factor - 1.0) > SMALL
            rows, a, below, inverse, ratio = rows[more], a[more], below[more], inverse[more], ratio[more]
            if not len(rows):
                break
    return total
