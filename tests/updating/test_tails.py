"""Surprises of forms of discrepancy: chi-squares as normal deviates."""

import numpy as np
import pytest
from scipy.stats import chi2, norm

from toolpath_stiff.inference.gates import surprise


def test_surprise_is_the_normal_deviate_of_a_chi_square():
    freedom, chances = np.array([2.0, 3.0, 8.0, 40.0, 900.0]), np.array([0.5, 0.1, 0.01, 1e-4])
    values = chi2.isf(chances[:, None], freedom)
    assert surprise(values, freedom) == pytest.approx(norm.isf(chances)[:, None] * np.ones(5), abs=0.12)
    rising = surprise(np.geomspace(1e-3, 1e5, 50)[:, None], np.array([0.3, 1.0, 900.0]))
    assert (np.diff(rising, axis=0) > 0.0).all()  # nowhere rounded to infinity, however far out


def test_no_freedom_is_surprised_by_anything():
    assert np.isinf(surprise(np.array([[0.0], [1.0]]), np.array([0.0]))).all()
