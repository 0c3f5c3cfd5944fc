"""`tps pose`: stiffness at single poses."""

from __future__ import annotations

import argparse
import sys

from toolpath_stiff.cli.arguments import add_json_option, add_machine_options, finite_number, machine_for
from toolpath_stiff.errors import InputError

OUT_OF_REACH, MOST_NAMED = 1, 10

EPILOG = """\
examples:
  tps pose -300 300 300 -30 0 0
  tps pose --csv poses.csv > stiffness.csv

Angles are roll A, pitch B, yaw C in degrees, R = Rz(C) Ry(B) Rx(A); the position is the tool tip in mm, machine
coordinates. --csv reads columns x_mm,y_mm,z_mm and, if there, a_deg,b_deg,c_deg; it writes one row a pose in the
same order, with empty cells where a pose is out of reach (exit code 1).
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument(
        "pose", nargs="*", type=finite_number, metavar="X Y Z [A B C]", help="tool tip in mm, angles in degrees"
    )
    parser.add_argument(
        "--csv",
        metavar="FILE",
        help="read poses from a table (CSV, or FILE.xlsx[#SHEET]), write CSV to standard output",
    )
    add_machine_options(parser)
    add_json_option(parser, "print JSON instead of a table")


def run(args: argparse.Namespace) -> int:
    """Evaluate and print."""
    from toolpath_stiff.api.machines import pose, read_poses

    if (args.csv is None) == (not args.pose):
        raise InputError(
            "give either a pose or --csv FILE" if args.csv is None else "give a pose or --csv FILE, not both",
            expected="tps pose X Y Z [A B C], or tps pose --csv FILE",
        )
    machine = machine_for(args)
    if args.csv is None:
        found = pose(machine, args.pose, force_N=args.force)
        sys.stdout.write(found.to_json() if args.json else f"{found}\n")
        return 0
    poses, notes = read_poses(args.csv)
    for note in notes:
        print(f"tps: note: {note}", file=sys.stderr)
    found = pose(machine, poses, force_N=args.force)
    sys.stdout.write(found.to_json() if args.json else found.csv())
    for warning in (*found.warnings, *found.out_of_reach(MOST_NAMED)):
        print(f"tps: warning: {warning}", file=sys.stderr)
    return 0 if found.reachable.all() else OUT_OF_REACH
