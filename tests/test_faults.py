"""Whatever stops a run at whatever call, its files are the old ones or the new, and the next run finds nothing odd."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest

import toolpath_stiff as tps
from tests.faults import FAULTS, count_points, fail_at, killed, points
from toolpath_stiff import results_folder
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import FileError
from toolpath_stiff.files import write_atomically
from toolpath_stiff.results_folder import INCOMPLETE, MANIFEST, Rules, clear_up, incomplete, write_folder

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


def nothing_there(out):
    pass


def old_results(out):
    write_folder(out, OLD, command="test")
    (out / "notes.txt").write_text("mine")


def old_results_and_a_folder(out):
    old_results(out)
    (out / "my folder").mkdir()
    (out / "my folder/part.step").write_text("mine")


def an_exercise_that_is_replaced(out):
    """All files of the tool's own, each to be kept."""
    old_results(out)


def a_file_in_the_way(out):
    old_results(out)
    (out / "samples.csv").write_text("filled in by hand")


class Case:
    """A folder before and after a run that is let through."""

    def __init__(self, place, prepare, exchanges):
        self.place, self.out, self.template = place, place / "out", place.with_name("template")
        self.prepare, self.exchanges = prepare, exchanges
        fresh = prepare is an_exercise_that_is_replaced
        self.rules = Rules(fresh=fresh, replace=fresh or prepare is a_file_in_the_way)
        self.old = self.fresh()
        self.points = count_points(self.run)
        self.new = tree(self.out)
        assert self.new != self.old and not left(place)

    def fresh(self):
        shutil.rmtree(self.place, ignore_errors=True)
        if not self.template.exists():
            self.template.mkdir()
            self.prepare(self.template / "out")
        shutil.copytree(self.template, self.place)
        return tree(self.out)

    def run(self):
        write_folder(self.out, NEW, command="test", rules=self.rules)


# The folder as it was, whether it can be exchanged on this file system.
CASES = [
    (nothing_there, True),
    (old_results, True),
    (a_file_in_the_way, True),
    (old_results_and_a_folder, True),
    (a_file_in_the_way, False),
    (an_exercise_that_is_replaced, True),
    (an_exercise_that_is_replaced, False),
]


@pytest.fixture(params=CASES, ids=lambda one: f"{one[0].__name__}-{'' if one[1] else 'not '}exchanged")
def case(request, tmp_path, monkeypatch):
    prepare, exchanges = request.param
    if not exchanges:
        monkeypatch.setattr(results_folder, "exchange", lambda one, other: False)
    return Case(tmp_path / "place", prepare, exchanges and prepare is not old_results_and_a_folder)


@pytest.mark.parametrize("fault", FAULTS)
def test_an_error_at_any_point_leaves_the_old_files_or_the_new(case, fault):
    code, lasting = FAULTS[fault]
    refused = 0
    for number in range(1, case.points + 1):
        case.fresh()
        try:
            with points(fail_at(number, code, lasting)):
                case.run()
        except FileError as error:
            assert os.strerror(code) in str(error)
            refused += 1
        assert tree(case.out) in (case.old, case.new), number
        clear_up([case.out])
        assert tree(case.out) in (case.old, case.new), number
        assert not left(case.place), number
    assert refused


def test_a_kill_at_any_point_leaves_the_old_files_or_the_new(case):
    for number in range(1, case.points + 1):
        case.fresh()
        assert killed(case.run, number)
        # At once, or when the next run has looked at it; until then every command says so.
        if case.exchanges or not incomplete(case.out):
            assert tree(case.out) in (case.old, case.new), number
        clear_up([case.out])
        assert tree(case.out) in (case.old, case.new), number
        assert not left(case.place), number
        if number % 3 == 0 and not (case.rules.fresh and tree(case.out) == case.new):
            case.run()
            assert tree(case.out) == case.new


def test_a_kill_while_the_next_run_clears_up_is_made_good_by_the_one_after(tmp_path):
    case = Case(tmp_path / "place", old_results_and_a_folder, False)
    for number in range(1, case.points + 1, 5):
        for second in range(1, 40, 5):
            case.fresh()
            assert killed(case.run, number)
            done = not killed(lambda: clear_up([case.out]), second)
            clear_up([case.out])
            assert tree(case.out) in (case.old, case.new), (number, second)
            assert not left(case.place)
            if done:
                break


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
                with pytest.raises(FileError), points(fail_at(number, *fault)):
                    run()
                    raise FileError("a failed fsync of the folder is no failure")
            assert file.read_text() in ("old", "new text")
            run()
            assert file.read_text() == "new text"
            assert [path.name for path in place.iterdir()] == [file.name]


