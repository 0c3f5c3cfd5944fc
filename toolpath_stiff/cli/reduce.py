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
    from toolpath_stiff.updating.raw import LoopEntry

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
    from toolpath_stiff.tables import split_name
    from toolpath_stiff.updating.raw import document, measurement_csv, reduce

    reduction = reduce(args.raw)
    loops, figures = reduction.loops, reduction.figures
    out = Path(args.out or f"{Path(split_name(args.raw)[0]).stem}_measurements.csv")
    picture = None if args.no_plots else out.with_name(f"{out.stem}_loops.png")
    replaced = check_written(args, [out, picture])
    png = b""
    if picture is not None:
        from toolpath_stiff.report.loops_picture import loops_png

        png = loops_png(loops, figures, Path(args.raw).name)
    keep(replaced, quiet=args.json)
    write_atomically(out, measurement_csv(loops, figures))
    if picture is not None:
        write_atomically(picture, png)
    for note in reduction.notes:
        print(f"tps: note: {note}", file=sys.stderr)
    written = [str(path) for path in (out, picture) if path is not None]
    if args.json:
        print(json.dumps({"loops": document(reduction), "files": written}, indent=2, ensure_ascii=False))
    else:
        print(table(document(reduction)))
        print(f"\nwrote {' and '.join(written)}")
    return 0


def table(entries: list[LoopEntry]) -> str:
    """The figures for people."""
    heading = ("loop", "N/mm", "force N", "deflection um", "lost motion um", "width um", "linearity %", "closure um")
    rows: list[tuple[str, ...]] = [heading]
    for one in entries:
        lost = (one["lost_motion_um"], one["loop_width_um"], one["linearity_percent"], one["closure_um"])
        cells = [one["loop"], f"{one['stiffness_N_per_mm']:.0f}", f"{one['force_N']:.0f}"]
        cells += ["-" if value is None else f"{value + 0.0:.1f}" for value in (one["deflection_um"], *lost)]
        rows.append(tuple(cells))
    widths = [max(len(row[i]) for row in rows) for i in range(len(heading))]
    return "\n".join(
        "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    )
