"""Candidates and their tables: what is tried, how large, and that a table says what the model says."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad

from tests.effects.cases import all_effects
from tests.stiffness.cases import nist
from tests.updating.cases import campaign, make_problem, readings_by_hand, simple_noise, table_1
from toolpath_stiff.inference import candidates
from toolpath_stiff.inference.candidates import Candidate, CandidateTable, Component, candidates_of, tabulate
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.noise import JOINT_ERROR
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.size_priors import EXPECTED, VISIBLE, SizePrior
from toolpath_stiff.stiffness.contract import Parameter

EFFECTS = all_effects()
REAL = [(name, p.name) for name, effect in EFFECTS.items() for p in effect.parameters if not p.discrete]


@cache
def problem(layout: str = "tilted") -> Problem:
    data = campaign(11, layout)[0]
    return make_problem(nist(), data, simple_noise(len(data), 0.02, 0.01, 0.01, 0.5e-3))[0]


@cache
def tables(name: str) -> tuple[CandidateTable, ...]:
    """The effect's tables in the tilted campaign."""
    found = (tabulate(c, problem().predictor, np.zeros(2)) for c in candidates_of(EFFECTS[name], campaign(11)[0]))
    return tuple(table for table in found if table is not None)


def added(table: CandidateTable, sizes: np.ndarray) -> np.ndarray:
    """(n,) m/N by the model itself."""
    predictor = problem().predictor
    logs = predictor.log_stiffness((0.0, 0.0), [table.candidate.active(sizes)])
    return np.exp(-logs) - np.exp(-predictor.log_stiffness())


@pytest.mark.parametrize(("name", "parameter"), REAL)
def test_sizes_count_from_neutral_and_reach_the_bounds(name, parameter):
    declared = next(p for p in EFFECTS[name].parameters if p.name == parameter)
    component = Component.of(declared)
    assert component.value(0.0) == declared.neutral * declared.si
    ends = sorted(component.value(size) / declared.si for size in component.bounds if np.isfinite(size))
    assert all(any(end == pytest.approx(b) or end == b for b in declared.bounds) for end in ends)
    assert component.signs and all(component.reach(sign) > 0.0 for sign in component.signs)
    low, high = component.typical()
    assert 0.0 <= low < high
    for sign in component.signs:
        inside = component.value(sign * 0.5 * min(component.reach(sign), 1e3 * high)) / declared.si
        assert declared.bounds[0] <= inside <= declared.bounds[1]


def test_a_stiffness_that_is_infinite_by_nature_counts_as_a_compliance():
    component = Component.of(EFFECTS["platform_flexibility"].parameters[0])
    assert component.inverse and component.bounds == (0.0, 1e-8)
    assert component.value(1e-9) == pytest.approx(1e9)


def chosen(name: str, data=None) -> set[tuple]:
    return {
        tuple(v for _, v in c.choice) for c in candidates_of(EFFECTS[name], campaign(11)[0] if data is None else data)
    }


def test_one_candidate_a_choice():
    assert chosen("weak_strut") == {(s,) for s in range(1, 7)}
    assert len(candidates_of(EFFECTS["spindle_compliance"], table_1())) == 1
    setups = set(campaign(11)[0].setup)
    assert len(setups) == 2
    assert chosen("setup_compliance") == {(name,) for name in setups}
    # One direction's readings or one set-up's, not both at once.
    assert chosen("gauge_scale") == {(d, "") for d in (1, 2, 3)} | {(0, name) for name in setups}
    single = readings_by_hand([4e7] * 3, (0, 0, 0.8), np.eye(3), setup=["table"] * 3)
    assert chosen("gauge_scale", single) == {(d, "") for d in (1, 2, 3)}


def test_subsets_are_all_ways_in_which_components_can_be_absent():
    (table,) = candidates_of(EFFECTS["table_compliance"], table_1())
    assert len(table.components) == 4
    assert sorted(table.subsets()) == sorted({s for s in _powerset(4) if s})


def _powerset(n: int) -> Iterator[tuple[int, ...]]:
    for bits in range(2**n):
        yield tuple(i for i in range(n) if bits >> i & 1)


@pytest.mark.parametrize("name", EFFECTS)
def test_a_table_says_what_the_model_says(name):
    """At sizes between those tabulated, for effects of up to 25 %; within a tenth of a reading's noise of 2 %."""
    rng = np.random.default_rng(0)
    base = problem().base_compliance
    for table in tables(name)[:2]:
        count = len(table.candidate.components)
        for _ in range(4):
            sign = rng.choice(table.candidate.components[0].signs)
            unit = rng.uniform(0.2, 1.0, count) * (sign if count == 1 else 1.0)
            scale = np.sqrt(np.mean((table.columns @ unit / base) ** 2))
            sizes = unit * rng.uniform(0.02, 0.25) / scale
            reaches = np.array([c.reach(np.sign(s)) for c, s in zip(table.candidate.components, sizes, strict=True)])
            sizes *= min(1.0, 0.9 * float(np.min(reaches / np.abs(sizes))))
            if table.candidate.effect.vector:  # linear, from the joints' nuisance: as far as that goes
                sizes *= min(1.0, JOINT_ERROR / np.abs(sizes).max())
            # A drift that takes away a reading's whole deflection leaves it no stiffness: at most half of it.
            sizes *= min(1.0, 0.5 / max(1e-9, float(np.max(-(table.columns @ sizes) / base))))
            model = added(table, sizes)
            assert np.abs(model).max() > 1e-4 * base.min()
            error = np.log1p(table.delta(sizes) / base) - np.log1p(model / base)
            assert np.abs(error).max() < 2e-3


