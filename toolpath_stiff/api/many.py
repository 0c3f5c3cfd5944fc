"""Many programs on one machine: each its report, one overview of all; in processes, or wherever an executor works."""

from __future__ import annotations

import json
import pickle
import textwrap
import threading
import uuid
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pebble import ProcessExpired

from toolpath_stiff.api.inputs import Force, LoadDirection, Origin, Step
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.api.programs import (
    JOBS,
    Compared,
    Partial,
    RequiredStiffness,
    ShowPlunges,
    Table,
    analyze,
    path_options,
)
from toolpath_stiff.defaults import FORCE, LOAD, VERSION, job_count
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.nc.program import Program
from toolpath_stiff.options import checked
from toolpath_stiff.processes import ProcessPool, death
from toolpath_stiff.report.analysis.summary import check_table
from toolpath_stiff.report.batch.index import files, names
from toolpath_stiff.report.batch.programs import (
    Found,
    Listed,
    Outcome,
    columns_of,
    figures_of,
    find_programs,
    report_folders,
    terminal_summary,
)
from toolpath_stiff.report.words import counted
from toolpath_stiff.results import Progress, Result
from toolpath_stiff.results_folder import Rules, check_folder, clear_up, write_folder

if TYPE_CHECKING:
    import pandas as pd

Machines = tuple[Machine, Machine | None]  # the machine, and the one to compare with
_ALONE = threading.Lock()  # a process analyzes one program at a time, however many threads an executor has


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

    def __init__(self, folder: Path, outcomes: Sequence[Outcome], written: Sequence[Path]) -> None:
        self.folder, self.outcomes, self.written = folder, tuple(outcomes), tuple(written)

    @property
    def failed(self) -> list[Outcome]:
        """The programs that have no report, each with its reason."""
        return [one for one in self.outcomes if one.status == "failed"]

    @property
    def complete(self) -> bool:
        """Whether no program failed and no sample was left out."""
        return all(one.status == "done" for one in self.outcomes)

    @property
    def below_required(self) -> list[Outcome]:
        """The programs with a cut below what was required."""
        return [one for one in self.outcomes if (one.figures or {}).get("lines_below_required")]

    @cached_property
    def _document(self) -> list[dict[str, Any]]:
        return [self._entry(one) for one in self.outcomes]

    def to_dict(self) -> list[dict[str, Any]]:  # type: ignore[override]  # the command prints a list
        """The JSON document of the command, a list: each program's summary, its file and its report; or the error."""
        return self._document

    def _entry(self, one: Outcome) -> dict[str, Any]:
        if one.reason:
            return {"program": Path(one.file).name, "file": one.file, "error": one.reason}
        report = self.folder / one.opens
        summary = json.loads((report.parent / "summary.json").read_text(encoding="utf-8"))
        return {**summary, "file": one.file, "report": str(report)}

    def json_pieces(self) -> Iterator[str]:
        """`to_dict()` as text, one program a piece: together they may be large."""
        for i, one in enumerate(self.outcomes):
            entry = json.dumps(self._entry(one), indent=2)  # names need not be UTF-8, so escaped
            yield ("[\n" if i == 0 else ",\n") + textwrap.indent(entry, "  ")
        yield "\n]\n"

    def to_json(self) -> str:
        """`to_dict()` as text, as the command prints it."""
        return "".join(self.json_pieces())

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
    jobs: Annotated[int | None, JOBS] = None,
    plots: bool = True,
    table: Table = "csv",
    show_plunges: ShowPlunges = False,
    replace: bool = False,
    origin_mm_deg: Origin = None,
    load: LoadDirection = LOAD,
    step_mm: Step = 1.0,
    force_N: Force = FORCE,
    partial: Partial = False,
    require_N_per_mm: RequiredStiffness = None,
    compare_with: Compared = None,
    progress: Progress | None = None,
    **reading: Any,
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
    origin_mm_deg, load, step_mm, force_N, partial, require_N_per_mm, compare_with
        As of `analyze`.
    progress
        Called with the program that is done, programs done, programs in all; first with 0 done, when all arguments
        have been found right.
    **reading
        How files are read: the options of `Program.read`.

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
    ...     "".join(found.json_pieces()) == found.to_json()
    True
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
    other = None
    if compare_with is not None:
        other = compare_with if isinstance(compare_with, Machine) else on.like(compare_with)
    options: dict[str, Any] = {
        "origin_mm_deg": origin_mm_deg, "load": load, "step_mm": step_mm, "force_N": force_N, "partial": partial,
        "require_N_per_mm": require_N_per_mm,
    }  # fmt: skip
    path_options(**options)  # a mistake in them is one error
    check_table(table)
    found, given = _found(programs)
    example = Program.from_text("", **reading)
    _check_shared(on, other, [example, *given.values()])
    job_count(jobs, 1)
    read = (*(one.file for one in found), *(file for one in (example, *given.values()) for file in one.inputs))
    inputs = (*read, *on.inputs, *(other.inputs if other else ()))
    run = Run(
        out=Path(folder),
        rules=Rules(inputs=inputs, replace=replace),
        options=options,
        saving={"plots": plots, "table": table, "show_plunges": show_plunges},
        machines=(on, other),
    )
    check_folder(run.out, names(), run.rules)
    listed = report_folders(found)
    with _folders_for(run.out, listed):
        # The overview of an earlier run goes, as its reports do from now on, one after the other.
        write_folder(run.out, {}, command="analyze", rules=run.rules, unfinished=True)
        tasks = _tasks(run, listed, given, example)
        outcomes = _outcomes(tasks, run, executor, jobs, progress)
        written = write_folder(run.out, files(outcomes), command="analyze", rules=run.rules)
    return ManyAnalyses(run.out, outcomes, written)


