"""What a case holds, as its steps have made it, and what one finds out on it: each result in a folder of its own.

The files of a case: the steps that were done and what they make of its state; copies of what came in.
"""

from __future__ import annotations

import hashlib
import math
import re
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

from toolpath_stiff.api import FolderResult, Progress
from toolpath_stiff.api.diagnosis import Measurements
from toolpath_stiff.api.effects import Preview, effects, preview, with_effects
from toolpath_stiff.api.inputs import Program, Reading
from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.trust import is_agreed
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import command_line, options
from toolpath_stiff.toml_reader import TomlReader, is_number, shortened

if TYPE_CHECKING:
    from toolpath_stiff.api.correction import Plan, Update
    from toolpath_stiff.api.diagnosis import Comparison, Diagnosis
    from toolpath_stiff.api.effects import EffectDraft
    from toolpath_stiff.api.placements import Placement
    from toolpath_stiff.api.programs import Analysis

CASE_FILE = "case.toml"
JOURNAL = ".tps-adding"  # what a step is about to bring into these rooms, until case.toml names it
EXERCISE = "exercise"  # a folder; the other rooms hold files
ROOMS = ("machines", "data", "programs", "effects", EXERCISE)
FORMAT = 1
HEADING = "# A case of toolpath_stiff: the steps in their order; `done` of them hold, the others were undone.\n"
UNSAFE = re.compile(r"[^\w.+-]+", re.ASCII)
LONGEST_NAME = 80
ENTRY = re.compile(r".+:[0-9]{1,9}")  # a reading that was set aside: file and line
TABLES = {"tools": "tool table", "offsets": "work offsets", "controller": "controller file"}  # a program is read with
READING = ("dialect", *TABLES, "block_delete", "feed_mm_per_min")  # of `Program.read`; not what runs another program
NOT_AGREED = "its code is not run, as you have not agreed to it"
Found = TypeVar("Found", bound=FolderResult)


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


def case_text(steps: Sequence[Step], done: int) -> str:
    """The content of case.toml."""
    lines = [HEADING, f"format = {FORMAT}", f"done = {done}"]
    for step in steps:
        lines += ["", "[[step]]", *(f"{name} = {_toml(value)}" for name, value in vars(step).items() if value)]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    from toolpath_stiff.machine import toml_text

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
        self._clear_up()

    def _clear_up(self) -> None:
        """Take away what a killed step brought, and no step names."""
        from toolpath_stiff.files import beside, forget, is_left, read_text, remove_parts
        from toolpath_stiff.results_folder import clear_up

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
            if not inside or _room(name) not in ROOMS:
                continue
            remove_parts(beside(file, "part-"))
            if name not in known and file.is_file():
                file.unlink()
            elif name not in known and _room(name) == EXERCISE and file.parent == self.folder:
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
        found = CaseState()
        for step in self.history:
            found = replace(found, **step.change)
        return found

    @property
    def state(self) -> CaseState:
        """What holds now: without the files of own effects that this user has not agreed to run, and their effects."""
        found, off = self.recorded, self.not_agreed
        if not off:
            return found
        kept = tuple(name for name in found.effects if name not in off)
        return replace(found, effects=kept, on=self._known(found.on, kept))

    def _known(self, on: Mapping[str, Mapping[str, Any]], files: Iterable[str]) -> dict[str, Mapping[str, Any]]:
        """Those of the effects that are known with these files of own ones."""
        known = {effect.name for effect in effects([self.path(name) for name in files]).effects}
        return {name: keys for name, keys in on.items() if name in known}

    @property
    def not_agreed(self) -> tuple[str, ...]:
        """The files of own effects whose code is not run: this user has not agreed to what they hold; see `trust`."""
        return tuple(name for name in self.recorded.effects if not self._is_agreed(self.folder / name))

    @staticmethod
    def _is_agreed(file: Path) -> bool:
        try:
            return is_agreed(file.read_bytes())
        except OSError:
            return False

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
        state = self.recorded
        tables = {str(state.reading[name]) for name in TABLES if name in state.reading}
        needed = {state.machine, state.program, *state.effects, *state.data, *tables} - {""}
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
        from toolpath_stiff.files import forget, write_atomically

        file = self.folder / CASE_FILE
        if file.is_file() and file.read_text("utf-8") != self._written:
            raise InputError(
                f"{CASE_FILE} was changed by another program since it was opened", hint="open the case again"
            )
        self._rewrite_used()
        self._written = case_text(self._steps, self._done)
        write_atomically(file, self._written)
        forget(self.folder / JOURNAL)


