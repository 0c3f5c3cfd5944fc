"""Small searches and splines against a general-purpose library."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import lsq_linear

from toolpath_stiff.inference.candidates import spline
from toolpath_stiff.inference.least_squares import bounded_step


def test_bounded_steps_are_bounded_variable_least_squares() -> None:
    rng = np.random.default_rng(0)
    for _ in range(100):
        count = int(rng.integers(2, 7))
        matrix, right = rng.standard_normal((12, count)), rng.standard_normal(12)
        low, high = -rng.random(count) * rng.integers(0, 2, count) - 1e-9, rng.random(count)
        low[0], high[0] = -np.inf, np.inf
        # Units that are many orders of magnitude apart.
        unit = 10.0 ** rng.uniform(-9.0, 9.0, count)
        wanted = lsq_linear(matrix, right, (low, high), method="bvls").x
        scaled = matrix / unit
        found = bounded_step(scaled.T @ scaled, scaled.T @ right, low * unit, high * unit)
        assert found / unit == pytest.approx(wanted, abs=1e-10)


@pytest.mark.parametrize("count", [2, 3, 4, 9])
def test_splines_are_not_a_knot_splines(count: int) -> None:
    rng = np.random.default_rng(count)
    knots, values = np.sort(rng.random(count)) + np.arange(count), rng.random((count, 3))
    at = rng.uniform(knots[0] - 0.1, knots[-1] + 0.1, (5, 7))
    assert spline(knots, values)(at) == pytest.approx(CubicSpline(knots, values)(at), abs=1e-12)
