"""`tps studio`: a case in the browser."""

from __future__ import annotations

import argparse

from toolpath_stiff.defaults import MACHINE

EPILOG = """\
examples:
  tps studio                                          a new case, in tps-case/
  tps studio measured.csv --machine mine.toml --program part.nc --case mill-3
  tps studio --case mill-3                            goes on where it was left

It serves 127.0.0.1 alone; the address holds a token. Ctrl-C ends it, nothing is lost.
"""


def studio_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("data", nargs="*", metavar="DATA", help="measurement files to add to the case")
    parser.add_argument("--machine", metavar="NAME|FILE", help=f"machine of a new case (default: {MACHINE})")
    parser.add_argument("--program", metavar="FILE", help="NC program to add")
    parser.add_argument("--effects", action="append", default=[], metavar="FILE.py", help="your own physical effects")
    parser.add_argument("--case", default="tps-case", metavar="DIR", help="folder of the case (default: tps-case)")
    parser.add_argument("--exercise", type=int, metavar="SEED", help="start a blind exercise in a new case")
    parser.add_argument("--port", type=int, default=0, metavar="N", help="port (default: one that is free)")
    parser.add_argument("--no-browser", action="store_true", help="print the address, open nothing")


def studio(args: argparse.Namespace) -> int:
    """Open the case and serve it until Ctrl-C."""
    from toolpath_stiff.studio import opened_case, serve

    case = opened_case(
        args.case, args.data, machine=args.machine, program=args.program, effects=args.effects, exercise=args.exercise
    )
    return serve(case, args.port, browser=not args.no_browser)


COMMANDS = {"studio": (studio_arguments, studio)}