def reading_words(reading: Mapping[str, Any]) -> list[str]:
    """How a program is read, as options of a command."""
    return options(**{name.removesuffix("_mm_per_min"): value for name, value in reading.items()})


def reading_arguments(folder: Path, reading: Mapping[str, Any]) -> Reading:
    """The same as arguments of `Program.read`."""
    given = {name: str(folder / value) if name in TABLES else value for name, value in reading.items()}
    if isinstance(switches := given.get("block_delete"), str):
        given["block_delete"] = [int(one) for one in switches.split(",")]
    return cast("Reading", given)


def free_name(folder: Path, name: str) -> str:
    """The name, or the next one with a number that the folder does not have yet; noted, where it is of a room."""
    from toolpath_stiff.files import announce

    path, number = Path(name), 1
    while (folder / name).exists():
        number += 1
        name = str(path.with_name(f"{path.stem}-{number}{path.suffix}"))
    if _room(name) in ROOMS:
        announce(folder / JOURNAL, name)
    return name


def drop(folder: Path, *names: str) -> None:
    """Take files away again that turned out to be of no use."""
    from toolpath_stiff.files import forget

    for name in names:
        (folder / name).unlink()
    forget(folder / JOURNAL)


def _room(name: str) -> str:
    """The room of a case that a file is in; "exercise" and "exercise-2" are one."""
    return name.partition("/")[0].partition("-")[0]


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


class Contents(History):
    """Machine, readings and program of a case."""

    def __init__(self, folder: Path, steps: Sequence[Step], done: int, text: str) -> None:
        super().__init__(folder, steps, done, text)
        self._preview: tuple[object, Preview] | None = None

    @property
    def machine(self) -> Machine:
        """The machine, effects of one's own included."""
        return self.machine_of(self.state.machine)

    def machine_of(self, file: str) -> Machine:
        """A machine file of the case with the effects of one's own; those that are not agreed to are left out of it.

        Examples
        --------
        >>> import tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     case.machine_of(case.state.machine)
        <Machine nist: 6 struts, no effects>
        """
        from toolpath_stiff.machine import load_machine
        from toolpath_stiff.stiffness.effects import known_effects
        from toolpath_stiff.stiffness.model import Idle, build_model

        path, files = self.path(file), tuple(map(self.path, self.state.effects))
        if not self.not_agreed:
            return Machine.load(path, effects=files)
        given, known = load_machine(path), known_effects(files)
        acting, reading = (tuple(e for e in some if e.name in known) for some in (given.effects, given.instruments))
        left = {e.name for e in (*given.effects, *given.instruments)} | set(self.recorded.on)
        model = build_model(given.with_changes(effects=acting, instruments=reading), files)
        withheld = tuple(Idle(name, NOT_AGREED, waiting=True) for name in sorted(left - set(known)))
        return Machine(replace(model, withheld=withheld), path, files)

    @property
    def data_files(self) -> tuple[str, ...]:
        """The files of the readings in use; those with readings set aside are in used/."""
        state = self.state
        touched = {entry.rpartition(":")[0] for entry in state.aside}
        return tuple(used_name(name) if name in touched else name for name in state.data)

    @property
    def data(self) -> Measurements:
        """The readings in use. Raises `InputError` where there are none."""
        if not self.data_files:
            raise InputError("this case has no measurements", hint="add a file with add_data, or start an exercise")
        return Measurements([self.path(name) for name in self.data_files])

    @property
    def preview(self) -> Preview:
        """The error of the readings in use with effects of any size, as `tps.preview`; made once for these readings."""
        state = self.state
        key = (state.machine, state.effects, state.data, state.aside)
        if self._preview is None or self._preview[0] != key:
            self._preview = (key, preview(self.machine, self.data))
        return self._preview[1]

    def machine_with(self, on: Mapping[str, Mapping[str, Any]]) -> Machine:
        """The machine with effects of these sizes; where there are readings, the strut law is refitted beside them.

        Examples
        --------
        >>> import tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     tps.Case.open(folder).machine_with({"weak_strut": {"strut": 4, "factor": 0.8}})
        <Machine nist: 6 struts, weak_strut>
        """
        machine = self.machine
        if not on:
            return machine
        found = self.preview.machine(on) if self.state.data else with_effects(machine, on)
        return replace(found, model=replace(found.model, withheld=machine.model.withheld))

    @property
    def program(self) -> Program:
        """The program. Raises `InputError` where there is none."""
        if not self.state.program:
            raise InputError("this case has no program", hint="add one with add_program")
        return self._program(self.state.program, self.state.reading)

    def _program(self, name: str, reading: Mapping[str, Any]) -> Program:
        return Program.read(self.path(name), **reading_arguments(self.folder, reading))

    def latest(self, kind: str) -> str:
        """Folder of the latest result of a kind among the steps that hold; "" without one."""
        return next((step.result for step in reversed(self.history) if step.kind == kind and step.result), "")

    def question(self, name: str, **own: Any) -> str:
        """The command line that asks this of the readings in use."""
        return self._ask(name, self.data_files, **own)

    def _ask(self, name: str, files: Sequence[str], machine: str = "", **own: Any) -> str:
        state = self.state
        asked = options(machine=machine or state.machine, **own, effects=list(state.effects))
        return command_line(name, *files, *asked)

    def _analyze_line(
        self,
        program: str,
        origin: Sequence[float],
        name: str = "analyze",
        machine: str = "",
        require: float | None = None,
        reading: Mapping[str, Any] | None = None,
    ) -> str:
        state, word = self.state, ",".join(f"{value:.10g}" for value in origin) or None
        need = state.require if require is None else require
        own: dict[str, Any] = {"partial": True, "require": f"{need:g}" if need else None} if name == "analyze" else {}
        asked = options(machine=machine or state.machine, origin=word, **own, effects=list(state.effects))
        return command_line(name, program, *asked, *reading_words(state.reading if reading is None else reading))


