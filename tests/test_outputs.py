"""No command writes over what it reads, by whatever name; told to, it keeps the old file beside the new one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import check_outputs, old_name
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.rig import case, exercise

PART = "G21 G90 G94\nG0 X0 Y0 Z20\nG1 Z0 F600\nG1 X30 F1200\nM30\n"
RAW = (
    "x_mm,y_mm,z_mm,direction,jog_um,force_N,displacement_um\n"
    "0,0,900,X,0,0,0\n0,0,900,X,200,1000,20\n0,0,900,X,-200,-1000,-20\n0,0,900,X,0,0,0\n"
)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """Inputs of every kind, and folders in which names of results are taken by inputs."""
    monkeypatch.chdir(tmp_path)
    rows, _ = case.make_case(7, layout="paper", hidden="weak_strut", size=0.1)
    data = exercise.csv_text(rows)
    machine = machine_toml(load_machine("nist"))
    for name, text in {
        "part.nc": PART, "machine.toml": machine, "data.csv": data, "raw.csv": RAW, "kins.hal": "# pins\n",
        "reports/update/machine.toml": machine, "reports/plan/plan.csv": data, "reports/compare/residuals.csv": data,
        "reports/diagnose/residuals.csv": data, "reports/map/map.json": machine, "o/summary.json": machine,
        "reports/case_study/case_study.md": machine, "o/placement.json": machine, "x.png": machine,
    }.items():  # fmt: skip
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    (tmp_path / "link.toml").symlink_to(tmp_path / "machine.toml")
    os.link(tmp_path / "machine.toml", tmp_path / "twin.toml")
    return tmp_path


UPDATE = ["update", "data.csv", "--machine", "machine.toml", "--strut-law", "--believe", "machine", "--no-plots"]
REFUSED = [
    [*UPDATE, "-o", "machine.toml"],
    [*UPDATE, "-o", "./reports/../machine.toml"],
    [*UPDATE, "-o", "link.toml"],
    [*UPDATE, "-o", "twin.toml"],
    [*UPDATE, "-o", "data.csv"],
    ["update", "data.csv", "--machine", "reports/update/machine.toml", "--strut-law", "--out", "reports/update"],
    ["plan", "reports/plan/plan.csv", "--out", "reports/plan"],
    ["compare", "reports/compare/residuals.csv", "--out", "reports/compare"],
    ["diagnose", "reports/diagnose/residuals.csv", "--out", "reports/diagnose"],
    ["reduce", "raw.csv", "--out", "raw.csv"],
    ["path", "part.nc", "--out", "part.nc"],
    ["map", "--machine", "reports/map/map.json", "--out", "reports/map"],
    ["case-study", "--machine", "reports/case_study/case_study.md", "--out", "reports/case_study"],
    ["analyze", "part.nc", "--machine", "o/summary.json", "--out", "o"],
    ["place", "part.nc", "--write", "part.nc"],
    ["place", "part.nc", "--machine", "o/placement.json", "--out", "o"],
    ["machine", "show", "x.png", "--out", "x.png"],
    ["rig", "new", "--seed", "1", "--machine", "machine.toml", "--out", "."],
]


@pytest.mark.parametrize("words", REFUSED, ids=" ".join)
def test_an_input_is_never_written_over(words, here, capsys):
    before = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
    assert main(words) == 2
    error = capsys.readouterr().err
    assert "is read here and would be written over" in error and "--replace" in error
    assert {path: path.read_bytes() for path in here.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("option", ["--replace", "--force"])  # of update it is both
def test_told_to_it_keeps_the_old_machine(option, here, capsys):
    old = (here / "machine.toml").read_bytes()
    assert main([*UPDATE, "-o", "machine.toml", option]) == 0
    assert "kept the old machine.toml as machine.toml.old" in capsys.readouterr().out
    assert (here / "machine.toml.old").read_bytes() == old != (here / "machine.toml").read_bytes()
    second = (here / "machine.toml").read_bytes()
    # The law is the fitted one by now: to write it again helps nothing, and is done by force alone.
    assert main([*UPDATE, "-o", "machine.toml", "--replace", "--force"]) == 0
    assert (here / "machine.toml.old2").read_bytes() == second
    assert (here / "machine.toml.old").read_bytes() == old


def test_told_to_path_and_reduce_keep_theirs(here, capsys):
    for words, file in ((["path", "part.nc", "--out", "part.nc"], "part.nc"), (
        ["reduce", "raw.csv", "--out", "raw.csv", "--no-plots"], "raw.csv")):  # fmt: skip
        old = Path(file).read_bytes()
        assert main([*words, "--replace"]) == 0
        assert Path(f"{file}.old").read_bytes() == old != Path(file).read_bytes()
        assert f"{file}.old" in capsys.readouterr().out


def test_templates_replace_nothing_unless_told_to(here, capsys):
    for words, file in ((["machine", "new"], "machine.toml"), (["effects", "new"], "mine.py")):
        Path(file).write_text("mine")
        assert main([*words, file]) == 2
        assert "exists already" in capsys.readouterr().err and Path(file).read_text() == "mine"
        assert main([*words, file, "--replace"]) == 0
        assert Path(f"{file}.old").read_text() == "mine" != Path(file).read_text()


def test_measuring_again_keeps_its_hands_off_the_exercise(here, capsys):
    assert main(["rig", "new", "--seed", "1", "--layout", "paper", "--out", "ex"]) == 0
    (here / "plan.csv").write_text("x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n0,0,900,X,\n")
    for name in ("ex/measurements.csv", "ex/sealed.bin", "plan.csv"):
        before = Path(name).read_bytes()
        assert main(["rig", "measure", "ex", "--at", "plan.csv", "--out", name]) == 2
        assert Path(name).read_bytes() == before
    assert "would be written over" in capsys.readouterr().err


def test_earlier_results_are_written_over_and_other_files_kept(here, capsys):
    for words, file in (([*UPDATE, "-o"], "better.toml"), (["path", "part.nc", "--out"], "path.csv")):
        Path(file).write_text("mine")
        assert main([*words, file]) == main([*words, file]) == 0
        assert Path(f"{file}.old").read_text() == "mine" != Path(file).read_text()
        assert not Path(f"{file}.old2").exists()
        assert capsys.readouterr().out.count(f"kept the old {file} as {file}.old") == 1
    assert load_machine("better.toml").origins["strut_law"] == "fitted"


def test_a_user_s_file_of_the_name_is_kept_and_the_tool_s_is_not(here, capsys):
    assert main(["rig", "new", "--seed", "1", "--layout", "paper", "--out", "ex"]) == 0
    Path("plan.csv").write_text("x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n0,0,900,X,\n")
    for words, file in (
        (["machine", "show", "nist", "--pose", "0,0,800", "--out"], "a.png"),
        (["machine", "check", "machine.toml", "--out"], "b.png"),
        (["reduce", "raw.csv", "--no-plots", "--out"], "c.csv"),
        (["rig", "measure", "ex", "--at", "plan.csv", "--out"], "d.csv"),
    ):
        Path(file).write_text("mine")
        assert main([*words, file]) == main([*words, file]) == 0
        assert Path(f"{file}.old").read_bytes() == b"mine" != Path(file).read_bytes()
        assert not Path(f"{file}.old2").exists()
        assert capsys.readouterr().out.count(f"kept the old {file} as {file}.old") == 1
    assert main(["machine", "show", "nist", "--out", "a.png"]) == 0  # at another pose
    assert main(["rig", "measure", "ex", "--at", "plan.csv", "--out", "d.csv", "--visit", "2"]) == 0
    assert Path("a.png.old2").exists() and Path("d.csv.old2").exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_device_or_a_named_pipe_is_refused_at_once(here, capsys):
    os.mkfifo("pipe")
    for words in (["compare"], ["check"], ["reduce"], ["pose", "--csv"]):
        for name in ("/dev/zero", "pipe"):
            assert main([*words, name]) == 2
            told = capsys.readouterr().err
            assert told.endswith("it is not a regular file\n") and told.count("\n") == 1, told


def test_the_check_itself(tmp_path):
    one, two = tmp_path / "one", tmp_path / "two"
    one.write_text("1")
    two.symlink_to(one)
    assert check_outputs([tmp_path / "new"], [one, tmp_path / "absent"]) == []
    with pytest.raises(InputError, match="two' is read here"):
        check_outputs([two], [one])
    assert check_outputs([two], [one], replace=True) == [two]
    (tmp_path / "one.old").symlink_to(tmp_path / "nowhere")  # a name that is taken, though nothing is there
    assert old_name(one) == tmp_path / "one.old2"
