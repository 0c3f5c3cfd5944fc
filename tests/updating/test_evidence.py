"""Fits and their marginal likelihoods, against brute force on a hexapod whose compliance is known by hand.

The orthogonal hexapod of `tests.stiffness.cases`: a compliance c in series with every strut adds c / 2 to the tip's
along any direction (two struts share the load), a table's t_x adds t_x d_x^2.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize
from scipy.special import logsumexp

from tests.conftest import as_written
from tests.stiffness.cases import nist, orthogonal_hexapod
from tests.updating.cases import (
    campaign,
    correlated_covariance,
    make_problem,
    oblique_directions,
    orthogonal_compliance,
    readings_by_hand,
    simple_noise,
)
from toolpath_stiff.diagnosis.examination import fitted_sizes
from toolpath_stiff.inference.candidates import CandidateTable, candidates_of, tabulate
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit, Problem
from toolpath_stiff.inference.hypotheses import probabilities, score_families, score_family
from toolpath_stiff.stiffness.catalogue import find_effect

FloatArray = NDArray[np.float64]

COUNT = 24
DIRECTION = oblique_directions(COUNT, seed=3)
SHARED = as_written(8).normal(size=(COUNT, 3)) * 0.01  # scatter that readings have in common
COVARIANCE = np.diag(np.full(COUNT, 0.02**2)) + SHARED @ SHARED.T


def logs_by_hand(first: float = 0.0, second: float = 0.0, joint: float = 0.0, table_x: float = 0.0) -> FloatArray:
    compliance = orthogonal_compliance(DIRECTION, first, second)
    return np.asarray(-np.log(compliance + 0.5 * joint + table_x * DIRECTION[:, 0] ** 2))


def scatter(seed: int) -> FloatArray:
    return np.random.default_rng(seed).multivariate_normal(np.zeros(COUNT), COVARIANCE, method="cholesky")


def by_hand(logs: FloatArray, outliers: float = 0.0, scale: float = 1.0) -> Problem:
    """The problem of explaining readings (24,) of ln k; `scale`: of the scatter that it reckons with."""
    from toolpath_stiff.inference.noise import Scatter
    from toolpath_stiff.inference.prediction import Predictor

    predictor = Predictor(orthogonal_hexapod(), readings_by_hand(np.exp(logs), direction=DIRECTION))
    spread = correlated_covariance(np.full(COUNT, (scale * 0.02) ** 2), scale * SHARED)
    return Problem(predictor, Scatter.of(simple_noise(COUNT, scale * 0.02, outliers=outliers), spread))


def table_of(problem: Problem, name: str) -> CandidateTable:
    (candidate,) = candidates_of(find_effect(name), problem.predictor.data)
    table = tabulate(candidate, problem.predictor, np.zeros(2))
    assert table is not None
    return table


def scored(problem: Problem, table: CandidateTable, base: Fit) -> Fit:
    """The fit of an effect of one parameter."""
    fit = problem.score_subset([table], (0,), base)
    assert fit is not None
    return fit


def minus_half_square(residual: FloatArray) -> FloatArray:
    """(...,) -r^T V^-1 r / 2 - ln |V| / 2."""
    inverse = np.linalg.inv(COVARIANCE)
    squares = ((residual @ inverse) * residual).sum(axis=-1)
    return np.asarray(-0.5 * squares - 0.5 * np.linalg.slogdet(COVARIANCE)[1])


def brute_force(observed: FloatArray, added: FloatArray) -> float:
    """Ln of the likelihood of `observed` integrated over the law's two logarithms; `added` (24,) m/N."""
    whiten = np.linalg.inv(np.linalg.cholesky(COVARIANCE))

    def residual(law: FloatArray) -> FloatArray:
        """(..., 24) for laws (..., 2)."""
        first, second = 10e6 * np.exp(law[..., 0, None]), 30e6 * np.exp(law[..., 1, None])
        x, y, z = (DIRECTION[:, i] ** 2 for i in range(3))
        return np.asarray(observed + np.log(x / (2.0 * first) + y / (first + second) + z / (2.0 * second) + added))

    found = least_squares(lambda law: np.concatenate([whiten @ residual(law), law / LAW_PRIOR]), np.zeros(2))
    spread = np.linalg.cholesky(np.linalg.inv(found.jac.T @ found.jac))
    steps = np.linspace(-6.0, 6.0, 41)  # standard deviations
    law = found.x + np.stack(np.meshgrid(steps, steps), axis=-1) @ spread.T
    prior = -0.5 * (law**2).sum(axis=-1) / LAW_PRIOR**2 - np.log(2.0 * np.pi * LAW_PRIOR**2)
    cell = 2.0 * np.log(steps[1] - steps[0]) + np.linalg.slogdet(spread)[1]
    return float(logsumexp(minus_half_square(residual(law)) + prior) + cell)


