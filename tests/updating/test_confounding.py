"""What a design cannot tell: correlations against subspace angles, known twins, and the power of detectable sizes."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import subspace_angles
from scipy.stats import norm

from tests.stiffness.cases import nist
from tests.updating.cases import campaign, dense, make_problem, simple_noise, table_1
from tests.updating.test_evidence import by_hand, logs_by_hand, one_table, scatter
from toolpath_stiff.inference.confounding import CONFOUNDED, Confounding, confounding
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.hidden_sizes import Detectable, detectable_sizes
from toolpath_stiff.inference.hypotheses import Family, score_families, score_single
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.contract import Effect

FloatArray = NDArray[np.float64]

NAMES = ("joint_compliance", "spindle_compliance", "table_compliance", "gauge_scale", "weak_strut")


class SoftJoint(type(find_effect("joint_compliance"))):  # type: ignore[misc]
    """The catalogue's compliance of the joints under another name."""

    name = "soft_joint"


def searched(data: Readings, repeat: float = 0.02) -> tuple[Problem, list[Family]]:
    problem, _ = make_problem(nist(), data, simple_noise(len(data), repeat, 0.01, 0.01, 0.5e-3))
    effects: list[Effect] = [find_effect(name) for name in NAMES]
    return problem, score_families(problem, [*effects, SoftJoint()], problem.score_base())


@cache
def paper() -> tuple[Problem, list[Family], Confounding]:
    problem, families = searched(campaign(51, "paper")[0])
    return problem, families, confounding(problem, families)


@cache
def tilted() -> tuple[Problem, list[Family], Confounding]:
    data = campaign(51)[0]
    problem, families = searched(data.select(np.arange(0, len(data), 4)))
    return problem, families, confounding(problem, families)


def entry(found: Confounding, first: str, second: str) -> float:
    return float(found.matrix[found.names.index(first), found.names.index(second)])


@pytest.mark.parametrize("case", [paper, tilted])
def test_correlations_are_cosines_between_subspaces(case):
    """Readings whitened by the square root of the projected inverse covariance; the worst choice of each counts."""
    problem, families, found = case()
    law = problem.law_jacobian(np.zeros(2), problem.base_compliance)
    root = np.linalg.cholesky(np.linalg.inv(dense(problem.scatter.covariance) + 0.2**2 * law @ law.T)).T

    def spans(family: Family) -> list[FloatArray]:
        columns = [root @ (table.columns / problem.base_compliance[:, None]) for table in family.tables]
        return [c / np.linalg.norm(c, axis=0) for c in columns]

    for first in families:
        for second in families:
            if first.name != second.name:
                cosines = [np.cos(subspace_angles(a, b)).max() for a in spans(first) for b in spans(second)]
                assert entry(found, first.name, second.name) == pytest.approx(max(cosines), abs=1e-6)
    assert found.matrix == pytest.approx(found.matrix.T) and (np.diag(found.matrix) == 1.0).all()


def test_the_same_physics_under_two_names_cannot_be_told_apart():
    for _, _, found in (paper(), tilted()):
        assert entry(found, "joint_compliance", "soft_joint") == pytest.approx(1.0, abs=1e-9)
        assert any({"joint_compliance", "soft_joint"} <= set(group) for group in found.sets)


def test_what_gives_way_alike_in_all_directions_may_sit_on_either_side():
    """Spindle and table share the isotropic compliance, however the platform tilts; one strut has no part in it."""
    for _, _, found in (paper(), tilted()):
        assert entry(found, "spindle_compliance", "table_compliance") == pytest.approx(1.0, abs=1e-6)
        assert any({"spindle_compliance", "table_compliance"} <= set(group) for group in found.sets)
        assert not any("weak_strut" in group for group in found.sets)


