"""`tps map`: stiffness over planes of the workspace."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

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
from toolpath_stiff.files import Content

if TYPE_CHECKING:
    from toolpath_stiff.analysis.poses import StiffnessMap
    from toolpath_stiff.stiffness.model import StiffnessModel

EPILOG = """\
examples:
  tps map --z 1200 --x -150:150 --y -150:150 --load radial     the paper's Figure 8
  tps map --z 1200 --load z                                    its Figure 9
  tps map --slices 400,800,1200 --x -400:400 --y -400:400 --tilt 15,0,0

files written to --out: map.csv (x_mm,y_mm,z_mm,stiffness_N_per_mm,reachable), map.json, map.png, map.html (3-D)
"""
DATA, PICTURES = ("map.csv", "map.json"), ("map.png", "map.html")
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
    from toolpath_stiff.units import m_from_mm, rad_from_deg

    if not 2 <= args.points <= 2001:
        raise InputError(f"--points {args.points}", expected="2 to 2001")
    target = destination(args, "map", [args.machine], "-map").check(DATA if args.no_plots else (*DATA, *PICTURES))
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
    contents: dict[str, Content] = {"map.csv": map_csv(found), "map.json": json.dumps(summary, indent=2) + "\n"}
    if not args.no_plots:
        from toolpath_stiff.report.map_page import map_page
        from toolpath_stiff.report.map_picture import map_picture
        from toolpath_stiff.report.wording import machine_text

        title = machine_text({**summary, "machine": model.machine.title})
        headed = model.machine.with_changes(title=title)
        contents["map.png"] = map_picture(headed, found)
        contents["map.html"] = map_page(headed, found, summary["warnings"])
    files = target.write(contents)
    if args.json:
        json.dump(summary, sys.stdout, indent=2)
        print()
    else:
        _print(summary)
        print("\n".join(["written:", *(f"  {file}" for file in files)]))
    return 0


def map_summary(model: StiffnessModel, found: StiffnessMap) -> dict[str, Any]:
    """Extremes of each slice, and of a circle about the machine axis where the map holds one."""
    import numpy as np

    from toolpath_stiff.analysis.poses import turning_points
    from toolpath_stiff.stiffness.model import condition_warnings, effects_stated
    from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

    slices = []
    for i, height in enumerate(found.z):
        layer = found.stiffness[i]
        row: dict[str, Any] = {"z_mm": mm_from_m(float(height)), "reachable_share": float(found.reachable[i].mean())}
        if found.reachable[i].any():
            for name, at in (("softest", np.nanargmin(layer)), ("stiffest", np.nanargmax(layer))):
                j, k = np.unravel_index(int(at), layer.shape)
                row[name] = {
                    "x_mm": mm_from_m(float(found.x[k])),
                    "y_mm": mm_from_m(float(found.y[j])),
                    "stiffness_N_per_mm": n_per_mm_from_n_per_m(float(layer[j, k])),
                }
            radius = min(-found.x[0], found.x[-1], -found.y[0], found.y[-1])
            if radius > 0.0 and not any(found.abc):
                turns = turning_points(model, float(radius), float(height), found.load)
                row["circle"] = {
                    "radius_mm": mm_from_m(float(radius)),
                    **{f"{k}_deg": [round(deg_from_rad(v), 2) for v in angles] for k, angles in turns.items()},
                }
        slices.append(row)
    return {
        "machine": model.machine.name,
        "load": str(found.load),
        "abc_deg": [deg_from_rad(v) for v in found.abc],
        "points": int(found.stiffness.size),
        "slices": slices,
        **effects_stated(model),
        "warnings": condition_warnings(model),
    }


def map_csv(found: StiffnessMap) -> Iterator[str]:
    """`map.csv`, a slice at a time."""
    import numpy as np

    from toolpath_stiff.column_files import csv_rows
    from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

    decimals: dict[str, int | None] = {"x_mm": 6, "y_mm": 6, "z_mm": 6, "stiffness_N_per_mm": 4, "reachable": None}
    yield ",".join(decimals) + "\n"
    ys, xs = np.meshgrid(mm_from_m(found.y), mm_from_m(found.x), indexing="ij")
    for i, height in enumerate(found.z):
        columns = {
            "x_mm": xs.ravel(),
            "y_mm": ys.ravel(),
            "z_mm": np.full(xs.size, mm_from_m(float(height))),
            "stiffness_N_per_mm": n_per_mm_from_n_per_m(found.stiffness[i].ravel()),
            "reachable": found.reachable[i].ravel().astype(int),
        }
        yield csv_rows(columns, decimals)


def _print(summary: dict[str, Any]) -> None:
    from toolpath_stiff.report.wording import machine_text, plain

    print(f"machine {machine_text(summary)}, load {summary['load']}, {summary['points']} points")
    for warning in summary["warnings"]:
        print(f"warning: {plain(warning)}")
    for row in summary["slices"]:
        print(f"z = {row['z_mm']:g} mm: {100 * row['reachable_share']:.0f} % within reach")
        for name in ("softest", "stiffest"):
            if name in row:
                at = row[name]
                print(f"  {name:<9} {at['stiffness_N_per_mm']:8.0f} N/mm at X{at['x_mm']:g} Y{at['y_mm']:g}")
        circle = row.get("circle", {})
        if circle.get("maxima_deg"):
            maxima, minima = (", ".join(f"{v:g}" for v in circle[f"{k}_deg"]) for k in ("maxima", "minima"))
            print(
                f"  on the circle of {circle['radius_mm']:g} mm: maxima at {maxima} degrees, minima at {minima} degrees"
            )
