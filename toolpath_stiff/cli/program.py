"""The commands on a program: analyze, path, check."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import toolpath_stiff as tps
from toolpath_stiff.api import programs
from toolpath_stiff.cli.calls import call, given, machine_for, program_for
from toolpath_stiff.cli.outputs import check_single, destination, keep, show, tell, written_text
from toolpath_stiff.cli.parser import FOLDER, JSON, PROGRAM, REPLACE, Command, own
from toolpath_stiff.cli.progress import say
from toolpath_stiff.defaults import one_thread
from toolpath_stiff.errors import InputError
from toolpath_stiff.options import Argument

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from toolpath_stiff.report.batch.programs import FolderCount, Found

BELOW_REQUIRED = 3  # exit code
INCOMPLETE = 1  # exit code: samples were left out, or of several programs one failed
CONNECT_SECONDS = 10  # for a scheduler to answer
NO_MACHINE = "none"


def analyze(args: Namespace) -> int:
    """Stiffness along the path of NC programs.

    for example:
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
      several: 0 done; 1 a program failed, or --partial left samples out; 2 the arguments are wrong, nothing was
      started;
      3 a cutting move is below --require and no program failed
    """
    one_thread()  # before numpy is loaded
    if len(args.programs) == 1 and os.path.isfile(args.programs[0]) and not args.cluster:  # noqa: PTH113  (false for a name that none can have)
        return _analyze_one(args, args.programs[0])  # without loading what lists many
    from toolpath_stiff.report.batch.programs import find_programs

    files, counts = find_programs(args.programs)
    if counts or len(files) > 1 or args.cluster:
        return _analyze_many(args, files, counts)
    return _analyze_one(args, files[0].file)


def _analyze_one(args: Namespace, file: str) -> int:
    from toolpath_stiff.report.analysis import other_samples

    target = destination(args, tps.Analysis, [file], other_samples(args.table))
    analysis = call(args, tps.analyze, program=program_for(args, file))
    saving = {"plots": not args.no_plots, "table": args.table, "show_plunges": args.show_plunges}
    show(args, analysis, written_text(target.write(analysis, **saving)))
    if analysis.below_required:
        return BELOW_REQUIRED
    return 0 if analysis.complete else INCOMPLETE


def _analyze_many(args: Namespace, files: Sequence[Found], counts: Sequence[FolderCount]) -> int:
    from toolpath_stiff.report.words import plain

    def progress(text: str, done: int, total: int) -> None:
        if done == 0 and not args.json:  # all arguments have been found right
            for count in counts:
                print(plain(str(count)), flush=True)
        say(f"{done}/{total} programs, {plain(text)}")

    try:
        with _executor(args) as executor:
            analyses = tps.analyze_many(
                files,
                machine_for(args),
                args.out or "reports",
                executor=executor,
                plots=not args.no_plots,
                replace=args.replace,
                progress=progress,
                **given(args, tps.analyze, tps.analyze_many, tps.Program.read),
            )
    finally:
        say("")
    if args.json:
        _write_pieces(analyses.json_pieces())
    else:
        show(args, analyses, written_text(analyses.written))
    if not analyses.complete:
        return INCOMPLETE
    return BELOW_REQUIRED if analyses.below_required else 0


@contextmanager
def _executor(args: Namespace) -> Iterator[Executor | None]:
    """The executor of --cluster; None without it. Raises `InputError` where there is no scheduler."""
    if args.cluster is None:
        yield None
        return
    if args.jobs is not None:
        raise InputError("--jobs with --cluster", hint="the cluster's workers say how many programs analyze at a time")
    try:
        from distributed import Client

        client: Any = Client(args.cluster, timeout=CONNECT_SECONDS, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, ImportError) as error:  # ImportError: a protocol that is not installed, or all of it
        if "distributed" not in sys.modules or sys.modules["distributed"] is None:
            hint = "run `pip install 'toolpath-stiff[cluster]'`"
            raise InputError("--cluster needs the package distributed", hint=hint) from None
        raise InputError(
            f"--cluster {args.cluster}: {' '.join(str(error).split())}",
            expected="the address of a Dask scheduler, as tcp://10.0.0.5:8786",
        ) from None
    with client:
        if not client.scheduler_info()["workers"]:
            tell("note", [f"{args.cluster} has no worker yet, the programs wait for one"])
        yield client.get_executor(pure=False)


def _write_pieces(pieces: Iterable[str | bytes]) -> None:
    """Text in pieces on standard output, as long as somebody reads it."""
    for piece in pieces:
        sys.stdout.write(piece if isinstance(piece, str) else piece.decode())
        if getattr(sys.stdout, "gone", False):
            return


def path(args: Namespace) -> int:
    """The sampled path alone, without a machine.

    for example:
      tps path programs/pocket.nc --step 0.5 --csv | head

    Columns: line, motion (rapid, feed, arc, cycle), tool, s_mm and t_s along the path, the tool tip x_mm,y_mm,z_mm and
    the rotary axes a_deg,b_deg,c_deg in machine coordinates, feed_mm_per_min (empty for rapids). Program zero lies at
    0,0,0 unless --origin or the program's own G10 says otherwise. Every move has samples at both of its ends.
    """
    replaced = check_single(args, args.out, mark=b"line,motion,tool,s_mm")
    sampled = call(args, tps.sample_path)
    if args.out:
        keep(replaced)
        sampled.save(args.out)
    else:
        _write_pieces(sampled.csv())
    tell("warning", (f"{sampled.name}: {warning}" for warning in sampled.warnings))
    tell("note", sampled.unsupported)
    return 0


def check(args: Namespace) -> int:
    """What a program uses, what is not understood, extents, times, reach.

    for example:
      tps check part.nc
      tps check part.nc --dialect fanuc --json
      tps check part.nc --strut-speed 5000         warn of cuts in which a strut is faster, mm/min
      tps check part.nc --machine none             the program alone, no reach and no strut speeds
      tps check part.ngc --interpreter auto        by LinuxCNC's interpreter where ours does not read it to its end

    Where the reader would refuse the program, the check says so and goes on with the next block; what it says of
    extents, lengths and times is then that of the blocks that could be read. Extents are those of the tool tip in
    program coordinates of G54, mm and degrees. Exit code 1 if there is any error.
    """
    findings = call(args, tps.check, **({"machine": None} if args.machine == NO_MACHINE else {}))
    show(args, findings)
    return 1 if findings.errors else 0


READ = (tps.Program.read, tps.Machine.load, tps.Machine.under)
CLUSTER = own(
    "--cluster ADDRESS",
    "hand the programs to the workers of a Dask cluster instead, one program a task; ADDRESS is its scheduler's, as "
    "tcp://10.0.0.5:8786. Workers must see the programs and --out by the same paths "
    "(pip install 'toolpath-stiff[cluster]')",
)
COMMANDS = {
    "analyze": Command(
        analyze,
        own("PROGRAM", "NC program or cutter-location file, or a folder of them", name="programs", count="+"),
        tps.analyze,
        Argument("table", programs.FORMAT, default="csv"),
        Argument("show_plunges", programs.SHOW_PLUNGES, kind=bool, default=False),
        Argument("jobs", programs.JOBS, kind=int),
        CLUSTER,
        *READ,
        *FOLDER,
    ),
    "path": Command(
        path,
        PROGRAM,
        tps.sample_path,
        tps.Program.read,
        own("--csv", "write CSV to standard output (the default)"),
        own("--out FILE", "write CSV to a file", instead_of="csv"),
        REPLACE,
    ),
    "check": Command(
        check,
        PROGRAM,
        own(
            "--machine NAME|FILE", "machine whose reach and strut speeds are checked; none: no machine", default="nist"
        ),
        tps.check,
        tps.Program.read,
        JSON,
    ),
}
