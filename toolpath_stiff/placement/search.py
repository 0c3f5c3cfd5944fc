"""The search for placements: a Pareto front of mean against range, and one recommendation.

Mean up and range down are in conflict, so there is a front. NSGA-II (pymoo: maintained, constraints and batches of
candidates built in) finds it on a few hundred samples that stand for the path; scipy's Nelder-Mead polishes points
along it, and the recommended one on the whole path. Every figure that is returned was computed on the whole path.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.evaluate import evaluate
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.errors import InputError, UnreachableError
from toolpath_stiff.placement import batch
from toolpath_stiff.placement.batch import Evaluator, Keepout, PlacementFigures, WorkPath, placed_path, telling_path
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import deg_from_rad, mm_from_m

FloatArray = NDArray[np.float64]

OBJECTIVES = ("balanced", "mean", "range", "min")
SCOUT_SAMPLES, POLISH_SAMPLES = 200, 1000
SCOUTS = 2000  # placements tried at random before the search proper
POPULATION, GENERATIONS = 100, 40
FRONT_STEPS = 60  # gaps of the front that are filled
POLISH_EVALUATIONS, FINAL_EVALUATIONS = 60, 300
FIRST_STEP = 0.05  # of each range


@dataclass(frozen=True)
class Bounds:
    """What the search may vary. SI.

    `low`, `high` (6,): x, y, z in m, A, B, C in rad; equal where fixed. `heights`: the only z allowed, or empty.
    """

    low: FloatArray
    high: FloatArray
    heights: tuple[float, ...] = ()

    @property
    def free(self) -> NDArray[np.int64]:
        """Columns of a placement that vary."""
        return np.flatnonzero(self.high > self.low)

    def placements(self, unit: FloatArray) -> FloatArray:
        """Placements (k, 6) of points (k, free) of the unit cube."""
        placements = np.repeat(self.low[None], len(unit), axis=0)
        free = self.free
        placements[:, free] = self.low[free] + np.clip(unit, 0.0, 1.0) * (self.high - self.low)[free]
        if self.heights:
            heights = np.array(self.heights)
            nearest = np.abs(placements[:, 2, None] - heights).argmin(axis=1)
            placements[:, 2] = heights[nearest]
        return placements


@dataclass(frozen=True)
class PlacementResult:
    """What a search found. SI.

    Attributes
    ----------
    front
        (n, 6) placements, none dominated by another, by rising mean.
    figures
        Their figures on the whole path.
    best, best_figures
        (6,) the recommended placement and its figures (one row).
    pose_evaluations
        Poses that the search evaluated.
    """

    front: FloatArray
    figures: PlacementFigures
    best: FloatArray
    best_figures: PlacementFigures
    pose_evaluations: int


def score(figures: PlacementFigures, objective: str) -> FloatArray:
    """(k,) N/m, to be maximised; -inf where infeasible."""
    value = {
        "balanced": figures.mean - figures.spread,
        "mean": figures.mean,
        "range": -figures.spread,
        "min": figures.lowest,
    }[objective]
    return np.asarray(np.where(np.isnan(value), -np.inf, value))


def search_placements(
    model: StiffnessModel,
    path: WorkPath,
    load: Load,
    bounds: Bounds,
    *,
    objective: str = "balanced",
    keepouts: tuple[Keepout, ...] = (),
    seed: int = 1,
    points: int = 60,
    force: float = 1000.0,
    start: FloatArray | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> PlacementResult:
    """Search for placements of a path.

    Parameters
    ----------
    model, path, load, force
        The machine, the path in the set-up frame, the load.
    bounds
        What may vary.
    objective
        One of `OBJECTIVES`, for the recommendation.
    keepouts
        Boxes that the path must stay out of.
    seed
        Of the search; the same seed gives the same placements.
    points
        Most points of the front.
    start
        (6,) a placement to try as well: the present one.
    progress
        Called with (stages done, stages in all).

    Raises
    ------
    UnreachableError
        No placement is feasible; says which limit binds at the least bad one, at which line, by how much.
    """
    if objective not in OBJECTIVES:
        raise InputError(f"objective {objective!r}", expected=f"one of {', '.join(OBJECTIVES)}")
    whole, scout, middle = (
        Evaluator(model, part, load, force, keepouts)
        for part in (path, telling_path(path, SCOUT_SAMPLES), telling_path(path, POLISH_SAMPLES))
    )
    report = progress or (lambda done, total: None)
    rng = np.random.default_rng(seed)
    candidates = _scout(scout, bounds, rng, start)
    report(1, 5)
    candidates = _evolve(scout, bounds, candidates, seed)
    report(2, 5)
    candidates = _polish_front(middle, bounds, candidates)
    report(3, 5)
    if start is not None:
        candidates = np.vstack([candidates, start])
    figures = whole.figures(candidates)
    if not (figures.margin >= 0.0).any():
        candidates, figures = _rescue(whole, bounds, candidates, figures)
    if not (figures.margin >= 0.0).any():
        raise _infeasible(model, path, load, keepouts, candidates[int(np.argmax(figures.margin))])
    report(4, 5)
    candidates, figures = _finish(whole, bounds, candidates, figures, objective)
    best = int(np.argmax(score(figures, objective)))
    rows = _front_rows(figures)
    rows = _thin(figures, rows, points, best)
    report(5, 5)
    return PlacementResult(
        front=candidates[rows],
        figures=_pick(figures, rows),
        best=candidates[best],
        best_figures=_pick(figures, np.array([best])),
        pose_evaluations=whole.poses + scout.poses + middle.poses,
    )


def _pick(figures: PlacementFigures, rows: NDArray[np.int64]) -> PlacementFigures:
    return PlacementFigures(*(getattr(figures, column.name)[rows] for column in fields(figures)))


def _unit(bounds: Bounds, placements: FloatArray) -> FloatArray:
    free = bounds.free
    return np.asarray((placements[:, free] - bounds.low[free]) / (bounds.high - bounds.low)[free])


def _scout(scout: Evaluator, bounds: Bounds, rng: np.random.Generator, start: FloatArray | None) -> FloatArray:
    """The best of many placements at random: feasible and spread over the trade-off, or nearest to feasible."""
    unit = rng.uniform(size=(SCOUTS if len(bounds.free) else 1, len(bounds.free)))
    placements = bounds.placements(unit)
    if start is not None:
        placements = np.vstack([placements, start])
    figures = scout.figures(placements)
    feasible = np.flatnonzero(figures.margin >= 0.0)
    if len(feasible) < POPULATION:
        return np.asarray(placements[np.argsort(-figures.margin, kind="stable")[:POPULATION]])
    weights = np.linspace(0.0, 1.0, POPULATION)
    mean, spread = _scaled(figures.mean[feasible]), _scaled(figures.spread[feasible])
    picks = [int(feasible[np.argmax((1 - w) * mean - w * spread)]) for w in weights]
    others = rng.permutation(feasible)[: POPULATION // 2]
    return np.asarray(placements[np.unique([*picks, *others])])


def _scaled(values: FloatArray) -> FloatArray:
    return np.asarray((values - values.min()) / max(float(np.ptp(values)), 1e-12))


def _evolve(scout: Evaluator, bounds: Bounds, candidates: FloatArray, seed: int) -> FloatArray:
    """NSGA-II on mean and range with the smallest margin as a constraint."""
    if not len(bounds.free):
        return candidates
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    class Trade(Problem):
        """Minus mean, and range, in N/um; infeasible where the margin is negative."""

        def __init__(self) -> None:
            super().__init__(n_var=len(bounds.free), n_obj=2, n_ieq_constr=1, xl=0.0, xu=1.0)

        def _evaluate(self, x: FloatArray, out: dict[str, Any], *_: Any, **__: Any) -> None:
            figures = scout.figures(bounds.placements(x))
            out["F"] = 1e-6 * np.nan_to_num(np.column_stack([-figures.mean, figures.spread]), nan=0.0)
            out["G"] = -figures.margin

    unit = _unit(bounds, candidates)
    fill = np.random.default_rng(seed + 1).uniform(size=(max(0, POPULATION - len(unit)), len(bounds.free)))
    found = minimize(
        Trade(), NSGA2(pop_size=POPULATION, sampling=np.vstack([unit, fill])), ("n_gen", GENERATIONS), seed=seed
    )
    last = bounds.placements(np.array([individual.X for individual in found.pop]))
    return np.vstack([last, candidates])


def _polish_front(middle: Evaluator, bounds: Bounds, candidates: FloatArray) -> FloatArray:
    """Fill the front: again and again the narrowest range whose mean lies in the middle of the widest gap."""
    figures = middle.figures(candidates)
    if not (figures.margin >= 0.0).any() or not len(bounds.free):
        return candidates
    for goal in ("mean", "range"):
        first = candidates[int(np.argmax(score(figures, goal)))]
        candidates, figures = _add(middle, candidates, figures, bounds, first, partial(score, objective=goal))
    tried: set[tuple[float, float]] = set()
    for _ in range(FRONT_STEPS):
        rows = _front_rows(figures)
        mean, spread = figures.mean[rows], figures.spread[rows]
        if len(rows) < 2 or np.ptp(mean) < 1e-9 * mean[-1]:
            break
        wide = np.diff(_scaled(mean)) + np.diff(_scaled(spread))
        gaps = [g for g in np.argsort(-wide, kind="stable") if (float(mean[g]), float(mean[g + 1])) not in tried]
        if not gaps:
            break
        gap = int(gaps[0])
        tried.add((float(mean[gap]), float(mean[gap + 1])))
        level = 0.5 * float(mean[gap] + mean[gap + 1])

        def gain(found: PlacementFigures, level: float = level) -> FloatArray:
            """Narrow range; a mean below the level costs more than any range could win."""
            value = -found.spread - 100.0 * np.maximum(level - found.mean, 0.0)
            return np.asarray(np.where(np.isnan(value), -np.inf, value))

        # Where the front is smooth, half-way between two of its points lies all but on it.
        ends = candidates[rows[[gap, gap + 1]]]
        apart = float(np.abs(np.diff(_unit(bounds, ends), axis=0)).max())
        reach = float(np.clip(0.25 * apart, 1e-3, 0.05))
        candidates, figures = _add(middle, candidates, figures, bounds, ends.mean(axis=0), gain, reach)
    return candidates[figures.margin >= 0.0]


def _add(
    middle: Evaluator,
    candidates: FloatArray,
    figures: PlacementFigures,
    bounds: Bounds,
    first: FloatArray,
    gain: Callable[[PlacementFigures], FloatArray],
    reach: float = FIRST_STEP,
) -> tuple[FloatArray, PlacementFigures]:
    """Climb from one placement and add where it ends."""
    found = _climb(middle, bounds, first, gain, POLISH_EVALUATIONS, reach)
    return np.vstack([candidates, found]), _joined(figures, middle.figures(found))


def _joined(one: PlacementFigures, two: PlacementFigures) -> PlacementFigures:
    return PlacementFigures(*(np.concatenate([getattr(one, c.name), getattr(two, c.name)]) for c in fields(one)))


def _climb(
    evaluator: Evaluator,
    bounds: Bounds,
    first: FloatArray,
    gain: Callable[[PlacementFigures], FloatArray],
    evaluations: int,
    reach: float = FIRST_STEP,
) -> FloatArray:
    """Nelder-Mead from one placement; an infeasible one counts by how far it is from being feasible."""
    from scipy.optimize import minimize

    free = bounds.free
    best = float(gain(evaluator.figures(first[None]))[0])

    def loss(unit: FloatArray) -> float:
        figures = evaluator.figures(bounds.placements(unit[None]))
        value = float(gain(figures)[0])
        return -value if np.isfinite(value) else 10.0 * abs(best) + 1.0 - float(figures.margin[0])

    unit = _unit(bounds, first[None])[0]
    # The first simplex points away from the nearer bound.
    simplex = np.vstack([unit, unit + reach * np.diag(np.where(unit < 0.5, 1.0, -1.0))])
    found = minimize(
        loss,
        unit,
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * len(free),
        options={"maxfev": evaluations, "initial_simplex": simplex, "xatol": 1e-5, "fatol": 1e-9},
    )
    return bounds.placements(np.array([found.x]))


def _rescue(
    whole: Evaluator, bounds: Bounds, candidates: FloatArray, figures: PlacementFigures
) -> tuple[FloatArray, PlacementFigures]:
    """Nothing is feasible so far: climb the margin itself."""
    if not len(bounds.free):
        return candidates, figures
    order = np.argsort(-figures.margin, kind="stable")[:3]
    climbed = [_climb(whole, bounds, candidates[i], lambda f: f.margin, FINAL_EVALUATIONS) for i in order]
    candidates = np.vstack([candidates, *climbed])
    return candidates, whole.figures(candidates)


def _finish(
    whole: Evaluator, bounds: Bounds, candidates: FloatArray, figures: PlacementFigures, objective: str
) -> tuple[FloatArray, PlacementFigures]:
    """Polish the ends of the front and the recommended placement on the whole path."""
    if not len(bounds.free):
        return candidates, figures
    added = []
    for goal, evaluations in (
        (objective, FINAL_EVALUATIONS),
        ("mean", POLISH_EVALUATIONS),
        ("range", POLISH_EVALUATIONS),
    ):
        ranked = np.argsort(-score(figures, goal), kind="stable")[: 2 if goal == objective else 1]
        gain = partial(score, objective=goal)
        added += [_climb(whole, bounds, candidates[i], gain, evaluations) for i in ranked]
    more = np.vstack(added)
    extra = whole.figures(more)
    return np.vstack([candidates, more]), _joined(figures, extra)


def _front_rows(figures: PlacementFigures) -> NDArray[np.int64]:
    """Feasible rows that no other beats in both mean and range, by rising mean."""
    rows = np.flatnonzero(figures.margin >= 0.0)
    order = rows[np.lexsort((figures.spread[rows], -figures.mean[rows]))]
    kept, narrowest = [], np.inf
    for i in order:
        if figures.spread[i] < narrowest:
            kept.append(int(i))
            narrowest = float(figures.spread[i])
    return np.array(kept[::-1], dtype=np.int64)


def _thin(figures: PlacementFigures, rows: NDArray[np.int64], points: int, best: int) -> NDArray[np.int64]:
    """At most `points` rows, evenly spread along the front; the ends and the recommended one stay."""
    kept = list(rows)
    mean, spread = _scaled(figures.mean[rows]), _scaled(figures.spread[rows])
    along = list(np.cumsum(np.abs(np.diff(mean, prepend=mean[0])) + np.abs(np.diff(spread, prepend=spread[0]))))
    while len(kept) > max(points, 2):
        # The point whose neighbours lie closest together is missed least.
        room = [along[i + 1] - along[i - 1] if kept[i] != best else np.inf for i in range(1, len(kept) - 1)]
        gone = 1 + int(np.argmin(room))
        del kept[gone], along[gone]
    return np.array(kept, dtype=np.int64)


def _infeasible(
    model: StiffnessModel, path: WorkPath, load: Load, keepouts: tuple[Keepout, ...], placement: FloatArray
) -> UnreachableError:
    """The error that names the limit, the line and by how much, at the least bad placement."""
    position, tangent, abc = placed_path(path, placement)
    found = evaluate(model, position, abc, tangent, path.tool_length, load)
    worst = int(np.argmin(found.margin))
    x, y, z = (mm_from_m(float(v)) for v in placement[:3])
    where = f"X{x:.1f} Y{y:.1f} Z{z:.1f}, turned by {deg_from_rad(float(placement[5])):.1f} degrees"
    if found.margin[worst] >= 0.0:
        depths = [batch.clearances(box, position) for box in keepouts]
        deepest = int(np.argmin([depth.min() for depth in depths]))
        row = int(np.argmin(depths[deepest]))
        return UnreachableError(
            f"no placement is feasible: at the least bad one ({where}) line {int(path.line[row])} runs "
            f"{mm_from_m(-float(depths[deepest][row])):.1f} mm deep into the keep-out {keepouts[deepest].name}",
            hint="make the keep-out smaller or the bounds wider",
        )
    return UnreachableError(
        f"no placement is feasible: at the least bad one ({where}) line {int(path.line[worst])} breaks a limit: "
        f"{found.reach.describe(worst)}",
        hint="widen the bounds, or cut the part in two set-ups",
    )
