"""The page of placements: its numbers against plain analysis, its drawing in a browser, its bytes, its size."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.browser import needs_browser, painted, run_in, viridis
from tests.placement.test_placement_search import headline_figures
from toolpath_stiff.analysis.results import analyze
from toolpath_stiff.cli.main import main
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.reader import parse_program, read_program
from toolpath_stiff.path.sampling import sample_moves
from toolpath_stiff.report.place_path import thinned_rows

ROOT = Path(__file__).parent.parent.parent
NIST = load_machine("nist")
STEP = 10e-3  # m
BOUNDS = ["--x", "-150:150", "--y", "-150:150", "--z", "700:1000", "--step", "10", "--points", "12"]
TILTS = ("--x=0:0", "--y=0:0", "--tilt-a", "-8:8", "--tilt-b", "-8:8")


def placed(tmp_path: Path, name: str, *more: str) -> tuple[str, dict]:
    program = str(ROOT / "programs" / f"{name}.nc")
    assert main(["place", program, *BOUNDS, *more, "--out", str(tmp_path)]) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    return page, json.loads(data[1])


def pose_of(row: dict) -> tuple[float, ...]:
    mm, degrees = ("x_mm", "y_mm", "z_mm"), ("a_deg", "b_deg", "rotation_deg")
    return (*(row[key] / 1e3 for key in mm), *(float(np.deg2rad(row[key])) for key in degrees))


def turned(row: dict, points: np.ndarray) -> np.ndarray:
    """Points of the set-up where the placement puts them, by scipy's rotations (extrinsic x, y, z)."""
    from scipy.spatial.transform import Rotation

    angles = [row["a_deg"], row["b_deg"], row["rotation_deg"]]
    zero = np.array([row["x_mm"], row["y_mm"], row["z_mm"]])
    return Rotation.from_euler("xyz", angles, degrees=True).apply(points) + zero


@pytest.fixture(scope="module")
def pocket(tmp_path_factory):
    """The page's data of a program cut in one plane, with plunges."""
    return placed(tmp_path_factory.mktemp("pocket"), "pocket")[1]


@pytest.fixture(scope="module")
def tilted(tmp_path_factory):
    """A tilted program in tilted set-ups, searched once: the folder and the page's data."""
    folder = tmp_path_factory.mktemp("tilted")
    return folder, placed(folder, "tilted_five_axis", *TILTS)[1]


def test_plunges_set_neither_the_axis_nor_the_colours(pocket):
    data = pocket
    values, plunge = np.array(data["stiffness"]), np.array(data["plunge"])
    assert plunge.any() and values[:, plunge].min() > 1.5 * values[:, ~plunge].max()
    assert data["scale"][1] <= values[:, ~plunge].max()
    assert data["beyond"][1]  # the plunges, which the key says