@pytest.mark.parametrize("name", ["weak_strut", "tool_length_error", "platform_flexibility", "spindle_compliance"])
def test_slopes_are_those_of_the_model(name):
    table = tables(name)[0]
    count = len(table.candidate.components)
    for j, component in enumerate(table.candidate.components):
        unit = np.eye(count)[j] * component.signs[-1]
        at = unit * 0.05 / np.sqrt(np.mean((table.columns[:, j] / problem().base_compliance) ** 2))
        at *= min(1.0, 0.5 * component.reach(component.signs[-1]) / abs(at[j]))
        step = 1e-3 * at
        slope = (added(table, at + step) - added(table, at - step)) / (2.0 * step[j])
        found = table.slope(at)[:, j]
        assert found == pytest.approx(slope, abs=0.01 * np.abs(slope).max())
    assert not table.delta(np.zeros((1, count))).any()


def test_what_does_nothing_to_the_data_has_no_table():
    """A drift needs a clock that runs; a gauge along Y, readings along Y."""
    same = np.zeros(4)
    still = readings_by_hand([4e7] * 4, (0, 0, 0.8), [0, 0, 1], minutes=same, force=[500, 500, 4000, 4000])
    predictor = Predictor(nist(), still)
    (drift,) = candidates_of(EFFECTS["thermal_drift"], still)
    assert tabulate(drift, predictor, np.zeros(2)) is None
    gauges = candidates_of(EFFECTS["gauge_scale"], still)
    shown = [tabulate(gauge, predictor, np.zeros(2)) is not None for gauge in gauges]
    assert shown == [dict(gauge.choice)["direction"] == 3 for gauge in gauges]


def test_effects_without_their_columns_are_named_with_what_they_lack():
    effects, cannot = candidates.testable_effects(Predictor(nist(), table_1()))
    for name in ("joint_clearance", "contact_nonlinearity"):
        assert cannot[name] == ("force_N",)
    assert set(cannot["thermal_drift"]) >= {"time_min"}
    assert {effect.name for effect in effects} == set(EFFECTS) - set(cannot)


# -- prior of the size ---------------------------------------------------------------------------------------------


def priors() -> Iterator[tuple[str, CandidateTable, int, SizePrior]]:
    for name in ("weak_strut", "gauge_scale", "tool_length_error", "platform_flexibility", "spindle_compliance"):
        table = tables(name)[0]
        for j in range(len(table.candidate.components)):
            yield name, table, j, problem().prior(table, j)


def test_a_size_has_some_size():
    """The prior over all sizes of both signs integrates to one."""
    for name, _, _, prior in priors():
        total = 0.0
        for sign, logs in prior.log_sizes.items():
            # Over ln size: log_at is the density of the size itself.
            value, _ = quad(
                lambda at, s=sign, p=prior: np.exp(p.log_at(np.array([s * np.exp(at)]))[0] + at),
                logs[0], logs[-1], limit=400, epsabs=1e-5,
            )  # fmt: skip
            total += value
        assert total == pytest.approx(1.0, abs=2e-3), name


def test_mean_likelihood_is_the_integral_over_the_prior():
    for name, _, _, prior in priors():
        sign = max(prior.log_sizes)
        middle = sign * float(np.exp(prior.log_sizes[sign].mean()))
        for peak, sd in ((middle, 0.2 * abs(middle)), (0.2 * middle, 0.3 * abs(middle)), (-middle, abs(middle))):
            total = 0.0
            for s, logs in prior.log_sizes.items():
                sizes = s * np.exp(np.linspace(logs[0], logs[-1], 20001))
                values = np.exp(prior.log_at(sizes) - 0.5 * ((sizes - peak) / sd) ** 2)
                total += float(np.abs(np.trapezoid(values, sizes)))
            assert prior.log_mean_likelihood(peak, sd) == pytest.approx(np.log(total), abs=0.02), name


def linear_table(per_unit: float, unit: float = 1.0) -> CandidateTable:
    """One parameter, linear, its unit chosen freely: the same physics in other units."""
    declared = Parameter("a", "", 1.0, (0.0, 1e6 * unit), (0.01 * unit, 0.1 * unit), "made for a test")
    column = per_unit / unit * problem().base_compliance[:, None]
    column = column * np.linspace(0.0, 1.0, len(column))[:, None]
    return CandidateTable(Candidate(EFFECTS["joint_compliance"], (), (Component.of(declared),)), column, dict)


def test_the_unit_of_a_parameter_does_not_matter():
    one, other = (SizePrior.of(linear_table(1.0, unit), 0, problem().sight) for unit in (1.0, 1e-9))
    sizes = np.geomspace(0.01, 0.3, 7)
    assert one.log_at(sizes) + np.log(sizes) == pytest.approx(
        other.log_at(sizes * 1e-9) + np.log(sizes * 1e-9), abs=1e-6
    )


def test_sizes_too_small_to_see_are_no_hypothesis():
    """The prior starts where the signature rises above the noise; far below it has fallen by orders of magnitude."""
    table = linear_table(1.0)
    prior, sight = SizePrior.of(table, 0, problem().sight), problem().sight
    sizes = np.geomspace(1e-3, 0.5, 400)
    length = sight.length(sight.change(table.delta(sizes[:, None])))
    rms = np.sqrt(np.mean(sight.change(table.delta(sizes[:, None])) ** 2, axis=1))
    density = prior.log_at(sizes) + np.log(sizes)
    flat = (length > VISIBLE) & (rms > EXPECTED[0]) & (rms < EXPECTED[1]) & (sizes > 0.01) & (sizes < 0.1)
    assert flat.sum() > 20 and np.ptp(density[flat]) < 0.02
    assert density[np.argmin(np.abs(length - VISIBLE + 2.1))] < density[flat][0] - 3.0
    assert density[rms > 5.0 * EXPECTED[1]].max(initial=-99.0) < density[flat][0] - 1.0
