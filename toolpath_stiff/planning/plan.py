"""What to measure next, or first: which measurements would tell rival explanations apart, per minute of work.

Visits are chosen one after another. Each lowers the bound on the chance of taking one rival for another,

    sum over pairs of sqrt(w_i w_j) exp(-gap_ij^2 / 4)

(Bhattacharyya's bound; Kailath 1967, IEEE Transactions on Communication Technology 15, 52: gap^2 / 4 is his distance
without its term for unlike covariances), and the one is taken that lowers its logarithm most per minute. A pair that
has been told apart counts no more; one that cannot be told apart takes nothing from the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.candidates import testable_effects
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.judgement import NAMED, Judgement, judge
from toolpath_stiff.inference.noise import LEAST, Noise, noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.question import question
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.planning.campaign import RISER, TABLE, Campaign, first_campaign
from toolpath_stiff.planning.gaps import (
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
from toolpath_stiff.planning.rivals import (
    Forecast,
    Rival,
    errors_so_far,
    fitted_rivals,
    forecast_all,
    rivals_of,
    unfitted_rivals,
)
from toolpath_stiff.planning.visits import Costs, Matters, Menu, Visits, possible_visits, with_options
from toolpath_stiff.readings.measurements import Measurements
from toolpath_stiff.stiffness.catalogue import known_effects
from toolpath_stiff.stiffness.contract import Effect

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
    forecasts = [_cleaned(f, good) for f in forecasts]
    noise = ReadingNoise(repeat, clamping, scatter)
    notes.extend(_floors_in_words(menu, visits))
    shares = {(f.name, g.name): pair_shares(visits, f, g, noise) for f, g in combinations(forecasts, 2)}
    weights = {f.name: f.weight for f in forecasts}
    picked = choose(visits, usable, shares, weights, n, costs, menu)
    chosen = in_order(visits, picked, menu, seed)
    before = float(np.square([f.weight for f in forecasts]).sum())
    after = expectation(visits, picked, forecasts, noise, seed)
    pairs = tuple(sorted((_pair(p, shares[p], chosen, usable, ranked) for p in shares), key=lambda pair: pair.gap))
    kinds = tuple(kind_of(visits, v, menu) for v in chosen)
    why = tuple(why_of(visits, v, shares, menu) for v in chosen)
    return Plan(
        visits=visits,
        chosen=chosen,
        shares=shares,
        pairs=pairs,
        kinds=kinds,
        why=why,
        before=Expectation(before, float(max(weights.values()) >= NAMED)),
        after=after,
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


def _pair(
    names: tuple[str, str],
    share: GapShares,
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


PLAN_POSES, CAMPAIGN_POSES = 6, 24


CAMPAIGN_NOISE = 0.02  # relative sd of a reading where nothing is known, of a plan without data; assumed


@dataclass(frozen=True)
class Proposal:
    """What to measure, and why.

    Attributes
    ----------
    machine, data
        What is to be measured; what has been, None before the first campaign.
    plan
        Visits that tell rivals apart, or a first campaign.
    menu, costs
        What might vary, and what it costs.
    noise
        Relative sd of a reading, or (repeat, clamping), that was planned for.
    verdict, errors
        Of the diagnosis of the data, "" if none was made; mean errors so far, %.
    effect_files, files, seed
        For the record.
    """

    machine: Machine
    data: Measurements | None
    plan: Plan | Campaign
    menu: Menu
    costs: Costs
    noise: float | tuple[float, float]
    verdict: str
    errors: Mapping[str, float]
    effect_files: tuple[str | Path, ...]
    files: tuple[str, ...]
    seed: int


def plan(
    machine: Machine,
    data: Measurements | None = None,
    *,
    between: Sequence[str] = (),
    n: int | None = None,
    radius: float | None = None,
    heights: Sequence[float] | None = None,
    max_tilt: float | None = None,
    loads: Sequence[float] | None = None,
    tool_extensions: Sequence[float] | None = None,
    setups: Sequence[str] | None = None,
    indicators: bool = False,
    costs: Costs | None = None,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    judgement: Judgement | None = None,
    files: Sequence[str] = (),
) -> Proposal:
    """What to measure next, after some measurements; or first.

    Parameters
    ----------
    machine, data
        The model; n readings, or None for a plan before any.
    between
        Effects to be told apart, or `none`; empty: what a diagnosis leaves standing, or a first campaign.
    n
        Poses; None: 6, or 24 of a first campaign.
    radius, heights, max_tilt, loads, tool_extensions, setups
        What may vary, as in `Menu`: m, m, rad, N, m, names; None: the usual, and what the data have.
    indicators
        Whether a second indicator may be set across a link of the load path.
    costs
        Minutes of work.
    noise, strut_spread, effect_files, seed
        As in `diagnose`; without data, a noise of `CAMPAIGN_NOISE` is assumed.
    judgement
        What a diagnosis of these data came to already (`Diagnosis.main`): it is not made again.
    files
        Names of the measurement files, for the record.

    Raises
    ------
    InputError
        An unknown effect, a number of poses or a menu that cannot be, no reachable pose.

    Examples
    --------
    >>> from toolpath_stiff.machine import load_machine
    >>> found = plan(load_machine("nist"), between=("spindle_compliance", "none"), n=2)
    >>> len(found.plan.chosen), found.plan.separable
    (2, True)
    """
    costs = costs or Costs()
    menu = with_options(
        Menu(setups=(TABLE, RISER)) if data is None else Menu.of(data), radius=radius, heights=heights,
        max_tilt=max_tilt, loads=loads, tool_extensions=tool_extensions, setups=setups, indicators=indicators,
    )  # fmt: skip
    record = (tuple(effect_files), tuple(files), seed)
    effects = known_effects(effect_files)
    planned_for: float | tuple[float, float] = CAMPAIGN_NOISE if noise is None else noise
    if data is None and not between:
        campaign = first_campaign(
            machine, CAMPAIGN_POSES if n is None else n, menu=menu, costs=costs, seed=seed, effects=effects,
            noise=planned_for, effect_files=effect_files,
        )  # fmt: skip
        return Proposal(machine, data, campaign, menu, costs, planned_for, "", {}, *record)
    verdict, errors = "", dict[str, float]()
    if data is None:
        rivals = unfitted_rivals(between, effects, setup=menu.setups[-1])
        notes = ["no data: the rivals are taken at their usual sizes"]
        notes += [] if noise is not None else [f"noise of a reading: {100 * CAMPAIGN_NOISE:g} % assumed"]
    else:
        rivals, verdict, scatter, problem, notes = _rivals_after(
            machine, data, between, effects, noise, strut_spread, effect_files, seed, judgement
        )
        planned_for, errors = (scatter.typical_repeat, scatter.clamping), errors_so_far(problem, rivals)
    found = plan_measurements(
        machine, rivals, planned_for, PLAN_POSES if n is None else n, menu=menu, costs=costs, seed=seed,
        effect_files=effect_files, strut_spread=strut_spread,
    )  # fmt: skip
    found = replace(found, notes=(*notes, *found.notes))
    return Proposal(machine, data, found, menu, costs, planned_for, verdict, errors, *record)


def _rivals_after(
    machine: Machine,
    data: Measurements,
    between: Sequence[str],
    effects: Mapping[str, Effect],
    noise: float | tuple[float, float] | None,
    strut_spread: float,
    effect_files: Sequence[str | Path],
    seed: int,
    judgement: Judgement | None,
) -> tuple[list[Rival], str, Noise, Problem, list[str]]:
    """Rivals after some measurements, the diagnosis's verdict ("" if none was made), noise, problem, notes."""
    if judgement is not None:
        scatter, problem = judgement.noise, judgement.problem
    else:
        # Where nothing is known of the noise the larger guess is planned for: too many repeats do no harm.
        scatter = noise_models(data, noise, strut_spread)[-1]
        problem = Problem.of(Predictor(machine, data, effect_files), scatter)
    notes = [*filter(None, [question(problem.predictor)]), f"noise: {scatter.origin}"]
    if between:
        return fitted_rivals(problem, between, effects), "", scatter, problem, notes
    if judgement is None:
        judgement = judge(problem, scatter, testable_effects(problem.predictor)[0], seed)
    verdict = judgement.verdict
    if verdict == "described":
        notes.append("the answer is only described: the plan goes where it would show, or fail")
    elif verdict != "ambiguous":
        notes.append(f"the diagnosis is settled ({verdict}): the plan puts it to the test against what comes next")
    return rivals_of(judgement), verdict, scatter, problem, notes
