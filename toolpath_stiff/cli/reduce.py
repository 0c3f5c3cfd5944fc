"""`tps reduce`: raw records of force and displacement to measured stiffnesses."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from toolpath_stiff.cli.arguments import add_json_option
from toolpath_stiff.cli.outputs import add_replace_option, check_written, keep

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
    from toolpath_stiff.api.measuring import reduce
    from toolpath_stiff.api.results import json_text
    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.tables import split_name

    found = reduce(args.raw)
    out = Path(args.out or f"{Path(split_name(args.raw)[0]).stem}_measurements.csv")
    files = found.files(out, plots=not args.no_plots)
    keep(check_written(args, files), quiet=args.json)
    written = [str(write_atomically(name, content)) for name, content in files.items()]
    for note in found.notes:
        print(f"tps: note: {note}", file=sys.stderr)
    if args.json:
        sys.stdout.write(json_text({**found.to_dict(), "files": written}))
    else:
        print(f"{found}\n\nwrote {' and '.join(written)}")
    return 0
