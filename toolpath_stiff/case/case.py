"""A case: a folder with a machine, measurements, a program, and all that was done with them, step by step.

    case.toml       the steps, each with what it changed, its command line and its Python line
    machines/       every version of the machine, copied or fitted
    data/           copies of the measurement files
    used/           the same without the readings that were set aside: commented out, so that line numbers stay
    programs/       copies of the programs
    results/        a folder a result, as the commands write them
    exercise/       a blind exercise, if one was started

The state is what the steps up to `done` have made of it; undo and redo move `done`, nothing is deleted.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

from toolpath_stiff.api.inputs import finite, pose_si
from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.measurements import Measurements
from toolpath_stiff.api.programs import analyze
from toolpath_stiff.api.trust import agree
from toolpath_stiff.case.contents import reading_arguments
from toolpath_stiff.case.exercise import BlindExercise
from toolpath_stiff.case.files import (
    copied,
    drop,
    first_name,
    free_name,
    machine_bytes,
    measurements_csv,
    used_name,
    without_lines,
    write_files,
)
from toolpath_stiff.case.history import recorded
from toolpath_stiff.case.reading import read_case
from toolpath_stiff.case.steps import CASE_FILE, READING, TABLES
from toolpath_stiff.correction.draft import EffectDraft
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.files import read_bytes, writing_errors
from toolpath_stiff.hints import command_line
from toolpath_stiff.machine.model import EffectEntry
from toolpath_stiff.nc.program import Program, Reading
from toolpath_stiff.options import arguments_of
from toolpath_stiff.report.words import counted
from toolpath_stiff.results import Progress
from toolpath_stiff.stiffness.catalogue import find_effect, known_effects
from toolpath_stiff.stiffness.parameters import read_parameters


class Case(BlindExercise):
    r"""A folder that holds a machine, measurements, a program, and every step that was done with them.

    Attributes
    ----------
    folder
        Where it is.
    plots
        Whether results are kept with pictures and pages, which take their time.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     case = tps.Case.open(folder)
    ...     case.start_exercise(seed=9006)
    ...     case.set_aside("data/measurements.csv", 5)
    ...     _ = case.undo()
    ...     [step.kind for step in tps.Case.open(folder).history], [step.kind for step in case.undone]
    ...     _ = case.redo()
    ...     _ = pathlib.Path(case.path("plan.csv")).write_text("x_mm,y_mm,z_mm,dx,dy,dz\n0,0,900,1,0,0\n")
    ...     case.measure(case.path("plan.csv"))
    ...     case.check_files()  # raises InputError for a file that is gone or was changed
    ...     case.state.data, case.claim("weak_strut")["verdict"], case.next_result("compare")
    (['machine', 'exercise'], ['aside'])
    (('data/measurements.csv', 'data/measured.csv'), 'right', 'results/006-compare')
    """

    @classmethod
    def open(cls, folder: str | Path, machine: str | Path = MACHINE, trust: Iterable[str] = ()) -> Case:
        """Open a case, or begin one in a folder that has none.

        Files of own effects that came with a case from elsewhere are code: it opens once you have agreed to run them.

        Parameters
        ----------
        folder
            Its folder; made if need be.
        machine
            Of a new case: name or file.
        trust
            Files of own effects of the case (their names there) that you have read and agree to run. The agreement is
            kept in your configuration folder: it holds for files of the same content in any case.

        Raises
        ------
        InputError
            case.toml is no case, a file of the case is missing or was changed by another program, or holds code that
            you have not agreed to run.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     _ = tps.Case.open(folder, "genhexkins")  # begins it
        ...     case = tps.Case.open(folder)
        ...     case.machine, len(case.history)
        (<Machine genhexkins: 6 struts, no effects>, 1)
        """
        place = Path(folder)
        with writing_errors(folder, "open the case"):  # a name that is too long, a circle of links
            there = (place / CASE_FILE).is_file()
        if not there:
            case = cls(place, [], 0, "")
            case.set_machine(machine)
            return case
        case = cls(place, *read_case(place / CASE_FILE))
        case.check_files()
        for name in trust:
            if name not in case.state.effects:
                raise InputError(
                    f"{name!r} is no file of own effects of this case", expected=", ".join(case.state.effects)
                )
            known_effects([case.path(name)])  # raises where it cannot be used
            agree((place / name).read_bytes(), name)
        case.effect_files  # noqa: B018  (raises for one that is not agreed to)
        return case

    def __repr__(self) -> str:
        return f"<Case {self.folder.name}: {self._done} steps>"

    @recorded
    def set_machine(self, machine: str | Path) -> None:
        """Use another machine: a name or a file, of which the case keeps a copy.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     case.set_machine("genhexkins")
        ...     case.machine.name, case.state.machine
        ('genhexkins', 'machines/genhexkins.toml')
        """
        text = machine_bytes(machine)
        name = free_name(self.folder, f"machines/{Path(machine).stem}.toml")
        write_files(self.folder, {name: text})
        try:
            self.machine_of(name)
        except TpsError:
            drop(self.folder, name)
            raise
        begun = f"case = tps.Case.open({self.folder.resolve().name!r}, {str(machine)!r})"
        self.record(
            "machine",
            f"machine {Path(machine).name}",
            command_line("machine", "check", name),
            change={"machine": name, "on": {}},
            files=[name],
            python="" if self.history else begun,
        )

    @recorded
    def add_effects(self, file: str | Path) -> None:
        """Use a Python file with effects of one's own. Its code is run: to add it is to agree to that.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     case.add_effects(tps.effect_template("my_screw").save(pathlib.Path(folder, "my_screw.py")))
        ...     case.change_effects("effects/my_screw.py", pathlib.Path(folder, "my_screw.py"))
        ...     case.state.effects, len(case.effect_files)
        (('effects/my_screw-2.py',), 1)
        """
        name = copied(self.folder, file, "effects")
        self._take_effects(name, "", f"own effects of {Path(file).name}")

    @recorded
    def change_effects(self, name: str, file: str | Path) -> None:
        """Use an edited file in place of a file of own effects of the case (its name there). Its code is run."""
        if name not in self.state.effects:
            raise InputError(f"{name} is no file of own effects of this case", expected=", ".join(self.state.effects))
        new = copied(self.folder, first_name(name), "effects", read_bytes(file, "the file"))
        self._take_effects(new, name, f"own effects of {Path(name).name}, edited")

    def _take_effects(self, new: str, old: str, text: str) -> None:
        """Put a file of the case among the effects, in place of `old` if there is one; drop it where it is at fault."""
        state = self.state
        files = (*(file for file in state.effects if file != old), new)
        paths = [self.path(file) for file in files]
        try:
            Machine.load(self.path(state.machine), effects=paths)
        except TpsError:
            drop(self.folder, new)
            raise
        agree((self.folder / new).read_bytes(), new)
        on = {name: keys for name, keys in state.on.items() if name in known_effects(paths)}
        line = command_line("effects", "check", new)
        self.record("effects", text, line, change={"effects": files, "on": on}, files=[new])

    @recorded
    def add_data(self, *files: str | Path) -> None:
        """Add measurement files; the case keeps copies, and nothing is kept of a file that cannot be used.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     case.add_data("nist-table1")
        ...     case.data_files, len(case.data.to_frame()), case.question("compare").split()[:2]
        (('data/nist-table1.csv',), 42, ['tps', 'compare'])
        """
        names = [copied(self.folder, file, "data", measurements_csv(file, self.machine)) for file in files]
        after = (*self.state.data, *names)
        try:
            count = len(Measurements([self.path(name) for name in after]).on(self.machine))
        except TpsError:
            drop(self.folder, *names)
            raise
        text = f"{', '.join(Path(file).name for file in files)} added: {counted(count, 'reading')} in all"
        self.record("data", text, self.question("compare", files=after), change={"data": after}, files=names)

    @recorded
    def set_aside(self, file: str, line: int, back: bool = False) -> None:
        """Leave out the readings of a line of a measurement file of the case; `back`: use them again."""
        state, entry = self.state, f"{file}:{line}"
        if file not in state.data or (entry in state.aside) is not back:
            raise InputError(f"{entry} is no reading that is {'set aside' if back else 'in use'}")
        aside = tuple(other for other in state.aside if other != entry) if back else (*state.aside, entry)
        lines = replace(state, aside=aside).lines_aside.get(file, [])
        write_files(self.folder, {used_name(file): without_lines(self.folder / file, lines)})
        left = self._lines(used_name(file))
        if not back and (not left or line in left or line not in self._lines(file)):
            self._rewrite_used(state)
            raise InputError(f"{file} line {line} cannot be left out by itself")
        words = " ".join(f"-e '{number}s/^/# /'" for number in lines)
        command = f"sed {words} {file} > {used_name(file)}" if words else self.question("compare", files=state.data)
        text = f"{file} line {line} {'used again' if back else 'set aside'}"
        self.record("aside", text, command, change={"aside": aside})

    def _lines(self, file: str) -> set[int]:
        """The lines of the readings of a file; none where it cannot be read."""
        try:
            return set(Measurements([self.path(file)]).on(self.machine).line.tolist())
        except TpsError:
            return set()

    @recorded
    def switch(self, effect: str, values: Document | None) -> None:
        """Switch an effect on with these values (keys as in a machine file), or off with None.

        Raises `InputError` for an effect that is unknown or in the machine, and for values that it cannot have.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     case.switch("weak_strut", {"strut": 4, "factor": 0.8})
        ...     case.state.on
        {'weak_strut': {'strut': 4, 'factor': 0.8}}
        """
        found = find_effect(effect, self.effect_files)
        on = {name: dict(keys) for name, keys in self.state.on.items() if name != effect}
        if values is not None:
            read_parameters(found, EffectEntry(effect, dict(values)), "by hand")
            if effect in self.machine.effects:
                raise InputError(f"{effect} is in the machine already")
            on[effect] = dict(values)
        name = self.state.machine
        if on:
            name = free_name(self.folder, "machines/by-hand.toml")
            self.machine_with(on).save(self.folder / name)
        sizes = ", ".join(f"{key} {_short(value)}" for key, value in (values or {}).items())
        command = self.question("compare", name) if self.state.data else command_line("machine", "check", name)
        self.record(
            "switch",
            f"{effect} off" if values is None else f"{effect} on: {sizes}",
            command,
            change={"on": on},
            files=[name] if on else [],
        )

    @recorded
    def accept(self, file: str | Path) -> None:
        """Go on with the machine file that an update of this case wrote.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     case.accept(tps.Machine.load("nist").save(pathlib.Path(folder, "fitted.toml")))
        ...     case.state.machine
        'machines/nist-updated.toml'
        """
        name = free_name(self.folder, f"machines/{Path(self.state.machine).stem.removesuffix('-updated')}-updated.toml")
        write_files(self.folder, {name: read_bytes(file, "the machine file")})
        command = next((step.command for step in reversed(self.history) if step.kind == "update"), "")
        command = f"{command} -o {name}" if command else ""
        self.record("accept", f"goes on with {name}", command, change={"machine": name, "on": {}}, files=[name])

    @recorded
    def add_program(self, file: str | Path, **reading: Unpack[Reading]) -> None:
        r"""Use an NC program or cutter-location file.

        Further arguments as of `Program.read`: dialect, controller, offsets, tools, block_delete, feed_mm_per_min. They
        hold for later programs of the case too, until they are given anew; None takes one back.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     file, tools = pathlib.Path(folder, "slot.nc"), pathlib.Path(folder, "my.tbl")
        ...     _ = file.write_text("G21 G90\nT1 M6\nG43 H1\nG1 X40 F300\nM2\n")
        ...     _ = tools.write_text("T1 P1 Z120\n")
        ...     case.add_program(file, tools=tools)
        ...     case.place_at((0, 0, 850))
        ...     case.require(50000)
        ...     analysis = case.analyze()
        ...     case.program, analysis.complete, case.latest("analyze"), case.history[-1].command[:30]
        (<Program slot.nc>, True, 'results/005-analyze', 'tps analyze programs/slot.nc -')
        """
        name = copied(self.folder, file, "programs")
        self._take_program(name, reading, [name], "program", f"program {Path(file).name}")

    @recorded
    def read_programs(self, **reading: Unpack[Reading]) -> None:
        r"""Read the programs of the case with another tool table, offsets, controller file: arguments of `add_program`.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     tools = pathlib.Path(folder, "my.tbl")
        ...     _ = tools.write_text("T1 P1 Z120\n")
        ...     case.read_programs(tools=tools)
        ...     case.state.reading
        {'tools': 'programs/my.tbl'}
        """
        text = ", ".join(f"{TABLES.get(name, name)} {Path(str(value)).name}" for name, value in reading.items())
        self._take_program(self.state.program, reading, [], "reading", f"programs are read with {text}")

    def _take_program(self, program: str, given: Document, files: list[str], kind: str, text: str) -> None:
        """Read a program of the case with what it has and what is given; drop the files where it cannot be read."""
        state, reading = self.state, dict(self.state.reading)
        try:
            for key, value in given.items():
                if key not in READING:
                    raise InputError(f"{key} is not kept in a case", expected=", ".join(READING))
                reading[key] = value
                if key in TABLES and value is not None:
                    reading[key] = copied(self.folder, value, "programs")
                    files.append(reading[key])
                elif key == "block_delete" and not isinstance(value, bool | None):
                    reading[key] = ",".join(map(str, sorted(value)))
            reading = {key: value for key, value in reading.items() if value not in (None, False)}
            if program:
                self._program(program, reading).moves()
            else:
                Program.from_text("M2", **reading_arguments(self.folder, reading))
        except TpsError:
            drop(self.folder, *files)
            raise
        change: dict[str, Any] = {"reading": reading} if reading != state.reading else {}
        if program != state.program:
            change |= {"program": program, "origin": ()}
        self.record(kind, text, self.program_line(change=change), change=change, files=files)

    @recorded
    def place_at(self, origin_mm_deg: Sequence[float]) -> None:
        """Put program zero somewhere: X, Y, Z, A, B, C in machine coordinates."""
        pose_si("origin", origin_mm_deg)
        origin = tuple(round(float(value), 6) for value in origin_mm_deg)
        word = " ".join(f"{axis}{value:g}" for axis, value in zip("XYZABC", origin, strict=False))
        change = {"origin": origin}
        self.record("place_at", f"program zero at {word}", self.program_line(change=change), change=change)

    @recorded
    def require(self, stiffness_N_per_mm: float) -> None:
        """Ask a stiffness of every cut; 0: none."""
        required = finite("required", stiffness_N_per_mm)
        if required:
            arguments_of(analyze)["require_N_per_mm"].check(required)
        change = {"require": required}
        self.record("require", f"{required:g} N/mm required", self.program_line(change=change), change=change)

    @recorded
    def draft(self, progress: Progress | None = None) -> EffectDraft:
        """What a diagnosis leaves unexplained as an effect file, as `tps.draft_effect`; the case uses it from then on.

        It competes like an effect of one's own; without new readings it is `described` at best.
        """
        draft = self._step("draft", EffectDraft, progress)
        if draft.text:
            self.add_effects(self.folder / self.latest("draft") / f"{draft.name}.toml")
        return draft


def _short(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)
