"""Planned measurements: the gap against its definition and closed forms, and what splits which pair of effects."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import norm

from tests.stiffness.cases import nist
from tests.updating.planning import READING_SD, candidate, rival, rivals, table_1_design
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.judgement import NAMED
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.planning.forecasts import Forecast, Rival, forecast_all
from toolpath_stiff.planning.gaps import ReadingNoise, expected_outcome, pair_shares
from toolpath_stiff.planning.menu import COSTS, Menu
from toolpath_stiff.planning.plan import RivalPlan, plan_measurements
from toolpath_stiff.planning.result import Plan
from toolpath_stiff.planning.visits import possible_visits
from toolpath_stiff.report.plan import text
from toolpath_stiff.rig.kinematics import reachable as rig_reachable
from toolpath_stiff.rig.nominal import load_nominal


def menu(**changes) -> Menu:
    return replace(Menu.of(table_1_design()), **changes)


@cache
def plan_for(truth: str, other: str, n: int = 6, noise=READING_SD, **changes) -> RivalPlan:
    return plan_measurements(nist(), rivals(truth, other), noise, n, menu=menu(**changes))


def best_gap(truth: str, other: str, **changes) -> float:
    return plan_for(truth, other, 1, **changes).pairs[0].best_single_pose_sigma


# -- the gap -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made_up():
    """Forecasts of two rivals and a third, their visits and the noise."""
    visits = possible_visits(nist(), menu(), {"force_N"}, np.random.default_rng(1))
    named = [*rivals("frame_compliance", "joint_moment_stiffness"), rivals("joint_compliance", "none")[1]]
    forecasts, good, scatter = forecast_all(nist(), named, visits.readings)
    assert good.all()
    noise = ReadingNoise(0.02, 0.01, scatter)
    return visits, noise, [(f, g, pair_shares(visits, f, g, noise)) for f, g in combinations(forecasts, 2)]


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 7), repeats=st.integers(1, 5))
def test_the_gap_is_the_quadratic_form_in_both_covariances(made_up, seed, count, repeats):
    """Buzzi-Ferraris' d^T (C_i + C_j)^-1 d with the covariances written out in full."""
    visits, noise, pairs = made_up
    chosen = np.random.default_rng(seed).choice(len(visits), count, replace=False)
    rows = np.concatenate([visits.rows(v) for v in chosen])
    clamp = np.repeat(np.arange(count), [len(visits.rows(v)) for v in chosen])
    scatter = (np.diag(np.full(len(rows), 0.02**2)) + 0.01**2 * (clamp[:, None] == clamp)) / repeats
    scatter += noise.machine[rows] @ noise.machine[rows].T
    for first, second, share in pairs:
        total = 2.0 * scatter + sum(f.factor[rows] @ f.factor[rows].T for f in (first, second))
        d = first.mean[rows] - second.mean[rows]
        expected = float(np.sqrt(d @ np.linalg.solve(total, d)))
        # Woodbury subtracts two terms of the size of d^T N^-1 d: absolute accuracy is that of their rounding.
        assert share.gap(np.tile(chosen, repeats)) == pytest.approx(expected, abs=1e-4)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_another_visit_never_narrows_a_gap(made_up, seed):
    visits, _, pairs = made_up
    share = pairs[0][2]
    chosen = np.random.default_rng(seed).choice(len(visits), 3, replace=False)
    before = share.gap(chosen)
    assert (np.sqrt(share.squares_with(chosen)) >= before - 1e-6).all()


def nudged(fit: Rival) -> Rival:
    """The fit, another in its 11th digit."""
    factors = 1.0 + 1e-11 * np.random.default_rng(3).uniform(-1.0, 1.0, len(fit.covariance))
    return replace(fit, law=np.multiply(fit.law, factors[:2]), covariance=fit.covariance * np.outer(factors, factors))


@pytest.mark.parametrize(
    "pair", [("joint_moment_stiffness", "contact_nonlinearity"), ("frame_compliance", "joint_moment_stiffness")]
)
def test_a_fit_that_differs_in_its_11th_digit_forecasts_the_same(pair):
    """Variances of 1e-4, 1e-18 and 1e9 stand in one covariance: law, compliance and stiffness in SI units."""
    visits = possible_visits(nist(), menu(oblique=False), {"force_N"}, np.random.default_rng(1))
    for one in rivals(*pair):
        (first, second), good, _ = forecast_all(nist(), [one, nudged(one)], visits.readings)
        assert good.any()
        assert second.mean[good] == pytest.approx(first.mean[good], rel=1e-6)
        spreads = [np.linalg.norm(found.factor[good], axis=1) for found in (first, second)]
        assert spreads[0].min() > 0.0
        assert spreads[1] == pytest.approx(spreads[0], rel=1e-6)


