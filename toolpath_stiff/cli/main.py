"""The entry point: commands are listed here and imported on demand, so that `tps --help` loads no numpy."""

import importlib
import os
import signal
import sys
import traceback
from collections.abc import Iterable, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import TextIOWrapper
from pathlib import Path
from typing import Any, TextIO, cast

from toolpath_stiff.cli.parser import COMMANDS, Command, nearest
from toolpath_stiff.defaults import THREADS, VERSION
from toolpath_stiff.errors import InputError, TpsError, harmless

# Module -> its commands, each with its line in the help.
GROUPS = {
    "program": {
        "analyze": "stiffness along the path of NC programs: samples, summary, pictures, page",
        "path": "the sampled path alone, without a machine",
        "check": "what a program uses, what is not understood, extents, times, reach",
        "place": "where the work should sit: Pareto front and one recommended placement",
        "case-study": "the paper's four regions: one path at two heights, displaced and turned",
    },
    "cutting": {
        "cut": "what a cut is computed from: setup files, materials",
        "compensate": "a program shifted against the deflection of its final walls",
    },
    "machine": {
        "pose": "stiffness, softest and stiffest direction, joint values at single poses",
        "map": "stiffness over planes of the workspace: picture, table, 3-D page",
        "machine": "list, show, check, make and import machine files",
    },
    "measurements": {
        "reduce": "raw force and displacement records to measured stiffnesses, lost motion, loops",
        "compare": "where the model fails: errors, structure in the residuals, pictures, page",
        "diagnose": "which physical effect the model lacks, if any: verdict, candidates, votes",
        "update": "fit effects to measurements, see how far the error falls, write the machine file",
        "forces": "coefficients of the cutting force from dynamometer records of slots",
        "plan": "what to measure next to tell explanations apart, or a first campaign",
    },
    "effects": {"effects": "physical effects that a machine can carry; write your own"},
    "rig": {"rig": "blind exercises: measurements of a simulated machine that hides an effect"},
    "studio": {"studio": "measure, see where the model fails, add what is missing: a case in the browser"},
}
MODULES = {name: module for module, commands in GROUPS.items() for name in commands}

DESCRIPTION = "Stiffness of a machine tool along an NC program: hexapods, mills, deltas, milling robots."
EPILOG = """\
examples:
  tps analyze part.nc                      stiffness along the path: reports/part/report.html
  tps analyze part.nc --origin 100,-50,900 with program zero at another place
  tps pose 100 -200 800 10 -15 20          stiffness at one pose
  tps machine show nist                    the machine's figures and where they come from

`tps COMMAND --help` describes a command. Lengths are in mm, angles in degrees, stiffnesses in N/mm.
"""


def help_text() -> str:
    """Help text of `tps` itself."""
    lines = ["usage: tps [--version] COMMAND ...", "", DESCRIPTION, ""]
    for group, commands in GROUPS.items():
        lines += [f"{group}:", *(f"  {name:<11} {about}" for name, about in commands.items())]
    return "\n".join([*lines, "", EPILOG])


def actions_of(name: str) -> dict[str, Command]:
    """A command by its name, or its actions by theirs ("rig new"). Raises `InputError`."""
    importlib.import_module(f"toolpath_stiff.cli.{MODULES[_known(name, MODULES)]}")
    return {title: command for title, command in COMMANDS.items() if title.split()[0] == name}


class Screen:
    """Standard output or error, filtered: control characters of a program or file name do not reach the terminal."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write text without characters that steer a terminal."""
        return self.stream.write(harmless(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code (2 for wrong input and for whatever else went wrong, 130 for Ctrl-C)."""
    code = 0
    with (
        Path(os.devnull).open("w", encoding="utf-8") as nothing,  # stands in for a stream that is closed
        redirect_stdout(cast("TextIO", Screen(sys.stdout or nothing))),
        redirect_stderr(cast("TextIO", Screen(sys.stderr or nothing))),
    ):
        try:
            code = _run(list(sys.argv[1:] if argv is None else argv))
            sys.stdout.flush()
            return code
        except BrokenPipeError:  # nobody reads any more (`| head`)
            return _ended("", code)
        except TpsError as error:
            return _ended(f"tps: error: {error}\n", error.exit_code)
        except (KeyboardInterrupt, Exception) as error:
            # A library that is being loaded may turn an interrupt into an error of its own.
            if isinstance(error, KeyboardInterrupt) or isinstance(error.__cause__, KeyboardInterrupt):
                return _ended("tps: interrupted; no file is half-written\n", 130)
            return _ended(f"tps: error: {last_resort(error)}\n", 2)


def _run(words: list[str]) -> int:
    """Run the command that the words name."""
    name = next((word for word in words if not word.startswith("-")), "")
    if not name:
        if strange := {*words} - {"-h", "--help", "--version"}:
            raise InputError(f"tps does not know {min(strange)!r}", hint="see tps --help")
        print(f"tps {VERSION}" if "--version" in words else help_text())
        return 0 if words else 2
    title, actions = name, actions_of(name)
    words.remove(name)
    if name not in actions:
        if not words or words[0] in ("-h", "--help"):
            print(actions_help(name, actions))
            return 0 if words else 2
        title = _known(f"{name} {words.pop(0)}", actions)
    return actions[title](f"tps {title}", words)


def _known(title: str, titles: Iterable[str]) -> str:
    """The title, if it is one of `titles`. Raises `InputError`."""
    if title in titles:
        return title
    near = nearest(title, titles)
    hint = f"did you mean `tps {near}`?" if near else f"say one of {', '.join(titles)}"
    raise InputError(f"unknown command {title!r}", hint=hint)


def actions_help(name: str, actions: Mapping[str, Command]) -> str:
    """Help on the actions of a command, one line each, with its examples."""
    examples = (sys.modules[f"toolpath_stiff.cli.{MODULES[name]}"].__doc__ or "").partition("\n\n")[2]
    about = [f"  {title:<22} {(action.run.__doc__ or '').splitlines()[0]}" for title, action in actions.items()]
    return "\n".join([f"usage: tps {name} ACTION ...", "", "actions:", *about, "", examples])


def _ended(text: str, code: int) -> int:
    """Print why a run ended, if that is possible; returns the exit code."""
    for stream, rest in ((sys.stdout, ""), (sys.stderr, text)):
        try:
            stream.write(rest)
            stream.flush()
        except OSError:  # nobody reads it: buffered output is dropped
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return code


def last_resort(error: Exception) -> str:
    """One line on an error that no command foresaw: the file system, memory, recursion, a defect of this package."""
    if isinstance(error, OSError):  # a name too long, a full disk
        return f"{error.strerror or error}{f': {str(error.filename)!r}' if error.filename else ''}"
    frames = traceback.extract_tb(error.__traceback__)
    place = f", {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    words = " ".join(str(error).split()) or "no more is known"
    return f"unexpected error ({type(error).__name__}{place}): {words}; please report this line"


def entry() -> None:
    """Console script: one thread of linear algebra, whatever the command."""
    os.environ.update(dict.fromkeys(THREADS, "1"))
    # Further processes would look for modules in the present folder first: in a case, or wherever programs came from.
    os.environ["PYTHONSAFEPATH"] = "1"
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # a terminal that cannot show a letter shows a question mark
            stream.reconfigure(errors="replace")
    sys.exit(main())
