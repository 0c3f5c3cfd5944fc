"""The house in figures that folding cannot please: `house.py ROOT [--runs] [--places]`; 1 where one is too high.

Counted by syntax tree and tokens: no line is longer, shorter or hidden for it.
"""

from __future__ import annotations

import ast
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import tokenize
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

PACKAGE = "toolpath_stiff"
VAGUE = {"found", "one", "at", "own", "said", "asked", "told"}
LONG_TABLE = 60  # lines of one assignment: data, not code
GROUP = 3  # definitions
MANY_ARGUMENTS = 8
LONG_FUNCTION = 60
NOT_CODE = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
RUNS = {
    "analyze": ["analyze", "programs/pocket.nc", "--out", "{out}"],
    "diagnose": ["diagnose", "nist-table1", "--out", "{out}"],
    "place": ["place", "programs/pocket.nc", "--x", "-300:300", "--y", "-300:300", "--z", "400:1250", "--out", "{out}"],
}


@dataclass
class Module:
    """A module of the package: its text, and what is counted of it."""

    path: Path  # below the package
    text: str = field(repr=False)

    @cached_property
    def tree(self) -> ast.Module:
        """Syntax tree."""
        return ast.parse(self.text)

    @property
    def room(self) -> str:
        """First folder, or the ground."""
        return self.path.parts[0] if len(self.path.parts) > 1 else "ground"

    @cached_property
    def nodes(self) -> list[ast.AST]:
        """Every node of the tree."""
        return list(ast.walk(self.tree))

    @cached_property
    def functions(self) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
        """Functions and methods, inner ones too."""
        return [node for node in self.nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]

    @cached_property
    def classes(self) -> list[ast.ClassDef]:
        """Classes."""
        return [node for node in self.nodes if isinstance(node, ast.ClassDef)]

    @cached_property
    def lines(self) -> int:
        """Lines that hold a token, docstrings left out."""
        held: set[int] = set()
        for token in tokenize.generate_tokens(io.StringIO(self.text).readline):
            if token.type not in NOT_CODE:
                held.update(range(token.start[0], token.end[0] + 1))
        for node in [self.tree, *self.functions, *self.classes]:
            if ast.get_docstring(node, clean=False) is not None:
                held.difference_update(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
        return len(held)

    @property
    def statements(self) -> int:
        """Statements, docstrings left out."""
        return sum(isinstance(node, ast.stmt) and not _is_text(node) for node in self.nodes)

    @property
    def longest_table(self) -> int:
        """Lines of the longest assignment at top level, where it is long enough to be a table of data."""
        spans = [
            (node.end_lineno or 0) - node.lineno
            for node in self.tree.body
            if isinstance(node, ast.Assign | ast.AnnAssign)
        ]
        return max((span for span in spans if span > LONG_TABLE), default=0)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def modules_of(root: Path) -> list[Module]:
    """Modules of the package below `root`."""
    package = root / PACKAGE
    return [Module(path.relative_to(package), path.read_text("utf-8")) for path in sorted(package.rglob("*.py"))]


# A rule yields a place for each time that it is broken.


def modules_too_long(module: Module, most: int = 300) -> Iterator[str]:
    """Modules of more lines than a subject takes; one table of data apart."""
    if module.lines - module.longest_table > most:
        yield f"{module.path}: {module.lines} lines"


def init_that_defines(module: Module, most: int = 40) -> Iterator[str]:
    """Room doors (`__init__.py`) that define something, or are long; the package's own holds the public names."""
    if module.path.name == "__init__.py":
        names = [node.name for node in module.tree.body if isinstance(node, Definition)]
        defined = [name for name in names if name not in ("__getattr__", "__dir__")]
        if defined or (len(module.path.parts) > 1 and module.lines > most):
            yield f"{module.path}: {', '.join(defined) or f'{module.lines} lines'}"


def banners(module: Module) -> Iterator[str]:
    """Comments that part a module, `# -- subject`."""
    for token in tokenize.generate_tokens(io.StringIO(module.text).readline):
        if token.type == tokenize.COMMENT and re.match(r"#\s*(--|==|\*\*|~~|##)", token.string):
            yield f"{module.path}:{token.start[0]}"


def modules_of_two_subjects(module: Module) -> Iterator[str]:
    """Modules with two groups of three or more definitions that never name each other."""
    names = {node.name: node for node in module.tree.body if isinstance(node, Definition)}
    group = {name: name for name in names}

    def head(name: str) -> str:
        while group[name] != name:
            name = group[name]
        return name

    for name, node in names.items():
        for inner in ast.walk(node):
            if isinstance(inner, ast.Name) and inner.id in names:
                group[head(name)] = head(inner.id)
    groups = Counter(map(head, names))
    if sum(size >= GROUP for size in groups.values()) >= 2:
        yield f"{module.path}: {', '.join(name for name, size in groups.items() if size >= GROUP)}"


def forwarding_functions(module: Module) -> Iterator[str]:
    """Functions that only hand names and constants on to another."""
    for function in module.functions:
        body = [n for n in function.body if not _is_text(n) and not isinstance(n, ast.Import | ast.ImportFrom)]
        if len(body) != 1 or not isinstance(body[0], ast.Return | ast.Expr) or not isinstance(body[0].value, ast.Call):
            continue
        call = body[0].value
        handed = [*call.args, *(word.value for word in call.keywords)]
        if all(isinstance(value, ast.Name | ast.Attribute | ast.Constant | ast.Starred) for value in handed):
            yield f"{module.path}:{function.lineno}: {function.name}"


def untyped_documents(module: Module) -> Iterator[str]:
    """`dict[str, Any]`, of any mapping."""
    for node in module.nodes:
        if isinstance(node, ast.Subscript) and ast.unparse(node) in ("dict[str, Any]", "Mapping[str, Any]"):
            yield f"{module.path}:{node.lineno}"


def late_imports(module: Module) -> Iterator[str]:
    """Imports within functions."""
    for function in module.functions:
        for node in ast.walk(function):
            if isinstance(node, ast.Import | ast.ImportFrom):
                yield f"{module.path}:{node.lineno}"


def long_parameter_lists(module: Module) -> Iterator[str]:
    """Functions of eight arguments or more, `self` and public functions of the api apart."""
    for function in module.functions:
        given = function.args
        names = [argument.arg for argument in [*given.posonlyargs, *given.args, *given.kwonlyargs]]
        count = len(names) - (names[:1] in (["self"], ["cls"]))
        public = "api" in module.path.parts and not function.name.startswith("_")
        if count >= MANY_ARGUMENTS and not public:
            yield f"{module.path}:{function.lineno}: {function.name} ({count})"


def vague_names(module: Module) -> Iterator[str]:
    """Variables, arguments and attributes whose names say nothing."""
    for node in module.nodes:
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            name = node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            name = node.attr
        elif isinstance(node, ast.arg):
            name = node.arg
        else:
            continue
        if name in VAGUE:
            yield f"{module.path}:{node.lineno}: {name}"


def functions_of_60_lines(module: Module) -> Iterator[str]:
    """Functions of 60 lines or more, docstring apart."""
    for function in module.functions:
        first = function.body[0]
        text = (first.end_lineno or 0) - first.lineno + 1 if ast.get_docstring(function) else 0
        if (function.end_lineno or 0) - function.lineno - text >= LONG_FUNCTION:
            yield f"{module.path}:{function.lineno}: {function.name}"


RULES = (
    modules_too_long, init_that_defines, banners, modules_of_two_subjects, forwarding_functions, untyped_documents,
    late_imports, long_parameter_lists, vague_names, functions_of_60_lines,
)  # fmt: skip


def class_names_twice(modules: list[Module]) -> list[str]:
    """Public class names that stand in several places."""
    names = Counter(node.name for module in modules for node in module.classes if not node.name.startswith("_"))
    return sorted(name for name, count in names.items() if count > 1)


def public_names(root: Path) -> int:
    """Names that the package gives: the imports of its list of them."""
    listed = root / PACKAGE / "__init__.pyi"
    tree = ast.parse(listed.read_text("utf-8") if listed.is_file() else "")
    return sum(len(node.names) for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom))


