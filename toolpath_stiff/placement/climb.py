"""Climbing from one placement, a sequence of linear programmes within a trust region; and fronts of placements.

Range and weakest place are extremes over samples and have kinks where two samples are equally stiff, which is where
their best values lie. Linearised sample by sample they are constraints of a linear programme (the epigraph form:
L <= k_i <= H for all i), and so are the limits and what must not get worse. Its solution is tried; where the figures
did not follow, it is corrected once for what was found there, and then the trust region shrinks (Fletcher, Practical
Methods of Optimization, 1987, section 14.4, exact penalty functions and second-order corrections; here with one shared
slack for all constraints, so that there is always a solution).

A front holds what nothing beats in mean, range and weakest place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.placement.evaluator import Evaluator, PlacedRows, PlacementFigures
from toolpath_stiff.placement.linear_programmes import least_costs

if TYPE_CHECKING:
    from toolpath_stiff.placement.linear_programmes import Programme


DIFFERENCE = 1e-6  # of each range, for the derivatives


PENALTY = 100.0  # what a shortfall costs, in units of the objective


INSIDE = 1e-6  # of the mean stiffness, and of a limit's span: constraints are met with this to spare


SMALLEST_REGION = 1e-5  # of each range


SMALLEST_GAIN = 1e-9  # of the mean stiffness


WORTH_A_RESTART = 1e-5  # of the mean stiffness: with a region as wide as at first, which kinks may have closed early


SLACKEST = 1e3


SOME_STIFFNESS = 5e7  # N/m, the order of a machine tool's: where no climb begins within reach


NO_SLOPE = np.zeros((1, 1))


_Block = tuple[
    FloatArray, tuple[float, float, float, float], FloatArray | float
]  # (free, j) slopes, L H t slack, bound


Rank = tuple[float, float, float]  # more is better, the first that differs decides: rules, floors, value


@dataclass(frozen=True)
class Bounds:
    """What the search may vary. SI.

    `low`, `high` (6,): x, y, z in m, A, B, C in rad; equal where fixed. `heights`: the only z allowed, or empty.
    """

    low: FloatArray
    high: FloatArray
    heights: tuple[float, ...] = ()

    @cached_property
    def free(self) -> IntArray:
        """Columns of a placement that vary."""
        return np.flatnonzero(self.high > self.low)

    @cached_property
    def round(self) -> BoolArray:
        """(6,) turns that go all the way round, and so have no end."""
        angle = np.arange(6) == 5
        return np.asarray(angle & (self.high - self.low >= 2.0 * np.pi - 1e-9))

    def placements(self, unit: FloatArray) -> FloatArray:
        """Placements (k, 6) of points (k, free) of the unit cube; a whole turn goes round."""
        placements = np.repeat(self.low[None], len(unit), axis=0)
        free = self.free
        inside = np.where(self.round[free], np.mod(unit, 1.0), np.clip(unit, 0.0, 1.0))
        placements[:, free] = self.low[free] + inside * (self.high - self.low)[free]
        if self.heights:
            heights = np.array(self.heights)
            nearest = np.abs(placements[:, 2, None] - heights).argmin(axis=1)
            placements[:, 2] = heights[nearest]
        return placements

    def unit(self, placements: FloatArray) -> FloatArray:
        """Points (k, free) of the unit cube of placements (k, 6)."""
        free = self.free
        return np.asarray((placements[:, free] - self.low[free]) / (self.high - self.low)[free])

    def holds(self, placement: FloatArray) -> bool:
        """Whether a placement (6,) lies within; the turn counts modulo a whole one."""
        apart = np.mod(placement[5] - self.low[5] + 1e-9, 2.0 * np.pi) - 1e-9
        inside = (placement >= self.low - 1e-9) & (placement <= self.high + 1e-9)
        inside[5] = apart <= self.high[5] - self.low[5] + 1e-9
        on_a_height = not self.heights or bool(np.abs(np.array(self.heights) - placement[2]).min() < 1e-9)
        return bool(inside.all()) and on_a_height


@dataclass(frozen=True)
class Rules:
    """What a placement has to keep.

    Attributes
    ----------
    margin
        Smallest margin to any limit, as a share of its span; cuts and rapids alike.
    extrapolated
        Largest share of samples outside the strut law; inf: any.
    """

    margin: float = 0.0
    extrapolated: float = np.inf

    def violation(self, figures: PlacementFigures) -> FloatArray:
        """(k,) how far placements are from keeping the rules; 0 where they are kept."""
        shortfalls = [self.margin - figures.margin, self.margin - figures.rapid_margin, -figures.clearance]
        shortfalls.append(figures.extrapolated - self.extrapolated - 1e-12)
        return np.asarray(np.maximum(np.max(shortfalls, axis=0), 0.0))


@dataclass(frozen=True)
class Goal:
    """What is to be raised: `weights` . (mean, -range, weakest), N/m, none of them below `floors`.

    `weights` None: the smallest surplus over the floors, which may be negative.
    """

    weights: tuple[float, float, float] | None
    floors: FloatArray

    def value(self, figures: PlacementFigures) -> FloatArray:
        """(k,) N/m, -inf where the figures do not exist."""
        if self.weights is None:
            value = (figures.objectives - self.floors).min(axis=1)
        else:
            value = (figures.objectives * np.array(self.weights)).sum(axis=1)
        return np.asarray(np.where(np.isnan(value), -np.inf, value))

    def worsening(self, figures: PlacementFigures) -> FloatArray:
        """(k,) N/m, the largest fall below a floor; 0 if there is none."""
        if self.weights is None:
            return np.zeros(len(figures))
        below = np.maximum((self.floors - figures.objectives).max(axis=1), 0.0)
        return np.asarray(np.where(np.isnan(below), np.inf, below))


@dataclass
class _Climb:
    """One climb: where it is, the best that it met, how far the next linear programme may go."""

    goal: Goal
    here: FloatArray
    rows: PlacedRows
    merit: float
    best: FloatArray
    best_rank: Rank
    region: float
    began: float
    gradient: PlacedRows | None = None
    step: FloatArray = field(default_factory=lambda: np.zeros(0))
    tried: PlacedRows | None = None

    def take(self, there: FloatArray, merit: float) -> None:
        """Go to where the step led."""
        if float(np.abs(self.step).max()) > 0.9 * self.region:
            self.region = min(2.0 * self.region, 0.25)
        assert self.tried is not None
        self.here, self.rows, self.merit, self.gradient = there, self.tried, merit, None

    def bent(self) -> PlacedRows:
        """What the programme has to start from to foretell what was found after the step: the second-order correction.

        A kink along which the figures are curved else lets only ever smaller steps pass (Fletcher 1987, section 14.4).
        """
        assert self.tried is not None and self.gradient is not None
        return self.tried.less(self.gradient, self.step)

    def shrink(self, first_region: float) -> None:
        """Look nearer; from as far as at first again while that is worth it."""
        self.region = 0.4 * min(self.region, max(float(np.abs(self.step).max()), SMALLEST_REGION))
        if self.region < SMALLEST_REGION and self.merit - self.began >= WORTH_A_RESTART:
            self.began, self.region = self.merit, first_region


def _merit(rank: Rank, scale: float) -> float:
    violated, worse, value = rank
    if not np.isfinite(value) or not np.isfinite(worse):
        return -1e3 + violated
    return (value + PENALTY * worse) / scale + PENALTY * violated


@dataclass(frozen=True)
class Climber:
    """One evaluator, the bounds and the rules that a climb keeps."""

    evaluator: Evaluator
    bounds: Bounds
    rules: Rules

    @cached_property
    def free(self) -> IntArray:
        """Columns that a climb may vary: a height from a list stays."""
        free = self.bounds.free
        return free[free != 2] if self.bounds.heights else free

    def climb(self, first: FloatArray, goal: Goal | Sequence[Goal], steps: int, region: float = 0.05) -> FloatArray:
        """The best placements (k, 6) on the ways up from `first` (k, 6): rules first, then floors, then value.

        One goal for all, or one for each. All climb in step, so that each trial evaluates k placements at once.
        """
        if not len(self.free):
            return first
        rows = self.evaluator.rows(first)
        scale = float(np.nanmean(rows.stiffness)) if np.isfinite(rows.stiffness).any() else SOME_STIFFNESS
        goals = [goal] * len(first) if isinstance(goal, Goal) else list(goal)
        judged = self._judged(rows, goals, scale)
        climbs = [
            _Climb(goals[i], first[i], rows.take(i), merit, first[i], rank, region, merit)
            for i, (merit, rank) in enumerate(judged)
        ]
        for _ in range(steps):
            going = [climb for climb in climbs if climb.region >= SMALLEST_REGION]
            if not going:
                break
            self._differentiate([climb for climb in going if climb.gradient is None])
            missed = self._try(going, [climb.rows for climb in going], scale)
            # Corrected for the curvature of what was found.
            for climb in self._try(missed, [climb.bent() for climb in missed], scale):
                climb.shrink(region)
        return np.array([climb.best for climb in climbs])

    def _try(self, climbs: list[_Climb], rows: list[PlacedRows], scale: float) -> list[_Climb]:
        """Evaluate the next step of each climb, foretold from `rows`, and take it where it gains; the others."""
        if not climbs:
            return []
        programmes = [self._programme(climb, values) for climb, values in zip(climbs, rows, strict=True)]
        for climb, found in zip(climbs, least_costs(programmes), strict=True):
            climb.step = np.zeros(len(self.free)) if found is None else found[: len(self.free)]
        there = np.array([self._moved(climb.here, climb.step) for climb in climbs])
        placed = self.evaluator.rows(there)
        missed = []
        for i, (merit, rank) in enumerate(self._judged(placed, [climb.goal for climb in climbs], scale)):
            climb = climbs[i]
            climb.tried = placed.take(i)
            if rank > climb.best_rank:
                climb.best, climb.best_rank = there[i], rank
            if merit > climb.merit + SMALLEST_GAIN:
                climb.take(there[i], merit)
            else:
                missed.append(climb)
        return missed

    def _judged(self, rows: PlacedRows, goals: list[Goal], scale: float) -> list[tuple[float, Rank]]:
        """Of each placement the merit for its goal, value less penalties in units of `scale` (N/m), and its rank."""
        figures = self.evaluator.summary(rows)
        ranks = np.empty((len(goals), 3))
        ranks[:, 0] = -self.rules.violation(figures)
        for goal in {id(goal): goal for goal in goals}.values():
            same = np.array([other is goal for other in goals])
            some = figures.take(same)
            ranks[same, 1], ranks[same, 2] = -goal.worsening(some), goal.value(some)
        return [(_merit(rank, scale), rank) for rank in ((a, b, c) for a, b, c in ranks.tolist())]

    def _inwards(self, placement: FloatArray) -> FloatArray:
        """(free,) 1 or -1, the sense that leads away from the nearer bound."""
        middle = 0.5 * (self.bounds.low + self.bounds.high)
        return np.where(placement[self.free] > middle[self.free], -1.0, 1.0)

    def _moved(self, placement: FloatArray, step: FloatArray) -> FloatArray:
        """A placement moved by a step (free,) of the ranges; a whole turn is brought back when the climb ends."""
        span = (self.bounds.high - self.bounds.low)[self.free]
        moved = placement.copy()
        moved[self.free] += step * span
        held = self.free[~self.bounds.round[self.free]]
        moved[held] = np.clip(moved[held], self.bounds.low[held], self.bounds.high[held])
        if self.bounds.round[5]:
            moved[5] = self.bounds.low[5] + np.mod(moved[5] - self.bounds.low[5], 2.0 * np.pi)
        return moved

    def _differentiate(self, climbs: list[_Climb]) -> None:
        """Derivatives of every row along each free column: arrays (free, samples), per unit of the range."""
        if not climbs:
            return
        d, span = len(self.free), (self.bounds.high - self.bounds.low)[self.free]
        signs = np.array([self._inwards(climb.here) for climb in climbs])
        around = np.repeat(np.array([climb.here for climb in climbs])[:, None], d, axis=1)
        around[:, np.arange(d), self.free] += signs * DIFFERENCE * span
        found = self.evaluator.rows(around.reshape(-1, 6))
        for i, (climb, sign) in enumerate(zip(climbs, signs, strict=True)):
            there = found.take(slice(i * d, (i + 1) * d))
            climb.gradient = there.slopes(climb.rows, sign * DIFFERENCE)

    def _programme(self, climb: _Climb, rows: PlacedRows) -> Programme:
        """The linear programme of the step within the region; variables step (free,), L, H, t, slack."""
        here, region, gradient, goal = climb.here, climb.region, climb.gradient, climb.goal
        assert gradient is not None
        d = len(self.free)
        k, g, scale = self._stiffness(rows, gradient)
        matrix, right = self._constraints(rows, gradient, k, g, scale, goal, region)
        cost = np.zeros(d + 4)
        slope = (g * self._weight).sum(axis=1)
        if goal.weights is None:
            cost[d + 2] = -1.0
        else:
            w_mean, w_range, w_low = goal.weights
            cost[:d] = -w_mean * slope
            cost[d], cost[d + 1] = -w_low - w_range, w_range
        cost[d + 3] = PENALTY
        span = (self.bounds.high - self.bounds.low)[self.free]
        room = [(here[i] - self.bounds.low[i], self.bounds.high[i] - here[i]) for i in self.free]
        box = [
            (-region, region) if self.bounds.round[i] else (max(-region, -below / s), min(region, above / s))
            for i, s, (below, above) in zip(self.free, span, room, strict=True)
        ]
        low, high = np.array([*box, *[(-SLACKEST, SLACKEST)] * 3, (0.0, SLACKEST)]).T
        return cost, matrix, right, low, high

    def _stiffness(self, rows: PlacedRows, gradient: PlacedRows) -> tuple[FloatArray, FloatArray, float]:
        """(h,) and (free, h) stiffness of the headline samples and its derivatives, in units of their mean, N/m."""
        head = self.evaluator.head
        values = rows.stiffness[0, head]
        scale = float(values.sum() / max(len(values), 1))
        if not np.isfinite(scale):  # a cut out of reach: no figures, the limits alone guide
            return np.ones(len(values)), np.zeros((len(self.free), len(values))), scale
        slopes = gradient.stiffness[:, head] / scale
        return values / scale, slopes if np.isfinite(slopes.sum()) else np.nan_to_num(slopes), scale

    @cached_property
    def _weight(self) -> FloatArray:
        """(h,) share of the path's length that each headline sample stands for."""
        raw = self.evaluator.path.weight[self.evaluator.head]
        return np.asarray(raw / raw.sum())

    def _constraints(
        self,
        rows: PlacedRows,
        gradient: PlacedRows,
        k: FloatArray,
        g: FloatArray,
        scale: float,
        goal: Goal,
        region: float,
    ) -> tuple[FloatArray, FloatArray]:
        """A x <= b in the variables step, L, H, t, slack; rows that cannot bind within the region are left out."""
        d = len(self.free)
        reach = region * np.abs(g).sum(axis=0)
        low = np.flatnonzero(k - reach <= (k + reach).min(initial=np.inf))
        high = np.flatnonzero(k + reach >= (k - reach).max(initial=-np.inf))
        blocks: list[_Block] = [
            (-g[:, low], (1.0, 0.0, 0.0, 0.0), k[low]),
            (g[:, high], (0.0, -1.0, 0.0, 0.0), -k[high]),
        ]
        for values, slopes, least in self._kept(rows, gradient):
            near = np.flatnonzero(values - region * np.abs(slopes).sum(axis=0) < least + INSIDE)
            blocks.append((-slopes[:, near], (0.0, 0.0, 0.0, -1.0), values[near] - least - INSIDE))
        floors = (goal.floors / scale) + (0.0 if goal.weights is None else INSIDE)
        soft = (1.0, 0.0) if goal.weights is None else (0.0, -1.0)  # the common surplus t, or the slack
        if np.isfinite(scale):
            if np.isfinite(floors[0]):
                mean = float((k * self._weight).sum()) - floors[0]
                blocks.append((-(g * self._weight).sum(axis=1)[:, None], (0.0, 0.0, *soft), mean))
            if np.isfinite(floors[1]):
                blocks.append((NO_SLOPE, (-1.0, 1.0, *soft), -floors[1]))
            if np.isfinite(floors[2]):
                blocks.append((NO_SLOPE, (-1.0, 0.0, *soft), -floors[2]))
        blocks += [(NO_SLOPE, (1.0, -1.0, 0.0, 0.0), 0.0), (NO_SLOPE, (0.0, 0.0, 1.0, 0.0), SLACKEST)]
        return _joined(blocks, d)

    def _kept(self, rows: PlacedRows, gradient: PlacedRows) -> list[tuple[FloatArray, FloatArray, float]]:
        """Values, derivatives and least value of what the rules keep, sample by sample."""
        kept = [(rows.margin[0], gradient.margin, self.rules.margin)]
        if self.evaluator.keepouts:
            kept.append((rows.clearance[0], gradient.clearance, 0.0))
        cutting = self.evaluator.cuts
        law = rows.law[0, cutting]
        if np.isfinite(self.rules.extrapolated) and len(law):
            inside = law >= 0.0
            # With room for more samples outside the law none is held; a trial that takes too many is refused.
            if np.mean(~inside) >= 0.98 * self.rules.extrapolated:
                kept.append((law[inside], gradient.law[:, cutting][:, inside], 0.0))
        return kept


