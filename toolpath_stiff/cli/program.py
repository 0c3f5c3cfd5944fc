"""The commands on a program: analyze, path, check, place, case-study."""

import sys
from argparse import Namespace
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Annotated, Any

import toolpath_stiff as tps
from toolpath_stiff.api.programs import Jobs, Table
from toolpath_stiff.cli import run
from toolpath_stiff.cli.parser import FOLDER, JSON, PROGRAM, REPLACE, command
from toolpath_stiff.errors import InputError
from toolpath_stiff.options import Option, numbers
from toolpath_stiff.report.analysis import unwritten
from toolpath_stiff.report.batch.programs import find_programs

BELOW_REQUIRED = 3  # exit code
INCOMPLETE = 1  # exit code: samples were left out, or of several programs one failed
CONNECT_SECONDS = 10  # for a scheduler to answer
NO_MACHINE = "none"
READ = ("Program.read", "Machine.load", "Machine.under")


@command("analyze", "analyze", *READ, *FOLDER)
def analyze(
    args: Namespace,
    programs: Annotated[Sequence[str], Option("PROGRAM", count="+")],
    table: Table = "csv",
    jobs: Jobs = None,
    cluster: Annotated[str | None, Option("--cluster", "ADDRESS", instead_of="jobs")] = None,
) -> int:
    """Stiffness along the path of NC programs.

    for example:
      tps analyze programs/pocket.nc --origin 100,-50,800 --load normal --require 40000
      tps analyze programs more/part.nc --jobs 4    all programs of a folder and one more, four at a time
      tps analyze programs/pocket.nc --cut programs/pocket_cut.toml --tolerance 20    the error of the surface, um

    plunges:
      With the tangential load, cuts along the tool axis (within 5 degrees of it) are left out of mean, range, weakest
      place, axes and colours: a few short plunges into a stiff direction would dominate them all. Their figures
      are reported separately, and --require applies to them as well.

    files written to --out:
      samples.csv   every sample (the end alone of a move shorter than half a step): line, position, stiffness,
                    joint values, margin to the nearest limit
      summary.json  the figures, those of each tool and operation too, what was assumed, what was not acted upon
      path.png      three views of the path coloured by stiffness
      profile.png   stiffness along the path
      report.html   the path in 3-D, linked to profile and program text; one file, no network
      with --cut also
      cut.csv       every sample: engagement, forces, deflection, error of left wall, right wall and floor
      cut_lines.csv the same by line
      surface.vtk   the finished part with its error in um, for ParaView and the like
      cut.png       the finished part, coloured by its error

    several programs, or a folder:
      a folder stands for the programs in it and below it: .nc .ngc .tap .cnc .gcode .gc .eia .mpf .min, and the
      cutter-location files .apt .aptsource .cl .cls .clsf .ncl, in small letters or capitals; hidden files and linked
      folders are ignored. Each program has the files above in a folder of its own below --out (default: reports), and
      beside these folders there are
      index.html    all programs in one sortable table, drawn on one scale of stiffness; failures with their reason
      summary.csv   the same for a spreadsheet, one row per program
      A program that fails does not stop the others and is named at the end.

    exit code
      one program: 0 done; 1 --partial left samples out; 2 the input is wrong; 3 a cutting move is below --require, or
      a surface leaves --tolerance
      several: 0 done; 1 a program failed, or --partial left samples out; 2 the arguments are wrong, nothing was
      started;
      3 a cutting move is below --require and no program failed

    Parameters
    ----------
    programs
        NC program or cutter-location file, or a folder of them.
    table
        Format of the samples.
    jobs
        Programs at a time, each in a process of this computer; 1: all in this process. Unless given, one for each
        available CPU.
    cluster
        Hand the programs to the workers of a Dask cluster instead, one program a task; ADDRESS is its scheduler's, as
        tcp://10.0.0.5:8786. Workers must see the programs and --out by the same paths (pip install
        'toolpath-stiff[cluster]').
    """
    files, counts = find_programs(programs)
    plots = not args.no_plots
    if counts or len(files) > 1 or cluster:
        options = run.given(args, tps.analyze, tps.Program.read)
        options |= {"plots": plots, "table": table, "jobs": jobs, "replace": args.replace}
        executor = _executor(cluster) if cluster else None
        with run.progress_line() as progress:
            analyses = tps.analyze_many(
                programs, run.machine_for(args), args.out or "reports", executor=executor, progress=progress, **options
            )
        if counts and not args.json:
            print(*counts, sep="\n")
        code = (BELOW_REQUIRED if analyses.below_required else 0) if analyses.complete else INCOMPLETE
        return run.show(args, analyses, run.written_text(analyses.written), code=code)
    file = files[0].file
    folder, rules = run.destination(args, tps.Analysis, [file], unwritten(table, bool(args.cut or args.material)))
    analysis = run.call(args, tps.analyze, program=tps.Program.read(file, **run.given(args, tps.Program.read)))
    written = analysis.save(folder, plots=plots, rules=rules, table=table)
    missed = analysis.below_required or analysis.beyond_tolerance
    code = BELOW_REQUIRED if missed else 0 if analysis.complete else INCOMPLETE
    return run.show(args, analysis, run.written_text(written), code=code)


def _executor(address: str) -> Executor:
    """The executor of a Dask cluster. Raises `InputError` where there is no scheduler."""
    try:
        from distributed import Client

        client: Any = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)  # type: ignore[no-untyped-call]
        executor: Executor = client.get_executor(pure=False)
    except (OSError, ValueError, ImportError) as error:  # ImportError: no such package, or no such protocol
        raise InputError(
            f"--cluster {address}: {' '.join(str(error).split())}",
            expected="the address of a Dask scheduler, as tcp://10.0.0.5:8786",
            hint="run `pip install 'toolpath-stiff[cluster]'` if distributed is missing",
        ) from None
    return executor


