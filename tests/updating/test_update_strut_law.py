"""The paper's own estimation of the strut law and its Figure 3, repeated with the model and scipy's simplex search."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from toolpath_stiff.correction.mean_error import update_by_mean_error
from toolpath_stiff.correction.task import MEAN_ERROR, UpdateTask
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.readings.measurements import read_measurements

PRINTED = np.array([46.5, 32.5])  # N/um


@pytest.fixture(scope="module")
def table_1():
    machine = load_machine("nist")
    return Predictor(machine, read_measurements("nist-table1", machine))


def mean_error(predictor, ends=PRINTED):
    modelled = np.exp(predictor.log_stiffness(np.log(np.asarray(ends) / PRINTED)))
    return float(np.abs(modelled / predictor.data.stiffness - 1.0).mean())


def search(predictor, start=PRINTED):
    """The law (N/um) with the smallest mean error. A second search from the first one's end: it may stop at a kink."""
    options = {"xatol": 1e-6, "fatol": 1e-10}
    for _ in range(2):
        start = minimize(lambda ends: mean_error(predictor, ends), start, method="Nelder-Mead", options=options).x
    return start, mean_error(predictor, start)


def test_the_printed_constants_are_not_quite_the_minimum(table_1):
    assert mean_error(table_1) == pytest.approx(0.0962, abs=5e-5)  # Table 1 as printed: 9.62 %
    for start in (PRINTED, 1.2 * PRINTED, PRINTED * [0.85, 1.1]):
        ends, error = search(table_1, start)
        assert ends == pytest.approx([46.3, 31.0], abs=0.05)
        assert error == pytest.approx(0.0942, abs=5e-5)


def test_figure_3(table_1):
    """The error over the stiffness of the bars that stand for the platform, with the law as given and refitted."""
    bars = (1e8, 3e8, 1e9, 3e9, 1e10, 1e11, np.inf)
    machines = [table_1.machine.with_changes(platform_bar_stiffness=k) for k in bars]
    predictors = [Predictor(machine, table_1.data) for machine in machines]
    laws, refitted = (np.array(column) for column in zip(*map(search, predictors), strict=True))
    error = np.array([mean_error(predictor) for predictor in predictors])
    # "Stiffnesses above 1 x 10^10 N/m minimise the average error": flat from there, within 1 % of the gain so far.
    assert all(np.diff(error[:4]) < 0.0) and error[-1] == pytest.approx(0.0962, abs=5e-5)
    assert np.ptp(error[4:]) < 0.01 * (error[0] - error[-1])
    # With the law refitted the error falls all the way, and hardly: the law takes the platform's part.
    assert all(np.diff(refitted) < 1e-9)
    assert np.ptp(refitted) < 0.005
    # Softer bars, stiffer struts.
    assert (np.diff(laws, axis=0) < 1e-3).all()


def test_update_repeats_it(table_1):
    found = update_by_mean_error(
        UpdateTask(table_1.machine, table_1.data, strut_law=True, objective=MEAN_ERROR, seed=1)
    )
    assert [100.0 * step.error for step in found.steps] == pytest.approx([9.62, 9.42], abs=5e-3)
    assert found.search["agreeing"] == len(found.search["end_errors_percent"]) == 6
    # Fitted to the points themselves, the law does worse at points that it has not seen.
    assert found.last.held.mean_error > found.last.error
    machine = found.fitted({"command": "", "data_sha256": ""})
    reached = np.array([machine.strut_law.stiffness_1, machine.strut_law.stiffness_2]) / 1e6
    assert reached == pytest.approx(search(table_1)[0], rel=1e-5)
    # The printed constants lie well within what 14 points can tell.
    assert (np.abs(PRINTED - reached) < 2.5 * machine.uncertainty.sd).all()
