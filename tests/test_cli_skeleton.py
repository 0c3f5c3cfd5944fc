"""The command line itself: help, wrong usage, numbers with a minus, pipes, files that are whole or not there."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import toolpath_stiff as tps
from toolpath_stiff.cli.main import GROUPS, MODULES, main
from toolpath_stiff.cli.parser import COMMANDS as MADE
from toolpath_stiff.cli.parser import Command
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import write_atomically
from toolpath_stiff.options import low_high, numbers

PROGRAM = "G21 G90 G0 X0 Y0 Z10\nG1 Z0 F600\nX100\nM30\n"


@pytest.fixture
def part(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "part.nc"
    file.write_text(PROGRAM)
    return file


@pytest.mark.parametrize("command", MODULES)
def test_every_listed_command_exists_and_explains_itself(command, capsys):
    assert main([command, "--help"]) == 0
    assert capsys.readouterr().out.startswith(f"usage: tps {command}")


def test_help_lists_every_command_with_examples(capsys):
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(f"{name:<11} {about}" in text for names in GROUPS.values() for name, about in names.items())
    assert "examples:" in text


def test_without_a_command_the_help_is_shown(capsys):
    assert main([]) == 2
    assert "usage: tps" in capsys.readouterr().out


@pytest.mark.parametrize(("typed", "meant"), [("anlyze", "analyze"), ("analyse", "analyze"), ("pth", "path")])
def test_a_mistyped_command_suggests_the_nearest(typed, meant, capsys):
    assert main([typed, "part.nc"]) == 2
    assert f"Did you mean `tps {meant}`?" in capsys.readouterr().err


def test_a_word_like_no_command_names_them_all(capsys):
    assert main(["qqqq"]) == 2
    error = capsys.readouterr().err
    assert all(name in error for name in MODULES)


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--step", "0", "more than 0 and at most 1000 mm"),
        ("--step", "-.5", "more than 0 and at most 1000 mm"),
        ("--step", "1001", "more than 0 and at most 1000 mm"),
        ("--step", "-1e-3", "more than 0 and at most 1000 mm"),
        ("--step", "-inf", "more than 0 and at most 1000 mm"),
        ("--step", "-nan", "more than 0 and at most 1000 mm"),
        ("--step", "1_0", "more than 0 and at most 1000 mm"),
        ("--origin", "-1,2", "X, Y, Z or X, Y, Z, A, B, C"),
        ("--origin", "-1,2,nan", "expected finite numbers"),
        ("--origin", "-1e6,0,0", "within +-100000 mm"),
        ("--origin", "0,0,800,0,0,-361", "within +-360 degrees"),
        ("--tools", "", "--tools ''; expected FILE"),  # as of a shell variable that is not set
        ("--feed", " ", "--feed ' '; expected mm/min"),
    ],
)
def test_wrong_values_end_with_what_is_allowed(part, capsys, option, value, said):
    assert main(["path", "part.nc", option, value]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"tps: error: {option}") and error.count("\n") == 1
    assert said in error


@pytest.mark.parametrize("value", ["-10,0,800", "-.5,0,1", "-1e-3,1,0", "-10, 0, 800"])
def test_values_that_begin_with_a_minus_need_no_equals_sign(part, capsys, value):
    assert main(["path", "part.nc", "--origin", value]) == 0
    first = capsys.readouterr().out.splitlines()[1].split(",")
    # The program goes to Z10 first, where it starts from its own zero.
    assert [float(cell) for cell in first[5:8]] == [float(part) for part in value.split(",")]


def test_positional_values_may_begin_with_a_minus(capsys):
    assert main(["pose", "-300", "300", "300", "-30", "0", "0", "--json"]) == 0
    assert main(["pose", "-.5", "-1e-3", "800", "--json"]) == 0
    assert main(["pose", "-inf", "0", "800", "--json"]) == 2
    assert "-inf" in capsys.readouterr().err


number = st.floats(-1e5, 1e5).map(lambda x: x + 0.0)


@given(st.tuples(number, number, number))
def test_origin_is_read_as_it_is_printed(xyz):
    assert numbers(",".join(map(repr, xyz))) == xyz


@given(number, number)
def test_ranges_are_read_in_order_or_refused(low, high):
    if low <= high:
        assert low_high(f"{low!r}:{high!r}") == (low, high)
    else:
        with pytest.raises(Exception, match="above the upper bound"):
            low_high(f"{low!r}:{high!r}")


@pytest.mark.parametrize(
    ("words", "call"),
    [
        (["analyze", "part.nc", "--step", "-1"], lambda: tps.analyze("part.nc", "nist", step_mm=-1)),
        (["path", "part.nc", "--step", "nan"], lambda: tps.sample_path("part.nc", step_mm=float("nan"))),
        (["map", "--points", "1"], lambda: tps.map_stiffness("nist", points=1)),
        (["place", "part.nc", "--objective", "best"], lambda: tps.place("part.nc", "nist", objective="best")),
        (["plan", "--max-tilt", "90"], lambda: tps.plan(machine="nist", max_tilt_deg=90)),
        (["path", "part.nc", "--feed", "0"], lambda: tps.Program.read("part.nc", feed_mm_per_min=0)),
    ],
)
def test_command_and_function_say_the_same_of_a_wrong_value(part, capsys, words, call):
    assert main(words) == 2
    with pytest.raises(InputError) as error:
        call()
    assert capsys.readouterr().err == f"tps: error: {error.value}\n"


def test_an_option_like_none_suggests_the_nearest(part, capsys):
    assert main(["path", "part.nc", "--stp", "3"]) == 2
    assert capsys.readouterr().err == "tps: error: tps path does not know '--stp'. Did you mean --step?\n"


def test_an_option_is_not_abbreviated(part, capsys):
    assert main(["compensate", str(part), "--cut", "cut.toml", "--out", "there"]) == 2
    assert "tps compensate does not know '--out'" in capsys.readouterr().err


def test_input_errors_are_one_line_without_traceback(part, capsys):
    part.write_text("G1 X10\n")  # a feed move before any F
    assert main(["path", "part.nc"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("tps: error: part.nc:1:") and captured.err.count("\n") == 1


def failing(monkeypatch, error):
    """`tps path` ends with an error that no command foresees."""

    def fail(_args):
        raise error

    main(["path", "--help"])
    monkeypatch.setitem(MADE, "path", Command(fail, MADE["path"].takes))


@pytest.mark.parametrize("while_loading", [False, True])
def test_interruption_is_130(part, monkeypatch, capsys, while_loading):
    error = ImportError("initialization failed") if while_loading else KeyboardInterrupt()
    error.__cause__ = KeyboardInterrupt() if while_loading else None
    failing(monkeypatch, error)
    assert main(["path", "part.nc"]) == 130
    assert capsys.readouterr().err == "tps: interrupted; no file is half-written\n"


UNFORESEEN = [
    (ValueError("a\nbug"), r"unexpected error \(ValueError, test_cli_skeleton.py:\d+\): a bug"),
    (np.linalg.LinAlgError("Singular matrix"), r"\(LinAlgError, .*: Singular matrix"),
    (MemoryError("Unable to allocate 9. GiB"), r"Unable to allocate 9. GiB"),
    (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "full/part.csv"), "No space left on device: 'full/part.csv'"),
    (AssertionError(), "no more is known"),
]


@pytest.mark.parametrize(("error", "told"), UNFORESEEN, ids=lambda one: type(one).__name__)
def test_what_nobody_foresaw_is_one_line_and_how_to_report_it(part, monkeypatch, capsys, error, told):
    failing(monkeypatch, error)
    assert main(["path", "part.nc"]) == 2
    text = capsys.readouterr().err
    assert text.startswith("tps: error: ") and text.count("\n") == 1 and re.search(told, text)
    assert ("report this line" in text) != isinstance(error, OSError)  # the system's errors are no defects of tps


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
@pytest.mark.parametrize("words", [["check", "part.nc"], ["path", "part.nc", "--step", "0.01"], ["--help"]])
def test_a_full_disk_behind_the_output_is_an_error(words, part, monkeypatch, capsys):
    with Path("/dev/full").open("w") as full:
        monkeypatch.setattr("sys.stdout", full)
        assert main(words) == 2
    error = capsys.readouterr().err
    assert "No space left on device" in error and error.count("\n") == 1


def test_where_standard_error_is_full_or_closed_the_exit_code_still_tells(part, monkeypatch):
    with Path("/dev/full").open("w") as full:
        monkeypatch.setattr("sys.stderr", full)
        assert main(["check", "gone.nc"]) == 2
    monkeypatch.setattr("sys.stderr", None)
    monkeypatch.setattr("sys.stdout", None)
    assert main(["check", "gone.nc"]) == 2 and main(["check", "part.nc"]) == 0


def test_a_closed_pipe_keeps_the_exit_code_of_require(part, monkeypatch, capsys):
    end, start = os.pipe()
    os.close(end)
    with os.fdopen(start, "w") as pipe:
        monkeypatch.setattr("sys.stdout", pipe)
        assert main(["analyze", "part.nc", "--no-plots", "--require", "9000000", "--origin", "0,0,800"]) == 3
    assert capsys.readouterr().err == ""


def test_nothing_from_a_file_steers_the_terminal(part, monkeypatch, capsys):
    odd = part.with_name("odd\x1b]0;title\x07.nc")
    odd.write_text("(MSG, \x1b[2J\x9b31m\u202e)\nG1 X10\x1b[31m\n")
    for words in (["check"], ["path"], ["analyze"], ["pose", "--at"], ["compare"], ["reduce"], ["effects", "check"]):
        main([*words, odd.name])
        captured = capsys.readouterr()
        assert captured.out + captured.err and not set(captured.out + captured.err) & set("\x1b\x07\x9b\u202e")


def test_a_reader_that_goes_away_is_no_error(part):
    command = [
        sys.executable,
        "-m",
        "toolpath_stiff",
        "path",
        "part.nc",
        "--step",
        "0.001",
    ]  # megabytes, no pipe's fill
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        assert process.stdout.readline().startswith(b"line,motion")
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


def test_path_goes_to_standard_output_or_a_file_with_the_same_bytes(part, capsys):
    assert main(["path", "part.nc"]) == 0
    printed = capsys.readouterr().out
    assert main(["path", "part.nc", "--csv"]) == 0
    assert capsys.readouterr().out == printed
    assert main(["path", "part.nc", "--out", "sub/path.csv"]) == 0
    assert (part.parent / "sub" / "path.csv").read_text() == printed
    assert main(["path", "part.nc", "--csv", "--out", "path.csv"]) == 2
    assert not (part.parent / "path.csv").exists()


def test_the_programs_own_origin_holds_unless_one_is_given(part, capsys):
    part.write_text("G10 L2 P1 X-100 Y50 Z800\n" + PROGRAM)
    assert main(["path", "part.nc"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].split(",")[5:8] == ["0.0000", "50.0000", "800.0000"]
    assert main(["path", "part.nc", "--origin", "1,2,3"]) == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines()[-1].split(",")[5:8] == ["101.0000", "2.0000", "3.0000"]
    assert "tps: warning: part.nc" in captured.err


def test_a_step_too_fine_says_which_would_do(part, capsys):
    assert main(["path", "part.nc", "--step", "1e-6"]) == 2
    error = capsys.readouterr().err
    use = float(error.split("--step ")[1].split()[0])
    assert 100 / 20e6 < use < 2 * 110 / 20e6  # 110 mm in 20 million samples


def test_a_file_is_whole_or_not_there(tmp_path):
    target = tmp_path / "out.csv"
    target.write_text("before")

    def pieces():
        yield "half"
        raise RuntimeError("stop")

    with pytest.raises(RuntimeError):
        write_atomically(target, pieces())
    assert [p.name for p in tmp_path.iterdir()] == ["out.csv"] and target.read_text() == "before"
    assert write_atomically(target, ["af", "ter\r\n", "µ"]) == target
    assert target.read_bytes() == "after\r\nµ".encode()


def test_what_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    for bad in (tmp_path, tmp_path / "file" / "below", tmp_path / ("x" * 300)):
        with pytest.raises(InputError, match="cannot write"):
            write_atomically(bad, "text")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_symbolic_link_stays_a_link(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    link.symlink_to(target)
    write_atomically(link, "new")
    assert link.is_symlink() and target.read_text() == "new"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got: list[str] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()), daemon=True)
    reader.start()
    write_atomically(pipe, "through")
    reader.join(timeout=10)
    assert got == ["through"] and pipe.is_fifo()