@dataclass(frozen=True)
class Run:
    """What all programs share, in this process."""

    out: Path
    rules: Rules
    options: dict[str, Any]
    saving: dict[str, Any]
    machines: Machines


@dataclass(frozen=True)
class Task:
    """One program, with all that a process needs for it: small, picklable, paths absolute.

    Attributes
    ----------
    program, listed
        What is read; its file as named, its name, its report's folder.
    out, shown
        The folder of all reports, and as the caller named it.
    machines
        Pickled once for all programs: a process unpacks it once.
    options, saving
        Of `analyze` and of `Analysis.save`.
    inputs, replace
        Files that lie where the report goes and are read by the run, and whether they may be replaced.
    version, run
        Of the package; a name that no other run has, for executors that know a call again by its arguments.
    """

    program: Program
    listed: Listed
    out: Path
    shown: str
    machines: bytes
    options: dict[str, Any]
    saving: dict[str, Any]
    inputs: tuple[str, ...]
    replace: bool
    version: str = VERSION
    run: str = ""

    @property
    def folder(self) -> Path:
        """The folder of its report."""
        return self.out / self.listed.folder


def _found(programs: Iterable[str | Path | Program | Found]) -> tuple[list[Found], dict[str, Program]]:
    """The programs, each once, and the `Program` objects among them by file, or by name where they have none."""
    given: dict[str, Program] = {}
    asked: list[str | Found] = []
    for one in [programs] if isinstance(programs, str | Path | Program) else programs:
        if isinstance(one, Program):
            found = Found(one.file or one.name, Path(Path(one.file or one.name).name))
            if found.file in given:
                raise InputError(f"two programs are named {found.file!r}", hint="give each a name of its own")
            given[found.file] = one
            asked.append(found)
        else:
            asked.append(one if isinstance(one, Found) else str(one))
    programs_found, _ = find_programs(asked)
    missing = given.keys() - {one.file for one in programs_found}
    if missing:
        raise InputError(f"{min(missing)!r} is named twice", hint="name it once, as a file or as a Program")
    if not programs_found:
        raise InputError("no programs", expected="files, folders or Program objects")
    return programs_found, given


