"""What is printed to be pasted runs as it stands, and carries what the command before it was told."""

from __future__ import annotations

import ast
import re
import shlex
from pathlib import Path
from types import SimpleNamespace

import pytest

import toolpath_stiff
from tests.effects.cases import BENCH_FILE
from tests.machine.test_machine_files import HAL
from toolpath_stiff.cli.main import MODULES as COMMANDS
from toolpath_stiff.cli.main import main
from toolpath_stiff.diagnosis.words import next_steps
from toolpath_stiff.hints import Asked, command_line, hint, parted
from toolpath_stiff.rig import case, exercise

PACKAGE = Path(toolpath_stiff.__file__).parent
DRAWING = ("diagnose", "compare", "update", "plan", "map")
NAMES = "|".join(COMMANDS)


def commands_in(printed: str) -> list[str]:
    """Commands on lines of their own, and whole ones in backticks."""
    own_lines = [line.strip() for line in printed.splitlines() if re.match(rf"\s*tps ({NAMES})\b", line)]
    return [*own_lines, *re.findall(rf"`(tps (?:{NAMES}) [^`]+)`", " ".join(printed.split()))]


def run(line: str, capsys, code: int = 0) -> list[str]:
    """Run a command as a shell would split it; the commands that it prints, on either stream."""
    words = shlex.split(line)[1:]
    assert main([*words, *(["--no-plots"] if words[0] in DRAWING else [])]) == code, line
    captured = capsys.readouterr()
    return commands_in(captured.out + captured.err)


