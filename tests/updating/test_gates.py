"""The two gates: statistics against brute force, false alarms as often as they should be, and what they must see."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import binom, chi2, kstest, norm

from tests.stiffness.cases import nist
from tests.updating.cases import campaign, correlated_covariance, dense, make_problem, simple_noise
from toolpath_stiff.inference.discrepancies import discrepancy_forms
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.gates import (
    DRAWS,
    Forms,
    FormStatistics,
    Gate,
    absolute_gate,
    gain_threshold,
    largest_gain,
    set_wild_aside,
    simulate,
)
from toolpath_stiff.inference.hypotheses import score_families, signatures
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.stiffness.catalogue import find_effect

FloatArray = NDArray[np.float64]

N = 42


def noise(freedom: float = np.inf, outliers: float = 0.0) -> Noise:
    return simple_noise(N, 0.02, 0.01, 0.01, 0.5e-3, outliers, freedom)


@cache
def setting() -> tuple[Problem, FloatArray, Forms]:
    """The paper's layout, its covariance (42, 42), the forms of discrepancy."""
    problem, spread = make_problem(nist(), campaign(31, "paper")[0], noise())
    return problem, spread, Forms(discrepancy_forms(problem.predictor), problem.scatter.precision)


def simulator_of(seed: int, draws: int = DRAWS, **options: float) -> FloatArray:
    return simulate(noise(**options), setting()[0].scatter.covariance, seed, draws)


def refitted(problem: Problem, logs: FloatArray) -> Fit:
    """The base model refitted to other readings (42,) of ln k."""
    problem.observed = logs
    return problem.score_base()


def gate_of(problem: Problem, logs: FloatArray, simulator: FloatArray) -> Gate:
    base = refitted(problem, logs)
    return absolute_gate(problem, base.residual, base.jacobian, simulator, setting()[2])


def null_logs(seed: int) -> FloatArray:
    """Ln k of a campaign to which the noise model applies exactly."""
    problem, spread, _ = setting()
    return problem.predictor.log_stiffness() + np.random.default_rng([seed, 77]).multivariate_normal(
        np.zeros(N), spread, method="cholesky"
    )


@cache
def null_gates() -> tuple[Gate, ...]:
    """120 campaigns with nothing hidden, each with its own bootstrap."""
    problem = setting()[0]
    return tuple(gate_of(problem, null_logs(k), simulator_of(k)) for k in range(120))


def test_false_alarms_as_often_as_they_should_be():
    """The p value is uniform where the model is right: squares, structure and both together."""
    gates = null_gates()
    # At 120 p values the test sees deviations above 0.2; the bootstrap's steps of 1 / 400 do not matter.
    assert kstest([gate.probability for gate in gates], "uniform").pvalue > 1e-4
    assert kstest([gate.squares_probability for gate in gates], "uniform").pvalue > 1e-4
    assert kstest([gate.structure_probability for gate in gates], "uniform").pvalue > 1e-4
    alarms = sum(gate.probability <= 0.05 for gate in gates)
    assert alarms <= binom.ppf(0.9999, 120, 0.05)  # too few: the first of the tests above


def test_noise_that_is_larger_or_structured_is_seen():
    problem, spread, _ = setting()
    simulator = simulator_of(1)
    rng = np.random.default_rng(5)
    model, root = problem.predictor.log_stiffness(), np.linalg.cholesky(spread)
    for _ in range(3):
        assert gate_of(problem, model + 2.0 * root @ rng.standard_normal(N), simulator).squares_probability < 0.01
    # A discrepancy of a few per cent, linear over the workspace and different by direction: structure, not size.
    form = discrepancy_forms(problem.predictor)["linear over the workspace, different by direction"]
    for _ in range(3):
        scatter, structure = root @ rng.standard_normal(N), 0.06 * form @ rng.standard_normal(form.shape[1])
        seen = gate_of(problem, model + scatter + structure, simulator)
        assert seen.probability < 0.05 and seen.structure_probability < 0.05
        shuffled = gate_of(problem, model + scatter + rng.permutation(structure), simulator)
        assert shuffled.squares != pytest.approx(seen.squares, rel=0.01)  # which reading is which matters


def test_the_same_seed_gives_the_same_probabilities():
    problem = setting()[0]
    first, again = (gate_of(problem, null_logs(3), simulator_of(1)) for _ in range(2))
    assert first.probability == again.probability and np.array_equal(first.simulated, again.simulated)
    other = gate_of(problem, null_logs(3), simulator_of(2))
    assert not np.array_equal(other.simulated, first.simulated)


