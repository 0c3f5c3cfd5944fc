"""`tps analyze`: the stiffness along the path of NC programs."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from toolpath_stiff.cli.arguments import (
    add_json_option,
    add_load_options,
    add_machine_options,
    add_program_options,
    positive_number,
    read_program_for,
)
from toolpath_stiff.errors import InputError

if TYPE_CHECKING:
    from toolpath_stiff.analysis import Analysis
    from toolpath_stiff.stiffness.model import StiffnessModel

BELOW_REQUIRED, PARTIAL = 3, 1  # exit codes

EPILOG = """\
example:
  tps analyze programs/pocket.nc --origin 100,-50,800 --load normal --require 40000

files written to --out:
  samples.csv   every sample: line, position, stiffness, strut lengths, margin to the nearest limit
  summary.json  the figures, what was assumed, what the program holds that was not acted upon
  path.png      three views of the path coloured by stiffness
  profile.png   stiffness along the path
  report.html   the path in 3-D, linked to profile and program text; one file, no network

exit code: 0 done; 1 --partial left samples out; 2 the input is wrong; 3 a cutting move is below --require
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("programs", nargs="+", metavar="PROGRAM", help="NC program")
    add_program_options(parser)
    add_machine_options(parser)
    add_load_options(parser)
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="folder for the report (default: reports/<program>; several programs: one each below it)",
    )
    parser.add_argument(
        "--format", choices=("csv", "parquet"), default="csv", help="format of the samples (default: csv)"
    )
    add_json_option(parser, "print summary.json to standard output and nothing else")
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
    """Analyse every program; the exit code is the worst of them."""
    from toolpath_stiff.machine import load_machine
    from toolpath_stiff.stiffness.model import build_model

    model = build_model(load_machine(args.machine), args.effects)
    other = build_model(load_machine(args.compare), args.effects) if args.compare else None
    folders = _folders(args)
    worst, summaries = 0, []
    for program, folder in zip(args.programs, folders, strict=True):
        code, summary = _analyse_one(args, program, folder, model, other)
        worst = max(worst, code)
        summaries.append(summary)
    if args.json:
        json.dump(summaries[0] if len(summaries) == 1 else summaries, sys.stdout, indent=2)
        sys.stdout.write("\n")
    return worst


def _folders(args: argparse.Namespace) -> list[Path]:
    """One report folder a program. Raises `InputError` if two programs would share one."""
    stems = [Path(program).stem for program in args.programs]
    if len(stems) == 1:
        return [Path(args.out) if args.out else Path("reports") / stems[0]]
    doubled = sorted({stem for stem in stems if stems.count(stem) > 1})
    if doubled:
        raise InputError(
            f"several programs are called {doubled[0]!r} and would share a report folder",
            hint="analyse them one at a time with --out",
        )
    return [Path(args.out or "reports") / stem for stem in stems]


def _analyse_one(
    args: argparse.Namespace, file: str, folder: Path, model: StiffnessModel, other: StiffnessModel | None
) -> tuple[int, dict[str, object]]:
    from toolpath_stiff.analysis.path_analysis import analyse, required_stiffness_missed
    from toolpath_stiff.cli.progress import progress_bar
    from toolpath_stiff.report.terminal import comparison_table, terminal_table
    from toolpath_stiff.report.write import write_analysis
    from toolpath_stiff.units import n_per_m_from_n_per_mm

    program = read_program_for(args, file, model.machine)
    options = {
        "origin": args.origin,
        "load": args.load,
        "step": args.step,
        "force": args.force,
        "partial": args.partial,
    }
    with progress_bar(f"{program.name}: samples", quiet=args.json) as progress:
        analysis = analyse(model, program, progress=progress, **options)
    second: Analysis | None = None
    if other is not None:
        second = analyse(other, read_program_for(args, file, other.machine), **options)
    required = None if args.require is None else n_per_m_from_n_per_mm(args.require)
    files = write_analysis(
        analysis, folder, plots=not args.no_plots, table=args.format, required=required, other=second
    )
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    missed = required_stiffness_missed(analysis, required) if required is not None else []
    if not args.json:
        print(terminal_table(summary))
        if second is not None:
            print(comparison_table(summary, second.summary()))
        if missed:
            print(f"below the required {args.require:g} N/mm:")
            for line, stiffness in missed:
                print(f"  line {line}: {stiffness:.0f} N/mm  {program.source[line - 1].strip()}")
        print("\n".join(["written:", *(f"  {path}" for path in files)]))
    if missed:
        return BELOW_REQUIRED, summary
    return (PARTIAL if analysis.out_of_reach.any() else 0), summary
