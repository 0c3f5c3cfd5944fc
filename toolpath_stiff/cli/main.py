"""The entry point: commands are registered here and imported only when they are asked for.

`tps --help` must not load numpy, so this module and `arguments` import nothing heavy.
"""

from __future__ import annotations

import argparse
import difflib
import importlib
import os
import re
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

from toolpath_stiff.cli.arguments import read_folders, tell_incomplete, whole_options
from toolpath_stiff.defaults import THREADS, VERSION
from toolpath_stiff.errors import FileError, TpsError, harmless


@dataclass(frozen=True)
class Command:
    """A command: its name, its line in the help, its group, whose module does the work."""

    name: str
    help: str
    group: str

    @property
    def parts(self) -> tuple[Callable[[argparse.ArgumentParser], None], Callable[[argparse.Namespace], int]]:
        """What declares its arguments, what runs it and gives the exit code."""
        module = importlib.import_module(f"toolpath_stiff.cli.{MODULES[self.group]}")
        found: tuple[Callable[[argparse.ArgumentParser], None], Callable[[argparse.Namespace], int]]
        found = module.COMMANDS[self.name]
        return found


MODULES = {
    "A program": "program",
    "A machine": "machine",
    "A placement": "program",
    "Measurements": "measurements",
    "Studio": "machine",
}


COMMANDS = (
    Command("analyze", "stiffness along the path of NC programs: samples, summary, pictures, page", "A program"),
    Command("path", "the sampled path alone, without a machine", "A program"),
    Command("check", "what a program uses, what is not understood, extents, times, reach", "A program"),
    Command("pose", "stiffness, softest and stiffest direction, strut lengths at single poses", "A machine"),
    Command("map", "stiffness over planes of the workspace: picture, table, 3-D page", "A machine"),
    Command("machine", "list, show, check, make and import machine files", "A machine"),
    Command("place", "where the work should sit: Pareto front and one recommended placement", "A placement"),
    Command("case-study", "the paper's four regions: one path at two heights, displaced and turned", "A placement"),
    Command("effects", "physical effects that a machine can carry; write your own", "A machine"),
    Command("reduce", "raw force and displacement records to measured stiffnesses, lost motion, loops", "Measurements"),
    Command("compare", "where the model fails: errors, structure in the residuals, pictures, page", "Measurements"),
    Command(
        "diagnose", "which physical effect the model lacks, if any: verdict, candidates, confounding", "Measurements"
    ),
    Command(
        "update", "fit effects to measurements, see how far the error falls, write the machine file", "Measurements"
    ),
    Command("plan", "what to measure next to tell explanations apart, or a first campaign", "Measurements"),
    Command("rig", "blind exercises: measurements of a simulated machine that hides an effect", "Measurements"),
    Command("studio", "measure, see where the model fails, add what is missing: a case in the browser", "Studio"),
)

DESCRIPTION = "Stiffness of a hexapod (Stewart-platform) mill along a real NC program."
EPILOG = """\
examples:
  tps analyze part.nc                      stiffness along the path: reports/part/report.html
  tps analyze part.nc --origin 100,-50,900 with program zero at another place
  tps pose 100 -200 800 10 -15 20          stiffness at one pose
  tps machine show nist                    the machine's figures and where they come from

`tps COMMAND --help` describes a command. Lengths are in mm, angles in degrees, stiffnesses in N/mm.
"""

# argparse takes "-10,0,800" or "-300:300" for an option; this matches every value that begins like a negative number.
NEGATIVE_VALUE = re.compile(r"^-(\d|\.\d|inf|nan)")


