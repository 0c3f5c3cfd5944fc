"""What readings would have shown: the power of detectable sizes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm

from tests.stiffness.cases import nist
from tests.updating.cases import campaign, make_problem, simple_noise, table_1
from tests.updating.test_evidence import by_hand, logs_by_hand, one_table, scatter, scored
from toolpath_stiff.inference.detectable import Detectable, detectable_sizes
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.hypotheses import Family, score_families
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect

NAMES = ("joint_compliance", "spindle_compliance", "table_compliance", "gauge_scale", "weak_strut")


def searched(data: Readings, repeat: float = 0.02) -> tuple[Problem, list[Family]]:
    problem, _ = make_problem(nist(), data, simple_noise(len(data), repeat, 0.01, 0.01, 0.5e-3))
    return problem, score_families(problem, [find_effect(name) for name in NAMES], problem.score_base())


def sizes(problem: Problem, families: list[Family], threshold: float = 9.0) -> dict[tuple[str, str], Detectable]:
    return {(d.effect, d.parameter.name): d for d in detectable_sizes(problem, families, threshold)}


def gain(problem: Problem) -> float:
    """Of soft joints over the base model, by the real search."""
    base = problem.score_base()
    return float(2.0 * (scored(problem, one_table(), base).log_posterior - base.log_posterior))


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
    data = campaign(51)[0]
    problem, families = searched(data.select(np.arange(0, len(data), 4)))
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
