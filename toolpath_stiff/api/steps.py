"""The files of a case: the steps that were done and what they make of its state; copies of what came in."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from toolpath_stiff.api.diagnosis import Measurements
from toolpath_stiff.api.machines import Machine
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.errors import InputError

CASE_FILE = "case.toml"
FORMAT = 1
HEADING = "# A case of toolpath_stiff: the steps in their order; `done` of them hold, the others were undone.\n"
UNSAFE = re.compile(r"[^\w.+-]+", re.ASCII)
LONGEST_NAME = 80


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
    origin: tuple[float, ...] = ()
    require: float = 0.0
    exercise: str = ""


def case_text(steps: Sequence[Step], done: int) -> str:
    """The content of case.toml."""
    lines = [HEADING, f"format = {FORMAT}", f"done = {done}"]
    for step in steps:
        lines += ["", "[[step]]", *(f"{name} = {_toml(value)}" for name, value in vars(step).items() if value)]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    from toolpath_stiff.machine.writer import toml_text

    if isinstance(value, str):
        return toml_text(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{toml_text(str(key))} = {_toml(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def read_case(file: Path) -> tuple[list[Step], int, str]:
    """Steps, how many hold, the text. Raises `InputError`."""
    from toolpath_stiff.toml_reader import TomlReader

    reader = TomlReader.read(file, "the case")
    found = reader.data
    if found.get("format") != FORMAT:
        raise InputError(f"format {found.get('format')}", expected=f"format = {FORMAT}", file=str(file))
    known, states = ({one.name for one in fields(kind)} for kind in (Step, CaseState))
    steps = []
    for number, entry in enumerate(found.get("step", []), 1):
        change: dict[str, Any] = entry.get("change", {})
        if not {"kind", "text"} <= set(entry) <= known or not set(change) <= states:
            raise InputError(
                f"step {number} is no step of a case", file=str(file), line=reader.line_of("step", nth=number - 1)
            )
        fixed = {name: tuple(value) if isinstance(value, list) else value for name, value in change.items()}
        _check_names(fixed, entry, str(file), number)
        steps.append(Step(**{**entry, "change": fixed}))
    done = found.get("done")
    if not isinstance(done, int) or not 1 <= done <= len(steps):
        raise InputError(f"done = {done}", expected=f"1 to {len(steps)}, the steps that hold", file=str(file))
    return steps, done, file.read_text("utf-8")


def _check_names(change: Mapping[str, Any], entry: Mapping[str, Any], file: str, number: int) -> None:
    """No file of a case lies outside its folder."""
    names = [change.get("machine"), change.get("program"), change.get("exercise"), entry.get("result")]
    names += [*change.get("data", ()), *change.get("effects", ()), *entry.get("files", {})]
    names += [str(one).rpartition(":")[0] for one in change.get("aside", ())]
    for name in filter(None, names):
        if not isinstance(name, str) or Path(name).is_absolute() or ".." in Path(name).parts or "\\" in name:
            raise InputError(f"step {number} names {name!r}", expected="a file within the case's folder", file=file)


class History:
    """The steps of a case and the files that they wrote.

    Attributes
    ----------
    folder
        Where the case is.
    sent_to
        A folder that the Python lines leave out, with its last "/": where files lie that a page has sent.
    """

    def __init__(self, folder: Path, steps: Sequence[Step], done: int, text: str) -> None:
        self.folder, self._steps, self._done, self._written = folder, list(steps), done, text
        self.sent_to = ""

    @property
    def history(self) -> list[Step]:
        """The steps that hold."""
        return self._steps[: self._done]

    @property
    def undone(self) -> list[Step]:
        """The steps that redo would bring back, the next one first."""
        return self._steps[self._done :]

    @property
    def state(self) -> CaseState:
        """What holds now."""
        found = CaseState()
        for step in self.history:
            found = replace(found, **step.change)
        return found

    def path(self, name: str) -> str:
        """A file of the case, as functions and commands take it."""
        return str(self.folder / name)

    def undo(self) -> Step | None:
        """Take back the last step that changed something, and what was found since; None where there is none."""
        at = next((n for n in range(self._done - 1, 0, -1) if self._steps[n].change), None)
        if at is None:
            return None
        self._done = at
        self._save()
        return self._steps[at]

    def redo(self) -> Step | None:
        """Do again the next step that was undone, and what was found after it; None where nothing was."""
        found = next((step for step in self.undone if step.change), None)
        if found is None:
            return None
        first = self._steps.index(found, self._done)
        later = (n for n in range(first + 1, len(self._steps)) if self._steps[n].change)
        self._done = next(later, len(self._steps))
        self._save()
        return found

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
        """Add a step and write the case. `files`: those that the step wrote.

        A step that changes something forgets what was undone; one that only finds something out does not.
        """
        sums = {name: sha256((self.folder / name).read_bytes()) for name in files}
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
        state = self.state
        needed = {state.machine, state.program, *state.effects, *state.data} - {""}
        for name, known in {n: s for step in self.history for n, s in step.files.items()}.items():
            file = self.folder / name
            if name in needed and (not file.is_file() or sha256(file.read_bytes()) != known):
                what = "is not what was put into the case" if file.is_file() else "is gone"
                raise InputError(f"{name} {what}", hint="bring the file back, or begin another case", file=str(file))

    def _rewrite_used(self) -> None:
        """Files in used/ as the state has them: after undo and redo too."""
        aside = self.state.aside
        for file in {entry.rpartition(":")[0] for entry in aside}:
            lines = [int(entry.rpartition(":")[2]) for entry in aside if entry.startswith(file + ":")]
            write_files(self.folder, {used_name(file): without_lines(self.folder / file, lines)})

    def _save(self) -> None:
        from toolpath_stiff.files import write_atomically

        file = self.folder / CASE_FILE
        if file.is_file() and file.read_text("utf-8") != self._written:
            raise InputError(
                f"{CASE_FILE} was changed by another program since it was opened", hint="open the case again"
            )
        self._rewrite_used()
        self._written = case_text(self._steps, self._done)
        write_atomically(file, self._written)


def free_name(folder: Path, name: str) -> str:
    """The name, or the next one with a number that the folder does not have yet."""
    path, number = Path(name), 1
    while (folder / name).exists():
        number += 1
        name = str(path.with_name(f"{path.stem}-{number}{path.suffix}"))
    return name


def first_name(name: str) -> str:
    """A file's name without the room and the number that a case gave it: "effects/drag-2.py" came as drag.py."""
    path = Path(name)
    return re.sub(r"-\d+$", "", path.stem) + path.suffix


