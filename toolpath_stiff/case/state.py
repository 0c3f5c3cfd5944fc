"""Steps of a case and the state after each: as values, as commands to paste, as the file case.json."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import toolpath_stiff as tps
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.documents import Document, to_dict
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_text
from toolpath_stiff.hints import command_line, options
from toolpath_stiff.options import words_of
from toolpath_stiff.results import json_text

CASE_FILE = "case.json"
FORMAT = 2
TABLES = {"tools": "tool table", "offsets": "work offsets", "controller": "controller file"}  # a program is read with
READING = ("dialect", *TABLES, "block_delete", "feed_mm_per_min")  # of `Program.read`; not what runs another program


@dataclass(frozen=True)
class CaseState:
    """State of a case after some steps; files are named within the case's folder.

    Attributes
    ----------
    machine, effects, data, program, exercise
        Files: of the machine, of effects of one's own, of measurements, of the program; folder of a blind exercise.
    aside
        Readings that were set aside, "file:line" each.
    used
        File of measurements -> its copy without the readings that were set aside.
    on
        Effects that are switched on: name -> the keys of its entry in a machine file.
    reading
        How programs are read, as arguments of `Program.read`.
    origin
        Where program zero sits, mm and degrees; empty: where the program or the machine has it.
    require
        Stiffness that every cut should have, N/mm; 0: none is asked for.
    cut
        Setup file of its cut; "": none.
    """

    machine: str = MACHINE
    effects: tuple[str, ...] = ()
    data: tuple[str, ...] = ()
    aside: tuple[str, ...] = ()
    used: Mapping[str, str] = field(default_factory=dict)
    on: Mapping[str, Document] = field(default_factory=dict)
    program: str = ""
    reading: Document = field(default_factory=dict)
    origin: tuple[float, ...] = ()
    require: float = 0.0
    cut: str = ""
    exercise: str = ""

    @property
    def data_files(self) -> tuple[str, ...]:
        """Files of the readings in use."""
        return tuple(self.used.get(file, file) for file in self.data)

    @property
    def judged(self) -> tuple[object, ...]:
        """Everything that a diagnosis depends on."""
        return (self.machine, self.effects, self.data_files)

    def question(self, name: str, machine: str = "", *words: str, files: Sequence[str] | None = None) -> str:
        """Command line that asks a question (`name`) of the readings in use, or of `files`."""
        common = options(machine=machine or self.machine, effects=list(self.effects))
        return command_line(*name.split(), *(self.data_files if files is None else files), *common, *words)

    def program_line(self, name: str = "analyze", machine: str = "", **given: Any) -> str:
        """Command line that runs `name` on the program; "" if there is no program."""
        cut = self.cut if name in ("analyze", "compensate") else ""
        stated: Document = {"origin_mm_deg": self.origin or None, "require_N_per_mm": self.require or None,
                            "partial": name == "analyze", "cut": cut or None, **given}  # fmt: skip
        words = [*words_of(tps.Program.read, self.reading), *words_of(getattr(tps, name), stated)]
        return self.question(name, machine, *words, files=[self.program]) if self.program else ""


@dataclass(frozen=True)
class Step:
    """One step of a case.

    Attributes
    ----------
    kind, text
        One word for programs, one line for people.
    command, python
        The command line, run in the case's folder, and the Python line that do the same; "" where there is none.
    state
        What holds since.
    result
        Folder with what was found, "" without one.
    """

    kind: str
    text: str
    command: str
    python: str
    state: CaseState
    result: str = ""


def call(method: str, *words: object, **named: object) -> str:
    """A call of a method of the case as a Python line: paths by name, arguments that say nothing left out."""
    entries = [("", word) for word in words] + [(f"{name}=", value) for name, value in named.items() if value]
    shown = (f"{name}{(value.name if isinstance(value, Path) else value)!r}" for name, value in entries)
    return f"case.{method}({', '.join(shown)})"


def read_steps(file: Path) -> list[Step]:
    """Steps of a case, which may come from anybody. Raises `InputError` for content that no case writes."""
    text = read_text(file, "the case")
    try:
        document = json.loads(text)
        if document["format"] != FORMAT:
            raise ValueError(f"format {document['format']}")
        steps = [Step(**{**entry, "state": _state(entry["state"])}) for entry in document["steps"]]
        case_text(steps)  # ValueError for a number that is not finite
        names = {name for step in steps for name in _files(step)}
        wrong = [name for name in names if Path(name).is_absolute() or ".." in Path(name).parts]
        if wrong or not steps:
            raise ValueError(f"a file {wrong[0]!r}" if wrong else "no step")
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise InputError(f"this is no case: {error}", expected="what a case has written", file=str(file)) from None
    return steps


def case_text(steps: Sequence[Step]) -> str:
    """The content of case.json."""
    return json_text({"format": FORMAT, "steps": to_dict(steps)})


def _state(document: Document) -> CaseState:
    """State with each value in its attribute's type; ValueError, TypeError, AttributeError for impossible values."""
    blank = CaseState()
    state = CaseState(**{name: type(getattr(blank, name))(value) for name, value in document.items()})
    if not set(state.reading) <= set(READING) or not all(isinstance(keys, dict) for keys in state.on.values()):
        raise ValueError(f"reading = {dict(state.reading)}, on = {dict(state.on)}")
    return state


def _files(step: Step) -> list[str]:
    state = step.state
    tables = [state.reading[name] for name in TABLES if name in state.reading]
    many = (*state.effects, *state.data, *state.data_files, *tables)
    return [step.result, state.machine, state.program, state.exercise, state.cut, *many]
