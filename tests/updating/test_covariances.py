"""Covariances by their structure, against the same matrices written out in full."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from tests.updating.cases import campaign, dense, predictor_for, simple_noise
from toolpath_stiff.comparison.structure import EXCESSES, Scattering, _Fit
from toolpath_stiff.inference.covariances import Covariance, Groups, inverse_root
from toolpath_stiff.inference.discrepancies import discrepancy_forms
from toolpath_stiff.inference.noise import Scatter

FloatArray = NDArray[np.float64]


@st.composite
def covariances(draw: st.DrawFn) -> tuple[Covariance, FloatArray, np.random.Generator]:
    """Of 1 to 20 readings in up to 6 groups with up to 4 nuisances in common, and the same (n, n) by its definition."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    n, q = draw(st.integers(1, 20)), draw(st.integers(0, 4))
    groups = draw(st.lists(st.sampled_from("abcdef"), min_size=n, max_size=n))
    common = draw(st.sampled_from([0.0, 0.01, 1.0, 25.0]))
    own, shared = rng.uniform(0.2, 2.0, n), rng.normal(size=(q, n)) * draw(st.sampled_from([0.0, 0.1, 1.0, 10.0]))
    whole = np.array([[(own[i] if i == j else 0.0) + common * (groups[i] == groups[j]) + shared[:, i] @ shared[:, j]
                       for j in range(n)] for i in range(n)])  # fmt: skip
    return Covariance(own, Groups.by(np.array(groups)), common, shared), whole, rng


@settings(max_examples=60, deadline=None)
@given(covariances())
def test_covariance_and_its_inverse_are_those_of_the_matrix_written_out(case):
    covariance, whole, rng = case
    n = len(whole)
    rows, inverse = rng.normal(size=(3, n)), np.linalg.inv(whole)
    found, tiny = covariance.precision, 1e-8 * np.abs(inverse).max()
    assert dense(covariance) == pytest.approx(whole, rel=1e-12)
    assert covariance.diagonal == pytest.approx(np.diag(whole), rel=1e-12)
    assert covariance.squares(rows) == pytest.approx(np.diag(rows @ whole @ rows.T), rel=1e-9)
    assert found.times(rows) == pytest.approx(rows @ inverse, rel=1e-7, abs=tiny)
    assert found.squares(rows) == pytest.approx(np.diag(rows @ inverse @ rows.T), rel=1e-7, abs=tiny)
    assert found.diagonal == pytest.approx(np.diag(inverse), rel=1e-7, abs=tiny)
    some = rng.permutation(n)[: rng.integers(1, n + 1)]
    assert found.block(some) == pytest.approx(inverse[np.ix_(some, some)], rel=1e-7, abs=tiny)


@settings(max_examples=40, deadline=None)
@given(covariances())
def test_readings_widened_one_by_one_have_the_inverse_of_the_matrix_written_out(case):
    covariance, whole, rng = case
    step_by_step = covariance.precision
    for row in rng.integers(0, len(whole), 6).tolist():
        more = rng.uniform(0.1, 5.0)
        step_by_step, _, _ = step_by_step.widened(row, more)
        whole[row, row] += more
        inverse = np.linalg.inv(whole)
        columns = step_by_step.times(np.eye(len(whole)))
        assert columns == pytest.approx(inverse, rel=1e-6, abs=1e-7 * np.abs(inverse).max())


@settings(max_examples=30, deadline=None)
@given(covariances())
def test_the_log_likelihood_is_that_of_the_multivariate_normal(case):
    covariance, whole, rng = case
    residual = rng.multivariate_normal(np.zeros(len(whole)), whole, method="cholesky")
    scatter = Scatter.of(simple_noise(len(whole)), covariance)
    expected = multivariate_normal(np.zeros(len(whole)), whole).logpdf(residual)
    found = float(scatter.log_likelihood(residual)) - 0.5 * len(whole) * np.log(2.0 * np.pi)
    assert found == pytest.approx(expected, rel=1e-8, abs=1e-8)


@settings(max_examples=30, deadline=None)
@given(covariances(), st.integers(1, 3))
def test_what_a_fit_leaves_is_known_as_by_generalised_least_squares(case, unknowns):
    """r^T P r is the smallest misfit over the unknowns; of any residuals, with a prior on the first."""
    covariance, whole, rng = case
    fitted = rng.normal(size=(unknowns, len(whole)))
    prior = np.diag(np.arange(unknowns) == 0).astype(float) * 4.0 + 1e-9 * np.eye(unknowns)
    left = covariance.precision.beside(fitted, prior)
    residual = rng.normal(size=len(whole))
    root = np.linalg.inv(np.linalg.cholesky(whole))
    design = np.concatenate([root @ fitted.T, np.sqrt(prior)])
    target = np.concatenate([root @ residual, np.zeros(unknowns)])
    best = np.linalg.lstsq(design, target, rcond=None)[0]
    expected = float(((target - design @ best) ** 2).sum())
    size = float((target**2).sum())
    assert left.squares(residual) == pytest.approx(expected, rel=1e-6, abs=1e-7 * size)
    # The rows of the fit itself: last among the factors, and known by the unknowns that they combine.
    assert left.factors[-len(left.fitted) :] == pytest.approx(covariance.precision.times(left.fitted))


