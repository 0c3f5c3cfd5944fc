"""`tps analyze`: the stiffness along the path of NC programs."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from toolpath_stiff.cli.arguments import (
    add_json_option,
    add_load_options,
    add_machine_options,
    add_program_options,
    machine_for,
    positive_number,
    program_for,
)
from toolpath_stiff.cli.outputs import add_replace_option, destination, show
from toolpath_stiff.cli.progress import Progress, progress_line

if TYPE_CHECKING:
    from toolpath_stiff.api.inputs import Machine
    from toolpath_stiff.api.programs import Analysis

BELOW_REQUIRED, PARTIAL = 3, 1  # exit codes

EPILOG = """\
example:
  tps analyze programs/pocket.nc --origin 100,-50,800 --load normal --require 40000
  tps analyze programs more/part.nc --jobs 4    all programs of a folder and one more, four at a time

plunges:
  With the tangential load, cuts along the tool axis (within 5 degrees of it) are left out of mean, range, weakest
  place, axes and colours: a few short plunges into a stiff direction would rule them all. Their own figures stand
  beside, and --require holds for them as well.

files written to --out:
  samples.csv   every sample: line, position, stiffness, strut lengths, margin to the nearest limit
  summary.json  the figures, those of each tool and operation too, what was assumed, what was not acted upon
  path.png      three views of the path coloured by stiffness
  profile.png   stiffness along the path
  report.html   the path in 3-D, linked to profile and program text; one file, no network

several programs, or a folder:
  a folder stands for the programs in it and below it: .nc .ngc .tap .cnc .gcode .gc .eia .mpf .min, and the
  cutter-location files .apt .aptsource .cl .cls .clsf .ncl, in small letters or capitals; hidden files and linked
  folders are left alone. Each program has the files above in a folder of its own below --out (default: reports), and
  beside these folders there are
  index.html    all programs in one sortable table, drawn on one scale of stiffness; failures with their reason
  summary.csv   the same for a spreadsheet, one row a program
  A program that fails does not stop the others and is named at the end.

exit code
  one program: 0 done; 1 --partial left samples out; 2 the input is wrong; 3 a cutting move is below --require
  several: 0 done; 1 a program failed, or --partial left samples out; 2 the arguments are wrong, nothing was started;
  3 a cutting move is below --require and no program failed
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument(
        "programs", nargs="+", metavar="PROGRAM", help="NC program or cutter-location file, or a folder of them"
    )
    add_program_options(parser)
    add_machine_options(parser)
    add_load_options(parser)
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="folder for the report (default: reports/<program>; several programs: reports, with a folder for each)",
    )
    parser.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        help="several programs: so many at a time, each in its own process; 1: all in this one "
        "(default: one a CPU that may be used)",
    )
    parser.add_argument(
        "--format", choices=("csv", "parquet"), default="csv", help="format of the samples (default: csv)"
    )
    add_replace_option(parser, force=False)
    add_json_option(parser, "print summary.json to standard output and nothing else")
    parser.add_argument(
        "--show-plunges",
        action="store_true",
        help="let plunges along the tool axis set the axes and colours of the pictures too (the page has a switch)",
    )
    parser.add_argument("--no-plots", action="store_true", help="only the samples and the summary")
    parser.add_argument(
        "--partial",
        action="store_true",
        help="keep the reachable samples of a program that leaves the workspace (exit code 1)",
    )
    parser.add_argument(
        "--require",
        type=positive_number("N/mm", 1e7),
        metavar="N_PER_MM",
        help="stiffness that every cutting move must have; those below are listed (exit code 3)",
    )
    parser.add_argument("--compare", metavar="MACHINE", help="also analyze on this machine (name or file) and compare")


def run(args: argparse.Namespace) -> int:
    """Analyze one program, or hand several, or a folder, to `batch`."""
    from toolpath_stiff.cli.programs import find_programs
    from toolpath_stiff.cli.workers import job_count

    found, counts = find_programs(args.programs)
    jobs = job_count(args.jobs, len(found))
    if counts or len(found) > 1:
        from toolpath_stiff.cli.batch import run_batch

        return run_batch(args, found, counts, jobs)
    return _run_single(args, found[0].file)


def analysis_of(
    args: argparse.Namespace, file: str, machine: Machine | None = None, progress: Progress | None = None
) -> Analysis:
    """The analysis of a program as the options say; `machine` if it is loaded already."""
    from toolpath_stiff.api.programs import analyze

    return analyze(
        machine or machine_for(args),
        program_for(args, file),
        origin_mm_deg=args.origin,
        load=args.load,
        step_mm=args.step,
        force_N=args.force,
        partial=args.partial,
        require_N_per_mm=args.require,
        compare_with=args.compare,
        progress=progress,
    )


def _run_single(args: argparse.Namespace, file: str) -> int:
    """Analyze, write, print; the exit code."""
    from toolpath_stiff.report.analysis import names

    target = destination(args, "analyze", [file]).check(names(not args.no_plots, args.format))
    with progress_line(quiet=args.json) as progress:
        found = analysis_of(args, file, progress=progress)
    show(args, found, target, table=args.format, show_plunges=args.show_plunges)
    if found.below_required:
        return BELOW_REQUIRED
    return 0 if found.complete else PARTIAL
