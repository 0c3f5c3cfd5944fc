"""A pool of processes as an executor of `concurrent.futures`; a process that dies fails its own call alone.

Why not `concurrent.futures.ProcessPoolExecutor`: when one of its processes dies, every call that is left fails with
`BrokenProcessPool`, and nothing says which call it was that killed the process. The pool is that of `pebble`.

Processes are spawned, not forked: a fork copies the state of threads that linear algebra may have started, and does not
exist on Windows; and a fresh process reads the number of threads that linear algebra may use.
"""

import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from multiprocessing import connection, get_context, parent_process, resource_tracker
from typing import Any, ParamSpec, TypeVar

import pebble

from toolpath_stiff.defaults import THREADS

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")

LEAVE_SECONDS = 5.0  # for a process that is told to stop, to remove its temporary files
BLOCKED = [getattr(signal, name) for name in ("SIGINT", "SIGHUP", "SIGTERM") if hasattr(signal, name)]

_living: set[Executor] = set()  # pools: while there are any, the environment, which processes take over, has 1 thread
_before: dict[str, str | None] = {}  # the caller's own settings of threads, for after the last of them


class ProcessPool(Executor):
    """Calls in other processes, each with one call at a time and one thread of linear algebra.

    A process that dies fails the future of its own call with `pebble.ProcessExpired`, and a new process takes the next
    call. Left by an exception (Ctrl-C, say), the `with` block tells the processes to stop and waits for them; what they
    were writing is removed.

    Parameters
    ----------
    jobs
        Number of processes.
    """

    def __init__(self, jobs: int) -> None:
        self._pool: Any = pebble.ProcessPool(jobs, initializer=_prepare, context=get_context("spawn"))
        self._calls: list[Future[Any]] = []
        _before.update({} if _living else {name: os.environ.get(name) for name in THREADS})
        _living.add(self)
        os.environ.update(dict.fromkeys(THREADS, "1"))
        with _signals_blocked():  # in the pool's threads and in the processes that they start
            if not self._pool.active:
                raise RuntimeError("the processes cannot be started")

    def submit(
        self, fn: Callable[Arguments, Answer], /, *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Future[Answer]:
        """Future of a call; the function must be at the top level of a module, and its arguments picklable."""
        call: Future[Answer] = self._pool.schedule(_answer, (fn, args, kwargs))
        self._calls.append(call)
        return call

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls, let the remaining ones finish (or cancel them), then end the processes."""
        self._pool.close()
        self._leave([call for call in self._calls if cancel_futures and not call.running()])

    def stop(self) -> None:
        """End the processes at once, whatever they are doing; remaining calls are cancelled."""
        self._pool.stop()
        self._leave(self._calls)

    def _leave(self, cancelled: Sequence[Future[Any]]) -> None:
        for call in cancelled:
            call.cancel()
        self._pool.join()
        _living.discard(self)
        while _before and not _living:
            name, setting = _before.popitem()
            os.environ.pop(name, None)
            os.environ.update({} if setting is None else {name: setting})

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        (self.shutdown if kind is None else self.stop)()


def death(error: pebble.ProcessExpired) -> str:
    """Reason why the process of a call ended, for a message."""
    if error.exitcode >= 0:
        return f"its process ended by itself, exit code {error.exitcode}"
    name = signal.Signals(-error.exitcode).name
    return f"its process was ended by {name}" + (" (out of memory?)" if name == "SIGKILL" else "")


def _prepare() -> None:
    """Set up a new process: the signals that end it, and that it ends with the process that started it."""
    # Ctrl-C reaches all processes of a terminal, and so does its end; the first one tells the others, once.
    for ignored in BLOCKED[:-1]:  # all but SIGTERM
        signal.signal(ignored, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # what is half-written is removed on the way out
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, BLOCKED)
    threading.Thread(target=_end_with_the_first, daemon=True).start()


def _answer(function: Callable[..., Answer], arguments: Sequence[Any], keywords: Mapping[str, Any]) -> Answer:
    """Result of a call, or its exception if that can be pickled; a call that exits ends its process."""
    try:
        return function(*arguments, **keywords)
    except (SystemExit, KeyboardInterrupt) as end:
        os._exit(end.code if isinstance(end, SystemExit) and isinstance(end.code, int) else 1)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            raise RuntimeError(f"{type(error).__name__}: {error}") from None
        raise


def _end_with_the_first() -> None:
    """Stop when the process that hands out the calls is gone, however it ended: nobody wants the result."""
    first = parent_process()
    if first is not None:
        connection.wait([first.sentinel])
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(LEAVE_SECONDS)
        os._exit(1)  # a long call in a library would not notice a signal


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Hold signals back, also in a process started meanwhile, until that has installed its own handlers."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # started together with the process it would lift the mask
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, BLOCKED)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
