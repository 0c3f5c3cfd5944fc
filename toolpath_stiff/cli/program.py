"""The commands on a program: analyze, path, check."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import (
    add_json_option,
    add_load_options,
    add_machine_options,
    add_program_options,
    add_replace_option,
    check_single,
    destination,
    keep,
    machine_for,
    positive_number,
    program_for,
    progress_line,
    reading_options,
    say,
    show,
    written_text,
)
from toolpath_stiff.errors import InputError

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from toolpath_stiff.report.batch.programs import FolderCount, Found

# -- tps analyze ------------------------------------------------------------------------------------------------------

BELOW_REQUIRED = 3  # exit code
INCOMPLETE = 1  # exit code: samples were left out, or of several programs one failed
CONNECT_SECONDS = 10  # for a scheduler to answer

ANALYZE_EPILOG = """\
example:
  tps analyze programs/pocket.nc --origin 100,-50,800 --load normal --require 40000
  tps analyze programs more/part.nc --jobs 4    all programs of a folder and one more, four at a time

plunges:
  With the tangential load, cuts along the tool axis (within 5 degrees of it) are left out of mean, range, weakest
  place, axes and colours: a few short plunges into a stiff direction would dominate them all. Their figures
  are reported separately, and --require applies to them as well.

files written to --out:
  samples.csv   every sample: line, position, stiffness, strut lengths, margin to the nearest limit
  summary.json  the figures, those of each tool and operation too, what was assumed, what was not acted upon
  path.png      three views of the path coloured by stiffness
  profile.png   stiffness along the path
  report.html   the path in 3-D, linked to profile and program text; one file, no network

several programs, or a folder:
  a folder stands for the programs in it and below it: .nc .ngc .tap .cnc .gcode .gc .eia .mpf .min, and the
  cutter-location files .apt .aptsource .cl .cls .clsf .ncl, in small letters or capitals; hidden files and linked
  folders are ignored. Each program has the files above in a folder of its own below --out (default: reports), and
  beside these folders there are
  index.html    all programs in one sortable table, drawn on one scale of stiffness; failures with their reason
  summary.csv   the same for a spreadsheet, one row a program
  A program that fails does not stop the others and is named at the end.

exit code
  one program: 0 done; 1 --partial left samples out; 2 the input is wrong; 3 a cutting move is below --require
  several: 0 done; 1 a program failed, or --partial left samples out; 2 the arguments are wrong, nothing was started;
  3 a cutting move is below --require and no program failed
"""


def analyze_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = ANALYZE_EPILOG
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
        help="several programs: how many run at a time, each in its own process; 1: all in this process "
        "(default: one for each available CPU)",
    )
    parser.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="hand the programs to the workers of a Dask cluster instead, one program a task; ADDRESS is its "
        "scheduler's, as tcp://10.0.0.5:8786. Workers must see the programs and --out by the same paths "
        "(pip install 'toolpath-stiff[cluster]')",
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


def analyze(args: argparse.Namespace) -> int:
    """Analyze one program, or several, or those of a folder."""
    from toolpath_stiff.defaults import job_count, one_thread

    one_thread()  # before numpy is loaded
    if len(args.programs) == 1 and os.path.isfile(args.programs[0]) and not args.cluster:  # noqa: PTH113  (false for a name that none can have)
        job_count(args.jobs, 1)
        return _run_single(args, args.programs[0])  # without loading what lists many
    from toolpath_stiff.report.batch.programs import find_programs

    found, counts = find_programs(args.programs)
    job_count(args.jobs, len(found))
    if counts or len(found) > 1 or args.cluster:
        return _run_many(args, found, counts)
    return _run_single(args, found[0].file)


def _asked(args: argparse.Namespace) -> dict[str, Any]:
    """The options of an analysis."""
    return {
        "origin_mm_deg": args.origin,
        "load": args.load,
        "step_mm": args.step,
        "force_N": args.force,
        "partial": args.partial,
        "require_N_per_mm": args.require,
        "compare_with": args.compare,
    }


def _run_single(args: argparse.Namespace, file: str) -> int:
    """Analyze, write, print; the exit code."""
    from toolpath_stiff.api.programs import analyze
    from toolpath_stiff.report.analysis import names

    target = destination(args, "analyze", [file]).check(names(not args.no_plots, args.format))
    with progress_line(quiet=args.json) as progress:
        found = analyze(machine_for(args), program_for(args, file), progress=progress, **_asked(args))
    show(args, found, target, table=args.format, show_plunges=args.show_plunges)
    if found.below_required:
        return BELOW_REQUIRED
    return 0 if found.complete else INCOMPLETE


def _run_many(args: argparse.Namespace, found: Sequence[Found], counts: Sequence[FolderCount]) -> int:
    """The same of many; nothing is printed before the arguments have been found right."""
    from toolpath_stiff.api.many import analyze_many
    from toolpath_stiff.report import plain

    def told(text: str, done: int, total: int) -> None:
        if done == 0 and not args.json:
            for count in counts:
                print(plain(str(count)), flush=True)
        say(f"{done}/{total} programs, {plain(text)}")

    try:
        with _executor(args) as executor:
            result = analyze_many(
                machine_for(args),
                found,
                args.out or "reports",
                executor=executor,
                jobs=args.jobs,
                plots=not args.no_plots,
                table=args.format,
                show_plunges=args.show_plunges,
                replace=args.replace,
                progress=told,
                **_asked(args),
                **reading_options(args),
            )
    finally:
        say("")
    if args.json:
        sys.stdout.writelines(result.json_pieces())
    else:
        print(f"{result}\n{written_text(result.written)}")
    if not result.complete:
        return INCOMPLETE
    return BELOW_REQUIRED if result.below_required else 0


@contextmanager
def _executor(args: argparse.Namespace) -> Iterator[Executor | None]:
    """The executor of --cluster; None without it. Raises `InputError` where there is no scheduler."""
    if args.cluster is None:
        yield None
        return
    if args.jobs is not None:
        raise InputError("--jobs with --cluster", hint="the cluster's workers say how many programs analyze at a time")
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--cluster needs the package distributed", hint="run `pip install 'toolpath-stiff[cluster]'`"
        ) from None
    try:
        client: Any = Client(args.cluster, timeout=CONNECT_SECONDS, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, ImportError) as error:  # ImportError: a protocol that is not installed
        told = " ".join(str(error).split())
        raise InputError(
            f"--cluster {args.cluster}: {told}", expected="the address of a Dask scheduler, as tcp://10.0.0.5:8786"
        ) from None
    with client:
        if not client.scheduler_info()["workers"]:
            print(f"tps: note: {args.cluster} has no worker yet, the programs wait for one", file=sys.stderr)
        yield client.get_executor(pure=False)


# -- tps path ---------------------------------------------------------------------------------------------------------

PATH_EPILOG = """\
example:
  tps path programs/pocket.nc --step 0.5 --csv | head

