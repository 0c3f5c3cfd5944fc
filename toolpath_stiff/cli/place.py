"""`tps place`: where the work should sit."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import (
    add_json_option,
    add_load_options,
    add_machine_options,
    add_program_options,
    controller_for,
    finite_number,
    length_m,
    model_for,
    range_argument,
    read_program_for,
)
from toolpath_stiff.cli.measurement_arguments import check_seed
from toolpath_stiff.cli.outputs import add_replace_option, check_written, destination, keep
from toolpath_stiff.errors import InputError

if TYPE_CHECKING:
    from toolpath_stiff.machine import Machine
    from toolpath_stiff.placement.climb import Bounds
    from toolpath_stiff.placement.evaluator import Keepout
    from toolpath_stiff.placement.placing import Task

EPILOG = """\
examples:
  tps place programs/pocket.nc --x -300:300 --y -300:300 --z 400:1250
  tps place programs/pocket.nc --z-values 400,600,800 --rotate 0 --objective mean
  tps place programs/pocket.nc --keep-out vice:100,100,0,300,300,900
  tps place programs/pocket.nc --rotate 0 --write placed.nc
  tps place programs/pocket.nc --rotate 0 --pick 7 --write placed.nc

The recommended placement is never worse than the present one in mean, range or weakest place, if one such can be found.

