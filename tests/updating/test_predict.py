"""What the model says to each reading: against a machine solved by hand, and against the rig's own mechanics."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.conftest import as_written
from tests.stiffness.cases import nist, orthogonal_hexapod
from tests.updating.cases import (
    active,
    campaign,
    oblique_directions,
    orthogonal_compliance,
    readings_by_hand,
    table_1,
)
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.prediction import JOINT_STEP, Predictor
from toolpath_stiff.machine.model import EffectEntry
from toolpath_stiff.rig.campaigns import tilted_campaign
from toolpath_stiff.rig.case import rows_of
from toolpath_stiff.rig.hidden import HiddenMachine, readings
from toolpath_stiff.rig.nominal import load_nominal

NOMINAL = load_nominal("nist")


@cache
def tilted() -> Predictor:
    return Predictor(nist(), campaign(5)[0])


def shown_by_rig(hidden: HiddenMachine) -> np.ndarray:
    """(288,) ln(N/m) at the poses of `tilted`, by a simulator that shares no mechanics with the model."""
    table = tilted_campaign(NOMINAL, as_written([5, 1]))  # the rig's stream of seed 5 for its campaign
    return np.log(readings(NOMINAL, hidden, rows_of(table)))


def by_hand(n: int = 12) -> Predictor:
    """The orthogonal hexapod under oblique loads, X, Y and Z first."""
    direction = np.concatenate([np.eye(3), oblique_directions(n - 3)])
    return Predictor(orthogonal_hexapod(), readings_by_hand(np.full(n, 1e7), direction=direction))


@pytest.mark.parametrize("law", [(0.0, 0.0), (np.log(2.0), np.log(2.0)), (0.3, -0.2)])
def test_stiffness_of_the_orthogonal_hexapod(law):
    predictor = by_hand()
    compliance = orthogonal_compliance(predictor.data.direction, *law)
    assert predictor.log_stiffness(law) == pytest.approx(-np.log(compliance), rel=1e-12)
    assert predictor.strut_part(law) == pytest.approx(compliance, rel=1e-12)


def test_columns_of_the_orthogonal_hexapod():
    """Along X only struts 1 and 2 give way, both at the law's first length; along Y struts midway between the two."""
    predictor = by_hand()
    assert predictor.strut_columns()[:3] == pytest.approx(np.kron(np.eye(3), [0.5, 0.5]), abs=1e-12)
    law = predictor.law_columns(predictor.log_stiffness())
    assert law[:3] == pytest.approx(np.array([[1.0, 0.0], [0.25, 0.75], [0.0, 1.0]]), abs=1e-12)
    # All struts twice as stiff: everything twice as stiff (Euler's theorem on homogeneous functions).
    assert law.sum(axis=1) == pytest.approx(1.0, rel=1e-12)
    assert predictor.strut_columns().sum(axis=1) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("law", [(0.0, 0.0), (0.2, -0.1)])
def test_law_columns_are_the_derivatives(law):
    predictor, step = tilted(), 1e-5
    columns = predictor.law_columns(predictor.log_stiffness(law), law)
    slopes = predictor.strut_part_and_slopes(law)[1]
    for j, moved in enumerate(np.eye(2) * step):
        ends = predictor.log_stiffness(law + moved), predictor.log_stiffness(law - moved)
        # Central differences of a smooth function of size 1: error about step^2 + 1e-16 / step.
        assert columns[:, j] == pytest.approx((ends[0] - ends[1]) / (2.0 * step), abs=1e-8)
        parts = predictor.strut_part(np.stack([law + moved, law - moved]))
        assert slopes[j] == pytest.approx((parts[0] - parts[1]) / (2.0 * step), rel=1e-6, abs=1e-16)


def test_the_rig_sees_the_same_machine():
    assert tilted().log_stiffness() == pytest.approx(shown_by_rig(HiddenMachine()), abs=1e-9)


def test_strut_columns_are_what_the_rig_sees_of_a_softer_strut():
    columns, step = tilted().strut_columns(), 1e-4
    for strut in range(6):
        factors = np.ones(6)
        factors[strut] += step
        up = shown_by_rig(HiddenMachine(strut_factors=factors))
        factors[strut] -= 2.0 * step
        down = shown_by_rig(HiddenMachine(strut_factors=factors))
        assert columns[:, strut] == pytest.approx((up - down) / (2.0 * step), abs=1e-7)


