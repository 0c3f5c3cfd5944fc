"""Running `rs274` in a folder of its own: no shell, no network, limits on time, memory and output.

Limits on time, memory and file size by the kernel, and no process beside it (`limiter`); bubblewrap makes the whole
file system but that folder read-only and takes away the network. Without it the caller must say that he knows.
"""

from __future__ import annotations

import contextlib
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from toolpath_stiff.errors import ProgramError, TpsError

HOW_TO_CONFINE = (
    "install bubblewrap (Debian, Ubuntu: apt install bubblewrap), or say --unconfined (unconfined=True): "
    "rs274 may then write wherever you may"
)
HOW_TO_GET = "install LinuxCNC (Debian, Ubuntu: apt install linuxcnc-uspace), or name the program with --rs274 PATH"
PROGRAM, CANON, PARAMETERS, TOOLS, ERRORS = "program.ngc", "canon.txt", "rs274.var", "tool.tbl", "errors.txt"
LONGEST_MESSAGE = 4000
LIMITER = Path(__file__).with_name("limiter.py").resolve()


@dataclass(frozen=True)
class RunLimits:
    """Limits of a run: processor time, memory, and size of any file it writes."""

    seconds: int = 60
    memory_bytes: int = 1 << 30
    file_bytes: int = 1 << 28


class StoppedError(TpsError):
    """A run that exceeded a limit; `line` is the last one that made rs274 print something, None if none did."""

    def __init__(self, message: str, line: int | None) -> None:
        super().__init__(message)
        self.line = line


@dataclass(frozen=True)
class Run:
    """Output of rs274: its canonical commands, its message ("" if it went well), its parameter file."""

    canon: str
    message: str
    parameters: str


def find_rs274(path: str | None = None, unconfined: bool = False) -> str:
    """The interpreter's path. Raises `InputError` with how to get it, or what is to confine it."""
    program = shutil.which(path or "rs274")
    if program is None:
        what = f"{path!r} is not a program that can be run" if path else "LinuxCNC's interpreter rs274 is not installed"
        raise ProgramError(what, hint=HOW_TO_GET)
    if not unconfined and _bubblewrap() is None:
        what = "bubblewrap, which keeps LinuxCNC's interpreter from all files but its own, is not there or may not work"
        raise ProgramError(what, hint=HOW_TO_CONFINE)
    return str(Path(program).resolve())


def run_rs274(program: str, parameters: str, tools: str, *, rs274: str, limits: RunLimits | None = None) -> Run:
    """Run the interpreter on a program that has passed the fence.

    Raises
    ------
    StoppedError
        It exceeded a limit.
    InputError
        It could not be started.
    """
    if sys.platform == "win32":
        raise TpsError("LinuxCNC's interpreter runs on Linux only")
    limits = limits or RunLimits()
    with tempfile.TemporaryDirectory(prefix="tps-linuxcnc-", ignore_cleanup_errors=True) as place:
        folder = Path(place)
        (folder / PROGRAM).write_text(program, encoding="ascii")
        (folder / PARAMETERS).write_text(parameters, encoding="ascii")
        (folder / TOOLS).write_text(tools, encoding="ascii")
        wrapper = _bubblewrap()
        sandbox = () if wrapper is None else (*wrapper, "--bind", str(folder), str(folder), "--chdir", str(folder))
        # A small Python that limits itself and becomes what follows. Setting the limits between fork and exec of this
        # process would not be safe where it has threads; and bubblewrap, which goes before, starts a process.
        values = (str(value) for value in (limits.seconds, limits.memory_bytes, limits.file_bytes))
        limiter = (sys.executable, "-I", "-S", str(LIMITER), *values)
        command = (rs274, "-g", "-t", TOOLS, "-v", PARAMETERS, PROGRAM, CANON)
        code = _execute([*sandbox, *limiter, *command], folder, limits)
        message = _text(folder / ERRORS, LONGEST_MESSAGE)
        over = _exceeded(code, limits)
        if over:
            raise StoppedError(over, _last_line(folder / CANON))
        return Run(_text(folder / CANON), message if code else "", _text(folder / PARAMETERS))


