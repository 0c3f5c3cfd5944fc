"""The command that opens a case in the browser."""

from __future__ import annotations

from argparse import Namespace
from typing import cast

from toolpath_stiff.api.machines import Machine
from toolpath_stiff.cli.calls import given
from toolpath_stiff.cli.parser import Command, own
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.nc.program import Program, Reading
from toolpath_stiff.options import arguments_of


def studio(args: Namespace) -> int:
    """Measure, see where the model fails, add what is missing: a case in the browser.

    for example:
      tps studio                                          a new case, in tps-case/
      tps studio measured.csv --machine mine.toml --program part.nc --case mill-3
      tps studio --case mill-3                            goes on where it was left
      tps studio --program part.nc --tools my.tbl         a program with tool lengths (G43)

    It serves 127.0.0.1 alone; the address holds a token. Ctrl-C ends it, nothing is lost.
    """
    from toolpath_stiff.studio.run import ask_for_effects, opened_case, serve

    reading = {name: value for name, value in given(args, Program.read).items() if value not in (None, False)}
    case = opened_case(
        args.case,
        args.data,
        machine=args.machine,
        program=args.program,
        effects=args.effects,
        exercise=args.exercise,
        trust=args.trust,
        reading=cast("Reading", reading),
    )
    ask_for_effects(case, args.case)
    return serve(case, args.port, browser=not args.no_browser)


COMMANDS = {
    "studio": Command(
        studio,
        own("DATA", "measurement files to add to the case", count="*", default=()),
        own("--machine NAME|FILE", f"machine of a new case (default: {MACHINE})"),
        own("--program FILE", "NC program to add"),
        arguments_of(Machine.load)["effects"],
        own(
            "--trust effects/FILE.py",
            "code that came with the case, which you have read and agree to run",
            count="append",
            default=(),
        ),
        Program.read,
        own("--case DIR", "folder of the case", default="tps-case"),
        own("--exercise SEED", "start a blind exercise in a new case", kind=int),
        own("--port N", "port (default: one that is free)", kind=int, default=0),
        own("--no-browser", "print the address, open nothing"),
        without=["interpreter", "rs274", "subprograms", "unconfined"],
    )
}