@pytest.mark.parametrize("scale", [0.02, -0.1])
def test_a_gauge_off_by_a_known_factor(scale):
    """Readings along X, two a visit, differ by ln(1 + s), all others by nothing: sqrt(2 n) |ln(1 + s)| / (sqrt 2 r)."""
    known = [Rival("none"), Rival("gauge_scale", candidates=(candidate("gauge_scale"),), sizes=(np.array([scale]),))]
    visits = possible_visits(nist(), menu(oblique=False), (), np.random.default_rng(0))
    forecasts = forecast_all(nist(), known, visits.readings)[0]
    share = pair_shares(visits, *forecasts, ReadingNoise(0.02, 0.0, np.zeros((len(visits.readings), 0))))
    twice = np.flatnonzero(visits.counts == 6)[:5]
    assert share.gap(twice) == pytest.approx(np.sqrt(10.0) * abs(np.log1p(scale)) / (np.sqrt(2.0) * 0.02), rel=1e-9)


def test_a_difference_that_refitting_closes_is_no_gap():
    """Strut laws 10 % apart but known to 20 % only: however exact the readings, |difference| / (sqrt 2 sd) at most."""
    loose = np.eye(2) * 0.2**2
    pair = [Rival("one", covariance=loose), Rival("two", (0.1, 0.1), covariance=loose)]
    found = plan_measurements(nist(), pair, 1e-9, 6, menu=menu(), strut_spread=0.0)
    assert found.pairs[0].separation_sigma <= np.hypot(0.1, 0.1) / (np.sqrt(2.0) * 0.2) * 1.01
    assert any("no measurement is better" in note for note in found.notes)
    known = [replace(r, covariance=None) for r in pair]
    assert plan_measurements(nist(), known, 0.02, 6, menu=menu()).pairs[0].separation_sigma > 3.0


@pytest.mark.parametrize("gap", [0.3, 1.0, 2.0])
def test_expected_probability_of_the_truth(gap):
    """Two rivals: ln of the Bayes factor is normal, mean gap^2, variance 2 gap^2; its expectation by quadrature."""
    spread = np.sqrt(2.0) * gap
    expected, _ = quad(
        lambda x: norm.pdf(x, gap**2, spread) / (1.0 + np.exp(-x)), gap**2 - 9 * spread, gap**2 + 9 * spread
    )
    noise = ReadingNoise(1.0, 0.0, np.zeros((1, 0)))
    forecasts = [Forecast(n, 0.5, np.array([m]), np.zeros((1, 0))) for n, m in (("a", 0.0), ("b", gap * np.sqrt(2.0)))]
    found = expected_outcome(forecasts, np.array([0]), np.array([0]), noise, seed=3)
    # 400 draws a rival of a figure between 0 and 1: four standard errors.
    assert found.truth == pytest.approx(expected, abs=4 * 0.5 / np.sqrt(800))


def test_a_verdict_is_settled_where_a_diagnosis_would_name_it():
    """Ln of the Bayes factor is normal, as above; a rival is named once prior odds times it leave `NAMED`."""
    gap, weights = 2.0, np.array([0.7, 0.3])
    forecasts = [
        Forecast(name, weight, np.array([mean]), np.zeros((1, 0)))
        for name, weight, mean in zip("ab", weights, (0.0, gap * np.sqrt(2.0) * 0.02), strict=True)
    ]
    noise = ReadingNoise(0.02, 0.0, np.zeros((1, 0)))
    found = expected_outcome(forecasts, np.array([0]), np.array([0]), noise, seed=3)
    needed, sd = np.log(NAMED / (1.0 - NAMED)), gap * np.sqrt(2.0)
    middle = np.log(weights / (1.0 - weights)) + gap**2
    chances = norm.sf((needed - middle) / sd) + norm.cdf((-needed - middle) / sd)
    assert found.settled == pytest.approx(weights @ chances, abs=3.0 * np.sqrt(0.25 / 400))


def test_a_plan_counts_what_readings_of_one_machine_have_in_common():
    """Struts, joints and the links taken for rigid, as a diagnosis does; joints there by differences over half a mm."""
    visits = possible_visits(nist(), menu(), (), np.random.default_rng(2))
    some = visits.readings.select(np.arange(0, len(visits.readings), 401))
    predictor, factor = Predictor(nist(), some), forecast_all(nist(), [Rival("none")], some)[2]
    parts = (0.01 * predictor.strut_columns(), 5e-4 * predictor.joint_columns, 0.003 * predictor.rest_columns())
    expected = sum(part @ part.T for part in parts)
    assert np.abs(factor @ factor.T - expected).max() < 0.02 * np.diag(expected).max()


