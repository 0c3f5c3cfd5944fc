"""`tps analyze`: the stiffness along the path of NC programs."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import (
    add_json_option,
    add_load_options,
    add_machine_options,
    add_program_options,
    models_for,
    positive_number,
    read_program_for,
)
from toolpath_stiff.cli.outputs import Destination, add_replace_option, destination

if TYPE_CHECKING:
    from toolpath_stiff.analysis import Analysis
    from toolpath_stiff.analysis.poses import Progress
    from toolpath_stiff.nc import Program
    from toolpath_stiff.stiffness.model import StiffnessModel

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
    parser.add_argument("--compare", metavar="MACHINE", help="also analyse on this machine (name or file) and compare")


def run(args: argparse.Namespace) -> int:
    """Analyse one program, or hand several, or a folder, to `batch`."""
    from toolpath_stiff.cli.programs import find_programs
    from toolpath_stiff.cli.workers import job_count

    found, counts = find_programs(args.programs)
    jobs = job_count(args.jobs, len(found))
    if counts or len(found) > 1:
        from toolpath_stiff.cli.batch import run_batch

        return run_batch(args, found, counts, jobs)
    return _run_single(args, found[0].file)


@dataclass(frozen=True)
class Models:
    """What the programs are analysed on: the machine and, with --compare, another one."""

    first: StiffnessModel
    second: StiffnessModel | None


@dataclass(frozen=True)
class Report:
    """What the analysis of a program left: its summary as written, the one on the other machine, what is too weak."""

    program: Program
    summary: dict[str, Any]
    second: Analysis | None
    missed: list[tuple[int, float]]
    files: list[Path]


def load_models(args: argparse.Namespace) -> Models:
    """Load the machines. Raises as `arguments.models_for`."""
    found = models_for(args, *(name for name in (args.machine, args.compare) if name))
    return Models(found[0], found[1] if args.compare else None)


def analyse_and_write(
    args: argparse.Namespace,
    file: str,
    target: Destination,
    models: Models,
    progress: Progress | None = None,
) -> Report:
    """Analyse a program and write its report folder. Raises `TpsError`, with nothing written."""
    from toolpath_stiff.analysis.results import analyse, required_stiffness_missed
    from toolpath_stiff.report.analysis import files
    from toolpath_stiff.units import n_per_m_from_n_per_mm

    program = read_program_for(args, file, models.first.machine)
    options = {
        "origin": args.origin,
        "load": args.load,
        "step": args.step,
        "force": args.force,
        "partial": args.partial,
    }
    analysis = analyse(models.first, program, progress=progress, **options)
    second: Analysis | None = None
    if models.second is not None:
        second = analyse(models.second, read_program_for(args, file, models.second.machine), **options)
    required = None if args.require is None else n_per_m_from_n_per_mm(args.require)
    contents = files(
        analysis,
        plots=not args.no_plots,
        table=args.format,
        required=required,
        other=second,
        show_plunges=args.show_plunges,
    )
    written = target.write(contents)
    return Report(
        program=program,
        summary=json.loads((target.folder / "summary.json").read_text(encoding="utf-8")),
        second=second,
        missed=required_stiffness_missed(analysis, required) if required is not None else [],
        files=written,
    )


def _run_single(args: argparse.Namespace, file: str) -> int:
    """Analyse, write, print; the exit code."""
    from toolpath_stiff.cli.progress import progress_bar
    from toolpath_stiff.report.analysis import names

    target = destination(args, "analyze", [file]).check(names(not args.no_plots, args.format))
    with progress_bar(f"{Path(file).name}: samples", quiet=args.json) as progress:
        report = analyse_and_write(args, file, target, load_models(args), progress)
    if args.json:
        json.dump(report.summary, sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        _print(report)
    if report.missed:
        return BELOW_REQUIRED
    return PARTIAL if report.summary["out_of_reach_samples"] else 0


def _print(report: Report) -> None:
    from toolpath_stiff.report.analysis import text
    from toolpath_stiff.report.words import plain

    print(text(report.summary, report.program.source, report.second.summary() if report.second else None))
    print("\n".join(["written:", *(f"  {plain(str(path))}" for path in report.files)]))
