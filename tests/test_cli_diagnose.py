"""`tps diagnose`: what it writes and prints, that it does so again to the byte, and what it refuses without a trace."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.effects.cases import BENCH_FILE
from toolpath_stiff.cli.main import main
from toolpath_stiff.report.folder import names
from toolpath_stiff.results_folder import MANIFEST
from toolpath_stiff.rig import case, exercise

PROGRAM = Path(__file__).parents[1] / "programs" / "case_study.nc"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A campaign with a weak strut, and one with a spindle that 42 untilted readings cannot tell from a table."""
    folder = tmp_path_factory.mktemp("campaigns")
    for name, hidden, seed in (("strut", "weak_strut", 7), ("spindle", "spindle_compliance", 11)):
        rows, _ = case.make_case(seed, layout="paper", hidden=hidden, size=0.1)
        (folder / f"{name}.csv").write_text(exercise.csv_text(rows), encoding="utf-8")
    return folder


def diagnosed(measurements, out, *options):
    """The folder that the command writes and what it prints, on stdout and stderr."""
    said, told = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told):
        assert main(["diagnose", str(measurements), "--out", str(out), *options]) == 0
    return out, said.getvalue(), told.getvalue()


@pytest.fixture(scope="module")
def strut(files, tmp_path_factory):
    """With its pictures and page."""
    return diagnosed(files / "strut.csv", tmp_path_factory.mktemp("strut") / "found")


@pytest.fixture(scope="module")
def spindle(files, tmp_path_factory):
    """Figures alone; printed is the document."""
    options = ("--json", "--no-plots", "--program", str(PROGRAM))
    return diagnosed(files / "spindle.csv", tmp_path_factory.mktemp("spindle") / "o", *options)


def test_it_writes_a_report_and_says_what_it_found(strut):
    out, said, told = strut
    assert "weak_strut" in said and "IDENTIFIED" in said
    assert "Traceback" not in told
    written = {file.name for file in out.iterdir()} - {MANIFEST}
    assert {"diagnose.json", "residuals.csv", "report.html"} <= written <= set(names("diagnose"))
    for name in written:
        assert name in said
    found = json.loads((out / "diagnose.json").read_text("utf-8"))
    assert found["verdict"] == "identified" and found["plausible"] == ["weak_strut"]
    page = (out / "report.html").read_text("utf-8")
    assert "weak_strut" in page
    # One file that can be sent around: nothing is loaded from elsewhere.
    assert not re.search(r"""(?:src|href)=["']https?:""", page)


