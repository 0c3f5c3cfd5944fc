"""`tps update` as a user calls it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.conftest import as_written
from tests.stiffness.cases import nist
from tests.updating.cases import active, table_1
from toolpath_stiff.cli.main import main
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.report.update import page as update_html

WEAK = ("--add", "weak_strut:strut=3", "--believe", "machine")


@pytest.fixture(scope="module")
def weak_csv(tmp_path_factory):
    """The paper's points on a machine whose third strut is a quarter softer; readings scatter by 2 %."""
    data = table_1()
    logs = Predictor(nist(), data).log_stiffness((0.0, 0.0), [active("weak_strut", {"strut": 3}, factor=0.75)])
    scattered = np.exp(logs + 0.02 * as_written(1).standard_normal(len(logs))) / 1e3
    rows = ["point,x_mm,y_mm,z_mm,direction,force_N,stiffness_N_per_mm,sd_N_per_mm"]
    for i, value in enumerate(scattered):
        x, y, z = 1e3 * data.position[i]
        axis = "XYZ"[int(np.argmax(np.abs(data.direction[i])))]
        rows.append(f"{data.point[i]},{x:.3f},{y:.3f},{z:.3f},{axis},500,{value:.1f},{0.02 * value:.1f}")
    file = tmp_path_factory.mktemp("update") / "weak.csv"
    file.write_text("\n".join(rows) + "\n")
    return str(file)


def test_a_name_is_no_markup_on_the_page():
    found = tps.update("nist-table1", strut_law=True)
    named = replace(found, task=replace(found.task, files=("<b>x</b>.csv",)))
    assert "&lt;b&gt;x" in update_html(named, {}) and "<b>x</b>" not in update_html(named, {})


def test_the_error_falls_and_the_machine_is_used(weak_csv, tmp_path, capsys):
    out = tmp_path / "update"
    assert main(["update", weak_csv, *WEAK, "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    for words in ("UPDATED", "weak_strut (strut 3)", "noise floor", "direction", "  factor "):
        assert words in printed
    assert {file.name for file in out.glob("[!.]*")} == {
        "update.json", "residuals.csv", "machine.toml", "before_after.png", "report.html",
    }  # fmt: skip
    told = json.loads((out / "update.json").read_text())
    assert told["steps"][-1]["held_out_error_percent"] < told["steps"][0]["held_out_error_percent"]
    assert told["machine_file"] == str(out / "machine.toml")
    page = (out / "report.html").read_text()
    assert page.count("<img ") == 1
    assert "{{" not in page
    machine = load_machine(out / "machine.toml")
    assert machine.effects[0].provenance["data_sha256"] == told["provenance"]["data_sha256"]
    program = tmp_path / "part.nc"
    program.write_text("G21 G90 G94\nG0 X0 Y0 Z20\nG1 Z0 F600\nG1 X50 F1200\nM30\n")
    analysis = tmp_path / "analysis"
    arguments = ["analyze", str(program), "--machine", str(out / "machine.toml"), "--out", str(analysis)]
    assert main([*arguments, "--step", "5"]) == 0
    assert "95 % band" in capsys.readouterr().out
    summary = json.loads((analysis / "summary.json").read_text())
    assert summary["effects"] == ["weak_strut"]
    low, high = summary["parameter_uncertainty"]["mean_95_N_per_mm"]
    assert low < summary["mean_N_per_mm"] < high


def test_the_same_command_writes_the_same_bytes(weak_csv, tmp_path, capsys):
    for folder in ("a", "b"):
        assert main(["update", weak_csv, *WEAK, "--no-plots", "--out", str(tmp_path / folder)]) == 0
    for file in (tmp_path / "a").glob("[!.]*"):
        again = (tmp_path / "b" / file.name).read_text()
        assert file.read_text() == again.replace(str(tmp_path / "b"), str(tmp_path / "a"))


def test_refused_is_no_failure_and_leaves_no_machine(weak_csv, tmp_path, capsys):
    out, elsewhere = tmp_path / "update", tmp_path / "made" / "machine.toml"
    assert main(["update", weak_csv, *WEAK, "--no-plots", "--out", str(out)]) == 0
    wrong = ["update", weak_csv, "--add", "joint_compliance", "--add", "weak_strut", "--no-plots", "--out", str(out)]
    assert main(wrong) == 0
    assert "REFUSED" in capsys.readouterr().out
    assert not (out / "machine.toml").exists()
    assert json.loads((out / "update.json").read_text())["machine_file"] is None
    assert main([*wrong, "--force", "-o", str(elsewhere), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"] == "forced"
    assert [entry.name for entry in load_machine(elsewhere).effects] == ["joint_compliance", "weak_strut"]
    assert not (out / "machine.toml").exists()


def test_table_1_bears_no_effect(tmp_path, capsys):
    """The negative control: readings that scatter by a tenth name no effect."""
    assert main(["update", "nist-table1", "--auto", "--strut-law", "--no-plots", "--out", str(tmp_path)]) == 0
    told = json.loads((tmp_path / "update.json").read_text())
    assert told["steps"][-1]["effects"] == []
    assert {one["effect"] for one in told["rejected"]} >= {"joint_moment_stiffness"}


def test_the_papers_own_estimation(tmp_path, capsys):
    arguments = ["update", "nist-table1", "--strut-law", "--objective", "mean-error", "--out", str(tmp_path)]
    assert main(arguments) == 0
    assert "46.30 N/um" in capsys.readouterr().out
    told = json.loads((tmp_path / "update.json").read_text())
    assert told["search"]["agreeing"] == len(told["search"]["end_errors_percent"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "nothing to update"),
        (("--strut-law", "--objective", "mean-error", "--auto"), "mean-error"),
        (("--objective", "mean-error"), "--strut-law"),
        (("--add", "weak_strutt"), "weak_strut"),
        (("--auto", "--seed", "-1"), "seed -1"),
    ],
)
def test_wrong_arguments(arguments, words, tmp_path, capsys):
    assert main(["update", "nist-table1", *arguments, "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
