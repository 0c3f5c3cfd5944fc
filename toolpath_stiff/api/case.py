r"""A case: a folder with a machine, measurements, a program, and all that was done with them, step by step.

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

import hashlib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from toolpath_stiff.api.diagnosis import Measurements
from toolpath_stiff.api.inputs import Program
from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.results import FolderResult, Progress
from toolpath_stiff.api.steps import CaseState, Step, case_text, read_case
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.hints import command_line, options

if TYPE_CHECKING:
    from toolpath_stiff.api.correction import Plan, Update
    from toolpath_stiff.api.diagnosis import Comparison, Diagnosis
    from toolpath_stiff.api.placements import Placement
    from toolpath_stiff.api.programs import Analysis

Found = TypeVar("Found", bound=FolderResult)
CASE_FILE = "case.toml"
UNSAFE = re.compile(r"[^\w.+-]+", re.ASCII)
LONGEST_NAME = 80


class Case:
    """A folder that holds a machine, measurements, a program, and every step that was done with them.

    Attributes
    ----------
    folder
        Where it is.
    plots
        Whether results are kept with pictures and pages, which take their time.

    Examples
    --------
    >>> import tempfile
    >>> import toolpath_stiff as tps
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     case = tps.Case.open(folder)
    ...     case.start_exercise(seed=9006)
    ...     case.set_aside("data/measurements.csv", 5)
    ...     _ = case.undo()
    ...     [step.kind for step in tps.Case.open(folder).history]
    ['machine', 'exercise']
    """

    def __init__(self, folder: Path, steps: Sequence[Step], done: int, text: str) -> None:
        self.folder, self._steps, self._done, self._written = folder, list(steps), done, text
        self.plots = False

    @classmethod
    def open(cls, folder: str | Path, machine: str | Path = MACHINE) -> Case:
        """Open a case, or begin one in a folder that has none.

        Parameters
        ----------
        folder
            Its folder; made if need be.
        machine
            Of a new case: name or file.

        Raises
        ------
        InputError
            case.toml is no case, a file of the case is missing or was changed by another program.
        """
        place = Path(folder)
        if (place / CASE_FILE).is_file():
            found = cls(place, *read_case(place / CASE_FILE))
            found.check_files()
            return found
        case = cls(place, [], 0, "")
        case.set_machine(machine)
        return case

    # -- what there is ------------------------------------------------------------------------------------------------

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

    @property
    def machine(self) -> Machine:
        """The machine, effects of one's own included."""
        state = self.state
        return Machine.load(self.path(state.machine), effects=[self.path(name) for name in state.effects])

    @property
    def data_files(self) -> tuple[str, ...]:
        """The files of the readings in use; those with readings set aside are in used/."""
        state = self.state
        touched = {entry.rpartition(":")[0] for entry in state.aside}
        return tuple(_used(name) if name in touched else name for name in state.data)

    @property
    def data(self) -> Measurements:
        """The readings in use. Raises `InputError` where there are none."""
        if not self.data_files:
            raise InputError("this case has no measurements", hint="add a file with add_data, or start an exercise")
        return Measurements([self.path(name) for name in self.data_files])

    @property
    def program(self) -> Program:
        """The program. Raises `InputError` where there is none."""
        if not self.state.program:
            raise InputError("this case has no program", hint="add one with add_program")
        return Program.read(self.path(self.state.program))

    def latest(self, kind: str) -> str:
        """Folder of the latest result of a kind among the steps that hold; "" without one."""
        return next((step.result for step in reversed(self.history) if step.kind == kind and step.result), "")

    def __repr__(self) -> str:
        return f"<Case {self.folder.name}: {self._done} steps>"

    # -- what one does ------------------------------------------------------------------------------------------------

    def set_machine(self, machine: str | Path) -> None:
        """Use another machine: a name or a file, of which the case keeps a copy."""
        text = _machine_text(machine)
        name = self._free(f"machines/{Path(machine).stem}.toml")
        self._write({name: text})
        try:
            Machine.load(self.path(name), effects=[self.path(one) for one in self.state.effects])
        except TpsError:
            (self.folder / name).unlink()
            raise
        self.record("machine", f"machine {Path(machine).name}", change={"machine": name, "on": {}}, files=[name])

    def add_effects(self, file: str | Path) -> None:
        """Use a Python file with effects of one's own. Its code is run."""
        name = self._copied(file, "effects")
        Machine.load(self.path(self.state.machine), effects=[self.path(name)])
        change = {"effects": (*self.state.effects, name)}
        self.record(
            "effects",
            f"own effects of {Path(file).name}",
            change=change,
            files=[name],
            command=command_line("effects", "check", name),
            python=f"case.add_effects({str(file)!r})",
        )

    def add_data(self, *files: str | Path) -> None:
        """Add measurement files; the case keeps copies, and nothing is kept of a file that cannot be used."""
        names = [self._copied(file, "data", self._as_csv(file)) for file in files]
        after = (*self.state.data, *names)
        try:
            count = len(Measurements([self.path(name) for name in after]).on(self.machine))
        except TpsError:
            for name in names:
                (self.folder / name).unlink()
            raise
        text = f"{', '.join(Path(file).name for file in files)} added: {count} readings in all"
        self.record(
            "data",
            text,
            change={"data": after},
            files=names,
            command=self._ask("compare", after),
            python=f"case.add_data({', '.join(repr(str(file)) for file in files)})",
        )

    def set_aside(self, file: str, line: int, back: bool = False) -> None:
        """Leave out the readings of a line of a measurement file of the case; `back`: use them again."""
        state, entry = self.state, f"{file}:{line}"
        if file not in state.data or (entry in state.aside) is not back:
            raise InputError(f"{entry} is no reading that is {'set aside' if back else 'in use'}")
        aside = tuple(one for one in state.aside if one != entry) if back else (*state.aside, entry)
        touched = _without(
            self.folder / file, [int(one.rpartition(":")[2]) for one in aside if one.startswith(file + ":")]
        )
        self._write({_used(file): touched})
        if not back:
            self._check_aside(file, line)
        text = f"{file} line {line} {'used again' if back else 'set aside'}"
        words = [f"-e '{one.rpartition(':')[2]}s/^/# /'" for one in aside if one.startswith(file + ":")]
        sed = f"sed {' '.join(words)} {file} > {_used(file)}" if words else ""
        self.record(
            "aside",
            text,
            change={"aside": aside},
            command=sed,
            python=f"case.set_aside({file!r}, {line}{', back=True' if back else ''})",
        )

    def switch(self, effect: str, values: Mapping[str, Any] | None) -> None:
        """Switch an effect on with these values (keys as in a machine file), or off with None.

        Raises `InputError` for an effect that is unknown or in the machine, and for values that it cannot have.
        """
        self._check_effect(effect, values or {}, values is not None)
        on = {name: dict(keys) for name, keys in self.state.on.items() if name != effect}
        if values is not None:
            on[effect] = dict(values)
        said = ", ".join(f"{key} {_short(value)}" for key, value in (values or {}).items())
        self.record(
            "switch",
            f"{effect} on: {said}" if values is not None else f"{effect} off",
            change={"on": on},
            python=f"case.switch({effect!r}, {dict(values) if values is not None else None!r})",
        )

    def accept(self, file: str | Path) -> None:
        """Go on with the machine file that an update of this case wrote."""
        name = self._free(f"machines/{Path(self.state.machine).stem.removesuffix('-updated')}-updated.toml")
        self._write({name: Path(file).read_bytes()})
        command = next((step.command for step in reversed(self.history) if step.kind == "update"), "")
        self.record(
            "accept",
            f"goes on with {name}",
            change={"machine": name, "on": {}},
            files=[name],
            command=f"{command} -o {name}" if command else "",
            python=f"case.accept({str(file)!r})",
        )

    def add_program(self, file: str | Path) -> None:
        """Use an NC program or cutter-location file."""
        name = self._copied(file, "programs")
        try:
            Program.read(self.path(name)).moves()
        except TpsError:
            (self.folder / name).unlink()
            raise
        self.record(
            "program",
            f"program {Path(file).name}",
            change={"program": name, "origin": ()},
            files=[name],
            command=self._analyze_line(name, ()),
            python=f"case.add_program({str(file)!r})",
        )

    def place_at(self, origin_mm_deg: Sequence[float]) -> None:
        """Put program zero somewhere: X, Y, Z, A, B, C in machine coordinates."""
        origin = tuple(round(float(value), 6) for value in origin_mm_deg)
        word = " ".join(f"{axis}{value:g}" for axis, value in zip("XYZABC", origin, strict=False))
        self.record(
            "place_at",
            f"program zero at {word}",
            change={"origin": origin},
            command=self._analyze_line(self.state.program, origin),
            python=f"case.place_at({origin})",
        )

    def require(self, stiffness_N_per_mm: float) -> None:
        """Ask a stiffness of every cut; 0: none."""
        self.record(
            "require",
            f"{stiffness_N_per_mm:g} N/mm required",
            change={"require": float(stiffness_N_per_mm)},
            python=f"case.require({stiffness_N_per_mm:g})",
        )

    # -- what one finds out -------------------------------------------------------------------------------------------

    def compare(self, progress: Progress | None = None) -> Comparison:
        """Where the model fails, as `tps.compare`; kept in results/."""
        from toolpath_stiff.api.diagnosis import compare

        return self._kept("compare", compare(self.machine, self.data, progress=progress))

    def diagnose(self, progress: Progress | None = None) -> Diagnosis:
        """Which effect is missing, as `tps.diagnose`; kept in results/."""
        from toolpath_stiff.api.diagnosis import diagnose

        return self._kept("diagnose", diagnose(self.machine, self.data, progress=progress))

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

    def analyze(self, progress: Progress | None = None) -> Analysis:
        """The program on the machine, as `tps.analyze`; kept in results/."""
        from toolpath_stiff.api.programs import analyze

        state = self.state
        found = analyze(
            self.machine,
            self.program,
            origin_mm_deg=state.origin or None,
            partial=True,
            require_N_per_mm=state.require or None,
            progress=progress,
        )
        return self._kept("analyze", found, program=state.program)

    def place(self, progress: Progress | None = None, **bounds: Any) -> Placement:
        """Where the work should sit, as `tps.place`; kept in results/."""
        from toolpath_stiff.api.placements import place

        found = place(self.machine, self.program, origin_mm_deg=self.state.origin or None, progress=progress, **bounds)
        words = ", ".join(f"{name}={value!r}" for name, value in bounds.items())
        return self._kept("place", found, words, program=self.state.program)

    # -- a blind exercise ---------------------------------------------------------------------------------------------

    def start_exercise(self, seed: int, hidden: str | None = None, layout: str = "tilted") -> None:
        """Begin a blind exercise: a simulated machine that hides something, and what was measured on it.

        `hidden` and `layout` as of `tps rig new`.
        """
        from toolpath_stiff.rig import new_exercise

        folder = self._free("exercise")
        new_exercise(self.folder / folder, seed, layout, hidden)
        machine, data = self._free("machines/machine.toml"), self._free("data/measurements.csv")
        self._write(
            {
                machine: (self.folder / folder / "machine.toml").read_bytes(),
                data: (self.folder / folder / "measurements.csv").read_bytes(),
            }
        )
        change = {"machine": machine, "data": (data,), "aside": (), "on": {}, "exercise": folder}
        other = {"hidden": hidden, "layout": layout if layout != "tilted" else None}
        words = "".join(f", {name}={value!r}" for name, value in other.items() if value)
        self.record(
            "exercise",
            f"blind exercise, seed {seed}",
            change=change,
            files=[machine, data],
            command=command_line("rig", "new", *options(seed=seed, out=folder, **other)),
            python=f"case.start_exercise({seed}{words})",
        )

    def measure(self, plan_file: str | Path) -> None:
        """Measure the exercise's machine at the poses of a plan; the readings are added."""
        from toolpath_stiff.rig import measure_again

        name = self._free("data/measured.csv")
        visit = 1 + sum(step.kind == "measure" for step in self.history)
        (self.folder / "data").mkdir(exist_ok=True)
        count = measure_again(self.folder / self._exercise(), str(plan_file), str(self.folder / name), visit)
        line = command_line("rig", "measure", self._exercise(), *options(at=plan_file, out=name, visit=visit))
        self.record(
            "measure",
            f"{count} readings measured",
            change={"data": (*self.state.data, name)},
            files=[name],
            command=line,
            python=f"case.measure({str(plan_file)!r})",
        )

    def claim(self, effects: str) -> dict[str, Any]:
        """Open the seal of the exercise and score a claim: names of effects with commas, "none" or "outside"."""
        from toolpath_stiff.api.results import json_text
        from toolpath_stiff.rig import reveal

        found = reveal(self.folder / self._exercise(), effects)
        result = self.next_result("reveal")
        self._write({f"{result}/reveal.json": json_text(found)})
        self.record(
            "reveal",
            f"claimed {effects}: {found['verdict']}",
            result=result,
            command=command_line("rig", "reveal", self._exercise(), *options(claim=effects)),
            python=f"case.claim({effects!r})",
        )
        return found

    def _exercise(self) -> str:
        if not self.state.exercise:
            raise InputError("no exercise was started in this case", hint="start one with start_exercise(seed)")
        return self.state.exercise

    # -- steps --------------------------------------------------------------------------------------------------------

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
        sums = {name: _sha256((self.folder / name).read_bytes()) for name in files}
        step = Step(kind, text, command, python, dict(change or {}), sums, result)
        self._steps = [*self.history, step, *(() if change else self.undone)]
        self._done += 1
        self._rewrite_used()
        self._save()

    def next_result(self, kind: str) -> str:
        """A free folder for a result."""
        return self._free(f"results/{len(self.history) + 1:03d}-{kind}")

    def question(self, name: str, **own: Any) -> str:
        """The command line that asks this of the readings in use."""
        return self._ask(name, self.data_files, **own)

    def check_files(self) -> None:
        """Raise `InputError` for a file of the case that is gone, or is not what its step wrote."""
        state = self.state
        needed = {state.machine, state.program, *state.effects, *state.data} - {""}
        for name, known in {n: s for step in self.history for n, s in step.files.items()}.items():
            file = self.folder / name
            if name in needed and (not file.is_file() or _sha256(file.read_bytes()) != known):
                what = "is not what was put into the case" if file.is_file() else "is gone"
                raise InputError(f"{name} {what}", hint="bring the file back, or begin another case", file=str(file))

    def _kept(self, kind: str, found: Found, words: str = "", **own: Any) -> Found:
        result = self.next_result(kind)
        found.save(self.folder / result, plots=self.plots)
        program = own.pop("program", "")
        line = self._analyze_line(program, self.state.origin, kind) if program else self.question(kind, **own)
        self.record(kind, found._short(), command=line, python=f"case.{kind}({words})", result=result)
        return found

    def _ask(self, name: str, files: Sequence[str], **own: Any) -> str:
        state = self.state
        return command_line(name, *files, *options(machine=state.machine, **own, effects=list(state.effects)))

    def _analyze_line(self, program: str, origin: Sequence[float], name: str = "analyze") -> str:
        state, word = self.state, ",".join(f"{value:.10g}" for value in origin) or None
        require = state.require if state.require and name == "analyze" else None
        return command_line(
            name, program, *options(machine=state.machine, origin=word, require=require, effects=list(state.effects))
        )

    def _check_effect(self, name: str, values: Mapping[str, Any], on: bool) -> None:
        from toolpath_stiff.machine.model import EffectEntry
        from toolpath_stiff.stiffness.effects import find_effect
        from toolpath_stiff.stiffness.effects.contract import read_parameters

        effect = find_effect(name, [self.path(one) for one in self.state.effects])
        if on:
            read_parameters(effect, EffectEntry(name, dict(values)), "by hand")
            if name in self.machine.effects:
                raise InputError(f"{name} is in the machine already")

    def _check_aside(self, file: str, line: int) -> None:
        machine = self.machine
        try:
            before = Measurements([self.path(file)]).on(machine)
            after = Measurements([self.path(_used(file))]).on(machine)
            good = len(before) - len(after) >= 1 and line not in set(after.line.tolist())
        except TpsError:
            good = False
        if not good:
            self._rewrite_used()
            raise InputError(f"{file} line {line} cannot be left out by itself")

    def _rewrite_used(self) -> None:
        """Files in used/ as the state has them: after undo and redo too."""
        aside = self.state.aside
        for file in {entry.rpartition(":")[0] for entry in aside}:
            lines = [int(entry.rpartition(":")[2]) for entry in aside if entry.startswith(file + ":")]
            self._write({_used(file): _without(self.folder / file, lines)})

    def _as_csv(self, file: str | Path) -> bytes:
        """A measurement file as CSV: a CSV file as it stands, a workbook or packaged data as a table."""
        from toolpath_stiff.column_files import csv_text
        from toolpath_stiff.files import read_bytes
        from toolpath_stiff.updating.measurements import NIST_TABLE_1

        name = str(file)
        if name != NIST_TABLE_1 and ".xlsx" not in name.lower():
            return read_bytes(name, "measurements")
        frame = Measurements([name]).to_frame(self.machine).drop(columns=["file", "line"])
        return csv_text(list(frame.columns), frame.astype(str).replace("nan", "").to_numpy().tolist()).encode()

    def _copied(self, file: str | Path, folder: str, content: bytes | None = None) -> str:
        """Copy a file into a folder of the case under a name that is free; the name."""
        from toolpath_stiff.files import read_bytes

        content = read_bytes(file, "the file") if content is None else content
        source = Path(str(file).partition("#")[0])
        suffix = ".csv" if folder == "data" else UNSAFE.sub("_", source.suffix)
        name = self._free(f"{folder}/{UNSAFE.sub('_', source.stem)[:LONGEST_NAME].lstrip('.') or 'file'}{suffix}")
        self._write({name: content})
        return name

    def _free(self, name: str) -> str:
        path, number = Path(name), 1
        while (self.folder / name).exists():
            number += 1
            name = str(path.with_name(f"{path.stem}-{number}{path.suffix}"))
        return name

    def _write(self, contents: Mapping[str, str | bytes]) -> None:
        from toolpath_stiff.files import write_atomically

        for name, content in contents.items():
            write_atomically(self.folder / name, content)

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


def _used(name: str) -> str:
    return f"used/{Path(name).name}"


def _without(file: Path, lines: Sequence[int]) -> bytes:
    """A file with these lines commented out."""
    rows = file.read_bytes().split(b"\n")
    for line in lines:
        if not 1 <= line <= len(rows):
            raise InputError(f"{file.name} has no line {line}")
        rows[line - 1] = b"# " + rows[line - 1]
    return b"\n".join(rows)


def _machine_text(machine: str | Path) -> bytes:
    from importlib import resources

    from toolpath_stiff.files import read_bytes

    if str(machine) in Machine.names():
        packaged = resources.files("toolpath_stiff") / "data" / "machines" / f"{machine}.toml"
        return packaged.read_bytes()
    return read_bytes(machine, "machine file")


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _short(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)
