"""Stiffness maps: what the paper's Figures 8 and 9 say, the grid, the files, mistakes."""

from __future__ import annotations

import csv
import json
from html.parser import HTMLParser

import numpy as np
import pytest

import toolpath_stiff as tps
from toolpath_stiff.analysis.evaluation import evaluate
from toolpath_stiff.analysis.grid import map_stiffness
from toolpath_stiff.analysis.loads import parse_load
from toolpath_stiff.analysis.poses import evaluate_poses
from toolpath_stiff.cli.main import main
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.stiffness.model import build_model

MODEL = build_model(load_machine("nist"))


def around_axis(radius, height, load, angles):
    position = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(len(angles), height)])
    zeros = np.zeros_like(position)
    return evaluate(MODEL, position, zeros, zeros, load=parse_load(load)).stiffness


def test_three_maxima_and_three_minima_where_the_struts_meet_the_frame():
    # The paper on Figure 8 (z = 1.2 m, radial load): "three stiffness maxima and three minima. These maxima
    # correspond to the struts' intersection with the base space frame", which is at 60, 180 and 300 degrees.
    angles = np.linspace(0.0, 2.0 * np.pi, 3600, endpoint=False)
    for radius in (0.05, 0.10, 0.15):
        values = around_axis(radius, 1.2, "radial", angles)
        before, after = np.roll(values, 1), np.roll(values, -1)
        # The two struts of a vertex differ in length, so the maximum lies a third of a degree beside it.
        np.testing.assert_allclose(np.rad2deg(angles[(values > before) & (values >= after)]), [60, 180, 300], atol=0.5)
        np.testing.assert_allclose(np.rad2deg(angles[(values < before) & (values <= after)]), [0, 120, 240], atol=0.5)


def test_map_is_the_pose_evaluation_on_a_grid():
    found = map_stiffness(MODEL, (-0.1, 0.2), (-0.05, 0.1), [0.4, 0.9], parse_load("z"), points=7, abc=(0.1, 0.0, 0.0))
    assert found.stiffness.shape == (2, 4, 7)
    position = np.array([[found.x[5], found.y[2], found.z[1]]])
    pose = evaluate_poses(MODEL, position, np.array([[0.1, 0.0, 0.0]]))
    assert found.stiffness[1, 2, 5] == pytest.approx(pose.along_axes[0, 2], rel=1e-12)


def test_z_map_is_threefold_symmetric():
    angles = np.deg2rad(np.array([10.0, 130.0, 250.0]))
    values = around_axis(0.15, 1.2, "z", angles)
    np.testing.assert_allclose(values, values[0], rtol=1e-12)


def test_command_writes_table_picture_page(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["map", "--z", "1200", "--x", "-150:150", "--y", "-150:150", "--points", "11"]) == 0
    assert "100 % within reach" in capsys.readouterr().out
    out = tmp_path / "reports/nist-map"
    rows = list(csv.DictReader((out / "map.csv").open()))
    assert list(rows[0]) == ["x_mm", "y_mm", "z_mm", "stiffness_N_per_mm", "reachable"] and len(rows) == 121
    assert (out / "map.png").read_bytes().startswith(b"\x89PNG")
    page = (out / "map.html").read_text()
    HTMLParser().feed(page)
    assert "://" not in page and "{{" not in page
    assert json.loads((out / "map.json").read_text())["slices"][0]["softest"]["stiffness_N_per_mm"] > 0.0


def test_out_of_reach_is_marked(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments = ["map", "--slices", "1200,400", "--x", "-900:900", "--y", "-900:900", "--points", "21", "--json"]
    assert main([*arguments, "--no-plots"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert [s["z_mm"] for s in summary["slices"]] == [400, 1200]
    assert 0 < summary["slices"][0]["reachable_share"] < 1
    rows = list(csv.DictReader((tmp_path / "reports/nist-map/map.csv").open()))
    for row in rows:
        assert (row["reachable"] == "1") == (row["stiffness_N_per_mm"] != "")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--x", "150:-150"], "above the upper bound"),
        (["--x", "5"], "no extent"),
        (["--load", "tangential"], "needs a path"),
        (["--z", "nan"], "expected finite numbers"),
        (["--z", "9000"], "nothing of the map is within reach"),
        (["--slices", "400,400"], "each height once"),
        (["--points", "1"], "at most 2001"),
        (["--tilt", "10,0"], "A,B,C"),
        (["--x", "-1e9:1e9"], "100 m"),
    ],
)
def test_mistakes(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert main(["map", *arguments]) == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", ["serial", "rotary_delta", "pentapod"])
def test_a_map_of_another_machine_is_about_its_program_zero(kind, tmp_path):
    assert main(["machine", "new", str(tmp_path / "m.toml"), "--kind", kind]) == 0
    machine = tps.Machine.load(tmp_path / "m.toml")
    (plane,) = tps.map_stiffness(machine, points=5).to_dict()["slices"]
    assert plane["z_mm"] == pytest.approx(1e3 * machine.stated.default_origin[2]) and plane["reachable_share"] > 0.5
