"""The commands on a program and on its placement: analyze, path, check; place, case-study."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import (
    add_json_option,
    add_load_options,
    add_machine_options,
    add_program_options,
    add_replace_option,
    check_single,
    destination,
    finite_number,
    keep,
    machine_for,
    positive_number,
    program_for,
    progress_line,
    range_argument,
    reading_options,
    say,
    show,
    tell_incomplete,
    written_text,
)
from toolpath_stiff.defaults import OBJECTIVES
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import both_names

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

# -- tps place --------------------------------------------------------------------------------------------------------

PLACE_EPILOG = """\
examples:
  tps place programs/pocket.nc --x -300:300 --y -300:300 --z 400:1250
  tps place programs/pocket.nc --z-values 400,600,800 --rotate 0 --objective mean
  tps place programs/pocket.nc --keep-out vice:100,100,0,300,300,900
  tps place programs/pocket.nc --rotate 0 --write placed.nc
  tps place programs/pocket.nc --rotate 0 --pick 7 --write placed.nc

The recommended placement is never worse than the present one in mean, range or weakest place, if one such can be found.

A placement is where program zero sits and how the work is turned about it: the numbers of --origin. Files written to
--out: placements.csv (the front), placement.json, front.png, profiles.png, map.png, setup.pdf,
report.html (click a placement of the front, see the path there).
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
    from toolpath_stiff.report.analysis.summary import names

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
    from toolpath_stiff.report.words import plain

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


def _add_bounds(parser: argparse.ArgumentParser) -> None:
    """Options about what a search may vary."""
    group = parser.add_argument_group(
        "what may vary (LO:HI, or one number to fix it; default: as far as the machine reaches)"
    )
    for axis in "xy":
        group.add_argument(f"--{axis}", type=range_argument, metavar="LO:HI", help=f"{axis} of program zero, mm")
    heights = group.add_mutually_exclusive_group()
    heights.add_argument("--z", type=range_argument, metavar="LO:HI", help="z of program zero, mm")
    heights.add_argument("--z-values", type=_heights, metavar="Z,Z,...", help="the only heights that are available, mm")
    group.add_argument(
        "--rotate", type=range_argument, default=(0.0, 360.0), metavar="LO:HI", help="degrees (default: 0:360)"
    )
    for axis in "ab":
        group.add_argument(
            f"--tilt-{axis}",
            type=range_argument,
            default=(0.0, 0.0),
            metavar="LO:HI",
            help="tilt of the set-up, degrees (default: 0)",
        )
    group.add_argument(
        "--keep-out", action="append", default=[], type=_keep_out, metavar="NAME:X0,Y0,Z0,X1,Y1,Z1",
        help="box that the tool tip must stay out of, rapids included, machine coordinates, mm",
    )  # fmt: skip
    group.add_argument(
        "--margin",
        type=_percent,
        default=1.0,
        metavar="PERCENT",
        help="distance that cuts and rapids keep from each limit, in per cent of its span (default: 1)",
    )
    group.add_argument(
        "--allow-extrapolation",
        action="store_true",
        help="let struts leave the lengths of their law at more samples than now",
    )


def place_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = PLACE_EPILOG
    parser.add_argument("program", metavar="PROGRAM", help="NC program or cutter-location file")
    _add_bounds(parser)
    parser.add_argument(
        "--objective",
        type=_objective,
        choices=OBJECTIVES,
        default="balanced",
        help="balanced: mean - range (default); whatever it is, none of mean, range, weakest gets worse where that "
        "can be avoided",
    )
    parser.add_argument(
        "--pick",
        type=int,
        metavar="N",
        help="take point N of the front in --out (number in placements.csv) instead of the recommended one, without "
        "searching again; leave the other options unchanged",
    )
    parser.add_argument("--points", type=int, default=60, metavar="N", help="most points of the front (default: 60)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the search (default: 1)")
    parser.add_argument("--out", metavar="DIR", help="folder (default: reports/<program>-place)")
    _add_write_options(parser)
    add_replace_option(parser, force=False)
    parser.add_argument("--no-plots", action="store_true", help="only placements.csv and placement.json")
    add_json_option(parser, "print placement.json to standard output and nothing else")
    add_program_options(parser)
    add_machine_options(parser)
    add_load_options(parser)


def _add_write_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("the program itself, transformed to the recommended placement")
    group.add_argument(
        "--write", metavar="FILE", help="write the program so that, run at the present origin, it cuts at the placement"
    )
    group.add_argument(
        "--decimals", type=int, metavar="N", help="of its numbers (default: 4 in mm and degrees, 5 in inch)"
    )
    group.add_argument(
        "--linearise",
        type=positive_number("mm", 10.0),
        metavar="MM",
        help="write arcs that the turn takes out of the planes as straight moves within MM (default: refuse them)",
    )


def _percent(text: str) -> float:
    value = finite_number(text)
    if not 0.0 <= value < 50.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected 0 to less than 50 (per cent)")
    return value


def _objective(text: str) -> str:
    if text == "min":
        raise argparse.ArgumentTypeError("'min' is called 'weakest' now")
    return text


def _heights(text: str) -> list[float]:
    return sorted({finite_number(part) for part in text.split(",")})


