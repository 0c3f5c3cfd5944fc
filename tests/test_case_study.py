"""The paper's case study on its four paths: figures, conclusions, where they stop holding, and repeatable bytes."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

import pytest

from toolpath_stiff.cli.main import main
from toolpath_stiff.machine import load_machine
from toolpath_stiff.placement.case_study import LOW_MM, run_case_study
from toolpath_stiff.stiffness.model import build_model

ROOT = Path(__file__).parent.parent
COMMITTED = ROOT / "reports" / "case_study"


@pytest.fixture(scope="module")
def study():
    return run_case_study(build_model(load_machine("nist")))


def region(study, name):
    return next(row for row in study.summary["regions"] if row["region"] == name)


@pytest.mark.parametrize(
    ("name", "mean", "spread"),
    [("1", 38700, 7650), ("3", 58380, 10120), ("4", 58320, 9460)],  # by another program, printed to 10 N/mm
)
def test_figures_of_the_regions(study, name, mean, spread):
    # The other program's sampling is not stated: whether end points count moves the mean by 1e-4.
    assert region(study, name)["mean_N_per_mm"] == pytest.approx(mean, abs=5 + 1e-4 * mean)
    assert region(study, name)["range_N_per_mm"] == pytest.approx(spread, abs=5)


def test_the_papers_three_conclusions(study):
    for low, high in (("1", "3"), ("2", "4")):
        assert region(study, low)["z_mm"] == LOW_MM < region(study, high)["z_mm"]
        assert region(study, low)["mean_N_per_mm"] < region(study, high)["mean_N_per_mm"]
        assert region(study, low)["range_N_per_mm"] < region(study, high)["range_N_per_mm"]
    for one, two in (("1", "2"), ("3", "4")):
        means = region(study, one)["mean_N_per_mm"], region(study, two)["mean_N_per_mm"]
        ranges = region(study, one)["range_N_per_mm"], region(study, two)["range_N_per_mm"]
        assert abs(means[0] / means[1] - 1) < 0.01
        assert 0 < abs(ranges[0] / ranges[1] - 1) < 0.2
    assert [found["holds"] for found in study.summary["conclusions"]] == [True, True, True]


def test_a_false_conclusion_would_be_told(study):
    from toolpath_stiff.placement.case_study import _conclusions

    figures = {row["region"]: dict(row) for row in study.summary["regions"]}
    figures["3"]["mean_N_per_mm"] = 1.0
    assert [found["holds"] for found in _conclusions(figures)] == [False, True, False]


def test_where_the_conclusions_stop_holding(study):
    limits = study.summary["limits_of_the_conclusions"]
    assert limits["largest_mean_at_z_mm"] == pytest.approx(1100, abs=25)  # "near 1100 mm", steps of 25
    assert limits["largest_range_at_z_mm"] == pytest.approx(900, abs=25)  # "near 900 mm"


def test_non_planar_cuts_widen_the_range(study):
    flat = region(study, "3")["range_N_per_mm"]
    ranges = [wave["regions"][2]["range_N_per_mm"] for wave in study.summary["non_planar"]]
    assert flat < ranges[0] < ranges[1] < ranges[2]


def test_committed_report_is_repeated_byte_for_byte(tmp_path, capsys):
    assert main(["case-study", "--out", str(tmp_path), "--json", "--no-plots"]) == 0
    assert json.loads(capsys.readouterr().out)["machine"] == "nist"
    for name in ("case_study.csv", "case_study.json", "case_study.md"):
        assert (tmp_path / name).read_bytes() == (COMMITTED / name).read_bytes(), name


def test_pictures_are_drawn(tmp_path):
    assert main(["case-study", "--out", str(tmp_path)]) == 0
    for name in ("regions.png", "heights.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_program_stands_in_both_places():
    packaged = resources.files("toolpath_stiff") / "data" / "programs" / "case_study.nc"
    assert packaged.read_bytes() == (ROOT / "programs" / "case_study.nc").read_bytes()
