"""`tps plan`: what to measure next, or first."""

from __future__ import annotations

import argparse

from toolpath_stiff.cli.arguments import finite_number, limit_threads, positive_number
from toolpath_stiff.cli.measurement_arguments import (
    add_data_arguments,
    add_noise_arguments,
    add_output_arguments,
    measured,
    noise_options,
)
from toolpath_stiff.cli.outputs import destination, show

EPILOG = """\
examples:
  tps plan measurements.csv                       what would tell the plausible explanations apart
  tps plan measurements.csv --between frame_compliance,joint_moment_stiffness --n 4
  tps plan --machine nist                         a good first campaign
  tps plan --machine nist --between spindle_compliance,table_compliance

Files written to --out: plan.csv (a measurement file with the stiffness left empty), plan.json, plan.png.
"""
COSTS = ("reading", "pose", "tool", "setup")

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
    from toolpath_stiff.report.plan import names

    target = destination(args, "plan", args.data or [args.machine], "-plan").check(names(not args.no_plots))
    limit_threads(args.jobs)
    from toolpath_stiff.api.measuring import plan

    machine, data = measured(args)
    found = plan(
        machine,
        data if args.data else None,
        between=args.between or (),
        n=args.n,
        radius_mm=args.radius,
        heights_mm=args.heights,
        max_tilt_deg=args.max_tilt,
        loads_N=args.loads,
        tool_extensions_mm=args.tools,
        setups=args.setups,
        minutes=dict(args.cost),
        **noise_options(args),
    )
    return show(args, found, target)
