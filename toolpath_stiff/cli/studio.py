"""The command that opens a case in the browser."""

from argparse import Namespace
from collections.abc import Sequence
from typing import Annotated, cast

from toolpath_stiff.api.machines import Machine
from toolpath_stiff.cli import run
from toolpath_stiff.cli.parser import FILES, command
from toolpath_stiff.nc.program import Program, Reading
from toolpath_stiff.options import Option, arguments_of
from toolpath_stiff.studio.run import opened_case, removed_if_refused, serve

# A case uses its own program reader: no other interpreter, no files from elsewhere.
NOT_IN_A_CASE = ("interpreter", "rs274", "subprograms", "unconfined")


@command("studio", arguments_of(Machine.load)["effects"], "Program.read", without=NOT_IN_A_CASE)
def studio(
    args: Namespace,
    data: Annotated[Sequence[str], Option("DATA", count="*", help=f"{FILES}, to add to the case")] = (),
    machine: Annotated[str | None, Option("--machine", "NAME|FILE")] = None,
    program: Annotated[str | None, Option("--program", "FILE")] = None,
    trust: Annotated[Sequence[str], Option("--trust", "effects/FILE.py", count="append")] = (),
    case: Annotated[str, Option("--case", "DIR")] = "tps-case",
    exercise: Annotated[int | None, Option("--exercise", "SEED")] = None,
    port: Annotated[int, Option("--port")] = 0,
    no_browser: Annotated[bool, Option("--no-browser")] = False,
) -> int:
    """Measure, see where the model fails, add what is missing: a case in the browser.

    for example:
      tps studio                                          a new case, in tps-case/
      tps studio measured.csv --machine mine.toml --program part.nc --case mill-3
      tps studio --case mill-3                            goes on where it was left
      tps studio --program part.nc --tools my.tbl         a program with tool lengths (G43)

    It serves 127.0.0.1 alone; the address holds a token. Ctrl-C ends it, nothing is lost.

    Parameters
    ----------
    machine
        Machine of a new case (default: nist).
    program
        NC program to add.
    trust
        Code that came with the case, which you have read and agree to run.
    case
        Folder of the case.
    exercise
        Start a blind exercise in a new case.
    port
        Port (default: one that is free).
    no_browser
        Print the address, open nothing.
    """
    reading = {name: value for name, value in run.given(args, Program.read).items() if value not in (None, False)}
    with removed_if_refused(case):
        opened = opened_case(case, trust, machine, exercise)
        for file in args.effects:
            opened.add_effects(file)
        if data:
            opened.add_data(*data)
        if program or reading:
            opened.add_program(program or None, **cast("Reading", reading))
    return serve(opened, port, browser=not no_browser)
