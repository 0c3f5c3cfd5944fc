"""The search for placements: a front of mean, range and weakest place, and one recommendation that is never worse.

Mean up, range down and weakest up are in conflict, so there is a front. Many placements at random and a small
evolution on a hundred-odd samples that stand for the path find where it lies; climbs (`ascents`) then finish its ends
and the recommendation on the whole path. Every figure that is returned was computed on the whole path.
"""

from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.placement.ascents import climbed
from toolpath_stiff.placement.evaluator import PlacementFigures
from toolpath_stiff.placement.goals import Goal, PlacementRules
from toolpath_stiff.placement.unreachable import infeasible, let_go
from toolpath_stiff.placement.working import ENDS, NO_FLOORS, Search

SCOUTS = 250  # placements tried at random before the evolution, for each that is free of x, y, z, A, B, C
LEGS, GENERATIONS, CHILDREN, ARCHIVE = 3, 12, 60, 120  # after each leg the few samples hear of what they missed
WIDE, NARROW = 0.2, 0.003  # of each range: steps of the first and of the last generation
SEARCHES = 3  # with other seeds, while nothing but the present placement is found
WHOLE_POSES = 2_000_000  # about, of the whole path to which the front's candidates are thinned
NO_WORSE = 1e-9  # of the mean: what rounding does to a figure that stays as it was
SAME = 1e-7  # of the mean: figures that differ by less count as equal; the order of the coordinates decides


@dataclass(frozen=True)
class PlacementResult:
    """A front of placements and the recommended one. SI.

    Attributes
    ----------
    front
        (n, 6) placements, none dominated by another, by rising mean; the recommended one among them.
    figures
        Their figures on the whole path.
    best
        Row of the recommended placement.
    present
        Figures of the present placement (one row); None if none was given.
    rules
        What every placement of the front keeps.
    searches
        Searches from the beginning, each with a seed of its own.
    alone
        Whether the front is the present placement alone, in spite of all of them.
    """

    front: FloatArray
    figures: PlacementFigures
    best: int
    present: PlacementFigures | None
    rules: PlacementRules
    searches: int = 1
    alone: bool = False

    @property
    def best_figures(self) -> PlacementFigures:
        """Figures of the recommended placement (one row)."""
        return self.figures.take(slice(self.best, self.best + 1))


def search_placements(search: Search) -> PlacementResult:
    """Search for placements of a path.

    Raises
    ------
    UnreachableError
        No placement keeps the rules; says which one binds at the least bad placement, at which line, by how much.
    """
    now, start = search.now, search.start
    for searches in range(1, SEARCHES + 1):
        result = _result(search, _candidates(search, np.random.default_rng(search.wanted.seed + searches - 1)))
        gain = result.figures.objectives - (now.objectives if now is not None and len(start) else NO_FLOORS)
        same = len(gain) == 1 and (np.abs(gain) <= SAME * result.figures.mean[0]).all()
        alone = bool(len(search.bounds.free) and same)
        if not alone or searches == SEARCHES:
            break
    search.report(4, 4)
    return replace(result, searches=searches, alone=alone)


