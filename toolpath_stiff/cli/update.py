"""`tps update`: fit effects to measurements, watch the error fall, write the machine that carries them."""

from __future__ import annotations

import argparse
import sys

from toolpath_stiff.cli.arguments import limit_threads
from toolpath_stiff.cli.measurement_arguments import (
    add_data_arguments,
    add_noise_arguments,
    add_output_arguments,
    measured,
    noise_options,
)
from toolpath_stiff.cli.outputs import check_written, destination, keep, written_text
from toolpath_stiff.cli.progress import progress_line

EPILOG = """\
examples:
  tps update measurements.csv --add joint_compliance -o fitted.toml
  tps update measurements.csv --add weak_strut:strut=3 --keep-strut-law
  tps update measurements.csv --auto
  tps update nist-table1 --strut-law --objective mean-error     the paper's own estimation

An effect that the data do not support is refused, with the reason, unless --force is given; the exit code is 0 all the
same. Files written to --out: update.json, residuals.csv, machine.toml (unless refused or -o names another place),
ladder.png, before_after.png, report.html; with --objective mean-error also figure3.csv and figure3.png.
"""

MACHINE = "machine.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    add_data_arguments(parser)
    parser.add_argument(
        "--add", action="append", default=[], metavar="EFFECT[:KEY=VALUE,..]",
        help="effect to fit; what it acts on is searched unless it is said (weak_strut:strut=3)",
    )  # fmt: skip
    law = parser.add_mutually_exclusive_group()
    law.add_argument("--strut-law", action="store_true", help="write the refitted strut law even without an effect")
    law.add_argument(
        "--keep-strut-law", action="store_true",
        help="keep the strut law as given (default: its two stiffnesses are refitted along with every effect)",
    )  # fmt: skip
    parser.add_argument(
        "--auto",
        action="store_true",
        help="add effects as long as the error at left-out points falls and the data support it",
    )
    parser.add_argument(
        "--force", action="store_true", help="write what the data do not support as well; and as --replace"
    )
    parser.add_argument(
        "--objective", choices=("likelihood", "mean-error"), default="likelihood",
        help="mean-error: the strut law alone, as the paper fitted it (default: likelihood)",
    )  # fmt: skip
    parser.add_argument("-o", "--output", metavar="MACHINE.toml", help="the new machine file (default: in --out)")
    add_noise_arguments(parser, guess="a high guess")
    add_output_arguments(parser, "update", kept="update.json, residuals.csv and the machine file", force=False)


def run(args: argparse.Namespace) -> int:
    """Fit, judge, write. Refusal is success as well."""
    from toolpath_stiff.report.update import MACHINE_FILE, names

    args.replace |= args.force
    replaced = check_written(args, [args.output])
    target = destination(args, "update", args.data, "-update")
    target.check(names(not args.no_plots, machine=args.output is None))
    limit_threads(args.jobs)
    from toolpath_stiff.api.measuring import update

    with progress_line(quiet=args.json) as progress:
        found = update(
            *measured(args),
            add=args.add,
            strut_law=args.strut_law,
            keep_strut_law=args.keep_strut_law,
            auto=args.auto,
            force=args.force,
            objective=args.objective,
            machine_file=args.output or target.folder / MACHINE_FILE,
            **noise_options(args),
            progress=progress,
        )
        files = found.files(plots=not args.no_plots, machine=args.output is None)
    keep(replaced, quiet=args.json)
    # The machine file first: update.json names it.
    written = [found.save_machine(args.output)] if args.output and found.accepted else []
    written += target.write(files)
    if args.json:
        sys.stdout.write(found.to_json())
    else:
        print("\n".join([str(found), written_text(written), *(["", *found.next] if found.next else [])]))
    return 0
