"""`tps check`: what a program uses, what is not understood, extents, times, and what a machine says to it."""

from __future__ import annotations

import argparse
import sys

from toolpath_stiff.cli.arguments import add_json_option, add_program_options, positive_number, program_for

EPILOG = """\
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


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
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


def run(args: argparse.Namespace) -> int:
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