def test_projection_is_the_inverse_covariance_with_the_law_as_one_more_scatter():
    """Woodbury: what a refit with a prior leaves has the inverse covariance (V + s^2 J J^T)^-1."""
    problem = by_hand(logs_by_hand())
    law = problem.law_jacobian(np.zeros(2), problem.base_compliance)
    dense = np.linalg.inv(COVARIANCE + LAW_PRIOR**2 * law @ law.T)
    found = problem.projected(law).times(np.eye(COUNT))
    assert found == pytest.approx(dense, rel=1e-7, abs=1e-7 * np.abs(dense).max())
    # A size has no prior here: the limit of a very wide one.
    column = np.random.default_rng(1).normal(size=(COUNT, 1)) * 10.0
    wide = np.linalg.inv(COVARIANCE + LAW_PRIOR**2 * law @ law.T + column @ column.T)
    found = problem.projected(np.concatenate([law, column], axis=1)).times(np.eye(COUNT))
    assert found == pytest.approx(wide, abs=1e-5 * np.abs(wide).max())
    assert found @ column == pytest.approx(np.zeros((COUNT, 1)), abs=1e-7 * np.abs(found).max())


@pytest.mark.parametrize("law", [(0.0, 0.0), (0.15, -0.1)])
def test_base_model_against_brute_force(law):
    observed = logs_by_hand(*law) + scatter(1)
    base = by_hand(observed).score_base()

    def cost(x: FloatArray) -> float:
        return -float(minus_half_square(observed - logs_by_hand(*x))) + 0.5 * float(x @ x) / LAW_PRIOR**2

    best = minimize(cost, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-9}).x
    assert base.law == pytest.approx(best, abs=1e-4)  # of standard deviations of 0.02 and more
    assert base.residual == pytest.approx(observed - logs_by_hand(*base.law), abs=1e-9)
    assert base.log_likelihood == pytest.approx(float(minus_half_square(base.residual)), abs=1e-6)
    # Laplace's approximation of an almost linear problem.
    assert base.log_evidence == pytest.approx(brute_force(observed, np.zeros(COUNT)), abs=0.02)


@pytest.mark.parametrize(("joint", "seed"), [(30e-9, 1), (30e-9, 2), (4e-9, 3), (0.0, 4)])
def test_evidence_of_one_parameter_against_brute_force(joint, seed):
    """Law and size integrated on a grid, under the prior of the size."""
    observed = logs_by_hand(0.05, -0.05, joint) + scatter(seed)
    problem = by_hand(observed)
    table = table_of(problem, "joint_compliance")
    score = scored(problem, table, problem.score_base())
    logs = problem.prior(table, 0).log_sizes[1.0]
    sizes = np.exp(np.linspace(logs[0], logs[-1], 160))
    each = np.array([brute_force(observed, np.full(COUNT, 0.5 * size)) for size in sizes])
    prior = problem.prior(table, 0).log_at(sizes)
    dense = float(np.log(np.trapezoid(np.exp(each + prior - each.max()), sizes))) + each.max()
    # The profile is taken for a parabola; its third derivative is what this leaves.
    assert score.log_evidence == pytest.approx(dense, abs=0.15)
    if joint > 1e-8:
        # Sizes step by 5 %; the standard deviation is some 10 % here.
        assert score.sizes[0][0] == pytest.approx(sizes[np.argmax(each)], rel=0.06)


