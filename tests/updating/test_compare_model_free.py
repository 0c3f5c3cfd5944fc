"""Checks without a model: they hold on machines for which the principle holds, and fail where it is broken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.stiffness.cases import nist
from tests.updating.cases import active, correlated_covariance, readings_by_hand, simple_noise, table_1
from toolpath_stiff.comparison.principles import assess, model_free_checks, symmetries
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.readings.measurements import Readings

ROUND = 1e-6  # relative: joints of the packaged machine are given to 1e-7 m of some metres


def modelled(data: Readings, effects=()) -> Readings:
    """The same readings without scatter, from the model."""
    return replace(data, stiffness=np.exp(Predictor(nist(), data).log_stiffness(effects=effects)))


def checked(data: Readings, repeat: float = 0.02):
    noise = simple_noise(len(data), repeat)
    spread = correlated_covariance(noise.repeat**2, np.zeros((len(data), 0)))
    draws = np.random.default_rng(0).normal(size=(400, len(data))) * repeat
    checks, cannot = model_free_checks(nist(), data)
    return assess(checks, data, spread, draws), cannot


def turned_poses() -> Readings:
    """A pose and its images by 120 and 240 degrees, along X, Y, Z; the turned X direction too."""
    turns = np.radians([0.0, 120.0, 240.0])
    positions, directions = [], []
    for angle in turns:
        c, s = np.cos(angle), np.sin(angle)
        q = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        for direction in (*np.eye(3), q[:, 0]):
            if not any(np.allclose(direction, d) and np.allclose(q @ [0.2, 0.05, 0.8], p)
                       for p, d in zip(positions, directions, strict=True)):  # fmt: skip
                positions.append(q @ [0.2, 0.05, 0.8])
                directions.append(direction)
    point = [str(np.round(p, 6)) for p in positions]
    return readings_by_hand(np.full(len(positions), 5e7), positions, directions, point=point)


def test_the_nist_machine_is_threefold_and_weak_links_do_not_matter_to_that():
    found = symmetries(nist())
    assert sum(np.linalg.det(q) > 0.0 for q in found) == 2
    # A machine with its legs in three pairs of other sizes is not.
    lopsided = replace(nist(), frame_joints=nist().frame_joints + np.eye(6, 3) * 0.05)
    assert symmetries(lopsided) == []
    assert isinstance(symmetries(load_machine("genhexkins")), list)


def test_x_and_y_are_alike_on_the_axis_of_a_threefold_machine():
    found, _ = checked(modelled(table_1()))
    on_axis = [one for one in found if one.check == "threefold symmetry on the axis"]
    assert len(on_axis) == 2
    assert all(one.holds and abs(one.percent) < 100.0 * ROUND for one in on_axis)


def test_a_soft_table_breaks_the_symmetry_on_the_axis():
    found, _ = checked(modelled(table_1(), [active("table_compliance", x=5e-9, y=0.0, z=0.0)]))
    on_axis = [one for one in found if one.check == "threefold symmetry on the axis"]
    assert all(not one.holds and one.percent < 0.0 for one in on_axis)
    assert "not alike" in on_axis[0].text


def test_turned_poses_are_images_of_each_other():
    found, _ = checked(modelled(turned_poses()))
    images = [one for one in found if one.check == "symmetric images"]
    # Three pairs of poses: along Z, and along the turned X.
    assert len(images) >= 6
    assert all(abs(one.percent) < 1e-3 for one in images)
    broken, _ = checked(modelled(turned_poses(), [active("weak_strut", {"strut": 3}, factor=0.7)]))
    assert any(not one.holds for one in broken if one.check == "symmetric images")


@pytest.mark.parametrize("exponent", [0.0, 0.1])
def test_hooke(exponent):
    force = np.tile([500.0, 1000.0, 2000.0, 4000.0], 3)
    direction = np.repeat(np.eye(3), 4, axis=0)
    data = readings_by_hand(5e7 * (force / 1000.0) ** exponent, (0.0, 0.0, 0.9), direction, force=force)
    found, _ = checked(data)
    whole = next(one for one in found if one.text.startswith("Load doubled, every direction"))
    assert whole.percent == pytest.approx(100.0 * (2.0**exponent - 1.0), abs=1e-9)
    assert whole.holds == (exponent == 0.0)


def test_set_ups_at_one_pose():
    setup = ["bare", "riser"] * 6
    direction = np.repeat(np.eye(3), 4, axis=0)
    data = readings_by_hand(np.where(np.array(setup) == "riser", 4.5e7, 5e7), (0.0, 0.0, 0.9), direction, setup=setup)
    found, _ = checked(data)
    between = [one for one in found if one.check == "set-ups"]
    assert len(between) == 3
    assert all(one.percent == pytest.approx(100.0 * (5.0 / 4.5 - 1.0)) for one in between)
    assert not any(one.holds for one in between)


def test_what_cannot_be_checked_is_said_with_the_reason():
    _, cannot = checked(table_1())
    reasons = cannot
    assert reasons["proportionality"] == "no pose was measured at two loads"
    assert reasons["set-ups"] == "no pose was measured in two set-ups"


def test_few_false_alarms_over_all_checks_together():
    rng = np.random.default_rng(5)
    exact = modelled(turned_poses())
    alarms = 0
    for _ in range(100):
        found, _ = checked(replace(exact, stiffness=exact.stiffness * np.exp(rng.normal(0.0, 0.02, len(exact)))))
        alarms += any(not one.holds for one in found)
    # 12 or more of 100 has a chance of 0.4 % if 5 % is true.
    assert alarms <= 11