def test_sets_stand_together():
    for _, _, found in (paper(), tilted()):
        for group in found.sets:
            places = sorted(found.names.index(name) for name in group)
            assert len(group) > 1 and places == list(range(places[0], places[0] + len(group)))
            inside = found.matrix[np.ix_(places, places)] > CONFOUNDED
            assert (inside.sum(axis=1) > 1).all()
        apart = {name for name in found.names if not any(name in group for group in found.sets)}
        for name in apart:
            assert sum(found.matrix[found.names.index(name)] > CONFOUNDED) == 1


def sizes(problem: Problem, families: list[Family], threshold: float = 9.0) -> dict[tuple[str, str], Detectable]:
    return {(d.effect, d.parameter.name): d for d in detectable_sizes(problem, families, threshold)}


def gain(problem: Problem) -> float:
    """Of soft joints over the base model, by the real search."""
    base = problem.score_base()
    return float(2.0 * (score_single(problem, one_table(), base).log_posterior - base.log_posterior))


def test_a_detectable_size_is_seen_in_four_campaigns_of_five():
    """The power is that of a normal number about the root of the gain without scatter; 4/5 where all is linear.

    Scatter so wide that a quarter of the stiffness must go before it is seen: the law takes a part of that upon itself,
    some 15 % of the gain. Of a tenth of that scatter, a tenth of the size, it is 2 %.
    """
    threshold, of_scale = 9.0, {}
    family = Family(find_effect("joint_compliance"), (one_table(),), None, 0.0)
    for scale, least in ((1.0, 0.80), (0.1, 0.96)):
        (found,) = detectable_sizes(by_hand(logs_by_hand(), scale=scale), [family], threshold)
        assert found.seen
        shown = logs_by_hand(joint=found.value)
        of_scale[scale] = shown, gain(by_hand(shown, scale=scale))
        assert least < of_scale[scale][1] / (math.sqrt(threshold) + norm.ppf(0.8)) ** 2 < 1.0
    shown, without = of_scale[1.0]
    count, power = 300, norm.cdf(math.sqrt(without) - math.sqrt(threshold))
    passed = sum(gain(by_hand(shown + scatter(5000 + seed))) > threshold for seed in range(count))
    # 4 standard deviations of a count of 300, 2.6 % each: outside by chance once in 16,000 seeds.
    assert passed / count == pytest.approx(power, abs=4.0 * math.sqrt(power * (1.0 - power) / count))


def test_detectable_sizes_make_the_change_that_they_claim():
    problem, families, _ = tilted()
    for family in families[:3]:
        for one in detectable_sizes(problem, [family], 9.0):
            if not one.seen:
                continue
            changes = []
            for table in family.tables:
                values = dict(table.candidate.choice) | {
                    c.parameter.name: c.value(0.0) for c in table.candidate.components
                }
                effect = ActiveEffect(family.effect, values | {one.parameter.name: one.value})
                change = problem.predictor.log_stiffness(effects=[effect]) - problem.predictor.log_stiffness()
                changes.append(float(np.sqrt(np.mean(change**2))))
            # The choice that is hardest to see is one of them.
            assert np.abs(np.array(changes) / one.rms - 1.0).min() < 0.03


def test_more_noise_hides_more_and_more_readings_show_more():
    few, many = table_1(), campaign(51)[0]
    calm, loud = sizes(*searched(few, 0.01)), sizes(*searched(few, 0.05))
    for key, one in calm.items():
        if one.seen and loud[key].seen:
            assert loud[key].rms > one.rms
    gauge = ("gauge_scale", "scale")
    assert calm[gauge].seen and loud[gauge].rms > 1.5 * calm[gauge].rms
    dense = sizes(*searched(many.select(np.arange(0, len(many), 2)), 0.02))
    sparse = sizes(*searched(many.select(np.arange(0, len(many), 12)), 0.02))
    seen = [key for key, one in dense.items() if one.seen and key in sparse and sparse[key].seen]
    assert seen and all(sparse[key].rms > dense[key].rms for key in seen)
    # A gauge is off by 20 % at most: under a noise of half a reading no gauge shows, and that is said.
    hidden = sizes(*searched(few, 0.5))[gauge]
    assert not hidden.seen and np.isnan(hidden.value) and hidden.rms < 0.25
