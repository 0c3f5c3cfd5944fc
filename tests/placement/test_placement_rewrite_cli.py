"""`tps place --write`: the file, the difference printed, and nothing written where it is refused."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.placement.test_placement_search import headline_figures
from toolpath_stiff.analysis.results import analyze
from toolpath_stiff.cli.main import main
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.reader import read_program

PROGRAMS = Path(__file__).parents[2] / "programs"
FIXED = ["--x", "30", "--y=-45", "--z", "900", "--rotate", "37", "--no-plots", "--step", "2"]


def place(name: str, *more: str) -> int:
    return main(["place", str(PROGRAMS / name), *FIXED, "--out", "out", *more])


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("decimals", "bar"), [("7", 1e-6), (None, 1e-4)])
def test_the_written_program_has_the_figures_of_the_placement(capsys, decimals, bar):
    options = ["--decimals", decimals] if decimals else []
    assert place("pocket.nc", "--write", "sub/placed.nc", *options) == 0
    summary = json.loads(Path("out/placement.json").read_text())
    machine = load_machine("nist")
    written = read_program("sub/placed.nc", default_origin=machine.default_origin)
    again = analyze(machine, written, step=2e-3)
    figures = headline_figures(again)
    for short, key in (("mean", "mean_N_per_mm"), ("range", "range_N_per_mm"), ("weakest", "min_N_per_mm")):
        assert figures[key] == pytest.approx(summary["chosen"][key], rel=bar)
        assert summary["written"]["relative_difference"][short] < bar
    printed = capsys.readouterr().out
    assert "sub/placed.nc" in printed
    assert f"mean {summary['written']['relative_difference']['mean']:.1e}" in printed


def test_written_where_the_program_is_told_to_sit():
    """With --origin the written program belongs at that origin, not at the machine's default."""
    assert place("case_study.nc", "--write", "placed.nc", "--origin", "10,20,850") == 0
    summary = json.loads(Path("out/placement.json").read_text())
    at = summary["written"]["analysed_at"]
    assert (at["x_mm"], at["y_mm"], at["z_mm"]) == pytest.approx((10.0, 20.0, 850.0))
    moved = Path("placed.nc").read_text()
    assert "Z70." in moved  # Z20 of the program, 50 mm higher


def test_tool_lengths_reach_the_rewriter():
    table = str(PROGRAMS / "tools.tbl")
    assert place("three_tools.nc", "--write", "placed.nc", "--tools", table, "--linearise", "0.001") == 0
    summary = json.loads(Path("out/placement.json").read_text())
    assert summary["written"]["relative_difference"]["mean"] < 1e-4
    assert any("chords within 0.001 mm" in note for note in summary["written"]["notes"])


def test_a_turn_that_cannot_be_written_keeps_the_search(in_empty_folder, capsys):
    assert place("arcs_in_planes.nc", "--write", "placed.nc") == 2
    error = capsys.readouterr().err
    assert "placed.nc was not written; the search is kept in out" in error
    assert "arcs_in_planes.nc:10: an arc of G18" in error
    assert "--linearise" in error
    summary = json.loads(Path("out/placement.json").read_text())
    assert "an arc of G18" in summary["written"]["refused"]
    assert not Path("placed.nc").exists()
    fixed = re.search(r"without a search by (--x=.*)", error)[1].split()
    assert place("arcs_in_planes.nc", "--write", "placed.nc", *fixed, "--linearise", "0.01") == 0
    again = json.loads(Path("out/placement.json").read_text())
    assert again["chosen"]["mean_N_per_mm"] == pytest.approx(summary["chosen"]["mean_N_per_mm"], rel=1e-5)


def test_a_program_in_plain_language_is_written_by_a_frame(in_empty_folder):
    lines = ("BEGIN PGM A MM", "L X+0 Y+0 Z+5 FMAX", "L Z-2 F300", "L X+30", "L Y+20", "END PGM A MM")
    Path("part.h").write_text("\n".join([*lines, ""]))
    assert main(["place", "part.h", "--points", "2", "--rotate", "0", "--out", "out", "--write", "placed.h"]) == 0
    assert "CYCL DEF 7.0 SHIFT" in Path("placed.h").read_text()
    assert json.loads(Path("out/placement.json").read_text())["written"]["relative_difference"]["mean"] < 1e-4


def test_nothing_asked_nothing_written():
    assert place("case_study.nc") == 0
    assert json.loads(Path("out/placement.json").read_text())["written"] is None


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("pocket.nc", ["--decimals", "5"], "--decimals or --linearise without --write"),
        ("pocket.nc", ["--linearise", "0.01"], "--linearise without --write"),
        ("pocket.nc", ["--write", "placed.nc", "--decimals", "0"], "--decimals 0"),
        ("pocket.nc", ["--write", str(PROGRAMS / "pocket.nc")], "is read here and would be written over"),
        ("pocket.nc", ["--write", "placed.nc", "--linearise", "nan"], "--linearise"),
    ],
)
def test_refusals_leave_nothing_behind(in_empty_folder, capsys, name, options, message):
    before = (PROGRAMS / name).read_bytes()
    try:
        code = place(name, *options)
    except SystemExit as end:  # argparse's own
        code = end.code
    assert code == 2
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error
    assert list(in_empty_folder.iterdir()) == []
    assert (PROGRAMS / name).read_bytes() == before
