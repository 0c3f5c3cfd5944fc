"""Slips of the pen: what changes, what does not, and how much it shows."""

from __future__ import annotations

import numpy as np
import pytest

from tests.rig.slips import SLIPS, slipped_case, with_slip, with_stated_noise
from toolpath_stiff.errors import InputError
from toolpath_stiff.rig.case import draw_case, rows_of
from toolpath_stiff.rig.exercise import csv_text
from toolpath_stiff.rig.hidden import Nuisances
from toolpath_stiff.rig.kinematics import reachable

CASE = draw_case(5, "tilted", "none")


@pytest.mark.parametrize("kind", SLIPS)
def test_only_the_rows_that_the_truth_names_are_written_wrongly(kind):
    table, (truth,) = slipped_case(CASE, 8, kind)
    assert truth["kind"] == kind
    assert list(table) == list(CASE.rows)
    wrong = {
        row + 1
        for name, values in table.items()
        for row, (written, meant) in enumerate(zip(values, CASE.rows[name], strict=True))
        if written != meant
    }
    assert wrong == set(truth["rows"])
    for name, written in truth["written"].items():
        rows = [row - 1 for row in truth["rows"]]
        assert [table[name][row] for row in rows] == written
        assert [CASE.rows[name][row] for row in rows] == truth["meant"][name]
    reached = rows_of(table)
    assert reachable(CASE.nominal, reached.position, reached.angles, reached.extension).all()
    assert csv_text(slipped_case(CASE, 8, kind)[0]) == csv_text(table)


def test_units_are_the_published_factors():
    """1 N/mm is 5.7101 lbf/in and 0.001 N/um."""
    for kind, factor in (("lbf_per_in", 5.710147), ("N_per_um", 1e-3)):
        _, (truth,) = slipped_case(CASE, 3, kind)
        written, meant = (truth[key]["stiffness_N_per_mm"][0] for key in ("written", "meant"))
        assert written / meant == pytest.approx(factor, rel=1e-4)


def test_how_much_a_slip_shows_is_what_it_does_to_the_residuals():
    """A unit is off by ln 5.71 = 1.742: 87 times the repeat noise of 2 %, a little less beside the other scatter."""
    _, (truth,) = slipped_case(CASE, 3, "lbf_per_in")
    assert 75.0 < truth["detectability"] < np.log(5.710147) / 0.02
    # 10 mm change the stiffness by less than a reading's noise.
    assert slipped_case(CASE, 3, "pose_10_mm")[1][0]["detectability"] < 5.0


def test_several_slips_are_in_different_rows():
    table, truths = slipped_case(CASE, 1, count=4)
    rows = [row for truth in truths for row in truth["rows"]]
    assert len(rows) == len(set(rows))
    assert len(truths) == 4
    assert len(table["x_mm"]) == 288


def test_a_slip_that_the_table_has_no_room_for_is_refused():
    rng = np.random.default_rng(1)
    with pytest.raises(InputError, match="sign_of_angle"):
        with_slip(CASE, draw_case(1, "paper", "none").rows, rng, "sign_of_angle")
    with pytest.raises(InputError, match="no slip called"):
        with_slip(CASE, CASE.rows, rng, "coffee")


def test_a_noise_is_stated_as_it_is_or_by_a_factor():
    table, truth = with_stated_noise(CASE.rows, Nuisances(repeat=0.02, clamping=0.01), 0.5)
    assert truth["true_percent"] == pytest.approx(2.236, abs=1e-3)
    assert truth["stated_percent"] == pytest.approx(1.118, abs=1e-3)
    relative = table["sd_N_per_mm"] / np.asarray(table["stiffness_N_per_mm"])
    assert relative == pytest.approx(np.full(288, 0.01118), abs=1e-5)
