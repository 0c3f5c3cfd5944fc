"""The entry point: commands are listed here and imported when they are asked for, as `tps --help` loads no numpy."""

from __future__ import annotations

import difflib
import importlib
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, TextIO, cast

from toolpath_stiff.defaults import THREADS, VERSION
from toolpath_stiff.errors import FileError, InputError, TpsError, harmless

if TYPE_CHECKING:
    from toolpath_stiff.cli.parser import Command

# Module -> its commands, each with its line in the help.
GROUPS = {
    "program": {
        "analyze": "stiffness along the path of NC programs: samples, summary, pictures, page",
        "path": "the sampled path alone, without a machine",
        "check": "what a program uses, what is not understood, extents, times, reach",
    },
    "machine": {
        "pose": "stiffness, softest and stiffest direction, strut lengths at single poses",
        "map": "stiffness over planes of the workspace: picture, table, 3-D page",
        "machine": "list, show, check, make and import machine files",
    },
    "placement": {
        "place": "where the work should sit: Pareto front and one recommended placement",
        "case-study": "the paper's four regions: one path at two heights, displaced and turned",
    },
    "measurements": {
        "reduce": "raw force and displacement records to measured stiffnesses, lost motion, loops",
        "compare": "where the model fails: errors, structure in the residuals, pictures, page",
        "diagnose": "which physical effect the model lacks, if any: verdict, candidates, confounding",
        "update": "fit effects to measurements, see how far the error falls, write the machine file",
        "plan": "what to measure next to tell explanations apart, or a first campaign",
    },
    "effects": {"effects": "physical effects that a machine can carry; write your own"},
    "rig": {"rig": "blind exercises: measurements of a simulated machine that hides an effect"},
    "studio": {"studio": "measure, see where the model fails, add what is missing: a case in the browser"},
}
COMMANDS = {name: module for module, commands in GROUPS.items() for name in commands}

DESCRIPTION = "Stiffness of a hexapod (Stewart-platform) mill along a real NC program."
EPILOG = """\
examples:
  tps analyze part.nc                      stiffness along the path: reports/part/report.html
  tps analyze part.nc --origin 100,-50,900 with program zero at another place
  tps pose 100 -200 800 10 -15 20          stiffness at one pose
  tps machine show nist                    the machine's figures and where they come from

`tps COMMAND --help` describes a command. Lengths are in mm, angles in degrees, stiffnesses in N/mm.
"""


def help_text() -> str:
    """The help of `tps` itself."""
    lines = ["usage: tps [--version] COMMAND ...", "", DESCRIPTION, ""]
    for group, commands in GROUPS.items():
        lines += [f"{group}:", *(f"  {name:<11} {about}" for name, about in commands.items())]
    return "\n".join([*lines, "", EPILOG])


def actions_of(name: str) -> dict[str, Command]:
    """The command under "", or its actions."""
    importlib.import_module(f"toolpath_stiff.cli.{COMMANDS[name]}")
    commands = importlib.import_module("toolpath_stiff.cli.parser").COMMANDS
    return {title.removeprefix(name).strip(): commands[title] for title in commands if title.split()[0] == name}


