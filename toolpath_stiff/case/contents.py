"""What a case holds, as its steps have made it: machine, readings, program; the commands that ask of these."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import toolpath_stiff as tps
from toolpath_stiff.api.by_hand import Preview, preview, with_effects
from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.measurements import Measurements
from toolpath_stiff.api.trust import is_agreed
from toolpath_stiff.case.files import used_name
from toolpath_stiff.case.history import History
from toolpath_stiff.case.steps import TABLES
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import is_file
from toolpath_stiff.hints import command_line, options
from toolpath_stiff.nc.program import Program, Reading
from toolpath_stiff.options import words_of

NO_CHANGE: Document = MappingProxyType({})


def reading_arguments(folder: Path, reading: Document) -> Reading:
    """The same as arguments of `Program.read`."""
    given = {name: str(folder / value) if name in TABLES else value for name, value in reading.items()}
    if isinstance(switches := given.get("block_delete"), str):
        given["block_delete"] = [int(switch) for switch in switches.split(",")]
    return cast("Reading", given)


class Contents(History):
    """Machine, readings and program of a case."""

    _preview: tuple[object, Preview] | None = None

    @property
    def effect_files(self) -> tuple[str, ...]:
        """The files of own effects; raises `InputError` for one whose code this user has not agreed to run."""
        for name in self.state.effects:
            file = self.folder / name
            if not is_file(file) or not is_agreed(file.read_bytes()):
                raise InputError(
                    f"{file} is code that came with the case, and you have not agreed to run it",
                    hint=f"read it, then `{command_line('studio', *options(case=self.folder, trust=name))}`",
                )
        return tuple(map(self.path, self.state.effects))

    @property
    def machine(self) -> Machine:
        """The machine, effects of one's own included."""
        return self.machine_of(self.state.machine)

    def machine_of(self, file: str) -> Machine:
        """A machine file of the case with the effects of one's own.

        Examples
        --------
        >>> import tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     case.machine_of(case.state.machine)
        <Machine nist: 6 struts, no effects>
        """
        return Machine.load(self.path(file), effects=self.effect_files)

    @property
    def data_files(self) -> tuple[str, ...]:
        """The files of the readings in use; those with readings set aside are in used/."""
        state = self.state
        return tuple(used_name(name) if name in state.lines_aside else name for name in state.data)

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
            self._preview = (key, preview(self.data, self.machine))
        return self._preview[1]

    def machine_with(self, on: Mapping[str, Document]) -> Machine:
        """The machine with effects of these sizes; where there are readings, the strut law is refitted beside them.

        Examples
        --------
        >>> import tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     tps.Case.open(folder).machine_with({"weak_strut": {"strut": 4, "factor": 0.8}})
        <Machine nist: 6 struts, weak_strut>
        """
        if not on:
            return self.machine
        return self.preview.machine(on) if self.state.data else with_effects(self.machine, on)

    @property
    def program(self) -> Program:
        """The program. Raises `InputError` where there is none."""
        if not self.state.program:
            raise InputError("this case has no program", hint="add one with add_program")
        return self._program(self.state.program, self.state.reading)

    def _program(self, name: str, reading: Document) -> Program:
        return Program.read(self.path(name), **reading_arguments(self.folder, reading))

    def latest(self, kind: str) -> str:
        """Folder of the latest result of a kind among the steps that hold; "" without one."""
        return next((step.result for step in reversed(self.history) if step.kind == kind and step.result), "")

    def question(self, name: str, machine: str = "", *words: str, files: Sequence[str] | None = None) -> str:
        """The command line that asks this of the readings in use, or of these files."""
        common = options(machine=machine or self.state.machine, effects=list(self.state.effects))
        return command_line(*name.split(), *(self.data_files if files is None else files), *common, *words)

    def program_line(self, name: str = "analyze", machine: str = "", change: Document = NO_CHANGE, **given: Any) -> str:
        """The command line that asks this of the program, after a change of the state; "" without a program."""
        state = replace(self.state, **change)
        if name == "analyze":
            given |= {"partial": True, "require_N_per_mm": state.require or None}
        given |= {"origin_mm_deg": state.origin or None}
        words = [*words_of(Program.read, state.reading), *words_of(getattr(tps, name), given)]
        return self.question(name, machine, *words, files=[state.program]) if state.program else ""
