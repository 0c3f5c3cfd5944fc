"""The entry point: commands are registered here and imported only when they are asked for.

`tps --help` must not load numpy, so this module and `arguments` import nothing heavy.
"""

from __future__ import annotations

import argparse
import difflib
import importlib
import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from toolpath_stiff import __version__
from toolpath_stiff.cli.arguments import whole_options
from toolpath_stiff.defaults import THREADS
from toolpath_stiff.errors import TpsError


@dataclass(frozen=True)
class Command:
    """A command: its name, its line in the help, its group, whose module does the work but where another is named."""

    name: str
    help: str
    group: str
    module: str = ""

    @property
    def parts(self) -> tuple[Callable[[argparse.ArgumentParser], None], Callable[[argparse.Namespace], int]]:
        """What declares its arguments, what runs it and gives the exit code."""
        module = importlib.import_module(f"toolpath_stiff.cli.{self.module or MODULES[self.group]}")
        found: tuple[Callable[[argparse.ArgumentParser], None], Callable[[argparse.Namespace], int]]
        found = module.COMMANDS[self.name]
        return found


MODULES = {
    "A program": "program",
    "A machine": "machine",
    "A placement": "placement",
    "Measurements": "measurements",
    "Studio": "studio",
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
    Command("update", "fit effects to measurements, watch the error fall, write the machine", "Measurements"),
    Command("plan", "what to measure next to tell explanations apart, or a first campaign", "Measurements"),
    Command("rig", "blind exercises: measurements of a simulated machine that hides an effect", "Measurements", "rig"),
    Command("studio", "measure, see where the model fails, add what is missing: a case in the browser", "Studio"),
)

DESCRIPTION = "Stiffness of a hexapod (Stewart-platform) mill along a real NC program."
EPILOG = """\
examples:
  tps analyze part.nc                      stiffness along the path: reports/part/report.html
  tps analyze part.nc --origin 100,-50,900 with program zero at another place
  tps pose 100 -200 800 10 -15 20          stiffness at one pose
  tps machine show nist                    the machine's figures and where they come from

`tps COMMAND --help` tells more. Lengths are in mm, angles in degrees, stiffnesses in N/mm.
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
    parser.add_argument("--version", action="version", version=f"tps {__version__}")
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


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code (2 for wrong input, 130 for Ctrl-C)."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    chosen = next((word for word in arguments if not word.startswith("-")), None)
    known = [command.name for command in COMMANDS]
    if chosen is not None and chosen not in known:
        near = difflib.get_close_matches(chosen, known, n=1)
        hint = f"did you mean `tps {near[0]}`?" if near else f"expected one of {', '.join(known)}"
        print(f"tps: error: unknown command {chosen!r}; {hint}", file=sys.stderr)
        return 2
    parser = build_parser(chosen)
    try:
        args = parser.parse_args(whole_options(arguments))
        if args.command is None:
            parser.print_help()
            return 2
        command = next(c for c in COMMANDS if c.name == args.command)
        code = command.parts[1](args)
        sys.stdout.flush()
        return code
    except SystemExit as stop:  # argparse: --help, --version, wrong usage
        return stop.code if isinstance(stop.code, int) else 2
    except TpsError as error:
        print(f"tps: error: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("tps: interrupted; no file is half-written", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of a pipe went away (`tps path ... | head`): not an error of ours.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def entry() -> None:
    """Console script: one thread of linear algebra, whatever the command."""
    os.environ.update(dict.fromkeys(THREADS, "1"))
    sys.exit(main())
