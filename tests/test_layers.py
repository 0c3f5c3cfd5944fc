"""The rooms of docs/architecture.md: a lower one never imports a higher one, and the help imports nothing heavy."""

from __future__ import annotations

import ast
import builtins
import pkgutil
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from importlinter.cli import lint_imports

import toolpath_stiff

PACKAGE = Path(toolpath_stiff.__file__).parent
POCKET = PACKAGE.parent / "programs" / "pocket.nc"
HEAVY = ("numpy", "scipy", "pandas", "numba", "matplotlib", "pyarrow", "pygcode")


def modules() -> list[Path]:
    """Modules of the package that stand in a room; `__init__` and `__main__` of the package itself see all rooms."""
    files = sorted(path.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py"))
    return [path for path in files if path.parts[0] not in ("__init__.py", "__main__.py", "data")]


def test_the_rooms_depend_in_one_direction():
    """The contracts of pyproject.toml: layers, the simulator apart, no circles."""
    assert lint_imports(config_filename=str(PACKAGE.parent / "pyproject.toml"), cache_dir=None) == 0


def test_every_language_of_programs_is_in_its_contract():
    """The folders of `nc`: languages that do not import each other, and what they share."""
    linter = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]
    (layers,) = (rule["layers"] for rule in linter["contracts"] if rule.get("containers") == ["toolpath_stiff.nc"])
    folders = {path.parent.name for path in (PACKAGE / "nc").glob("*/__init__.py")}
    assert {name for layer in layers for name in layer.split(" | ")} == folders
    assert {"heidenhain", "siemens"} <= set(layers[0].split(" | "))


def test_a_trespass_is_found(tmp_path, monkeypatch):
    """The same contracts on a package in which a lower room imports a higher one."""
    package = tmp_path / "rooms"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "machine.py").write_text("def f():\n    from rooms import stiffness\n")
    (package / "stiffness.py").touch()
    (tmp_path / "contracts.ini").write_text(
        "[importlinter]\nroot_package = rooms\n[importlinter:contract:1]\nname = rooms\ntype = layers\n"
        "containers = rooms\nlayers =\n    stiffness\n    machine\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    assert lint_imports(config_filename=str(tmp_path / "contracts.ini"), cache_dir=None) == 1


def test_every_room_is_in_the_architecture_page():
    page = (PACKAGE.parent / "docs" / "architecture.md").read_text("utf-8")
    rooms = {path.parts[0].removesuffix(".py") for path in modules()}
    assert {room for room in rooms if f"`{room}`" not in page} == set()


def walks() -> dict[str, list[str]]:
    """Heading of each walk of the architecture page -> the functions and modules that it names, in order."""
    page = (PACKAGE.parent / "docs" / "architecture.md").read_text("utf-8")
    sections = [section.partition("**") for section in page.partition("\n## ")[0].split("\n**")[1:]]
    return {heading: re.findall(r"`((?:[a-z_]+\.)+\w+(?:\.\w+)?)`", text) for heading, _, text in sections}


def test_the_walks_of_the_architecture_page_name_what_there_is():
    for heading, names in walks().items():
        assert 3 <= len(names) <= 12, heading
        for name in names:
            assert pkgutil.resolve_name(f"toolpath_stiff.{name}")
    assert len(walks()) == 3


@pytest.mark.parametrize(("walk", "words"), [(0, ["analyze", str(POCKET)]), (1, ["diagnose", "nist-table1"])])
def test_a_run_goes_the_walk(tmp_path, walk, words):
    """The functions of a walk are called, one first after the other, in a fresh interpreter."""
    code = (
        "import sys\n"
        "called = {}\n"
        "def note(frame, event, argument):\n"
        "    if event == 'call':\n"
        "        module = frame.f_globals.get('__name__', '').removeprefix('toolpath_stiff.')\n"
        "        called.setdefault(f'{module}.{frame.f_code.co_qualname}', len(called))\n"
        "from toolpath_stiff.cli.main import main\n"
        "sys.setprofile(note)\n"
        f"main({[*words, '--no-plots']!r})\n"
        "sys.setprofile(None)\n"
        "print('called', *called)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    called = {name: number for number, name in enumerate(done.stdout.splitlines()[-1].split())}
    names = [name for name in list(walks().values())[walk] if name != "nc.codes.registry"]
    assert [name for name in names if name not in called] == []
    assert sorted(names, key=lambda name: called[name]) == names


def test_the_help_imports_nothing_heavy():
    """Of the tool, its version, its name alone; in a fresh interpreter, as this one has numpy already."""
    asked: list[list[str]] = [["--help"], ["--version"], []]
    code = (
        "import sys, io, contextlib\n"
        "from toolpath_stiff.cli.main import main\n"
        f"for words in {asked!r}:\n"
        "    with contextlib.redirect_stdout(io.StringIO()):\n"
        "        main(words)\n"
        f"    print(words, [name for name in {HEAVY!r} if name in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [f"{words} []" for words in asked]


def test_array_types_stand_in_one_place():
    again = [
        str(path)
        for path in modules()
        if path.name != "arrays.py"
        and re.search(r"^(Float|Int|Bool|Text)Array = ", (PACKAGE / path).read_text("utf-8"), re.M)
    ]
    assert again == []


def test_no_package_calls_a_builtin_that_a_module_of_its_own_hides():
    # importing `report.map` binds `map` in `report`: from then on the name means the module there
    hidden = []
    for file in PACKAGE.rglob("__init__.py"):
        inside = {path.stem for path in file.parent.iterdir()} & set(dir(builtins))
        names = (node for node in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(node, ast.Name))
        hidden += [f"{file.parent.name}: {node.id}, line {node.lineno}" for node in names if node.id in inside]
    assert not hidden, hidden
