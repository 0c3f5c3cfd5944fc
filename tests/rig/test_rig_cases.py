"""Cases drawn from seeds: determinism, sizes, and the noise estimated back from many draws."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.conftest import seeds
from toolpath_stiff.errors import InputError
from toolpath_stiff.rig.case import clamp_of, draw_case, hideable, make_case, rows_of
from toolpath_stiff.rig.effects import CATALOGUE
from toolpath_stiff.rig.exercise import csv_text
from toolpath_stiff.rig.hidden import Nuisances, disturb_readings
from toolpath_stiff.rig.kinematics import reachable
from toolpath_stiff.rig.nominal import load_nominal
from toolpath_stiff.rig.sizes import whitened_length
from toolpath_stiff.rig.unknowns import ODDITIES

NIST = load_nominal("nist")


@pytest.mark.parametrize("layout", ["paper", "tilted"])
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(layout):
    first, second, other = (csv_text(make_case(seed, layout)[0]) for seed in (3, 3, 4))
    assert first == second != other


def test_what_is_hidden_leaves_poses_and_noise_as_they_were():
    """Streams of their own: a case and its control differ by the effect alone."""
    plain, stiff = (make_case(5, "tilted", hidden)[0] for hidden in ("none", "joint_compliance"))
    ratio = stiff["stiffness_N_per_mm"] / plain["stiffness_N_per_mm"]
    assert all(np.array_equal(plain[name], stiff[name]) for name in plain if name != "stiffness_N_per_mm")
    # A constant softening: without the common noise of 2 % the ratio varies far less than the noise would make it.
    assert (ratio < 1.0).all()
    assert np.log(ratio).std() < 0.25 * abs(np.log(ratio).mean())


def test_layouts():
    paper, _ = make_case(1, "paper")
    assert len(paper["x_mm"]) == 42
    assert "sd_N_per_mm" in paper
    tilted, _ = make_case(1, "tilted")
    assert len(tilted["x_mm"]) == 288
    poses = np.column_stack([tilted[name] for name in ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")])
    assert len(np.unique(poses, axis=0)) == 24
    assert len(np.unique(poses[:, 2])) >= 4  # the heights that a curved strut law asks for
    assert sorted(set(tilted["force_N"])) == [500.0, 4000.0]
    assert (np.hypot(tilted["a_deg"], tilted["b_deg"]) > 4.9).all()  # 5 degrees, rounded to 0.1
    assert len(set(tilted["clamp"])) == 48
    assert set(tilted["setup"]) == {"table", "riser"}
    assert len(np.unique(poses[np.array(tilted["tool_extension_mm"]) > 0.0], axis=0)) == 4


@pytest.mark.parametrize("seed", range(5))
def test_tilted_poses_are_within_the_machines_limits(seed):
    rows = rows_of(make_case(seed, "tilted", "none")[0])
    assert reachable(NIST, rows.position, rows.angles, rows.extension).all()


@pytest.mark.parametrize("name", [*CATALOGUE, *ODDITIES])
def test_every_effect_shows_at_the_size_asked_for(name):
    """A change of 5 % rms, or less where the effect's bound is nearer; the data do change."""
    rows, truth = make_case(2, "tilted", name, size=0.05, noise=Nuisances.none())
    plain, _ = make_case(2, "tilted", "none", noise=Nuisances.none())
    change = np.log(rows["stiffness_N_per_mm"] / plain["stiffness_N_per_mm"])
    seen = np.sqrt(np.mean(change**2))
    assert seen == pytest.approx(truth["effects"][0]["size"], rel=0.01)  # parameters are rounded to four digits
    assert seen == pytest.approx(0.05, rel=0.03)  # the search stops within 2 %


def test_blind_sizes_reach_from_just_detectable_to_30_percent():
    found = [make_case(seed, "paper", "table_compliance")[1]["effects"][0] for seed in seeds(0, 60)]
    sizes, seen = (np.array([effect[key] for effect in found]) for key in ("size", "detectability"))
    assert sizes.max() <= 0.30 * 1.03
    assert sizes.max() > 0.2
    # 3.9 is what 80 % power takes; extrapolated to first order from 3 %.
    assert 3.5 < seen.min() < 6.0


@pytest.mark.parametrize("seed", range(12))
def test_a_strength_that_grows_faster_than_in_proportion_still_ends_at_30_percent(seed):
    """A weak strut's compliance grows without bound as its stiffness falls."""
    effect = make_case(seed, "paper", "weak_strut", size=0.3)[1]["effects"][0]
    assert effect["size"] < 0.30 * 1.025  # the search stops within 2 %, parameters are rounded to four digits


def test_two_effects_and_blind_draws():
    _, truth = make_case(11, "tilted", "two")
    assert len(set(truth["hidden"])) == 2
    # The rarest, 15 %, is not among 60 once in 17,000 times.
    kinds = [make_case(seed, "paper")[1]["kind"] for seed in seeds(0, 60)]
    assert set(kinds) == {"none", "one", "two", "outside"}


def test_the_paper_layout_hides_nothing_that_its_columns_cannot_show():
    assert "thermal_drift" not in hideable(make_case(1, "paper", "none")[0], fem=False)[0]
    with pytest.raises(InputError, match="time_min"):
        make_case(1, "paper", "thermal_drift")


