"""`tps plan`: which measurements would tell rival explanations apart, per minute of work.

Visits are chosen one after another. Each lowers the bound on the chance of taking one rival for another,

    sum over pairs of sqrt(w_i w_j) exp(-gap_ij^2 / 4)

(Bhattacharyya's bound; Kailath 1967, IEEE Transactions on Communication Technology 15, 52: gap^2 / 4 is his distance
without its term for unlike covariances), and the one is taken that lowers its logarithm most per minute. A pair that
has been told apart counts no more; one that cannot be told apart takes nothing from the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.updating.inference.noise import STRUT_SPREAD
from toolpath_stiff.updating.planning.rivals import (
    SETTLED,
    Forecast,
    Outcome,
    ReadingNoise,
    Rival,
    Shares,
    expected_outcome,
    forecast_all,
    pair_shares,
    repeat_and_clamping,
)
from toolpath_stiff.updating.planning.visits import Costs, Matters, Menu, Visits, possible_visits

FloatArray = NDArray[np.float64]

MOST_RIVALS = 6  # a plan that separates more would separate none well
MOST_VISITS = 200
LEAST_NOISE = 1e-3  # relative; the paper's best readings, not clamped anew, scatter by 44 N/mm, 0.1 %
LEAST_GAP = 1.0  # standard deviations after all visits: below, tip stiffness cannot tell the two apart
MOST_REPEATS = 64

# Where an indicator reads a link's own deflection.
INDICATORS = {
    "tool": "between spindle nose and platform, and tool tip and spindle nose",
    "platform": "between two joints of the platform",
    "joints": "across a joint: strut end to frame vertex, and strut end to platform",
    "struts": "along a strut, from end to end",
    "frame": "between a frame vertex and the floor",
    "table": "between the table and the floor",
    "geometry": "none: measure the length or radius itself",
    "instrument": "none: compare the gauge with a second one, and watch the indicator without load",
}


@dataclass(frozen=True)
class PairGap:
    """How far two rivals are apart.

    Attributes
    ----------
    first, second
        Names.
    gap, best_visit_gap
        In standard deviations: after the plan; at the best single visit of all that are possible.
    separable
        Whether tip stiffness can tell them apart: a gap of `LEAST_GAP` after the plan.
    indicators
        Where an indicator would tell instead: link -> place; for separable pairs as well.
    """

    first: str
    second: str
    gap: float
    best_visit_gap: float
    separable: bool
    indicators: dict[str, str]


@dataclass(frozen=True)
class Plan:
    """Visits to make, in order, and what is to be expected of them.

    Attributes
    ----------
    visits
        All that were possible.
    chosen
        Numbers of the chosen ones, in measuring order.
    shares
        Pair of rivals -> what each visit adds to their gap.
    pairs
        The gaps, the narrowest first.
    kinds, why
        Of each chosen visit: what it changes, one word or two; what it is for, a sentence.
    before, after
        Expected before and after the plan; the probabilities of the truth and of a settled verdict.
    enough
        How many of the poses, the best ones, should do for a probability of `SETTLED` for the truth; None: not all.
    repeats
        How often each visit must be repeated, clamped anew, for a probability of `SETTLED` for the truth; None if
        no number up to `MOST_REPEATS` does.
    minutes
        Work.
    rivals
        Those considered, the most probable first.
    noise
        Repeat noise of a reading and scatter of a clamping, relative sd.
    notes
        What was assumed or left out.
    """

    visits: Visits
    chosen: tuple[int, ...]
    shares: dict[tuple[str, str], Shares]
    pairs: tuple[PairGap, ...]
    kinds: tuple[str, ...]
    why: tuple[str, ...]
    before: Outcome
    after: Outcome
    enough: int | None
    repeats: int | None
    minutes: float
    rivals: tuple[Rival, ...]
    noise: tuple[float, float]
    notes: tuple[str, ...]

    @property
    def separable(self) -> bool:
        """Whether any pair can be told apart by tip stiffness."""
        return any(pair.separable for pair in self.pairs)


def plan_measurements(
    machine: Machine,
    rivals: Sequence[Rival],
    noise_relative: float | tuple[float, float],
    n: int = 6,
    *,
    menu: Menu | None = None,
    costs: Costs | None = None,
    seed: int = 0,
    effect_files: Sequence[str | Path] = (),
    strut_spread: float = STRUT_SPREAD,
) -> Plan:
    """Choose the visits that best tell rivals apart per minute.

    Parameters
    ----------
    machine
        The machine file's machine, which the rivals add to.
    rivals
        Two or more, as fitted to the data so far.
    noise_relative
        Relative sd of one reading, re-clamping included; or (repeat, clamping).
    n
        Visits: poses, each with one tool, set-up and clamping.
    menu, costs
        What may vary (`Menu.of(data)` after some measurements), and what it costs.
    seed
        Of the poses to choose from, and of the expected outcome.
    effect_files
        A user's own effects.
    strut_spread
        Relative sd of the struts' stiffnesses.

    Raises
    ------
    InputError
        Fewer than two rivals, a number of visits or a noise that cannot be, no reachable pose.
    """
    if not 1 <= n <= MOST_VISITS:
        raise InputError(f"a plan of {n} poses", expected=f"1 to {MOST_VISITS}")
    repeat, clamping = repeat_and_clamping(noise_relative)
    ranked, notes = _ranked(rivals)
    if repeat < LEAST_NOISE:
        repeat = LEAST_NOISE
        notes.append(f"planned for a noise of {100 * LEAST_NOISE:g} % a reading: nobody measures better")
    menu, costs = menu or Menu(), costs or Costs()
    visits = possible_visits(machine, menu, matters(ranked), np.random.default_rng(seed))
    forecasts, good, scatter = forecast_all(machine, ranked, visits.readings, effect_files, strut_spread)
    usable = np.logical_and.reduceat(good[visits.members], visits.starts)
    if not usable.any():
        raise InputError("no pose that every rival has an answer to", hint="plan with fewer rivals, or other heights")
    # A reading without an answer belongs to visits that are never chosen; its numbers only must not spread.
    forecasts = [_cleaned(f, good) for f in forecasts]
    noise = ReadingNoise(repeat, clamping, scatter)
    floors = {name: low for name, low in menu.floors.items() if name in visits.setup}
    if floors:
        words = ", ".join(
            f"{1e3 * low:.4g} mm" + (f" in set-up {name}" if name else "") for name, low in floors.items()
        )
        notes.append(f"no pose lower than was measured before: {words}; name heights to go lower")
    shares = {(f.name, g.name): pair_shares(visits, f, g, noise) for f, g in combinations(forecasts, 2)}
    weights = {f.name: f.weight for f in forecasts}
    picked = choose(visits, usable, shares, weights, n, costs, menu)
    chosen = in_order(visits, picked, menu, seed)
    before = float(np.square([f.weight for f in forecasts]).sum())
    after = expectation(visits, picked, forecasts, noise, seed)
    pairs = tuple(sorted((_pair(p, shares[p], chosen, usable, ranked) for p in shares), key=lambda pair: pair.gap))
    kinds = tuple(_kind(visits, v, menu) for v in chosen)
    why = tuple(_why(visits, v, shares, menu) for v in chosen)
    return Plan(
        visits=visits,
        chosen=chosen,
        shares=shares,
        pairs=pairs,
        kinds=kinds,
        why=why,
        before=Outcome(before, float(max(weights.values()) >= SETTLED)),
        after=after,
        enough=_enough(visits, picked, forecasts, noise, seed),
        repeats=_repeats(visits, picked, forecasts, noise, seed),
        minutes=plan_minutes(visits, chosen, costs, menu),
        rivals=ranked,
        noise=(repeat, clamping),
        notes=tuple(notes),
    )


def _ranked(rivals: Sequence[Rival]) -> tuple[tuple[Rival, ...], list[str]]:
    """The most probable ones, weights adding up to 1, and what was left out."""
    if len({rival.name for rival in rivals}) < max(len(rivals), 2):
        raise InputError(
            f"{len(rivals)} rivals to tell apart: {', '.join(rival.name for rival in rivals) or 'none'}",
            expected="two or more, of different names",
        )
    order = sorted(rivals, key=lambda rival: -rival.weight)
    notes = []
    if len(order) > MOST_RIVALS:
        out = ", ".join(rival.name for rival in order[MOST_RIVALS:])
        notes.append(f"the plan is for the {MOST_RIVALS} most probable rivals, not for {out}")
        order = order[:MOST_RIVALS]
    total = sum(rival.weight for rival in order)
    if not (min(rival.weight for rival in order) > 0.0 and np.isfinite(total)):
        raise InputError("rivals with a weight that is not above 0", expected="probabilities")
    return tuple(replace(rival, weight=rival.weight / total) for rival in order), notes


def matters(rivals: Sequence[Rival]) -> Matters:
    """What the rivals' answers hang on."""
    actives = [active for rival in rivals for active in rival.effects]
    needs = {column for active in actives for column in active.effect.needs}
    # A set-up that an effect acts on is a text among its values.
    chosen = {str(active.values[p.name]) for active in actives for p in active.effect.parameters if p.kind == "text"}
    loaded = any(active.effect.load_dependent for rival in rivals for active in rival.effects)
    return Matters(load=loaded or "force_N" in needs, setup="setup" in needs or bool(chosen), time="time_min" in needs)


