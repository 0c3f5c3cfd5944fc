"""`tps path`: the sampled path of a program, without a machine."""

from __future__ import annotations

import argparse
import sys

from toolpath_stiff.cli.arguments import add_program_options, program_for
from toolpath_stiff.cli.outputs import add_replace_option, check_written, keep

EPILOG = """\
example:
  tps path programs/pocket.nc --step 0.5 --csv | head

Columns: line, motion (rapid, feed, arc, cycle), tool, s_mm and t_s along the path, the tool tip x_mm,y_mm,z_mm and
the rotary axes a_deg,b_deg,c_deg in machine coordinates, feed_mm_per_min (empty for rapids). Program zero lies at
0,0,0 unless --origin or the program's own G10 says otherwise. Every move has samples at both of its ends.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("program", metavar="PROGRAM", help="NC program or cutter-location file")
    add_program_options(parser)
    target = parser.add_mutually_exclusive_group()
    target.add_argument("--csv", action="store_true", help="write CSV to standard output (the default)")
    target.add_argument("--out", metavar="FILE", help="write CSV to a file")
    add_replace_option(parser)


def run(args: argparse.Namespace) -> int:
    """Sample, write."""
    from toolpath_stiff.api.programs import sample_path

    replaced = check_written(args, [args.out])
    found = sample_path(program_for(args, args.program), origin_mm_deg=args.origin, step_mm=args.step)
    if args.out:
        keep(replaced)
        found.save(args.out)
    else:
        for piece in found.csv():
            sys.stdout.write(piece.decode())
    for warning in found.warnings:
        print(f"tps: warning: {found.name}: {warning}", file=sys.stderr)
    for note in found.unsupported:
        print(f"tps: note: {note}", file=sys.stderr)
    return 0