@pytest.mark.parametrize("prepare", [nothing_there, old_results, old_results_and_a_folder])
def test_a_file_elsewhere_and_its_folder_are_of_one_run_or_the_folder_says_so(tmp_path, prepare):
    """`place --write`, `update -o`."""
    place = tmp_path / "place"
    out, file = place / "out", place / "machine.toml"

    def fresh():
        shutil.rmtree(place, ignore_errors=True)
        prepare(out)
        write_atomically(file, "old")
        return tree(out)

    def run():
        write_folder(out, NEW, command="test", elsewhere={file: "new"})

    before = fresh()
    total = count_points(run)
    after = tree(out)
    assert INCOMPLETE not in after and not incomplete(out)
    states = set()
    for number in range(1, total + 1):
        fresh()
        assert killed(run, number)
        whole = tree(out) in ((before, after)[file.read_text() == "new"],)
        assert whole or incomplete(out), number
        states.add(whole)
        for code, lasting in FAULTS.values():
            fresh()
            try:
                with points(fail_at(number, code, lasting)):
                    run()
            except FileError:
                assert incomplete(out) or (tree(out), file.read_text()) in ((before, "old"), (after, "new")), number
        run()
        assert tree(out) == after and file.read_text() == "new" and not left(place)
    assert states == {True, False}


def test_what_others_write_at_the_moment_of_the_exchange_stays(tmp_path, monkeypatch):
    out = tmp_path / "out"
    old_results(out)
    real = results_folder.exchange

    def meanwhile(one, other):
        (out / "late.txt").write_text("mine")
        (out / "notes.txt").unlink()
        (out / "notes.txt").write_text("edited, as editors do")
        return real(one, other)

    monkeypatch.setattr(results_folder, "exchange", meanwhile)
    write_folder(out, NEW, command="test")
    assert (out / "late.txt").read_text() == "mine"
    assert (out / "notes.txt").read_text() == "edited, as editors do"
    assert set(tree(out)) == {*NEW, "late.txt", "notes.txt"}
    assert not left(tmp_path)


def test_another_run_is_named(tmp_path, monkeypatch):
    """Where it does not come to an end; this one waits for a while."""
    from toolpath_stiff import locks

    monkeypatch.setattr(locks, "WAIT_SECONDS", 0.05)
    monkeypatch.setattr(sys, "argv", ["/usr/bin/tps", "analyze", "my part.nc"])
    inside = {"a": lambda: write_folder(tmp_path / "out", {"b": ""}, command="test")}
    told = r"is being written by another run: tps analyze 'my part.nc' \(process \d+ on .+\)\. Wait for it"
    with pytest.raises(FileError, match=told):
        write_folder(tmp_path / "out", inside, command="test")
    assert not list(tmp_path.iterdir())


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
            halves = tree(out)
            assert halves.get("summary.csv") != before["summary.csv"] or halves == before
    assert stopped


def test_every_command_that_reads_an_incomplete_folder_says_so(tmp_path, capsys):
    """The process that writes a file elsewhere dies between the folder and that file."""
    out, file = tmp_path / "out", tmp_path / "part.nc"
    command = ["machine", "check", str(out / "machine.toml"), "--json"]

    def run():
        write_folder(out, {"machine.toml": text}, command="test", elsewhere={file: "new"})

    text = tps.Machine.load("nist").save(tmp_path / "nist.toml").read_text()
    run()
    assert main(command) == 0 and not capsys.readouterr().err
    number = count_points(run)
    while not incomplete(out):
        assert killed(run, number)
        number -= 1
    assert main(command) == 0
    assert "is incomplete: the run that wrote it has not come to its end" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["data", "machine", "program", "exercise"])
def test_a_case_that_is_killed_while_it_adds_a_file_keeps_no_orphan(tmp_path, kind):
    place, template, slot = tmp_path / "case", tmp_path / "template", tmp_path / "slot.nc"
    slot.write_text("G21 G90\nG1 X40 F300\nM2\n")
    tps.Case.open(template)
    (template / "data").mkdir()
    (template / "data/mine.csv").write_text("a user's own")

    def fresh():
        shutil.rmtree(place, ignore_errors=True)
        shutil.copytree(template, place)

    def run():
        case = tps.Case.open(place)
        add = {"data": case.add_data, "machine": case.set_machine, "program": case.add_program}
        if kind == "exercise":
            case.start_exercise(9006, layout="paper")
        else:
            add[kind]({"data": "nist-table1", "machine": "genhexkins", "program": slot}[kind])

    fresh()
    total = count_points(run)
    before, after = tree(template), tree(place)
    for number in range(1, total + 1, 1 + (kind == "exercise")):
        fresh()
        assert killed(run, number)
        tps.Case.open(place)
        files = {name: text for name, text in tree(place).items() if text is not None}
        assert files in ({n: t for n, t in one.items() if t is not None} for one in (before, after)), number
        assert not left(place)


def test_a_journal_of_somebody_else_reaches_nothing_outside_the_rooms_of_a_case(tmp_path):
    case, mine = tmp_path / "case", tmp_path / "mine"
    tps.Case.open(case)
    mine.mkdir()
    (mine / "x.csv").write_text("mine")
    (case / "data").symlink_to(mine)
    names = ["../mine/x.csv", "data/x.csv", "data/../case.toml", "machines", "case.toml", "", str(mine / "x.csv")]
    (case / ".tps-adding").write_text("\n".join([*names, "machines/nist.toml", ""]))
    before = tree(tmp_path)
    tps.Case.open(case)
    assert {name: text for name, text in tree(tmp_path).items() if "tps-adding" not in name} == {
        name: text for name, text in before.items() if "tps-adding" not in name
    }