class Parser(argparse.ArgumentParser):
    """An argument parser whose values may begin with a minus, and which suggests the nearest command."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[arg-type]
        self._negative_number_matcher = NEGATIVE_VALUE


def build_parser(chosen: str | None) -> argparse.ArgumentParser:
    """The parser with the chosen command's arguments; the other commands have only their name."""
    parser = Parser(
        prog="tps",
        description=DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        usage="tps [--version] COMMAND ...",
        epilog=_command_list() + "\n" + EPILOG,
    )
    parser.add_argument("--version", action="version", version=f"tps {VERSION}")
    commands = parser.add_subparsers(
        dest="command", metavar="COMMAND", help=argparse.SUPPRESS, parser_class=Parser, prog="tps"
    )
    for command in COMMANDS:
        sub = commands.add_parser(command.name, description=command.help)
        if command.name == chosen:
            command.parts[0](sub)
    return parser


def _command_list() -> str:
    lines = []
    for group in dict.fromkeys(command.group for command in COMMANDS):
        lines.append(f"{group.lower()}:")
        lines += [f"  {c.name:<11} {c.help}" for c in COMMANDS if c.group == group]
    return "\n".join(lines) + "\n"


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

    def writelines(self, lines: Iterable[str]) -> None:
        """The same of several texts."""
        for line in lines:
            self.write(line)

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


@contextmanager
def screens() -> Iterator[None]:
    """Standard output and standard error as `Screen`; a closed one is a silent one."""
    before = sys.stdout, sys.stderr
    with Path(os.devnull).open("w", encoding="utf-8") as nothing:
        out, error = (stream if stream is not None else nothing for stream in before)
        sys.stdout, sys.stderr = Screen(out, "standard output"), Screen(error, "standard error")
        try:
            yield
        finally:
            sys.stdout, sys.stderr = before


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code (2 for wrong input and for whatever else went wrong, 130 for Ctrl-C)."""
    with screens():
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
            if os.environ.get(TRACEBACK):
                traceback.print_exc()
            return _ended(last_resort(error), 2)


def _run(arguments: Sequence[str]) -> int:
    """The command that the arguments name."""
    chosen = next((word for word in arguments if not word.startswith("-")), None)
    known = [command.name for command in COMMANDS]
    if chosen is not None and chosen not in known:
        near = difflib.get_close_matches(chosen, known, n=1)
        hint = f"did you mean `tps {near[0]}`?" if near else f"expected one of {', '.join(known)}"
        print(f"tps: error: unknown command {chosen!r}; {hint}", file=sys.stderr)
        return 2
    parser = build_parser(chosen)
    args = parser.parse_args(whole_options(arguments))
    if args.command is None:
        parser.print_help()
        return 2
    tell_incomplete(read_folders(args))
    return next(c for c in COMMANDS if c.name == args.command).parts[1](args)


def _ended(error: str, code: int) -> int:
    """Say why a run ended, if that can be said; the exit code."""
    with suppress(TpsError):  # nobody hears it: standard error is full, or its terminal is gone
        sys.stdout.flush()
    with suppress(TpsError):
        print(f"tps: error: {error}" if error else "tps: interrupted; no file is half-written", file=sys.stderr)
        sys.stderr.flush()
    return code


TRACEBACK = "TPS_TRACEBACK"  # set in the environment, it shows where in the code an unforeseen error came from
REPORT = f"if that does not explain it, run the command again with {TRACEBACK}=1 and report what it prints"


def last_resort(error: Exception) -> str:
    """What no command foresaw, in one line: memory, recursion, the file system, a defect of this package."""
    told = " ".join(str(error).split()) or "no more is known"
    if isinstance(error, MemoryError):
        return f"out of memory ({told}): take a larger --step, fewer --jobs or fewer data; {REPORT}"
    if isinstance(error, RecursionError):
        return f"something is nested too deeply ({told}); {REPORT}"
    if isinstance(error, OSError):
        files = [repr(str(file)) for file in (error.filename, error.filename2) if file is not None]
        return f"{': '.join([*files, error.strerror or told])}; {REPORT}"
    frames = traceback.extract_tb(error.__traceback__)
    place = f", {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    return f"an error that should not be ({type(error).__name__}{place}): {told}; {REPORT}"


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