@pytest.mark.parametrize("size", [20e-9, 5e-9])
def test_evidence_of_one_component_of_several_against_brute_force(size):
    observed = logs_by_hand(0.02, 0.03, table_x=size) + 0.2 * scatter(5)  # so little that no draw makes it absent
    problem = by_hand(observed)
    table = table_of(problem, "table_compliance")
    score = problem.score_subset([table], (0,), problem.score_base())
    assert score is not None and score.possible
    logs = problem.prior(table, 0).log_sizes[1.0]
    sizes = np.exp(np.linspace(logs[0], logs[-1], 160))
    each = np.array([brute_force(observed, s * DIRECTION[:, 0] ** 2) for s in sizes])
    prior = problem.prior(table, 0).log_at(sizes)
    dense = float(np.log(np.trapezoid(np.exp(each + prior - each.max()), sizes))) + each.max()
    # The profile is taken for a parabola; its third derivative is what this leaves.
    assert score.log_evidence == pytest.approx(dense, abs=0.15)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.floats(0.0, 0.05))
def test_an_effect_more_never_fits_worse(seed, size):
    """Even on nonsense: the base model is the candidate's limit for small sizes."""
    noise = scatter(seed) + size * np.random.default_rng(seed + 1).normal(size=COUNT)
    problem = by_hand(logs_by_hand() + noise)
    base = problem.score_base()
    found = scored(problem, table_of(problem, "joint_compliance"), base)

    def posterior(score) -> float:
        return score.log_likelihood - 0.5 * float(score.law @ score.law) / LAW_PRIOR**2

    # The smallest size tried changes the stiffness by 0.2 %, a tenth of the noise: at most a little worse.
    assert posterior(found) > posterior(base) - 0.2
    family = score_family(problem, find_effect("table_compliance"), base)
    assert family is not None
    if family.best is not None:
        assert posterior(family.best) > posterior(base) - 1e-6


def test_a_missing_effect_is_likelier_than_none_and_a_needless_component_less():
    observed = logs_by_hand(0.05, 0.0, table_x=40e-9) + scatter(6)
    problem = by_hand(observed)
    base, table = problem.score_base(), table_of(problem, "table_compliance")
    right, both = problem.score_subset([table], (0,), base), problem.score_subset([table], (0, 2), base)
    assert right is not None
    assert right.log_evidence > base.log_evidence + 10.0
    assert both is None or not both.possible or both.log_evidence < right.log_evidence
    wrong = problem.score_subset([table], (2,), base)
    assert wrong is None or wrong.log_evidence < right.log_evidence - 3.0


def test_intervals_hold_the_truth_as_often_as_they_say():
    """200 campaigns each, the law drawn from its prior; 95 %, as sure as 200 make it: 4 sd of 1.5 %."""
    rng = np.random.default_rng(0)
    inside, small = [], []
    for seed in range(200):
        law = rng.normal(0.0, LAW_PRIOR, 2)
        for size, into in ((30e-9, inside), (8e-9, small)):
            problem = by_hand(logs_by_hand(*law, joint=size) + scatter(1000 + seed))
            sizes = fitted_sizes(scored(problem, one_table(), problem.score_base()))
            ((low, high),) = (figure.interval for figure in sizes["joint_compliance"].values())
            into.append(low <= size * 1e9 <= high)
    assert 0.89 <= np.mean(inside) < 1.0  # all of 200 inside: once in 28,000 times
    # About two standard deviations from zero, which bounds it: never short of truth.
    assert np.mean(small) >= 0.89


@cache
def one_table() -> CandidateTable:
    return table_of(by_hand(logs_by_hand()), "joint_compliance")


def calm_scatter(rng: np.random.Generator) -> FloatArray:
    """Scatter in which no reading stands out: from 3.4 sd beside the others on, a reading of it counts as wild."""
    inverse = np.linalg.inv(COVARIANCE)
    while True:
        drawn = rng.multivariate_normal(np.zeros(COUNT), COVARIANCE, method="cholesky")
        if np.abs(inverse @ drawn / np.sqrt(np.diag(inverse))).max() < 2.5:  # three draws of four
            return drawn


