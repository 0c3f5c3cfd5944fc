"""The tail of the chi-square distribution.

SciPy has it, but loading it takes longer than all the tests of a diagnosis.
"""

import math

import numpy as np

from toolpath_stiff.arrays import FloatArray

MOST_TERMS = 10_000  # next to x = a about 6 sqrt(a) terms are needed


SMALL = 1e-15  # share that the terms left out may have


TOGETHER = 8  # terms between two looks at whether more are needed


LEAST = 1e-300


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
    surprises = np.empty(x.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        surprises[near] = -np.log1p(-np.minimum(_series(a[near], x[near]) * np.exp(-front[near]), 1.0))
    surprises[~near] = front[~near] - np.log(_fraction(a[~near], x[~near]))
    return np.where(np.isnan(surprises), np.inf, surprises)  # no degrees of freedom: any value is too much


def _series(a: FloatArray, x: FloatArray) -> FloatArray:
    """(m,) sum over k of x^k / (a (a + 1) .. (a + k))."""
    with np.errstate(divide="ignore"):
        term = 1.0 / a
    total = term.copy()
    for k in range(1, MOST_TERMS):
        term = term * (x / (a + k))
        total += term
        if k % TOGETHER == 0 and not (term > SMALL * total).any():
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
    for k in range(1, MOST_TERMS):
        share, below = k * (a - k), below + 2.0
        inverse, ratio = 1.0 / (below + share * inverse), below + share / ratio
        total *= inverse * ratio
        if k % TOGETHER == 0 and not (np.abs(inverse * ratio - 1.0) > SMALL).any():
            break
    return total
