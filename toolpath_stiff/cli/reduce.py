"""`tps reduce`: raw records of force and displacement to measured stiffnesses."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from toolpath_stiff.cli.arguments import add_json_option
from toolpath_stiff.cli.outputs import add_replace_option, check_written, keep

if TYPE_CHECKING:
    pass

EPILOG = """\
columns of RAW:
  x_mm,y_mm,z_mm,direction     where and along what (X, Y, Z; or dx,dy,dz), optionally a_deg,b_deg,c_deg
  jog_um                       how far the machine was told to move from zero
  force_N,displacement_um      gauge and indicator, positive the way the jog counts
  point,setup,clamp,repeat,loop,tool_extension_mm,time_min,temperature_C   optional, carried along

Records in the order taken, jogging 0, +200, -200, 0 um as ASME B5.54 and the paper do; those of one point, direction,
set-up, clamping and repeat are one loop. Its stiffness is the secant between the extremes (the paper's equation 12).
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("raw", metavar="RAW", help="raw records: CSV, or FILE.xlsx[#SHEET]")
    parser.add_argument(
        "--out", metavar="FILE", help="measurement file to write (default: <name>_measurements.csv); loops go beside it"
    )
    add_replace_option(parser)
    parser.add_argument("--no-plots", action="store_true", help="do not draw the loops")
    add_json_option(parser, "print the figures as JSON")


def run(args: argparse.Namespace) -> int:
    """Reduce, write, print."""
    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.report.reduce import describe, files, names, text
    from toolpath_stiff.tables import read_table, split_name
    from toolpath_stiff.updating.raw import COLUMNS, read_raw, reduce_loops

    raw = read_table(args.raw, "raw records", COLUMNS)
    loops = read_raw(raw)
    figures = reduce_loops(loops, args.raw)
    out = Path(args.out or f"{Path(split_name(args.raw)[0]).stem}_measurements.csv")
    replaced = check_written(args, names(out, plots=not args.no_plots))
    contents = files(loops, figures, out, Path(args.raw).name, plots=not args.no_plots)
    keep(replaced, quiet=args.json)
    written = [str(write_atomically(path, content)) for path, content in contents.items()]
    for note in raw.notes:
        print(f"tps: note: {note}", file=sys.stderr)
    if args.json:
        print(json.dumps({"loops": describe(loops, figures), "files": written}, indent=2, ensure_ascii=False))
    else:
        print(text(loops, figures))
        print(f"\nwrote {' and '.join(written)}")
    return 0
