"""Contents of a case after its last step: machine, readings, program and results."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

import toolpath_stiff as tps
from toolpath_stiff.api.by_hand import Preview, preview, with_effects
from toolpath_stiff.api.trust import is_agreed
from toolpath_stiff.case.files import free_name
from toolpath_stiff.case.state import TABLES, CaseState, Step
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import is_file
from toolpath_stiff.hints import command_line, options
from toolpath_stiff.nc.program import Reading


class Contents:
    """What a case holds; the steps that change it are of `Case`, which says what the attributes are."""

    plots = False
    _preview: tuple[object, Preview] | None = None

    def __init__(self, folder: Path, history: Sequence[Step] = ()) -> None:
        self.folder, self.history = folder, list(history)

    @property
    def state(self) -> CaseState:
        """State after the last step."""
        return self.history[-1].state if self.history else CaseState()

    def path(self, name: str) -> str:
        """Path of a file of the case, as functions and commands take it."""
        return str(self.folder / name)

    @property
    def effect_files(self) -> tuple[str, ...]:
        """Files of the user's own effects; raises `InputError` for one whose code this user has not agreed to run."""
        for name in self.state.effects:
            file = self.folder / name
            if not is_file(file) or not is_agreed(file.read_bytes()):
                hint = f"read it, then `{command_line('studio', *options(case=self.folder, trust=name))}`"
                raise InputError(f"{file} is code that came with the case; you have not agreed to run it", hint=hint)
        return tuple(map(self.path, self.state.effects))

    @property
    def machine(self) -> tps.Machine:
        """The machine, with the user's own effects."""
        return self.machine_of(self.state.machine)

    def machine_of(self, file: str) -> tps.Machine:
        """A machine file of the case, with the user's own effects.

        Examples
        --------
        >>> import tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     case.machine_of(case.state.machine)
        <Machine nist: 6 struts, no effects>
        """
        return tps.Machine.load(self.path(file), effects=self.effect_files)

    def machine_with(self, on: Mapping[str, Document]) -> tps.Machine:
        """The machine with effects of given sizes; if there are readings, the strut law is refitted with them.

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
    def cut(self) -> str | None:
        """Setup file of the cut; None if there is none."""
        return self.path(self.state.cut) if self.state.cut else None

    @property
    def data(self) -> tps.Measurements:
        """Readings in use. Raises `InputError` if there are none."""
        if not self.state.data:
            raise InputError("this case has no measurements", hint="add a file with add_data, or start an exercise")
        return tps.Measurements(list(map(self.path, self.state.data_files)))

    @property
    def preview(self) -> Preview:
        """Errors of the readings in use for effects of any size, as `tps.preview`; made once for a set of readings."""
        if self._preview is None or self._preview[0] != self.state.judged:
            self._preview = (self.state.judged, preview(self.data, self.machine))
        return self._preview[1]

    @property
    def program(self) -> tps.Program:
        """The program. Raises `InputError` if there is none."""
        if not self.state.program:
            raise InputError("this case has no program", hint="add one with add_program")
        return self._program(self.state)

    def _program(self, state: CaseState) -> tps.Program:
        reading = {key: self.path(value) if key in TABLES else value for key, value in state.reading.items()}
        if not state.program:  # without a program the tables are still read, so that errors show
            return tps.Program.from_text("M2", **cast("Reading", reading))
        return tps.Program.read(self.path(state.program), **cast("Reading", reading))

    def latest(self, kind: str) -> str:
        """Folder of the latest result of a kind; "" if there is none."""
        return next((step.result for step in reversed(self.history) if step.kind == kind and step.result), "")

    def next_result(self, kind: str) -> str:
        """A free folder for a result."""
        return free_name(self.folder, f"results/{len(self.history) + 1:03d}-{kind}")
