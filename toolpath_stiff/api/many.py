"""Many programs on one machine: each its report, one overview of all; in processes, or wherever an executor works."""

from __future__ import annotations

import dataclasses
import json
import pickle
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from toolpath_stiff.api.hand_out import BatchRun, Task, answers
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.api.programs import Jobs, ShowPlunges, Table, analyze, check_options
from toolpath_stiff.defaults import job_count
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import writing_errors
from toolpath_stiff.nc.program import Program
from toolpath_stiff.options import arguments_of, checked
from toolpath_stiff.report.analysis import other_samples
from toolpath_stiff.report.batch.index import files
from toolpath_stiff.report.batch.outcomes import ProgramOutcome, columns_of, terminal_summary
from toolpath_stiff.report.batch.programs import RESERVED, Found, find_programs, report_folders
from toolpath_stiff.report.words import counted
from toolpath_stiff.results import Progress, Result
from toolpath_stiff.results_folder import Rules, check_folder, write_folder

if TYPE_CHECKING:
    import pandas as pd


class ManyAnalyses(Result):
    """What became of each program; the reports are in a folder.

    Attributes
    ----------
    folder
        Holds `index.html`, `summary.csv`, and a folder of each program.
    outcomes
        In the order of the programs: name, file, status (done, partial, failed), reason of a failure, figures.
    written
        The files of the overview.
    """

    command: ClassVar[str] = "analyze"

    def __init__(self, folder: Path, outcomes: Sequence[ProgramOutcome], written: Sequence[Path]) -> None:
        self.folder, self.outcomes, self.written = folder, tuple(outcomes), tuple(written)

    @property
    def failed(self) -> list[ProgramOutcome]:
        """The programs that have no report, each with its reason."""
        return [outcome for outcome in self.outcomes if outcome.status == "failed"]

    @property
    def complete(self) -> bool:
        """Whether no program failed and no sample was left out."""
        return all(outcome.status == "done" for outcome in self.outcomes)

    @property
    def below_required(self) -> list[ProgramOutcome]:
        """The programs with a cut below what was required."""
        return [outcome for outcome in self.outcomes if outcome.figure("lines_below_required")]

    def to_dict(self) -> list[dict[str, Any]]:  # type: ignore[override]  # the command prints a list
        """The JSON document of the command, a list: each program's summary, its file and its report; or the error."""
        return [self._entry(outcome) for outcome in self.outcomes]

    def _entry(self, outcome: ProgramOutcome) -> dict[str, Any]:
        if outcome.reason:
            return {"program": Path(outcome.file).name, "file": outcome.file, "error": outcome.reason}
        report = self.folder / outcome.opens
        summary = json.loads((report.parent / "summary.json").read_text(encoding="utf-8"))
        return {**summary, "file": outcome.file, "report": str(report)}

    def to_json(self) -> str:
        """`to_dict()` as text, as the command prints it."""
        return json.dumps(self.to_dict(), indent=2) + "\n"  # names need not be UTF-8, so escaped

    def to_frame(self) -> pd.DataFrame:
        """One row a program, the columns of `summary.csv`."""
        import pandas as pd

        return pd.DataFrame(columns_of(self.outcomes))

    def __str__(self) -> str:
        return terminal_summary(self.outcomes)

    def _short(self) -> str:
        return f"{counted(len(self.outcomes), 'program')}, {len(self.failed) or 'none'} failed"