A placement is where program zero sits and how the work is turned about it: the numbers of --origin. Files written to
--out: placements.csv (the front), placement.json, front.png, profiles.png, map.png, setup.pdf,
report.html (click a placement of the front, see the path there).
"""
FARTHEST_MM = 1e5
FARTHEST_TURN = 720.0
OBJECTIVES = ("balanced", "mean", "range", "weakest")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("program", metavar="PROGRAM", help="NC program or cutter-location file")
    group = parser.add_argument_group(
        "what may vary (LO:HI, or one number to fix it; default: as far as the machine reaches)"
    )
    for axis in "xy":
        group.add_argument(f"--{axis}", type=range_argument, metavar="LO:HI", help=f"{axis} of program zero, mm")
    heights = group.add_mutually_exclusive_group()
    heights.add_argument("--z", type=range_argument, metavar="LO:HI", help="z of program zero, mm")
    heights.add_argument("--z-values", type=_heights, metavar="Z,Z,...", help="the only heights there are, mm")
    group.add_argument(
        "--rotate", type=range_argument, default=(0.0, 360.0), metavar="LO:HI", help="degrees (default: 0:360)"
    )
    for axis in "ab":
        group.add_argument(
            f"--tilt-{axis}",
            type=range_argument,
            default=(0.0, 0.0),
            metavar="LO:HI",
            help="tilt of the set-up, degrees (default: 0)",
        )
    group.add_argument(
        "--keep-out", action="append", default=[], type=_keep_out, metavar="NAME:X0,Y0,Z0,X1,Y1,Z1",
        help="box that the tool tip must stay out of, rapids included, machine coordinates, mm",
    )  # fmt: skip
    group.add_argument(
        "--margin",
        type=_percent,
        default=1.0,
        metavar="PERCENT",
        help="of a limit's span that cuts and rapids keep from it (default: 1)",
    )
    group.add_argument(
        "--allow-extrapolation",
        action="store_true",
        help="let struts leave the lengths of their law at more samples than now",
    )
    parser.add_argument(
        "--objective",
        type=_objective,
        choices=OBJECTIVES,
        default="balanced",
        help="balanced: mean - range (default); whatever it is, none of mean, range, weakest gets worse where that "
        "can be avoided",
    )
    parser.add_argument(
        "--pick",
        type=int,
        metavar="N",
        help="take point N of the front in --out (number in placements.csv) instead of the recommended one, without "
        "searching again; the other options as they were",
    )
    parser.add_argument("--points", type=int, default=60, metavar="N", help="most points of the front (default: 60)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the search (default: 1)")
    parser.add_argument("--out", metavar="DIR", help="folder (default: reports/<program>-place)")
    _add_write_options(parser)
    add_replace_option(parser, force=False)
    parser.add_argument("--no-plots", action="store_true", help="only placements.csv and placement.json")
    add_json_option(parser, "print placement.json to standard output and nothing else")
    add_program_options(parser)
    add_machine_options(parser)
    add_load_options(parser)


def _add_write_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("the program itself, transformed to the recommended placement")
    group.add_argument("--write", metavar="FILE", help="write it: run at the present origin it cuts as placed")
    group.add_argument(
        "--decimals", type=int, metavar="N", help="of its numbers (default: 4 in mm and degrees, 5 in inch)"
    )
    group.add_argument(
        "--linearise",
        type=length_m(10.0),
        metavar="MM",
        help="write arcs that the turn takes out of the planes as straight moves within MM (default: refuse them)",
    )


def _percent(text: str) -> float:
    value = finite_number(text)
    if not 0.0 <= value < 50.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected 0 to less than 50 (per cent)")
    return value


def _objective(text: str) -> str:
    if text == "min":
        raise argparse.ArgumentTypeError("'min' is called 'weakest' now")
    return text


def _heights(text: str) -> list[float]:
    return sorted({finite_number(part) for part in text.split(",")})


def _keep_out(text: str) -> tuple[str, list[float]]:
    name, _, numbers = text.rpartition(":")
    values = [finite_number(part) for part in numbers.split(",")]
    if not name or len(values) != 6:
        raise argparse.ArgumentTypeError(f"{text!r}: expected NAME:X0,Y0,Z0,X1,Y1,Z1")
    for low, high, axis in zip(values[:3], values[3:], "XYZ", strict=True):
        if low >= high:
            raise argparse.ArgumentTypeError(f"{text!r}: {axis}1 = {high:g} is not above {axis}0 = {low:g}")
    return name, values


def run(args: argparse.Namespace) -> int:
    """Search, or take another point of an earlier search; write the files."""
    from toolpath_stiff.cli.progress import progress_bar
    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.placement.placing import place_again, place_program
    from toolpath_stiff.report.place import files, names, text

    if not 2 <= args.points <= 1000:
        raise InputError(f"--points {args.points}", expected="2 to 1000")
    check_seed(args.seed)
    _check_write(args)
    replaced = check_written(args, [args.write])
    target = destination(args, "place", [args.program], "-place").check(names(not args.no_plots))
    earlier = _earlier(target.folder) if args.pick is not None else None
    task = _task(args)
    if earlier is not None:
        placed = place_again(task, earlier, args.pick)
    else:
        with progress_bar(f"{task.program.name}: search", quiet=args.json) as progress:
            placed = place_program(task, progress)
    keep(replaced, quiet=args.json)
    written = target.write(files(placed, plots=not args.no_plots))
    if placed.rewritten is not None:
        written.append(write_atomically(args.write, placed.rewritten))
    if args.json:
        json.dump(placed.summary, sys.stdout, indent=2)
        print()
    else:
        print(text(placed.summary))
        print("\n".join(["written:", *(f"  {file}" for file in written)]))
    return 0


def _earlier(out: Path) -> dict[str, Any]:
    """placement.json of an earlier search."""
    from toolpath_stiff.files import read_text

    file = out / "placement.json"
    if not file.exists():
        raise InputError(
            f"--pick: there is no earlier search in {out} (no placement.json)",
            hint="search first, without --pick, or name the search's folder with --out",
        )
    try:
        found = json.loads(read_text(file, "the earlier search"))
    except ValueError as error:
        raise InputError(f"--pick: {file} is no JSON: {error}", hint="search again, without --pick") from None
    if not isinstance(found, dict):
        raise InputError(f"--pick: {file} is no result of a search", hint="search again, without --pick")
    return found


def _task(args: argparse.Namespace) -> Task:
    """The options in SI, the program read."""
    from toolpath_stiff.analysis.loads import parse_load
    from toolpath_stiff.placement.placing import Rewriting, Task
    from toolpath_stiff.placement.search import SearchRules

    model = model_for(args)
    program = read_program_for(args, args.program, model.machine)
    rewriting = None
    if args.write:
        controller = controller_for(args)
        reading = {"offsets": controller.offsets, "tools": controller.tools, "block_delete": args.block_delete}
        rewriting = Rewriting(args.write, args.decimals, args.linearise, reading)
    return Task(
        model=model,
        program=program,
        present=args.origin or (program.origin if program.origin_source == "program" else model.machine.default_origin),
        read=lambda origin: read_program_for(args, args.program, model.machine, origin),
        bounds=_bounds(args, model.machine),
        rules=SearchRules(
            objective=args.objective,
            margin=args.margin / 100.0,
            allow_extrapolation=args.allow_extrapolation,
            keepouts=_keepouts(args),
            seed=args.seed,
            points=args.points,
        ),
        load=parse_load(args.load),
        step=args.step,
        force=args.force,
        rewriting=rewriting,
    )


def _check_write(args: argparse.Namespace) -> None:
    """What can be said of --write before the program is read."""
    if not args.write:
        for option in ("decimals", "linearise"):
            if getattr(args, option) is not None:
                raise InputError(f"--{option} without --write", hint="say with --write FILE where the program goes")


def _bounds(args: argparse.Namespace, machine: Machine) -> Bounds:
    import numpy as np

    from toolpath_stiff.placement.climb import Bounds
    from toolpath_stiff.units import m_from_mm, mm_from_m, rad_from_deg

    low, high = (mm_from_m(corner) for corner in machine.limits.workspace)
    given = [args.x, args.y, args.z]
    if args.z_values:
        given[2] = (args.z_values[0], args.z_values[-1])
    box = []
    for name, asked, lo, hi in zip("xyz", given, low, high, strict=True):
        if asked is None and not np.isfinite(hi - lo):
            raise InputError(f"the machine file bounds no workspace in {name}", hint=f"give --{name} LO:HI")
        box.append(asked if asked is not None else (float(lo), float(hi)))
    if max(abs(v) for pair in box for v in pair) > FARTHEST_MM:
        raise InputError("bounds beyond 100 m", expected="mm")
    turns = [args.tilt_a, args.tilt_b, args.rotate]
    if max(abs(v) for pair in turns for v in pair) > FARTHEST_TURN:
        raise InputError(f"a turn or tilt beyond {FARTHEST_TURN:g} degrees", expected="at most two whole turns")
    limits = [[*(m_from_mm(pair[end]) for pair in box), *(rad_from_deg(pair[end]) for pair in turns)] for end in (0, 1)]
    heights = tuple(m_from_mm(z) for z in args.z_values) if args.z_values else ()
    return Bounds(np.array(limits[0]), np.array(limits[1]), heights)


def _keepouts(args: argparse.Namespace) -> tuple[Keepout, ...]:
    from toolpath_stiff.placement.evaluator import Keepout
    from toolpath_stiff.units import m_from_mm

    boxes = []
    for name, values in args.keep_out:
        x0, y0, z0, x1, y1, z1 = (m_from_mm(v) for v in values)
        boxes.append(Keepout(name, (x0, y0, z0), (x1, y1, z1)))
    return tuple(boxes)