def _execute(command: list[str], folder: Path, limits: RunLimits) -> int:
    """Exit code, -9 if it had to be stopped by the clock."""
    environment = {"HOME": str(folder), "PATH": "/usr/bin:/bin", "LC_ALL": "C", "TMPDIR": str(folder)}
    with (folder / ERRORS).open("wb") as errors:
        try:
            process = subprocess.Popen(
                command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=errors, stderr=errors,
                start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            raise ProgramError(f"cannot run {command[0]!r}: {error.strerror}", hint=HOW_TO_GET) from None
        try:
            return _wait(process, folder, limits)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _wait(process: subprocess.Popen[bytes], folder: Path, limits: RunLimits) -> int:
    """Exit code, or the signal in its place: Python within rs274 ignores the one for large files."""
    # A process that sleeps uses no processor time: the clock ends it too.
    end = time.monotonic() + 2 * limits.seconds + 5
    pause = 0.01
    while time.monotonic() < end:
        if _ended(process, pause):
            return process.wait()
        pause = min(2 * pause, 0.25)
        if any(path.stat().st_size >= limits.file_bytes for path in (folder / CANON, folder / ERRORS) if path.exists()):
            return -signal.SIGXFSZ
    return -signal.SIGKILL


def _ended(process: subprocess.Popen[bytes], seconds: float) -> bool:
    """True if it ends within a time: at once when it does, where the kernel tells (`wait` looks every so often)."""
    try:
        handle = os.pidfd_open(process.pid)
    except (AttributeError, OSError):  # Linux before 5.3, or not Linux
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=seconds)
        return process.returncode is not None
    try:
        ends = select.poll()  # `select` takes no handle above 1023
        ends.register(handle, select.POLLIN)
        return bool(ends.poll(1e3 * seconds))
    finally:
        os.close(handle)


def _exceeded(code: int, limits: RunLimits) -> str:
    """The limit that an exit code stands for; a shell's or bubblewrap's 128 + n is signal n."""
    number = -code if code < 0 else code - 128
    limit: dict[int, str] = {signal.SIGXFSZ: f"{limits.file_bytes / 1e6:.0f} MB of output"}
    limit |= dict.fromkeys((signal.SIGXCPU, signal.SIGKILL), f"{limits.seconds} s of processor time")
    if number in limit:
        end = "an endless loop, or a program too long for it"
        return f"LinuxCNC's interpreter was stopped after {limit[number]}: {end}"
    if number in (signal.SIGABRT, signal.SIGSEGV, signal.SIGBUS):
        memory = limits.memory_bytes >> 20
        return f"LinuxCNC's interpreter crashed (signal {number}; its memory is limited to {memory} MB)"
    return ""


@cache
def _bubblewrap() -> tuple[str, ...] | None:
    """Its command line so far; None where it is missing or may not make name spaces (many containers)."""
    path = shutil.which("bwrap")
    if path is None:
        return None
    read_only = ("--ro-bind", "/", "/", "--dev", "/dev", "--proc", "/proc", "--tmpfs", "/run")
    wrapper = (path, *read_only, "--unshare-all", "--new-session", "--die-with-parent")
    try:
        tried = subprocess.run([*wrapper, "/bin/true"], capture_output=True, check=False, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return wrapper if tried.returncode == 0 else None


def _text(path: Path, most: int | None = None) -> str:
    try:
        with path.open(encoding="latin-1") as stream:
            return stream.read() if most is None else stream.read(most)
    except FileNotFoundError:
        return ""


def _last_line(path: Path) -> int | None:
    """Our number of the last line that shows in the canonical commands."""
    try:
        with path.open("rb") as stream:
            stream.seek(max(0, path.stat().st_size - 4096))
            numbers = re.findall(rb"^ *\d+ N(\d+)", stream.read(), re.MULTILINE)
    except FileNotFoundError:
        return None
    return (int(numbers[-1]) or None) if numbers else None


def message_and_line(message: str) -> tuple[str, int | None]:
    """The message of rs274, and the line: it repeats the line that it was reading, with the copy's N word."""
    lines = [line.strip() for line in message.splitlines()]
    lines = [line for line in lines if line and line != "executing" and not line.startswith("link (updating")]
    if not lines:
        return "", None
    number = re.match(r"N(\d+)", lines[-1])
    if number and len(lines) > 1:
        return " ".join(lines[:-1]), int(number[1])
    return " ".join(lines[:-1] or lines), None