def figures_of(modules: list[Module]) -> dict[str, dict[str, float]]:
    """Section of the budget file -> figure -> count."""
    rooms = Counter[str]()
    for module in modules:
        rooms[module.room] += module.lines
    limits: dict[str, float] = {rule.__name__: sum(1 for m in modules for _ in rule(m)) for rule in RULES}
    limits["class_names_twice"] = len(class_names_twice(modules))
    whole = {
        "lines": sum(rooms.values()),
        "statements": sum(module.statements for module in modules),
        "classes": sum(len(module.classes) for module in modules),
    }
    return {"rooms": dict(rooms), "whole": whole, "limits": limits}


def beside(root: Path, modules: list[Module]) -> dict[str, float]:
    """Lines beside the package: scripts and styles of its pages, benchmarks, tests."""
    pages = [p.read_text("utf-8").splitlines() for s in ("js", "css") for p in (root / PACKAGE).rglob(f"*.{s}")]
    tests = sum(path.read_text("utf-8").count("\n") for path in (root / "tests").rglob("*.py"))
    return {
        "page_lines": sum(map(len, pages)),
        "page_line_letters": max((len(line) for lines in pages for line in lines), default=0),
        "benchmark_lines": sum(p.read_text("utf-8").count("\n") for p in (root / "benchmarks").rglob("*.py")),
        "test_lines_per_line": round(tests / max(1, sum(m.text.count("\n") for m in modules)), 3),
    }


