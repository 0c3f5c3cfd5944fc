"""The rooms of docs/architecture.md: a lower one never imports a higher one, and the help imports nothing heavy."""

from __future__ import annotations

import ast
import builtins
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import toolpath_stiff
from toolpath_stiff.cli.main import COMMANDS

PACKAGE = Path(toolpath_stiff.__file__).parent
# From the lowest to the highest; rooms of one rank do not import each other. `files` writes what others made.
RANK = {
    "units": 0,
    "errors": 0,
    "arrays": 0,
    "rotations": 1,
    "defaults": 1,
    "toml_reader": 1,
    "hints": 2,
    "files": 2,
    "processes": 2,
    "results_folder": 3,
    "column_files": 2,
    "tables": 3,
    "nc": 3,
    "path": 4,
    "rewriting": 5,
    "machine": 5,
    "stiffness": 6,
    "analysis": 7,
    "placement": 8,
    "updating": 8,
    "report": 9,
    "api": 10,
    "studio": 11,
    "cli": 12,
}
# The same within `updating`, of its modules and rooms.
UPDATING_RANK = {
    "dates": -1,
    "rows": 0,
    "history": 1,
    "measurements": 1,
    "raw_labels": 1,
    "raw_layouts": 2,
    "raw_records": 3,
    "raw": 4,
    "inference": 2,
    "comparison": 3,
    "planning": 3,
    "portrait": 3,
    "diagnosis": 4,
    "correction": 5,
    "drafting": 6,
}
RIG_MAY_IMPORT = {"units", "errors", "arrays", "defaults", "toml_reader", "files", "results_folder", "rig"}
RIG_SHOWN_BY = ("api", "cli")  # a case starts, measures and reveals exercises, as the command does
HEAVY = ("numpy", "scipy", "pandas", "numba", "matplotlib", "pyarrow", "pygcode")


tree = cache(ast.parse)  # each module is parsed once


@cache
def imports(source: str, package: str) -> tuple[str, ...]:
    """Every absolute module name that the source imports, inside functions too; relative ones are resolved."""
    return tuple(_imports(source, package))


