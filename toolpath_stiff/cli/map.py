"""`tps map`: stiffness over planes of the workspace."""

from __future__ import annotations

import argparse

from toolpath_stiff.cli.arguments import (
    add_json_option,
    add_machine_options,
    finite_number,
    load_argument,
    machine_for,
    range_argument,
)
from toolpath_stiff.cli.outputs import add_replace_option, destination, show
from toolpath_stiff.cli.progress import progress_line

EPILOG = """\
examples:
  tps map --z 1200 --x -150:150 --y -150:150 --load radial     the paper's Figure 8
  tps map --z 1200 --load z                                    its Figure 9
  tps map --slices 400,800,1200 --x -400:400 --y -400:400 --tilt 15,0,0

files written to --out: map.csv (x_mm,y_mm,z_mm,stiffness_N_per_mm,reachable), map.json, map.png, map.html (3-D)
"""


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
    from toolpath_stiff.api.machines import map_stiffness
    from toolpath_stiff.report.map import names

    target = destination(args, "map", [args.machine], "-map").check(names(not args.no_plots))
    with progress_line(quiet=args.json) as progress:
        found = map_stiffness(
            machine_for(args),
            x_mm=args.x,
            y_mm=args.y,
            z_mm=args.slices or args.z,
            load=args.load,
            tilt_deg=args.tilt,
            points=args.points,
            force_N=args.force,
            progress=progress,
        )
    return show(args, found, target)
