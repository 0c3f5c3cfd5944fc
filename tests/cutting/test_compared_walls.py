"""Measured walls: points made from known errors come back with their factor, their lines, their verdicts."""

from __future__ import annotations

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.cutting.test_compensated_cuts import HEAD, MODEL, ORIGIN, pocket, setup
from toolpath_stiff.cli.main import main
from toolpath_stiff.cutting.cut import evaluate_cut
from toolpath_stiff.errors import TpsError
from toolpath_stiff.nc.reader import parse_program

TEXT = HEAD + pocket(0.5, 6, False, 10) + "M2\n"
GIVEN = setup(10, 30.0)
# Gauss and Lobatto's nine nodes (Abramowitz, Stegun, table 25.6), as shares of the height.
HEIGHTS = 0.5 + 0.5 * np.array([-1, -0.8997579954, -0.6771862795, -0.3631174638, 0, 0.3631174638, 0.6771862795,
                                0.8997579954, 1])  # fmt: skip
HEADING = "x_mm,y_mm,z_mm,nx,ny,nz,deviation_um"


def measured(factor=1.0, off_line=0, by_um=0.0, noise_um=0.3, own=False, share=(0.0, 1.0)):
    """Rows of a file: points of the true walls between shares of their height.

    Off by `factor` times the error predicted at that height, one line `by_um` further out.
    """
    rng = np.random.default_rng(3)
    program = parse_program(TEXT)
    cut = evaluate_cut(MODEL, program, ORIGIN, GIVEN, 2e-3)
    rows = []
    for i, side in zip(*np.nonzero(np.isfinite(cut.wall_mean)), strict=True):
        x, y, z = cut.samples.position[i] * 1e3
        tx, ty, _ = cut.samples.tangent[i]
        out = np.array([ty, -tx]) * (1 if side == 0 else -1)  # of the part, towards the tool
        low, high = cut.wall_heights[i, side] * 1e3
        place_z = rng.uniform(*share)
        error = factor * np.interp(place_z, HEIGHTS, cut.wall_profiles[i, side]) * 1e6 + rng.normal(0.0, noise_um)
        error += by_um if cut.samples.line[i] == off_line else 0.0
        place = np.array([x, y]) - out * (5.0 - (error * 1e-3 if own else 0.0))
        where = f"{place[0]:.6f},{place[1]:.6f},{z + low + place_z * (high - low):.4f}"
        rows.append(f"{where},{out[0]:.6f},{out[1]:.6f},0" + ("" if own else f",{error:.4f}"))
    return rows


def compare(tmp_path, rows, heading=HEADING, **options):
    file = tmp_path / "points.csv"
    file.write_text("\n".join([heading, *rows, ""]))
    program = tps.Program.from_text(TEXT, name="part.nc")
    return tps.compare_walls(file, program=program, cut=GIVEN, step_mm=2.0, **options)


@pytest.mark.parametrize("own", [False, True])
def test_the_factor_comes_back(tmp_path, own):
    rows = measured(1.3, own=own)
    heading = HEADING.removesuffix(",deviation_um") if own else HEADING
    compared = compare(tmp_path, [*rows, "0,0,5,0,0,1" + ("" if own else ",3")], heading)
    factor, spread = compared.factor
    assert abs(factor - 1.3) < 4.0 * spread + 0.01 and spread < 0.02
    assert compared.others == 1 and len(compared.line) == len(rows)
    document = compared.to_dict()
    assert document["points"] == len(rows) and {row["line"] for row in document["lines"]} == set(compared.line.tolist())
    assert len(compared.to_frame()) == len(rows) and "factor      1.3" in str(compared)


@pytest.mark.parametrize("share", [(0.0, 0.2), (0.8, 1.0)])
def test_points_at_one_height_are_held_against_the_error_there(tmp_path, share):
    """At the foot this wall is off by 1.6 times its mean, at the top by hardly anything: the factor is one at both."""
    compared = compare(tmp_path, measured(share=share, noise_um=0.05))
    assert compared.factor[0] == pytest.approx(1.0, abs=0.02)
    assert not any(row["fails"] for row in compared.lines)
    assert (compared.height[compared.predicted != 0.0] <= 6e-3 * share[1] + 1e-6).all()