class Findings(Contents):
    """The results of a case.

    Attributes
    ----------
    plots
        Whether results are kept with pictures and pages, which take their time.
    """

    def __init__(self, folder: Path, steps: Sequence[Step], done: int, text: str) -> None:
        super().__init__(folder, steps, done, text)
        self.plots = False

    def compare(self, progress: Progress | None = None) -> Comparison:
        """Where the model fails, as `tps.compare`; kept in results/."""
        from toolpath_stiff.api.diagnosis import compare

        return self._kept("compare", compare(self.machine, self.data, progress=progress))

    def diagnose(self, progress: Progress | None = None) -> Diagnosis:
        """Which effect is missing, as `tps.diagnose`; kept in results/."""
        from toolpath_stiff.api.diagnosis import diagnose

        return self._kept("diagnose", diagnose(self.machine, self.data, progress=progress))

    def draft_in(self, result: str, progress: Progress | None = None) -> tuple[EffectDraft, str]:
        """What `draft` finds, kept in a folder of the case without a step; and its command."""
        from toolpath_stiff.api.effects import draft_effect

        file = f"{result}/{self._free_effect('missing')}.py"
        found = draft_effect(self.machine, self.data, file, progress=progress)
        (self.folder / result).mkdir(parents=True, exist_ok=True)
        if found.text:
            found.save(self.folder / file)
        state = self.state
        asked = options(machine=state.machine, effects=list(state.effects), out=file)
        return found, command_line("effects", "draft", *self.data_files, *asked)

    def _free_effect(self, name: str) -> str:
        taken, number = {one.name for one in effects([self.path(one) for one in self.state.effects]).effects}, 1
        free = name
        while free in taken:
            number += 1
            free = f"{name}_{number}"
        return free

    def update(self, add: str | Iterable[str], progress: Progress | None = None) -> Update:
        """Fit effects, as `tps.update`; kept in results/, where `accept` takes machine.toml from."""
        from toolpath_stiff.api.correction import update

        names = [add] if isinstance(add, str) else list(add)
        return self._kept(
            "update", update(self.machine, self.data, add=names, progress=progress), repr(names), add=names
        )

    def plan(self, n: int = 6) -> Plan:
        """What to measure next, as `tps.plan`; kept in results/, plan.csv among it."""
        from toolpath_stiff.api.correction import plan

        return self._kept("plan", plan(self.machine, self.data if self.state.data else None, n=n), f"n={n}", n=n)

    def analyze(self, machine: str = "", progress: Progress | None = None) -> Analysis:
        """The program on the machine with the effects that are switched on, as `tps.analyze`; kept in results/.

        `machine`: a file of the case in place of that, such as an update's.
        """
        result = self.next_result("analyze")
        found, command = self.analyze_in(result, machine, progress)
        words = repr(machine) if machine else ""
        self.record("analyze", found._short(), command=command, python=f"case.analyze({words})", result=result)
        return found

    def analyze_in(self, result: str, machine: str = "", progress: Progress | None = None) -> tuple[Analysis, str]:
        """What `analyze` finds, kept in a folder of the case without a step, with a machine of its own; its command."""
        from toolpath_stiff.api.programs import analyze

        state, name = self.state, machine or self.state.machine
        on = self.machine_of(machine) if machine else self.machine_with(state.on)
        found = analyze(
            on,
            self.program,
            origin_mm_deg=state.origin or None,
            partial=True,
            require_N_per_mm=state.require or None,
            progress=progress,
        )
        found.save(self.folder / result, plots=self.plots)
        if state.on and not machine:
            name = f"{result}/machine.toml"
            on.save(self.folder / name)
        return found, self._analyze_line(state.program, state.origin, machine=name)

    def place(self, progress: Progress | None = None, **bounds: Any) -> Placement:
        """Where the work should sit, as `tps.place`; kept in results/."""
        from toolpath_stiff.api.placements import place

        found = place(self.machine, self.program, origin_mm_deg=self.state.origin or None, progress=progress, **bounds)
        words = ", ".join(f"{name}={value!r}" for name, value in bounds.items())
        return self._kept("place", found, words, program=self.state.program)

    def set_up(self, progress: Progress | None = None) -> Placement:
        """The program where it sits now, for the shop floor: offsets, set-up sheet and the program written for it.

        As `tps.place` with every bound fixed there; figures and warnings are against where the program sat at first.
        Kept in results/ with its pictures. A program that cannot be written for the place is not; not_written.txt says
        why.
        """
        result = self.next_result("set_up")
        found, command = self.set_up_in(result, progress)
        self.record("set_up", found._short(), command=command, python="case.set_up()", result=result)
        return found

    def set_up_in(self, result: str, progress: Progress | None = None) -> tuple[Placement, str]:
        """What `set_up` finds, kept in a folder of the case without a step; and its command."""
        from toolpath_stiff.api.placements import place

        state = self.state
        if len(state.origin) < 3:
            raise InputError("the program sits where it always did", hint="put it somewhere with place_at first")
        names = ("x_mm", "y_mm", "z_mm", "tilt_a_deg", "tilt_b_deg", "rotate_deg")
        at: dict[str, Any] = dict(zip(names, (*state.origin, 0.0, 0.0, 0.0), strict=False))
        name, reason = Path(state.program).name, ""
        try:
            found = place(self.machine, self.program, write=name, progress=progress, **at)
            content = found.program_bytes
        except InputError as error:
            found, reason = place(self.machine, self.program, progress=progress, **at), str(error)
        found.save(self.folder / result)
        beside = {"not_written.txt": f"{reason}\n"} if reason else {name: content}
        write_files(self.folder / result, beside)
        bounds = {key.rpartition("_")[0].replace("_", "-"): f"{value:.10g}" for key, value in at.items()}
        written = None if reason else f"{result}/{name}"
        asked = options(machine=state.machine, effects=list(state.effects), **bounds, out=result, write=written)
        return found, command_line("place", state.program, *asked, *reading_words(state.reading))

    def _kept(self, kind: str, found: Found, words: str = "", **own: Any) -> Found:
        result = self.next_result(kind)
        found.save(self.folder / result, plots=self.plots)
        program = own.pop("program", "")
        line = self._analyze_line(program, self.state.origin, kind) if program else self.question(kind, **own)
        self.record(kind, found._short(), command=line, python=f"case.{kind}({words})", result=result)
        return found
