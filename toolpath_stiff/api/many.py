"""Many programs on one machine: a report each, one overview of all; in processes, or on any executor."""

import dataclasses
import json
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from pebble import ProcessExpired

from toolpath_stiff.analysis.loads import parse_load
from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.api.inputs import origin_si
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.api.programs import Jobs, Table, analyze
from toolpath_stiff.defaults import LOAD, usable_cpus
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.files import writing_errors
from toolpath_stiff.nc.program import Program
from toolpath_stiff.options import arguments_of, checked
from toolpath_stiff.processes import ProcessPool, death
from toolpath_stiff.report.analysis import unwritten
from toolpath_stiff.report.batch.index import files
from toolpath_stiff.report.batch.outcomes import ProgramOutcome, columns_of, figures_of, terminal_summary
from toolpath_stiff.report.batch.programs import RESERVED, Found, Listed, find_programs, report_folders
from toolpath_stiff.report.words import counted
from toolpath_stiff.results import DataFrame, Progress, Result, frame_of
from toolpath_stiff.results_folder import Rules, check_folder, write_folder

_ALONE = threading.Lock()  # a process analyzes one program at a time, however many threads an executor has


class ManyAnalyses(Result):
    """The outcome of each program; the reports are in a folder.

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
        """Programs without a report, each with its reason."""
        return [outcome for outcome in self.outcomes if outcome.status == "failed"]

    @property
    def complete(self) -> bool:
        """True if no program failed and no sample was left out."""
        return all(outcome.status == "done" for outcome in self.outcomes)

    @property
    def below_required(self) -> list[ProgramOutcome]:
        """Programs with a cut below the required stiffness."""
        return [outcome for outcome in self.outcomes if outcome.figure("lines_below_required")]

    def to_dict(self) -> list[Document]:  # type: ignore[override]  # the command prints a list
        """The JSON document of the command, a list: each program's summary, its file and its report; or the error."""
        return [self._entry(outcome) for outcome in self.outcomes]

    def _entry(self, outcome: ProgramOutcome) -> Document:
        if outcome.reason:
            return {"program": Path(outcome.file).name, "file": outcome.file, "error": outcome.reason}
        report = self.folder / outcome.opens
        summary = json.loads((report.parent / "summary.json").read_text(encoding="utf-8"))
        return {**summary, "file": outcome.file, "report": str(report)}

    def to_frame(self) -> DataFrame:
        """A row for each program, in the columns of `summary.csv`."""
        return frame_of(columns_of(self.outcomes))

    def __str__(self) -> str:
        return terminal_summary(self.outcomes)

    def _short(self) -> str:
        return f"{counted(len(self.outcomes), 'program')}, {len(self.failed) or 'none'} failed"


