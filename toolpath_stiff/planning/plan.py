"""Plans between rivals: measurements that best tell rival explanations apart, per minute of work.

Visits are chosen one after another. Each lowers the bound on the chance of taking one rival for another,

    sum over pairs of sqrt(w_i w_j) exp(-gap_ij^2 / 4)

(Bhattacharyya's bound; Kailath 1967, IEEE Transactions on Communication Technology 15, 52: gap^2 / 4 is his distance
without its term for unlike covariances), and the one is taken that lowers its logarithm most per minute. A pair that
has been told apart counts no more; one that cannot be told apart takes nothing from the others.
"""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.judgement import NAMED
from toolpath_stiff.inference.noise import LEAST
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.planning.forecasts import Forecast, Rival, forecast_all
from toolpath_stiff.planning.gaps import (
    Expectation,
    GapShares,
    ReadingNoise,
    expected_outcome,
    pair_shares,
    repeat_and_clamping,
)
from toolpath_stiff.planning.indicators import loops_between, with_indicators
from toolpath_stiff.planning.menu import Menu
from toolpath_stiff.planning.visits import Visits, possible_visits
from toolpath_stiff.stiffness.contract import SETUP, Effect
from toolpath_stiff.units import min_from_s

Pair = tuple[str, str]  # names of two rivals
SETTLED = 0.95  # probability of one rival at which visits are enough: on the safe side of a diagnosis's `NAMED`
MOST_RIVALS = 6  # a plan that separates more would separate none well
MOST_VISITS, MOST_REPEATS = 200, 64
LEAST_GAP = 1.0  # standard deviations after all visits: below, tip stiffness cannot tell the two apart
LEAST_GAIN = 0.01  # least gain in probability worth measuring for; it is printed in whole per cent
# Place of an indicator that reads a link's own deflection.
INDICATORS = {
    "tool": "between spindle nose and platform, and tool tip and spindle nose",
    "platform": "between two joints of the platform",
    "joints": "across a joint: strut end to frame vertex, and strut end to platform",
    "struts": "along a strut, from end to end",
    "frame": "between a frame vertex and the floor",
    "table": "between the table and the floor",
    "geometry": "none: the length or radius measured by itself",
    "instrument": "none: a second gauge beside this one, and an indicator watched without load",
}


def telling(effect: Effect) -> str:
    """Place of an indicator that reads an effect's own deflection, or "none: " and another reading that reveals it."""
    return f"none: {effect.told_by}" if effect.told_by else INDICATORS[effect.link]


def reading_words(place: str) -> str:
    """Text of `telling` in words for people."""
    return place.removeprefix("none: ") if place.startswith("none: ") else f"an indicator {place}"


