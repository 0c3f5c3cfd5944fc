"""The chain of a cut: setup files, spindle, tools, forces and errors in the station's frame, files and exit codes."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.browser import needs_browser, painted
from tests.stiffness.cases import nist
from toolpath_stiff.cli.main import main
from toolpath_stiff.cutting.cut import evaluate_cut
from toolpath_stiff.cutting.setup import read_setup
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import EffectEntry, Uncertainty
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.model import build_model

PROGRAMS = Path(__file__).parents[2] / "programs"
POCKET, POCKET_CUT = PROGRAMS / "pocket.nc", PROGRAMS / "pocket_cut.toml"
# The tool and coefficients of the check values of Altintas' formulas: N and mm.
SETUP = """
[stock]
box_mm = [100, 20, 10]
corner_mm = [0, 0, -10]
[coefficients]
cutting_N_per_mm2 = [800, 250, 150]
edge_N_per_mm = [20, 25, 2]
origin = "made up"
[[tool]]
number = 1
diameter_mm = 10
flutes = 3
helix_deg = 30
corner_radius_mm = 0
stick_out_mm = 30
core_mm = 8
modulus_GPa = 600
"""
ORIGIN = (0.0, 0.0, 0.8, 0.0, 0.0, 0.0)
BEAM = 0.03**3 / (3 * 600e9 * np.pi * 0.008**4 / 64)
DOWN, UP = "Y24 F900", "Y-4 F900"  # 1 mm of the wall at Y20 or Y0; the work on the right of +X, and on its left


def program(side="Y24", feed=900, spindle="M3", way=("X-10", "X110")):
    lines = ["G21 G90", f"T1 M6 S6000 {spindle}", f"G0 {way[0]} {side} Z20", "G0 Z-3", f"G1 {way[1]} F{feed}", "M30"]
    return parse_program("\n".join(lines), "wall.nc")


def cut_of(read, tmp_path, text=SETUP, model=None, origin=ORIGIN, step=2e-3):
    file = tmp_path / "cut.toml"
    file.write_text(text)
    return evaluate_cut(model or build_model(nist()), read, origin, read_setup(file), step)


def middle(cut):
    """The sample in the middle of the wall, away from its ends."""
    return int(np.argmin(np.abs(cut.samples.position[:, 0] - 0.05) + (cut.samples.motion == 0)))


@pytest.mark.parametrize(
    ("side", "way", "engaged", "force", "wall"),
    [
        ("Y24", ("X-10", "X110"), (143.13, 180.0), (18.8763, 35.1223, -3.99209), 1),
        ("Y24", ("X110", "X-10"), (0.0, 36.87), (-36.1277, -14.2953, -3.99209), 0),
        ("Y10", ("X-10", "X110"), (0.0, 180.0), (-99.7447, 147.296, -30.4859), None),
    ],
)
def test_a_wall_has_the_published_forces_and_the_error_of_all_that_gives_way(tmp_path, side, way, engaged, force, wall):
    cut = cut_of(program(side, way=way), tmp_path)
    row = middle(cut)
    assert np.degrees([cut.entry[row], cut.exit[row]]) == pytest.approx(engaged, abs=0.01)
    assert cut.ap[row] == pytest.approx(3e-3) and cut.feed_per_tooth[row] == pytest.approx(5e-5)
    # The edge's force sets in over 1 um of chip here, at once in the check values.
    np.testing.assert_allclose(cut.mean_force[row], force, rtol=0.01, atol=0.3)
    x, y, z = cut.samples.position[row] * 1e3
    machine = tps.pose((x, y, z + 800.0)).tip_compliance[0]
    turn = np.diag([1.0, 1.0, 1.0]) if way[0] == "X-10" else np.diag([-1.0, -1.0, 1.0])
    tensor = turn.T @ machine @ turn + np.diag([BEAM, BEAM, 0.03 / (600e9 * np.pi * 0.008**2 / 4)])
    np.testing.assert_allclose(cut.deflection[row], tensor @ cut.mean_force[row], rtol=1e-6)
    for k, outward in ((0, -1.0), (1, 1.0)):
        if wall in (k, None):
            expected = outward * (tensor @ cut.wall_force[row, k])[1]
            assert cut.wall_mean[row, k] == pytest.approx(expected, rel=1e-6)
            assert cut.lowest[row, k] < cut.wall_mean[row, k] < cut.highest[row, k]
            assert cut.deviation[row, k] == pytest.approx(0.3 * abs(cut.wall_mean[row, k]), rel=0.05)
        else:
            assert np.isnan(cut.wall_mean[row, k])
    rate = cut.removed[cut.samples.cutting].sum()
    assert rate == pytest.approx(1e-9 * 3.0 * 100.0 * (10.0 if side == "Y10" else 1.0), rel=2e-3)


def test_of_two_levels_the_deeper_cut_stays(tmp_path):
    """A slot in two levels: the second passes the walls of the first; its left wall is cut too deep by both."""
    lines = ["G21 G90", "T1 M6 S6000 M3", *(f"G0 X-10 Y10 Z20\nG0 Z{z}\nG1 X110 F900" for z in (-3, -6)), "M30"]
    both = cut_of(parse_program("\n".join(lines), "slot.nc"), tmp_path)
    alone = [cut_of(program("Y10"), tmp_path)]
    deep = SETUP.replace("box_mm = [100, 20, 10]", "box_mm = [100, 20, 7]")  # its top where the first level was
    lines[2:4] = lines[3:4]
    alone.append(cut_of(parse_program("\n".join(lines), "slot.nc"), tmp_path, deep))
    first, second = (middle(cut) for cut in alone)
    row = max(i for i in np.flatnonzero(both.ap > 0) if abs(both.samples.position[i, 0] - 0.05) < 1e-3)
    assert both.wall_heights[row] == pytest.approx(np.array([[0.0, 6e-3]] * 2), abs=1e-6)
    assert np.isnan(both.wall_mean[first]).all()  # the last pass owns the walls
    parts = [(cut.wall_mean[at], cut.lowest[at, :2]) for cut, at in zip(alone, (first, second), strict=True)]
    means, lows = np.transpose(parts, (1, 0, 2)).min(axis=1)
    np.testing.assert_allclose(both.lowest[row, :2], lows, rtol=0.01)  # a profile is known at nine heights
    assert (both.wall_mean[row] <= means + 2e-8).all()


def test_where_the_work_sits_and_how_it_is_turned_changes_nothing_but_the_machine(tmp_path):
    """The same cut along Y of a turned program on a machine turned against it: row for row the same errors."""
    first = cut_of(program(), tmp_path, origin=(0.1, 0.05, 0.8, 0.0, 0.0, 0.0))
    text = SETUP.replace("box_mm = [100, 20, 10]", "box_mm = [20, 100, 10]").replace("[0, 0, -10]", "[-20, 0, -10]")
    turned = parse_program("G21 G90\nT1 M6 S6000 M3\nG0 X-24 Y-10 Z20\nG0 Z-3\nG1 Y110 F900\nM30", "wall.nc")
    second = cut_of(turned, tmp_path, text, origin=(0.1, 0.05, 0.8, 0.0, 0.0, -np.pi / 2))
    np.testing.assert_allclose(first.wall_mean, second.wall_mean, rtol=1e-4)
    np.testing.assert_allclose(first.errors[:, 2], second.errors[:, 2], atol=3e-9)  # the strip of floor has 41 places
    np.testing.assert_allclose(first.mean_force, second.mean_force, rtol=1e-4, atol=1e-3)


def test_a_spindle_that_turns_the_other_way_mirrors_the_cut(tmp_path):
    """M4 with the work on the left is M3 with it on the right; the helix pushes where it drew."""
    right, left = program(), program(spindle="M4", way=("X110", "X-10"))
    first, second = cut_of(right, tmp_path), cut_of(left, tmp_path, SETUP.replace("helix_deg = 30", "helix_deg = -30"))
    a, b = middle(first), middle(second)
    assert second.mean_force[b] == pytest.approx(first.mean_force[a] * [1.0, -1.0, 1.0])
    assert second.wall_force[b, 0] == pytest.approx(first.wall_force[a, 1] * [1.0, -1.0, 1.0])


def test_the_force_that_acts_decides_what_depends_on_the_load(tmp_path):
    contact = ActiveEffect(find_effect("contact_nonlinearity"), {"compliance": 5e-9})
    plain, soft = (cut_of(program(), tmp_path, model=build_model(nist(), extra=extra)) for extra in ([], [contact]))
    row = middle(plain)
    assert soft.wall_mean[row, 1] > 1.02 * plain.wall_mean[row, 1]
    assert any("as under the mean force" in sentence for sentence in soft.assumptions)


def test_the_machine_s_uncertainty_is_in_the_band(tmp_path):
    weak = EffectEntry("spindle_compliance", {"radial_nm_per_N": 40.0, "axial_nm_per_N": 5.0})
    known = Uncertainty(("spindle_compliance.radial_nm_per_N",), np.array([20.0]), np.eye(1))
    model = build_model(nist().with_changes(effects=(weak,), uncertainty=known))
    steady = SETUP.replace('origin = "made up"', 'origin = "made up"\nspread_percent = 0')
    cut = cut_of(program(), tmp_path, steady, model)
    row = middle(cut)
    # 20 nm/N of sd across the feed, of the whole compliance there.
    whole = cut.deflection[row, 1] / cut.mean_force[row, 1]
    assert cut.deviation[row, 1] / cut.wall_mean[row, 1] == pytest.approx(20e-9 / whole, rel=0.02)


BROKEN = {
    "stock.box_mm": ("box_mm = [100, 20, 10]", "box_mm = [100, 20]", 3, "[X, Y, Z] in mm"),
    "size": ("box_mm = [100, 20, 10]", "box_mm = [100, 0, 10]", 3, "0.001 mm or more"),
    "two kinds": ("box_mm = [100, 20, 10]", 'box_mm = [100, 20, 10]\nstl = "a.stl"', 2, "one of box_mm"),
    "coefficients": ('origin = "made up"', "", 5, "where the coefficients come from"),
    "material": (SETUP[SETUP.index("cutting_N") : SETUP.index("[[tool]]")], 'material = "Al"\n', 6, "one of"),
    "flutes": ("flutes = 3", "flutes = 2.5", 9, "a whole number"),
    "helix": ("helix_deg = 30", "helix_deg = 95", 9, "from -80 to 80"),
    "key": ("core_mm = 8", "core = 8", 16, "not known"),
    "section": ("[stock]", "[stck]\na = 1\n[stock]", 2, "stock, coefficients"),
    "spindle": ("[[tool]]", "[spindle]\nspeed_per_min = -3\n[[tool]]", 10, "more than 0"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_setup_is_one_error_with_its_line(tmp_path, name):
    old, new, line, words = BROKEN[name]
    assert old in SETUP
    with pytest.raises(InputError) as error:
        cut_of(program(), tmp_path, SETUP.replace(old, new))
    assert f"cut.toml:{line}" in str(error.value) and words in str(error.value)
    assert "\n" not in str(error.value)


MISSING = {
    "stock": (
        SETUP[SETUP.index("[stock]") : SETUP.index("[coeff")],
        "",
        "M3",
        "wall.nc: no stock is given, the program states none",
    ),
    "diameter": ("diameter_mm = 10\n", "", "M3", "tool 1: diameter_mm not known"),
    "teeth and helix": ("flutes = 3\nhelix_deg = 30\n", "", "M3", "flutes, helix_deg not known"),
    "core": ("core_mm = 8", "core_mm = 80", "M3", "tool 1: core_mm = 80; expected at most 10, the diameter"),
    "tool": ("number = 1", "number = 2", "M3", "[[tool]] with number = 1"),
    "spindle": ("", "", "M5", "wall.nc:5: a cut while the spindle stands"),
    "surface speed": ("", "", "M3 G96", "constant surface speed"),
}


@pytest.mark.parametrize("name", MISSING)
def test_what_is_missing_is_named_with_where_to_write_it(tmp_path, name):
    old, new, spindle, words = MISSING[name]
    with pytest.raises(InputError) as error:
        cut_of(program(spindle=spindle), tmp_path, SETUP.replace(old, new))
    assert words in str(error.value) and "\n" not in str(error.value)


def test_rapids_through_material_and_turning_tools_are_warned_of(tmp_path):
    lines = ["G21 G90", "T1 M6 S6000 M3", "G0 X-10 Y24 Z20", "G0 Z-3", "G1 X110 F900", "G0 X50 Y10", "G1 X60 A3", "M30"]
    cut = cut_of(parse_program("\n".join(lines), "wall.nc"), tmp_path)
    assert any(text.startswith("lines 6: rapids run into material") for text in cut.warnings)
    assert any(text.startswith("lines 7: the tool turns") for text in cut.warnings)
    turning, still = cut.samples.line == 7, cut.samples.line == 5
    assert cut.mean_force[turning].any() and np.isnan(cut.errors[turning]).all()
    assert cut.mean_force[still].any() and np.isfinite(cut.errors[still]).any()
    assert np.isnan(cut.wall_heights[turning]).all() and np.isnan(cut.wall_profiles[turning]).all()


def test_chords_shorter_than_a_tooth_s_feed_have_the_direction_of_the_path(tmp_path):
    """Chords of 20 um whose ends are rounded up and down by a micrometre: 3 degrees each."""
    chords = "\n".join(f"X{49 + 0.02 * i:.2f} Y{24 + 0.001 * (i % 2):.3f}" for i in range(101))
    read = parse_program(f"G21 G90\nT1 M6 S6000 M3\nG0 X-10 Y24 Z20\nG0 Z-3\nG1 X49 F900\n{chords}\nM30", "wall.nc")
    cut, straight = cut_of(read, tmp_path), cut_of(program(), tmp_path)
    rows = np.flatnonzero(cut.samples.line > 6)[5:-10]
    assert np.abs(cut.samples.tangent[rows, 1]).max() < 0.021  # 0.05 of the chords
    expected = straight.wall_mean[
        middle(straight), 1
    ]  # the last degree before the wall is cut by every other chord only
    np.testing.assert_allclose(cut.wall_mean[rows, 1], expected, rtol=0.1)


def test_a_speed_of_the_setup_holds_where_the_program_has_none(tmp_path):
    text = SETUP.replace("[[tool]]", "[spindle]\nspeed_per_min = 6000\n[[tool]]")
    cut = cut_of(program(spindle="M5"), tmp_path, text)
    assert cut.feed_per_tooth[middle(cut)] == pytest.approx(5e-5)
    assert any("the spindle turns at 6000" in sentence for sentence in cut.assumptions)


def test_without_a_stick_out_the_result_says_machine_only(tmp_path):
    cut = cut_of(program(), tmp_path, SETUP.replace("stick_out_mm = 30\n", ""))
    whole = cut_of(program(), tmp_path)
    assert cut.machine_only and not whole.machine_only and "machine only" in cut.warnings[0]
    row = middle(cut)
    assert 3.0 * cut.wall_mean[row, 1] < whole.wall_mean[row, 1]


def test_tools_of_the_table_and_of_the_setup(tmp_path, monkeypatch, capsys):
    """What the tool table has need not be said again; the setup wins."""
    monkeypatch.chdir(tmp_path)
    Path("wall.nc").write_text("\n".join(["G21 G90 T1 M6 S6000 M3", "G0 X-10 Y24 Z20", "Z-3", "G1 X110 F900", "M30"]))
    heading = "tool,length_mm,diameter_mm,stick_out_mm,flutes,helix_deg,core_mm,modulus_GPa"
    Path("tools.csv").write_text(f"{heading}\n1,100,10,30,3,30,8,600\n")
    given = ["--tools", "tools.csv", "--no-plots", "--json", "--replace"]
    assert main(["analyze", "wall.nc", *given, "--material", "Al7075", "--stock", "100,20,10"]) == 0
    cut = json.loads(capsys.readouterr().out)["cut"]
    assert cut["tools"][0]["lateral_nm_per_N"] == pytest.approx(BEAM * 1e9)
    assert "lowest corner at 0, 0, -10 mm" in cut["stock"]
    Path("cut.toml").write_text(
        '[stock]\nextents = true\n[coefficients]\nmaterial = "Al7075"\n[[tool]]\nnumber = 1\nflutes = 2\n'
    )
    assert main(["analyze", "wall.nc", *given, "--cut", "cut.toml"]) == 0
    cut = json.loads(capsys.readouterr().out)["cut"]
    assert (cut["tools"][0]["flutes"], cut["tools"][0]["diameter_mm"]) == (2, 10.0)
    assert any("assumed: the extents" in sentence for sentence in cut["assumptions"])


@pytest.fixture(scope="module")
def pocket():
    return tps.analyze(POCKET, cut=POCKET_CUT, tolerance_um=20)


def test_the_command_writes_the_cut_and_says_what_leaves_the_tolerance(tmp_path, monkeypatch, capsys, pocket):
    monkeypatch.chdir(tmp_path)
    plain = ["analyze", str(POCKET), "--no-plots", "--out"]
    assert main([*plain, "without"]) == 0
    assert "under an assumed force" in Path("without/summary.json").read_text()
    assert main([*plain, "with", "--cut", str(POCKET_CUT), "--tolerance", "20"]) == 3
    out = capsys.readouterr().out
    assert "9 lines beyond 20 um" in out and "material left, worst lines" in out
    assert {file.name for file in Path("with").iterdir()} - {file.name for file in Path("without").iterdir()} == {
        "cut.csv", "cut_lines.csv", "surface.vtk",
    }  # fmt: skip
    assert Path("with/samples.csv").read_bytes() == Path("without/samples.csv").read_bytes()
    assert main([*plain, "wide", "--cut", str(POCKET_CUT), "--tolerance", "60"]) == 0
    rows = Path("with/cut_lines.csv").read_text().splitlines()
    assert rows[0].startswith("line,tool,largest_ap_mm") and len(rows) == 1 + len(
        set(pocket.samples.line[pocket.samples.cutting])
    )
    document = json.loads(Path("with/summary.json").read_text())["cut"]
    assert [row["line"] for row in document["tolerance"]["beyond"]] == [line for line, _ in pocket.beyond_tolerance]
    assert document["walls"]["least_um"] <= document["walls"]["mean_um"] <= document["walls"]["most_um"]
    assert sum(part["removed_mm3"] for part in document["per_operation"]) == pytest.approx(document["removed_mm3"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--tolerance", "5"], "--tolerance without a cut"),
        (["--stock", "1,2,3"], "--stock without --material"),
        (["--material", "Al7075", "--stock", "1,2"], "X,Y,Z of a box"),
        (["--material", "Al7075", "--cut", str(POCKET_CUT)], "one of the two"),
        ([str(POCKET_CUT.with_name("arcs_in_planes.nc")), "--cut", str(POCKET_CUT)], "--cut with several programs"),
    ],
)
def test_words_that_do_not_fit_are_refused(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    assert main(["analyze", str(POCKET), *words]) == 2
    assert message in capsys.readouterr().err and not Path("reports").exists()


def test_the_surface_to_take_away_is_the_part(tmp_path, pocket):
    """Read back: quadrangles of walls that stand, floors that lie, at the places and depths of the program."""
    text = tmp_path / "surface.vtk"
    pocket.save(tmp_path, plots=False)
    lines = text.read_text().splitlines()
    count = int(lines[4].split()[1])
    points = np.array([line.split() for line in lines[5 : 5 + count]], float).reshape(-1, 4, 3)
    error = np.array(lines[5 + count + 1 + count // 4 + 3 :][: count // 4], float)
    assert lines[:4:3] == ["# vtk DataFile Version 3.0", "DATASET POLYDATA"] and len(points) == count // 4
    standing = np.ptp(points[..., 2], axis=1) > 1.0
    outer = np.abs(points[standing].mean(axis=1)[:, 0]) > 50.0
    np.testing.assert_allclose(np.abs(points[standing][outer].mean(axis=1)[:, 0]).max(), 55.0, atol=1e-3)
    assert set(np.round(points[standing][..., 2].min(axis=1)).tolist()) == {-10.0, -6.0}
    assert np.nanmax(error) > 40.0 and np.isfinite(error[standing]).all()


@needs_browser
def test_the_page_draws_the_part(tmp_path, pocket):
    page = "".join(pocket.files()["report.html"]())
    colours = painted(page, tmp_path)
    assert len(colours["part"]) > 12


def test_cut_template_is_read(tmp_path):
    file = tps.cut_template().save(tmp_path / "cut.toml")
    setup = read_setup(file)
    assert setup.tools[1].cutter["flutes"] == 3 and setup.size == pytest.approx((0.12, 0.08, 0.02))
    assert dataclasses.replace(setup, file="").inputs == ()


BLANKS = {
    "wall.h": "BEGIN PGM WALL MM\nBLK FORM 0.1 Z X+0 Y+0 Z-10\nBLK FORM 0.2 X+100 Y+20 Z+0\nTOOL CALL 1 Z S6000\n"
    "L X-10 Y+24 Z+20 R0 FMAX M3\nL Z-3 FMAX\nL X+110 F900\nM30\nEND PGM WALL MM\n",
    "wall.mpf": 'G17 G90 G71\nWORKPIECE(,"",,"BOX",112,0,-10,-80,0,0,100,20)\nT1 D1\nM6\nS6000 M3\nG0 X-10 Y24 Z20\n'
    "G0 Z-3\nG1 X110 F900\nM30\n",
}


@pytest.mark.parametrize("name", BLANKS)
def test_without_a_stock_it_is_the_blank_that_the_program_states(tmp_path, name):
    """BLK FORM, WORKPIECE: the cut is that of the same box in the setup; G code that states none is refused (above)."""
    read = parse_program(BLANKS[name], name)
    old, new, *_ = MISSING["stock"]
    stated, given = cut_of(read, tmp_path, SETUP.replace(old, new)), cut_of(read, tmp_path)
    assert stated.removed.sum() > 1e-9 and "BLK FORM, WORKPIECE" in stated.work.stock.origin
    np.testing.assert_allclose(stated.wall_mean, given.wall_mean, rtol=1e-9)
    np.testing.assert_allclose(stated.removed, given.removed, rtol=1e-9, atol=1e-18)


def test_a_blank_turned_inside_out_names_its_program(tmp_path):
    text = BLANKS["wall.h"].replace("X+100 Y+20 Z+0", "X+100 Y-20 Z+0")
    old, new, *_ = MISSING["stock"]
    with pytest.raises(InputError, match=r"wall\.h: a stock of 100 x -20 x 10 mm"):
        cut_of(parse_program(text, "wall.h"), tmp_path, SETUP.replace(old, new))
