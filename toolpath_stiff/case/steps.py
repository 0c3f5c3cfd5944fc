"""The steps of a case: what was done, what it makes of the case's state, as text."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.documents import Document
from toolpath_stiff.machine.writer import toml_text

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
    change: Document = field(default_factory=dict)
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
    on: Mapping[str, Document] = field(default_factory=dict)
    program: str = ""
    reading: Document = field(default_factory=dict)
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