def follow(line: str, capsys) -> list[str]:
    """Run a command and everything that it and its followers print, each once."""
    done: list[str] = []
    waiting = [line]
    while waiting:
        now = waiting.pop(0)
        if now not in done:
            done.append(now)
            waiting += run(now, capsys)
    return done


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder whose name a shell has to be told with quotes."""
    folder = tmp_path / "first try"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def test_from_an_exercise_to_the_machine_that_explains_it(here, capsys):
    """A blind exercise, its diagnosis, update, comparison, map: nothing is typed after the first command."""
    (here / "set up.py").write_text(BENCH_FILE)
    new = "tps rig new --seed 3 --layout paper --hidden setup_compliance --noise 1 --out 'ex 1'"
    diagnosis = run(new, capsys)
    assert diagnosis == ["tps diagnose 'ex 1/measurements.csv' --machine 'ex 1/machine.toml'"]
    done = follow(f"{diagnosis[0]} --effects 'set up.py' --noise 1 --strut-spread 0.5", capsys)
    update = next(line for line in done if line.startswith("tps update"))
    for part in ("--machine 'ex 1/machine.toml'", "--effects 'set up.py'", "--noise 1", "--strut-spread 0.5"):
        assert part in update
    assert (here / "ex 1/machine-updated.toml").is_file()
    assert {shlex.split(line)[1] for line in done} == {"diagnose", "update", "compare", "map"}
    assert any(line.startswith("tps map") and "--setup riser" in line for line in done)
    readings = "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n0,0,900,X,\n50,0,900,Y,\n"
    (here / "plan.csv").write_text(readings)
    again = run("tps rig measure 'ex 1' --at plan.csv --out 'more data.csv'", capsys)
    assert again == ["tps diagnose 'ex 1/measurements.csv' 'more data.csv' --machine 'ex 1/machine.toml'"]


def test_what_the_data_leave_open_is_planned(here, capsys):
    rows, _ = case.make_case(11, layout="paper", hidden="spindle_compliance", size=0.1)
    (here / "a spindle.csv").write_text(exercise.csv_text(rows), encoding="utf-8")
    done = follow("tps diagnose 'a spindle.csv' --noise 2,1", capsys)
    plan, update, *further = done[1:]
    assert plan == "tps plan 'a spindle.csv' --noise 2,1"
    # Until then: what the update takes away, and what it leaves.
    assert update == "tps update 'a spindle.csv' --auto --believe machine -o nist-updated.toml --noise 2,1"
    assert (here / "nist-updated.toml").is_file() and {shlex.split(line)[1] for line in further} == {
        "compare",
        "diagnose",
        "map",
    }


def test_what_nothing_explains_is_written_and_tried(here, capsys):
    rows, _ = case.make_case(7, layout="paper", hidden="weak_strut", size=0.1)
    (here / "data.csv").write_text(exercise.csv_text(rows), encoding="utf-8")
    asked = Asked(("data.csv",), effects=(), stated=("--noise", "3"))
    said = SimpleNamespace(
        verdict="unexplained", best=None, main=SimpleNamespace(question=""), portrait=None, remarks=()
    )
    lines = [line for _, line in map(parted, next_steps(said, asked))]
    assert [shlex.split(line)[1] for line in lines] == ["compare", "effects", "diagnose"]
    for line in lines:
        run(line, capsys)
    # Where it has a portrait, this is drafted.
    portrait = SimpleNamespace(terms=(SimpleNamespace(term=SimpleNamespace(acts=True)),))
    said.portrait = portrait
    lines = [line for _, line in map(parted, next_steps(said, asked))]
    assert lines[1:] == [
        "tps effects draft data.csv -o missing.toml --noise 3",
        "tps diagnose data.csv --effects missing.toml --noise 3",
    ]


def test_a_draft_is_written_and_its_commands_run(here, capsys):
    rows, _ = case.make_case(7, layout="paper", hidden="saddle_overhang", size=0.1)
    (here / "a saddle.csv").write_text(exercise.csv_text(rows), encoding="utf-8")
    first = "tps effects draft 'a saddle.csv' -o missing.toml"
    printed = run(first, capsys)
    assert [shlex.split(line)[1] for line in printed] == ["effects", "diagnose", "plan"]
    assert all("missing.toml" in line for line in printed) and "'a saddle.csv'" in printed[1]
    run(printed[0], capsys)
    assert any(line.startswith("tps update") and "--effects missing.toml" in line for line in run(printed[1], capsys))
    assert run(first, capsys, code=2) == []
    assert main(["effects", "draft", "a saddle.csv", "--noise", "20", "-o", "other.toml"]) == 0
    assert "nothing to describe" in capsys.readouterr().out and not (here / "other.toml").exists()
    again = Asked(("data.csv",), effects=("my_effect.py",))
    assert again.new_effect() == "my_effect_2.py"


def test_templates_and_imports(here, capsys):
    done = follow("tps machine new 'my machine.toml'", capsys)
    assert done[1:] == ["tps machine check 'my machine.toml'"]
    (here / "kins.hal").write_text(HAL)
    printed = run("tps machine from-linuxcnc kins.hal --units mm -o 'from hal.toml'", capsys)
    assert printed == ["tps machine check 'from hal.toml'"]
    run(printed[0], capsys, code=2)  # what LinuxCNC does not know is to be filled in first
    done = follow("tps effects new my_screw.py", capsys)
    assert done[1:] == ["tps effects show my_screw --effects my_screw.py"]


@pytest.mark.parametrize(
    ("line", "printed"),
    [
        ("tps pose 0 0 5000 --machine 'my machine.toml'", ["tps machine show 'my machine.toml'"]),
        ("tps pose 0 0 800 --machine 'other one.toml'", ["tps machine list", "tps machine new 'other one.toml'"]),
        ("tps machine check 'other one.toml'", ["tps machine list", "tps machine new 'other one.toml'"]),
        ("tps effects show nothing_like_it --effects own.py", ["tps effects list --effects own.py"]),
        ("tps effects list --effects another.py", ["tps effects new another.py"]),
    ],
)
def test_hints_of_errors_run_too(line, printed, here, capsys):
    run("tps machine new 'my machine.toml'", capsys)
    run("tps effects new own.py", capsys)
    assert run(line, capsys, code=2) == printed
    for one in printed:
        run(one, capsys)


def test_an_update_never_proposes_the_name_of_its_own_input():
    machine, seen = "machine.toml", set()
    for _ in range(4):
        seen.add(machine)
        machine = Asked(("a.csv",), machine).updated_machine
        assert machine not in seen
    assert Asked(("a.csv",)).updated_machine == "nist-updated.toml"
    assert Asked(("a.csv",), "here/m.toml").updated_machine == "here/m-updated.toml"


def test_options_that_were_left_alone_are_left_out_and_the_rest_is_quoted():
    assert Asked(("a b.csv", "c.csv")).command("plan") == "tps plan 'a b.csv' c.csv"
    full = Asked(("a.csv",), "m.toml", ("x.py", "y z.py"), stated=("--noise", "2,1.5", "--strut-spread", "2"))
    assert full.command("update", "--auto") == (
        "tps update a.csv --machine m.toml --auto --effects x.py --effects 'y z.py' --noise 2,1.5 --strut-spread 2"
    )
    assert parted(hint("try it", command_line("map", "--z", 3))) == ("try it:", "tps map --z 3")
    assert parted("no command here") == ("no command here", "")


def test_the_recorded_command_is_the_one_that_was_run(here, capsys):
    import json

    assert main(["plan", "--machine", "nist", "--n", "12", "--no-plots", "--out", "my plan"]) == 0
    capsys.readouterr()
    found = json.loads((here / "my plan/plan.json").read_text())
    assert found["command"] == "tps plan --n 12"  # what is the default goes without saying


def test_no_message_holds_a_command_with_a_gap_to_fill():
    """Outside help and docstrings a command is made by `hints`: a literal one cannot know the user's files."""
    gap = re.compile(rf"tps (?:{NAMES})\b[^.`;]*\b(?:DATA|FILE|DIR|EFFECT|PROGRAM|NAME)\b")
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text("utf-8")
        if "tps " not in text:
            continue
        tree = ast.parse(text)
        aside = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node, clean=False):
                aside.add(id(node.body[0].value))
            if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") in ("EPILOG", "EXAMPLES"):
                aside.add(id(node.value))
            if isinstance(node, ast.keyword) and node.arg == "expected":  # of a command line itself: its usage
                aside.add(id(node.value))
        found += [
            f"{path.name}:{node.lineno}: {node.value}"
            for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in aside
            if "tps " in node.value and gap.search(node.value)
        ]
    assert found == []
