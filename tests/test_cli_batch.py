"""`tps analyze` of many programs: reports side by side, one overview, failures that stop nothing."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import unquote

import pytest

import toolpath_stiff as tps
from tests.test_cli_analyze import PART, _nist
from toolpath_stiff.cli.main import main
from toolpath_stiff.results_folder import MANIFEST, STAGE

BROKEN = "G21 F1000\nG1 X10\nG77.7\n"
FAR = "F1000\nG1 X100\nX2000\n"
QUICK = ["--no-plots", "--step", "20"]
SHORT = [*QUICK, "--jobs", "1"]  # a process takes longer to start than these programs to analyze


@pytest.fixture
def shop(tmp_path, monkeypatch):
    """Two good programs of one name, a broken one between them."""
    monkeypatch.chdir(tmp_path)
    for name, text in {
        "jobs/a/part.nc": PART,
        "jobs/bad.nc": BROKEN,
        "jobs/b/part.nc": PART.replace("Z0", "Z50"),
    }.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


def files_of(folder):
    """Every file but the records of what was written."""
    found = sorted(p for p in folder.rglob("*") if p.is_file() and p.name != MANIFEST)
    return {str(p.relative_to(folder)): p.read_bytes() for p in found}


def rows_of(out):
    return {row["file"]: row for row in csv.DictReader((out / "summary.csv").open(encoding="utf-8"))}


def test_a_failing_program_does_not_stop_the_others_and_is_named_last(shop, capsys):
    assert main(["analyze", "jobs", "--out", "out", "--jobs", "2", *QUICK]) == 1
    printed = capsys.readouterr().out
    lines = printed.splitlines()
    assert lines[0] == "jobs: 3 programs"
    assert [line.split()[0] for line in lines[2:4]] == ["a/part.nc", "b/part.nc"]
    assert lines[4] == "1 of 3 programs failed:"
    assert lines[5].startswith("  jobs/bad.nc:3:1: ") and "G77.7" in lines[5]
    assert set(files_of(shop / "out")) == {
        "a/part/samples.csv", "a/part/summary.json", "b/part/samples.csv", "b/part/summary.json",
        "index.html", "summary.csv",
    }  # fmt: skip


def test_the_overview_says_what_the_summaries_say(shop):
    main(["analyze", "jobs", "--out", "out", *SHORT])
    rows = rows_of(shop / "out")
    assert list(rows) == ["jobs/a/part.nc", "jobs/b/part.nc", "jobs/bad.nc"]
    for file, row in rows.items():
        if row["status"] == "failed":
            assert row["reason"].startswith(f"{file}:3:1: ") and row["mean_N_per_mm"] == row["report"] == ""
            continue
        assert row["reason"] == "" and row["status"] == "done"
        summary = json.loads((shop / "out" / row["report"]).read_text())
        for key in ("mean_N_per_mm", "min_N_per_mm", "max_N_per_mm", "range_N_per_mm", "cutting_length_mm", "time_s"):
            assert float(row[key]) == pytest.approx(summary[key], abs=1e-3)  # a thousandth is the coarsest column
        assert int(row["weakest_line"]) == summary["weakest"]["line"]
        assert row["weakest_text"] == summary["weakest"]["text"]


def test_the_same_bytes_for_any_number_of_jobs(shop, monkeypatch, capsys):
    printed = []
    for jobs in ("1", "2"):
        (shop / jobs).mkdir()
        monkeypatch.chdir(shop / jobs)
        assert main(["analyze", "../jobs", "--jobs", jobs, "--step", "20"]) == 1
        captured = capsys.readouterr()
        assert captured.err == ""
        printed.append(captured.out)
    assert printed[0] == printed[1]
    assert files_of(shop / "1") == files_of(shop / "2")
    assert "reports/a/part/report.html" in files_of(shop / "1")


def test_json_lists_all_in_the_order_given(shop, capsys):
    assert main(["analyze", "jobs/bad.nc", "jobs/b/part.nc", "jobs/a/part.nc", "--json", "--out", "o", *SHORT]) == 1
    bad, *good = json.loads(capsys.readouterr().out)
    assert bad["program"] == "bad.nc" and bad["error"].startswith("jobs/bad.nc:3:1: ")
    assert [entry["file"] for entry in good] == ["jobs/b/part.nc", "jobs/a/part.nc"]
    for entry in good:
        summary = json.loads((shop / entry["report"]).read_text())
        assert {key: entry[key] for key in summary} == summary


def test_a_program_that_cannot_be_read_is_one_of_the_failures(shop, capsys):
    assert main(["analyze", "jobs/a/part.nc", "jobs/gone.nc", *SHORT]) == 1
    assert "cannot read 'jobs/gone.nc'" in capsys.readouterr().out
    assert (shop / "reports/part/summary.json").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["jobs", "--jobs", "0"], "--jobs 0"),
        (["jobs", "--jobs", "two"], "expected at least 1"),
        (["jobs", "--machine", "none"], "neither a packaged machine nor a file"),
        (["jobs", "--compare", "none"], "neither a packaged machine nor a file"),
        (["jobs", "--effects", "none.py"], "no effects file"),
        (["jobs", "--controller", "none.toml"], "none.toml"),
        (["jobs", "--tools", "none.tbl"], "none.tbl"),
        (["jobs", "--out", "jobs/bad.nc/out"], "cannot write"),
        (["jobs/a/part.nc", "empty"], "no NC program in folder 'empty'"),
    ],
)
def test_wrong_arguments_are_one_message_before_anything_starts(shop, capsys, arguments, words):
    (shop / "empty").mkdir()
    before = files_of(shop)
    assert main(["analyze", *arguments]) == 2
    captured = capsys.readouterr()
    assert words in captured.err and "Traceback" not in captured.err and captured.out == ""
    assert files_of(shop) == before and not (shop / "reports").exists()


def test_partial_exits_1_and_require_3_unless_something_failed(shop, capsys):
    (shop / "far.nc").write_text(FAR)
    good = ["jobs/a/part.nc", "jobs/b/part.nc"]
    required = [*SHORT, "--require", "200000"]  # more than the machine has anywhere
    assert main(["analyze", *good, *SHORT]) == 0
    assert main(["analyze", *good, *required]) == 3
    assert "below the required 200000 N/mm:\n  a/part.nc: 4 lines" in capsys.readouterr().out
    assert main(["analyze", *good, "far.nc", *required]) == 1
    assert main(["analyze", *good, "far.nc", "--partial", *required]) == 1
    rows = rows_of(shop / "reports")
    assert rows["far.nc"]["status"] == "partial" and int(rows["far.nc"]["out_of_reach_samples"]) > 0
    assert main(["analyze", "far.nc", "jobs/bad.nc", *SHORT]) == 1
    assert {row["status"] for row in rows_of(shop / "reports").values()} == {"failed"}


def test_compare_and_require_are_columns_of_the_overview(shop, capsys):
    (shop / "soft.toml").write_text(_nist().replace("bar_stiffness_N_per_m = inf", "bar_stiffness_N_per_m = 3e8"))
    assert main(["analyze", "jobs/a", "jobs/b", "--compare", "soft.toml", "--require", "1", *SHORT]) == 0
    assert "other mean" in capsys.readouterr().out
    for row in rows_of(shop / "reports").values():
        assert float(row["compare_mean_N_per_mm"]) < float(row["mean_N_per_mm"])
        assert float(row["compare_mean_difference_percent"]) < 0 == int(row["lines_below_required"])


def test_other_peoples_files_of_these_names_stay(shop, capsys):
    for name in ("index.html", "summary.csv"):
        out = shop / f"with {name}"
        out.mkdir()
        (out / name).write_text("mine")
        assert main(["analyze", "jobs", "--out", str(out), *SHORT]) == 2
        assert "is there already" in capsys.readouterr().err
        assert files_of(out) == {name: b"mine"}
    assert main(["analyze", "jobs", *SHORT]) == 1
    assert main(["analyze", "jobs/a", *SHORT]) == 0  # an earlier overview is replaced
    assert len(rows_of(shop / "reports")) == 1


def test_one_program_has_no_overview_however_often_it_is_named(shop):
    assert main(["analyze", "jobs/a/part.nc", "jobs/a/../a/part.nc", *SHORT]) == 0
    assert set(files_of(shop / "reports")) == {"part/samples.csv", "part/summary.json"}
    assert main(["analyze", "jobs/bad.nc"]) == 2


@pytest.mark.parametrize("name", ["ä b#?.nc", "two\nlines.nc", "\udcff.nc", "%41.nc", "<b>.nc"])
def test_any_file_name_has_its_report_and_a_link_to_it(name, shop, capsys):
    try:
        (shop / "odd").mkdir()
        (shop / "odd" / name).write_text(PART)
    except OSError:
        pytest.skip("this file system does not take the name")
    assert main(["analyze", "odd", "--out", "o", *SHORT]) == 0
    assert main(["analyze", f"odd/{name}", "--out", "single", *SHORT]) == 0
    capsys.readouterr().out.encode("utf-8")  # raises for what no terminal can show
    (link,) = re.findall('<a href="([^"]*)"', (shop / "o/index.html").read_text(encoding="utf-8"))
    assert (shop / "o" / unquote(link, errors="surrogateescape")).is_file()


TRAP = '''
import os, time
from multiprocessing import parent_process
from pathlib import Path

import numpy as np

from toolpath_stiff.stiffness.effects import Effect, Parameter


class Trap(Effect):
    """Kills the process that sees the tool at Z 850 mm, or waits there for ever."""

    name, title, link, equation, source = "trap", "trap", "struts", "-", "-"
    parameters = (Parameter("seconds", "s", 1.0, (0.0, 1e6), (0.0, 1.0), "-"),)

    def strut_compliance(self, path, p):
        if parent_process() is not None and (path.position[:, 2] > 0.84).any():
            Path("reached").touch()
            if p["seconds"] == 0.0:
                os.kill(os.getpid(), 9)
            time.sleep(p["seconds"])
        return np.zeros((len(path), 6))
'''


def trap(shop, seconds):
    (shop / "trap.py").write_text(TRAP)
    (shop / "trap.toml").write_text(_nist() + f'\n[[effect]]\nname = "trap"\nseconds_s = {seconds}\n')
    return ["--machine", "trap.toml", "--effects", "trap.py", "--allow-unchecked-effects"]


def test_a_killed_process_is_a_failing_program(shop, capsys):
    assert main(["analyze", "jobs", "--jobs", "2", *trap(shop, 0.0), *QUICK]) == 1
    rows = rows_of(shop / "reports")
    assert [row["status"] for row in rows.values()] == ["done", "failed", "failed"]
    assert rows["jobs/b/part.nc"]["reason"].startswith("jobs/b/part.nc: its process was ended by SIGKILL")
    assert "jobs/b/part.nc: its process was ended by SIGKILL" in capsys.readouterr().out


def wait_until(process, reached):
    """Until something has been reached, or the process has ended; not for ever."""
    end = time.monotonic() + 300
    while process.poll() is None and not reached():
        assert time.monotonic() < end, "it did not get there"
        time.sleep(0.05)


def test_ctrl_c_leaves_whole_reports_and_nothing_else(shop):
    arguments = ["analyze", "jobs", "--jobs", "2", *trap(shop, 600.0), *QUICK]
    # A shell that runs this in the background ignores SIGINT, and children inherit that: this one shall not.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        process = subprocess.Popen(
            [sys.executable, "-m", "toolpath_stiff", *arguments],
            cwd=shop, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip
    finally:
        signal.signal(signal.SIGINT, before)
    done = shop / "reports/a/part/summary.json"
    try:
        wait_until(process, lambda: done.exists() and (shop / "reached").exists())
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all processes
        _, error = process.communicate(timeout=120)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130
    assert error == "tps: interrupted; no file is half-written\n"
    assert set(files_of(shop / "reports")) == {"INCOMPLETE.txt", "a/part/samples.csv", "a/part/summary.json"}
    assert {path.name for path in (shop / "reports").rglob(".*")} <= {MANIFEST}


def test_no_odd_file_in_a_folder_ends_the_others(shop):
    """Links in a circle or to nowhere, pipes, devices, empty files, zeros, a folder with the name of a program."""
    odd = shop / "jobs/odd"
    (odd / "folder.nc").mkdir(parents=True)
    (odd / "circle.nc").symlink_to(odd / "circle.nc")
    (odd / "nowhere.nc").symlink_to("/nonexistent")
    (odd / "device.nc").symlink_to("/dev/zero")
    if hasattr(os, "mkfifo"):
        os.mkfifo(odd / "pipe.nc")
    (odd / "empty.nc").touch()
    (odd / "zeros.nc").write_bytes(b"\0" * 1000)
    (odd / "nested.nc").write_text("(" * 10_000)
    assert main(["analyze", "jobs", "--out", "out", *SHORT]) == 1
    status = {Path(file).name: row["status"] for file, row in rows_of(shop / "out").items() if "odd" in file}
    assert status == dict.fromkeys(["circle.nc", "empty.nc", "nested.nc", "nowhere.nc", "zeros.nc"], "failed")


def test_the_command_shows_what_the_function_returns(shop, capsys):
    seen = []
    found = tps.analyze_many(
        ["jobs"], "nist", "out", plots=False, step_mm=20, jobs=1, progress=lambda *told: seen.append(told)
    )
    before = files_of(shop / "out")
    assert main(["analyze", "jobs", "--out", "out", *SHORT]) == 1
    assert capsys.readouterr().out == f"jobs: 3 programs\n{found}\nwritten:\n  out/index.html\n  out/summary.csv\n"
    assert files_of(shop / "out") == before
    assert main(["analyze", "jobs", "--out", "out", "--json", *SHORT]) == 1
    printed = capsys.readouterr().out
    assert printed == found.to_json() and json.loads(printed) == found.to_dict()
    assert seen[0] == ("1 at a time", 0, 3) and sorted(seen[1:], key=lambda one: one[1])[-1][1:] == (3, 3)
    assert {text for text, _, _ in seen[1:]} == {"a/part.nc", "b/part.nc", "bad.nc: failed"}


def test_the_table_of_the_function_is_the_summary(shop):
    found = tps.analyze_many(["jobs"], "nist", "out", plots=False, step_mm=20, jobs=1, compare_with="genhexkins")
    frame = found.to_frame()
    with (shop / "out/summary.csv").open(encoding="utf-8") as stream:
        heading, *rows = csv.reader(stream)
    assert list(frame.columns) == heading and repr(found) == "<ManyAnalyses: 3 programs, 1 failed>"
    assert frame["reason"].tolist() == [row[heading.index("reason")] for row in rows]
    found = tps.analyze_many(["jobs"], "nist", "out", plots=False, step_mm=20, jobs=1)
    rows = rows_of(shop / "out")
    for _, one in found.to_frame().iterrows():
        row = rows[one["file"]]
        assert (one["program"], one["status"], one["report"]) == (row["program"], row["status"], row["report"])
        if one["status"] == "done":
            assert one["mean_N_per_mm"] == pytest.approx(float(row["mean_N_per_mm"]), abs=1e-4)
    assert [one.file for one in found.failed] == ["jobs/bad.nc"] and not found.complete and not found.below_required


def test_programs_may_be_given_as_objects_and_read_their_own_way(shop):
    inch = tps.Program.from_text("G20 F40.\nG1 X1.\nX0\nM2", name="inch.nc", dialect="fanuc")
    read = tps.Program.read("jobs/a/part.nc")
    found = tps.analyze_many([inch, read, Path("jobs/b")], "nist", "out", plots=False, jobs=2, step_mm=20)
    assert [(one.name, one.status) for one in found.outcomes] == [
        ("inch.nc", "done"), ("jobs/a/part.nc", "done"), ("jobs/b/part.nc", "done"),
    ]  # fmt: skip
    alone = tps.analyze(inch, "nist", step_mm=20)
    assert found.to_dict()[0] == {**alone.to_dict(), "file": "inch.nc", "report": "out/inch/summary.json"}


@pytest.mark.parametrize(
    ("programs", "options", "words"),
    [
        ([], {}, "no programs"),
        (["jobs"], {"step_mm": -1.0}, "--step -1"),
        (["jobs"], {"load": "sideways"}, "sideways"),
        (["jobs"], {"table": "xls"}, "xls"),
        (["jobs"], {"jobs": 0}, "--jobs 0"),
        (["jobs"], {"dialect": "klingon"}, "klingon"),
        (["jobs"], {"compare_with": "none"}, "neither a packaged machine nor a file"),
        ([tps.Program.from_text("G1 X1 F1", "a.nc"), tps.Program.from_text("G1 X2 F1", "a.nc")], {}, "named 'a.nc'"),
    ],
)
def test_a_wrong_argument_of_the_function_starts_nothing(shop, programs, options, words):
    with pytest.raises(tps.InputError, match=re.escape(words)):
        tps.analyze_many(programs, "nist", "out", **options)
    assert not (shop / "out").exists()


def test_any_executor_will_do(shop):
    with ThreadPoolExecutor(3) as threads:
        found = tps.analyze_many(["jobs"], "nist", "out", executor=threads, plots=False, step_mm=20)
    tps.analyze_many(["jobs"], "nist", "alone", jobs=1, plots=False, step_mm=20)
    assert files_of(shop / "out") == files_of(shop / "alone")
    assert [one.status for one in found.outcomes] == ["done", "done", "failed"]


@pytest.mark.parametrize("name", ["SIGTERM", "SIGKILL"])
def test_however_the_first_process_ends_the_others_end_too(name, shop):
    arguments = ["analyze", "jobs", "--jobs", "2", *trap(shop, 600.0), *QUICK]
    process = subprocess.Popen(
        [sys.executable, "-m", "toolpath_stiff", *arguments], cwd=shop, stderr=subprocess.PIPE, text=True
    )
    try:
        wait_until(process, (shop / "reached").exists)
        process.send_signal(getattr(signal, name))
        _, error = process.communicate(timeout=120)  # the pipe is open as long as any process lives
    finally:
        process.kill()
    if name == "SIGTERM":  # as Ctrl-C
        assert process.returncode == 130 and error == "tps: interrupted; no file is half-written\n"
    assert {path.name for path in (shop / "reports").rglob(".*")} <= {MANIFEST, STAGE}