@checked
def analyze_many(
    programs: Iterable[str | Path | Program | Found],
    machine: Machine | str | Path,
    folder: str | Path,
    *,
    executor: Executor | None = None,
    jobs: Jobs = None,
    plots: bool = True,
    table: Table = "csv",
    show_plunges: ShowPlunges = False,
    replace: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> ManyAnalyses:
    r"""Stiffness along the path of many programs: each gets its report, all get one overview.

    A program that fails does not stop the others; nor does a process that dies.

    Parameters
    ----------
    programs
        Files, folders (every program in them and below), `Program` objects. A file that is named twice is read once,
        as its `Program` object says if there is one of the same path.
    machine
        What they run on; a name or a file is loaded.
    folder
        Where the reports go: a folder for each program, `index.html` and `summary.csv` beside them.
    executor
        What the programs are handed to, one a call: any `concurrent.futures.Executor`, as Dask's
        `client.get_executor()`. It stays open. Its processes must see the programs and `folder` by the same paths.
        Unless given, processes of this computer.
    jobs
        Programs at a time, each in a process of this computer; 1: all in this process. Unless given, one for each
        available CPU.
    plots, table, show_plunges, replace
        As of `Analysis.save`.
    progress
        Called with the program that is done, programs done, programs in all; first with 0 done, when all arguments
        have been found right.
    **options
        Those of `analyze` (origin_mm_deg, load, step_mm, force_N, partial, require_N_per_mm, compare_with) and of
        `Program.read`.

    Raises
    ------
    InputError
        An argument is wrong; nothing has been started then.

    Examples
    --------
    >>> import tempfile
    >>> import toolpath_stiff as tps
    >>> slot = "G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2"
    >>> parts = [tps.Program.from_text(slot, name="slot.nc"), tps.Program.from_text("G1 X10 F", name="bad.nc")]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     found = tps.analyze_many(parts, "nist", folder, jobs=1, plots=False, require_N_per_mm=60000)
    ...     programs = [entry["program"] for entry in found.to_dict()]
    >>> found, programs
    (<ManyAnalyses: 2 programs, 1 failed>, ['slot.nc', 'bad.nc'])
    >>> [one.status for one in found.outcomes], found.complete
    (['done', 'failed'], False)
    >>> [one.name for one in found.failed], [one.name for one in found.below_required]
    (['bad.nc'], ['slot.nc'])
    >>> found.to_frame()["status"].tolist()
    ['done', 'failed']
    """
    on = machine_from(machine)
    path_options = {name: options.pop(name) for name in arguments_of(analyze) if name in options}
    compared = path_options.pop("compare_with", None)
    other = on.like(compared) if isinstance(compared, str | Path) else compared
    check_options(**path_options)  # a mistake in them is one error
    other_samples(table)
    listed, given = _listed(programs)
    example = Program.from_text("", **options)
    each = [given.get(program.file) or _named(example, program.file) for program in listed]
    for program in (example, *given.values()):
        on.running(program, [other] if other else [])
    count = job_count(jobs, len(listed))
    shared = (*on.inputs, *(other.inputs if other else ()))
    rules = Rules(inputs=(*(file for program in each for file in program.inputs), *shared), replace=replace)
    out = Path(folder)
    check_folder(out, RESERVED, rules)
    saved = {"plots": plots, "table": table, "show_plunges": show_plunges}
    run = BatchRun(out.absolute(), str(out), pickle.dumps((on, other)), path_options, saved, replace)
    # The overview of an earlier run goes, as its reports do from now on, one after the other.
    write_folder(out, {}, command="analyze", rules=rules, unfinished=True)
    tasks = [
        Task(_absolute(program), report, (*program.inputs, *shared), run)
        for program, report in zip(each, report_folders(listed), strict=True)
    ]
    with writing_errors(out, "write to"):
        for task in tasks:  # before the processes, which would take each other's away
            task.folder.parent.mkdir(parents=True, exist_ok=True)
    outcomes = dict.fromkeys(range(len(tasks)), ProgramOutcome("", ""))
    told = progress or (lambda text, done, total: None)
    told(f"{count} at a time" if executor is None else type(executor).__name__, 0, len(tasks))
    for done, (place, outcome) in enumerate(answers(tasks, executor, count), 1):
        outcomes[place] = outcome
        told(f"{outcome.name}{': failed' if outcome.reason else ''}", done, len(tasks))
    written = write_folder(out, files([*outcomes.values()]), command="analyze", rules=rules)
    return ManyAnalyses(out, [*outcomes.values()], written)


def _named(example: Program, file: str) -> Program:
    """A program in a file, read as the example."""
    return dataclasses.replace(example, name=Path(file).name, file=file, text=None, _last={})


def _absolute(program: Program) -> Program:
    """The same for another process."""
    return dataclasses.replace(program, file=program.file and str(Path(program.file).absolute()), _last={})


def _listed(programs: Iterable[str | Path | Program | Found]) -> tuple[list[Found], dict[str, Program]]:
    """The programs, each once, and the `Program` objects among them by file, or by name where they have none."""
    given: dict[str, Program] = {}
    arguments: list[str | Found] = []
    for program in [programs] if isinstance(programs, str | Path | Program) else programs:
        if isinstance(program, Program):
            file = program.file or program.name
            if file in given:
                raise InputError(f"two programs are named {file!r}", hint="give each a name of its own")
            given[file] = program
            arguments.append(Found(file, Path(Path(file).name)))
        else:
            arguments.append(program if isinstance(program, Found) else str(program))
    listed, _ = find_programs(arguments)
    missing = given.keys() - {program.file for program in listed}
    if missing:
        raise InputError(f"{min(missing)!r} is named twice", hint="name it once, as a file or as a Program")
    if not listed:
        raise InputError("no programs", expected="files, folders or Program objects")
    return listed, given