@pytest.mark.parametrize("name", ["pocket", "tilted_five_axis"])
def test_page_tells_what_analysis_finds(name, request):
    data = request.getfixturevalue("tilted")[1] if name == "tilted_five_axis" else request.getfixturevalue(name)
    program = read_program(ROOT / "programs" / f"{name}.nc")
    assert len(data["stiffness"]) == len(data["front"]) + 1  # and the original
    for i in (0, len(data["front"]) // 2, data["recommended"]):
        row = data["front"][i]
        found = analyze(NIST, program, origin=pose_of(row), step=STEP)
        figures = headline_figures(found)
        for key in ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm", "mean_deflection_um"):
            # placement.json holds mm to the last digit; the range is a difference of large numbers
            assert row[key] == pytest.approx(figures[key], rel=1e-7)
        # Each drawn point is a sample of the analysis, with its stiffness to the whole N/mm.
        samples = found.samples
        position = turned(row, np.array(data["position"]))
        for k in range(0, len(position), 7):
            near = np.linalg.norm(1e3 * samples.position - position[k], axis=1) < 2e-3
            near &= samples.cutting & (np.abs(1e3 * samples.s - data["s"][k]) < 2e-2)
            assert np.abs(found.at.stiffness[near] / 1e3 - data["stiffness"][i][k]).min() <= 0.5 + 1e-6
    original = headline_figures(analyze(NIST, program, step=STEP))
    assert data["before"]["mean_N_per_mm"] == pytest.approx(original["mean_N_per_mm"], rel=1e-12)


def test_tools_lean_as_programmed(tilted):
    data = tilted[1]
    program = read_program(ROOT / "programs" / "tilted_five_axis.nc")
    samples = sample_moves(program.moves, STEP)
    lean = np.arccos(np.cos(samples.abc[:, 0]) * np.cos(samples.abc[:, 1]))[samples.cutting]
    drawn = np.arccos(np.array(data["axis"])[:, 2])
    assert drawn.max() == pytest.approx(lean.max(), abs=1e-4)
    assert np.linalg.norm(data["axis"], axis=1) == pytest.approx(np.ones(len(drawn)), abs=1e-4)


def test_nothing_from_the_network_and_names_are_text(tmp_path, capsys):
    keep_out = ("--keep-out", "<b>vice</b>:100,100,0,300,300,900")
    page, data = placed(tmp_path / "one", "case_study", *keep_out)  # the same bytes twice: test_command of the search
    assert data["keepouts"] == [{"name": "<b>vice</b>", "box": [[100, 100, 0], [300, 300, 900]]}]
    assert "<b>vice" not in page
    assert "default-src 'none'" in page
    assert not re.findall(r"""(?:src|href)=|url\(["']?https?:|@import|fetch\(|XMLHttp""", page)


@cache
def finely_sampled(name: str):
    program = read_program(ROOT / "programs" / f"{name}.nc", tool_table=ROOT / "programs" / "tools.tbl")
    return sample_moves(program.moves, 2e-3)


@pytest.mark.parametrize("points", [50, 150, 800])
@pytest.mark.parametrize("name", ["pocket", "drilling", "three_tools", "incremental_slots", "surface_50000"])
def test_thinned_paths_keep_their_ends_and_are_no_longer_than_asked(name, points):
    samples = finely_sampled(name)
    rows = np.flatnonzero(samples.cutting)
    cut = np.unique(np.cumsum(~samples.cutting)[rows], return_inverse=True)[1]
    kept = thinned_rows(samples.take(rows), cut, points)
    assert len(kept) <= points
    assert (np.diff(kept) > 0).all()
    assert {0, len(rows) - 1} <= set(kept.tolist())


def test_more_cuts_than_points_leaves_whole_cuts_out():
    holes = "".join(f"G0 X{i} Z5\nG1 Z-5 F100\nG0 Z5\n" for i in range(400))
    samples = sample_moves(parse_program(holes, "holes.nc").moves, 1e-3)
    rows = np.flatnonzero(samples.cutting)
    cut = np.unique(np.cumsum(~samples.cutting)[rows], return_inverse=True)[1]
    kept = thinned_rows(samples.take(rows), cut, 100)
    assert len(kept) <= 100
    assert (np.bincount(cut[kept])[np.unique(cut[kept])] == 2).all()  # where a hole begins and where it ends


@needs_browser
def test_a_browser_draws_the_placement_that_is_clicked(tilted, tmp_path):
    folder, data = tilted
    chosen = 3 if data["recommended"] == 2 else 2  # the recommended one is called so
    click = (
        f"for (const one of [document.querySelectorAll('.dot')[{chosen}], document.querySelector('[value=workspace]')])"
    )
    click += " one.dispatchEvent(new MouseEvent('click', { bubbles: true }));"
    done = run_in((folder / "report.html").read_text("utf-8"), click, tmp_path)
    assert "CONSOLE" not in done.stderr  # neither an error nor a blocked script
    assert f"Placement {chosen + 1} of {len(data['front'])}" in done.stdout
    assert f"{data['front'][chosen]['x_mm']:.3f}" in done.stdout
    (front,) = re.findall(r'<svg id="front"[^>]*>(.*?)</svg>', done.stdout, re.S)
    assert front.count("<circle") == len(data["front"])
    assert front.count('aria-checked="true"') == 1


@needs_browser
def test_both_placements_and_the_profile_are_painted(tilted, tmp_path):
    """What the canvases show: the classes' colours in both drawings, the curve's in the profile."""
    found = painted((tilted[0] / "report.html").read_text(encoding="utf-8"), tmp_path)
    for name in ("chosen", "before"):
        assert len(found[name].keys() & {*viridis(0.0, 0.93), *viridis(0.22, 1.0)}) > 3
    assert found["profile"]
