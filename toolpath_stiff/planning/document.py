"""A plan in figures and sentences."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, NotRequired, TypedDict, cast

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.inference.judgement import NAMED
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.planning.campaign import Campaign
from toolpath_stiff.planning.gaps import MOST_REPEATS, SETTLED, ReadingNoise, pair_shares
from toolpath_stiff.planning.plan import Plan, Proposal, matters
from toolpath_stiff.planning.rivals import forecast_all
from toolpath_stiff.planning.visits import (
    AXES,
    READING_EVERY,
    ROUND,
    VECTORS,
    Menu,
    Visits,
    planned_readings,
    reachable,
)
from toolpath_stiff.units import certain, deg_from_rad, min_from_s, mm_from_m


class RivalEntry(TypedDict):
    """A rival and its probability."""

    name: str
    probability: float


class Expected(TypedDict):
    """What is to be expected of the plan."""

    probability_of_truth_before: float
    probability_of_truth_after: float
    settled_before: float
    settled_after: float
    settled_at: float
    poses_to_settle: int | None
    repeats_to_settle: int | None


class PairEntry(TypedDict):
    """How far two rivals are apart, in standard deviations."""

    effects: list[str]
    separation_sigma: float
    best_single_pose_sigma: float
    separable: bool
    indicator_across: dict[str, str]


class VisitEntry(TypedDict):
    """One clamping."""

    clamp: int
    point: str
    x_mm: float
    y_mm: float
    z_mm: float
    a_deg: float
    b_deg: float
    c_deg: float
    tool_extension_mm: float
    setup: str
    forces_N: list[float]
    directions: list[str]
    loops: list[str]
    kind: str
    why: str


class Seen(TypedDict):
    """An effect and how far a campaign would set it apart from nothing."""

    effect: str
    separation_sigma: float


class _Promise(TypedDict):
    """What every plan says of itself."""

    poses: int
    readings: int
    minutes: float
    text: list[str]
    notes: list[str]


class RivalsPlan(_Promise):
    """A plan that tells rivals apart."""

    rivals: list[RivalEntry]
    expected: Expected
    worth_measuring: bool
    pairs: list[PairEntry]


class PlanDocument(_Promise):
    """The content of plan.json: of a plan between rivals, or of a first campaign."""

    kind: str
    verdict: NotRequired[str]
    mean_abs_error_percent: NotRequired[dict[str, float]]
    rivals: NotRequired[list[RivalEntry]]
    expected: NotRequired[Expected]
    worth_measuring: NotRequired[bool]
    pairs: NotRequired[list[PairEntry]]
    sees: NotRequired[list[Seen]]
    visits: list[VisitEntry]
    machine: str
    data: list[str]
    seed: int
    costs_minutes: dict[str, float]
    command: str


COSTS = ("reading", "pose", "tool", "setup", "indicator")


SHOWS = 3.0  # standard deviations from which on an effect is said to show


def document(proposal: Proposal, command: str = "") -> PlanDocument:
    """The content of plan.json."""
    found = proposal.plan
    rows = rows_of(proposal)
    if isinstance(found, Plan):
        own: dict[str, Any] = {
            "kind": "rivals",
            "verdict": proposal.verdict,
            "mean_abs_error_percent": dict(proposal.errors),
            **plan_document(found),
        }
        if proposal.errors:
            steps = ", ".join(f"{name} {value:.2f} %" for name, value in proposal.errors.items())
            own["text"].insert(int(not found.gains), f"mean error so far: {steps}")
        kinds, why = found.kinds, found.why
    else:
        own = _campaign(found, rows, proposal.noise)
        kinds = why = found.purposes
    whole = own | {
        "visits": _visits_of(rows, kinds, why),
        "machine": proposal.machine.name,
        "data": list(proposal.files),
        "seed": proposal.seed,
        "costs_minutes": {name: getattr(proposal.costs, name) for name in COSTS},
        "command": command,
    }
    return cast(PlanDocument, certain(whole))


def rows_of(proposal: Proposal) -> list[dict[str, Any]]:
    """The rows of plan.csv: a measurement file whose stiffness is left empty."""
    found = proposal.plan
    if isinstance(found, Plan):
        taken = () if proposal.data is None else set(proposal.data.point.tolist())
        return plan_rows(found.visits, found.chosen, taken)
    return plan_rows(found.visits, range(len(found.visits)), repeats=found.repeats)


def _campaign(campaign: Campaign, rows: list[dict[str, Any]], noise: float | tuple[float, float]) -> dict[str, Any]:
    return {
        "kind": "campaign",
        "poses": len({row["point"] for row in rows}),
        "readings": len(rows),
        "minutes": campaign.minutes,
        "detectability": [{"effect": name, "separation_sigma": gap} for name, gap in campaign.sees.items()],
        "text": _campaign_text(campaign, rows, noise),
        "notes": [f"seen or not: at a noise of {_noise_text(noise)}, each effect alone at its usual size"],
    }


def _campaign_text(campaign: Campaign, rows: list[dict[str, Any]], noise: float | tuple[float, float]) -> list[str]:
    heights = sorted({row["z_mm"] for row in rows})
    hidden = [name for name, gap in campaign.sees.items() if gap < SHOWS]
    lines = [
        f"{len({row['point'] for row in rows})} poses at {len(heights)} heights, {len(campaign.visits)} clampings, "
        f"{len(rows)} readings: about {campaign.minutes / 60.0:.0f} hours"
    ]
    if hidden:
        lines.append(
            f"of usual size and alone, these would not show at {_noise_text(noise)} noise: {', '.join(hidden)}"
        )
    return lines


def _noise_text(noise: float | tuple[float, float]) -> str:
    """As "2 %"; of a reading and of a clamping, "2 % and 1 %"."""
    return " and ".join(f"{100 * part:g} %" for part in (noise if isinstance(noise, tuple) else (noise,)))


def _visits_of(rows: list[dict[str, Any]], kinds: Sequence[str], why: Sequence[str]) -> list[VisitEntry]:
    """One entry a clamping: where, how, what is read, why."""
    found: list[VisitEntry] = []
    for clamp, (kind, reason) in enumerate(zip(kinds, why, strict=True), 1):
        own = [row for row in rows if row["clamp"] == clamp]
        first = own[0]
        found.append(
            {
                "clamp": clamp,
                "point": first["point"],
                "x_mm": first["x_mm"],
                "y_mm": first["y_mm"],
                "z_mm": first["z_mm"],
                "a_deg": first["a_deg"],
                "b_deg": first["b_deg"],
                "c_deg": first["c_deg"],
                "tool_extension_mm": first["tool_extension_mm"],
                "setup": first.get("setup", ""),
                "forces_N": sorted({row["force_N"] for row in own}),
                "directions": list(dict.fromkeys(_direction(row) for row in own)),
                "loops": list(dict.fromkeys(row["loop"] for row in own if row.get("loop"))),
                "kind": kind,
                "why": reason,
            }
        )
    return found


def _direction(row: dict[str, Any]) -> str:
    if "direction" in row:
        return str(row["direction"])
    return "".join(axis for axis, part in zip("XYZ", (row["dx"], row["dy"], row["dz"]), strict=True) if part)


def plan_document(plan: Plan) -> RivalsPlan:
    """The plan as the content of plan.json."""
    return {
        "rivals": [{"name": rival.name, "probability": rival.weight} for rival in plan.rivals],
        "poses": len(plan.chosen),
        "readings": int(plan.visits.counts[list(plan.chosen)].sum()),
        "minutes": plan.minutes,
        "expected": {
            "probability_of_truth_before": plan.before.truth,
            "probability_of_truth_after": plan.after.truth,
            "settled_before": plan.before.settled,
            "settled_after": plan.after.settled,
            "settled_at": NAMED,
            "poses_to_settle": plan.enough,
            "repeats_to_settle": plan.repeats,
        },
        "worth_measuring": plan.gains,
        "pairs": [
            {
                "effects": [pair.first, pair.second],
                "separation_sigma": pair.gap,
                "best_single_pose_sigma": pair.best_visit_gap,
                "separable": pair.separable,
                "indicator_across": pair.indicators,
            }
            for pair in plan.pairs
        ],
        "text": plan_text(plan),
        "notes": list(plan.notes),
    }


def _percent(share: float) -> str:
    """Never "100 %" for what is only expected."""
    return "more than 99 %" if share > 0.99 else f"{100 * share:.0f} %"


def plan_text(plan: Plan) -> list[str]:
    """What the plan promises, in sentences."""
    count = len(plan.chosen)
    lines = [
        f"{count} pose{'s' if count > 1 else ''}, about {plan.minutes:.0f} minutes: the probability of the right "
        f"explanation is expected to rise from {_percent(plan.before.truth)} to {_percent(plan.after.truth)}, "
        f"and the verdict to be settled in {_percent(plan.after.settled)} of cases"
    ]
    if not plan.gains:
        lines = [nothing_gained(plan)]
    elif plan.enough is not None and plan.enough < count:
        lines.append(f"{plan.enough} of the poses should do for {100 * SETTLED:.0f} %; the others are in reserve")
    elif plan.repeats is None:
        lines.append(f"{100 * SETTLED:.0f} % is not expected from repeats of these poses, up to {MOST_REPEATS} of them")
    elif plan.repeats > 1:
        lines.append(f"{100 * SETTLED:.0f} % is expected after {plan.repeats} repeats of each, clamped anew")
    for pair in plan.pairs:
        if not pair.separable:
            lines.append(
                f"tip stiffness cannot tell {pair.first} from {pair.second} ({pair.gap:.1f} sigma after all poses); "
                f"put an indicator across the link: "
                + "; or ".join(f"{link}: {place}" for link, place in pair.indicators.items())
            )
    return lines


def nothing_gained(plan: Plan) -> str:
    """That a plan is not worth its minutes, and what would tell its two likeliest rivals apart instead."""
    count = len(plan.chosen)
    first, second = (rival.name for rival in plan.rivals[:2])
    pair = next(pair for pair in plan.pairs if {pair.first, pair.second} == {first, second})
    beside = bool((plan.visits.readings.loop != "").any())  # indicators take part already
    places = [] if beside else list(pair.indicators.values())
    across = dict.fromkeys(place.split(":")[0] for place in places if not place.startswith("none: "))
    parts = ["nothing worth measuring" + ("" if beside else " at the tip")]
    parts += [f"an indicator {' or '.join(across)} would tell {first} from {second}"] if across else []
    parts += dict.fromkeys(place.removeprefix("none: ") for place in places if place.startswith("none: "))
    return "; ".join(parts) + (
        f". {count} pose{'s' if count > 1 else ''}, about {plan.minutes:.0f} minutes, would bring the probability of "
        f"the right explanation from {_percent(plan.before.truth)} to {_percent(plan.after.truth)}"
    )


POSE = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")


VECTOR = ("dx", "dy", "dz")


def plan_rows(
    visits: Visits, chosen: Sequence[int], taken: Iterable[str] = (), repeats: Sequence[int] = ()
) -> list[dict[str, Any]]:
    """Rows of a measurement file in shop units, in measuring order.

    Parameters
    ----------
    visits, chosen
        The visits in measuring order; each is one clamping.
    taken
        Names of points that new points must not have.
    repeats
        Which repeat of its place each visit is, where places are clamped several times; else the rounds of a visit.
    """
    names = _point_names(visits, chosen, set(taken))
    timed = not np.isnan(visits.readings.time).any()
    axes_only = all(visits.names[row] in AXES for visit in chosen for row in visits.rows(visit))
    found = []
    for clamp, visit in enumerate(chosen, 1):
        for row in visits.rows(visit):
            pose = [*mm_from_m(visits.pose[visit, :3]), *deg_from_rad(visits.pose[visit, 3:])]
            entry: dict[str, Any] = dict(zip(POSE, (_round(value) for value in pose), strict=True))
            name = str(visits.names[row])
            if axes_only:
                entry["direction"] = name
            else:
                entry |= zip(VECTOR, _whole(name), strict=True)
            entry["stiffness_N_per_mm"] = ""
            entry["loop"] = str(visits.readings.loop[row])
            entry["displacement_um"] = ""
            entry["force_N"] = _round(visits.readings.force[row])
            entry["setup"] = str(visits.setup[visit])
            entry["clamp"] = clamp
            entry["repeat"] = repeats[clamp - 1] if len(repeats) else int(visits.rounds[row])
            entry["point"] = names[clamp - 1]
            if timed:
                entry["time_min"] = _round(min_from_s(visits.readings.time[row]))
            entry["tool_extension_mm"] = _round(mm_from_m(visits.extension[visit]))
            found.append(entry)
    if not any(entry["loop"] for entry in found):
        for entry in found:
            del entry["loop"], entry["displacement_um"]
    if not (visits.setup[list(chosen)] != "").any():
        for entry in found:
            del entry["setup"]
    return found


def _point_names(visits: Visits, chosen: Sequence[int], taken: set[str]) -> list[str]:
    """The name that a pose had before, or a new one; one name a pose."""
    known: dict[tuple[float, ...], str] = {}
    number, names = 0, []
    for visit in chosen:
        pose = tuple(visits.pose[visit].tolist())
        if pose not in known:
            name = str(visits.label[visit])
            while not name or (not visits.label[visit] and name in taken):
                number += 1
                name = f"plan {number}"
            known[pose] = name
        names.append(known[pose])
    return names


def _round(value: float) -> float:
    """To ten digits after the unit's point at most: 0.30000000000000004 is 0.3 to whoever keys it in."""
    return round(float(value), 6) + 0.0


