"""`tps compare`: see where the model fails."""

from __future__ import annotations

import argparse
import json

from toolpath_stiff.cli.arguments import limit_threads
from toolpath_stiff.cli.measurement_arguments import (
    add_data_arguments,
    add_noise_arguments,
    add_output_arguments,
    asked,
    check_seed,
)
from toolpath_stiff.cli.outputs import destination
from toolpath_stiff.files import Content

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

DATA = ("compare.json", "residuals.csv")
PICTURES = (
    "report.html", "measured_modelled.png", "strips.png", "planes.png", "machine.png", "variables.png", "load_path.png",
)  # fmt: skip


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
    target = destination(args, "compare", args.data, "-compare").check(DATA if args.no_plots else (*DATA, *PICTURES))
    limit_threads(args.jobs)
    from toolpath_stiff.machine import load_machine
    from toolpath_stiff.report.compare_text import residuals_csv, terminal_text
    from toolpath_stiff.updating.comparison import compare
    from toolpath_stiff.updating.measurements import read_measurements

    machine = load_machine(args.machine)
    found = compare(
        machine, read_measurements(args.data, machine), noise=args.noise, strut_spread=args.strut_spread,
        effect_files=args.effects, seed=args.seed, jobs=args.jobs, asked=asked(args),
    )  # fmt: skip
    contents: dict[str, Content] = {
        "compare.json": json.dumps(found.document, indent=2, ensure_ascii=False, allow_nan=False) + "\n",
        "residuals.csv": residuals_csv(found),
    }
    if not args.no_plots:
        from toolpath_stiff.report.compare_page import compare_html, compare_pictures

        pictures = compare_pictures(found)
        contents |= {**pictures, "report.html": compare_html(found, pictures)}
    written = target.write(contents)
    if args.json:
        print(contents["compare.json"], end="")
    else:
        print(terminal_text(found.document))
        print("\n".join(found.document["next"]))
        print("\n".join(["written:", *(f"  {file}" for file in written)]))
    return 0
