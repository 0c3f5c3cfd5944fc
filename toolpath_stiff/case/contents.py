"""What a case holds, as its steps have made it: machine, readings, program; the commands that ask of these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

from toolpath_stiff.api.by_hand import Preview, preview, with_effects
from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.measurements import Measurements
from toolpath_stiff.case.files import used_name
from toolpath_stiff.case.history import History
from toolpath_stiff.case.steps import TABLES
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import command_line, options
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.program import Program, Reading
from toolpath_stiff.stiffness.catalogue import known_effects
from toolpath_stiff.stiffness.model import Idle, build_model

NOT_AGREED = "its code is not run, as you have not agreed to it"


NO_CHANGE: Mapping[str, Any] = MappingProxyType({})


def reading_arguments(folder: Path, reading: Mapping[str, Any]) -> Reading:
    """The same as arguments of `Program.read`."""
    given = {name: str(folder / value) if name in TABLES else value for name, value in reading.items()}
    if isinstance(switches := given.get("block_delete"), str):
        given["block_delete"] = [int(switch) for switch in switches.split(",")]
    return cast("Reading", given)


class Contents(History):
    """Machine, readings and program of a case."""

    _preview: tuple[object, Preview] | None = None

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
        changed = self.preview.machine(on) if self.state.data else with_effects(machine, on)
        return replace(changed, model=replace(changed.model, withheld=machine.model.withheld))

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

    def question(self, name: str, machine: str = "", **given: Any) -> str:
        """The command line that asks this of the readings in use."""
        return self._line(name, self.data_files, machine, **given)

    def program_line(
        self, name: str = "analyze", machine: str = "", change: Mapping[str, Any] = NO_CHANGE, **given: Any
    ) -> str:
        """The command line that asks this of the program, after a change of the state; "" without a program."""
        state = replace(self.state, **change)
        if not state.program:
            return ""
        if name == "analyze":
            given |= {"partial": True, "require": f"{state.require:g}" if state.require else None}
        origin = ",".join(f"{value:.10g}" for value in state.origin) or None
        reading = options(**{name.removesuffix("_mm_per_min"): value for name, value in state.reading.items()})
        return self._line(name, [state.program], machine, *reading, origin=origin, **given)

    def _line(self, name: str, files: Sequence[str], machine: str = "", *last: str, **given: Any) -> str:
        words = options(machine=machine or self.state.machine, **given, effects=list(self.state.effects))
        return command_line(*name.split(), *files, *words, *last)