def test_simulated_scatter_has_the_covariance_and_its_uncertainty():
    _, spread, _ = setting()
    draws = simulator_of(2, 4000)
    white = draws @ np.linalg.inv(np.linalg.cholesky(spread)).T
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], white.size) / white.size
    assert low < np.mean(white**2) < high
    values = np.linalg.eigvalsh(white.T @ white / len(white))
    assert values.max() < 1.1 * (1.0 + np.sqrt(N / 4000)) ** 2  # Marchenko and Pastur 1967
    # A noise known to 10 degrees of freedom: Student's t, variance 10 / 8 of the normal's.
    wide = simulator_of(2, 4000, freedom=10.0)
    assert np.mean(wide**2) / np.mean(draws**2) == pytest.approx(10.0 / 8.0, rel=0.05)
    wild = simulator_of(2, 4000, outliers=0.1)
    expected = np.trace(spread) + N * 0.02**2 * 0.1 * (4.0**2 - 1.0)
    assert np.mean(wild**2) * N == pytest.approx(expected, rel=0.05)
    assert np.array_equal(wild, simulator_of(2, 4000, outliers=0.1))
    assert not np.array_equal(wild, simulator_of(3, 4000, outliers=0.1))


def test_a_reading_set_aside_is_as_if_it_had_never_been_taken():
    """Against the pulls of the readings that stay, their own sub-matrix inverted."""
    problem, spread, _ = setting()
    law = problem.predictor.law_columns(-np.log(problem.base_compliance))
    projected, residual = (
        problem.projected(law),
        np.random.default_rng(1).multivariate_normal(np.zeros(N), spread, method="cholesky"),
    )
    # Half of the scatter that is reckoned with, so that no other stands out, and nine standard deviations: 7 at least
    # of 500 draws.
    residual = 0.5 * residual
    residual[9] += 0.2
    out, taken = set_wild_aside(projected.times(residual[None]), projected)
    assert np.flatnonzero(taken[0]).tolist() == [9]
    stay = np.arange(N) != 9
    rest = np.linalg.inv(spread[np.ix_(stay, stay)] + 0.2**2 * law[stay] @ law[stay].T)
    assert out[0][stay] == pytest.approx(rest @ residual[stay], rel=1e-6)
    assert abs(out[0][9]) < 1e-9 * np.abs(out).max()


def test_structure_of_pure_noise_surprises_no_one():
    """Each form's tail probability is uniform under the null, as well as Satterthwaite's approximation has it."""
    problem, _, forms = setting()
    law = problem.predictor.law_columns(-np.log(problem.base_compliance))
    projected = problem.projected(law)
    draws = simulator_of(4, 1000)
    structure = FormStatistics(forms, projected)
    tails = norm.sf(structure.surprises(structure.loads(draws)))
    for column, name in zip(tails.T, forms.names, strict=True):
        assert 0.02 < np.mean(column < 0.05) < 0.08, name
        assert 0.4 < np.mean(column) < 0.6, name


@pytest.mark.parametrize("columns", [1, 2, 3])
def test_largest_gain_is_that_of_non_negative_least_squares(columns):
    """All subsets with positive sizes, against the active-set method of Lawson and Hanson on whitened readings."""
    rng = np.random.default_rng(columns)
    n = 15
    covariance = correlated_covariance(rng.uniform(0.5, 2.0, n), rng.normal(size=(n, 3)))
    projected = np.linalg.inv(dense(covariance))
    root = np.linalg.cholesky(projected).T
    shape = rng.normal(size=(n, columns))
    subsets = [list(s) for s in ([0], [1], [2], [0, 1], [0, 2], [1, 2], [0, 1, 2]) if max(s) < columns]
    residuals = rng.normal(size=(50, n))
    found = largest_gain(residuals @ projected, covariance.precision, [[shape[:, s] for s in subsets]])
    for residual, gain in zip(residuals, found, strict=True):
        left = nnls(root @ shape, root @ residual)[1] ** 2
        assert gain == pytest.approx(float(residual @ projected @ residual) - left, rel=1e-8, abs=1e-9)


def test_the_gain_of_the_best_of_many_is_judged_against_the_best_of_many():
    """With nothing hidden the threshold exceeds that of a single effect, and the real search rarely passes it."""
    problem, _, forms = setting()
    effects = [find_effect(name) for name in ("weak_strut", "gauge_scale", "table_compliance", "frame_compliance")]
    passed, thresholds = 0, []
    for k in range(20):
        base = refitted(problem, null_logs(1000 + k))
        families = score_families(problem, effects, base)
        gain = max((2.0 * (f.best.log_posterior - base.log_posterior) for f in families if f.best), default=0.0)
        simulator = simulator_of(k)
        signs = signatures(problem, [table for family in families for table in family.tables])
        gate = absolute_gate(problem, base.residual, base.jacobian, simulator, forms, signs, gain)
        assert (
            gate.own_probability == absolute_gate(problem, base.residual, base.jacobian, simulator, forms).probability
        )
        thresholds.append(gain_threshold(problem, base.jacobian, simulator, signs))
        passed += gate.gain_probability <= 0.05
    single = float(chi2.ppf(0.90, 1))  # one-sided 5 % of one effect
    assert min(thresholds) > single + 2.0
    assert passed <= binom.ppf(0.999, 20, 0.05)


def test_draws_resolve_the_levels_that_are_used():
    """The smallest probability that the bootstrap can give lies below the level at which explanations are dropped."""
    from toolpath_stiff.inference.judgement import ADEQUATE

    assert 0.5 / DRAWS < ADEQUATE / 2.0