def test_joint_columns_are_what_the_rig_sees_of_displaced_joints():
    """The same small displacement of every third coordinate; rig and model both let the control know nothing of it."""
    columns, before = tilted().joint_columns, shown_by_rig(HiddenMachine())
    assert columns.shape == (288, 36)
    for coordinate in range(0, 18, 3):
        error = np.zeros(18)
        error[coordinate + coordinate // 3 % 3] = JOINT_STEP
        frame = shown_by_rig(HiddenMachine(frame_errors=error.reshape(6, 3)))
        platform = shown_by_rig(HiddenMachine(platform_errors=error.reshape(6, 3)))
        at = int(np.flatnonzero(error)[0])
        assert columns[:, at] == pytest.approx((frame - before) / JOINT_STEP, abs=1e-5)
        assert columns[:, 18 + at] == pytest.approx((platform - before) / JOINT_STEP, abs=1e-5)


def test_shuffled_readings_get_the_same_answers():
    """Rows that are alike are solved once; each still gets its own row's answer, instruments and clock included."""
    data = campaign(5)[0]
    order = np.random.default_rng(1).permutation(len(data))
    effects = [
        active("joint_clearance", lost_motion=3e-6),
        active("thermal_drift", rate=1e-9),
        active("gauge_scale", {"direction": 2, "setup": ""}, scale=0.1),
    ]
    plain, shuffled = tilted(), Predictor(nist(), data.select(order))
    assert shuffled.log_stiffness((0.1, 0.0), effects) == pytest.approx(
        plain.log_stiffness((0.1, 0.0), effects)[order], rel=1e-13
    )
    assert shuffled.strut_columns() == pytest.approx(plain.strut_columns()[order], rel=1e-12)
    assert shuffled.strut_lengths() == pytest.approx(plain.strut_lengths()[order], rel=1e-12)
    assert shuffled.strut_forces() == pytest.approx(plain.strut_forces()[order], abs=1e-12)
    assert not np.allclose(shuffled.log_stiffness(), plain.log_stiffness())


def test_repeats_read_differently_only_when_the_clock_matters():
    data = readings_by_hand(np.full(4, 4e7), (0.0, 0.0, 0.8), minutes=[0.0, 10.0, 20.0, 30.0], force=np.full(4, 1000.0))
    predictor = Predictor(nist(), data)
    assert np.ptp(predictor.log_stiffness()) == 0.0
    drift = 1e-6 / 60.0  # m/s: one micrometre a minute
    shown = predictor.log_stiffness((0.0, 0.0), [active("thermal_drift", rate=drift)])
    # The displacement of 1000 N over k grows by the drift: k = F / (F / k + rate t).
    true = np.exp(predictor.log_stiffness()[0])
    assert np.exp(shown) == pytest.approx(1000.0 / (1000.0 / true + drift * data.time), rel=1e-12)


def test_a_law_that_leaves_a_strut_nothing_has_no_answer():
    predictor = Predictor(nist(), table_1())
    assert np.isnan(predictor.log_stiffness((3.0, -3.0))).all()
    assert np.isfinite(predictor.log_stiffness((0.5, -0.5))).all()
    law = nist().strut_law
    with pytest.raises(InputError, match="stiffness"):
        Predictor(nist().with_changes(strut_law=replace(law, stiffness_2=0.01 * law.stiffness_2)), table_1())


def test_effects_come_on_top_of_those_of_the_machine_file():
    """Compliances in series only add up, wherever they are written."""
    entry = EffectEntry("joint_compliance", {"compliance_nm_per_N": 4.0})
    plain, with_file = Predictor(nist(), table_1()), Predictor(nist().with_changes(effects=(entry,)), table_1())
    logs = [plain.log_stiffness(effects=[active("joint_compliance", compliance=c)]) for c in (0.0, 4e-9, 8e-9)]
    assert with_file.log_stiffness() == pytest.approx(logs[1], rel=1e-12)
    table = active("table_compliance", x=5e-9, y=5e-9, z=5e-9)
    both = np.exp(-with_file.log_stiffness(effects=[table]))
    assert both - np.exp(-with_file.log_stiffness()) == pytest.approx(5e-9, rel=1e-9)
    none, single, double = np.exp(-np.array(logs))
    assert double - single == pytest.approx(single - none, rel=1e-9)
    with pytest.raises(InputError, match="given twice"):
        with_file.log_stiffness(effects=[active("joint_compliance", compliance=4e-9)])
    # Beside a compliance that the law does not move, the law moves less than everything.
    assert (with_file.law_columns(with_file.log_stiffness()).sum(axis=1) < 0.95).all()


def test_a_pose_measured_many_times_is_what_it_is_measured_once():
    """With a control that knows nothing of the true joints, so that poses have to be searched; in any order."""
    data = campaign(5)[0]
    order = np.random.default_rng(3).permutation(len(data))
    wrong = active("platform_radius_error", error=0.5e-3)
    whole = Predictor(nist(), data).log_stiffness(effects=[wrong])
    shuffled = Predictor(nist(), data.select(order)).log_stiffness(effects=[wrong])
    np.testing.assert_array_equal(shuffled, whole[order])
    for row in (0, 17, 250):
        alone = Predictor(nist(), data.select(np.array([row]))).log_stiffness(effects=[wrong])
        assert alone[0] == pytest.approx(whole[row], rel=1e-13)
