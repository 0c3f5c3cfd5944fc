"""The commands on a placement: place, case-study."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

import toolpath_stiff as tps
from toolpath_stiff.cli.calls import call
from toolpath_stiff.cli.outputs import check_single, destination, keep, show, tell_incomplete, written_text
from toolpath_stiff.cli.parser import FOLDER, PROGRAM, Command, own
from toolpath_stiff.cli.program import READ
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import both_names
from toolpath_stiff.options import arguments_of, numbers


def place(args: Namespace) -> int:
    """Where the work should sit: Pareto front and one recommended placement.

    for example:
      tps place programs/pocket.nc --x -300:300 --y -300:300 --z 400:1250
      tps place programs/pocket.nc --z-values 400,600,800 --rotate 0 --objective mean
      tps place programs/pocket.nc --keep-out vice:100,100,0,300,300,900
      tps place programs/pocket.nc --rotate 0 --write placed.nc
      tps place programs/pocket.nc --rotate 0 --pick 7 --write placed.nc

    The recommended placement is never worse than the present one in mean, range or weakest place, if one such can be
    found.

    A placement is where program zero sits and how the work is turned about it: the numbers of --origin. Files written
    to --out: placements.csv (the front), placement.json, front.png, profiles.png, map.png, setup.pdf, report.html
    (click a placement of the front, see the path there).
    """
    replaced = check_single(args, args.write)
    target = destination(args, tps.Placement, [args.program])
    if args.pick is not None:
        tell_incomplete([target.folder])
    placement = call(args, tps.place, earlier=Path(target.folder, "placement.json"))
    keep(replaced, quiet=args.json)
    program = {args.write: placement.program_bytes} if args.write and not placement.refusal else {}
    written = target.write(placement, program, plots=not args.no_plots)
    show(args, placement, written_text([*written, *map(Path, program)]))
    if placement.refusal:
        raise InputError(
            f"{args.write} was not written; the search is kept in {target.folder} "
            f"({both_names('--pick')} takes it up): {placement.refusal}"
        )
    return 0


def case_study(args: Namespace) -> int:
    """The paper's four regions: one path at two heights, displaced and turned.

    for example:
      tps case-study
      tps case-study programs/pocket.nc
      tps case-study programs/pocket.nc --region left:-200,0,800 --region right:200,0,800,90
      tps case-study programs/pocket.nc --regions reports/case_study/case_study.csv

    Writes case_study.csv, case_study.json, case_study.md, regions.png and heights.png: one tool path at two heights,
    displaced and turned, as the paper's Figure 10; its three conclusions checked one by one; where they stop holding.
    A file of regions has the columns region, x_mm, y_mm, z_mm, rotation_deg (CSV or FILE.xlsx[#SHEET]).
    """
    regions = dict(args.region)
    if len(regions) < len(args.region):
        raise InputError("--region: a name is given twice", expected="a name of its own for each region")
    target = destination(args, tps.CaseStudy, [args.program or args.machine])
    study = call(args, tps.case_study, regions=regions or args.regions)
    return show(args, study, written_text(target.write(study, plots=not args.no_plots)))


def _region(text: str) -> tuple[str, tuple[float, ...]]:
    name, _, place = text.rpartition(":")
    values = numbers(place)
    if not name or len(values) not in (3, 4):
        raise ValueError("NAME:X,Y,Z or NAME:X,Y,Z,TURN")
    return name, values


REGION = own(
    "--region NAME:X,Y,Z[,TURN]",
    "where program zero sits, mm, and how far the path is turned about it, degrees; once for each region (default: "
    "four of the reference machine)",
    read=_region, count="append", default=(),
)  # fmt: skip
COMMANDS = {
    "place": Command(place, PROGRAM, tps.place, *READ, *FOLDER),
    "case-study": Command(
        case_study,
        own("PROGRAM", f"{PROGRAM.help} (default: the contour of a 200 mm square)", count="?"),
        REGION,
        own("--regions FILE", "the same as a table", instead_of="region"),
        tps.case_study,
        arguments_of(tps.analyze)["force_N"],
        *READ,
        *FOLDER,
    ),
}
