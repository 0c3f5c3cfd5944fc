"""`tps check` and `tps diagnose` with LinuxCNC's interpreter."""

from __future__ import annotations

import json
import shutil

import pytest

from toolpath_stiff.cli.main import main

needs_rs274 = pytest.mark.skipif(shutil.which("rs274") is None, reason="LinuxCNC's rs274 is not installed")
# Variables and a loop, and a code that the built-in reader refuses.
LOOP = "#1=5\nG21 G90 F100\nG1 X#1\no1 repeat [3]\nG91 G1 Y1 M8\no1 endrepeat\nG7\nM2\n"


def check(capsys, file, *options):
    code = main(["check", str(file), "--json", *options])
    return code, json.loads(capsys.readouterr().out)


@pytest.fixture
def program(tmp_path):
    def write(text):
        file = tmp_path / "part.ngc"
        file.write_text(text)
        return file

    return write


@needs_rs274
@pytest.mark.parametrize("interpreter", ["linuxcnc", "auto"])
def test_a_program_with_variables_is_checked(interpreter, program, capsys):
    code, found = check(capsys, program(LOOP), "--interpreter", interpreter)
    assert code == 0 and found["complete"] and found["interpreter"] == found["dialect"] == "linuxcnc"
    assert found["extents_mm"]["x"] == [0.0, 5.0] and found["extents_mm"]["y"] == [0.0, 3.0]
    assert found["lengths_mm"]["cutting"] == pytest.approx(8.0)
    assert {code["code"]: code["count"] for code in found["used"]}["G1"] == 2
    assert [word["code"] for word in found["unsupported"]] == ["M8"]
    notes = [finding for finding in found["findings"] if finding["code"] == "interpreter"]
    assert len(notes) == (interpreter == "auto")


@needs_rs274
def test_auto_is_the_built_in_check_where_that_reads_all(program, capsys):
    file = program("G1 X5 F100\nM2\n")
    assert check(capsys, file, "--interpreter", "auto") == check(capsys, file)


@needs_rs274
def test_both_refuse(program, capsys):
    code, found = check(capsys, program("G1 X5 F100\n#1 = 3 G7\nM[101]\nM2\n"), "--interpreter", "auto")
    assert code == 1 and not found["complete"] and found["interpreter"] == "builtin"
    errors = [(finding["line"], finding["text"]) for finding in found["findings"] if finding["severity"] == "error"]
    assert [line for line, _ in errors] == [2, 3]
    assert "nor by LinuxCNC: an M code that is computed" in errors[1][1]


@needs_rs274
def test_what_linuxcnc_refuses_is_a_finding(program, capsys):
    code, found = check(capsys, program("G1 X5 F100\nG1 X[1/0]\nM2\n"), "--interpreter", "linuxcnc")
    assert code == 1 and not found["complete"]
    assert [finding["line"] for finding in found["findings"] if finding["severity"] == "error"] == [2]


def test_without_it_the_message_says_how_to_get_it(program, capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    file = program(LOOP)
    assert main(["check", str(file), "--interpreter", "linuxcnc"]) == 2
    assert "linuxcnc-uspace" in capsys.readouterr().err
    code, found = check(capsys, file, "--interpreter", "auto")
    assert code == 1
    assert any("linuxcnc-uspace" in finding["text"] for finding in found["findings"])


def test_diagnose_reads_its_program_as_analyze_does():
    from toolpath_stiff.cli.main import actions_of

    options = ["--interpreter", "linuxcnc", "--dialect", "haas", "--block-delete=2", "--origin", "0,0,800"]
    words = ["readings.csv", "--program", "part.ngc", *options]
    args = actions_of("diagnose")["diagnose"].read("tps diagnose", words)
    assert (args.interpreter, args.dialect, args.block_delete) == ("linuxcnc", "haas", frozenset({2}))
