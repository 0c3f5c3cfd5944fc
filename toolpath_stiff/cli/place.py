"""`tps place`: where the work should sit."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import (
    add_json_option,
    add_load_options,
    add_machine_options,
    add_program_options,
    controller_for,
    finite_number,
    length_m,
    model_for,
    range_argument,
    read_program_for,
)
from toolpath_stiff.cli.measurement_arguments import check_seed
from toolpath_stiff.cli.outputs import add_replace_option, check_written, keep
from toolpath_stiff.errors import InputError

if TYPE_CHECKING:
    from toolpath_stiff.analysis import Analysis
    from toolpath_stiff.machine import Machine
    from toolpath_stiff.nc import Program
    from toolpath_stiff.placement.batch import Keepout
    from toolpath_stiff.placement.search import Bounds
    from toolpath_stiff.units import Pose

EPILOG = """\
examples:
  tps place programs/pocket.nc --x -300:300 --y -300:300 --z 400:1250
  tps place programs/pocket.nc --z-values 400,600,800 --rotate 0 --objective mean
  tps place programs/pocket.nc --keep-out vice:100,100,0,300,300,900
  tps place programs/pocket.nc --rotate 0 --write placed.nc

A placement is where program zero sits and how the work is turned about it: the numbers of --origin. Files written to
--out: placements.csv (the front), placement.json, front.png, profiles.png, map.png, setup.pdf,
report.html (click a placement of the front, see the path there).
"""
FARTHEST_MM = 1e5
FARTHEST_TURN = 720.0
OWN_FILES = (
    "placements.csv", "placement.json", "report.html", "front.png", "profiles.png", "map.png", "setup.pdf",
)  # fmt: skip
OBJECTIVES = ("balanced", "mean", "range", "min")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("program", metavar="PROGRAM", help="NC program or cutter-location file")
    group = parser.add_argument_group(
        "what may vary (LO:HI, or one number to fix it; default: as far as the machine reaches)"
    )
    for axis in "xy":
        group.add_argument(f"--{axis}", type=range_argument, metavar="LO:HI", help=f"{axis} of program zero, mm")
    heights = group.add_mutually_exclusive_group()
    heights.add_argument("--z", type=range_argument, metavar="LO:HI", help="z of program zero, mm")
    heights.add_argument("--z-values", type=_heights, metavar="Z,Z,...", help="the only heights there are, mm")
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
        help="box that the tool tip must stay out of, machine coordinates, mm",
    )  # fmt: skip
    parser.add_argument("--objective", choices=OBJECTIVES, default="balanced", help="balanced: mean - range (default)")
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
    group.add_argument("--write", metavar="FILE", help="write it: run at the present origin it cuts as placed")
    group.add_argument(
        "--decimals", type=int, metavar="N", help="of its numbers (default: 4 in mm and degrees, 5 in inch)"
    )
    group.add_argument(
        "--linearise",
        type=length_m(10.0),
        metavar="MM",
        help="write arcs that the turn takes out of the planes as straight moves within MM (default: refuse them)",
    )


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


def run(args: argparse.Namespace) -> int:
    """Search, analyse the recommended placement, write the files."""
    from toolpath_stiff.analysis.loads import parse_load
    from toolpath_stiff.analysis.path_analysis import analyse
    from toolpath_stiff.cli.progress import progress_bar
    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.placement.batch import work_path
    from toolpath_stiff.placement.report_data import analyse_before, front_rows, placement_summary, pose_of
    from toolpath_stiff.placement.search import search_placements
    from toolpath_stiff.rewriting import check_rewritable

    if not 2 <= args.points <= 1000:
        raise InputError(f"--points {args.points}", expected="2 to 1000")
    check_seed(args.seed)
    _check_write(args)
    replaced = check_written(args, [args.write, *(_folder(args) / name for name in OWN_FILES)])
    model = model_for(args)
    program = read_program_for(args, args.program, model.machine)
    if args.write:
        check_rewritable(program)
    if args.write and program.interpreter != "builtin":
        raise InputError(
            f"--write {args.write}: {program.name} was read by LinuxCNC's interpreter; its blocks cannot be rewritten",
            hint="leave --write out and set the work offset",
        )
    load = parse_load(args.load)
    origin = args.origin or (program.origin if program.origin_source == "program" else model.machine.default_origin)
    options = {"load": load, "step": args.step, "force": args.force}
    before, reason = analyse_before(model, program, origin, **options)
    with progress_bar(f"{program.name}: search", quiet=args.json) as progress:
        found = search_placements(
            model,
            work_path(program, args.step),
            load,
            _bounds(args, model.machine),
            objective=args.objective,
            keepouts=_keepouts(args),
            seed=args.seed,
            points=args.points,
            force=args.force,
            progress=progress,
        )
    again = read_program_for(
        argparse.Namespace(**{**vars(args), "origin": pose_of(found.best)}), args.program, model.machine
    )
    best = analyse(model, again, origin=pose_of(found.best), **options)
    front = front_rows(model, again, found, args.step, args.force)
    summary = placement_summary(program, found, best, before, reason, front, args.objective, args.seed)
    rewritten, summary["written"] = _rewrite(args, again, best, origin)
    keep(replaced, quiet=args.json)
    files = _write(args, _folder(args), summary, best, before, program)
    if rewritten is not None:
        files.append(write_atomically(args.write, rewritten))
    if args.json:
        json.dump(summary, sys.stdout, indent=2)
        print()
    else:
        print(_table(summary))
        print("\n".join(["written:", *(f"  {file}" for file in files)]))
    return 0


def _folder(args: argparse.Namespace) -> Path:
    return Path(args.out) if args.out else Path("reports") / f"{Path(args.program).stem}-place"


def _check_write(args: argparse.Namespace) -> None:
    """What can be said of --write before the search."""
    from toolpath_stiff.rewriting import check_decimals

    if not args.write:
        for option in ("decimals", "linearise"):
            if getattr(args, option) is not None:
                raise InputError(f"--{option} without --write", hint="say with --write FILE where the program goes")
        return
    check_decimals(args.decimals)


def _rewrite(
    args: argparse.Namespace, program: Program, placed: Analysis, origin: Pose
) -> tuple[bytes | None, dict[str, Any] | None]:
    """The transformed program's bytes, and what `placement.json` says of it; None, None unless asked for."""
    if not args.write:
        return None, None
    import numpy as np

    from toolpath_stiff.placement.report_data import placement_row
    from toolpath_stiff.placement.written_path import rewriting_differences
    from toolpath_stiff.rewriting import rewrite_program

    controller = controller_for(args)
    reading: dict[str, Any] = {
        "offsets": controller.offsets,
        "tools": controller.tools,
        "block_delete": args.block_delete,
    }
    rewritten = rewrite_program(
        program, placed.origin, origin, decimals=args.decimals, linearise=args.linearise, **reading
    )
    return rewritten.content, {
        "file": args.write,
        "analysed_at": placement_row(np.array(origin)),
        "relative_difference": rewriting_differences(placed, rewritten, origin, **reading),
        "notes": list(rewritten.notes),
    }


