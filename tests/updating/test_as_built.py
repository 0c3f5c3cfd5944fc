"""Struts and joints as built: what an update finds against a machine that is off its drawing, and its machine file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.updating.cases import nist
from toolpath_stiff.correction.as_built import AS_BUILT
from toolpath_stiff.correction.task import UpdateTask
from toolpath_stiff.correction.update import update
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.file import parse_machine
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.rig import case as rig
from toolpath_stiff.rig.exercise import csv_text
from toolpath_stiff.rig.hidden import readings


@pytest.fixture(scope="module")
def weak(tmp_path_factory):
    """A machine of the rig with a weak strut, its struts and joints off their drawing; updated."""
    case = rig.draw_case(9006, hidden="weak_strut")
    file = tmp_path_factory.mktemp("weak") / "measured.csv"
    file.write_text(csv_text(case.rows))
    return case, update(
        UpdateTask(nist(), read_measurements(str(file), nist()), add=["weak_strut"], files=(str(file),))
    )


def test_the_true_machine_and_its_struts_agree_with_it(weak):
    case, found = weak
    assert found.accepted and found.steps[-1].name == AS_BUILT
    assert found.last.held.mean_error < found.model.held.mean_error
    # Against what the hidden machine would show without scatter, which no fit has seen.
    true = np.log(readings(case.nominal, case.machine, rig.rows_of(case.rows)))
    modelled = [found.task.problem.observed - step.residual for step in (found.model, found.last)]
    before, after = (float(np.abs(true - each).mean()) for each in modelled)
    assert after < 0.6 * before
    # Nearer to the true struts than the law alone, the weak one apart, which the effect's size has taken up.
    factors = np.log(case.machine.strut_factors)[np.arange(6) != found.last.fit.effects[0].values["strut"] - 1]
    moved = found.as_built.as_built[:6][np.arange(6) != found.last.fit.effects[0].values["strut"] - 1]
    assert np.abs(moved - factors).mean() < np.abs(factors).mean()


def test_the_machine_file_holds_it_and_predicts_the_same(weak):
    found = weak[1]
    again = parse_machine(machine_toml(found.corrected))
    assert again.as_built == pytest.approx(found.as_built.as_built, abs=2e-8)
    modelled = Predictor(again, found.task.data).log_stiffness()
    assert modelled == pytest.approx(found.task.problem.observed - found.last.residual, abs=1e-6)


def test_left_out_residuals_are_those_of_the_readings_that_stay(weak):
    """Each point by an update of the others, solved at once by normal equations of law, sizes and offsets together."""
    found = weak[1]
    fit, data = found.last.fit, found.task.data
    fit = replace(fit, residual=found.task.problem.residual(fit.law, fit.effects))
    held = found.last.held.residual
    covariance, known = fit.scatter.covariance, fit.scatter.covariance.shared
    whole = np.linalg.inv(fit.scatter.precision.times(np.eye(len(data))))
    for label in np.unique(data.point)[:3]:
        out = data.point == label
        weight = np.linalg.inv(whole[np.ix_(~out, ~out)])
        J, r = fit.jacobian[~out], fit.residual[~out]
        free = J if fit.law_free else J[:, 2:]
        move = np.linalg.solve(free.T @ weight @ free, free.T @ weight @ r)
        left = r - free @ move
        offsets = known[:42, ~out] @ weight @ left
        columns = fit.jacobian[out] if fit.law_free else fit.jacobian[out][:, 2:]
        expected = fit.residual[out] - columns @ move - known[:42, out].T @ offsets
        assert held[out] == pytest.approx(expected, abs=2e-4)
    assert len(covariance) == len(data)


def test_nothing_is_moved_where_something_else_is_missing(weak):
    """Offsets beyond three standard deviations are no tolerance: here a strut 20 % weak, of which nothing is said."""
    bare = update(replace(weak[1].task, add=(), strut_law=True, force=True))
    assert bare.accepted and bare.as_built is None


@pytest.mark.parametrize(("key", "value"), [("struts_percent", "[1, 2]"), ("frame_joints_mm", "[[40, 0, 0]]")])
def test_a_wrong_section_is_told(weak, key, value):
    text = machine_toml(weak[1].corrected)
    begin = text.index(f"{key} = ", text.index("[as_built]"))
    end = text.index("platform_joints_mm" if key.startswith("frame") else "frame_joints_mm", begin)
    with pytest.raises(InputError, match=rf"\[as_built\] {key}"):
        parse_machine(f"{text[:begin]}{key} = {value}\n{text[end:]}")
