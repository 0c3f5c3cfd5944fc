"""Errors of the disk and kills at every call that changes it, one after the other, as SQLite's tests have them.

The points are found by counting: a run that is let through says how many there are.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

from toolpath_stiff import files

CALLS = ("fsync", "rename", "replace", "unlink", "mkdir", "rmdir")  # what changes a disk; a file is flushed once
ON_A_FULL_DISK = ("fsync", "mkdir")  # taking away and renaming go on
TRAILING = 5000  # more points than any run has


@contextmanager
def points(act: Callable[[int, str], None]) -> Iterator[None]:
    """Call `act` with number and name before each call that changes the disk."""
    count = 0

    def watched(name: str, real: Callable[..., object]) -> Callable[..., object]:
        def call(*args: object, **kwargs: object) -> object:
            nonlocal count
            count += 1
            act(count, name)
            return real(*args, **kwargs)

        return call

    with mock.patch.multiple(os, **{name: watched(name, getattr(os, name)) for name in CALLS}):
        yield


def count_points(run: Callable[[], object]) -> int:
    """How many there are."""
    seen: list[int] = []
    with points(lambda number, _: seen.append(number)):
        run()
    return len(seen)


def fail_at(number: int, code: int, lasting: bool) -> Callable[[int, str], None]:
    """An error of the system at a point, or (`lasting`) from there on wherever a full disk would have it."""

    def act(at: int, name: str) -> None:
        if at == number or (lasting and at > number and name in ON_A_FULL_DISK):
            raise OSError(code, os.strerror(code))

    return act


def killed(run: Callable[[], object], number: int) -> bool:
    """Run in a forked process that SIGKILL ends at a point; whether it did."""

    def act(at: int, _: str) -> None:
        if at == number:
            os.kill(os.getpid(), signal.SIGKILL)

    process = os.fork()
    if process == 0:
        try:
            with points(act):
                run()
        finally:
            os._exit(0)
    _, status = os.waitpid(process, 0)
    return os.WIFSIGNALED(status)


_heard: list[list[tuple[str, bool]]] = []  # the list of who listens now; a first, empty one stands for the hook


def _listen(event: str, args: tuple[object, ...]) -> None:
    """An audit hook, which stays for good: what is opened to be written, and whether `files` does it."""
    if len(_heard) < 2 or event != "open" or not isinstance(args[0], str | os.PathLike):
        return
    if isinstance(args[2], int) and args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
        frame, within = sys._getframe(), False
        while frame is not None and not within:
            within, frame = frame.f_code.co_filename == files.__file__, frame.f_back
        _heard[-1].append((os.path.realpath(os.fspath(args[0])), within))


@contextmanager
def all_writes_by_files(folder: Path) -> Iterator[None]:
    """Whatever is written below a folder is written by `files`, whose points the tests of faults try."""
    if not _heard:  # the hook cannot be taken away again
        sys.addaudithook(_listen)
        _heard.append([])
    opened: list[tuple[str, bool]] = []
    _heard.append(opened)
    try:
        yield
    finally:
        _heard.pop()
    assert any(within for _, within in opened)
    assert not [path for path, within in opened if not within and path.startswith(str(folder))]


FAULTS = {
    "an I/O error": (errno.EIO, False),
    "a full disk": (errno.ENOSPC, True),
    "a disk that fails for good": (errno.EIO, True),
}