def _bounds(args: argparse.Namespace, machine: Machine) -> Bounds:
    import numpy as np

    from toolpath_stiff.placement.search import Bounds
    from toolpath_stiff.units import m_from_mm, mm_from_m, rad_from_deg

    low, high = (mm_from_m(corner) for corner in machine.limits.workspace)
    given = [args.x, args.y, args.z]
    if args.z_values:
        given[2] = (args.z_values[0], args.z_values[-1])
    box = []
    for name, asked, lo, hi in zip("xyz", given, low, high, strict=True):
        if asked is None and not np.isfinite(hi - lo):
            raise InputError(f"the machine file bounds no workspace in {name}", hint=f"give --{name} LO:HI")
        box.append(asked if asked is not None else (float(lo), float(hi)))
    if max(abs(v) for pair in box for v in pair) > FARTHEST_MM:
        raise InputError("bounds beyond 100 m", expected="mm")
    turns = [args.tilt_a, args.tilt_b, args.rotate]
    if max(abs(v) for pair in turns for v in pair) > FARTHEST_TURN:
        raise InputError(f"a turn or tilt beyond {FARTHEST_TURN:g} degrees", expected="at most two whole turns")
    limits = [[*(m_from_mm(pair[end]) for pair in box), *(rad_from_deg(pair[end]) for pair in turns)] for end in (0, 1)]
    heights = tuple(m_from_mm(z) for z in args.z_values) if args.z_values else ()
    return Bounds(np.array(limits[0]), np.array(limits[1]), heights)


