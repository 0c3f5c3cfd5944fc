"""Climbs from one placement: a sequence of linear programmes within a trust region.

Range and weakest place are extremes over samples and have kinks where two samples are equally stiff, which is where
their best values lie. Linearised sample by sample they are constraints of a linear programme (the epigraph form:
L <= k_i <= H for all i), and so are the limits and what must not get worse. Its solution is tried; where the figures
did not follow, it is corrected once for what was found there, and then the trust region shrinks (Fletcher, Practical
Methods of Optimization, 1987, section 14.4, exact penalty functions and second-order corrections; here with one shared
slack for all constraints, so that there is always a solution).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray, product
from toolpath_stiff.placement.evaluator import Evaluator, PlacedRows
from toolpath_stiff.placement.goals import Bounds, Goal, SearchRules
from toolpath_stiff.placement.linear_programmes import Programme, least_costs

DIFFERENCE = 1e-6  # step of the derivatives, as a share of each range
PENALTY = 100.0  # cost of a shortfall, in units of the objective
INSIDE = 1e-6  # share of mean stiffness and of limits' spans by which constraints are met with room to spare
SMALLEST_REGION = 1e-5  # of each range
SMALLEST_GAIN = 1e-9  # of the mean stiffness
WORTH_A_RESTART = 1e-5  # of the mean stiffness: gain worth a restart with the first region, which kinks may close early
SLACKEST = 1e3
SOME_STIFFNESS = 5e7  # N/m, typical of a machine tool; used if no climb begins within reach
NO_SLOPE = np.zeros((1, 1))
Rank = tuple[float, float, float]  # more is better, the first that differs decides: rules, floors, value
_Block = tuple[FloatArray, tuple[float, float, float, float], FloatArray | float]  # slopes, L H t slack, bound


@dataclass
class _Climb:
    """State of one climb: its place, the best placement met, the trust region."""

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

    def move(self, there: FloatArray, rows: PlacedRows, merit: float) -> None:
        """Move to the result of the step."""
        if float(np.abs(self.step).max()) > 0.9 * self.region:
            self.region = min(2.0 * self.region, 0.25)
        self.here, self.rows, self.merit, self.gradient = there, rows, merit, None

    def bent(self, tried: PlacedRows) -> PlacedRows:
        """Rows from which the programme would have predicted those after the step: the second-order correction.

        A kink along which the figures are curved else lets only ever smaller steps pass (Fletcher 1987, section 14.4).
        """
        assert self.gradient is not None
        return tried.combined(lambda now, slope: now - product(self.step[None], slope), self.gradient)

    def shrink(self, first_region: float) -> None:
        """Shrink the trust region; restart with the initial one as long as that pays."""
        self.region = 0.4 * min(self.region, max(float(np.abs(self.step).max()), SMALLEST_REGION))
        if self.region < SMALLEST_REGION and self.merit - self.began >= WORTH_A_RESTART:
            self.began, self.region = self.merit, first_region


@dataclass(frozen=True)
class Climber:
    """An evaluator with the bounds and rules that a climb keeps."""

    evaluator: Evaluator
    bounds: Bounds
    rules: SearchRules

    @cached_property
    def free(self) -> IntArray:
        """Columns that a climb may vary: a height taken from a list stays."""
        free = self.bounds.free
        return free[free != 2] if self.bounds.heights else free

    @cached_property
    def span(self) -> FloatArray:
        """(free,) m and rad, the ranges of these columns."""
        return np.asarray((self.bounds.high - self.bounds.low)[self.free])

    @cached_property
    def weight(self) -> FloatArray:
        """(h,) share of the path's length that each headline sample represents."""
        lengths = self.evaluator.path.weight[self.evaluator.head]
        return np.asarray(lengths / lengths.sum())

    def climb(self, first: FloatArray, goal: Goal | Sequence[Goal], steps: int, region: float = 0.05) -> FloatArray:
        """Best placements (k, 6) met on climbs from `first` (k, 6): rules first, then floors, then value.

        One goal for all, or one for each. All climb in step, so that each trial evaluates k placements at once.
        """
        if not len(self.free):
            return first
        rows = self.evaluator.rows(first)
        scale = float(np.nanmean(rows.stiffness)) if np.isfinite(rows.stiffness).any() else SOME_STIFFNESS
        goals = [goal] * len(first) if isinstance(goal, Goal) else list(goal)
        climbs = [
            _Climb(goals[i], first[i], rows.take(slice(i, i + 1)), merit, first[i], rank, region, merit)
            for i, (merit, rank) in enumerate(self._judged(rows, goals, scale))
        ]
        for _ in range(steps):
            going = [climb for climb in climbs if climb.region >= SMALLEST_REGION]
            if not going:
                break
            self._differentiate([climb for climb in going if climb.gradient is None])
            missed = self._try(going, [climb.rows for climb in going], scale)
            # Corrected for the curvature found.
            for climb, _ in self._try(
                [climb for climb, _ in missed], [climb.bent(tried) for climb, tried in missed], scale
            ):
                climb.shrink(region)
        return np.array([climb.best for climb in climbs])

    def _try(
        self, climbs: Sequence[_Climb], rows: Sequence[PlacedRows], scale: float
    ) -> list[tuple[_Climb, PlacedRows]]:
        """Evaluate the next step of each climb, predicted from `rows`, and take it if it gains; return the others."""
        if not climbs:
            return []
        programmes = [self._programme(climb, values) for climb, values in zip(climbs, rows, strict=True)]
        for climb, solution in zip(climbs, least_costs(programmes), strict=True):
            climb.step = np.zeros(len(self.free)) if solution is None else solution[: len(self.free)]
        there = np.array([self._moved(climb.here, climb.step) for climb in climbs])
        placed = self.evaluator.rows(there)
        missed = []
        for i, (merit, rank) in enumerate(self._judged(placed, [climb.goal for climb in climbs], scale)):
            climb, tried = climbs[i], placed.take(slice(i, i + 1))
            if rank > climb.best_rank:
                climb.best, climb.best_rank = there[i], rank
            if merit > climb.merit + SMALLEST_GAIN:
                climb.move(there[i], tried, merit)
            else:
                missed.append((climb, tried))
        return missed

    def _judged(self, rows: PlacedRows, goals: Sequence[Goal], scale: float) -> list[tuple[float, Rank]]:
        """Merit of each placement for its goal, value less penalties in units of `scale` (N/m), and its rank."""
        figures = self.evaluator.summary(rows)
        ranks = np.empty((len(goals), 3))
        ranks[:, 0] = -self.rules.violation(figures)
        for goal in {id(goal): goal for goal in goals}.values():
            same = np.array([other is goal for other in goals])
            some = figures.take(same)
            ranks[same, 1], ranks[same, 2] = -goal.worsening(some), goal.value(some)
        judged = []
        for violated, worse, value in ranks.tolist():
            known = np.isfinite(value) and np.isfinite(worse)
            merit = (value + PENALTY * worse) / scale + PENALTY * violated if known else -1e3 + violated
            judged.append((merit, (violated, worse, value)))
        return judged

    def _moved(self, placement: FloatArray, step: FloatArray) -> FloatArray:
        """Placement moved by a step (free,) in shares of the ranges; whole turns are taken out when the climb ends."""
        bounds, moved = self.bounds, placement.copy()
        moved[self.free] += step * self.span
        held = self.free[~bounds.round[self.free]]
        moved[held] = np.clip(moved[held], bounds.low[held], bounds.high[held])
        turns, low = bounds.round, bounds.low
        moved[turns] = low[turns] + np.mod(moved[turns] - low[turns], 2.0 * np.pi)
        return moved

    def _differentiate(self, climbs: Sequence[_Climb]) -> None:
        """Differentiate every row along each free column: arrays (free, samples), per unit of the range."""
        if not climbs:
            return
        d, middle = len(self.free), 0.5 * (self.bounds.low + self.bounds.high)[self.free]
        here = np.array([climb.here for climb in climbs])
        steps = np.where(here[:, self.free] > middle, -1.0, 1.0) * DIFFERENCE  # away from the nearer bound
        around = np.repeat(here[:, None], d, axis=1)
        around[:, np.arange(d), self.free] += steps * self.span
        rows = self.evaluator.rows(around.reshape(-1, here.shape[1]))
        for i, climb in enumerate(climbs):
            step = steps[i, :, None]
            there = rows.take(slice(i * d, (i + 1) * d))
            climb.gradient = there.combined(lambda moved, start, step=step: (moved - start) / step, climb.rows)

    def _programme(self, climb: _Climb, rows: PlacedRows) -> Programme:
        """Linear programme of the step within the trust region; variables step (free,), L, H, t, slack."""
        here, region, gradient, goal, head = climb.here, climb.region, climb.gradient, climb.goal, self.evaluator.head
        assert gradient is not None
        d = len(self.free)
        k, g = rows.stiffness[0, head], gradient.stiffness[:, head]  # (h,) and (free, h), in units of the mean
        scale = float(k.sum() / max(len(k), 1))
        if np.isfinite(scale):
            k, g = k / scale, g / scale
            g = g if np.isfinite(g.sum()) else np.nan_to_num(g)
        else:  # a cut is out of reach: no figures, only the limits guide
            k, g = np.ones(len(k)), np.zeros((d, len(k)))
        slope = (g * self.weight).sum(axis=1)
        cost = np.zeros(d + 4)
        if goal.weights is None:
            cost[d + 2] = -1.0
        else:
            w_mean, w_range, w_low = goal.weights
            cost[:d] = -w_mean * slope
            cost[d], cost[d + 1] = -w_low - w_range, w_range
        cost[d + 3] = PENALTY
        blocks = self._kept(rows, gradient, k, g, region)
        if np.isfinite(scale):
            blocks += self._floors(goal, scale, slope, k)
        low, high = self.bounds.low[self.free], self.bounds.high[self.free]
        whole = self.bounds.round[self.free]
        least = np.where(whole, -region, np.maximum(-region, -(here[self.free] - low) / self.span))
        most = np.where(whole, region, np.minimum(region, (high - here[self.free]) / self.span))
        slackest = [SLACKEST] * 3
        return (
            cost,
            *_joined([*blocks, (NO_SLOPE, (1.0, -1.0, 0.0, 0.0), 0.0), (NO_SLOPE, (0.0, 0.0, 1.0, 0.0), SLACKEST)], d),
            np.array([*least, *(-s for s in slackest), 0.0]),
            np.array([*most, *slackest, SLACKEST]),
        )

    def _kept(
        self, rows: PlacedRows, gradient: PlacedRows, k: FloatArray, g: FloatArray, region: float
    ) -> list[_Block]:
        """Constraints of L and H as bounds of all stiffnesses, and of the rules; rows that cannot bind are left out."""
        reach = region * np.abs(g).sum(axis=0)
        low = np.flatnonzero(k - reach <= (k + reach).min(initial=np.inf))
        high = np.flatnonzero(k + reach >= (k - reach).max(initial=-np.inf))
        blocks: list[_Block] = [
            (-g[:, low], (1.0, 0.0, 0.0, 0.0), k[low]),
            (g[:, high], (0.0, -1.0, 0.0, 0.0), -k[high]),
        ]
        kept = [(rows.margin[0], gradient.margin, self.rules.margin)]
        if self.evaluator.keepouts:
            kept.append((rows.clearance[0], gradient.clearance, 0.0))
        law = rows.law[0, self.evaluator.cuts]
        if np.isfinite(self.rules.extrapolated) and len(law):
            inside = law >= 0.0
            # While more samples may leave the law, none is constrained; a trial with too many is refused.
            if np.mean(~inside) >= 0.98 * self.rules.extrapolated:
                kept.append((law[inside], gradient.law[:, self.evaluator.cuts][:, inside], 0.0))
        for values, slopes, least in kept:
            near = np.flatnonzero(values - region * np.abs(slopes).sum(axis=0) < least + INSIDE)
            blocks.append((-slopes[:, near], (0.0, 0.0, 0.0, -1.0), values[near] - least - INSIDE))
        return blocks

    def _floors(self, goal: Goal, scale: float, slope: FloatArray, k: FloatArray) -> list[_Block]:
        """Constraints against getting worse: with the slack, or with the common surplus t if that is the goal."""
        floors = (goal.floors / scale) + (0.0 if goal.weights is None else INSIDE)
        soft = (1.0, 0.0) if goal.weights is None else (0.0, -1.0)
        blocks: list[_Block] = [
            (-slope[:, None], (0.0, 0.0, *soft), float((k * self.weight).sum()) - floors[0]),
            (NO_SLOPE, (-1.0, 1.0, *soft), -floors[1]),
            (NO_SLOPE, (-1.0, 0.0, *soft), -floors[2]),
        ]
        return [block for block, floor in zip(blocks, floors, strict=True) if np.isfinite(floor)]


def _joined(blocks: Sequence[_Block], free: int) -> tuple[FloatArray, FloatArray]:
    """A (m, free + 4) and b (m,) of constraints A x <= b."""
    m = sum(slopes.shape[1] for slopes, _, _ in blocks)
    matrix, right, start = np.empty((free + 4, m)), np.empty(m), 0
    for slopes, rest, bound in blocks:
        rows = slice(start, start + slopes.shape[1])
        matrix[:free, rows], matrix[free:, rows], right[rows] = slopes, np.array(rest)[:, None], bound
        start = rows.stop
    return matrix.T, right
