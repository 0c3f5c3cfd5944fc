"""What to measure next, or first: which measurements would tell rival explanations apart, per minute of work.

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

from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.judgement import NAMED
from toolpath_stiff.inference.noise import LEAST
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.planning.gaps import (
    MOST_REPEATS,
    SETTLED,
    Expectation,
    GapShares,
    ReadingNoise,
    choose,
    enough,
    expectation,
    in_order,
    kind_of,
    pair_shares,
    plan_minutes,
    repeat_and_clamping,
    repeats_needed,
    same_place,
    why_of,
)
from toolpath_stiff.planning.indicators import loops_between, with_indicators
from toolpath_stiff.planning.rivals import Forecast, Rival, forecast_all
from toolpath_stiff.planning.visits import Costs, Matters, Menu, Visits, possible_visits

MOST_RIVALS = 6  # a plan that separates more would separate none well


MOST_VISITS = 200


LEAST_GAP = 1.0  # standard deviations after all visits: below, tip stiffness cannot tell the two apart


LEAST_GAIN = 0.01  # of a probability that is printed in whole per cent: less is no reason to measure


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
    effects
        Names of the two.
    separation_sigma, best_single_pose_sigma
        In standard deviations: after the plan; at the best single visit of all that are possible.
    separable
        Whether tip stiffness can tell them apart: a gap of `LEAST_GAP` after the plan.
    indicator_across
        Where an indicator would tell instead: link -> place; for separable pairs as well.
    """

    effects: tuple[str, str]
    separation_sigma: float
    best_single_pose_sigma: float
    separable: bool
    indicator_across: dict[str, str]