def _joined(blocks: list[_Block], free: int) -> tuple[FloatArray, FloatArray]:
    """A (m, free + 4) and b (m,) of constraints A x <= b."""
    m = sum(slopes.shape[1] for slopes, _, _ in blocks)
    matrix, right, start = np.empty((free + 4, m)), np.empty(m), 0
    for slopes, rest, bound in blocks:
        rows = slice(start, start + slopes.shape[1])
        matrix[:free, rows], right[rows] = slopes, bound
        for row, value in zip(matrix[free:], rest, strict=True):
            row[rows] = value
        start = rows.stop
    return matrix.T, right


def front_rows(figures: PlacementFigures, kept: BoolArray) -> IntArray:
    """Rows of those kept that no other beats in all of mean, range and weakest, by rising mean; equals stand once."""
    rows = np.flatnonzero(kept & np.isfinite(figures.mean))
    values, first = np.unique(figures.objectives[rows], axis=0, return_index=True)
    rows = rows[first]
    no_worse = np.asarray((values[:, None] >= values[None]).all(axis=2))  # [i, j]: i is at least as good as j in all
    no_worse[np.diag_indices(len(rows))] = False
    return np.asarray(rows[~no_worse.any(axis=0)], dtype=np.int64)


def thin(objectives: FloatArray, rows: IntArray, points: int, best: int = -1) -> IntArray:
    """At most `points` of rows (n,) with objectives (n, 3), spread over the front by farthest-point choice.

    Its ends and the row `best` come first.
    """
    if len(rows) <= points:
        return rows
    scaled = (objectives - objectives.min(axis=0)) / np.maximum(np.ptp(objectives, axis=0), 1e-12)
    chosen = list(dict.fromkeys([*np.flatnonzero(rows == best), *scaled.argmax(axis=0)]))[:points]
    distance = np.min([((scaled - scaled[i]) ** 2).sum(axis=1) for i in chosen], axis=0)
    while len(chosen) < points:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, ((scaled - scaled[chosen[-1]]) ** 2).sum(axis=1))
    return np.asarray(rows[np.sort(np.array(chosen))])


def apart(bounds: Bounds, placements: FloatArray, count: int, distance: float = 0.1) -> list[int]:
    """Rows of ranked placements: the first, and the best of the others that are not beside one chosen.

    `distance` in shares of the ranges.
    """
    unit, whole_turn = bounds.unit(placements), bounds.round[bounds.free]
    chosen: list[int] = []
    for i in range(len(unit)):
        away = np.abs(unit[chosen] - unit[i])
        away = np.where(whole_turn, np.minimum(away, 1.0 - away), away)
        if (away.max(axis=1, initial=0.0) > distance).all():
            chosen.append(i)
        if len(chosen) == count:
            break
    return chosen
