"""Running `rs274` in a folder of its own: no shell, no network, limits on time, memory and output.

The kernel's limits, by `prlimit`; bubblewrap makes the whole file system but that folder read-only and takes away the
network. Without it the caller must say that he knows.
"""

import re
import shutil
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from toolpath_stiff.errors import ProgramError

HOW_TO_CONFINE = (
    "install bubblewrap (Debian, Ubuntu: apt install bubblewrap), or say --unconfined (unconfined=True): "
    "rs274 may then write wherever you may"
)
HOW_TO_GET = "install LinuxCNC (Debian, Ubuntu: apt install linuxcnc-uspace), or name the program with --rs274 PATH"
PROGRAM, CANON, PARAMETERS, TOOLS, ERRORS = "program.ngc", "canon.txt", "rs274.var", "tool.tbl", "errors.txt"
LONGEST_MESSAGE = 4000
# Limits of a run: processor time, memory, and size of any file it writes.
SECONDS, MEMORY_BYTES, FILE_BYTES = 60, 1 << 30, 1 << 28
# rs274 repeats the line being read, with the copy's N word; the last line of its output names it too.
LAST_LINE = re.compile(r"^(?: *\d+ )?N(\d+)", re.MULTILINE)


@dataclass(frozen=True)
class Run:
    """Output of rs274: its canonical commands, its parameter file; why it stopped ("" at the end), and where."""

    canon: str
    parameters: str
    refusal: str = ""
    line: int | None = None


def find_rs274(path: str | None = None, unconfined: bool = False) -> str:
    """Path of the interpreter. Raises `InputError` with how to install it, or the program that is to confine it."""
    program = shutil.which(path or "rs274")
    if program is None or sys.platform != "linux":
        what = f"{path!r} is not a program that can be run" if path else "LinuxCNC's interpreter rs274 is not installed"
        raise ProgramError(what, hint=HOW_TO_GET)
    if not unconfined and _bubblewrap() is None:
        what = "bubblewrap, which keeps LinuxCNC's interpreter from all files but its own, is not there or may not work"
        raise ProgramError(what, hint=HOW_TO_CONFINE)
    return str(Path(program).resolve())


def run_rs274(program: str, parameters: str, tools: str, *, rs274: str) -> Run:
    """Run the interpreter on a program that has passed the fence. Raises `InputError` if it cannot be started."""
    with tempfile.TemporaryDirectory(prefix="tps-rs274-", ignore_cleanup_errors=True) as place:
        folder = Path(place)
        for name, text in ((PROGRAM, program), (PARAMETERS, parameters), (TOOLS, tools)):
            (folder / name).write_text(text, encoding="ascii")
        wrapper = _bubblewrap()
        sandbox = () if wrapper is None else (*wrapper, "--bind", str(folder), str(folder), "--chdir", str(folder))
        bounds = (f"--cpu={SECONDS}", f"--as={MEMORY_BYTES}", f"--fsize={FILE_BYTES}")
        command = (rs274, "-g", "-t", TOOLS, "-v", PARAMETERS, PROGRAM, CANON)
        code = _execute([*sandbox, "prlimit", *bounds, "--core=0", "--nproc=0", *command], folder)
        canon, message = _text(folder / CANON), _text(folder / ERRORS)[:LONGEST_MESSAGE]
        exceeded = _exceeded(code, len(canon))
        if exceeded:
            numbers = LAST_LINE.findall(canon[-4096:])
            return Run("", "", exceeded, (int(numbers[-1]) or None) if numbers else None)
        return Run(canon, _text(folder / PARAMETERS), *(_refusal_and_line(message) if code else ()))


def _execute(command: list[str], folder: Path) -> int:
    """Exit code, or minus the signal that ended it. Wall time is limited too: a sleeping process uses no CPU time."""
    environment = {"HOME": str(folder), "PATH": "/usr/bin:/bin", "LC_ALL": "C", "TMPDIR": str(folder)}
    with (folder / ERRORS).open("wb") as errors:
        try:
            done = subprocess.run(
                command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=errors, stderr=errors,
                start_new_session=True, timeout=2 * SECONDS + 5, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return -signal.SIGKILL
        except OSError as error:
            raise ProgramError(f"cannot run {command[0]!r}: {error.strerror}", hint=HOW_TO_GET) from None
    return done.returncode


def _exceeded(code: int, written: int) -> str:
    """Limit that an exit code stands for, "" for none; for a shell or bubblewrap 128 + n is signal n."""
    number = -code if code < 0 else code - 128
    if written >= FILE_BYTES:  # Python within rs274 ignores the signal
        limit = f"{FILE_BYTES / 1e6:.0f} MB of output"
    elif number in (signal.SIGXCPU, signal.SIGKILL):
        limit = f"{SECONDS} s of processor time"
    elif number in (signal.SIGABRT, signal.SIGSEGV, signal.SIGBUS):
        memory = MEMORY_BYTES >> 20
        return f"LinuxCNC's interpreter crashed (signal {number}; its memory is limited to {memory} MB)"
    else:
        return ""
    return f"LinuxCNC's interpreter was stopped after {limit}: an endless loop, or a program too long for it"


@cache
def _bubblewrap() -> tuple[str, ...] | None:
    """Beginning of bubblewrap's command line; None if it is missing or may not make namespaces (many containers)."""
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


def _text(path: Path) -> str:
    return path.read_text(encoding="latin-1") if path.exists() else ""


def _refusal_and_line(message: str) -> tuple[str, int | None]:
    """Message of rs274 without its chatter, and the line named at its end."""
    lines = [line.strip() for line in message.splitlines()]
    lines = [line for line in lines if line and line != "executing" and not line.startswith("link (updating")]
    number = LAST_LINE.match(lines[-1]) if len(lines) > 1 else None
    text = " ".join(lines[:-1] if number else lines) or "it stopped without a message"
    if "File ended" in text:  # it did not reach the M2 at the end of the copy
        text = "the end of an O word is missing"
    return f"LinuxCNC's interpreter refuses: {text}", int(number[1]) if number else None
