"""What the studio asks while a slider moves: held against the commands that give the same figures the long way."""

from __future__ import annotations

import numpy as np
import pytest

import toolpath_stiff as tps

SLOT = "G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nG1 Y30\nM2\n"


@pytest.fixture(scope="module")
def hand():
    return tps.preview("nist-table1", "nist", noise_percent=5)


def test_without_effects_the_errors_are_those_of_compare(hand):
    told = tps.compare("nist-table1", "nist", noise_percent=5)
    given = hand.at(strut_law=False)
    baseline = told.to_dict()["baseline"]
    for name in ("mean_abs_error_percent", "bias_percent", "rms_percent"):
        assert given[name] == pytest.approx(baseline[name], rel=1e-4)
    assert given["deviation_percent"] == pytest.approx(told.to_frame()["deviation_percent"].tolist(), abs=1e-3)


def test_without_effects_the_refitted_law_is_that_of_an_update(hand):
    found = tps.update("nist-table1", "nist", strut_law=True, noise_percent=5, force=True).to_dict()["steps"][-1]
    assert hand.at()["mean_abs_error_percent"] == pytest.approx(found["mean_abs_error_percent"], rel=1e-3)


def test_with_the_sizes_of_an_update_the_error_is_that_of_the_update(hand):
    found = tps.update("nist-table1", "nist", add="weak_strut:strut=1", noise_percent=5, force=True).to_dict()
    sizes = found["steps"][-1]["parameters"]["weak_strut"]
    keys = {"strut": 1, "factor": sizes["factor"]["value"]}
    there = found["steps"][-1]["mean_abs_error_percent"]
    assert hand.at({"weak_strut": keys})["mean_abs_error_percent"] == pytest.approx(there, rel=1e-3)


def test_near_another_setting_the_error_is_that_of_the_setting_itself(hand):
    there, here = ({"weak_strut": {"strut": 4, "factor": factor}} for factor in (0.8, 0.82))
    found = hand.at(here)
    for near in (here, there):  # the same readings are wild at both: none
        quick = hand.at(here, near=near)
        assert quick["mean_abs_error_percent"] == pytest.approx(found["mean_abs_error_percent"], rel=1e-4)
        # a thirtieth of the last digit that the studio shows
        assert quick["deviation_percent"] == pytest.approx(found["deviation_percent"], rel=1e-3, abs=3e-3)


def test_the_machine_by_hand_carries_effect_and_law(hand):
    keys = {"strut": 2, "factor": 0.8}
    machine = hand.machine({"weak_strut": keys})
    assert machine.effects == ["weak_strut"]
    told = tps.compare("nist-table1", machine, noise_percent=5).to_dict()["baseline"]["mean_abs_error_percent"]
    assert hand.at({"weak_strut": keys})["mean_abs_error_percent"] == pytest.approx(told, rel=1e-4)


@pytest.mark.parametrize(
    "effects", [{"ghost": {}}, {"weak_strut": {"strut": 9, "factor": 0.8}}, {"weak_strut": {"strut": 1, "factor": 8.0}}]
)
def test_effects_that_cannot_be_are_refused(hand, effects):
    with pytest.raises(tps.InputError):
        hand.at(effects)


@pytest.mark.parametrize("pose", [(0, 0, 800), (100, -50, 600, 5, 0, 20)])
def test_the_reach_ends_where_the_machine_says_so(pose):
    machine = tps.Machine.load("nist")
    rays = np.random.default_rng(1).normal(size=(12, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    turned = (*pose[3:], 0, 0, 0)[:3]
    for ray, length in zip(rays, machine.reach_mm(pose, rays), strict=True):
        inside, outside = (np.add(pose[:3], (length + more) * ray) for more in (-0.5, 0.5))
        assert machine.standing((*inside, *turned))[2].reachable[0]
        assert not machine.standing((*outside, *turned))[2].reachable[0]


def test_from_out_of_reach_there_is_no_way():
    assert tps.Machine.load("nist").reach_mm((0, 0, 3000), [(0, 0, 1)]).tolist() == [0.0]


@pytest.mark.parametrize("origin", [(0, 0, 800, 0, 0, 0), (120, -80, 950, 0, 0, 40)])
def test_a_placement_that_is_tried_has_the_figures_of_its_analysis(origin):
    slot = tps.Program.from_text(SLOT, name="slot.nc")
    tried = tps.try_placement(slot, "nist", step_mm=2).at(origin)
    found = tps.analyze(slot, "nist", origin_mm_deg=origin, step_mm=2)
    for name in ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm"):
        assert tried[name] == pytest.approx(getattr(found, name), rel=1e-6)


def test_a_placement_out_of_reach_has_no_figures():
    tried = tps.try_placement(tps.Program.from_text(SLOT, name="slot.nc"), "nist", step_mm=10).at((3000, 0, 800))
    assert tried["mean_N_per_mm"] is None
    assert tried["margin"] < 0