def _candidates(search: Search, rng: np.random.Generator) -> FloatArray:
    """Candidates for the front (k, 6), the present placement first where it may be one."""
    bounds = search.bounds
    unit = rng.uniform(size=(max(SCOUTS * len(bounds.free), 1), len(bounds.free)))
    scouts = np.vstack([search.start, bounds.placements(unit)])
    known = let_go(search, scouts)
    search.rules = replace(search.rules, extrapolated=_extrapolation_allowed(search, scouts, known))
    search.report(1, 4)
    archive, figures = _evolved(search, scouts, known, rng)
    search.report(2, 4)
    ends = climbed(search, np.vstack([archive, scouts]), PlacementFigures.joined([figures, known]))
    search.report(3, 4)
    most = max(search.wanted.points, WHOLE_POSES // max(len(search.path), 1))
    if len(archive) > most:  # of a long path no more than the front needs
        figures = search.evaluators["middle"].figures(archive)
        rows = front_rows(figures, search.rules_for("middle").violation(figures) == 0.0)
        archive = archive[thin(figures.take(rows).objectives, rows, most) if len(rows) else slice(0, most)]
    return np.vstack([search.start, archive, ends])


def _result(search: Search, candidates: FloatArray) -> PlacementResult:
    """The front of the candidates on the whole path, and the recommendation. Raises `UnreachableError`."""
    candidates = candidates[np.lexsort(np.round(candidates.T[::-1], 9))]  # of equals the first stands
    figures = search.whole.figures(candidates)
    if not search.kept(figures).any():
        raise infeasible(search, candidates[int(np.argmin(search.rules.violation(figures)))])
    best = _recommended(search, figures)
    rows = front_rows(_rounded(figures), search.kept(figures))
    if best not in rows:  # equal to another in all three
        rows = np.append(rows, best)
    rows = rows[np.argsort(figures.mean[rows], kind="stable")]
    rows = thin(figures.take(rows).objectives, rows, search.wanted.points, best)
    return PlacementResult(
        front=candidates[rows],
        figures=figures.take(rows),
        best=int(np.flatnonzero(rows == best)[0]),
        present=search.now,
        rules=search.rules,
    )


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


def _extrapolation_allowed(search: Search, scouts: FloatArray, few: PlacementFigures) -> float:
    """Largest share of samples outside the strut law: as now; where that is out of reach, the least that was found.

    `few` are the figures of the scouts on few samples.
    """
    now = search.now
    if search.wanted.allow_extrapolation or now is None:
        return np.inf
    if now.margin[0] >= 0.0:
        return float(now.extrapolated[0])
    possible = np.flatnonzero(search.kept(few))
    if not len(possible):
        return np.inf
    least = possible[np.argsort(few.extrapolated[possible], kind="stable")[:5]]
    return float(search.whole.figures(scouts[least]).extrapolated.min())


def _evolved(
    search: Search, scouts: FloatArray, known: PlacementFigures, rng: np.random.Generator
) -> tuple[FloatArray, PlacementFigures]:
    """An archive of placements that nothing dominates, from the scouts on, with their figures on few samples.

    `known` are the figures of the scouts. Each generation moves members of the archive at random, by steps that shrink,
    and along the difference of two others, as differential evolution does; what is dominated goes, and so does what is
    crowded.
    """
    bounds = search.bounds
    archive, figures = _survivors(search, scouts, known)
    spreads = np.geomspace(WIDE, NARROW, LEGS * GENERATIONS) if len(bounds.free) else np.zeros(0)
    for generation, spread in enumerate(spreads):
        if generation % GENERATIONS == 0:
            search.heed(np.vstack([archive[search.ranked(goal, figures)[:1]] for goal in ENDS]))
            archive, figures = _survivors(search, archive, search.few.figures(archive))
        parents, first, second = (bounds.unit(archive[rng.integers(len(archive), size=CHILDREN)]) for _ in range(3))
        step = spread * rng.normal(size=parents.shape) * (rng.uniform(size=parents.shape) < 0.7)
        along = np.where(rng.uniform(size=(CHILDREN, 1)) < 0.5, 0.5, 0.0)
        children = bounds.placements(parents + step + along * (first - second))
        met = PlacementFigures.joined([figures, search.few.figures(children)])
        archive, figures = _survivors(search, np.vstack([archive, children]), met)
    return archive, figures


def _survivors(
    search: Search, placements: FloatArray, figures: PlacementFigures
) -> tuple[FloatArray, PlacementFigures]:
    """Placements that none dominates, thinned; where too few keep the rules, the nearest to keeping them as well."""
    violation = search.rules_for("few").violation(figures)
    rows = front_rows(figures, violation == 0.0)
    rows = thin(figures.take(rows).objectives, rows, ARCHIVE) if len(rows) else rows
    if len(rows) < CHILDREN // 3:
        order = np.argsort(violation, kind="stable")
        rows = np.unique(np.append(rows, order[: CHILDREN // 3]))
    return placements[rows], figures.take(rows)


def _recommended(search: Search, figures: PlacementFigures) -> int:
    """Row of the recommendation: the best of those that are no worse in anything, else the least worse."""
    goal, now = Goal(defaults.OBJECTIVES[search.wanted.objective], NO_FLOORS), search.now
    possible = np.flatnonzero(search.kept(figures))
    if now is not None and search.present is not None:
        fall = (now.objectives[0] - figures.objectives[possible]).max(axis=1)
        slack = NO_WORSE * float(now.mean[0])
        possible = possible[fall <= slack if (fall <= slack).any() else fall <= fall.min() + slack]
    equal = _rounded(figures.take(possible))
    return int(possible[np.lexsort((*(-equal.objectives.T), -goal.value(equal)))[0]])


def _rounded(figures: PlacementFigures) -> PlacementFigures:
    """Figures of which equal ones compare as equal: symmetric machines have placements that rounding alone parts."""
    unit = SAME * float(np.nanmax(figures.mean))
    mean, spread, lowest = (np.round(v / unit) * unit for v in (figures.mean, figures.spread, figures.lowest))
    return replace(figures, mean=mean, spread=spread, lowest=lowest)
