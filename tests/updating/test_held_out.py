"""Errors at left-out points, against honest refits without the point."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from tests.conftest import seeds
from tests.stiffness.cases import nist
from tests.updating.cases import campaign, dense, make_problem, selected, simple_noise
from toolpath_stiff.inference.candidates import candidates_of
from toolpath_stiff.inference.covariances import Covariance, Groups
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import fit_effects
from toolpath_stiff.inference.left_out import gain_in_standard_errors, held_out, products_without
from toolpath_stiff.inference.noise import Scatter
from toolpath_stiff.stiffness.catalogue import find_effect

DATA = campaign(21, "paper", "weak_strut", 0.06)[0]
NOISE = simple_noise(len(DATA), 0.02, 0.01, 0.01, 0.5e-3)
PROBLEM = make_problem(nist(), DATA, NOISE)[0]


def fit(problem: Problem, name: str | None = "weak_strut") -> Fit:
    if name is None:
        return fit_effects(problem, (), (), (), np.zeros(2))
    base = problem.score_base()
    from toolpath_stiff.inference.hypotheses import score_family

    best = score_family(problem, find_effect(name), base).best
    return fit_effects(problem, best.candidates, best.sizes, best.free, best.law)


def honest(whole: Fit) -> np.ndarray:
    """(42,) residuals of fits that never saw the point, each a problem of its own."""
    residual = np.empty(len(DATA))
    for label in np.unique(DATA.point):
        out = DATA.point == label
        rest = make_problem(nist(), DATA.select(~out), NOISE.select(~out))[0]
        # The same joint positions and struts are uncertain: the covariance of the readings that stay.
        rest = Problem(rest.predictor, Scatter.of(NOISE.select(~out), selected(PROBLEM.scatter.covariance, ~out)))
        again = fit_effects(rest, whole.candidates, whole.sizes, whole.free, whole.law)
        residual[out] = (PROBLEM.observed - PROBLEM.predictor.log_stiffness(again.law, again.effects))[out]
    return residual


@pytest.mark.parametrize("name", [None, "weak_strut", "table_compliance"])
def test_left_out_errors_are_those_of_refits_without_the_point(name):
    """One Gauss-Newton step against the full fit, on moves of a few per cent: right within a tenth of the noise."""
    whole = fit(PROBLEM, name)
    found = held_out(whole, DATA.point)
    refitted = honest(whole)
    assert np.abs(found.residual - refitted).max() < 0.002
    assert found.mean_error == pytest.approx(np.abs(np.expm1(-refitted)).mean(), rel=0.02)
    assert found.rms == pytest.approx(np.sqrt(np.mean(np.expm1(-refitted) ** 2)), rel=0.02)


def test_every_left_out_fit_moves():
    """The trap: parameters in N/m do not move at all, and the held-out error is the fitted one."""
    whole = fit(PROBLEM)
    found = held_out(whole, DATA.point)
    deviations = np.sqrt(np.diag(whole.covariance))
    moved = np.abs(found.moves / deviations).max(axis=1)
    assert moved.min() > 1e-3 and 0.2 < moved.max() < 5.0
    assert found.mean_error > whole.errors.mean()
    assert not np.allclose(found.residual, whole.residual)


def test_more_parameters_look_better_fitted_than_held_out():
    """Where nothing is missing, an effect of four parameters lowers the fitted error, not the held-out one."""
    better = []
    for seed in seeds(60, 66):
        data = campaign(seed, "paper")[0]
        problem = make_problem(nist(), data, NOISE)[0]
        base = fit(problem, None)
        table = candidates_of(find_effect("table_compliance"), data)
        more = fit_effects(problem, table, [np.array([1e-9, 1e-9, 1e-9, 1e-10])], (0, 1, 2, 3), np.zeros(2))
        weighed = [float(problem.scatter.precision.squares(f.residual)) for f in (base, more)]
        assert weighed[1] <= weighed[0] + 0.1
        before, after = held_out(base, data.point), held_out(more, data.point)
        better.append(gain_in_standard_errors(before, after))
    assert sum(np.array(better) > 1.0) <= 4  # by chance one in six: 5 of 6 once in 2,000 times


def test_products_of_what_stays_are_those_of_its_own_covariance():
    """Points of one to five readings, clampings across points: generalised least squares of the rest, inverted anew."""
    rng = np.random.default_rng(0)
    covariance = Covariance(rng.uniform(0.5, 2.0, 12), Groups.by(rng.integers(0, 4, 12)), 0.7, rng.normal(size=(3, 12)))
    points = Groups.by(np.array([0, 1, 2, 1, 0, 1, 2, 2, 2, 2, 3, 0]))
    columns, residual = rng.normal(size=(12, 2)), rng.normal(size=12)
    count = 0
    for which, left_out, products in products_without(covariance.precision, columns, residual, points):
        for label, out, found in zip(which, left_out, products, strict=True):
            assert out.tolist() == np.flatnonzero(points.of == label).tolist()
            stay = np.setdiff1d(np.arange(12), out)
            weighted = columns[stay].T @ np.linalg.inv(dense(covariance)[np.ix_(stay, stay)])
            assert found[:, :2] == pytest.approx(weighted @ columns[stay], rel=1e-9)
            assert found[:, 2] == pytest.approx(weighted @ residual[stay], rel=1e-9)
            count += len(out)
    assert count == 12


def test_the_gain_is_a_paired_t_statistic_over_points():
    base, weak = held_out(fit(PROBLEM, None), DATA.point), held_out(fit(PROBLEM), DATA.point)
    labels = np.unique(DATA.point)
    falls = [base.errors[DATA.point == p].mean() - weak.errors[DATA.point == p].mean() for p in labels]
    assert gain_in_standard_errors(base, weak) == pytest.approx(ttest_1samp(falls, 0.0).statistic, rel=1e-9)
    assert gain_in_standard_errors(base, weak) > 2.0
    assert gain_in_standard_errors(weak, base) == pytest.approx(-gain_in_standard_errors(base, weak), rel=1e-9)
    rounded = replace(weak, residual=weak.residual + 1e-15 * np.arange(len(weak.residual)))
    assert gain_in_standard_errors(base, base) == gain_in_standard_errors(weak, rounded) == 0.0


def test_two_points_cannot_be_left_out():
    whole = fit(PROBLEM, None)
    two = np.where(np.arange(len(DATA)) < 21, "A", "B")
    found = held_out(whole, two)
    assert np.isnan(found.residual).all() and np.isnan(gain_in_standard_errors(found, found))


def test_labels_may_stand_in_any_order():
    whole = fit(PROBLEM)
    renamed = replace(DATA, point=np.array([f"point {ord('z') - int(p)}" for p in DATA.point]))
    assert held_out(whole, renamed.point).residual == pytest.approx(held_out(whole, DATA.point).residual, rel=1e-12)