# -- what splits what --------------------------------------------------------------------------------------------------


def test_spindle_against_table_needs_tilt():
    """Upright they are the same spring; a longer tool is no help, as the catalogue's spindle does not grow with it."""
    upright = best_gap("spindle_compliance", "table_compliance", max_tilt=0.0)
    assert upright < 0.05
    found = plan_for("spindle_compliance", "table_compliance")
    assert found.pairs[0].separation_sigma > 3.0
    assert all(found.visits.tilt(v) > np.radians(10.0) for v in found.chosen)


def test_frame_against_joint_moment_is_split_by_tilt():
    assert best_gap("frame_compliance", "joint_moment_stiffness") > 3.0 * best_gap(
        "frame_compliance", "joint_moment_stiffness", max_tilt=0.0
    )


def test_contact_against_clearance_is_split_by_another_load():
    """Clearance falls with 1 / F, contact with F^(-1/3): at 1000 N alone both were fitted to look alike."""
    same = best_gap("contact_nonlinearity", "joint_clearance", loads=(1000.0,))
    other = best_gap("contact_nonlinearity", "joint_clearance")
    assert other > 2.0 * same
    found = plan_for("contact_nonlinearity", "joint_clearance")
    assert {500.0, 4000.0} <= set(
        found.visits.readings.force[np.concatenate([found.visits.rows(v) for v in found.chosen])]
    )


def test_riser_against_table_is_split_by_the_same_pose_without_the_riser():
    """At the very poses that were measured on the riser, upright, reference tool."""
    found = plan_for("setup_compliance", "table_compliance", max_tilt=0.0, tool_extensions=(0.0,))
    share = found.shares[("setup_compliance", "table_compliance")]
    gaps, visits = np.sqrt(share.squares_with(())), found.visits
    on_riser = (visits.label != "") & (visits.pose[:, 2] > 1.0)
    with_riser, without = on_riser & (visits.setup == "riser"), on_riser & (visits.setup == "no riser")
    assert (gaps[without] > 2.0 * gaps[with_riser]).all()  # place by place, the same readings
    assert gaps[without].max() > 3.0


@pytest.mark.parametrize("other", ["none", "strut_law"])
def test_a_constant_joint_compliance_is_never_told_from_the_struts_own(other):
    found = plan_for("joint_compliance", other)
    (pair,) = found.pairs
    assert pair.separation_sigma < 1.0 and not pair.separable and not found.separable
    assert "strut end" in pair.indicator_across["joints"]
    assert found.after.truth < 0.8 and found.after.settled < 0.2
    assert any("indicator" in line for line in found.sentences)


def test_a_plan_that_gains_nothing_says_so_first() -> None:
    """Joints against the struts' own softness: a chance of about a half, before and after."""
    found = plan_for("joint_compliance", "none")
    first = "nothing worth measuring at the tip; an indicator across a joint would tell joint_compliance from none"
    assert not found.gains and found.sentences[0].startswith(first)
    assert not any("is expected to rise" in line for line in found.sentences)
    whole = Plan(nist(), None, found, (), 0)
    assert text(whole).startswith(first) and not whole.to_dict()["worth_measuring"]
    worth = plan_for("spindle_compliance", "table_compliance")
    assert worth.gains and "is expected to rise" in worth.sentences[0]


def random_visits(plan, n, seed):
    """As many visits to different places drawn from the same menu."""
    free, rng, drawn = np.ones(len(plan.visits), dtype=bool), np.random.default_rng(seed), []
    while len(drawn) < n and free.any():
        drawn.append(int(rng.choice(np.flatnonzero(free))))
        free &= ~plan.visits.same_place(drawn[-1])
    return drawn


def test_a_plan_beats_visits_drawn_at_random():
    for pair in (("frame_compliance", "joint_moment_stiffness"), ("spindle_compliance", "table_compliance")):
        found = plan_for(*pair)
        share = next(iter(found.shares.values()))
        drawn = [share.gap(random_visits(found, 6, seed)) for seed in range(20)]
        assert share.gap(found.chosen) > max(drawn)


