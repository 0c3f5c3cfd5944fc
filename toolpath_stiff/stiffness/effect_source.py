"""Source of an effect: its file, and the lines of its declarations and failures."""

import inspect
import re
import sys
from pathlib import Path

from toolpath_stiff.stiffness.contract import Effect


def is_foreign(effect: Effect) -> bool:
    """True if the effect comes from a user's file or another package."""
    packaged = tuple(f"toolpath_stiff.stiffness.{name}" for name in ("effects.", "element_effects.", "as_built"))
    return not type(effect).__module__.startswith(packaged)


def file_of(effect: Effect) -> str:
    """File that defines the effect, in the shortest form relative to here."""
    module = sys.modules.get(type(effect).__module__)
    file = Path(effect.file or getattr(module, "__file__", None) or type(effect).__module__)
    return str(file.relative_to(Path.cwd()) if file.is_relative_to(Path.cwd()) else file)


def line_in(error: BaseException, file: str) -> int | None:
    """Innermost line of `file` in the traceback of `error`."""
    trace, line = error.__traceback__, None
    while trace is not None:
        if Path(trace.tb_frame.f_code.co_filename).resolve() == Path(file).resolve():
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


def line_of(kind: type, name: str = "") -> int | None:
    """Line on which a class assigns or defines a name, otherwise that of the class; None without a source."""
    try:
        lines, first = inspect.getsourcelines(kind)
    except (TypeError, OSError):  # built in, or its file is missing
        return None
    defined = re.compile(rf"\s+(def )?{re.escape(name)}\s*[=:(]")
    return next((first + i for i, line in enumerate(lines) if name and defined.match(line)), first)