@dataclass(frozen=True)
class PairGap:
    """Gap between two rivals.

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


@dataclass(frozen=True, eq=False)
class RivalPlan:
    """Visits that tell rivals apart, and their expected outcome.

    Attributes
    ----------
    visits, usable
        All that were possible; (v,) those that all rivals have an answer to.
    picked
        Numbers of the chosen ones, the best first.
    seed
        Of their order, and of the expected outcome.
    rivals, forecasts
        Those considered, the most probable first; what they expect of all readings.
    scatter
        How readings and the machine scatter.
    shares
        Pair of rivals -> what each visit adds to their gap.
    notes
        What was assumed or left out.
    verdict, errors
        Of the diagnosis of the data, "" if none was made; mean errors so far, %.
    """

    visits: Visits
    usable: BoolArray
    picked: tuple[int, ...]
    seed: int
    rivals: tuple[Rival, ...]
    forecasts: tuple[Forecast, ...]
    scatter: ReadingNoise
    shares: Mapping[Pair, GapShares]
    notes: tuple[str, ...]
    verdict: str = ""
    errors: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def chosen(self) -> tuple[int, ...]:
        """Numbers of the chosen visits in measuring order: by set-up, then by tool, at random within.

        So a drift over the day looks like no pose.
        """
        visits, setups, tools = self.visits, self.visits.menu.setups, self.visits.menu.tool_extensions
        order = np.random.default_rng([self.seed, 1]).permutation(len(self.picked))
        drawn = [self.picked[k] for k in order]
        return tuple(sorted(drawn, key=lambda v: (setups.index(visits.setup[v]), tools.index(visits.extension[v]))))

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kind of change that each chosen visit brings, in a word or two."""
        return tuple(self.visits.kind(visit) for visit in self.chosen)

    @property
    def why(self) -> tuple[str, ...]:
        """Purpose of each chosen visit, a sentence."""
        return tuple(self._purpose(visit) for visit in self.chosen)

    def _purpose(self, visit: int) -> str:
        visits, rows = self.visits, self.visits.rows(visit)
        tilt, extension, wait, rounds = visits.tilt(visit), visits.extension[visit], visits.wait[visit], visits.rounds
        parts = [f"tilted {np.degrees(tilt):.3g} deg" if tilt > 1e-6 else "vertical"]
        if extension:
            parts.append(f"tool {1e3 * abs(extension):.4g} mm {'longer' if extension > 0 else 'shorter'}")
        if visits.setup[visit]:
            parts.append(f"set-up {visits.setup[visit]}")
        parts.append("at " + " and ".join(f"{load:g} N" for load in np.unique(visits.readings.force[rows])))
        if wait > visits.menu.waits[0]:
            parts.append(f"{min_from_s(wait):.3g} minutes after zeroing")
        if rounds[rows].max() > 1:
            parts.append("each reading twice")
        if visits.loop[visit]:
            parts.append(f"a second indicator: {visits.loop[visit]}")
        gaps = {pair: share.gap([visit]) for pair, share in self.shares.items()}
        first, second = max(gaps, key=lambda pair: gaps[pair])
        return f"{', '.join(parts)}: {gaps[first, second]:.1f} sigma between {first} and {second}"

    @property
    def minutes(self) -> float:
        """Minutes of work."""
        return self.visits.minutes(self.chosen)

    @cached_property
    def pairs(self) -> tuple[PairGap, ...]:
        """Gaps between pairs of rivals, the narrowest first, with the differing links and indicators across them."""
        pairs = []
        for names, share in self.shares.items():
            both = [rival for rival in self.rivals if rival.name in names]
            common = set.intersection(*(set(rival.names) for rival in both))
            effects = [active.effect for rival in both for active in rival.effects]
            places = {effect.link: telling(effect) for effect in effects if effect.name not in common}
            best, gap = float(np.sqrt(share.squares_with(())[self.usable].max())), share.gap(self.chosen)
            pairs.append(PairGap(names, gap, best, gap >= LEAST_GAP, places))
        return tuple(sorted(pairs, key=lambda pair: pair.separation_sigma))

    @property
    def separable(self) -> bool:
        """True if tip stiffness can tell at least one pair apart."""
        return any(pair.separable for pair in self.pairs)

    def expected(self, count: int | None = None, repeats: int = 1) -> Expectation:
        """Expected outcome of the best `count` visits (None: all), each made `repeats` times."""
        rows = [self.visits.rows(visit) for visit in self.picked[:count]]
        visit_of = np.repeat(np.arange(len(rows)), [len(some) for some in rows])
        noise = self.scatter.shared_out(repeats)
        return expected_outcome(self.forecasts, np.concatenate(rows), visit_of, noise, self.seed)

    @property
    def before(self) -> Expectation:
        """Probabilities of the truth and of a settled verdict before the plan."""
        weights = [forecast.weight for forecast in self.forecasts]
        return Expectation(float(np.square(weights).sum()), float(max(weights) >= NAMED))

    @cached_property
    def after(self) -> Expectation:
        """Probabilities of the truth and of a settled verdict expected after the plan."""
        return self.expected()

    @cached_property
    def enough(self) -> int | None:
        """Number of best poses expected to bring the truth to a probability of `SETTLED`; None if all are too few."""
        counts = range(1, len(self.picked) + 1)
        return next((count for count in counts if self.expected(count).truth >= SETTLED), None)

    @cached_property
    def repeats(self) -> int | None:
        """Repeats of each visit, clamped anew, needed for `SETTLED`; None if even `MOST_REPEATS` are too few."""
        chance = range(MOST_REPEATS + 2)
        fewest = bisect_left(chance, SETTLED, lo=1, hi=MOST_REPEATS + 1, key=lambda n: self.expected(repeats=n).truth)
        return None if fewest > MOST_REPEATS else fewest

    @property
    def gains(self) -> bool:
        """True if on average the truth becomes likelier or the verdict settled, and further visits would add to it."""
        rises = (self.after.truth - self.before.truth, self.after.settled - self.before.settled)
        return bool(max(rises) >= LEAST_GAIN and (self.separable or self.repeats is not None))

    @property
    def _rise(self) -> str:
        return f"from {percent(self.before.truth)} to {percent(self.after.truth)}"

    @property
    def _work(self) -> str:
        return f"{len(self.chosen)} pose{'s' * (len(self.chosen) != 1)}, about {self.minutes:.0f} minutes"

    @property
    def sentences(self) -> list[str]:
        """Sentences on what the plan is expected to bring."""
        rises = (
            f"{self._work}: the probability of the right explanation is expected to rise {self._rise}, "
            f"and the verdict to be settled in {percent(self.after.settled)} of cases"
        )
        lines, sure = [rises if self.gains else self.nothing_gained], f"{100 * SETTLED:.0f} %"
        if self.gains and self.enough is not None and self.enough < len(self.chosen):
            lines.append(f"{self.enough} of the poses should do for {sure}; the others are in reserve")
        elif self.gains and self.repeats is None:
            lines.append(f"{sure} is not expected from repeats of these poses, up to {MOST_REPEATS} of them")
        elif self.gains and self.repeats != 1:
            lines.append(f"{sure} is expected after {self.repeats} repeats of each, clamped anew")
        for pair in self.pairs:
            if not pair.separable:
                places = "; or ".join(
                    f"{link}: {place.removeprefix('none: ')}" for link, place in pair.indicator_across.items()
                )
                lines.append(
                    f"tip stiffness cannot tell {pair.effects[0]} from {pair.effects[1]} ({pair.separation_sigma:.1f} "
                    f"sigma after all poses); put an indicator across the link: {places}"
                )
        if self.errors:
            steps = ", ".join(f"{name} {value:.2f} %" for name, value in self.errors.items())
            lines.insert(int(not self.gains), f"mean error so far: {steps}")
        return lines

    @property
    def nothing_gained(self) -> str:
        """Sentence: the plan is not worth its minutes, and what would tell the two likeliest rivals apart instead."""
        first, second = (rival.name for rival in self.rivals[:2])
        pair = next(pair for pair in self.pairs if {first, second} == set(pair.effects))
        beside = bool((self.visits.readings.loop != "").any())  # indicators take part already
        places = [] if beside else list(pair.indicator_across.values())
        across = dict.fromkeys(place.split(":")[0] for place in places if not place.startswith("none: "))
        parts = ["nothing worth measuring" + ("" if beside else " at the tip")]
        parts += [f"an indicator {' or '.join(across)} would tell {first} from {second}"] if across else []
        parts += dict.fromkeys(place.removeprefix("none: ") for place in places if place.startswith("none: "))
        return f"{'; '.join(parts)}. {self._work}, would bring the probability of the right explanation {self._rise}"

    def head(self) -> Document:
        """First entries of plan.json."""
        return {
            "kind": "rivals",
            "verdict": self.verdict,
            "mean_abs_error_percent": self.errors,
            "rivals": [{"name": rival.name, "probability": rival.weight} for rival in self.rivals],
            "poses": len(self.chosen),
            "readings": int(self.visits.counts[list(self.chosen)].sum()),
            "minutes": self.minutes,
            "expected": {
                "probability_of_truth_before": self.before.truth,
                "probability_of_truth_after": self.after.truth,
                "settled_before": self.before.settled,
                "settled_after": self.after.settled,
                "settled_at": NAMED,
                "poses_to_settle": self.enough,
                "repeats_to_settle": self.repeats,
            },
            "worth_measuring": self.gains,
            "pairs": self.pairs,
        }


