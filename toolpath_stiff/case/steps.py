"""The file of a case: the steps that were done, what they make of the case's state, read and written."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar, cast

from toolpath_stiff.api.effects import effects
from toolpath_stiff.api.trust import is_agreed
from toolpath_stiff.case.files import (
    ENTRY,
    EXERCISE,
    JOURNAL,
    ROOMS,
    free_name,
    room_of,
    sha256,
    used_name,
    without_lines,
    write_files,
)
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import is_file, read_text, write_atomically
from toolpath_stiff.locks import beside, forget, is_left, remove_parts
from toolpath_stiff.machine.writer import toml_text
from toolpath_stiff.results_folder import clear_up
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
        return "{" + ", ".join(f"{toml_text(str(key))} = {_toml(one)}" for key, one in value.items()) + "}"
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
        _is_text(one) or isinstance(one, bool) or _is_number(one) for one in value.values()
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
    names += [one.rpartition(":")[0] for one in change.get("aside", ())]
    names += [value for name, value in change.get("reading", {}).items() if name in TABLES]
    for name in filter(None, names):
        if not isinstance(name, str) or Path(name).is_absolute() or ".." in Path(name).parts or "\\" in name:
            raise InputError(f"step {number} names {name!r}", expected="a file within the case's folder", file=file)


Method = TypeVar("Method", bound=Callable[..., Any])


def python_line(name: str, positional: Sequence[Any], named: Mapping[str, Any]) -> str:
    """A call of a method of the case; without what only watches it."""
    shown = [_python(value) for value in positional if not callable(value)]
    shown += [f"{key}={_python(value)}" for key, value in named.items() if not callable(value) and key != "progress"]
    return f"case.{name}({', '.join(shown)})"


def _python(value: Any) -> str:
    return repr(str(value) if isinstance(value, Path) else value)


def recorded(method: Method) -> Method:
    """The method; the step that it records has its call as the Python line."""

    @wraps(method)
    def call(self: History, *args: Any, **named: Any) -> Any:
        outer, self._call = self._call, python_line(method.__name__, args, named)
        try:
            return method(self, *args, **named)
        finally:
            self._call = outer

    return cast("Method", call)


class History:
    """The steps of a case and the files that they wrote.

    Attributes
    ----------
    folder
        Where the case is.
    sent_to
        A folder that the Python lines leave out, with its last "/": where files lie that a page has sent.
    """

    sent_to = ""
    _call = ""  # the method that is at work, as a Python line

    def __init__(self, folder: Path, steps: Sequence[Step], done: int, text: str) -> None:
        self.folder, self._steps, self._done, self._written = folder, list(steps), done, text
        self._clear_up()

    def _clear_up(self) -> None:
        """Take away what a killed step brought, and no step names."""
        journal = self.folder / JOURNAL
        if not is_left(journal):
            return
        remove_parts(beside(self.folder / CASE_FILE, "part-"))
        known = {name for step in self._steps for name in (*step.files, step.change.get("exercise"))}
        here = self.folder.resolve()
        for name in read_text(journal, "journal").splitlines():
            file = self.folder / name
            # A case may come from somebody else: nothing outside its rooms is touched.
            inside = file.parent.is_dir() and file.parent.resolve().is_relative_to(here) and ".." not in file.parts
            if not inside or room_of(name) not in ROOMS:
                continue
            remove_parts(beside(file, "part-"))
            if name not in known and file.is_file():
                file.unlink()
            elif name not in known and room_of(name) == EXERCISE and file.parent == self.folder:
                clear_up([file])
                shutil.rmtree(file, ignore_errors=True)
        forget(journal)

    @property
    def history(self) -> list[Step]:
        """The steps that hold."""
        return self._steps[: self._done]

    @property
    def undone(self) -> list[Step]:
        """The steps that redo would bring back, the next one first."""
        return self._steps[self._done :]

    @property
    def recorded(self) -> CaseState:
        """What holds now as the steps say it."""
        state = CaseState()
        for step in self.history:
            state = replace(state, **step.change)
        return state

    @property
    def state(self) -> CaseState:
        """What holds now: without the files of own effects that this user has not agreed to run, and their effects."""
        state, off = self.recorded, self.not_agreed
        if not off:
            return state
        kept = tuple(name for name in state.effects if name not in off)
        return replace(state, effects=kept, on=self._known(state.on, kept))

    def _known(self, on: Mapping[str, Mapping[str, Any]], files: Iterable[str]) -> dict[str, Mapping[str, Any]]:
        """Those of the effects that are known with these files of own ones."""
        known = {effect.name for effect in effects([self.path(name) for name in files]).effects}
        return {name: keys for name, keys in on.items() if name in known}

    @property
    def not_agreed(self) -> tuple[str, ...]:
        """The files of own effects whose code is not run: this user has not agreed to what they hold; see `trust`."""
        files = {name: self.folder / name for name in self.recorded.effects}
        return tuple(name for name, file in files.items() if not is_file(file) or not is_agreed(file.read_bytes()))

    def path(self, name: str) -> str:
        """A file of the case, as functions and commands take it."""
        return str(self.folder / name)

    def undo(self) -> Step | None:
        """Take back the last step that changed something, and what was found since; None where there is none."""
        last = next((n for n in range(self._done - 1, 0, -1) if self._steps[n].change), None)
        if last is None:
            return None
        self._done = last
        self._save()
        return self._steps[last]

    def redo(self) -> Step | None:
        """Do again the next step that was undone, and what was found after it; None where nothing was."""
        changes = [n for n in range(self._done, len(self._steps)) if self._steps[n].change]
        if not changes:
            return None
        self._done = changes[1] if changes[1:] else len(self._steps)
        self._save()
        return self._steps[changes[0]]

    def record(
        self,
        kind: str,
        text: str,
        *,
        change: Mapping[str, Any] | None = None,
        files: Sequence[str] = (),
        command: str = "",
        python: str = "",
        result: str = "",
    ) -> None:
        """Add a step and write the case. `files`: those that the step wrote; `python`: unless given, the call at work.

        A step that changes something forgets what was undone; one that only finds something out does not.
        """
        sums = {name: sha256((self.folder / name).read_bytes()) for name in files}
        python = python or self._call
        python = python.replace(self.sent_to, "") if self.sent_to else python
        step = Step(kind, text, command, python, dict(change or {}), sums, result)
        self._steps = [*self.history, step, *(() if change else self.undone)]
        self._done += 1
        self._rewrite_used()
        self._save()

    def next_result(self, kind: str) -> str:
        """A free folder for a result."""
        return free_name(self.folder, f"results/{len(self.history) + 1:03d}-{kind}")

    def check_files(self) -> None:
        """Raise `InputError` for a file of the case that is gone, or is not what its step wrote."""
        state = self.recorded
        tables = {str(state.reading[name]) for name in TABLES if name in state.reading}
        needed = {state.machine, state.program, *state.effects, *state.data, *tables} - {""}
        for name, known in {n: s for step in self.history for n, s in step.files.items()}.items():
            file = self.folder / name
            if name in needed and (not file.is_file() or sha256(file.read_bytes()) != known):
                what = "is not what was put into the case" if file.is_file() else "is gone"
                raise InputError(f"{name} {what}", hint="bring the file back, or begin another case", file=str(file))

    def _rewrite_used(self, state: CaseState | None = None) -> None:
        """Files in used/ as the state has them: after undo and redo too."""
        for file, lines in (state or self.state).lines_aside.items():
            write_files(self.folder, {used_name(file): without_lines(self.folder / file, lines)})

    def _save(self) -> None:
        file = self.folder / CASE_FILE
        if file.is_file() and file.read_text("utf-8") != self._written:
            raise InputError(
                f"{CASE_FILE} was changed by another program since it was opened", hint="open the case again"
            )
        self._rewrite_used()
        self._written = case_text(self._steps, self._done)
        write_atomically(file, self._written)
        forget(self.folder / JOURNAL)