@dataclass(frozen=True)
class RivalPlan:
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
    forecasts, usable, scatter
        What the choice was made from: of each rival for all readings; (v,) visits that all rivals have an answer to;
        how readings and the machine scatter.
    """

    visits: Visits
    chosen: tuple[int, ...]
    shares: dict[tuple[str, str], GapShares]
    pairs: tuple[PairGap, ...]
    kinds: tuple[str, ...]
    why: tuple[str, ...]
    before: Expectation
    after: Expectation
    enough: int | None
    repeats: int | None
    minutes: float
    rivals: tuple[Rival, ...]
    noise: tuple[float, float]
    notes: tuple[str, ...]
    forecasts: tuple[Forecast, ...]
    usable: NDArray[np.bool_]
    scatter: ReadingNoise

    @property
    def separable(self) -> bool:
        """Whether any pair can be told apart by tip stiffness."""
        return any(pair.separable for pair in self.pairs)

    @property
    def gains(self) -> bool:
        """Whether the truth becomes likelier, or the verdict settled, on average, and more of it would go on so."""
        rises = (self.after.truth - self.before.truth, self.after.settled - self.before.settled)
        return bool(max(rises) >= LEAST_GAIN and (self.separable or self.repeats is not None))


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
) -> RivalPlan:
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
    if repeat < LEAST:
        repeat = LEAST
        notes.append(f"planned for a noise of {100 * LEAST:g} % a reading: nobody measures better")
    menu, costs = menu or Menu(), costs or Costs()
    visits = possible_visits(machine, menu, matters(ranked), np.random.default_rng(seed))
    if menu.indicators:
        visits = with_indicators(machine, visits, loops_between(ranked), repeat)
    forecasts, good, scatter = forecast_all(machine, ranked, visits.readings, effect_files, strut_spread)
    usable = np.logical_and.reduceat(good[visits.members], visits.starts)
    if not usable.any():
        raise InputError("no pose that every rival has an answer to", hint="plan with fewer rivals, or other heights")
    # A reading without an answer belongs to visits that are never chosen; its numbers only must not spread.
    forecasts = [
        replace(f, mean=np.where(good, f.mean, 0.0), factor=np.where(good[:, None], f.factor, 0.0)) for f in forecasts
    ]
    noise = ReadingNoise(repeat, clamping, scatter)
    notes.extend(_floors_in_words(menu, visits))
    shares = {(f.name, g.name): pair_shares(visits, f, g, noise) for f, g in combinations(forecasts, 2)}
    weights = {f.name: f.weight for f in forecasts}
    picked = choose(visits, usable, shares, weights, n, costs, menu)
    chosen = in_order(visits, picked, menu, seed)
    return RivalPlan(
        visits=visits,
        chosen=chosen,
        shares=shares,
        pairs=_pairs(ranked, shares, chosen, usable),
        kinds=tuple(kind_of(visits, visit, menu) for visit in chosen),
        why=tuple(why_of(visits, visit, shares, menu) for visit in chosen),
        before=Expectation(
            float(np.square([f.weight for f in forecasts]).sum()), float(max(weights.values()) >= NAMED)
        ),
        after=expectation(visits, picked, forecasts, noise, seed),
        enough=enough(visits, picked, forecasts, noise, seed),
        repeats=repeats_needed(visits, picked, forecasts, noise, seed),
        minutes=plan_minutes(visits, chosen, costs, menu),
        rivals=ranked,
        noise=(repeat, clamping),
        notes=tuple(notes),
        forecasts=tuple(forecasts),
        usable=usable,
        scatter=noise,
    )


def _floors_in_words(menu: Menu, visits: Visits) -> list[str]:
    floors = {name: low for name, low in menu.floors.items() if name in visits.setup}
    words = ", ".join(f"{1e3 * low:.4g} mm" + (f" in set-up {name}" if name else "") for name, low in floors.items())
    return [f"no pose lower than was measured before: {words}; name heights to go lower"] if floors else []


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


def random_visits(plan: RivalPlan, n: int, seed: int) -> tuple[int, ...]:
    """As many visits to different places drawn blindly from the same menu: what planning is compared with."""
    free = np.ones(len(plan.visits), dtype=bool)
    rng = np.random.default_rng(seed)
    found: list[int] = []
    while len(found) < n and free.any():
        visit = int(rng.choice(np.flatnonzero(free)))
        found.append(visit)
        free &= ~same_place(plan.visits, visit)
    return tuple(found)


def _pairs(
    rivals: Sequence[Rival],
    shares: dict[tuple[str, str], GapShares],
    chosen: Sequence[int],
    usable: NDArray[np.bool_],
) -> tuple[PairGap, ...]:
    """The gaps, the narrowest first, with the links at which two rivals differ and where an indicator reads them."""
    pairs = []
    for names, share in shares.items():
        both = [rival for rival in rivals if rival.name in names]
        common = set.intersection(*(set(rival.names) for rival in both))
        links = [active.effect.link for rival in both for active in rival.effects if active.effect.name not in common]
        best, gap = float(share.gaps_with(())[usable].max()), share.gap(chosen)
        pairs.append(PairGap(names, gap, best, gap >= LEAST_GAP, {link: INDICATORS[link] for link in links}))
    return tuple(sorted(pairs, key=lambda pair: pair.separation_sigma))


def _percent(share: float) -> str:
    """Never "100 %" for what is only expected."""
    return "more than 99 %" if share > 0.99 else f"{100 * share:.0f} %"


def plan_text(plan: RivalPlan) -> list[str]:
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
            first, second = pair.effects
            places = "; or ".join(f"{link}: {place}" for link, place in pair.indicator_across.items())
            lines.append(
                f"tip stiffness cannot tell {first} from {second} ({pair.separation_sigma:.1f} sigma after all poses); "
                f"put an indicator across the link: {places}"
            )
    return lines


def nothing_gained(plan: RivalPlan) -> str:
    """That a plan is not worth its minutes, and what would tell its two likeliest rivals apart instead."""
    count = len(plan.chosen)
    first, second = (rival.name for rival in plan.rivals[:2])
    pair = next(pair for pair in plan.pairs if {first, second} == set(pair.effects))
    beside = bool((plan.visits.readings.loop != "").any())  # indicators take part already
    places = [] if beside else list(pair.indicator_across.values())
    across = dict.fromkeys(place.split(":")[0] for place in places if not place.startswith("none: "))
    parts = ["nothing worth measuring" + ("" if beside else " at the tip")]
    parts += [f"an indicator {' or '.join(across)} would tell {first} from {second}"] if across else []
    parts += dict.fromkeys(place.removeprefix("none: ") for place in places if place.startswith("none: "))
    return "; ".join(parts) + (
        f". {count} pose{'s' if count > 1 else ''}, about {plan.minutes:.0f} minutes, would bring the probability of "
        f"the right explanation from {_percent(plan.before.truth)} to {_percent(plan.after.truth)}"
    )