def percent(share: float) -> str:
    """Share in per cent; an expectation is never "100 %" or "0 %"."""
    if share > 0.99:
        return "more than 99 %"
    return "less than 1 %" if share < 0.01 else f"{100 * share:.0f} %"


def plan_measurements(
    machine: MachineTool,
    rivals: Sequence[Rival],
    noise_relative: float | tuple[float, float],
    n: int = 6,
    *,
    menu: Menu | None = None,
    seed: int = 0,
    effect_files: Sequence[str | Path] = (),
    strut_spread: float = STRUT_SPREAD,
) -> RivalPlan:
    """Choose the visits that tell rivals apart best per minute.

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
    menu
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
        notes.append(f"planned for a noise of {100 * LEAST:g} % a reading: no measurement is better")
    menu = menu or Menu()
    visits = possible_visits(machine, menu, matters(ranked), np.random.default_rng(seed))
    if menu.indicators and isinstance(machine, Hexapod):
        visits = with_indicators(machine, visits, loops_between(ranked), repeat)
    forecasts, good, scatter = forecast_all(machine, ranked, visits.readings, effect_files, strut_spread)
    usable = np.logical_and.reduceat(good[visits.members], visits.starts)
    if not usable.any():
        raise InputError("no pose that suits every rival", hint="plan with fewer rivals, or other heights")
    # Readings without a forecast belong to visits that are never chosen; their nan must not spread.
    forecasts = [
        replace(f, mean=np.where(good, f.mean, 0.0), factor=np.where(good[:, None], f.factor, 0.0)) for f in forecasts
    ]
    floors = {name: low for name, low in menu.floors.items() if name in visits.setup}
    words = ", ".join(f"{1e3 * low:.4g} mm" + (f" in set-up {name}" if name else "") for name, low in floors.items())
    notes += [f"no pose lower than those measured before: {words}; name heights to go lower"] if floors else []
    noise = ReadingNoise(repeat, clamping, scatter)
    shares = {(f.name, g.name): pair_shares(visits, f, g, noise) for f, g in combinations(forecasts, 2)}
    picked = choose(visits, usable, shares, {f.name: f.weight for f in forecasts}, n)
    return RivalPlan(visits, usable, picked, seed, ranked, tuple(forecasts), noise, shares, tuple(notes))


def choose(
    visits: Visits, usable: BoolArray, shares: Mapping[Pair, GapShares], weights: Mapping[str, float], n: int
) -> tuple[int, ...]:
    """Up to `n` usable visits, chosen one by one, each the one that lowers the bound most per minute."""

    def log_bound(squares: Mapping[Pair, FloatArray]) -> FloatArray:
        terms = [0.5 * np.log(weights[i] * weights[j]) - square / 4.0 for (i, j), square in squares.items()]
        return np.asarray(np.logaddexp.reduce(terms, axis=0))

    chosen: list[int] = []
    free = usable.copy()
    now = float(log_bound({pair: np.zeros(()) for pair in shares}))
    while free.any() and len(chosen) < n:
        after = log_bound({pair: share.squares_with(chosen) for pair, share in shares.items()})
        best = int(np.argmax(np.where(free, (now - after) / visits.further_minutes(chosen), -np.inf)))
        chosen.append(best)
        now = float(after[best])
        free &= ~visits.same_place(best)
    return tuple(chosen)


def _ranked(rivals: Sequence[Rival]) -> tuple[tuple[Rival, ...], list[str]]:
    """The most probable rivals, weights adding up to 1, and a note on those left out."""
    if len(rivals) < 2:
        raise InputError(f"{len(rivals)} rivals to tell apart", expected="two or more")
    order = sorted(rivals, key=lambda rival: -rival.weight)
    notes = []
    if out := ", ".join(rival.name for rival in order[MOST_RIVALS:]):
        notes, order = [f"the plan is for the {MOST_RIVALS} most probable rivals, not for {out}"], order[:MOST_RIVALS]
    total = sum(rival.weight for rival in order)
    return tuple(replace(rival, weight=rival.weight / total) for rival in order), notes


def matters(rivals: Sequence[Rival]) -> set[str]:
    """Columns that the rivals' forecasts depend on."""
    actives = [active for rival in rivals for active in rival.effects]
    columns = {column for active in actives for column in active.effect.needs}
    if any(active.effect.load_dependent for active in actives):
        columns.add("force_N")
    if any(p.name == SETUP for active in actives for p in active.effect.parameters):  # that it acts on
        columns.add("setup")
    return columns