class Screen:
    """Standard output or standard error, through which all text goes that a user sees.

    Control characters from a program or a file name do not reach the terminal. Where nobody reads any more (`| head`),
    the command goes on to its end and its exit code, in silence.

    Attributes
    ----------
    gone
        Whether nobody reads any more.
    """

    def __init__(self, stream: TextIO, name: str) -> None:
        self.stream, self.name, self.gone = stream, name, False

    def write(self, text: str) -> int:
        """Write text, without what steers a terminal. Raises `InputError` where the disk behind it is full, say."""
        self._do(lambda: self.stream.write(harmless(text)))
        return len(text)

    def flush(self) -> None:
        """Hand on what is held back."""
        self._do(self.stream.flush)

    def _do(self, step: Callable[[], object]) -> None:
        if self.gone:
            return
        try:
            step()
        except OSError as error:
            self.gone = True
            with suppress(OSError, ValueError):  # what Python itself still holds back goes nowhere
                os.dup2(os.open(os.devnull, os.O_WRONLY), self.stream.fileno())
            if not isinstance(error, BrokenPipeError):
                raise FileError(f"cannot write to {self.name}: {error.strerror}") from None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code (2 for wrong input and for whatever else went wrong, 130 for Ctrl-C)."""
    with (
        Path(os.devnull).open("w", encoding="utf-8") as nothing,  # for one that is closed
        redirect_stdout(cast("TextIO", Screen(sys.stdout or nothing, "standard output"))),
        redirect_stderr(cast("TextIO", Screen(sys.stderr or nothing, "standard error"))),
    ):
        try:
            try:
                code = _run(list(sys.argv[1:] if argv is None else argv))
            except SystemExit as stop:  # argparse: --help, --version, wrong usage
                code = stop.code if isinstance(stop.code, int) else 2
            sys.stdout.flush()
            return code
        except TpsError as error:
            return _ended(str(error), error.exit_code)
        except KeyboardInterrupt:
            return _ended("", 130)
        except Exception as error:
            return _ended(last_resort(error), 2)


def _run(words: list[str]) -> int:
    """The command that the words name."""
    name = next((word for word in words if not word.startswith("-")), "")
    if not name:
        print(f"tps {VERSION}" if "--version" in words else help_text())
        return 0 if words else 2
    if name not in COMMANDS:
        raise InputError(f"unknown command {name!r}", hint=_nearest(name, COMMANDS, "tps "))
    words.remove(name)
    actions, title = actions_of(name), f"tps {name}"
    action = words[0] if words and "" not in actions else ""
    if action not in actions:
        if action in ("-h", "--help"):
            print(actions_help(title, actions))
            return 0
        raise InputError(f"{title} {action}".strip(), hint=_nearest(action, actions, f"{title} "))
    if action:
        title = f"{title} {words.pop(0)}"
    return actions[action](title, words)


def _nearest(word: str, known: Iterable[str], before: str) -> str:
    """What may have been meant."""
    near = difflib.get_close_matches(word, list(known), n=1)
    return f"did you mean `{before}{near[0]}`?" if near else f"say one of {', '.join(known)}"


def actions_help(title: str, actions: Mapping[str, Command]) -> str:
    """The actions of a command, a line each, and its examples."""
    examples = (sys.modules[next(iter(actions.values())).run.__module__].__doc__ or "").partition("\n\n")[2]
    about = [f"  {name:<14} {(command.run.__doc__ or '').partition(chr(10))[0]}" for name, command in actions.items()]
    return "\n".join([f"usage: {title} ACTION ...", "", "actions:", *about, "", examples])


def _ended(error: str, code: int) -> int:
    """Say why a run ended, if that can be said; the exit code."""
    with suppress(TpsError):  # nobody hears it: standard error is full, or its terminal is gone
        sys.stdout.flush()
    with suppress(TpsError):
        print(f"tps: error: {error}" if error else "tps: interrupted; no file is half-written", file=sys.stderr)
        sys.stderr.flush()
    return code


REPORT = "if that does not explain it, report this line"


def last_resort(error: Exception) -> str:
    """What no command foresaw, in one line: memory, recursion, the file system, a defect of this package."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f", {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    words = " ".join(str(error).split()) or "no more is known"
    if isinstance(error, MemoryError):
        words += ": take a larger --step, fewer --jobs or fewer data"
    return f"an error that should not be ({type(error).__name__}{place}): {words}; {REPORT}"


def _stop(number: int, frame: FrameType | None) -> None:
    """A signal handler that ends the run as Ctrl-C does; no other signal of its kind disturbs the clearing up."""
    _stop_at(signal.SIG_IGN, _stop)
    raise KeyboardInterrupt


def _stop_at(new: Any, *before: Any) -> None:
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) in before:
            signal.signal(number, new)


def entry() -> None:
    """Console script: one thread of linear algebra, whatever the command."""
    os.environ.update(dict.fromkeys(THREADS, "1"))
    # Further processes would look for modules in the present folder first: in a case, or wherever programs came from.
    os.environ["PYTHONSAFEPATH"] = "1"
    _stop_at(_stop, signal.SIG_DFL)  # one that is ignored (nohup) stays so
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a terminal that cannot show a letter shows a question mark
            stream.reconfigure(errors="replace")
    sys.exit(main())
