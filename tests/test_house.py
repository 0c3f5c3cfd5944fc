"""The check of the house (.ci/house.py): each rule finds what breaks it, and nothing in what does not."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

import toolpath_stiff as tps

FILE = Path(__file__).parents[1] / ".ci" / "house.py"
SPEC = importlib.util.spec_from_file_location("house", FILE)
house = importlib.util.module_from_spec(SPEC)
sys.modules["house"] = house
SPEC.loader.exec_module(house)

GROUP = "def {0}a(): return {0}b()\ndef {0}b(): return {0}c()\ndef {0}c(): pass\n"
BROKEN = {
    "modules_too_long": ("x = 1\n" * 301, "x = 1\n" * 300 + "# a comment\n" * 50),
    "init_that_defines": ("def f(): pass\n", "from a import f\n"),
    "banners": ("# -- subject ---\nx = 1\n", "# a comment -- with dashes\nx = '# -- no comment'\n"),
    "modules_of_two_subjects": (GROUP.format("x") + GROUP.format("y"), GROUP.format("x") + "def ya(): xa()\n"),
    "forwarding_functions": ("def f(a, b):\n    return g(a, key=b)\n", "def f(a, b):\n    return g(a + b)\n"),
    "untyped_documents": ("x: dict[str, Any] = {}\n", "x: dict[str, int] = {}  # dict[str, Any]\n"),
    "late_imports": ("def f():\n    import re\n", "import re\ndef f(): pass\n"),
    "long_parameter_lists": ("def f(a, b, c, d, *, e, f, g, h): pass\n", "def f(self, a, b, c, d, e, f, g): pass\n"),
    "vague_names": ("found = 1\n", "foundation = found\n"),
    "functions_of_60_lines": ("def f():\n" + "    x = 1\n" * 60, "def f():\n" + "    x = 1\n" * 59),
}


def module(source: str, name: str = "room/__init__.py"):
    return house.Module(Path(name), source)


@pytest.mark.parametrize("rule", house.RULES, ids=lambda rule: rule.__name__)
def test_each_rule_finds_what_breaks_it_and_nothing_else(rule):
    broken, sound = BROKEN[rule.__name__]
    assert len(list(rule(module(broken)))) == 1
    assert list(rule(module(sound))) == []


def test_class_names_are_counted_over_the_package():
    twice = [
        module("class Fit: pass\nclass _Own: pass\n", "a.py"),
        module("class Fit: pass\nclass _Own: pass\n", "b.py"),
    ]
    assert house.class_names_twice(twice) == ["Fit"]


def test_lines_are_those_that_hold_code():
    text = (
        '"""A module.\n\nMore."""\n\n# why\nx = (\n    1,  # one\n)\ndef f():\n    """It."""\n    return """a\nb"""\n'
    )
    assert module(text).lines == 6
    assert module(text).statements == 3  # an assignment, a function, its return


def test_a_figure_above_its_budget_or_in_no_budget_falls_short(tmp_path, monkeypatch, capsys):
    (tmp_path / "toolpath_stiff" / "attic").mkdir(parents=True)
    (tmp_path / "toolpath_stiff" / "attic" / "old.py").write_text("x = 1\ny = 2\n")
    (tmp_path / "tests").mkdir()
    (tmp_path / "benchmarks").mkdir()
    (tmp_path / ".ci").mkdir()
    (tmp_path / ".ci" / "house.toml").write_text((FILE.parent / "house.toml").read_text("utf-8"))
    monkeypatch.setattr("sys.argv", ["house.py", str(tmp_path)])
    assert house.main() == 1
    assert "falls short: rooms.attic" in capsys.readouterr().out


def test_public_names_are_those_of_the_list(tmp_path):
    (tmp_path / "toolpath_stiff").mkdir()
    assert house.public_names(tmp_path) == 0
    (tmp_path / "toolpath_stiff" / "__init__.pyi").write_text("from a import b as b\nfrom a import c as c, d as d\n")
    assert house.public_names(tmp_path) == 3
    assert house.public_names(FILE.parents[1]) == len(set(tps.__all__) - {"__version__"})