def _check_shared(on: Machine, other: Machine | None, programs: Iterable[Program]) -> None:
    """What all programs share, so that a mistake in it is one error. Raises `InputError`."""
    from toolpath_stiff.nc.linuxcnc.runner import find_rs274

    for program in programs:
        on.running(program, [other] if other else [])
        if program.options["interpreter"] == "linuxcnc":
            find_rs274(program.options["rs274"], program.options["unconfined"])


def _tasks(run: Run, listed: Sequence[Listed], given: dict[str, Program], example: Program) -> list[Task]:
    out, known = run.out.absolute(), _file_ids(run.rules.inputs)
    shared: dict[str, Any] = {
        "out": out,
        "shown": str(run.out),
        "machines": pickle.dumps(run.machines),
        "options": run.options,
        "saving": run.saving,
    }
    name = uuid.uuid4().hex
    tasks = []
    for one in listed:
        program = given.get(one.file) or replace(example, name=Path(one.file).name, file=one.file, text=None)
        file = program.file and str(Path(program.file).absolute())
        inputs = _inputs_in(out / one.folder, known)
        sent = replace(program, file=file, _last={})
        tasks.append(Task(sent, one, inputs=inputs, replace=run.rules.replace, run=name, **shared))
    return tasks


def _file_ids(inputs: Iterable[str | Path]) -> dict[tuple[int, int], str]:
    """Device and inode of each file that is there."""
    found = {}
    for file in map(Path, inputs):
        with suppress(OSError):
            state = file.stat()
            found[state.st_dev, state.st_ino] = str(file.absolute())
    return found


def _inputs_in(folder: Path, known: dict[tuple[int, int], str]) -> tuple[str, ...]:
    """Inputs of any program that lie in a report's folder, by that name or another: of thousands, hardly ever one."""
    try:
        there = _file_ids(folder.iterdir())
    except OSError:  # no such folder yet, the usual case
        return ()
    return tuple(known[one] for one in there if one in known)


@contextmanager
def _folders_for(out: Path, programs: Sequence[Listed]) -> Iterator[None]:
    """Make the folders above the reports, for all processes; those that stay empty are taken away at the end."""
    wanted = {out, *((out / program.folder).parent for program in programs)}
    above = {folder for place in wanted for folder in (place, *place.parents)}
    made = sorted((folder for folder in above if not folder.exists()), key=lambda folder: len(folder.parts))
    try:
        for folder in made:
            try:
                folder.mkdir(exist_ok=True)
            except OSError as error:
                raise InputError(f"cannot write to {str(folder)!r}: {error.strerror}") from None
        yield
    finally:
        for folder in reversed(made):
            with suppress(OSError):  # not empty, the usual case
                folder.rmdir()


def _outcomes(
    tasks: Sequence[Task], run: Run, executor: Executor | None, jobs: int | None, progress: Progress | None
) -> list[Outcome]:
    """What became of each program, in the order given."""
    outcomes: list[Outcome | None] = [None] * len(tasks)
    count = job_count(jobs, len(tasks))
    if progress is not None:
        progress(f"{count} at a time" if executor is None else type(executor).__name__, 0, len(tasks))
    for done, (place, outcome) in enumerate(_answers(tasks, run, executor, count), 1):
        outcomes[place] = outcome
        if progress is not None:
            progress(f"{outcome.name}{': failed' if outcome.reason else ''}", done, len(tasks))
    return [one for one in outcomes if one is not None]


def _answers(tasks: Sequence[Task], run: Run, executor: Executor | None, jobs: int) -> Iterator[tuple[int, Outcome]]:
    """Position and outcome of each task, as they come."""
    if executor is None and jobs == 1:
        for place, task in enumerate(tasks):
            yield place, analyze_task(task, run.machines)
        return
    try:
        if executor is not None:
            yield from _from_executor(tasks, executor)
        else:
            with ProcessPool(jobs) as pool:
                yield from _from_executor(tasks, pool)
    finally:  # of processes that died, wherever they were
        clear_up(task.folder for task in tasks)