def test_nuisances_estimated_back_from_repeated_readings():
    """One true value read 40,000 times, 10 readings a clamp, without outliers."""
    clamps = np.repeat(np.arange(4000), 10)
    nuisances = Nuisances(repeat=0.02, clamping=0.01, outliers=0.0, rounded=False)
    shown = disturb_readings(np.full(40_000, 5e7), clamps, nuisances, np.random.default_rng(1))
    logs = np.log(shown / 5e7).reshape(4000, 10)
    within = logs.std(axis=1, ddof=1) ** 2
    between = logs.mean(axis=1).var(ddof=1) - within.mean() / 10.0
    # Sampling error of a variance from m values: sqrt(2 / m) of it; four of them.
    assert within.mean() == pytest.approx(0.02**2, rel=4.0 * np.sqrt(2.0 / 36_000))
    assert between == pytest.approx(0.01**2, rel=4.0 * np.sqrt(2.0 / 4000) * (0.01**2 + 0.02**2 / 10.0) / 0.01**2)


def test_two_percent_of_the_readings_are_outliers():
    clamps = np.arange(100_000)
    nuisances = Nuisances(repeat=0.02, clamping=0.0, rounded=False)
    logs = np.log(disturb_readings(np.ones(100_000), clamps, nuisances, np.random.default_rng(2))) / 0.02
    # Beyond four standard deviations: 6e-5 of a normal, 2 Q(1) = 31.7 % of the wide ones; four sampling errors.
    expected = 0.02 * 0.3173 + 0.98 * 6.3e-5
    assert (np.abs(logs) > 4.0).mean() == pytest.approx(expected, abs=4.0 * np.sqrt(expected / 100_000))


def test_whitened_length_against_the_dense_covariance():
    rng = np.random.default_rng(4)
    clamps = np.unique(rng.integers(0, 20, 100), return_inverse=True)[1]
    spread, x = rng.normal(size=(100, 8)), rng.normal(size=100)
    dense = 0.02**2 * np.eye(100) + 0.01**2 * (clamps[:, None] == clamps) + spread @ spread.T
    expected = np.sqrt(x @ np.linalg.solve(dense, x))
    # The dense matrix has a condition number of 1e6.
    assert whitened_length(clamps, spread, Nuisances())(x) == pytest.approx(expected, rel=1e-8)


def test_strut_spread_and_joint_errors_over_many_machines():
    cases = [draw_case(seed, "paper", "none") for seed in seeds(0, 150)]
    factors = np.array([case.machine.strut_factors for case in cases])
    errors = np.array([case.machine.frame_errors for case in cases])
    # Four sampling errors of a standard deviation, 1 / sqrt(2 m).
    assert factors.std() == pytest.approx(0.01, rel=4.0 / np.sqrt(2 * factors.size))
    assert errors.std() == pytest.approx(0.5e-3, rel=4.0 / np.sqrt(2 * errors.size))


def test_readings_scatter_about_the_model_as_the_nuisances_say():
    """Whole cases: variance of ln k over seeds is repeat, outliers, clamping and strut spread together."""
    exact = make_case(0, "paper", "none", noise=Nuisances.none())[0]["stiffness_N_per_mm"]
    logs = np.array(
        [np.log(make_case(seed, "paper", "none")[0]["stiffness_N_per_mm"] / exact) for seed in seeds(0, 200)]
    )
    # Strut spread reaches the tip as 1 % times the root of the summed squared energy shares: between 1/sqrt(6) and 1.
    own = 0.02**2 * (0.98 + 0.02 * 16.0) + 0.01**2
    low, high = own + 0.01**2 / 6.0, own + 0.01**2
    assert 0.95 * low < logs.var() < 1.05 * high  # 8400 values, some correlated: 2 to 3 % sampling error


def test_rows_of_one_clamp_move_together_and_without_that_column_those_of_one_pose():
    paper, _ = make_case(1, "paper")
    assert clamp_of(paper).tolist() == np.repeat(np.arange(14), 3).tolist()
    tilted, _ = make_case(1, "tilted")
    assert np.array_equal(clamp_of(tilted) + 1, tilted["clamp"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": -1}, "seed"),
        ({"layout": "round"}, "layout"),
        ({"hidden": "gremlin"}, "gremlin"),
        ({"hidden": "weak_strut,weak_strut"}, "once"),
        ({"noise": 0.9}, "noise"),
        ({"machine": "nowhere"}, "nowhere"),
        ({"layout": "campaign"}, "together"),
    ],
)
def test_wrong_arguments_are_named(arguments, message):
    with pytest.raises(InputError, match=message):
        make_case(**{"seed": 1, **arguments})


def test_a_machine_that_already_carries_effects_is_refused():
    text = NIST.text + '\n[[effect]]\nname = "weak_strut"\nstrut = 1\nfactor = 0.5\n'
    with pytest.raises(InputError, match="effect"):
        from toolpath_stiff.rig.nominal import parse_nominal

        parse_nominal(text, "mine.toml")


def test_other_machines_are_measured_at_poses_of_ones_own():
    plan = {"x_mm": np.zeros(3), "y_mm": np.zeros(3), "z_mm": np.full(3, 800.0), "direction": ["X", "Y", "Z"]}
    turned = dataclasses.replace(NIST, law_stiffnesses=NIST.law_stiffnesses * 2.0)
    rows, doubled = (
        make_case(1, "campaign", "none", machine=machine, plan=plan, noise=Nuisances.none())[0]
        for machine in (NIST, turned)
    )
    assert doubled["stiffness_N_per_mm"] == pytest.approx(2.0 * rows["stiffness_N_per_mm"])


def test_sizes_of_several_effects_are_set_one_by_one():
    names = ("spindle_compliance", "weak_strut", "gauge_scale")
    truth = make_case(4, "paper", names, size=(0.10, 0.07, 0.05))[1]
    assert truth["kind"] == "three"
    assert [effect["size"] for effect in truth["effects"]] == pytest.approx([0.10, 0.07, 0.05], rel=0.03)
    with pytest.raises(InputError, match="2 sizes for 3"):
        make_case(4, "paper", names, size=(0.1, 0.05))
    assert len(set(make_case(11, "paper", "three")[1]["hidden"])) == 3