Columns: line, motion (rapid, feed, arc, cycle), tool, s_mm and t_s along the path, the tool tip x_mm,y_mm,z_mm and
the rotary axes a_deg,b_deg,c_deg in machine coordinates, feed_mm_per_min (empty for rapids). Program zero lies at
0,0,0 unless --origin or the program's own G10 says otherwise. Every move has samples at both of its ends.
"""


def path_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = PATH_EPILOG
    parser.add_argument("program", metavar="PROGRAM", help="NC program or cutter-location file")
    add_program_options(parser)
    target = parser.add_mutually_exclusive_group()
    target.add_argument("--csv", action="store_true", help="write CSV to standard output (the default)")
    target.add_argument("--out", metavar="FILE", help="write CSV to a file")
    add_replace_option(parser)


def path(args: argparse.Namespace) -> int:
    """Sample, write."""
    from toolpath_stiff.api.programs import sample_path

    replaced = check_single(args, args.out, mark=b"line,motion,tool,s_mm")
    found = sample_path(program_for(args, args.program), origin_mm_deg=args.origin, step_mm=args.step)
    if args.out:
        keep(replaced)
        found.save(args.out)
    else:
        for piece in found.csv():
            sys.stdout.write(piece.decode())
            if getattr(sys.stdout, "gone", False):  # nobody reads on
                break
    for warning in found.warnings:
        print(f"tps: warning: {found.name}: {warning}", file=sys.stderr)
    for note in found.unsupported:
        print(f"tps: note: {note}", file=sys.stderr)
    return 0


# -- tps check --------------------------------------------------------------------------------------------------------

CHECK_EPILOG = """\
examples:
  tps check part.nc
  tps check part.nc --dialect fanuc --json
  tps check part.nc --strut-speed 5000         warn of cuts in which a strut is faster, mm/min
  tps check part.nc --machine none             the program alone, no reach and no strut speeds
  tps check part.ngc --interpreter auto        by LinuxCNC's interpreter where ours does not read it to its end

Where the reader would refuse the program, the check says so and goes on with the next block; what it says of extents,
lengths and times is then that of the blocks that could be read. Extents are those of the tool tip in program
coordinates of G54, mm and degrees. Exit code 1 if there is any error.
"""
NO_MACHINE = "none"


def check_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = CHECK_EPILOG
    parser.add_argument("program", metavar="PROGRAM", help="NC program or cutter-location file")
    add_program_options(parser)
    parser.add_argument(
        "--machine",
        default="nist",
        metavar="NAME|FILE",
        help="machine whose reach and strut speeds are checked; none: no machine (default: nist)",
    )
    parser.add_argument(
        "--strut-speed", type=positive_number("mm/min", 1e6), metavar="MM/MIN", help="largest speed of a strut"
    )
    add_json_option(
        parser,
        "print JSON: used, unsupported, findings, extents_mm, lengths_mm, times_s, tools, operations, modal state",
    )


def check(args: argparse.Namespace) -> int:
    """Check and print; 1 if there is any error."""
    from toolpath_stiff.api.programs import check

    found = check(
        program_for(args, args.program),
        None if args.machine == NO_MACHINE else args.machine,
        origin_mm_deg=args.origin,
        step_mm=args.step,
        strut_speed_mm_per_min=args.strut_speed,
    )
    sys.stdout.write(found.to_json() if args.json else str(found))
    return 1 if found.errors else 0


# Command -> what declares its arguments, what runs it.
COMMANDS = {
    "analyze": (analyze_arguments, analyze),
    "path": (path_arguments, path),
    "check": (check_arguments, check),
}