def _imports(source: str, package: str) -> Iterator[str]:
    for node in ast.walk(tree(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            # `from toolpath_stiff import machine` imports a room as well.
            yield from (f"{module}.{alias.name}" for alias in node.names)


def room_of(module: str) -> str:
    """First name below the package: `toolpath_stiff.nc.words` -> `nc`."""
    return module.split(".")[1]


def trespasses(source: str, room: str, package: str) -> list[str]:
    """The imports of a module in `room` that its rank forbids."""
    found = []
    for name in imports(source, package):
        if not name.startswith("toolpath_stiff.") or room_of(name) not in {*RANK, "rig"}:
            continue
        other = room_of(name)
        if room == "rig":
            allowed = other in RIG_MAY_IMPORT
        else:
            allowed = (
                other == room
                or (other != "rig" and RANK[other] < RANK[room])
                or (other == "rig" and room in RIG_SHOWN_BY)
            )
        if not allowed:
            found.append(name)
    return found


def modules() -> list[Path]:
    """Modules of the package that stand in a room; `__init__` and `__main__` of the package itself see all rooms."""
    files = sorted(path.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py"))
    return [path for path in files if path.parts[0] not in ("__init__.py", "__main__.py", "data")]


@pytest.mark.parametrize("path", modules(), ids=str)
def test_no_module_imports_a_higher_room(path):
    room = path.parts[0].removesuffix(".py")
    assert room in {*RANK, "rig"}, f"{room} has no place in docs/architecture.md"
    package = ".".join(("toolpath_stiff", *path.parts[:-1]))
    assert trespasses((PACKAGE / path).read_text("utf-8"), room, package) == []


@pytest.mark.parametrize("path", [path for path in modules() if path.parts[0] == "updating"], ids=str)
def test_updating_has_its_own_order(path):
    room = path.parts[1].removesuffix(".py")
    if room == "__init__":
        return
    package = ".".join(("toolpath_stiff", *path.parts[:-1]))
    used = {
        name.split(".")[2] for name in imports((PACKAGE / path).read_text("utf-8"), package) if ".updating." in name
    }
    assert all(other == room or UPDATING_RANK[other] < UPDATING_RANK[room] for other in used), used


@pytest.mark.parametrize(
    ("source", "room"),
    [
        ("from toolpath_stiff.stiffness import exact", "machine"),
        ("def f():\n    from toolpath_stiff.report import page", "analysis"),
        ("from toolpath_stiff import machine", "nc"),
        ("import toolpath_stiff.cli.main", "report"),
        ("from ..stiffness import exact", "machine"),
        ("from toolpath_stiff.machine import load_machine", "rig"),
        ("from toolpath_stiff.updating.inference import fits", "placement"),
    ],
)
def test_the_check_finds_a_trespass(source, room):
    assert trespasses(source, room, f"toolpath_stiff.{room}")


def test_every_room_is_in_the_architecture_page_or_beside_it():
    """The ranks above follow the page's table, top to bottom."""
    page = (PACKAGE.parent / "docs" / "architecture.md").read_text("utf-8")
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    named = [name.strip().strip("`") for row in rows for name in row.split(",")]
    ranks = [RANK[name] for name in named if name != "rig"]
    assert ranks == sorted(ranks)


def test_the_help_imports_nothing_heavy():
    """Of the tool and of every command; in a fresh interpreter, as this one has numpy already.

    Commands import numpy and its like in `run`, so that a slip in an option is answered at once.
    """
    asked = [["--help"], ["--version"], [], *([command.name, "--help"] for command in COMMANDS)]
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


def test_single_poses_load_no_nc_program():
    """`tps pose` needs the machine and its stiffness alone."""
    code = (
        "import sys, io, contextlib\n"
        "from toolpath_stiff.cli.main import main\n"
        "with contextlib.redirect_stdout(io.StringIO()):\n"
        "    assert main(['pose', '0', '0', '800']) == 0\n"
        "rooms = {'.'.join(name.split('.')[:2]) for name in sys.modules if name.startswith('toolpath_stiff.')}\n"
        "print(sorted(rooms & {'toolpath_stiff.nc', 'toolpath_stiff.path', 'toolpath_stiff.placement'}))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


MOST_LINES = 60  # of a function, its docstring apart


def lines_of_functions(source: str) -> Iterator[tuple[str, int]]:
    for node in ast.walk(tree(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0]
            said = first.end_lineno - first.lineno + 1 if ast.get_docstring(node) is not None else 0
            yield node.name, node.end_lineno - node.lineno + 1 - said


def test_no_function_is_long():
    long = [
        f"{path}: {name} has {lines} lines"
        for path in modules()
        for name, lines in lines_of_functions((PACKAGE / path).read_text("utf-8"))
        if lines > MOST_LINES
    ]
    assert long == []


def test_array_types_stand_in_one_place():
    again = [
        str(path)
        for path in modules()
        if path.name != "arrays.py"
        and re.search(r"^(Float|Int|Bool|Text)Array = ", (PACKAGE / path).read_text("utf-8"), re.M)
    ]
    assert again == []


def module_imports() -> dict[str, set[str]]:
    """Module -> the modules of the package that it imports, inside functions too."""
    names = {
        ".".join(("toolpath_stiff", *path.with_suffix("").parts)).removesuffix(".__init__"): path for path in modules()
    }
    found = {}
    for name, path in names.items():
        package = ".".join(("toolpath_stiff", *path.parts[:-1]))
        wanted = set(imports((PACKAGE / path).read_text("utf-8"), package))
        # `from a.b import c` imports a.b.c if that is a module, else a.b.
        found[name] = {t if t in names else t.rsplit(".", 1)[0] for t in wanted} & names.keys() - {name}
    return found


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """The modules that import each other in a ring, each ring once."""
    from graphlib import CycleError, TopologicalSorter

    found, left = [], {name: set(targets) for name, targets in graph.items()}
    while True:
        try:
            TopologicalSorter(left).prepare()
        except CycleError as error:
            ring = error.args[1]
            found.append(ring)
            for name in ring:
                left.pop(name, None)
            left = {name: targets - set(ring) for name, targets in left.items()}
        else:
            return found


# Rings that are left; a ring that goes leaves this list, and none is added.
LEFT = [
    {"toolpath_stiff.api.inputs", "toolpath_stiff.api.machines"},
]


def test_no_import_circle():
    """Of any size, in any room and across rooms, imports within functions counted."""
    graph = module_imports()
    assert len(graph) > 150
    assert [set(ring) for ring in circles(graph) if set(ring) not in LEFT] == []


def test_the_search_for_circles_finds_one():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) != []


def test_no_package_calls_a_builtin_that_a_module_of_its_own_hides():
    # importing `report.map` binds `map` in `report`: from then on the name means the module there
    hidden = []
    for file in PACKAGE.rglob("__init__.py"):
        inside = {path.stem for path in file.parent.iterdir()} & set(dir(builtins))
        names = (node for node in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(node, ast.Name))
        hidden += [f"{file.parent.name}: {node.id}, line {node.lineno}" for node in names if node.id in inside]
    assert not hidden, hidden
