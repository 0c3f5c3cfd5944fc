"""`tps plan`: what to measure next, or first."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import finite_number, limit_threads, positive_number
from toolpath_stiff.cli.measurement_arguments import (
    add_data_arguments,
    add_noise_arguments,
    add_output_arguments,
    check_seed,
)
from toolpath_stiff.cli.outputs import destination
from toolpath_stiff.files import Content

if TYPE_CHECKING:
    from toolpath_stiff.updating.planning import Proposal

EPILOG = """\
examples:
  tps plan measurements.csv                       what would tell the plausible explanations apart
  tps plan measurements.csv --between frame_compliance,joint_moment_stiffness --n 4
  tps plan --machine nist                         a good first campaign
  tps plan --machine nist --between spindle_compliance,table_compliance

Files written to --out: plan.csv (a measurement file with the stiffness left empty), plan.json, plan.png.
"""
DATA, PICTURES = ("plan.csv", "plan.json"), ("plan.png",)
COSTS = ("reading", "pose", "tool", "setup")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    add_data_arguments(parser, nargs="*", otherwise="; none: a first campaign")
    parser.add_argument("--between", type=_names, metavar="A,B", help="tell these effects apart (or `none`)")
    parser.add_argument("--n", type=int, metavar="N", help="poses (default: 6, or 24 of a first campaign)")
    group = parser.add_argument_group("what may vary")
    group.add_argument("--radius", type=positive_number("mm", 1e5), metavar="MM", help="about the axis (default: 300)")
    group.add_argument("--heights", type=_numbers, metavar="Z,Z,...", help="of the tool tip, mm (default: five levels)")
    group.add_argument("--max-tilt", type=_tilt, metavar="DEG", help="of the spindle (default: 25)")
    group.add_argument("--loads", type=_numbers, metavar="N,N,...", help="default: 500,1000,4000 and those of the data")
    group.add_argument(
        "--tools", type=_numbers, metavar="MM,MM,...",
        help="tools, longer than the reference tool by; the first is in the spindle (default: as last, and 150)",
    )  # fmt: skip
    group.add_argument(
        "--setups", type=_names, metavar="NAME,...", help="the first is on the table (default: those of the data)"
    )
    group.add_argument(
        "--cost", action="append", default=[], type=_cost, metavar="WHAT=MINUTES",
        help="of a reading (default 1), a pose (15), another tool (10), another setup (45)",
    )  # fmt: skip
    add_noise_arguments(parser, guess="a high guess, or 2 %% without data")
    add_output_arguments(parser, "plan", kept="plan.csv and plan.json", of="DATA, else machine")


def _names(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(dict.fromkeys(finite_number(part) for part in text.split(",")))


def _tilt(text: str) -> float:
    value = finite_number(text)
    if not 0.0 <= value < 90.0:
        raise argparse.ArgumentTypeError(f"{text} degrees: expected 0 or more and less than 90")
    return value


def _cost(text: str) -> tuple[str, float]:
    name, _, minutes = text.partition("=")
    if name not in COSTS:
        raise argparse.ArgumentTypeError(f"{text!r}: expected {', '.join(COSTS)} and =MINUTES")
    value = finite_number(minutes)
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected minutes, 0 or more")
    return name, value


def run(args: argparse.Namespace) -> int:
    """Plan, write the files, say what the plan promises."""
    check_seed(args.seed)
    target = destination(args, "plan", args.data or [args.machine], "-plan").check(
        DATA if args.no_plots else (*DATA, *PICTURES)
    )
    limit_threads(args.jobs)
    from toolpath_stiff.machine import load_machine
    from toolpath_stiff.units import m_from_mm, rad_from_deg
    from toolpath_stiff.updating.measurements import read_measurements
    from toolpath_stiff.updating.planning import plan
    from toolpath_stiff.updating.planning.document import document, plan_csv, rows_of
    from toolpath_stiff.updating.planning.visits import Costs

    machine = load_machine(args.machine)
    proposal = plan(
        machine, read_measurements(args.data, machine) if args.data else None, between=args.between or (), n=args.n,
        radius=None if args.radius is None else m_from_mm(args.radius),
        heights=None if args.heights is None else tuple(m_from_mm(z) for z in args.heights),
        max_tilt=None if args.max_tilt is None else rad_from_deg(args.max_tilt), loads=args.loads,
        tool_extensions=None if args.tools is None else tuple(m_from_mm(t) for t in args.tools), setups=args.setups,
        costs=Costs(**dict(args.cost)), noise=args.noise, strut_spread=args.strut_spread, effect_files=args.effects,
        seed=args.seed, files=args.data,
    )  # fmt: skip
    found = document(proposal, args.command_line)
    text = json.dumps(found, indent=2, ensure_ascii=False) + "\n"
    contents: dict[str, Content] = {"plan.csv": plan_csv(rows_of(proposal)), "plan.json": text}
    if not args.no_plots:
        contents["plan.png"] = _picture(proposal)
    written = target.write(contents)
    if args.json:
        print(text, end="")
    else:
        print(_table(found))
        print("\n".join(["written:", *(f"  {file}" for file in written)]))
    return 0


def _picture(proposal: Proposal) -> bytes:
    """The visits in the workspace; of a plan between rivals, with how well each place tells them apart."""
    from toolpath_stiff.report.plan_picture import plan_picture
    from toolpath_stiff.updating.planning import Plan
    from toolpath_stiff.updating.planning.document import gap_map

    found, name = proposal.plan, proposal.machine.name
    if isinstance(found, Plan):
        gap = gap_map(proposal.machine, found, proposal.menu, proposal.effect_files)
        title = f"What tells {gap.pair[0]} from {gap.pair[1]}"
        text = f"machine {name}   ·   colour: gap of one pose with the reference tool, X, Y and Z read"
        return plan_picture(found.visits, found.chosen, found.kinds, gap, title, text)
    clampings, readings = len(found.visits), len(found.visits.readings)
    text = f"machine {name}   ·   {clampings} clampings, {readings} readings; lines: where spindles lean"
    return plan_picture(found.visits, range(clampings), found.purposes, None, "A first campaign", text)


def _table(document: dict[str, Any]) -> str:
    """The visits in measuring order, then what is to be expected."""
    lines = [
        f"{'':>4} {'x':>7} {'y':>7} {'z':>7} mm {'a':>6} {'b':>6} deg {'tool':>5} mm  load N     set-up, directions"
    ]
    for visit in document["visits"]:
        loads = "/".join(f"{force:g}" for force in visit["forces_N"])
        where = ", ".join([*([visit["setup"]] if visit["setup"] else []), " ".join(visit["directions"])])
        lines.append(
            f"{visit['clamp']:>4} {visit['x_mm']:>7.1f} {visit['y_mm']:>7.1f} {visit['z_mm']:>7.1f}    "
            f"{visit['a_deg']:>6.1f} {visit['b_deg']:>6.1f}     {visit['tool_extension_mm']:>5g}     {loads:<10} "
            f"{where}"
        )
        if document["kind"] == "rivals":
            lines.append(f"{'':>5}{visit['why']}")
    lines += ["", *document["text"]]
    lines += [f"note: {note}" for note in document["notes"]]
    return "\n".join(lines)
