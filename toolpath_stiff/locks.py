"""Who writes where: what is written is locked by its process, and the lock ends with the process however that ends.

A temporary file or folder that nobody holds was left by a run that was killed, and the next run takes it away.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from toolpath_stiff.errors import FileError

if sys.platform != "win32":  # nothing is locked there, and what a killed run leaves stays
    import fcntl

WAIT_SECONDS = 10.0  # for another run that writes to the same place
LONGEST_NAME = 60  # letters of a target in the name of what lies beside it: names may have 255 bytes


def reason(error: OSError) -> str:
    """What an error of the system says."""
    return error.strerror or str(error) or type(error).__name__


@contextmanager
def writing_errors(path: str | Path, what: str = "write") -> Iterator[None]:
    """An error of the system becomes an `InputError`."""
    try:
        yield
    except OSError as error:
        raise FileError(f"cannot {what} {str(path)!r}: {reason(error)}") from None


def beside(target: Path, what: str) -> Path:
    """The name beside a file or folder of what belongs to it while it is written."""
    name = target.name
    if len(name) > LONGEST_NAME:  # the letters of a name are up to four bytes
        digest = hashlib.sha256(os.fsencode(name)).hexdigest()[:16]
        name = f"{name[:LONGEST_NAME]}-{digest}"
    return target.with_name(f".{name}.tps-{what}")


def hold(handle: int) -> bool:
    """Lock an open file or folder until it is closed, or its process ends; False where another holds it.

    True as well where the file system knows no locks: nobody is kept out there.
    """
    if sys.platform == "win32":
        return True
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return not isinstance(error, BlockingIOError | PermissionError)
    return True


def is_left(path: Path) -> bool:
    """Whether something that is locked while it is used is there and not locked: its process was killed."""
    if sys.platform == "win32":
        return False
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:  # held, or no locks here: nobody can tell
        return False
    finally:
        os.close(handle)
    return True


def is_at(path: Path, handle: int) -> bool:
    """True where this open file is still the one of that name."""
    try:
        return os.path.samestat(path.stat(), os.fstat(handle))
    except OSError:
        return False


@contextmanager
def locked(lock: Path, what: str, wait: float | None = None) -> Iterator[None]:
    """Hold a lock file, which says who does: process, host, command.

    Parameters
    ----------
    lock
        Its name; made, and removed at the end.
    what
        What is written under it, for the message.
    wait
        Seconds to wait for another run, `WAIT_SECONDS` unless given.

    Raises
    ------
    InputError
        Another run holds it; the message names that run.
    """
    end = time.monotonic() + (WAIT_SECONDS if wait is None else wait)
    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
        if hold(handle) and is_at(lock, handle):
            break
        holder = _holder(handle)
        os.close(handle)
        if holder and time.monotonic() > end:
            raise FileError(f"{what} is being written by {holder}", hint="wait for it, or choose another folder")
        time.sleep(0.02)
    try:
        command = shlex.join([Path(sys.argv[0] or "python").name, *sys.argv[1:]])[:500]
        record = {"process": os.getpid(), "host": platform.node(), "command": command}
        os.ftruncate(handle, 0)
        os.write(handle, (json.dumps(record) + "\n").encode())
        yield
    finally:
        with suppress(OSError):
            lock.unlink()
        os.close(handle)


def _holder(handle: int) -> str:
    """Who wrote a lock file."""
    try:
        holder = json.loads(os.read(handle, 4096))
        return f"another run: {holder['command']} (process {holder['process']} on {holder['host']})"
    except (OSError, ValueError, KeyError, TypeError, RecursionError):  # it has not written its name yet
        return "another run"


_JOURNALS: dict[Path, int] = {}  # those that this process holds


def announce(journal: Path, name: str) -> None:
    """Note in a journal that something is about to be written; held until `forget`, or its process ends.

    Raises `InputError`.
    """
    with writing_errors(journal):
        handle = _JOURNALS.get(journal)
        if handle is None or not is_at(journal, handle):
            journal.parent.mkdir(parents=True, exist_ok=True)
            handle = _JOURNALS[journal] = os.open(journal, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
            hold(handle)
        os.write(handle, f"{name}\n".encode())
        os.fsync(handle)


def forget(journal: Path) -> None:
    """Take a journal away: what it announced is there."""
    journal.unlink(missing_ok=True)
    handle = _JOURNALS.pop(journal, None)
    if handle is not None:
        os.close(handle)


@contextmanager
def temporary_folder(prefix: str) -> Iterator[Path]:
    """A new folder among the system's temporary ones, removed at the end; those of killed runs are removed as well."""
    place = Path(tempfile.gettempdir())
    for left in place.glob(f"{prefix}*"):
        if left.is_dir() and not left.is_symlink() and is_left(left):
            shutil.rmtree(left, ignore_errors=True)
    while True:
        folder = Path(tempfile.mkdtemp(prefix=prefix, dir=place))
        try:
            handle = os.open(folder, os.O_RDONLY) if sys.platform != "win32" else None
        except FileNotFoundError:  # another run took it for a killed one's before it was held
            continue
        if handle is None or (hold(handle) and is_at(folder, handle)):
            break
        os.close(handle)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if handle is not None:
            os.close(handle)


def remove_parts(prefix: Path) -> None:
    """Take away what killed runs left of files that they wrote: `beside(file, "part-")` and more letters."""
    for left in prefix.parent.iterdir():
        if left.name.startswith(prefix.name) and is_left(left):
            with suppress(OSError):
                left.unlink()
