"""Where an effect is written: its file, and the lines of what it declares or fails at."""

from __future__ import annotations

import ast
import inspect
import sys
from pathlib import Path

from toolpath_stiff.stiffness.contract import Effect


def is_foreign(effect: Effect) -> bool:
    """Whether the effect comes from a user's file or another package."""
    return not type(effect).__module__.startswith("toolpath_stiff.stiffness.effects.")


def file_of(effect: Effect) -> str:
    """The file that defines it, as short as it can be written from here."""
    module = sys.modules.get(type(effect).__module__)
    file = Path(effect.file or getattr(module, "__file__", None) or type(effect).__module__)
    return str(file.relative_to(Path.cwd()) if file.is_relative_to(Path.cwd()) else file)


def line_in(error: BaseException, file: str) -> int | None:
    """The innermost line of `file` on the way to `error`."""
    trace, line = error.__traceback__, None
    while trace is not None:
        if Path(trace.tb_frame.f_code.co_filename).resolve() == Path(file).resolve():
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


def line_of_hook(effect: Effect, hook: str) -> int | None:
    """Line on which the hook is defined, if the effect's own file defines it."""
    code = getattr(inspect.unwrap(getattr(type(effect), hook)), "__code__", None)
    here = code is not None and Path(code.co_filename).resolve() == Path(file_of(effect)).resolve()
    return code.co_firstlineno if here and code is not None else None


def line_of(kind: type, attribute: str, index: int | None = None) -> int | None:
    """Line of a class, of what it assigns or defines, or of an element of that; None without a source."""
    try:
        tree = ast.parse(Path(inspect.getsourcefile(kind) or "").read_text("utf-8"))
    except (TypeError, OSError, ValueError, SyntaxError):  # built in, or its file or module is gone
        return None
    classes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef) and node.name == kind.__name__]
    return _line_within(classes[0], attribute, index) if classes else None


def _line_within(node: ast.ClassDef, attribute: str, index: int | None) -> int:
    for part in node.body:
        targets = getattr(part, "targets", None) or [getattr(part, "target", None)]
        names = [getattr(part, "name", None), *(getattr(target, "id", None) for target in targets)]
        if attribute in names:
            value = getattr(part, "value", None)
            if index is not None and isinstance(value, ast.Tuple | ast.List) and index < len(value.elts):
                return value.elts[index].lineno
            return part.lineno
    return node.lineno
