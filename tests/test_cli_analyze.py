"""The commands as a user calls them: files, exit codes, messages; nothing half-written."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys

import numpy as np
import pytest

from toolpath_stiff.cli.main import main

PART = "(square)\nG21 G90 F1000\nG0 X-100 Y-100 Z0\nG1 X100\nY100\nX-100\nM8\nY-100\nM2\n"
COLUMNS = (
    "line,motion,tool,s_mm,t_s,x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,feed_mm_per_min,stiffness_N_per_mm,deflection_um,"
    "strut1_mm,strut2_mm,strut3_mm,strut4_mm,strut5_mm,strut6_mm,margin,margin_limit,operation,cut"
)


@pytest.fixture
def part(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "part.nc"
    path.write_text(PART)
    return path


def test_analyze_writes_the_reports(part, capsys):
    assert main(["analyze", "part.nc"]) == 0
    out = part.parent / "reports" / "part"
    assert sorted(p.name for p in out.glob("[!.]*")) == [
        "path.png", "profile.png", "report.html", "samples.csv", "summary.json",
    ]  # fmt: skip
    printed = capsys.readouterr().out
    assert "report.html" in printed and "N/mm" in printed
    rows = list(csv.DictReader((out / "samples.csv").open()))
    assert ",".join(rows[0]) == COLUMNS
    summary = json.loads((out / "summary.json").read_text())
    assert summary["samples"] == len(rows)
    assert summary["unsupported"] == [{"line": 7, "column": 1, "word": "M8", "reason": "coolant"}]
    for key in (
        "program", "machine", "samples", "cutting_length_mm", "rapid_length_mm", "mean_N_per_mm", "min_N_per_mm",
        "max_N_per_mm", "range_N_per_mm", "weakest", "per_tool", "per_operation", "extrapolated_share", "unsupported",
        "assumptions", "warnings",
    ):  # fmt: skip
        assert key in summary
    cutting = [float(r["stiffness_N_per_mm"]) for r in rows if r["motion"] != "rapid"]
    assert min(cutting) == pytest.approx(summary["min_N_per_mm"], abs=1e-4)  # the column has four decimals


def test_same_input_same_bytes(part):
    for out in ("one", "two"):
        assert main(["analyze", "part.nc", "--out", out]) == 0
    for file in (part.parent / "one").iterdir():
        assert file.read_bytes() == (part.parent / "two" / file.name).read_bytes(), file.name


def test_json_prints_the_summary_alone(part, capsys):
    assert main(["analyze", "part.nc", "--json", "--no-plots", "--origin", "-50,0,900,0,0,30"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["origin_mm_deg"] == pytest.approx([-50, 0, 900, 0, 0, 30])
    assert not (part.parent / "reports/part/report.html").exists()


def test_several_programs_one_folder_each(part, capsys):
    (part.parent / "other.nc").write_text(PART)
    assert main(["analyze", "part.nc", "other.nc", "--no-plots", "--out", "all"]) == 0
    assert (part.parent / "all/part/samples.csv").exists() and (part.parent / "all/other/samples.csv").exists()
    (part.parent / "sub").mkdir()
    (part.parent / "sub/part.nc").write_text(PART)
    assert main(["analyze", "part.nc", "sub/part.nc", "--no-plots", "--out", "twice"]) == 0
    assert (part.parent / "twice/part/samples.csv").exists() and (part.parent / "twice/sub/part/samples.csv").exists()


def test_require_lists_weak_lines_and_exits_3(part, capsys):
    assert main(["analyze", "part.nc", "--no-plots", "--require", "54000"]) == 3
    assert "lines below the required 54 000 N/mm:\n  line " in capsys.readouterr().out
    assert main(["analyze", "part.nc", "--no-plots", "--require", "100"]) == 0


def test_partial_exits_1_and_out_of_reach_2(part, capsys):
    part.write_text("F1000\nG1 X100\nX2000\n")
    assert main(["analyze", "part.nc", "--no-plots", "--out", "o"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("tps: error: part.nc:3: ") and "--partial" in error
    assert not (part.parent / "o").exists()
    assert main(["analyze", "part.nc", "--partial", "--out", "o"]) == 1
    rows = list(csv.DictReader((part.parent / "o/samples.csv").open()))
    assert rows[-1]["stiffness_N_per_mm"] == "" and float(rows[-1]["margin"]) < 0


def test_a_weak_plunge_is_below_the_required_stiffness(part, capsys):
    (part.parent / "down.nc").write_text("G1 Z-4 F100\nG1 X40\n")
    assert main(["analyze", "down.nc", "--json", "--no-plots"]) == 0
    plunges = json.loads(capsys.readouterr().out)["plunges"]
    level = plunges["weakest"]["stiffness_N_per_mm"] + 1.0
    assert main(["analyze", "down.nc", "--no-plots", "--require", str(level)]) == 3
    below = r"2 lines below the required .*\n  line 2 .*\n  line 1  .*  G1 Z-4 F100\n"
    assert re.search(below, capsys.readouterr().out)


def test_compare_with_another_machine(part, capsys):
    (part.parent / "soft.toml").write_text(
        _nist().replace("bar_stiffness_N_per_m = inf", "bar_stiffness_N_per_m = 3e8")
    )
    assert main(["analyze", "part.nc", "--compare", "soft.toml", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["compare"]["mean_N_per_mm"] < summary["mean_N_per_mm"]


def _nist() -> str:
    from toolpath_stiff.machine.file import packaged_machines

    return packaged_machines()["nist"].read_text()


def _keys(effect: str) -> list[str]:
    from toolpath_stiff.stiffness.catalogue import find_effect

    return [parameter.key for parameter in find_effect(effect).parameters]


def test_effects_of_a_machine_file_are_honoured_and_instruments_set_aside(part, capsys):
    (part.parent / "bars.toml").write_text(
        _nist() + '\n[[effect]]\nname = "platform_flexibility"\nbar_stiffness_N_per_m = 3e8\n'
    )
    (part.parent / "gauge.toml").write_text(
        _nist()
        + '\n[[instrument]]\nname = "thermal_drift"\n'
        + "".join(f"{key} = 1.0\n" for key in _keys("thermal_drift"))
    )
    assert main(["analyze", "part.nc", "--machine", "gauge.toml", "--no-plots"]) == 0
    assert "instruments set aside" in capsys.readouterr().out
    values = []
    for machine in ("nist", "bars.toml"):
        assert main(["analyze", "part.nc", "--machine", machine, "--json", "--no-plots"]) == 0
        values.append(json.loads(capsys.readouterr().out))
    assert values[1]["mean_N_per_mm"] < values[0]["mean_N_per_mm"]
    assert values[1]["effects"] == ["platform_flexibility"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["analyze", "nothing.nc"], "cannot read"),
        (["analyze", "part.nc", "--machine", "none"], "neither a packaged machine nor a file"),
        (["analyze", "part.nc", "--step", "0"], "more than 0"),
        (["analyze", "part.nc", "--step", "nan"], "more than 0 and at most 1000 mm"),
        (["analyze", "part.nc", "--step", "1e6"], "at most 1000"),
        (["analyze", "part.nc", "--step", "1e-6"], "--step"),
        (["analyze", "part.nc", "--origin", "1,2"], "X, Y, Z"),
        (["analyze", "part.nc", "--origin", "1,2,inf"], "expected finite numbers"),
        (["analyze", "part.nc", "--origin", "1,2,1e9"], "within"),
        (["analyze", "part.nc", "--load", "sideways"], "not a direction"),
        (["analyze", "part.nc", "--force", "-5"], "more than 0"),
        (["analyze", "part.nc", "--require", "-1"], "more than 0"),
        (["analyze", "part.nc", "--format", "xml"], "expected one of csv, parquet"),
        (["analyze", "part.nc", "--effects", "none.py"], "no effects file"),
        (["analyze"], "required"),
        (["analyse", "part.nc"], "Did you mean `tps analyze`"),
        (["--anlyze"], "tps does not know '--anlyze'"),
        (["check", ""], "program ''"),
        (["compare", "long" * 99], "File name too long"),
        (["machine", "check", "."], "Is a directory"),
        (["effects", "check", "."], "no effects file"),
        (["case-study", "--region", "left"], "NAME:X,Y,Z"),
        (["place", "part.nc", "--keep-out", "clamp"], "NAME:X0,Y0,Z0,X1,Y1,Z1"),
        (["plan", "--cost", "pose"], "WHAT=MINUTES"),
        (["pose", "1", "2"], "X Y Z"),
        (["pose"], "give either"),
        (["pose", "0", "0", "5000"], "out of reach"),
        (["pose", "0", "0", "1e9"], "within"),
        (["pose", "0", "0", "-inf"], "expected finite numbers"),
    ],
)
def test_wrong_input_is_one_message_and_exit_2(part, capsys, arguments, words):
    before = sorted(part.parent.iterdir())
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert words in captured.err and "Traceback" not in captured.err
    assert sorted(part.parent.iterdir()) == before


@pytest.mark.parametrize("programs", [["part.nc"], ["part.nc", "other.nc"]])
def test_parquet_without_pyarrow_is_one_line_that_names_the_extra(part, capsys, monkeypatch, programs):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    (part.parent / "other.nc").write_bytes(part.read_bytes())
    before = sorted(part.parent.iterdir())
    assert main(["analyze", *programs, "--format", "parquet", "--no-plots"]) == 2
    error = capsys.readouterr().err
    assert "Parquet needs the package pyarrow" in error and "pip install 'toolpath-stiff[parquet]'" in error
    assert error.count("\n") == 1 and sorted(part.parent.iterdir()) == before


@pytest.mark.parametrize("value", ["-1,0,0", "-.5,0,1", "-1e-3,1,0"])
def test_values_may_begin_with_a_minus(part, value):
    assert main(["analyze", "part.nc", "--no-plots", "--load", value]) == 0


def test_pose_prints_table_1_and_the_paper_pose(part, capsys):
    assert main(["pose", "0", "0", "1268.225", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    found = [round(values[f"k{a}_N_per_mm"]) for a in "xyz"]
    assert found == [57950, 57950, 110141]  # Table 1, first row
    assert main(["pose", "-300", "300", "300", "-30", "0", "0"]) == 0  # the paper's Figure 2
    assert "15889 N/mm" in capsys.readouterr().out


def test_pose_reads_tables_as_offices_write_them(part, capsys):
    poses = part.parent / "poses.csv"
    poses.write_text("X [mm];Y [mm];Z [mm]\n0;0;1268,225\n", encoding="utf-8-sig")
    assert main(["pose", "--csv", "poses.csv"]) == 0
    captured = capsys.readouterr()
    assert round(float(next(csv.DictReader(captured.out.splitlines()))["kx_N_per_mm"])) == 57950  # Table 1
    assert "decimal commas" in captured.err


def test_pose_csv_keeps_the_order_and_names_bad_cells(part, capsys):
    poses = part.parent / "poses.csv"
    poses.write_text("z_mm,x_mm,y_mm\n1268.225,0,0\n353.225,-300,0\n")
    assert main(["pose", "--csv", "poses.csv"]) == 0
    rows = list(csv.DictReader(capsys.readouterr().out.splitlines()))
    assert [round(float(r["kx_N_per_mm"])) for r in rows] == [57950, 40670]  # Table 1
    poses.write_text("x_mm,y_mm,z_mm\n1,2,abc\n1,nan,3\n")
    assert main(["pose", "--csv", "poses.csv"]) == 2
    error = capsys.readouterr().err
    assert "poses.csv:2: pose 1, 2, abc" in error and "poses.csv:3: pose 1, nan, 3" in error
    poses.write_text("x_mm,y_mm,z_mm\n0,0,800\n0,0,9000\n")
    assert main(["pose", "--csv", "poses.csv"]) == 1
    captured = capsys.readouterr()
    assert "row 2: out of reach" in captured.err
    assert list(csv.DictReader(captured.out.splitlines()))[1]["kx_N_per_mm"] == ""


def test_path_alone_needs_no_machine(part, capsys):
    assert main(["path", "part.nc", "--csv", "--step", "50"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == COLUMNS.split(",stiffness", maxsplit=1)[0]
    assert lines[1].startswith("3,rapid,0,0.0000,0.000000,0.0000,0.0000,0.0000,")
    assert "-0.000000" not in "\n".join(lines)
    assert main(["path", "part.nc", "--out", "path.csv", "--origin", "10,20,30"]) == 0
    table = np.genfromtxt(part.parent / "path.csv", delimiter=",", names=True)
    assert table["x_mm"].max() == 110 and table["z_mm"].max() == 30


def test_help_loads_nothing_heavy_and_works_as_a_module():
    code = (
        "import sys; from toolpath_stiff.cli.main import main; main(['--help']);"
        "bad = {'numpy', 'scipy', 'pandas', 'numba', 'matplotlib', 'pygcode'} & set(sys.modules);"
        "sys.exit(f'loaded {bad}' if bad else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    done = subprocess.run(
        [sys.executable, "-m", "toolpath_stiff", "--version"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and done.stdout.startswith("tps ")


def test_analyze_without_plots_loads_neither_pandas_nor_matplotlib(part):
    code = (
        "import sys; from toolpath_stiff.cli.main import main; main(['analyze', 'part.nc', '--no-plots']);"
        "bad = {'scipy', 'pandas', 'numba', 'matplotlib'} & set(sys.modules);"
        "sys.exit(f'loaded {bad}' if bad else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=part.parent)
    assert done.returncode == 0, done.stderr