def write_files(folder: Path, contents: Mapping[str, str | bytes]) -> None:
    """Write files of a folder, each whole or not at all."""
    from toolpath_stiff.files import write_atomically

    for name, content in contents.items():
        write_atomically(folder / name, content)


def copied(folder: Path, file: str | Path, room: str, content: bytes | None = None) -> str:
    """Copy a file, or this content under its name, into a room of the case under a name that is free; the name."""
    from toolpath_stiff.files import read_bytes

    content = read_bytes(file, "the file") if content is None else content
    source = Path(str(file).partition("#")[0])
    suffix = ".csv" if room == "data" else UNSAFE.sub("_", source.suffix)
    name = free_name(folder, f"{room}/{UNSAFE.sub('_', source.stem)[:LONGEST_NAME].lstrip('.') or 'file'}{suffix}")
    write_files(folder, {name: content})
    return name


def measurements_csv(file: str | Path, machine: Machine) -> bytes:
    """A measurement file as CSV: a CSV file as it stands, a workbook or packaged data as a table."""
    from toolpath_stiff.column_files import csv_text
    from toolpath_stiff.files import read_bytes
    from toolpath_stiff.updating.measurements import NIST_TABLE_1

    name = str(file)
    if name != NIST_TABLE_1 and ".xlsx" not in name.lower():
        return read_bytes(name, "measurements")
    frame = Measurements([name]).to_frame(machine).drop(columns=["file", "line"])
    return csv_text(list(frame.columns), frame.astype(str).replace("nan", "").to_numpy().tolist()).encode()


def machine_bytes(machine: str | Path) -> bytes:
    """The content of a machine file, packaged or one's own."""
    from importlib import resources

    from toolpath_stiff.files import read_bytes

    if str(machine) in Machine.names():
        packaged = resources.files("toolpath_stiff") / "data" / "machines" / f"{machine}.toml"
        return packaged.read_bytes()
    return read_bytes(machine, "machine file")


def used_name(name: str) -> str:
    """Where a measurement file stands without the readings that were set aside."""
    return f"used/{Path(name).name}"


def without_lines(file: Path, lines: Sequence[int]) -> bytes:
    """A file with these lines commented out."""
    rows = file.read_bytes().split(b"\n")
    for line in lines:
        if not 1 <= line <= len(rows):
            raise InputError(f"{file.name} has no line {line}")
        rows[line - 1] = b"# " + rows[line - 1]
    return b"\n".join(rows)


def sha256(content: bytes) -> str:
    """The sum under which a case knows a file again."""
    return hashlib.sha256(content).hexdigest()