@command("path", PROGRAM, "sample_path", "Program.read", REPLACE)
def path(
    args: Namespace,
    csv: Annotated[bool, Option("--csv", help="write CSV to standard output (the default)")] = False,
    out: Annotated[str | None, Option("--out", "FILE", instead_of="csv", help="write CSV to a file")] = None,
) -> int:
    """The sampled path alone, without a machine.

    for example:
      tps path programs/pocket.nc --step 0.5 --csv | head

    Columns: line, motion (rapid, feed, arc, cycle), tool, s_mm and t_s along the path, the tool tip x_mm,y_mm,z_mm and
    the rotary axes a_deg,b_deg,c_deg in machine coordinates, feed_mm_per_min (empty for rapids). Program zero lies at
    0,0,0 unless --origin or the program's own G10 says otherwise. Every move has samples at both of its ends.
    """
    sampled = run.call(args, tps.sample_path)
    if out:
        run.write_single(args, {Path(out): sampled.csv()})
    else:
        sys.stdout.writelines(piece.decode() for piece in sampled.csv())
    run.tell("warning", (f"{sampled.name}: {warning}" for warning in sampled.warnings))
    run.tell("note", sampled.unsupported)
    return 0


@command("check", PROGRAM, "check", "Program.read", JSON)
def check(
    args: Namespace,
    machine: Annotated[str, Option("--machine", "NAME|FILE")] = "nist",
) -> int:
    """What a program uses, what is not understood, extents, times, reach.

    for example:
      tps check part.nc
      tps check part.nc --dialect fanuc --json
      tps check part.nc --machine none             the program alone, no reach and no strut speeds
      tps check part.ngc --interpreter auto        by LinuxCNC's interpreter where ours does not read it to its end

    Where the reader would refuse the program, the check says so and goes on with the next block; what it says of
    extents, lengths and times is then that of the blocks that could be read. Extents are those of the tool tip in
    program coordinates of G54, mm and degrees. Exit code 1 if there is any error.

    Parameters
    ----------
    machine
        Machine whose reach and strut speeds are checked; none: no machine.
    """
    findings = run.call(args, tps.check, machine=None if machine == NO_MACHINE else machine)
    return run.show(args, findings, code=1 if findings.errors else 0)


@command("place", PROGRAM, "place", *READ, *FOLDER)
def place(args: Namespace) -> int:
    """Where the work should sit: Pareto front and one recommended placement.

    for example:
      tps place programs/pocket.nc --x -300:300 --y -300:300 --z 400:1250
      tps place programs/pocket.nc --z-values 400,600,800 --rotate 0 --objective mean
      tps place programs/pocket.nc --keep-out vice:100,100,0,300,300,900
      tps place programs/pocket.nc --rotate 0 --write placed.nc
      tps place programs/pocket.nc --x 40 --y 25.5 --z 900 --rotate 0 --write placed.nc

    The recommended placement is never worse than the present one in mean, range or weakest place, if one such can be
    found.

    A placement is where program zero sits and how the work is turned about it: the numbers of --origin. Files written
    to --out: placements.csv (the front), placement.json, setup.pdf, report.html
    (click a placement of the front, see the path there).
    """
    run.check_single(args, args.write)
    folder, rules = run.destination(args, tps.Placement, [args.program])
    placement = run.call(args, tps.place)
    written = placement.save(folder, plots=not args.no_plots, rules=rules)
    if args.write and not placement.refusal:
        written += run.write_single(args, {Path(args.write): placement.program_bytes})
    run.show(args, placement, run.written_text(written))
    if placement.refusal:
        raise InputError(
            f"{args.write} was not written; the search is kept in {folder}: {placement.refusal}",
            hint=f"place it there without a search by {placement.fixed}",
        )
    return 0


def _region(text: str) -> tuple[str, tuple[float, ...]]:
    name, _, place = text.rpartition(":")
    values = numbers(place) if name else ()
    if len(values) not in (3, 4):
        raise ValueError("NAME:X,Y,Z or NAME:X,Y,Z,TURN")
    return name, values


Region = tuple[str, tuple[float, ...]]


@command("case-study", "case_study", *READ, *FOLDER)
def case_study(
    args: Namespace,
    program: Annotated[str | None, Option("PROGRAM")] = None,
    region: Annotated[Sequence[Region], Option("--region", "NAME:X,Y,Z[,TURN]", read=_region, count="append")] = (),
) -> int:
    """The paper's four regions: one path at two heights, displaced and turned.

    for example:
      tps case-study
      tps case-study programs/pocket.nc
      tps case-study programs/pocket.nc --region left:-200,0,800 --region right:200,0,800,90

    Writes case_study.csv, case_study.json, case_study.md, regions.png and heights.png: one tool path at two heights,
    displaced and turned, as the paper's Figure 10; its three conclusions checked one by one; where they stop holding.

    Parameters
    ----------
    program
        NC program or cutter-location file (default: the contour of a 200 mm square).
    region
        Where program zero sits, mm, and how far the path is turned about it, degrees; once for each region (default:
        four of the reference machine).
    """
    named = dict(region)
    if len(named) < len(region):
        raise InputError("--region: a name is given twice", expected="a name of its own for each region")
    return run.to_folder(args, tps.case_study, tps.CaseStudy, [program or args.machine], regions=named or None)
