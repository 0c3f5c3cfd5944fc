"""A pool of processes as an executor of `concurrent.futures`; a process that dies fails its own call alone.

Why not `concurrent.futures.ProcessPoolExecutor`: when one of its processes dies, every call that is left fails with
`BrokenProcessPool`, and nothing says which call it was that killed the process. Here each process has its own pipe and
one call at a time: when the pipe closes, the call that it held has failed, and a new process takes the next.

Processes are spawned, not forked: a fork copies the state of threads that linear algebra may have started, and does not
exist on Windows; and a fresh process reads the number of threads that linear algebra may use.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import connection, get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any, ParamSpec, TypeVar

from toolpath_stiff.defaults import THREADS, one_thread

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")

LEAVE_SECONDS = 5.0  # for a process that is told to stop, to remove its temporary files
BLOCKED = [getattr(signal, name) for name in ("SIGINT", "SIGHUP", "SIGTERM") if hasattr(signal, name)]
_ONE_BY_ONE = threading.Lock()  # processes are started and reaped by one thread at a time


class ProcessDied(RuntimeError):
    """The process that held a call ended before it answered; the text says how.

    Attributes
    ----------
    process
        Its process id, for what it left behind.
    """

    def __init__(self, how: str, process: int) -> None:
        super().__init__(how)
        self.process = process


class ProcessPool(Executor):
    """Calls in other processes, each with one call at a time and one thread of linear algebra.

    A process that dies fails the future of its own call with `ProcessDied`, and a new process takes the next call. Left
    by an exception (Ctrl-C, say), the `with` block tells the processes to stop and waits for them; what they were
    writing is removed.

    Parameters
    ----------
    jobs
        Number of processes, at most: they are started as calls come.
    """

    def __init__(self, jobs: int) -> None:
        # Each thread has a process, and waits for its answer.
        self._threads = ThreadPoolExecutor(jobs, thread_name_prefix="tps-process")
        self._own = threading.local()
        self._processes: set[_Process] = set()
        self._stopped = False

    def submit(
        self, fn: Callable[Arguments, Answer], /, *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Future[Answer]:
        """The future of a call: of a function at the top of a module, with arguments that can be pickled."""
        return self._threads.submit(self._call, fn, args, kwargs)

    def _call(self, *call: Any) -> Any:
        """Runs in a thread of the pool."""
        process = self._process()
        try:
            return process.call(call)
        except ProcessDied:
            self._own.process = None
            with _ONE_BY_ONE:
                self._processes.discard(process)
            raise

    def _process(self) -> _Process:
        """The process of this thread."""
        found: _Process | None = getattr(self._own, "process", None)
        if found is None:
            with _ONE_BY_ONE:
                if self._stopped:
                    raise CancelledError
                found = self._own.process = _Process()
                self._processes.add(found)
        return found

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls, let those that are left be answered (or cancel them), then end the processes."""
        self._threads.shutdown(wait=wait, cancel_futures=cancel_futures)
        if wait:
            self._end_processes()
        else:
            threading.Thread(target=self.shutdown, daemon=True).start()

    def stop(self) -> None:
        """End the processes at once, whatever they do; calls that are left are cancelled."""
        with _ONE_BY_ONE:
            self._stopped = True
            busy = list(self._processes)
        self._threads.shutdown(wait=False, cancel_futures=True)
        for process in busy:
            process.terminate()
        self._threads.shutdown(wait=True)
        self._end_processes()

    def _end_processes(self) -> None:
        deadline = time.monotonic() + LEAVE_SECONDS
        while self._processes:
            self._processes.pop().dismiss(deadline)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if kind is None:
            self.shutdown()
        else:
            self.stop()


class _Process:
    """A process and our end of its pipe."""

    def __init__(self) -> None:
        """Start it; the caller holds `_ONE_BY_ONE`."""
        context = get_context("spawn")
        self.pipe: Connection
        self.pipe, its_end = context.Pipe()
        # daemon: should we end without asking it to, it ends too.
        self.process: BaseProcess = context.Process(target=_serve, args=(its_end,), daemon=True)
        with _surroundings():
            self.process.start()
        its_end.close()  # ours is the only other end: it closes when the process ends

    def call(self, call: tuple[Any, ...]) -> Any:
        """The answer of a call (function, arguments, keywords). Raises what it raises, or `ProcessDied`."""
        message = pickle.dumps(call)
        with suppress(OSError):  # it has died already; its pipe will say so
            self.pipe.send_bytes(message)
        try:
            answer = self.pipe.recv_bytes()
        except (EOFError, OSError):  # closed, or in the middle of an answer
            raise ProcessDied(self.end(), self.process.pid or 0) from None
        value, error = pickle.loads(answer)
        if error is not None:
            raise error
        return value

    def terminate(self) -> None:
        """Tell it to stop."""
        with _ONE_BY_ONE:
            self.process.terminate()

    def dismiss(self, deadline: float) -> None:
        """There is no more to do: the closed pipe says so."""
        self.pipe.close()
        self._gone(max(0.0, deadline - time.monotonic()))

    def end(self) -> str:
        """How the process ended."""
        code = self._gone(LEAVE_SECONDS)  # it has closed the pipe, and can answer no more
        self.pipe.close()
        if code is not None and code < 0:
            try:
                name = signal.Signals(-code).name
            except ValueError:
                name = f"signal {-code}"
            return f"its process was ended by {name}" + (" (out of memory?)" if name == "SIGKILL" else "")
        return f"its process ended by itself, exit code {code}"

    def _gone(self, seconds: float) -> int | None:
        """Wait for its end, make it end thereafter; its exit code."""
        connection.wait([self.process.sentinel], seconds)
        with _ONE_BY_ONE:
            if self.process.is_alive():
                self.process.kill()
            self.process.join()
            return self.process.exitcode


def _serve(pipe: Connection) -> None:
    """The life of a process: calls in, answers out, until the pipe closes or a signal says to stop."""
    # Ctrl-C reaches all processes of a terminal; the first one tells the others, once.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "SIGHUP"):  # so does the end of the terminal
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with suppress(EOFError, BrokenPipeError, ConnectionResetError, KeyboardInterrupt):
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # what is half-written is removed on the way out
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_UNBLOCK, BLOCKED)
        threading.Thread(target=_end_with_the_first, daemon=True).start()
        while True:
            pipe.send_bytes(_answer(pipe.recv_bytes()))


def _answer(message: bytes) -> bytes:
    """What a call gives or raises, pickled."""
    try:
        function, arguments, keywords = pickle.loads(message)
        return pickle.dumps((function(*arguments, **keywords), None))
    except Exception as error:
        error.add_note(f"in another process:\n{traceback.format_exc()}")
        try:
            answer = pickle.dumps((None, error))
            pickle.loads(answer)
        except Exception:  # an exception that cannot travel
            return pickle.dumps((None, RuntimeError(f"{type(error).__name__}: {error}")))
        return answer


def _end_with_the_first() -> None:
    """Stop when the process that hands out the calls is gone, however it ended: nobody wants the answer."""
    first = parent_process()
    if first is not None:
        connection.wait([first.sentinel])
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(LEAVE_SECONDS)
        os._exit(1)  # a long call in a library sees no signal


@contextmanager
def _surroundings() -> Iterator[None]:
    """What a process starts with: signals wait until it has its own handlers; one thread for linear algebra."""
    before = {name: os.environ.get(name) for name in THREADS}
    one_thread()
    mask = None
    if hasattr(signal, "pthread_sigmask"):
        resource_tracker.ensure_running()  # started together with the process it would lift the mask
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, BLOCKED)
    try:
        yield
    finally:
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
