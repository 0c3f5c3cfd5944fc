"""`tps compare`: see where the model fails."""

from __future__ import annotations

import argparse

from toolpath_stiff.cli.arguments import limit_threads
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
  tps compare nist-table1
  tps compare measurements.csv --machine my_machine.toml
  tps compare first.csv second.csv --noise 2,1 --out reports/again

The machine file is compared as it stands; `tps diagnose` asks which effect it lacks. A finding is a pattern in the
residuals that fewer than 5 % of campaigns of mere scatter would show anywhere among all patterns looked for.
Files written to --out: compare.json, residuals.csv, report.html, measured_modelled.png, strips.png, planes.png,
machine.png, variables.png, load_path.png.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    add_data_arguments(parser)
    add_noise_arguments(parser)
    add_output_arguments(parser, "compare", kept="compare.json and residuals.csv")


def run(args: argparse.Namespace) -> int:
    """Compare, write, say where the model fails."""
    from toolpath_stiff.report.compare import names

    target = destination(args, "compare", args.data, "-compare").check(names(not args.no_plots))
    limit_threads(args.jobs)
    from toolpath_stiff.api.measuring import compare

    with progress_line(quiet=args.json) as progress:
        found = compare(*measured(args), **noise_options(args), progress=progress)
        return show(args, found, target)