def test_residuals_are_those_of_the_measurements(files, strut):
    out = strut[0]
    with (out / "residuals.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    with (files / "strut.csv").open(newline="") as stream:
        measured = [float(row["stiffness_N_per_mm"]) for row in csv.DictReader(stream)]
    assert [float(row["stiffness_N_per_mm"]) for row in rows] == measured
    found = json.loads((out / "diagnose.json").read_text("utf-8"))
    for when, percent in (
        ("as_given", found["baseline"]["as_given"]["mean_abs_error_percent"]),
        ("law_refitted", found["baseline"]["mean_abs_error_percent"]),
        ("after", found["candidates"][0]["mean_abs_error_percent"]),
    ):
        shown = np.array([float(row[f"{when}_deviation_percent"]) for row in rows])
        modelled = np.array([float(row[f"{when}_N_per_mm"]) for row in rows])
        assert 100.0 * np.abs(modelled / np.array(measured) - 1.0).mean() == pytest.approx(percent, rel=1e-3)
        # Percentages are printed with three decimals, stiffnesses with one; minus: softer than modelled.
        assert shown == pytest.approx(100.0 * (np.array(measured) / modelled - 1.0), abs=2e-3)


def older_cpu():
    """Environment in which numpy and OpenBLAS compute as on a CPU of 2004: sums in another order, nothing fused."""
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    there = [name for name in __cpu_dispatch__ if __cpu_features__.get(name)]
    return os.environ | {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": " ".join(there)}


@pytest.mark.parametrize("command", ["diagnose", "compare", "plan"])
def test_the_same_command_writes_the_same_bytes_on_another_cpu(command, files, tmp_path, monkeypatch, capsys):
    """Each into a folder of the same name; the campaign leaves the verdict ambiguous, so that a plan is made too."""
    given = ["--between", "spindle_compliance,table_compliance", "--n", "2"] if command == "plan" else ["spindle.csv"]
    told = [command, *given, "--no-plots", "--out", "found"]
    here, there = (shutil.copytree(files, tmp_path / name) for name in ("here", "there"))
    words = [sys.executable, "-m", "toolpath_stiff", *told]
    older = subprocess.run(words, cwd=there, env=older_cpu(), stdout=subprocess.PIPE, check=True)
    monkeypatch.chdir(here)
    assert main(told) == 0
    assert capsys.readouterr().out.encode() == older.stdout
    found = [{file.name: file.read_bytes() for file in (one / "found").iterdir()} for one in (here, there)]
    assert found[0] == found[1]


def test_an_ambiguous_verdict_comes_with_what_to_measure_and_what_it_matters(spindle):
    out, said, _ = spindle
    assert {file.name for file in out.glob("[!.]*")} == {"diagnose.json", "residuals.csv"}
    found = json.loads(said)
    assert found["verdict"] == "ambiguous" and "spindle_compliance" in found["plausible"]
    assert found["why"] and found["next"]
    assert found["next_measurements"] and all(row["why"] for row in found["next_measurements"])
    explained = found["path"]["explanations"]
    assert len(explained) >= 2
    means = [entry["mean_N_per_mm"] for entry in explained.values()]
    assert found["path"]["mean_spread_percent"] == pytest.approx(
        100.0 * (max(means) - min(means)) / np.mean(means), abs=0.01
    )
    assert json.loads((out / "diagnose.json").read_text("utf-8")) == found


def test_noise_that_is_stated_takes_the_place_of_what_is_guessed(tmp_path, capsys):
    """Of readings without repeats; what they say under guesses: test_nist_table1."""
    out = ["--no-plots", "--json", "--out", str(tmp_path / "o")]
    assert main(["diagnose", "nist-table1", "--noise", "4,2", *out]) == 0
    stated = json.loads(capsys.readouterr().out)
    assert set(stated["by_noise"]) == {"stated"}
    assert stated["noise"]["repeat_percent"] == pytest.approx(4.0)
    assert stated["noise"]["clamping_percent"] == pytest.approx(2.0)


def test_a_users_own_effect_takes_part(files, tmp_path, capsys):
    effect = tmp_path / "bench.py"
    effect.write_text(BENCH_FILE, encoding="utf-8")
    arguments = ["diagnose", str(files / "strut.csv"), "--no-plots", "--json", "--out", str(tmp_path / "o")]
    assert main([*arguments, "--effects", str(effect)]) == 0
    found = json.loads(capsys.readouterr().out)
    named = {entry["effect"] for entry in found["candidates"]} | {entry["effect"] for entry in found["cannot_test"]}
    assert "bench" in named and found["plausible"] == ["weak_strut"]


FEW = "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n" + "".join(f"{x},0,800,Z,5000{x}\n" for x in range(5))
EMPTY = FEW.replace("50000\n", "\n")
SHORT_NOISE = "more than 0 and at most 50"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["{few}"], "5 readings"),
        (["{empty}"], "stiffness_N_per_mm"),
        (["{missing}"], "missing.csv"),
        (["{strut}", "--noise", "0"], SHORT_NOISE),
        (["{strut}", "--noise", "-2"], SHORT_NOISE),
        (["{strut}", "--noise", "60"], SHORT_NOISE),
        (["{strut}", "--noise", "2,1,1"], SHORT_NOISE),
        (["{strut}", "--noise", "two"], "two"),
        (["{strut}", "--noise", "nan"], "nan"),
        (["{strut}", "--seed", "-1"], "seed"),
        (["{strut}", "--strut-spread", "-1"], "at most 50"),
        (["{strut}", "--machine", "no-such-machine"], "no-such-machine"),
        (["{strut}", "--effects", "{missing}"], "missing.csv"),
        (["{strut}", "{strut}"], "twice"),
        ([], "DATA"),
    ],
)
def test_wrong_input_is_one_message_and_nothing_is_written(files, tmp_path, capsys, arguments, said):
    (tmp_path / "few.csv").write_text(FEW, encoding="utf-8")
    (tmp_path / "empty.csv").write_text(EMPTY, encoding="utf-8")
    places = {
        "few": tmp_path / "few.csv", "empty": tmp_path / "empty.csv", "strut": files / "strut.csv",
        "missing": tmp_path / "missing.csv",
    }  # fmt: skip
    given = [argument.format(**places) for argument in arguments]
    out = tmp_path / "out"
    for command in ["diagnose", *(["plan"] if arguments else [])]:  # without data a plan is a first campaign
        assert main([command, *given, "--out", str(out)]) == 2
        printed = capsys.readouterr()
        assert said in printed.err and "Traceback" not in printed.err
        assert printed.err.count("error:") == 1
        assert not printed.out and not out.exists()