def _cleaned(forecast: Forecast, good: NDArray[np.bool_]) -> Forecast:
    return replace(
        forecast, mean=np.where(good, forecast.mean, 0.0), factor=np.where(good[:, None], forecast.factor, 0.0)
    )


def random_visits(plan: Plan, n: int, seed: int) -> tuple[int, ...]:
    """As many visits to different places drawn blindly from the same menu: what planning is compared with."""
    free = np.ones(len(plan.visits), dtype=bool)
    rng = np.random.default_rng(seed)
    found: list[int] = []
    while len(found) < n and free.any():
        visit = int(rng.choice(np.flatnonzero(free)))
        found.append(visit)
        free &= ~same_place(plan.visits, visit)
    return tuple(found)


# -- what is to be expected --------------------------------------------------------------------------------------------


def expectation(
    visits: Visits,
    chosen: Sequence[int],
    forecasts: Sequence[Forecast],
    noise: ReadingNoise,
    seed: int,
    repeats: int = 1,
) -> Outcome:
    """What is to be expected of these visits, each made so often."""
    rows = [visits.rows(visit) for visit in chosen]
    visit_of = np.repeat(np.arange(len(chosen)), [len(own) for own in rows])
    return expected_outcome(forecasts, np.concatenate(rows), visit_of, noise.shared_out(repeats), seed)


