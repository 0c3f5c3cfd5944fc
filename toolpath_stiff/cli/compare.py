"""`tps compare`: see where the model fails."""

from __future__ import annotations

import argparse

from toolpath_stiff.cli.arguments import limit_threads
from toolpath_stiff.cli.measurement_arguments import (
    add_data_arguments,
    add_noise_arguments,
    add_output_arguments,
    asked,
    check_seed,
)
from toolpath_stiff.cli.outputs import destination
from toolpath_stiff.hints import hint

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
    check_seed(args.seed)
    limit_threads(args.jobs)
    from toolpath_stiff.machine import load_machine
    from toolpath_stiff.report.compare import files, names, text
    from toolpath_stiff.updating.comparison import compare
    from toolpath_stiff.updating.measurements import read_measurements

    target = destination(args, "compare", args.data, "-compare").check(names(not args.no_plots))
    machine = load_machine(args.machine)
    found = compare(
        machine, read_measurements(args.data, machine), noise=args.noise, strut_spread=args.strut_spread,
        effect_files=args.effects, seed=args.seed, jobs=args.jobs,
    )  # fmt: skip
    found.document["next"] = [hint("which effect would explain it", asked(args).command("diagnose"))]
    contents = files(found, plots=not args.no_plots)
    written = target.write(contents)
    if args.json:
        print(contents["compare.json"], end="")
    else:
        print(text(found.document))
        print("\n".join(found.document["next"]))
        print("\n".join(["written:", *(f"  {file}" for file in written)]))
    return 0
