"""Work on many items in parallel processes, each item answered for, whatever becomes of the process.

`concurrent.futures` would fail every item that is left when one process dies, and cannot tell which item killed it. So
each process here has its own pipe and one item at a time: when the pipe closes, the item that it held has failed, and a
new process takes the next.

Processes are spawned, not forked: a fork copies the state of threads that linear algebra may have started, and does not
exist on Windows; and a fresh process reads the number of threads that linear algebra may use.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import connection, get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import FrameType
from typing import Generic, TypeVar

from toolpath_stiff.errors import InputError

Item = TypeVar("Item")
Answer = TypeVar("Answer")

LEAVE_SECONDS = 5.0  # for a process that is told to stop, to remove its temporary files
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def usable_cpus() -> int:
    """CPUs that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def one_thread() -> None:
    """Linear algebra on one thread, if it is not loaded yet: the processes share the CPUs, sums keep their order."""
    for name in THREADS:
        os.environ[name] = "1"


def answers(
    items: Sequence[Item],
    start: Callable[[], Callable[[Item], Answer]],
    death: Callable[[Item, int, str], Answer],
    jobs: int,
) -> Iterator[tuple[int, Answer]]:
    """Yield (position of the item, answer) as the answers come; with one job in this process.

    Parameters
    ----------
    items
        What to work on, picklable.
    start
        Called once in each process, gives the function from item to answer. Picklable: a function at the top of a
        module, or a `functools.partial` of one.
    death
        `death(item, process id, how it ended)`: the answer of an item whose process died.
    jobs
        Number of processes, at most.

    When the caller stops early (Ctrl-C, an error) the processes are told to stop and waited for.
    """
    if jobs == 1 or len(items) <= 1:
        work = start()
        for place, item in enumerate(items):
            yield place, work(item)
        return
    waiting = deque(enumerate(items))
    busy: list[_Worker[Item, Answer]] = []
    try:
        for _ in range(min(jobs, len(items))):
            busy.append(_Worker(start))
            busy[-1].take(*waiting.popleft())
        while busy:
            ready = connection.wait([worker.pipe for worker in busy])
            for worker in [worker for worker in busy if worker.pipe in ready]:
                try:
                    answer, alive = worker.pipe.recv(), True
                except (EOFError, OSError):  # closed, or in the middle of an answer
                    answer, alive = death(worker.item, worker.process.pid or 0, worker.end()), False
                yield worker.place, answer
                if alive and waiting:
                    worker.take(*waiting.popleft())
                    continue
                busy.remove(worker)
                worker.dismiss()
                if not alive and waiting:
                    busy.append(_Worker(start))
                    busy[-1].take(*waiting.popleft())
    finally:
        _stop(busy)


class _Worker(Generic[Item, Answer]):
    """A process, our end of its pipe, and the item that it has."""

    def __init__(self, start: Callable[[], Callable[[Item], Answer]]) -> None:
        context = get_context("spawn")
        self.pipe: Connection
        self.pipe, its_end = context.Pipe()
        # daemon: should we end without asking it to, it ends too.
        self.process: BaseProcess = context.Process(target=_serve, args=(its_end, start), daemon=True)
        with _deaf():
            self.process.start()
        its_end.close()  # ours is the only other end: it closes when the process ends

    def take(self, place: int, item: Item) -> None:
        self.place, self.item = place, item
        with suppress(OSError):  # it has died already; its pipe will say so
            self.pipe.send(item)

    def dismiss(self) -> None:
        """There is no more to do: the closed pipe says so."""
        self.pipe.close()
        self.process.join(LEAVE_SECONDS)

    def end(self) -> str:
        """How the process ended."""
        self.process.join(LEAVE_SECONDS)
        if self.process.is_alive():  # it has closed the pipe, and can answer no more
            self.process.kill()
            self.process.join()
        code = self.process.exitcode
        if code is not None and code < 0:
            try:
                name = signal.Signals(-code).name
            except ValueError:
                name = f"signal {-code}"
            return f"its process was ended by {name}" + (" (out of memory?)" if name == "SIGKILL" else "")
        return f"its process ended by itself, exit code {code}"


def _stop(busy: Sequence[_Worker[Item, Answer]]) -> None:
    for worker in busy:
        worker.process.terminate()
    deadline = time.monotonic() + LEAVE_SECONDS
    for worker in busy:
        worker.process.join(max(0.0, deadline - time.monotonic()))
        if worker.process.is_alive():
            worker.process.kill()


def _serve(pipe: Connection, start: Callable[[], Callable[[Item], Answer]]) -> None:
    """The life of a process: items in, answers out, until the pipe closes or a signal says to stop."""
    one_thread()
    # Ctrl-C reaches all processes of a terminal; the first one tells the others, once.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _interrupt)
    with suppress(EOFError, BrokenPipeError, KeyboardInterrupt):
        work = start()
        while True:
            pipe.send(work(pipe.recv()))


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Stop as at Ctrl-C: what is half-written is removed on the way out."""
    raise KeyboardInterrupt


@contextmanager
def _deaf() -> Iterator[None]:
    """Ctrl-C is ignored, here and in a process that is started, until that one has its own handler."""
    if threading.current_thread() is not threading.main_thread():  # only the main thread may set handlers
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def job_count(asked: int | None, items: int) -> int:
    """Processes for so many items: as asked, else one a CPU. Raises `InputError` for fewer than one."""
    if asked is not None and asked < 1:
        raise InputError(f"--jobs {asked}", expected="1 or more")
    return max(1, min(asked or usable_cpus(), items))