def _enough(
    visits: Visits, picked: Sequence[int], forecasts: Sequence[Forecast], noise: ReadingNoise, seed: int
) -> int | None:
    for k in range(1, len(picked) + 1):
        if expectation(visits, picked[:k], forecasts, noise, seed).truth >= SETTLED:
            return k
    return None


def _repeats(
    visits: Visits, picked: Sequence[int], forecasts: Sequence[Forecast], noise: ReadingNoise, seed: int
) -> int | None:
    def settles(repeats: int) -> bool:
        return expectation(visits, picked, forecasts, noise, seed, repeats).truth >= SETTLED

    if settles(1):
        return 1
    if not settles(MOST_REPEATS):
        return None
    low, high = 1, MOST_REPEATS
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if settles(middle) else (middle, high)
    return high


def _pair(
    names: tuple[str, str],
    share: Shares,
    chosen: Sequence[int],
    usable: NDArray[np.bool_],
    rivals: Sequence[Rival],
) -> PairGap:
    gap = share.gap(chosen)
    return PairGap(
        *names,
        gap=gap,
        best_visit_gap=float(share.gaps_with(())[usable].max()),
        separable=gap >= LEAST_GAP,
        indicators=_indicators(*(next(r for r in rivals if r.name == name) for name in names)),
    )


def _indicators(first: Rival, second: Rival) -> dict[str, str]:
    """Links at which the two differ, and where an indicator reads them."""
    effects = [active.effect for active in (*first.effects, *second.effects)]
    common = set(first.names) & set(second.names)
    links = dict.fromkeys(effect.link for effect in effects if effect.name not in common)
    return {link: INDICATORS[link] for link in links}


def _kind(visits: Visits, visit: int, menu: Menu) -> str:
    """What the visit changes, the dearest thing first."""
    if visits.setup[visit] != menu.setups[0]:
        return "another set-up"
    if visits.wait[visit] > menu.waits[0]:
        return "waiting"
    if visits.extension[visit] != menu.tool_extensions[0]:
        return "another tool"
    return "tilted" if visits.tilt(visit) > 1e-6 else "vertical"


