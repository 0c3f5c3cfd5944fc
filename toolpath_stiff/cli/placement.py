"""The commands on a placement: place, case-study."""

from __future__ import annotations

import argparse
from pathlib import Path

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
    show,
)
from toolpath_stiff.defaults import OBJECTIVES
from toolpath_stiff.errors import InputError

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
    from toolpath_stiff.report.place import names

    replaced = check_single(args, args.write)
    target = destination(args, "place", [args.program], "-place").check(names(not args.no_plots))
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
    return show(args, found, target, {args.write: found.program_bytes} if args.write else {})


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
COMMANDS = {
    "place": (place_arguments, place),
    "case-study": (case_study_arguments, case_study),
}
