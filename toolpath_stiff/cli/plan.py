"""`tps plan`: what to measure next, or first."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import finite_number, limit_threads, positive_number
from toolpath_stiff.cli.measurement_arguments import (
    add_data_arguments,
    add_noise_arguments,
    add_output_arguments,
    check_seed,
)
from toolpath_stiff.cli.outputs import destination

if TYPE_CHECKING:
    from toolpath_stiff.machine import Machine
    from toolpath_stiff.stiffness.effects.contract import Effect
    from toolpath_stiff.updating.measurements import Measurements
    from toolpath_stiff.updating.planning.campaign import Campaign
    from toolpath_stiff.updating.planning.rivals import Rival
    from toolpath_stiff.updating.planning.visits import Costs, Menu

EPILOG = """\
examples:
  tps plan measurements.csv                       what would tell the plausible explanations apart
  tps plan measurements.csv --between frame_compliance,joint_moment_stiffness --n 4
  tps plan --machine nist                         a good first campaign
  tps plan --machine nist --between spindle_compliance,table_compliance

Files written to --out: plan.csv (a measurement file with the stiffness left empty), plan.json, plan.png.
"""
COSTS = ("reading", "pose", "tool", "setup")
PLAN_POSES, CAMPAIGN_POSES = 6, 24
CAMPAIGN_NOISE = 0.02  # relative sd of a reading where nothing is known, of a plan without data; assumed


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
    limit_threads(args.jobs)
    from toolpath_stiff.machine import load_machine
    from toolpath_stiff.report.plan import files, names, text
    from toolpath_stiff.stiffness.effects import known_effects
    from toolpath_stiff.updating.planning.visits import Costs

    target = destination(args, "plan", args.data or [args.machine], "-plan").check(names(not args.no_plots))
    machine = load_machine(args.machine)
    effects = known_effects(args.effects)
    costs = Costs(**dict(args.cost))
    if args.data or args.between:
        document, rows, picture = _told_apart(args, machine, effects, costs)
    else:
        document, rows, picture = _campaign(args, machine, effects, costs)
    document |= {
        "machine": machine.name,
        "data": list(args.data),
        "seed": args.seed,
        "costs_minutes": {name: getattr(costs, name) for name in COSTS},
        "command": args.command_line,
    }
    contents = files(document, rows, picture)
    written = target.write(contents)
    if args.json:
        print(contents["plan.json"], end="")
    else:
        print(text(document))
        print("\n".join(["written:", *(f"  {file}" for file in written)]))
    return 0


def _menu(args: argparse.Namespace, menu: Menu) -> Menu:
    from toolpath_stiff.units import m_from_mm, rad_from_deg
    from toolpath_stiff.updating.planning.visits import with_options

    return with_options(
        menu,
        radius=None if args.radius is None else m_from_mm(args.radius),
        heights=None if args.heights is None else tuple(m_from_mm(z) for z in args.heights),
        max_tilt=None if args.max_tilt is None else rad_from_deg(args.max_tilt),
        loads=args.loads,
        tool_extensions=None if args.tools is None else tuple(m_from_mm(t) for t in args.tools),
        setups=args.setups,
    )


# -- telling rivals apart ----------------------------------------------------------------------------------------------


def _told_apart(
    args: argparse.Namespace, machine: Machine, effects: dict[str, Effect], costs: Costs
) -> tuple[dict[str, Any], list[dict[str, Any]], bytes | None]:
    from toolpath_stiff.report.plan import visit_entries
    from toolpath_stiff.updating.measurements import read_measurements
    from toolpath_stiff.updating.planning import plan_measurements
    from toolpath_stiff.updating.planning.between import unfitted_rivals
    from toolpath_stiff.updating.planning.document import plan_document, plan_rows
    from toolpath_stiff.updating.planning.visits import Menu

    taken: set[str] = set()
    errors: dict[str, float] = {}
    noise: float | tuple[float, float]
    if args.data:
        data = read_measurements(args.data, machine)
        taken = set(data.point.tolist())
        menu = _menu(args, Menu.of(data))
        rivals, noise, notes, verdict, errors = _rivals(args, machine, data, effects)
    else:
        menu = _menu(args, Menu(setups=("table", "riser")))
        noise = CAMPAIGN_NOISE if args.noise is None else args.noise
        rivals = unfitted_rivals(args.between, effects, setup=menu.setups[-1])
        notes = ["no data: the rivals are taken at their usual sizes"]
        notes += [] if args.noise is not None else [f"noise of a reading: {100 * CAMPAIGN_NOISE:g} % assumed"]
        verdict = ""
    n = PLAN_POSES if args.n is None else args.n
    plan = plan_measurements(
        machine, rivals, noise, n, menu=menu, costs=costs, seed=args.seed, effect_files=args.effects,
        strut_spread=args.strut_spread,
    )  # fmt: skip
    plan = replace(plan, notes=(*notes, *plan.notes))
    rows = plan_rows(plan.visits, plan.chosen, taken)
    document = {"kind": "rivals", "verdict": verdict, "mean_abs_error_percent": errors, **plan_document(plan)}
    if errors:
        steps = ", ".join(f"{name} {value:.2f} %" for name, value in errors.items())
        document["text"] = [f"mean error so far: {steps}", *document["text"]]
    document["visits"] = visit_entries(rows, plan.kinds, plan.why)
    if args.no_plots:
        return document, rows, None
    from toolpath_stiff.report.plan import rivals_picture
    from toolpath_stiff.updating.planning.document import gap_map

    return document, rows, rivals_picture(plan, gap_map(machine, plan, menu, args.effects), machine.name)


def _rivals(
    args: argparse.Namespace, machine: Machine, data: Measurements, effects: dict[str, Effect]
) -> tuple[list[Rival], tuple[float, float], list[str], str, dict[str, float]]:
    """Rivals, noise (repeat, clamping), notes, verdict of the diagnosis ("" if none was made), mean errors so far."""
    import numpy as np

    from toolpath_stiff.updating.inference import judge
    from toolpath_stiff.updating.inference.evidence import Problem
    from toolpath_stiff.updating.inference.noise import Scatter, covariance, noise_models
    from toolpath_stiff.updating.inference.prediction import Predictor
    from toolpath_stiff.updating.planning.between import errors_so_far, fitted_rivals, rivals_of

    # Where nothing is known of the noise the larger guess is planned for: too many repeats do no harm.
    noise = noise_models(data, args.noise, args.strut_spread)[-1]
    notes = [f"noise: {noise.origin}"]
    predictor = Predictor(machine, data, args.effects)
    scatter = covariance(noise, predictor)
    problem = Problem(predictor, Scatter.of(noise, scatter), scatter)
    verdict = ""
    if args.between:
        rivals = fitted_rivals(problem, args.between, effects)
    else:
        own = {entry.name for entry in (*machine.effects, *machine.instruments)}
        lacking = data.cannot_test(effects.values())
        tested = [effect for name, effect in effects.items() if name not in own and name not in lacking]
        judgement = judge(problem, noise, scatter, tested, args.seed)
        rivals, verdict = rivals_of(judgement), judgement.verdict
        if verdict != "ambiguous":
            notes.append(f"the diagnosis is settled ({verdict}): the plan puts it to the test against what comes next")
    of_reading = (float(np.sqrt(np.mean(noise.repeat**2))), noise.clamping)
    return rivals, of_reading, notes, verdict, errors_so_far(problem, rivals)


# -- a first campaign --------------------------------------------------------------------------------------------------


def _campaign(
    args: argparse.Namespace, machine: Machine, effects: dict[str, Effect], costs: Costs
) -> tuple[dict[str, Any], list[dict[str, Any]], bytes | None]:
    from toolpath_stiff.report.plan import visit_entries
    from toolpath_stiff.updating.planning.campaign import RISER, TABLE, first_campaign
    from toolpath_stiff.updating.planning.document import plan_rows
    from toolpath_stiff.updating.planning.visits import Menu

    noise = CAMPAIGN_NOISE if args.noise is None else args.noise
    campaign = first_campaign(
        machine, CAMPAIGN_POSES if args.n is None else args.n, menu=_menu(args, Menu(setups=(TABLE, RISER))),
        costs=costs, seed=args.seed, effects=effects, noise=noise, effect_files=args.effects,
    )  # fmt: skip
    chosen = range(len(campaign.visits))
    rows = plan_rows(campaign.visits, chosen, repeats=campaign.repeats)
    document = {
        "kind": "campaign",
        "poses": len({row["point"] for row in rows}),
        "readings": len(rows),
        "minutes": campaign.minutes,
        "sees": [{"effect": name, "gap_sigma": gap} for name, gap in campaign.sees.items()],
        "text": _campaign_text(campaign, rows, noise),
        "notes": [f"seen or not: at a noise of {100 * noise:g} %, each effect alone at its usual size"],
        "visits": visit_entries(rows, campaign.purposes, campaign.purposes),
    }
    if args.no_plots:
        return document, rows, None
    from toolpath_stiff.report.plan import campaign_picture

    return document, rows, campaign_picture(campaign, len(rows), machine.name)


def _campaign_text(campaign: Campaign, rows: list[dict[str, Any]], noise: float) -> list[str]:
    heights = sorted({row["z_mm"] for row in rows})
    hidden = [name for name, gap in campaign.sees.items() if gap < 3.0]
    lines = [
        f"{len({row['point'] for row in rows})} poses at {len(heights)} heights, {len(campaign.visits)} clampings, "
        f"{len(rows)} readings: about {campaign.minutes / 60.0:.0f} hours"
    ]
    if hidden:
        lines.append(f"of usual size and alone, these would not show at {100 * noise:g} % noise: {', '.join(hidden)}")
    return lines
