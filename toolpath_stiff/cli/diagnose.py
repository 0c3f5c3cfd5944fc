"""`tps diagnose`: the physical effect that the model lacks, if any."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import (
    add_condition_options,
    add_program_options,
    limit_threads,
    machine_for,
    program_for,
)
from toolpath_stiff.cli.measurement_arguments import (
    add_data_arguments,
    add_noise_arguments,
    add_output_arguments,
    asked,
    check_seed,
)
from toolpath_stiff.cli.outputs import destination
from toolpath_stiff.cli.progress import say

if TYPE_CHECKING:
    from toolpath_stiff.updating.diagnosis import Diagnosis

EPILOG = """\
examples:
  tps diagnose measurements.csv
  tps diagnose nist-table1 --noise 5
  tps diagnose first.csv second.csv --effects my_effect.py --out reports/again

The verdict: adequate (nothing is missing that these data could show), identified, ambiguous (several explain the data
equally well), unexplained (something is missing that no effect of the catalogue describes). Files written to --out:
diagnose.json, residuals.csv, ladder.png, confounding.png, detectable.png, before_after.png, envelope.png,
report.html.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    add_data_arguments(parser)
    add_noise_arguments(parser)
    group = parser.add_argument_group("how much the choice matters")
    group.add_argument(
        "--program", metavar="PROGRAM", help="NC program to try it on (default: the packaged case study)"
    )
    add_condition_options(group)
    add_program_options(parser, sampled=False)
    add_output_arguments(parser, "diagnose", kept="diagnose.json and residuals.csv")


def run(args: argparse.Namespace) -> int:
    """Diagnose, write, say what was found. Any verdict is success."""
    check_seed(args.seed)
    limit_threads(args.jobs)
    from toolpath_stiff.machine import load_machine
    from toolpath_stiff.report.diagnose import files, names, text
    from toolpath_stiff.updating.diagnosis import diagnose
    from toolpath_stiff.updating.diagnosis.document import document
    from toolpath_stiff.updating.measurements import read_measurements

    target = destination(args, "diagnose", args.data, "-diagnose").check(names(not args.no_plots))
    machine = load_machine(args.machine)
    data = read_measurements(args.data, machine)
    diagnosis = diagnose(
        machine, data, noise=args.noise, strut_spread=args.strut_spread, effect_files=args.effects, seed=args.seed,
        files=args.data, progress=say,
    )  # fmt: skip
    found = document(diagnosis, args.command_line, asked(args))
    _complete(found, diagnosis, args)
    if not args.no_plots:
        say("drawing")
    contents = files(diagnosis, found, plots=not args.no_plots)
    say("")
    written = target.write(contents)
    if args.json:
        print(contents["diagnose.json"], end="")
    else:
        print(text(found))
        print("\n".join(["written:", *(f"  {file}" for file in written)]))
    return 0


def _complete(found: dict[str, Any], diagnosis: Diagnosis, args: argparse.Namespace) -> None:
    """Add what needs other rooms: the next measurements, and the choice's weight on a tool path."""
    from toolpath_stiff.units import pose_in_si
    from toolpath_stiff.updating.diagnosis import choice_on_path, next_measurements

    if diagnosis.verdict != "ambiguous":
        return
    say("planning the next measurements")
    found["next_measurements"], remarks = next_measurements(diagnosis, seed=args.seed)
    found["why"] += remarks
    if args.program is None:
        from toolpath_stiff.placement.case_study import case_study_program

        part, program = None, case_study_program()
    else:
        part = program_for(args, args.program)
        program = part.moves(None if args.origin is None else pose_in_si(args.origin), diagnosis.machine.default_origin)
    conditions = machine_for(args).running(part).conditions
    found["path"] = choice_on_path(
        diagnosis, program, None if args.origin is None else pose_in_si(args.origin), conditions
    )
