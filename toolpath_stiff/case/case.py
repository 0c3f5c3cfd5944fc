"""A case: a folder with a machine, measurements, a program, and everything done with them, step by step.

    case.json       the steps: what each led to, its command line and its Python line
    machines/       every version of the machine, copied or fitted
    data/           copies of the measurement files
    used/           the same without the readings that were set aside: commented out, so that line numbers stay
    programs/       copies of the programs
    results/        a folder per result, as the commands write them
    exercise/       a blind exercise, if one was started

No file is written twice: a change is a new file and a step that names it, so to undo is to forget the last steps.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self, Unpack

import toolpath_stiff as tps
from toolpath_stiff.api.inputs import pose_si
from toolpath_stiff.api.trust import agree
from toolpath_stiff.case.contents import Contents
from toolpath_stiff.case.files import copied, free_name, kept_if_read, measurements_csv, without_lines
from toolpath_stiff.case.results import find
from toolpath_stiff.case.state import CASE_FILE, READING, TABLES, Step, call, case_text, read_steps
from toolpath_stiff.cutting.setup import read_setup
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_bytes, write_atomically, writing_errors
from toolpath_stiff.hints import command_line, options
from toolpath_stiff.machine.file import packaged_machines
from toolpath_stiff.nc.program import Reading
from toolpath_stiff.options import arguments_of
from toolpath_stiff.report.words import counted
from toolpath_stiff.results import Progress, json_text
from toolpath_stiff.rig import exercise as rig
from toolpath_stiff.rig.case import draw_case
from toolpath_stiff.stiffness.catalogue import find_effect, known_effects


class Case(Contents):
    r"""A folder that holds a machine, measurements, a program, and every step done with them.

    Attributes
    ----------
    folder
        Where it is.
    history
        The steps.
    plots
        Whether results are kept with pictures and pages, which take their time.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     case = tps.Case.open(folder)
    ...     case.start_exercise(seed=9006)
    ...     case.set_aside("exercise/measurements.csv", 5)
    ...     _ = case.undo()
    ...     [step.kind for step in tps.Case.open(folder).history]
    ...     _ = pathlib.Path(case.path("plan.csv")).write_text("x_mm,y_mm,z_mm,dx,dy,dz\n0,0,900,1,0,0\n")
    ...     case.measure(case.path("plan.csv"))
    ...     case.state.data, case.claim("weak_strut")["verdict"]
    ['machine', 'exercise']
    (('exercise/measurements.csv', 'data/measured.csv'), 'right')
    """

    @classmethod
    def open(cls, folder: str | Path, machine: str | Path = MACHINE, trust: Iterable[str] = ()) -> Self:
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
            case.json is no case, or the case holds code that you have not agreed to run.

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
        file = Path(folder) / CASE_FILE
        with writing_errors(folder, "open the case"):  # a name that is too long, a circle of links
            there = file.is_file()
        case = cls(Path(folder), read_steps(file) if there else ())
        if not there:
            case.set_machine(machine)
        for name in trust:
            case._check_effect(name)
            known_effects([case.path(name)])  # raises where it cannot be used
            agree((case.folder / name).read_bytes(), name)
        case.effect_files  # noqa: B018  (raises for one that is not agreed to)
        return case

    def __repr__(self) -> str:
        return f"<Case {self.folder.name}: {len(self.history)} steps>"

    def record(self, kind: str, text: str, python: str, command: str = "", result: str = "", **change: Any) -> None:
        """Add a step that changes these attributes of the state, and save the case.

        Without a command, it is the one that shows what the readings or the program give with the change.
        """
        state = replace(self.state, **change)
        command = command or (state.question("compare") if kind in ("data", "aside") else state.program_line())
        self._write([*self.history, Step(kind, text, command, python, state, result)])

    def undo(self) -> Step | None:
        """Take back the last step that changed something, and all results since; None if there is none."""
        changes = [n for n, step in enumerate(self.history) if n and step.state != self.history[n - 1].state]
        undone = self.history[changes[-1]] if changes else None
        if undone:
            self._write(self.history[: changes[-1]])
        return undone

    def _write(self, history: list[Step]) -> None:
        file = self.folder / CASE_FILE
        if file.is_file() and file.read_bytes() != case_text(self.history).encode():
            raise InputError(f"{CASE_FILE} was changed by another program since then", hint="open the case again")
        write_atomically(file, case_text(history))
        self.history = history

    def set_machine(self, machine: str | Path) -> None:
        """Use another machine, by name or file; the case keeps a copy.

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
        name = copied(self.folder, packaged_machines().get(str(machine), machine), "machines")
        with kept_if_read(self.folder, [name]):
            self.machine_of(name)
        begun = f"case = tps.Case.open({self.folder.resolve().name!r}, {str(machine)!r})"
        python, line = call("set_machine", machine) if self.history else begun, command_line("machine", "check", name)
        self.record("machine", f"machine {Path(machine).name}", python, line, machine=name, on={})

    def _check_effect(self, name: str) -> None:
        if name not in self.state.effects:
            raise InputError(f"{name} is not an effect file of this case", expected=", ".join(self.state.effects))

    def add_effects(self, file: str | Path, instead_of: str = "") -> None:
        """Use a Python file with the user's own effects. Its code is run: to add it is to agree to that.

        `instead_of`: the file of the case that it takes the place of.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     file = tps.effect_template("my_screw").save(pathlib.Path(folder, "my_screw.py"))
        ...     case.add_effects(file)
        ...     case.add_effects(file, instead_of="effects/my_screw.py")
        ...     case.state.effects, len(case.effect_files)
        (('effects/my_screw-2.py',), 1)
        """
        state = self.state
        if instead_of:
            self._check_effect(instead_of)
        new = copied(self.folder, file, "effects")
        effects = (*(name for name in state.effects if name != instead_of), new)
        paths = [*map(self.path, effects)]
        with kept_if_read(self.folder, [new]):
            tps.Machine.load(self.path(state.machine), effects=paths)
        agree((self.folder / new).read_bytes(), new)
        on = {name: keys for name, keys in state.on.items() if name in known_effects(paths)}
        text = f"own effects of {Path(file).name}{', edited' if instead_of else ''}"
        python = call("add_effects", file, instead_of=instead_of)
        self.record("effects", text, python, command_line("effects", "check", new), effects=effects, on=on)

    def add_data(self, *files: str | Path) -> None:
        """Add measurement files; the case keeps copies, but of none if one cannot be used.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     case.add_data("nist-table1")
        ...     case.state.data, len(case.data.to_frame()), case.state.question("compare").split()[:2]
        (('data/nist-table1.csv',), 42, ['tps', 'compare'])
        """
        names: list[str] = []
        with kept_if_read(self.folder, names):
            names.extend(copied(self.folder, file, "data", measurements_csv(file, self.machine)) for file in files)
            data = (*self.state.data, *names)
            count = len(tps.Measurements([*map(self.path, data)]).on(self.machine))
        text = f"{', '.join(Path(file).name for file in files)} added: {counted(count, 'reading')} in all"
        self.record("data", text, call("add_data", *files), data=data)

    def set_aside(self, file: str, line: int, back: bool = False) -> None:
        """Leave out the readings on a line of a measurement file of the case; `back`: use them again."""
        state, entry = self.state, f"{file}:{line}"
        lines = {int(other.rpartition(":")[2]) for other in state.aside if other.rpartition(":")[0] == file} ^ {line}
        known = tps.Measurements([self.path(file)]).on(self.machine).line if file in state.data else ()
        if line not in known or (entry in state.aside) is not back:
            raise InputError(f"{entry} is no reading that is {'set aside' if back else 'in use'}")
        used = {name: copy for name, copy in state.used.items() if name != file}
        if lines:
            used[file] = copied(self.folder, file, "used", without_lines(self.folder / file, lines))
        aside = (*(other for other in state.aside if other != entry), *([] if back else [entry]))
        text = f"{file} line {line} {'used again' if back else 'set aside'}"
        self.record("aside", text, call("set_aside", file, line, back=back), aside=aside, used=used)

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
        on, name = {name: keys for name, keys in self.state.on.items() if name != effect}, self.state.machine
        text = f"{find_effect(effect, self.effect_files).name} off"
        if values is not None:
            on[effect] = dict(values)
            sizes = (f"{key} {value:{'.5g' if isinstance(value, float) else ''}}" for key, value in values.items())
            text = f"{effect} on: {', '.join(sizes)}"
        if on:
            name = free_name(self.folder, "machines/by-hand.toml")
            self.machine_with(on).save(self.folder / name)
        command = self.state.question("compare", name) if self.state.data else command_line("machine", "check", name)
        self.record("switch", text, call("switch", effect, values), command, on=on)

    def accept(self, file: str | Path) -> None:
        """Continue with the machine file that an update of this case wrote.

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
        write_atomically(self.folder / name, read_bytes(file, "the machine file"))
        command = next((f"{step.command} -o {name}" for step in reversed(self.history) if step.kind == "update"), "")
        self.record("accept", f"goes on with {name}", call("accept", file), command, machine=name, on={})

    def add_program(self, file: str | Path | None = None, **reading: Unpack[Reading]) -> None:
        r"""Use an NC program or cutter-location file; without one, read the present program with other settings.

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
        ...     case.add_program(tools=tools)
        ...     case.add_program(file)
        ...     case.place_at((0, 0, 850))
        ...     case.require(50000)
        ...     analysis = case.find("analyze")
        ...     case.program, analysis.complete, case.latest("analyze"), case.history[-1].command[:30]
        (<Program slot.nc>, True, 'results/006-analyze', 'tps analyze programs/slot.nc -')
        """
        state, files, kept = self.state, list[str](), dict(self.state.reading)
        shown = (f"{TABLES.get(key, key)} {Path(str(value)).name}" for key, value in reading.items())
        text = f"programs are read with {', '.join(shown)}"
        with kept_if_read(self.folder, files):
            for key, value in reading.items():
                if key not in READING:
                    raise InputError(f"{key} is not kept in a case", expected=", ".join(READING))
                kept[key] = sorted(value) if isinstance(value, set | frozenset) else value
                if key in TABLES and value is not None:
                    kept[key] = copied(self.folder, str(value), "programs")
                    files.append(kept[key])
            if file is not None:
                text = f"program {Path(file).name}"
                files.append(copied(self.folder, file, "programs"))
                state = replace(state, program=files[-1], origin=())
            state = replace(state, reading={key: value for key, value in kept.items() if value not in (None, False)})
            program = self._program(state)
            if state.program:
                program.moves()
        self.record("program", text, call("add_program", *filter(None, [file]), **reading), **vars(state))

    def place_at(self, origin_mm_deg: Sequence[float]) -> None:
        """Place program zero: X, Y, Z, A, B, C in machine coordinates."""
        pose_si("origin", origin_mm_deg)
        origin = tuple(round(float(value), 6) for value in origin_mm_deg)
        text = " ".join(f"{axis}{value:g}" for axis, value in zip("XYZABC", origin, strict=False))
        self.record("place_at", f"program zero at {text}", call("place_at", origin), origin=origin)

    def require(self, stiffness_N_per_mm: float) -> None:
        """Require a stiffness of every cut; 0: none."""
        option = arguments_of(tps.analyze)["require_N_per_mm"]
        required = 0.0 if stiffness_N_per_mm == 0 else float(option.check(stiffness_N_per_mm) or 0)
        self.record("require", f"{required:g} N/mm required", call("require", required), require=required)

    def set_cut(self, file: str | Path) -> None:
        """Describe how programs cut: stock, tools and coefficients, from a setup file that names no other files.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     case.set_cut(tps.cut_template("part.toml").save(pathlib.Path(folder, "part.toml")))
        ...     case.state.cut, case.history[-1].python
        ('programs/part.toml', "case.set_cut('part.toml')")
        """
        name = copied(self.folder, file, "programs")
        with kept_if_read(self.folder, [name]):
            read_setup(self.folder / name)
        self.record("cut", f"cuts as {Path(file).name} says", call("set_cut", file), cut=name)

    def find(self, kind: str, progress: Progress | None = None, **given: Any) -> Any:
        """Result as a step, in results/: analyze, compensate, compare, diagnose, update, plan, place, draft, set_up.

        What the public function of that name gives for the machine, readings and program of the case, with further
        arguments of it; `draft_effect` for "draft", whose effect the case uses from then on. "set_up" is the program
        where it sits now, for the shop floor: offsets, set-up sheet and the program written for it; not_written.txt
        says why where that cannot be.

        Examples
        --------
        >>> import tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     case = tps.Case.open(folder)
        ...     case.add_data("nist-table1")
        ...     comparison = case.find("compare")
        ...     type(comparison).__name__, case.latest("compare"), case.history[-1].python
        ('Comparison', 'results/003-compare', "case.find('compare')")
        """
        result = self.next_result(kind)
        kept, command = find(self, kind, result, progress, **given)
        self.record(kind, repr(kept).strip("<>"), call("find", kind, **given), command, result)
        if kind == "draft" and kept.text:
            self.add_effects(self.folder / result / f"{kept.name}.toml")
        return kept

    def start_exercise(self, seed: int, hidden: str | None = None, layout: str = "tilted") -> None:
        """Begin a blind exercise: a simulated machine with something hidden, and measurements of it.

        `hidden` and `layout` as of `tps rig new`.
        """
        name = free_name(self.folder, "exercise")
        rig.new_exercise(self.folder / name, draw_case(seed, layout, hidden))
        python = call("start_exercise", seed, hidden=hidden, layout=layout)
        line = command_line("rig", "new", *options(seed=seed, out=name, hidden=hidden, layout=layout))
        new: Document = {"data": (f"{name}/{rig.MEASUREMENTS}",), "aside": (), "used": {}, "on": {}, "exercise": name}
        self.record("exercise", f"blind exercise, seed {seed}", python, line, machine=f"{name}/{rig.MACHINE}", **new)

    def measure(self, plan_file: str | Path) -> None:
        """Measure the exercise's machine at the poses of a plan; the readings are added."""
        visit = 1 + sum(step.kind == "measure" for step in self.history)
        readings, count = rig.measured_again(self.folder / self.state.exercise, str(plan_file), visit)
        name = copied(self.folder, "measured.csv", "data", readings.encode())
        line = command_line("rig", "measure", self.state.exercise, *options(at=plan_file, out=name, visit=visit))
        text, data = f"{counted(count, 'reading')} measured", (*self.state.data, name)
        self.record("measure", text, call("measure", plan_file), line, data=data)

    def claim(self, effects: str) -> Document:
        """Open the seal of the exercise and score a claim: names of effects with commas, "none" or "outside"."""
        score = rig.reveal(self.folder / self.state.exercise, effects)
        result = self.next_result("reveal")
        write_atomically(self.folder / result / "reveal.json", json_text(score))
        line = command_line("rig", "reveal", self.state.exercise, *options(claim=effects))
        self.record("reveal", f"claimed {effects}: {score['verdict']}", call("claim", effects), line, result)
        return score