COUNTER = """
import json, os, sys
functions, types = set(), set()
def note(frame, event, argument):
    if event == "call" and frame.f_globals.get("__name__", "").startswith("{package}."):
        code = frame.f_code
        if code.co_flags & 1 and not code.co_name.startswith("<"):  # not a class body
            functions.add((code.co_filename, code.co_firstlineno, code.co_name))
        for name in code.co_varnames[:code.co_argcount + code.co_kwonlyargcount]:
            kind = type(frame.f_locals.get(name))
            if kind.__module__.startswith("{package}."):
                types.add(kind.__qualname__)
sys.setprofile(note)
from {package}.cli.main import main
try:
    sys.stdout = open(os.devnull, "w")
    main(sys.argv[1:])
finally:
    sys.setprofile(None)
    print(json.dumps([len(functions), len(types)]), file=sys.stderr)
"""


def runs(root: Path) -> dict[str, float]:
    """Functions and types of the package that the commands of `RUNS` pass, in one process each."""
    figures: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, command in RUNS.items():
            words = [word.format(out=f"{folder}/{name}") for word in command]
            ended = subprocess.run(
                [sys.executable, "-c", COUNTER.replace("{package}", PACKAGE), *words],
                cwd=root,
                env={**os.environ, "PYTHONPATH": str(root)},
                capture_output=True,
                text=True,
                check=True,
            )
            figures[f"{name}_functions"], figures[f"{name}_types"] = json.loads(ended.stderr.splitlines()[-1])
    return figures


def judge(budget: dict[str, dict[str, float]], figures: dict[str, dict[str, float]]) -> list[tuple[str, float, float]]:
    """(figure, count, budget) of each figure that the budget names, or that should be in it."""
    rows = []
    for section, counts in figures.items():
        rows += [
            (f"{section}.{name}", counts.get(name, 0), most) for name, most in budget[section].items() if name in counts
        ]
        rows += [(f"{section}.{name}", count, 0) for name, count in counts.items() if name not in budget[section]]
    return rows


def main() -> int:
    """Print figures beside budgets; 1 where one is above, with the places of broken rules."""
    root = Path(sys.argv[1]).resolve()
    budget = tomllib.loads((root / ".ci" / "house.toml").read_text("utf-8"))
    modules = modules_of(root)
    figures = {**figures_of(modules), "beside": beside(root, modules)}
    figures["whole"]["public_names"] = public_names(root)
    if "--runs" in sys.argv:
        figures["runs"] = runs(root)
    rows = judge(budget, figures)
    for name, count, most in rows:
        print(f"{name:<36}{count:>10,}{most:>10,}{'   above' if count > most else ''}")
    if "--places" in sys.argv:
        for rule in RULES:
            for place in [place for module in modules for place in rule(module)]:
                print(f"{rule.__name__}: {place}")
    above = [name for name, count, most in rows if count > most]
    print(f"falls short: {', '.join(above)}" if above else "the house holds")
    return bool(above)


if __name__ == "__main__":
    sys.exit(main())
