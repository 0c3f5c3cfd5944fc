"""`tps map`: stiffness over planes of the workspace."""

from __future__ import annotations

import argparse
import json
import sys

from toolpath_stiff.cli.arguments import (
    add_json_option,
    add_machine_options,
    finite_number,
    load_argument,
    model_for,
    range_argument,
)
from toolpath_stiff.cli.outputs import add_replace_option, destination
from toolpath_stiff.errors import InputError

EPILOG = """\
examples:
  tps map --z 1200 --x -150:150 --y -150:150 --load radial     the paper's Figure 8
  tps map --z 1200 --load z                                    its Figure 9
  tps map --slices 400,800,1200 --x -400:400 --y -400:400 --tilt 15,0,0

files written to --out: map.csv (x_mm,y_mm,z_mm,stiffness_N_per_mm,reachable), map.json, map.png, map.html (3-D)
"""
FARTHEST_MM = 1e5
OUT_OF_REACH = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    heights = parser.add_mutually_exclusive_group()
    heights.add_argument("--z", type=finite_number, default=1200.0, metavar="MM", help="height (default: 1200)")
    heights.add_argument("--slices", type=_heights, metavar="Z,Z,...", help="several heights, mm")
    parser.add_argument(
        "--x", type=range_argument, default=(-150.0, 150.0), metavar="LO:HI", help="mm (default: -150:150)"
    )
    parser.add_argument(
        "--y", type=range_argument, default=(-150.0, 150.0), metavar="LO:HI", help="mm (default: -150:150)"
    )
    parser.add_argument("--points", type=int, default=61, metavar="N", help="grid points along a side (default: 61)")
    parser.add_argument(
        "--load", type=load_argument, default="radial", metavar="DIRECTION",
        help="radial, axial, softest, x, y, z or DX,DY,DZ (default: radial)",
    )  # fmt: skip
    parser.add_argument(
        "--tilt", type=_angles, default=(0.0, 0.0, 0.0), metavar="A,B,C", help="roll, pitch, yaw, degrees"
    )
    parser.add_argument("--out", metavar="DIR", help="folder (default: reports/<machine>-map)")
    add_replace_option(parser, force=False)
    parser.add_argument("--no-plots", action="store_true", help="only map.csv and map.json")
    add_machine_options(parser)
    add_json_option(parser, "print map.json to standard output and nothing else")


def _heights(text: str) -> list[float]:
    values = [finite_number(part) for part in text.split(",")]
    if len(set(values)) < len(values):
        raise argparse.ArgumentTypeError(f"{text!r}: a height appears twice")
    return sorted(values)


def _angles(text: str) -> tuple[float, float, float]:
    values = [finite_number(part) for part in text.split(",")]
    if len(values) != 3 or max(abs(v) for v in values) > 180.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected A,B,C in degrees, within +-180")
    return (values[0], values[1], values[2])


def run(args: argparse.Namespace) -> int:
    """Evaluate the grid and write the files."""
    from toolpath_stiff.analysis.loads import parse_load
    from toolpath_stiff.analysis.poses import map_stiffness
    from toolpath_stiff.cli.progress import progress_bar
    from toolpath_stiff.report.map import files, map_summary, names, text
    from toolpath_stiff.units import m_from_mm, rad_from_deg

    if not 2 <= args.points <= 2001:
        raise InputError(f"--points {args.points}", expected="2 to 2001")
    target = destination(args, "map", [args.machine], "-map").check(names(not args.no_plots))
    heights = args.slices or [args.z]
    if max(abs(v) for v in (*args.x, *args.y, *heights)) > FARTHEST_MM:
        raise InputError("a map beyond 100 m", expected="mm")
    model = model_for(args)
    a, b, c = (rad_from_deg(v) for v in args.tilt)
    x, y = ((m_from_mm(lo), m_from_mm(hi)) for lo, hi in (args.x, args.y))
    with progress_bar("map: poses", quiet=args.json) as progress:
        found = map_stiffness(
            model,
            x,
            y,
            [m_from_mm(z) for z in heights],
            parse_load(args.load),
            args.points,
            (a, b, c),
            args.force,
            progress,
        )
    summary = map_summary(model, found)
    written = target.write(files(model, found, summary, plots=not args.no_plots))
    if args.json:
        json.dump(summary, sys.stdout, indent=2)
        print()
    else:
        print(text(summary))
        print("\n".join(["written:", *(f"  {file}" for file in written)]))
    return 0
