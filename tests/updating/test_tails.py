"""The tail of chi-square against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from toolpath_stiff.inference.gates import surprise


def test_surprise_is_the_tail_of_chi_square_even_where_it_underflows():
    freedom = np.array([0.3, 0.7, 1.0, 2.0, 3.0, 40.0, 900.0])
    ratio = np.array([0.0, 1e-3, 0.1, 0.9, 1.0, 1.01, 1.2, 3.0, 20.0])
    values = ratio[:, None] * freedom
    expected = -chi2.logsf(values, freedom)
    known = expected < 300.0  # beyond, SciPy's own is rough
    assert surprise(values, freedom)[known] == pytest.approx(expected[known], rel=1e-10, abs=1e-14)
    far = np.array([[1500.0], [3000.0]])  # with 4 degrees of freedom the tail is exp(-x / 2) (1 + x / 2)
    assert surprise(far, np.array([4.0])) == pytest.approx(0.5 * far - np.log1p(0.5 * far), rel=1e-14)


def test_no_freedom_is_surprised_by_anything():
    assert np.isinf(surprise(np.array([[0.0], [1.0]]), np.array([0.0]))).all()