def _from_executor(tasks: Sequence[Task], executor: Executor) -> Iterator[tuple[int, Outcome]]:
    # The largest first, so that no process is left alone with one at the end.
    order = sorted(range(len(tasks)), key=lambda i: -_size(tasks[i].program))
    futures = {_submit(executor, tasks[i]): i for i in order}
    suspects = []
    try:
        for future in as_completed(futures):
            place = futures[future]
            if _worker_died(future):
                suspects.append(place)
            else:
                yield place, _answer(tasks[place], future)
        # Dask gives a worker its next tasks early and, when it dies, cannot tell which of them it died of: each alone.
        for place in suspects:
            futures = {_submit(executor, tasks[place]): place}
            yield place, _answer(tasks[place], next(as_completed(futures)))
    finally:
        for future in futures:
            future.cancel()


def _worker_died(future: Future[Outcome]) -> bool:
    """Whether a Dask cluster gave a call up because its workers died; by name, as Dask need not be installed."""
    return not future.cancelled() and type(future.exception()).__name__ == "KilledWorker"


def _submit(executor: Executor, task: Task) -> Future[Outcome]:
    try:
        return executor.submit(analyze_task, task)
    except RuntimeError as error:  # it has been shut down, or it broke
        failed: Future[Outcome] = Future()
        failed.set_exception(error)
        return failed


def _size(program: Program) -> int:
    if program.file is None:
        return len(program.text or "")
    try:
        return Path(program.file).stat().st_size
    except OSError:  # it fails later, with a better message
        return 0


def _answer(task: Task, future: Future[Outcome]) -> Outcome:
    """What became of a program, also where its process gave no answer."""
    if future.cancelled():
        return _failed(task, "was cancelled: the executor was shut down, or lost its workers")
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, ProcessExpired):
        return _failed(task, death(error))
    if _worker_died(future):
        tried, last = error.args[2] + 1, error.args[1].address
        return _failed(task, f"{tried} workers died of it, the last at {last} (out of memory? their logs may say)")
    return _failed(task, f"no process could do it: {_named(error)}")


def _failed(task: Task, told: str) -> Outcome:
    """A failure: a sentence in one line that begins with the file as named; errors know its last name alone."""
    file = task.listed.file
    line = "; ".join(told.splitlines())
    line = line.replace(task.program.file or file, file).replace(str(task.out), task.shown)
    last = Path(file).name
    if line.startswith(f"{last}:"):
        line = file + line[len(last) :]
    return Outcome(task.listed.name, file, line if file in line else f"{file}: {line}")


def _named(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def analyze_task(task: Task, machines: Machines | None = None) -> Outcome:
    """Analyse a program and write its report: what an executor is handed, in whatever process."""
    if task.version != VERSION:
        return _failed(task, f"its process runs toolpath_stiff {VERSION}, the caller {task.version}")
    if not task.out.is_dir():
        return _failed(
            task, f"its process does not see {task.out}: reports need a file system that all processes share"
        )
    try:
        with _ALONE:
            on, other = machines or _unpacked(task.machines)
            found = analyze(task.program, on, compare_with=other, **task.options)
            found.save(task.folder, rules=Rules(inputs=task.inputs, replace=task.replace), **task.saving)
    except TpsError as error:
        return _failed(task, str(error))
    except MemoryError:
        return _failed(task, "out of memory; try fewer --jobs")
    except Exception as error:  # a defect of ours: it must not stop the other programs
        return _failed(task, f"{_named(error)} (a defect; analyze it alone to see where)")
    opens = "report.html" if task.saving["plots"] else "summary.json"
    report = (task.listed.folder / opens).as_posix()
    return Outcome(task.listed.name, task.listed.file, "", report, figures_of(found.to_dict()))


@lru_cache(maxsize=2)
def _unpacked(machines: bytes) -> Machines:
    """Once a process."""
    found: Machines = pickle.loads(machines)
    return found