def _keep_out(text: str) -> tuple[str, list[float]]:
    name, _, numbers = text.rpartition(":")
    values = [finite_number(part) for part in numbers.split(",")]
    if not name or len(values) != 6:
        raise argparse.ArgumentTypeError(f"{text!r}: expected NAME:X0,Y0,Z0,X1,Y1,Z1")
    for low, high, axis in zip(values[:3], values[3:], "XYZ", strict=True):
        if low >= high:
            raise argparse.ArgumentTypeError(f"{text!r}: {axis}1 = {high:g} is not above {axis}0 = {low:g}")
    return name, values


def place(args: argparse.Namespace) -> int:
    """Search, or take another point of an earlier search; write the files."""
    from toolpath_stiff.api.placements import KeepOut, place
    from toolpath_stiff.report.place.page import names

    replaced = check_single(args, args.write)
    target = destination(args, "place", [args.program], "-place").check(names(not args.no_plots))
    if args.pick is not None:
        tell_incomplete([target.folder])
    with progress_line(quiet=args.json) as progress:
        found = place(
            machine_for(args),
            program_for(args, args.program),
            x_mm=args.x,
            y_mm=args.y,
            z_mm=args.z,
            z_values_mm=args.z_values or (),
            rotate_deg=args.rotate,
            tilt_a_deg=args.tilt_a,
            tilt_b_deg=args.tilt_b,
            keep_out=[KeepOut(name, tuple(box[:3]), tuple(box[3:])) for name, box in args.keep_out],
            margin_percent=args.margin,
            allow_extrapolation=args.allow_extrapolation,
            objective=args.objective,
            points=args.points,
            seed=args.seed,
            pick=args.pick,
            earlier=Path(target.folder, "placement.json"),
            origin_mm_deg=args.origin,
            load=args.load,
            step_mm=args.step,
            force_N=args.force,
            write=args.write,
            decimals=args.decimals,
            linearise_mm=args.linearise,
            progress=progress,
        )
    keep(replaced, quiet=args.json)
    code = show(args, found, target, {args.write: found.program_bytes} if args.write and not found.refusal else {})
    if found.refusal:
        raise InputError(
            f"{args.write} was not written; the search is kept in {target.folder} "
            f"({both_names('--pick')} takes it up): {found.refusal}"
        )
    return code


# -- tps case-study ---------------------------------------------------------------------------------------------------

CASE_STUDY_EPILOG = """\
examples:
  tps case-study
  tps case-study programs/pocket.nc
  tps case-study programs/pocket.nc --region left:-200,0,800 --region right:200,0,800,90
  tps case-study programs/pocket.nc --regions reports/case_study/case_study.csv

Writes case_study.csv, case_study.json, case_study.md, regions.png and heights.png: one tool path at two heights,
displaced and turned, as the paper's Figure 10; its three conclusions checked one by one; where they stop holding.
A file of regions has the columns region, x_mm, y_mm, z_mm, rotation_deg (CSV or FILE.xlsx[#SHEET]).
"""


def case_study_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = CASE_STUDY_EPILOG
    parser.add_argument(
        "program",
        nargs="?",
        metavar="PROGRAM",
        help="NC program or cutter-location file (default: the packaged contour of a 200 mm square)",
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--region", action="append", default=[], type=_region, metavar="NAME:X,Y,Z[,TURN]",
        help="where program zero sits, mm, and how far the path is turned about it, degrees; once for each region "
        "(default: four of the reference machine)",
    )  # fmt: skip
    where.add_argument("--regions", metavar="FILE", help="the same as a table")
    parser.add_argument(
        "--out", metavar="DIR", help="folder (default: reports/<machine>-case-study, or <program>-case-study)"
    )
    add_replace_option(parser, force=False)
    parser.add_argument("--no-plots", action="store_true", help="no pictures")
    add_program_options(parser, placed=False)
    add_machine_options(parser)
    add_json_option(parser, "print case_study.json to standard output and nothing else")


def _region(text: str) -> tuple[str, list[float]]:
    name, _, numbers = text.rpartition(":")
    values = [finite_number(part) for part in numbers.split(",")]
    if not name or len(values) not in (3, 4):
        raise argparse.ArgumentTypeError(f"{text!r}: expected NAME:X,Y,Z or NAME:X,Y,Z,TURN")
    return name, values


def case_study(args: argparse.Namespace) -> int:
    """Analyze the regions and write the files."""
    from toolpath_stiff.api.case_studies import case_study
    from toolpath_stiff.report.case_study import names

    regions = dict(args.region)
    if len(regions) < len(args.region):
        raise InputError("--region: a name is given twice", expected="a name of its own for each region")
    source = args.program or args.machine
    target = destination(args, "case-study", [source], "-case-study").check(names(not args.no_plots))
    program = None if args.program is None else program_for(args, args.program)
    found = case_study(machine_for(args), program, regions or args.regions, step_mm=args.step)
    return show(args, found, target)


# Command -> what declares its arguments, what runs it.


# Command -> what declares its arguments, what runs it.
COMMANDS = {
    "analyze": (analyze_arguments, analyze),
    "path": (path_arguments, path),
    "check": (check_arguments, check),
    "place": (place_arguments, place),
    "case-study": (case_study_arguments, case_study),
}