def _whole(name: str) -> list[int]:
    """A direction in whole numbers: files allow vectors of any length."""
    return [int(component != 0.0) for component in VECTORS[name]]


def plan_csv(rows: Sequence[dict[str, Any]]) -> str:
    """The rows as CSV."""
    cells = [[value if isinstance(value, str) else f"{value:.10g}" for value in row.values()] for row in rows]
    return csv_text(rows[0], cells)


ACROSS = 11  # points of the grid a side


TILTS = 6  # directions of tilt


MOST_LEVELS = 8  # heights with a panel of their own; more are put together, neighbours with neighbours


@dataclass(frozen=True)
class GapMap:
    """Gap in standard deviations of one visit, reference tool, the best of the set-ups.

    Attributes
    ----------
    pair
        Names of the two rivals.
    x, y, levels
        (g,) m, (g,) m, (h,) m, the middle of each of `height_groups`.
    vertical, tilted
        (h, g, g) with y before x; with the spindle vertical, and tilted as far as planned in the best of six
        directions; nan where the machine does not reach.
    max_tilt
        rad.
    """

    pair: tuple[str, str]
    x: FloatArray
    y: FloatArray
    levels: FloatArray
    vertical: FloatArray
    tilted: FloatArray
    max_tilt: float


def top_pair(plan: Plan) -> tuple[str, str]:
    """The two most probable rivals that can be told apart; if none can, the two most probable."""
    weights = {rival.name: rival.weight for rival in plan.rivals}
    best = max(plan.pairs, key=lambda pair: (pair.separable, weights[pair.first] * weights[pair.second]))
    return best.first, best.second