def _keepouts(args: argparse.Namespace) -> tuple[Keepout, ...]:
    from toolpath_stiff.placement.batch import Keepout
    from toolpath_stiff.units import m_from_mm

    boxes = []
    for name, values in args.keep_out:
        x0, y0, z0, x1, y1, z1 = (m_from_mm(v) for v in values)
        boxes.append(Keepout(name, (x0, y0, z0), (x1, y1, z1)))
    return tuple(boxes)


def _write(
    args: argparse.Namespace,
    out: Path,
    summary: dict[str, Any],
    best: Analysis,
    before: Analysis | None,
    program: Program,
) -> list[Path]:
    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.placement.report_data import COLUMNS

    rows = [",".join(f"{row[name]:.6f}" for name in COLUMNS) for row in summary["front"]]
    contents: dict[str, str | bytes] = {
        "placements.csv": "\n".join([",".join(COLUMNS), *rows, ""]),
        "placement.json": json.dumps(summary, indent=2) + "\n",
    }
    if not args.no_plots:
        from toolpath_stiff.report.place_page import place_page
        from toolpath_stiff.report.place_picture import front_picture, profiles_picture, setup_sheet, workspace_picture

        contents["report.html"] = place_page(summary, best, program, _keepouts(args))
        contents["front.png"] = front_picture(summary)
        contents["profiles.png"] = profiles_picture(best, before)
        contents["map.png"] = workspace_picture(best, before)
        contents["setup.pdf"] = setup_sheet(summary, best)
    return [write_atomically(out / name, content) for name, content in contents.items()]


def _table(summary: dict[str, Any]) -> str:
    """Recommended placement, what it brings, what it costs."""
    best, before = summary["recommended"], summary["before"]
    lines = [
        f"program         {summary['program']} on {summary['machine']}, load {summary['load']}",
        f"recommended     X{best['x_mm']:.3f} Y{best['y_mm']:.3f} Z{best['z_mm']:.3f}, turned by "
        f"{best['rotation_deg']:.3f} degrees (objective {summary['objective']})",
    ]
    if best["a_deg"] or best["b_deg"]:
        lines.append(f"                set-up tilted by A{best['a_deg']:.3f} B{best['b_deg']:.3f} degrees")
    for name, row in (("  stiffness", best), ("  before", before)):
        if row is None:
            lines.append(f"{name:<16}not feasible: {summary['before_reason']}")
            continue
        lines.append(
            f"{name:<16}mean {row['mean_N_per_mm']:.0f}, range {row['range_N_per_mm']:.0f}, "
            f"min {row['min_N_per_mm']:.0f} N/mm, deflection {row['mean_deflection_um']:.1f} um"
        )
    if best["extrapolated_share"]:
        lines.append(
            f"  strut law     extrapolated at {100.0 * best['extrapolated_share']:.0f} % of the samples: outside the "
            "lengths that it was measured at"
        )
    for goal, cost in summary["costs"].items():
        lines.append(
            f"  best {goal:<9} {cost['best_on_front_N_per_mm']:.0f} on the front, "
            f"{cost['recommended_N_per_mm']:.0f} here, N/mm"
        )
    blocks = summary["offset_blocks"]
    lines.append(f"LinuxCNC        {blocks['linuxcnc'] or blocks['linuxcnc_reason']}")
    fanuc = (blocks["fanuc"] or blocks["fanuc_reason"]).replace("\n", "\n                ")
    lines.append(f"Fanuc-style     {fanuc}")
    lines.append(f"front           {len(summary['front'])} placements, {summary['pose_evaluations']} poses evaluated")
    lines += _written(summary["written"]) if summary["written"] else []
    lines += [f"warning         {text}" for text in summary["warnings"]]
    return "\n".join(lines)


def _written(written: dict[str, Any]) -> list[str]:
    """What became of the transformed program."""
    at, apart = written["analysed_at"], written["relative_difference"]
    figures = ", ".join(f"{name} {value:.1e}" for name, value in apart.items())
    lines = [
        f"rewritten       {written['file']}; at X{at['x_mm']:g} Y{at['y_mm']:g} Z{at['z_mm']:g}, "
        f"{at['rotation_deg']:g} degrees it differs from the placed program by (relative) {figures}"
    ]
    return lines + [f"                {note}" for note in written["notes"]]
