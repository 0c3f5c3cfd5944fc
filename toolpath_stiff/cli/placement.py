"""The commands on a placement: place, case-study."""

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import toolpath_stiff as tps
from toolpath_stiff.cli.parser import FOLDER, PROGRAM, command
from toolpath_stiff.cli.program import READ
from toolpath_stiff.cli.run import call, check_single, destination, run_to_folder, show, write_single, written_text
from toolpath_stiff.errors import InputError
from toolpath_stiff.options import Option, numbers


@command("place", PROGRAM, "place", *READ, *FOLDER)
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
    to --out: placements.csv (the front), placement.json, setup.pdf, report.html
    (click a placement of the front, see the path there).
    """
    check_single(args, args.write)
    folder, rules = destination(args, tps.Placement, [args.program])
    placement = call(args, tps.place, earlier=folder / "placement.json")
    written = placement.save(folder, plots=not args.no_plots, rules=rules)
    if args.write and not placement.refusal:
        written += write_single(args, {Path(args.write): placement.program_bytes})
    show(args, placement, written_text(written))
    if placement.refusal:
        raise InputError(
            f"{args.write} was not written; the search is kept in {folder} (--pick takes it up): {placement.refusal}"
        )
    return 0


def _region(text: str) -> tuple[str, tuple[float, ...]]:
    name, _, place = text.rpartition(":")
    values = numbers(place)
    if not name or len(values) not in (3, 4):
        raise ValueError("NAME:X,Y,Z or NAME:X,Y,Z,TURN")
    return name, values


Region = tuple[str, tuple[float, ...]]


@command("case-study", "case_study", *READ, *FOLDER)
def case_study(
    args: Namespace,
    program: Annotated[str | None, Option("PROGRAM")] = None,
    region: Annotated[Sequence[Region], Option("--region", "NAME:X,Y,Z[,TURN]", read=_region, count="append")] = (),
    regions: Annotated[str | None, Option("--regions", "FILE", instead_of="region")] = None,
) -> int:
    """The paper's four regions: one path at two heights, displaced and turned.

    for example:
      tps case-study
      tps case-study programs/pocket.nc
      tps case-study programs/pocket.nc --region left:-200,0,800 --region right:200,0,800,90
      tps case-study programs/pocket.nc --regions reports/case_study/case_study.csv

    Writes case_study.csv, case_study.json, case_study.md, regions.png and heights.png: one tool path at two heights,
    displaced and turned, as the paper's Figure 10; its three conclusions checked one by one; where they stop holding.
    A file of regions has the columns region, x_mm, y_mm, z_mm, rotation_deg (CSV or FILE.xlsx[#SHEET]).

    Parameters
    ----------
    program
        NC program or cutter-location file (default: the contour of a 200 mm square).
    region
        Where program zero sits, mm, and how far the path is turned about it, degrees; once for each region (default:
        four of the reference machine).
    regions
        The same as a table.
    """
    named = dict(region)
    if len(named) < len(region):
        raise InputError("--region: a name is given twice", expected="a name of its own for each region")
    return run_to_folder(args, tps.case_study, tps.CaseStudy, [program or args.machine], regions=named or regions)
