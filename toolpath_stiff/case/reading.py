"""case.toml read again: it may come from anybody, and what no step has written is refused."""

import math
import re
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

from toolpath_stiff.case.steps import FORMAT, READING, TABLES, CaseState, Step
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.toml_reader import TomlReader, is_number, shortened

ENTRY = re.compile(r".+:[0-9]{1,9}")  # a reading that was set aside: file and line


def read_case(file: Path) -> tuple[list[Step], int, str]:
    """Steps, how many hold, the text. Raises `InputError`."""
    reader = TomlReader.read(file, "the case")
    content = reader.data
    if content.get("format") != FORMAT:
        raise InputError(f"format {content.get('format')}", expected=f"format = {FORMAT}", file=str(file))
    entries = content.get("step", [])
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise reader.error("step is no table", expected="the steps, each under [[step]]", where="step")
    steps = [_step(reader, number, entry) for number, entry in enumerate(entries)]
    done = content.get("done")
    if not isinstance(done, int) or not 1 <= done <= len(steps):
        raise InputError(f"done = {done}", expected=f"1 to {len(steps)}, the steps that hold", file=str(file))
    return steps, done, file.read_text("utf-8")


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_file(value: Any) -> bool:
    """A file within the case's folder, or none."""
    return _is_text(value) and not Path(value).is_absolute() and ".." not in Path(value).parts and "\\" not in value


def _is_number(value: Any) -> bool:
    return is_number(value) and math.isfinite(value)


def _all(value: Any, kind: type, holds: Callable[[Any], bool]) -> bool:
    parts: Any = value.values() if isinstance(value, dict) else value
    return isinstance(value, kind) and all(map(holds, parts))


def _is_scalars(value: Any) -> bool:
    return _all(value, dict, lambda part: _is_text(part) or isinstance(part, bool) or _is_number(part))


SHAPES: dict[str, Callable[[Any], bool]] = {
    **dict.fromkeys(("kind", "text", "command", "python"), _is_text),
    **dict.fromkeys(("result", "machine", "program", "exercise"), _is_file),
    **dict.fromkeys(("effects", "data"), lambda value: _all(value, list, _is_file)),
    "files": lambda value: _all(value, dict, _is_text) and all(map(_is_file, value)),
    "aside": lambda value: _all(value, list, lambda entry: _is_file(entry) and bool(ENTRY.fullmatch(entry))),
    "on": lambda value: _all(value, dict, _is_scalars),
    "reading": lambda value: _is_scalars(value) and set(value) <= set(READING) and all(
        _is_file(value[name]) for name in TABLES if name in value),
    "origin": lambda value: _all(value, list, _is_number) and len(value) in (0, 3, 6),
    "require": lambda value: _is_number(value) and value >= 0,
    "change": lambda value: isinstance(value, dict),
}  # fmt: skip


def _step(reader: TomlReader, number: int, entry: Document) -> Step:
    """A step; refused where it says what no step has written."""
    wrong = "" if {"kind", "text"} <= set(entry) else "it has no kind or no text"
    for kind, table in ((Step, entry), (CaseState, entry.get("change", {}))):
        known = {field.name for field in fields(kind)}
        for key, value in table.items() if not wrong else ():
            if key not in known or not SHAPES[key](value):
                wrong = f"{key} = {shortened(value)}"
    if wrong:
        lines = (reader.line_of("step", key, number) for key in (wrong.partition(" = ")[0], "change", ""))
        raise InputError(
            f"step {number + 1} is no step of a case: {wrong}",
            expected="what a step has written, files within the case's folder",
            file=reader.file,
            line=next(filter(None, lines), None),
        )
    change = {key: tuple(part) if isinstance(part, list) else part for key, part in entry.get("change", {}).items()}
    return Step(**{**entry, "change": change})
