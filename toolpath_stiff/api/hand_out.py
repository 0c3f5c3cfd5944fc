"""Programs handed to processes, or to any executor; what became of each, also where its process gave no answer."""

import pickle
import threading
import uuid
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future, as_completed
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from pebble import ProcessExpired

from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.programs import analyze
from toolpath_stiff.defaults import VERSION
from toolpath_stiff.errors import TpsError
from toolpath_stiff.nc.program import Program
from toolpath_stiff.processes import ProcessPool, death
from toolpath_stiff.report.batch.outcomes import ProgramOutcome, figures_of
from toolpath_stiff.report.batch.programs import Listed
from toolpath_stiff.results_folder import Rules

_ALONE = threading.Lock()  # a process analyzes one program at a time, however many threads an executor has


@dataclass(frozen=True)
class BatchRun:
    """What all programs share: small and picklable.

    Attributes
    ----------
    out, shown
        The folder of all reports, absolute, and as the caller named it.
    machines
        The machine and the one to compare with, pickled: a process unpacks them once.
    options
        Of `analyze`.
    saved, replace
        Of `Analysis.save`: plots, table, show_plunges; and whether what is in the way is kept beside.
    version, name
        Of the package; a name that no other run has, for executors that know a call again by its arguments.
    """

    out: Path
    shown: str
    machines: bytes
    options: dict[str, Any]
    saved: dict[str, Any]
    replace: bool
    version: str = VERSION
    name: str = field(default_factory=lambda: uuid.uuid4().hex)


@dataclass(frozen=True)
class Task:
    """One program: what is read (paths absolute), its name and report's folder, what else the run reads, the run."""

    program: Program
    listed: Listed
    inputs: tuple[str, ...]
    run: BatchRun

    @property
    def folder(self) -> Path:
        """The folder of its report."""
        return self.run.out / self.listed.folder

    def failed(self, reason: str) -> ProgramOutcome:
        """A failure: a sentence in one line that begins with the file as named; errors know its last name alone."""
        file, line = self.listed.file, "; ".join(reason.splitlines())
        line = line.replace(self.program.file or file, file).replace(str(self.run.out), self.run.shown)
        last = f"{Path(file).name}:"
        line = f"{file}:{line.removeprefix(last)}" if line.startswith(last) else line
        return ProgramOutcome(self.listed.name, file, line if file in line else f"{file}: {line}")


def answers(tasks: Sequence[Task], executor: Executor | None, jobs: int) -> Iterator[tuple[int, ProgramOutcome]]:
    """Position and outcome of each task, as they come; of no executor, from so many processes, one being this one."""
    if executor is None and jobs == 1:
        yield from enumerate(map(analyze_task, tasks))
    elif executor is not None:
        yield from _from_executor(tasks, executor)
    else:
        with ProcessPool(jobs) as pool:
            yield from _from_executor(tasks, pool)


def _from_executor(tasks: Sequence[Task], executor: Executor) -> Iterator[tuple[int, ProgramOutcome]]:
    # The largest first, so that no process is left alone with one at the end.
    order = sorted(range(len(tasks)), key=lambda i: -_size(tasks[i].program))
    futures = {executor.submit(analyze_task, tasks[i]): i for i in order}
    suspects = []
    try:
        for future in as_completed(futures):
            if _worker_died(future):
                suspects.append(futures[future])
            else:
                yield futures[future], _answer(tasks[futures[future]], future)
        # Dask gives a worker its next tasks early and, when it dies, cannot tell which of them it died of: each alone.
        for place in suspects:
            future = executor.submit(analyze_task, tasks[place])
            futures[future] = place
            yield place, _answer(tasks[place], next(as_completed([future])))
    finally:
        for future in futures:
            future.cancel()


def _worker_died(future: Future[ProgramOutcome]) -> bool:
    """True where a Dask cluster gave a call up because its workers died; by name, as Dask need not be installed."""
    return not future.cancelled() and type(future.exception()).__name__ == "KilledWorker"


def _size(program: Program) -> int:
    try:
        return len(program.text or "") if program.file is None else Path(program.file).stat().st_size
    except OSError:  # it fails later, with a better message
        return 0


def _answer(task: Task, future: Future[ProgramOutcome]) -> ProgramOutcome:
    """What became of a program, also where its process gave no answer."""
    if future.cancelled():
        return task.failed("was cancelled: the executor was shut down, or lost its workers")
    error: Any = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, ProcessExpired):
        return task.failed(death(error))
    if _worker_died(future):
        count, last = error.args[2] + 1, error.args[1].address
        return task.failed(f"{count} workers died of it, the last at {last} (out of memory? their logs may say)")
    return task.failed(f"no process could do it: {_named(error)}")


def _named(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def analyze_task(task: Task) -> ProgramOutcome:
    """Analyse a program and write its report: what an executor is handed, in whatever process."""
    run, listed = task.run, task.listed
    if run.version != VERSION:
        return task.failed(f"its process runs toolpath_stiff {VERSION}, the caller {run.version}")
    if not run.out.is_dir():
        return task.failed(f"its process does not see {run.out}: reports need a file system that all processes share")
    try:
        with _ALONE:
            machine, other = _unpacked(run.machines)
            analysis = analyze(task.program, machine, compare_with=other, **run.options)
            rules = Rules(inputs=task.inputs, replace=run.replace)
            analysis.save(task.folder, rules=rules, **run.saved)
    except TpsError as error:
        return task.failed(str(error))
    except MemoryError:
        return task.failed("out of memory; try fewer --jobs")
    except Exception as error:  # a defect of ours: it must not stop the other programs
        return task.failed(f"{_named(error)} (a defect; analyze it alone to see where)")
    report = (listed.folder / ("report.html" if run.saved["plots"] else "summary.json")).as_posix()
    return ProgramOutcome(listed.name, listed.file, "", report, figures_of(analysis.to_dict()))


@lru_cache(maxsize=2)
def _unpacked(machines: bytes) -> tuple[Machine, Machine | None]:
    """Once a process."""
    unpacked: tuple[Machine, Machine | None] = pickle.loads(machines)
    return unpacked