def test_wider_scatter_of_some_readings_is_theirs_alone():
    covariance = Covariance(np.full(5, 2.0), Groups.by(np.array([0, 0, 1, 1, 1])), 0.5, np.ones((1, 5)))
    wider = covariance.widened(np.array([3]), np.array([7.0]))
    assert (dense(wider) - dense(covariance)).tolist() == np.diag([0.0, 0.0, 0.0, 7.0, 0.0]).tolist()


def test_common_scatter_is_drawn_with_its_covariance():
    """20,000 draws: each element within five standard errors, by the variance of products of normal numbers."""
    rng = np.random.default_rng(0)
    covariance = Covariance(np.full(6, 1.0), Groups.by(np.array([0, 0, 1, 1, 2, 0])), 0.5, rng.normal(size=(2, 6)))
    expected = dense(covariance) - np.eye(6)
    found = covariance.draw(np.random.default_rng(1), 20_000)
    error = np.sqrt((np.outer(np.diag(expected), np.diag(expected)) + expected**2) / 20_000)
    assert np.abs(found.T @ found / 20_000 - expected).max() < 5.0 * error.max()
    assert np.array_equal(found, covariance.draw(np.random.default_rng(1), 20_000))


def test_an_information_without_a_number_for_some_unknown_has_a_root_all_the_same():
    root = inverse_root(np.diag([4.0, 0.0, 1e-12]))
    assert root @ root.T == pytest.approx(np.diag([0.25, 0.0, 1e12]))


# -- forms of discrepancy ----------------------------------------------------------------------------------------------


def written_out(position: FloatArray, angles: FloatArray, direction: FloatArray) -> FloatArray:
    """Smooth over the workspace, different by direction, pair by pair: 250 mm and 15 degrees to one sd."""
    n = len(position)
    found = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            apart = ((position[i] - position[j]) ** 2).sum() / 0.25**2
            turned = (np.degrees(angles[i] - angles[j]) ** 2).sum() / 15.0**2
            found[i, j] = np.exp(-0.5 * (apart + turned)) * float(direction[i] @ direction[j]) ** 2
    return found


def test_features_of_a_form_are_those_of_its_covariance():
    data = campaign(31, "paper")[0]
    forms = discrepancy_forms(predictor_for(data))
    features = forms["smooth over the workspace, different by direction"]
    expected = written_out(data.position, data.angles, data.direction)
    assert features @ features.T == pytest.approx(expected, abs=1e-8)
    for words, found in forms.items():
        assert np.mean((found**2).sum(axis=1)) == pytest.approx(1.0, abs=1e-8), words
        assert found.shape[1] <= len(data)


# -- the scatter of a comparison ---------------------------------------------------------------------------------------


def test_residuals_are_weighed_as_by_the_whole_covariance():
    """By t = x' V^-1 r / sqrt(x' V^-1 x) with V = S + tau^2 Z Z' written out; x free of a column found before."""
    rng = np.random.default_rng(4)
    n = 24
    clamp, place = np.repeat(np.arange(6), 4).astype(str), np.tile(np.repeat(np.arange(6), 2), 2)
    covariance = Covariance(rng.uniform(1e-4, 4e-4, n), Groups.by(clamp), 2e-4, 0.01 * rng.normal(size=(3, n)))
    scattering = Scattering(simple_noise(n, 0.015, 0.014), covariance, clamp, place, 50, seed=1)
    columns, base = rng.normal(size=(5, n)), rng.normal(size=(2, n))
    fit = _Fit(scattering, columns, base)
    residual = 0.01 * rng.normal(size=(1, n))
    rows = fit._weighed(residual)
    for grid in (0, 7, 23):
        inverse = np.linalg.inv(dense(covariance) + EXCESSES[grid] ** 2 * (place[:, None] == place))
        free = columns.T - base.T @ np.linalg.solve(base @ inverse @ base.T, base @ inverse @ columns.T)
        expected = free.T @ inverse @ residual[0] / np.sqrt(np.einsum("ni,nm,mi->i", free, inverse, free))
        found = fit._with_columns(rows, grid) @ fit.free(grid)[0]
        assert found == pytest.approx(expected[None], rel=1e-8, abs=1e-10)
        left = residual[0] - base.T @ np.linalg.solve(base @ inverse @ base.T, base @ inverse @ residual[0])
        assert fit._squares(rows, grid) == pytest.approx([left @ inverse @ left], rel=1e-8)


def test_ten_thousand_readings_need_no_matrix_of_their_size():
    """A day's repeats of one point, clamped once: nothing here holds 10,000 x 10,000 numbers (800 MB)."""
    n = 10_000
    covariance = Covariance(np.full(n, 4e-4), Groups.by(np.zeros(n)), 1e-4, np.full((1, n), 0.01))
    scattering = Scattering(simple_noise(n), covariance, np.full(n, "1"), np.zeros(n, dtype=np.int64), 3, seed=0)
    # The mean scatters by clamping, nuisance and a ten-thousandth of the readings' own variance.
    mean = np.full(n, 1.0 / n)
    assert covariance.squares(mean) == pytest.approx(1e-4 + 1e-4 + 4e-4 / n)
    assert 1.0 / covariance.precision.squares(np.ones(n)) == pytest.approx(1e-4 + 1e-4 + 4e-4 / n)
    assert scattering.of_places.shape == (1, n)
