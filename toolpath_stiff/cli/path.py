"""`tps path`: the sampled path of a program, without a machine."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from toolpath_stiff.cli.arguments import add_program_options, read_program_for
from toolpath_stiff.cli.outputs import add_replace_option, check_written, keep

if TYPE_CHECKING:
    from toolpath_stiff.path import Samples

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
    """Read, sample, write."""
    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.path import place, sample_moves

    replaced = check_written(args, [args.out])
    program = read_program_for(args, args.program, None)
    origin = args.origin or program.origin
    samples = sample_moves(place(program.moves, origin), step=args.step, origin=origin)
    if args.out:
        keep(replaced)
        write_atomically(args.out, path_csv(samples))
    else:
        for piece in path_csv(samples):
            sys.stdout.write(piece.decode())
    for warning in program.warnings:
        print(f"tps: warning: {program.name}: {warning}", file=sys.stderr)
    for word in program.unsupported:
        print(f"tps: note: {program.name}:{word.line}:{word.column}: {word.word}: {word.reason}", file=sys.stderr)
    return 0


def path_csv(samples: Samples) -> Iterator[bytes]:
    """The CSV text in pieces."""
    from toolpath_stiff.column_files import csv_pieces
    from toolpath_stiff.path import PATH_COLUMNS, path_columns

    return csv_pieces(partial(path_columns, samples), len(samples), PATH_COLUMNS)
