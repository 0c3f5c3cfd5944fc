"""`tps diagnose`: the physical effect that the model lacks, if any."""

from __future__ import annotations

import argparse

from toolpath_stiff.cli.arguments import add_condition_options, add_program_options, limit_threads, program_for
from toolpath_stiff.cli.measurement_arguments import (
    add_data_arguments,
    add_noise_arguments,
    add_output_arguments,
    measured,
    noise_options,
)
from toolpath_stiff.cli.outputs import destination, show
from toolpath_stiff.cli.progress import progress_line

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
    from toolpath_stiff.report.diagnose import names

    target = destination(args, "diagnose", args.data, "-diagnose").check(names(not args.no_plots))
    limit_threads(args.jobs)
    from toolpath_stiff.api.measuring import diagnose

    machine, data = measured(args)
    with progress_line(quiet=args.json) as progress:
        found = diagnose(
            machine.under(args.setup, args.temperature),
            data,
            **noise_options(args),
            program=program_for(args, args.program) if args.program else None,
            origin_mm_deg=args.origin,
            progress=progress,
        )
        return show(args, found, target)