def _why(visits: Visits, visit: int, shares: dict[tuple[str, str], Shares], menu: Menu) -> str:
    pair = max(shares, key=lambda p: shares[p].gap([visit]))
    what = [f"tilted {np.degrees(visits.tilt(visit)):.3g} deg" if visits.tilt(visit) > 1e-6 else "vertical"]
    extension = visits.extension[visit]
    if extension:
        what.append(f"tool {1e3 * abs(extension):.4g} mm {'longer' if extension > 0 else 'shorter'}")
    if visits.setup[visit]:
        what.append(f"set-up {visits.setup[visit]}")
    loads = np.unique(visits.readings.force[visits.rows(visit)])
    what.append("at " + " and ".join(f"{load:g} N" for load in loads))
    if visits.wait[visit] > menu.waits[0]:
        what.append(f"{visits.wait[visit] / 60.0:.3g} minutes after zeroing")
    if visits.rounds[visits.rows(visit)].max() > 1:
        what.append("each reading twice" if visits.rounds[visits.rows(visit)].max() == 2 else "readings repeated")
    gap = shares[pair].gap([visit])
    return f"{', '.join(what)}: {gap:.1f} sigma between {pair[0]} and {pair[1]}"


# -- choice of visits --------------------------------------------------------------------------------------------------
#
# Which visits: the bound on taking one rival for another, the minutes that each costs, one after another.


def log_confusion(gaps: dict[tuple[str, str], FloatArray], weights: dict[str, float]) -> FloatArray:
    """Logarithm of the bound on the chance of taking one rival for another, of any shape that the gaps have."""
    each = [0.5 * np.log(weights[i] * weights[j]) - gap**2 / 4.0 for (i, j), gap in gaps.items()]
    return np.asarray(np.logaddexp.reduce(each, axis=0))


def choose(
    visits: Visits,
    usable: NDArray[np.bool_],
    shares: dict[tuple[str, str], Shares],
    weights: dict[str, float],
    n: int,
    costs: Costs,
    menu: Menu,
) -> tuple[int, ...]:
    """Up to `n` usable visits, one after another, each the one that lowers the bound most per minute."""
    chosen: list[int] = []
    free = usable.copy()
    now = float(log_confusion({pair: np.zeros(()) for pair in shares}, weights))
    for _ in range(min(n, int(usable.sum()))):
        after = log_confusion({pair: share.gaps_with(chosen) for pair, share in shares.items()}, weights)
        gain = np.where(free, (now - after) / further_minutes(visits, chosen, costs, menu), -np.inf)
        best = int(np.argmax(gain))
        if not np.isfinite(gain[best]):
            break
        chosen.append(best)
        now = float(after[best])
        free &= ~same_place(visits, best)
    return tuple(chosen)


def same_place(visits: Visits, visit: int) -> NDArray[np.bool_]:
    """(v,) visits to the same pose with the same tool in the same set-up: other readings there are no new pose."""
    return np.asarray(
        (visits.pose == visits.pose[visit]).all(axis=1)
        & (visits.extension == visits.extension[visit])
        & (visits.setup == visits.setup[visit])
    )


def further_minutes(visits: Visits, chosen: Sequence[int], costs: Costs, menu: Menu) -> FloatArray:
    """(v,) minutes that each visit adds to those chosen; visits of one set-up and tool are made together."""
    setups = {menu.setups[0], *visits.setup[list(chosen)].tolist()}
    equipped = {(menu.setups[0], menu.tool_extensions[0])}
    equipped |= {(str(visits.setup[v]), float(visits.extension[v])) for v in chosen}
    minutes = costs.pose + costs.reading * visits.counts + visits.wait / 60.0
    minutes = minutes + costs.setup * ~np.isin(visits.setup, list(setups))
    tools: dict[str, set[float]] = {}
    for setup, tool in equipped:
        tools.setdefault(setup, set()).add(tool)
    # In a new set-up the tool that is in the spindle stays there.
    known = np.array(
        [
            float(tool) in tools.get(str(setup), {menu.tool_extensions[0]})
            for setup, tool in zip(visits.setup, visits.extension, strict=True)
        ]
    )
    return np.asarray(minutes + costs.tool * ~known)


def plan_minutes(visits: Visits, chosen: Sequence[int], costs: Costs, menu: Menu) -> float:
    """Minutes of work for the chosen visits."""
    return sum(float(further_minutes(visits, chosen[:k], costs, menu)[visit]) for k, visit in enumerate(chosen))


def in_order(visits: Visits, chosen: Sequence[int], menu: Menu, seed: int) -> tuple[int, ...]:
    """Set-up by set-up, tool by tool, at random within: a drift over the day looks like no pose."""
    order = list(np.random.default_rng([seed, 1]).permutation(len(chosen)))
    setups, tools = list(menu.setups), list(menu.tool_extensions)
    order.sort(key=lambda k: (setups.index(visits.setup[chosen[k]]), tools.index(visits.extension[chosen[k]])))
    return tuple(chosen[k] for k in order)