@checked
def analyze_many(
    programs: Iterable[str | Path | Program],
    machine: Machine | str | Path,
    folder: str | Path,
    *,
    executor: Executor | None = None,
    jobs: Jobs = None,
    plots: bool = True,
    table: Table = "csv",
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
        The machine that runs them; a name or a file is loaded.
    folder
        Folder of the reports: a folder for each program, `index.html` and `summary.csv` beside them.
    executor
        Takes the programs, one a call: any `concurrent.futures.Executor`, as Dask's
        `client.get_executor()`. It stays open. Its processes must see the programs and `folder` by the same paths.
        Unless given, processes of this computer.
    jobs
        Programs at a time, each in a process of this computer; 1: all in this process. Unless given, one for each
        available CPU.
    plots, table, replace
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
    on, arguments = machine_from(machine), arguments_of(analyze)
    path_options = {name: options.pop(name) for name in arguments if name in options}
    compared = path_options.pop("compare_with", None)
    other = on.like(compared) if isinstance(compared, str | Path) else compared
    # A mistake in these options is a single error.
    origin_si(path_options.get("origin_mm_deg"))
    parse_load(path_options.get("load", LOAD))
    for name, value in path_options.items():
        if value is not None:
            arguments[name].check(value)
    unwritten(table, cut=False)
    if any(path_options.get(name) is not None for name in ("cut", "material", "stock_mm", "tolerance_um")):
        raise InputError("--cut with several programs", expected="one program, as a stock is that of one part")
    listed, given = _listed(programs)
    example = Program.from_text("", **options)
    each = [given.get(program.file) or _in_file(example, program.file) for program in listed]
    for program in (example, *given.values()):
        on.running(program, [other] if other else [])
    shared = (*on.inputs, *(other.inputs if other else ()))
    rules = Rules(inputs=(*(file for program in each for file in program.inputs), *shared), replace=replace)
    out = Path(folder)
    check_folder(out, RESERVED, rules)
    # Remove an earlier run's overview: its reports are replaced from now on, one by one.
    write_folder(out, {}, command="analyze", rules=rules, unfinished=True)
    work = partial(analyze, machine=on, compare_with=other, **path_options)
    tasks = []
    for program, report in zip(each, report_folders(listed), strict=True):
        own_rules = Rules(inputs=(*program.inputs, *shared), replace=replace)
        save = partial(Analysis.save, rules=own_rules, plots=plots, table=table)
        absolute = dataclasses.replace(program, file=program.file and str(Path(program.file).absolute()), _last=[])
        opens = (report.folder / ("report.html" if plots else "summary.json")).as_posix()
        tasks.append(Task(absolute, report, out.absolute(), opens, work, save))
        with writing_errors(out, "write to"):  # made here, as parallel processes would remove each other's
            tasks[-1].folder.parent.mkdir(parents=True, exist_ok=True)
    count = max(1, min(jobs or usable_cpus(), len(tasks)))
    outcomes = dict.fromkeys(range(len(tasks)), ProgramOutcome("", ""))
    tell = progress or (lambda text, done, total: None)
    tell(f"{count} at a time" if executor is None else type(executor).__name__, 0, len(tasks))
    for done, (place, outcome) in enumerate(_outcomes(tasks, executor, count), 1):
        outcomes[place] = outcome
        tell(f"{outcome.name}{': failed' if outcome.reason else ''}", done, len(tasks))
    written = write_folder(out, files([*outcomes.values()]), command="analyze", rules=rules)
    return ManyAnalyses(out, [*outcomes.values()], written)


def _in_file(example: Program, file: str) -> Program:
    """A program in a file, read with the example's options."""
    return dataclasses.replace(example, name=Path(file).name, file=file, text=None, _last=[])


def _listed(programs: Iterable[str | Path | Program]) -> tuple[list[Found], dict[str, Program]]:
    """The programs, each once, and the `Program` objects among them by file, or by name if they have no file."""
    several = [programs] if isinstance(programs, str | Path | Program) else list(programs)
    given: dict[str, Program] = {}
    for program in several:
        if isinstance(program, Program):
            file = program.file or program.name
            if file in given:
                raise InputError(f"two programs are named {file!r}", hint="give each a name of its own")
            given[file] = program
    objects = [Found(file, Path(Path(file).name)) for file in given]  # first, as they hold their reading options
    listed, _ = find_programs([*objects, *(str(program) for program in several if not isinstance(program, Program))])
    if not listed:
        raise InputError("no programs", expected="files, folders or Program objects")
    return listed, given


@dataclass(frozen=True)
class Task:
    """One program to be analysed, in any process.

    Attributes
    ----------
    program, listed
        The program, its path absolute; its name and the folder of its report, below `out`, which is absolute.
    opens
        The file that shows most of it, seen from `out`.
    analyze, save
        Functions that make its analysis, and write it to a folder.
    """

    program: Program
    listed: Listed
    out: Path
    opens: str
    analyze: Callable[[Program], Analysis]
    save: Callable[[Analysis, Path], object]

    @property
    def folder(self) -> Path:
        """Folder of the program's report."""
        return self.out / self.listed.folder

    def failed(self, reason: str) -> ProgramOutcome:
        """The outcome of a failure: one line that begins with the file as named; errors know its last name alone."""
        file, last = self.listed.file, f"{Path(self.listed.file).name}:"
        line = "; ".join(reason.splitlines()).replace(self.program.file or file, file)
        if file not in line:
            line = f"{file}:{line.removeprefix(last)}" if line.startswith(last) else f"{file}: {line}"
        return ProgramOutcome(self.listed.name, file, line)


def analyze_task(task: Task) -> ProgramOutcome:
    """Analyse a program and write its report: the call submitted to an executor, in any process."""
    if not task.out.is_dir():
        return task.failed(f"its process does not see {task.out}: reports need a file system that all processes share")
    try:
        with _ALONE:
            analysis = task.analyze(task.program)
            task.save(analysis, task.folder)
    except TpsError as error:
        return task.failed(str(error))
    except Exception as error:  # one failure must not stop the other programs
        return task.failed(f"{_named(error)} (analyze it alone to see where)")
    return ProgramOutcome(task.listed.name, task.listed.file, "", task.opens, figures_of(analysis.to_dict()))


def _outcomes(tasks: Sequence[Task], executor: Executor | None, jobs: int) -> Iterator[tuple[int, ProgramOutcome]]:
    """Position and outcome of each task, as completed; without an executor from `jobs` processes, 1 being this one."""
    if executor is None and jobs == 1:
        yield from enumerate(map(analyze_task, tasks))
    elif executor is None:
        with ProcessPool(jobs) as pool:
            yield from _outcomes(tasks, pool, jobs)
    else:
        futures = {executor.submit(analyze_task, task): place for place, task in enumerate(tasks)}
        try:
            for future in as_completed(list(futures)):
                place = futures.pop(future)
                outcome = _answer(tasks[place], future)
                del future  # a cluster recomputes results still referenced if their worker dies
                yield place, outcome
        finally:
            for future in futures:
                future.cancel()


def _answer(task: Task, future: Future[ProgramOutcome]) -> ProgramOutcome:
    """The outcome of a program, even if its process gave no answer."""
    if future.cancelled():
        return task.failed("was cancelled: the executor was shut down, or lost its workers")
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, ProcessExpired):
        return task.failed(death(error))
    guard = '; in a script, call it below `if __name__ == "__main__":`' if isinstance(error, BrokenExecutor) else ""
    return task.failed(f"no process could do it: {_named(error)}{guard}")


def _named(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
