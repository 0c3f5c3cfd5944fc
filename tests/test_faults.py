"""Whatever stops a run at whatever call, its files are the old ones or the new, and the next run finds nothing odd."""

from __future__ import annotations

import os
import shutil
import sys
import threading
import time
from pathlib import Path

import pytest

import toolpath_stiff as tps
from tests.faults import FAULTS, count_points, fail_at, killed, points
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import write_atomically
from toolpath_stiff.results_folder import INCOMPLETE, MANIFEST, Rules, write_folder

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, and counts the calls of Linux")

OLD = {"report.html": "old page" * 9, "samples.csv": "old", "only old.png": b"\x89"}
NEW = {"report.html": "new page" * 9, "samples.csv": ["n", "ew"], "summary.json": "{}"}


def tree(folder):
    """Content by name, without the tool's own records; a folder has none."""
    found = {str(path.relative_to(folder)): path for path in folder.rglob("*")}
    return {name: p.read_bytes() if p.is_file() else None for name, p in found.items() if not name.startswith(".tps-")}


def left(place):
    """What a run leaves that is not a result."""
    return [path.name for path in place.rglob(".*") if path.name != MANIFEST]


def incomplete(folder):
    return (folder / INCOMPLETE).exists()


def nothing_there(out):
    pass


def old_results(out):
    write_folder(out, OLD, command="test")
    (out / "notes.txt").write_text("mine")


def old_results_and_a_folder(out):
    old_results(out)
    (out / "my folder").mkdir()
    (out / "my folder/part.step").write_text("mine")


def a_file_in_the_way(out):
    old_results(out)
    (out / "samples.csv").write_text("filled in by hand")


CASES = [nothing_there, old_results, old_results_and_a_folder, a_file_in_the_way]


def write(out, **more):
    write_folder(out, NEW, command="test", rules=Rules(replace=True), **more)


@pytest.fixture(params=CASES, ids=lambda case: case.__name__)
def case(request, tmp_path):
    """The folder, what makes it anew and says what it holds then, and what it holds after a run."""
    place = tmp_path / "place"

    def fresh():
        shutil.rmtree(place, ignore_errors=True)
        request.param(place / "out")
        return tree(place / "out")

    fresh()
    write(place / "out")
    new = tree(place / "out")
    assert new != fresh() and not left(place)
    return place / "out", fresh, new


@pytest.mark.parametrize("fault", FAULTS)
def test_an_error_at_any_point_leaves_the_old_files_or_the_new_or_the_folder_says_so(case, fault):
    out, fresh, new = case
    refused = 0
    for number in range(1, count_points(lambda: write(out)) + 1):
        old = fresh()
        try:
            with points(fail_at(number, *FAULTS[fault])):
                write(out)
        except InputError as error:
            assert os.strerror(FAULTS[fault][0]) in str(error)
            refused += 1
        assert tree(out) in (old, new) or incomplete(out), number
        write(out)
        assert tree(out) == new, number
        assert not left(out.parent), number
    assert refused


def test_a_kill_at_any_point_leaves_the_old_files_or_the_new_or_the_folder_says_so(case):
    out, fresh, new = case
    states = set()
    for number in range(1, count_points(lambda: write(out)) + 1):
        old = fresh()
        assert killed(lambda: write(out), number)
        assert tree(out) in (old, new) or incomplete(out), number
        states.add(bool(incomplete(out)))
        write(out)  # nothing there is taken for a user's, and kept
        assert tree(out) == new and not left(out.parent), number
    assert states == {True, False}


def test_a_single_file_is_the_old_or_the_new(tmp_path):
    place = tmp_path / "place"
    place.mkdir()
    file = place / "machine.toml"

    def run():
        write_atomically(file, ["new ", "text"])

    total = count_points(run)
    for number in range(1, total + 1):
        for fault in (*FAULTS.values(), None):
            file.write_text("old")
            if fault is None:
                assert killed(run, number)
            else:
                with pytest.raises(InputError), points(fail_at(number, *fault)):
                    run()
                    raise InputError("a failed fsync of the folder is no failure")
            assert file.read_text() in ("old", "new text")
            run()
            assert file.read_text() == "new text"
            others = [path for path in place.iterdir() if path != file]
            assert fault is None or not others
            for path in others:
                path.unlink()


def test_another_run_waits_for_its_turn(tmp_path):
    after = {"a": lambda: f"{(tmp_path / 'a').read_text()} and second"}
    second = threading.Thread(target=lambda: write_folder(tmp_path, after, command="test"))

    def content():
        second.start()
        time.sleep(0.1)
        return "first"

    write_folder(tmp_path, {"a": content}, command="test")
    second.join()
    assert (tmp_path / "a").read_text() == "first and second"


def test_the_current_folder_stays_itself(tmp_path, monkeypatch):
    """A shell that stands in it would be left in one that is gone."""
    monkeypatch.chdir(tmp_path)
    for content in ("1", "2"):
        before = Path(tmp_path).stat().st_ino
        write_folder(".", {"a": content}, command="test")
        assert Path(tmp_path).stat().st_ino == before and Path("a").read_text() == content
    assert not left(tmp_path)


def test_many_programs_killed_leave_no_overview_of_another_run(tmp_path):
    programs = [tps.Program.from_text(f"G21 G90\nG0 Z5\nG1 Z0 F300\nG1 X{x}\nM2", name=f"{x}.nc") for x in (10, 20)]
    out, template = tmp_path / "out", tmp_path / "template"

    def run(folder, step):
        tps.analyze_many(programs, "nist", folder, jobs=1, plots=False, step_mm=step)

    run(template, 5.0)
    before = tree(template)

    def fresh():
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(template, out)

    fresh()
    total = count_points(lambda: run(out, 2.0))
    after = tree(out)
    assert not incomplete(out) and {name for name in before if before[name] != after[name]} > {"summary.csv"}
    stopped = 0
    for number in range(1, total + 1, 4):
        fresh()
        assert killed(lambda: run(out, 2.0), number)
        if not incomplete(out):
            assert tree(out) in (before, after), number
        else:
            stopped += 1
    assert stopped