def test_a_wild_reading_hardly_moves_the_fit():
    observed = logs_by_hand(joint=30e-9) + calm_scatter(np.random.default_rng(7))
    calm = by_hand(observed, outliers=0.02)
    before = scored(calm, one_table(), calm.score_base())
    assert before.scatter.wild == ()
    observed[11] += 0.5
    after, naive = by_hand(observed, outliers=0.02), by_hand(observed)
    robust = scored(after, one_table(), after.score_base())
    assert robust.scatter.wild == (11,)
    # Who takes it at its word is carried away.
    carried = scored(naive, one_table(), naive.score_base())
    assert carried.log_likelihood < robust.log_likelihood - 50.0
    # Four times as wide, it weighs a 16th and moves the fit by a 16th of that, and what it said before it was wild is
    # lost.
    moved, far = (float(fit.sizes[0][0] - before.sizes[0][0]) for fit in (robust, carried))
    assert abs(far) > 2.0 * robust.deviation(0)
    assert abs(moved - far / 16.0) < 0.5 * robust.deviation(0)


# -- on a campaign ---------------------------------------------------------------------------------------------------

SOME = ("weak_strut", "table_compliance", "gauge_scale", "joint_compliance", "tool_length_error")


def ranked(order: NDArray[np.int64] | None = None, logs: FloatArray | None = None) -> dict[str, float]:
    """Log evidence of some effects over that of the base model, on a paper campaign with a weak strut."""
    data = campaign(21, "paper", "weak_strut", 0.06)[0]
    if logs is not None:
        from dataclasses import replace

        data = replace(data, stiffness=np.exp(logs))
    data = data if order is None else data.select(order)
    problem, _ = make_problem(nist(), data, simple_noise(len(data), 0.02, 0.01, 0.01, 0.5e-3, outliers=0.02))
    base = problem.score_base()
    families = score_families(problem, [find_effect(name) for name in SOME], base)
    return {family.name: family.log_evidence - base.log_evidence for family in families}


def test_the_order_of_the_readings_does_not_matter_but_which_is_which_does():
    plain = ranked()
    assert max(plain, key=lambda name: plain[name]) == "weak_strut" and plain["weak_strut"] > 10.0
    order = np.random.default_rng(0).permutation(42)
    # The scan ends where the steps are small against a standard deviation: a log evidence within 0.01.
    assert ranked(order) == pytest.approx(plain, abs=0.01)
    data = campaign(21, "paper", "weak_strut", 0.06)[0]
    model, logs = make_problem(nist(), data, simple_noise(42))[0].predictor.log_stiffness(), np.log(data.stiffness)
    permuted = ranked(logs=model + (logs - model)[order])
    assert permuted["weak_strut"] < plain["weak_strut"] - 5.0
    flipped = ranked(logs=2.0 * model - logs)  # a strut that is too stiff: not in the catalogue
    assert flipped["weak_strut"] < 0.5 * plain["weak_strut"]


def test_a_choice_of_six_costs_ln_6():
    """The family's evidence is the mean over its choices."""
    data = campaign(21, "paper", "weak_strut", 0.06)[0]
    problem, _ = make_problem(nist(), data, simple_noise(42, 0.02, 0.01, 0.01, 0.5e-3))
    base, effect = problem.score_base(), find_effect("weak_strut")
    family = score_family(problem, effect, base)
    assert family is not None and family.best is not None
    assert len(family.tables) == 6
    each = [scored(problem, table, base).log_evidence for table in family.tables]
    assert family.log_evidence == pytest.approx(float(logsumexp(each)) - np.log(6.0), abs=1e-9)
    assert family.log_evidence < family.best.log_evidence


def test_probabilities_are_bayes_theorem():
    found = probabilities({"a": -1000.0, "b": -1000.0 + np.log(3.0), "c": 0.0}, {"a": 0.5, "b": 0.25})
    assert found == pytest.approx({"a": 0.4, "b": 0.6, "c": 0.0})
    assert probabilities({"a": -3.0}, {}) == {"a": 0.0}
