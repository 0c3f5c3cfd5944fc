"""The file of a case: the steps that were done, what they make of the case's state, read and written."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toolpath_stiff.case.files import ENTRY
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.writer import toml_text
from toolpath_stiff.toml_reader import TomlReader, is_number, shortened

CASE_FILE = "case.toml"


FORMAT = 1


HEADING = "# A case of toolpath_stiff: the steps in their order; `done` of them hold, the others were undone.\n"


TABLES = {"tools": "tool table", "offsets": "work offsets", "controller": "controller file"}  # a program is read with


READING = ("dialect", *TABLES, "block_delete", "feed_mm_per_min")  # of `Program.read`; not what runs another program


@dataclass(frozen=True)
class Step:
    """Something that was done.

    Attributes
    ----------
    kind, text
        One word for programs, one line for people.
    command, python
        The command line, run in the case's folder, and the Python line that do the same; "" where there is none.
    change
        Attribute of `CaseState` -> its new value.
    files
        File of the case that this step wrote -> its SHA-256.
    result
        Folder with what was found, "" without one.
    """

    kind: str
    text: str
    command: str = ""
    python: str = ""
    change: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    result: str = ""


@dataclass(frozen=True)
class CaseState:
    """What holds after some steps; files are named within the case's folder.

    Attributes
    ----------
    machine, effects, data, program, exercise
        Files: of the machine, of effects of one's own, of measurements, of the program; folder of a blind exercise.
    aside
        Readings that were set aside, "file:line" each.
    on
        Effects that are switched on: name -> the keys of its entry in a machine file.
    reading
        How programs are read, as arguments of `Program.read`; switches of block delete as "2,3".
    origin
        Where program zero sits, mm and degrees; empty: where the program or the machine has it.
    require
        Stiffness that every cut should have, N/mm; 0: none is asked for.
    """

    machine: str = MACHINE
    effects: tuple[str, ...] = ()
    data: tuple[str, ...] = ()
    aside: tuple[str, ...] = ()
    on: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    program: str = ""
    reading: Mapping[str, Any] = field(default_factory=dict)
    origin: tuple[float, ...] = ()
    require: float = 0.0
    exercise: str = ""

    @property
    def lines_aside(self) -> dict[str, list[int]]:
        """File -> lines of its readings that were set aside."""
        lines: dict[str, list[int]] = {}
        for entry in self.aside:
            file, _, line = entry.rpartition(":")
            lines.setdefault(file, []).append(int(line))
        return lines


def case_text(steps: Sequence[Step], done: int) -> str:
    """The content of case.toml."""
    lines = [HEADING, f"format = {FORMAT}", f"done = {done}"]
    for step in steps:
        lines += ["", "[[step]]", *(f"{name} = {_toml(value)}" for name, value in vars(step).items() if value)]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return toml_text(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{toml_text(str(key))} = {_toml(part)}" for key, part in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def read_case(file: Path) -> tuple[list[Step], int, str]:
    """Steps, how many hold, the text. Raises `InputError`."""
    reader = TomlReader.read(file, "the case")
    content = reader.data
    if content.get("format") != FORMAT:
        raise InputError(f"format {content.get('format')}", expected=f"format = {FORMAT}", file=str(file))
    entries = content.get("step", [])
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise reader.error("step is no table", expected="the steps, each under [[step]]", where="step")
    steps = []
    for number, entry in enumerate(entries, 1):
        _check_step(reader, number, entry)
        change = {k: tuple(value) if isinstance(value, list) else value for k, value in entry.get("change", {}).items()}
        _check_names(change, entry, str(file), number)
        steps.append(Step(**{**entry, "change": change}))
    done = content.get("done")
    if not isinstance(done, int) or not 1 <= done <= len(steps):
        raise InputError(f"done = {done}", expected=f"1 to {len(steps)}, the steps that hold", file=str(file))
    return steps, done, file.read_text("utf-8")


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_texts(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_text, value))


def _is_number(value: Any) -> bool:
    return is_number(value) and math.isfinite(value)


def _is_scalars(value: Any) -> bool:
    return isinstance(value, dict) and all(
        _is_text(part) or isinstance(part, bool) or _is_number(part) for part in value.values()
    )


STEP: dict[str, Callable[[Any], bool]] = {
    **dict.fromkeys(("kind", "text", "command", "python", "result"), _is_text),
    "change": lambda value: isinstance(value, dict),
    "files": lambda value: isinstance(value, dict) and all(map(_is_text, value.values())),
}


STATE: dict[str, Callable[[Any], bool]] = {
    **dict.fromkeys(("machine", "program", "exercise"), _is_text),
    **dict.fromkeys(("effects", "data"), _is_texts),
    "aside": lambda value: _is_texts(value) and all(ENTRY.fullmatch(entry) for entry in value),
    "on": lambda value: isinstance(value, dict) and all(map(_is_scalars, value.values())),
    "reading": lambda value: _is_scalars(value) and set(value) <= set(READING),
    "origin": lambda value: isinstance(value, list) and len(value) in (0, 3, 6) and all(map(_is_number, value)),
    "require": lambda value: _is_number(value) and value >= 0,
}


def _check_step(reader: TomlReader, number: int, entry: Mapping[str, Any]) -> None:
    """Refuse a step that is none, or that says what no step has written."""
    wrong = "" if {"kind", "text"} <= set(entry) else "it has no kind or no text"
    for shapes, table in ((STEP, entry), (STATE, entry.get("change", {}))):
        for key, value in table.items() if not wrong else ():
            if key not in shapes or not shapes[key](value):
                wrong = f"{key} = {shortened(value)}"
    if wrong:
        lines = (reader.line_of("step", key, number - 1) for key in (wrong.partition(" = ")[0], "change", ""))
        line = next(filter(None, lines), None)
        raise InputError(f"step {number} is no step of a case: {wrong}", file=reader.file, line=line)


def _check_names(change: Mapping[str, Any], entry: Mapping[str, Any], file: str, number: int) -> None:
    """No file of a case lies outside its folder."""
    names = [change.get("machine"), change.get("program"), change.get("exercise"), entry.get("result")]
    names += [*change.get("data", ()), *change.get("effects", ()), *entry.get("files", {})]
    names += [reading.rpartition(":")[0] for reading in change.get("aside", ())]
    names += [value for name, value in change.get("reading", {}).items() if name in TABLES]
    for name in filter(None, names):
        if not isinstance(name, str) or Path(name).is_absolute() or ".." in Path(name).parts or "\\" in name:
            raise InputError(f"step {number} names {name!r}", expected="a file within the case's folder", file=file)