def test_the_line_where_the_model_fails(tmp_path):
    line = 23
    compared = compare(tmp_path, measured(1.0, line, by_um=25.0))
    failing = {row["line"] for row in compared.lines if row["fails"]}
    assert failing == {line}
    residual = next(row["residual_um"] for row in compared.lines if row["line"] == line)
    assert 20.0 < residual < 26.0  # points at its ends may count to its neighbours, theirs to it
    assert not any(row["fails"] for row in compare(tmp_path, measured()).lines)


def test_a_file_with_other_names_and_units(tmp_path):
    rows = [",".join([*row.split(",")[:6], f"{float(row.split(',')[6]) * 1e-3:.7f}"]) for row in measured(noise_um=0.0)]
    compared = compare(tmp_path, rows, "x_mm,y_mm,z_mm,nx,ny,nz,dev", columns="deviation=dev:mm")
    assert compared.factor[0] == pytest.approx(1.0, abs=1e-3)


def test_a_row_of_units_in_inch(tmp_path):
    rows = [[float(cell) for cell in row.split(",")] for row in measured(noise_um=0.0)]
    inch = [",".join(f"{v:.9f}" for v in (*(c / 25.4 for c in r[:3]), *r[3:6], r[6] / 25400)) for r in rows]
    names = "x=X, y=Y, z=Z, nx=I, ny=J, nz=K, deviation=Dev"
    compared = compare(tmp_path, ["inch,inch,inch,,,,inch", *inch], "X,Y,Z,I,J,K,Dev", columns=names)
    assert compared.factor[0] == pytest.approx(1.0, abs=1e-3) and len(compared.line) == len(rows)


@pytest.mark.parametrize(
    ("rows", "heading", "what"),
    [
        (["0,0,0,0,0,0,1"], HEADING, "a normal of no length"),
        (["0,0,zero,0,0,1,1"], HEADING, "z_mm = 'zero'"),
        (["0,0,0,0,0,1,1", "1,2"], HEADING, r"points.csv:3: row with 2 cells; expected 7"),
        (["0,0,0,1"], "x_mm,y_mm,z_mm,nx", "column ny is missing"),
        (["100,100,0,1,0,0,1"], HEADING, "no measured point lies on a final wall"),
        ([], HEADING, "no measured point"),
    ],
)
def test_what_is_refused(tmp_path, rows, heading, what):
    with pytest.raises(TpsError, match=what):
        compare(tmp_path, rows, heading)
    with pytest.raises(TpsError, match="without the program"):
        tps.compare_walls(tmp_path / "points.csv", cut=GIVEN)


def test_the_commands(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.nc").write_text(TEXT)
    (tmp_path / "points.csv").write_text("\n".join([HEADING, *measured(), ""]))
    (tmp_path / "cut.toml").write_text(
        "[stock]\nbox_mm = [80, 40, 20]\ncorner_mm = [-40, -20, -20]\n[coefficients]\nmaterial = 'Al7075'\n[[tool]]\n"
        "number = 1\ndiameter_mm = 10\nflutes = 3\nhelix_deg = 30\nstick_out_mm = 30\n"
    )
    cut = ["--cut", "cut.toml", "--step", "2"]
    assert main(["compare", "points.csv", "--program", "part.nc", *cut, "--out", "out"]) == 0
    assert {"compare.json", "residuals.csv"} <= {file.name for file in (tmp_path / "out").iterdir()}
    assert main(["compensate", "part.nc", *cut]) == 0
    shown = capsys.readouterr().out
    assert "points on final walls" in shown and "part_comp.nc" in shown
    same = tps.compensate("part.nc", cut="cut.toml", step_mm=2.0)
    assert (tmp_path / "part_comp.nc").read_bytes() == same.rewritten.content
    assert main(["compensate", "part.nc"]) == 2
    assert main(["compensate", "part.nc", *cut, "-o", "part.nc"]) == 2
