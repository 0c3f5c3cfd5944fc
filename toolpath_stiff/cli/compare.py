"""`tps compare`: see where the model fails."""

from __future__ import annotations

import argparse
import json

from toolpath_stiff.cli.arguments import add_json_option
from toolpath_stiff.cli.diagnose import noise_argument, spread_argument
from toolpath_stiff.errors import InputError

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

OWN_FILES = (
    "compare.json", "residuals.csv", "report.html", "measured_modelled.png", "strips.png", "planes.png", "machine.png",
    "variables.png", "load_path.png",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("data", nargs="+", metavar="DATA", help="measurement files, or nist-table1")
    parser.add_argument("--machine", default="nist", metavar="NAME|FILE", help="machine name or file (default: nist)")
    parser.add_argument("--effects", action="append", default=[], metavar="FILE.py", help="your own physical effects")
    group = parser.add_argument_group("noise")
    group.add_argument(
        "--noise", type=noise_argument, metavar="PERCENT[,PERCENT]",
        help="sd of one reading, re-clamping included; or of the reading alone and of a clamping "
        "(default: from repeats, else from sd_N_per_mm, else a low and a high guess)",
    )  # fmt: skip
    group.add_argument(
        "--strut-spread", type=spread_argument, default=0.01, metavar="PERCENT",
        help="of the struts' stiffness (default: 1)",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the simulated scatter (default: 0)")
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="threads; the low and the high guess can share them"
    )
    parser.add_argument("--out", default="reports/compare", metavar="DIR", help="folder (default: reports/compare)")
    parser.add_argument("--no-plots", action="store_true", help="only compare.json and residuals.csv")
    add_json_option(parser, "print compare.json to standard output and nothing else")


def run(args: argparse.Namespace) -> int:
    """Compare, write, say where the model fails."""
    from toolpath_stiff.machine import load_machine
    from toolpath_stiff.report.compare_text import residuals_csv, terminal_text
    from toolpath_stiff.report.write import write_folder
    from toolpath_stiff.updating.compare import compare
    from toolpath_stiff.updating.measurements import read_measurements

    if args.seed < 0:
        raise InputError(f"--seed {args.seed}", expected="0 or more")
    if args.jobs < 1:
        raise InputError(f"--jobs {args.jobs}", expected="1 or more")
    machine = load_machine(args.machine)
    found = compare(
        machine, read_measurements(args.data, machine), noise=args.noise, strut_spread=args.strut_spread,
        effect_files=args.effects, seed=args.seed, jobs=args.jobs,
    )  # fmt: skip
    contents: dict[str, str | bytes] = {
        "compare.json": json.dumps(found.document, indent=2, ensure_ascii=False, allow_nan=False) + "\n",
        "residuals.csv": residuals_csv(found),
    }
    if not args.no_plots:
        from toolpath_stiff.report.compare_page import compare_html, compare_pictures

        pictures = compare_pictures(found)
        contents |= {**pictures, "report.html": compare_html(found, pictures)}
    written = write_folder(args.out, contents, OWN_FILES)
    if args.json:
        print(contents["compare.json"], end="")
    else:
        print(terminal_text(found.document))
        print("\n".join(["written:", *(f"  {file}" for file in written)]))
    return 0