def height_groups(z: FloatArray) -> list[FloatArray]:
    """Heights (n,) m in groups, rising: each height its own, or `MOST_LEVELS` groups of neighbours."""
    heights = np.unique(np.round(z, 4))
    return list(np.array_split(heights, min(len(heights), MOST_LEVELS)))


def group_of(z: FloatArray, groups: Sequence[FloatArray]) -> NDArray[np.int64]:
    """(n,) the group that holds each height."""
    lowest = np.array([group[0] for group in groups])
    return np.asarray(np.searchsorted(lowest, np.round(z, 4), side="right") - 1, dtype=np.int64)


def levels_of(plan: Plan) -> FloatArray:
    """(h,) m: the middle height of each group that the plan visits, rising."""
    return np.array([group[len(group) // 2] for group in height_groups(plan.visits.pose[list(plan.chosen), 2])])


def gap_map(machine: Machine, plan: Plan, menu: Menu, effect_files: Sequence[str | Path] = ()) -> GapMap:
    """Gaps of the plan's top pair over the menu's radius at the heights that the plan visits most."""
    names = top_pair(plan)
    rivals = [next(rival for rival in plan.rivals if rival.name == name) for name in names]
    side = np.linspace(-menu.radius, menu.radius, ACROSS)
    levels = levels_of(plan)
    turns = np.linspace(0.0, 2.0 * np.pi, TILTS, endpoint=False)
    tilts = np.stack([menu.max_tilt * np.cos(turns), menu.max_tilt * np.sin(turns)], axis=1)
    angles = np.concatenate([np.zeros((1, 2)), tilts])
    poses = np.array([[x, y, z, a, b, 0.0] for a, b in angles for z, y, x in product(levels, side, side)])
    good = np.flatnonzero(reachable(machine, poses, 0.0, margin=0.0))
    found = matters(rivals)
    setups = menu.setups if found.setup else menu.setups[:1]
    loads = tuple(dict.fromkeys((min(menu.loads), max(menu.loads)))) if found.load else (menu.usual_load,)
    gaps = np.full((len(setups), len(poses)), np.nan)
    if len(good):
        visits = _visits(poses[good], setups, loads, menu)
        forecasts, answered, scatter = forecast_all(machine, rivals, visits.readings, effect_files)
        share = pair_shares(visits, forecasts[0], forecasts[1], ReadingNoise(*plan.noise, scatter))
        usable = np.logical_and.reduceat(answered, visits.starts)
        gaps[:, good] = np.where(usable, share.gaps_with(()), np.nan).reshape(len(setups), -1)
    for k, setup in enumerate(setups):
        gaps[k, poses[:, 2] < menu.floors.get(setup, -np.inf) - ROUND] = np.nan
    best = np.fmax.reduce(gaps, axis=0).reshape(len(angles), len(levels), ACROSS, ACROSS)
    return GapMap(names, side, side, levels, best[0], np.fmax.reduce(best[1:], axis=0), menu.max_tilt)


def _visits(poses: FloatArray, setups: Sequence[str], loads: Sequence[float], menu: Menu) -> Visits:
    """One visit to each pose in each set-up."""
    jobs = list(product(AXES, loads))
    count, v = len(jobs), len(poses) * len(setups)
    pose, setup = np.tile(poses, (len(setups), 1)), np.repeat(np.array(setups, dtype=str), len(poses))
    names = np.tile([name for name, _ in jobs], v)
    time = max(menu.waits) + READING_EVERY * np.arange(1.0, count + 1.0)
    readings = planned_readings(
        np.repeat(pose, count, axis=0),
        names,
        np.tile([load for _, load in jobs], v),
        np.zeros(v * count),
        np.repeat(setup, count),
        np.tile(time if menu.timed else np.full(count, np.nan), v),
    )
    members = np.arange(v * count)
    return Visits(
        pose,
        np.zeros(v),
        np.zeros(v),
        setup,
        np.full(v, ""),
        readings,
        names,
        np.ones(v * count, dtype=np.int64),
        members,
        members[::count].copy(),
    )