# -- the plan ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("machine", ["nist", "genhexkins", "nategh_agheli"])
def test_every_possible_visit_is_reachable_for_the_rig_as_well(machine):
    """The rig has kinematics and a reader of limits of its own."""
    visits = possible_visits(load_machine(machine), Menu(), (), np.random.default_rng(0))
    assert len(visits) > 100
    assert rig_reachable(load_nominal(machine), visits.pose[:, :3], visits.pose[:, 3:], visits.extension).all()


def test_poses_are_tilted_no_further_and_lie_no_wider_than_allowed():
    wanted = menu(radius=0.2, max_tilt=np.radians(10.0), heights=(0.6, 0.9), measured=np.zeros((0, 6)), labels=())
    visits = possible_visits(nist(), wanted, (), np.random.default_rng(0))
    assert max(visits.tilt(v) for v in range(len(visits))) <= np.radians(10.0) + 1e-9
    assert np.hypot(*visits.pose[:, :2].T).max() <= 0.2 + 1e-9
    assert set(np.round(visits.pose[:, 2], 9)) == {0.6, 0.9}


def test_places_are_different_and_the_same_seed_gives_the_same_plan():
    first = plan_for("frame_compliance", "joint_moment_stiffness")
    again = plan_for.__wrapped__("frame_compliance", "joint_moment_stiffness")
    assert first.chosen == again.chosen and first.sentences == again.sentences and first.pairs == again.pairs
    places = {(v.pose[k].tobytes(), v.extension[k], v.setup[k]) for v in [first.visits] for k in first.chosen}
    assert len(places) == len(first.chosen) == 6


def test_what_is_dear_is_avoided():
    """The longer tool helps here, but not if changing it costs a day."""
    pair = rivals("frame_compliance", "joint_moment_stiffness")
    cheap = plan_measurements(nist(), pair, 0.02, menu=menu(costs={**COSTS, "tool": 0.0}))
    dear = plan_measurements(nist(), pair, 0.02, menu=menu(costs={**COSTS, "tool": 480.0}))
    assert cheap.visits.extension[list(cheap.chosen)].any()
    assert not dear.visits.extension[list(dear.chosen)].any()
    assert dear.minutes < 480.0


def test_minutes_count_every_change_once():
    found = plan_for("spindle_compliance", "table_compliance", 4, max_tilt=np.radians(25.0), tool_extensions=(0.0,))
    readings = int(found.visits.counts[list(found.chosen)].sum())
    assert found.minutes == pytest.approx(4 * COSTS["pose"] + readings * COSTS["reading"])


def test_repeats_and_noise_hang_together():
    """More noise needs more repeats; less noise needs fewer poses."""
    exact = plan_for("spindle_compliance", "table_compliance", noise=0.005)
    vague = plan_for("spindle_compliance", "table_compliance", noise=0.10)
    assert exact.enough is not None and exact.enough <= 2
    assert vague.enough is None and (vague.repeats is None or vague.repeats > 1)
    assert vague.after.truth < exact.after.truth


def test_a_certain_rival_takes_no_visits_from_the_doubtful_ones():
    """Three rivals, one of them next to impossible: the plan is that for the other two."""
    pair = rivals("frame_compliance", "joint_moment_stiffness")
    third = replace(rival("none", np.log(table_1_design().stiffness)), name="measured", weight=1e-12)
    both = plan_for("frame_compliance", "joint_moment_stiffness")
    three = plan_measurements(nist(), [*pair, third], 0.02, menu=menu())
    names = (pair[0].name, pair[1].name)
    assert three.shares[names].gap(three.chosen) > 0.8 * both.shares[names].gap(both.chosen)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"n": 0}, "0 poses"),
        ({"noise_relative": 0.0}, "noise"),
        ({"rivals": []}, "two or more"),
        ({"menu": Menu(heights=(20.0,))}, "reaches none"),
    ],
)
def test_plans_that_cannot_be(change, words):
    asked = {"rivals": rivals("frame_compliance", "joint_moment_stiffness"), "noise_relative": 0.02, "n": 2} | change
    with pytest.raises(InputError, match=words):
        plan_measurements(nist(), **asked)


@pytest.mark.parametrize("change", [{"loads": ()}, {"loads": (-5.0,)}])
def test_menus_that_cannot_be(change):
    with pytest.raises(InputError):
        Menu(**change)


def test_no_set_up_is_used_lower_than_it_was_measured():
    """Table 1 has the riser at 1268 mm only, and nothing below 353 mm."""
    visits = possible_visits(nist(), menu(), {"setup"}, np.random.default_rng(0))
    assert visits.pose[visits.setup == "riser", 2].min() > 1.26
    assert 0.35 < visits.pose[visits.setup == "no riser", 2].min() < 0.5
