"""The search for placements: a front of mean, range and weakest place, and a recommendation that is never worse.

Mean up, range down and weakest up are in conflict, so there is a front. Many placements at random and a small
evolution on a hundred-odd samples that stand for the path find where it lies; climbs then finish its ends
and the recommendation on the whole path. Every figure that is returned was computed on the whole path.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.errors import UnreachableError
from toolpath_stiff.machine.limits import reach, solved
from toolpath_stiff.placement.climb import Climber
from toolpath_stiff.placement.evaluator import PlacementFigures
from toolpath_stiff.placement.goals import Goal
from toolpath_stiff.placement.paths import placed_path, with_rows
from toolpath_stiff.placement.surface_error import Errors
from toolpath_stiff.placement.working import ENDS, NO_FLOORS, Search
from toolpath_stiff.poses import pose_in_mm
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import mm_from_m

SCOUTS = 250  # placements tried at random before the evolution, for each that is free of x, y, z, A, B, C
LEGS, GENERATIONS, CHILDREN, ARCHIVE = 3, 12, 60, 120  # after each leg, samples that the few had missed are added
WIDE, NARROW = 0.2, 0.003  # share of each range: steps of the first and the last generation
SEARCHES = 3  # most searches, with other seeds, while only the present placement is found
WHOLE_POSES = 2_000_000  # approximate number of poses of the whole path, to which the front's candidates are thinned
NO_WORSE = 1e-9  # of the mean: rounding of an unchanged figure
SAME = 1e-7  # of the mean: figures that differ by less count as equal; the order of the coordinates decides
# Climbs to one goal, for each free column: on few samples, from the best of these on more, from the best on all.
STARTS, FLOORED_STARTS, FINALISTS = (4, 3, 12, 3), 2, 3  # for each objective; the range has the most hills
HEATS, CLIMB_STEPS, POLISH_STEPS, FINAL_STEPS = 3, 4, 6, 6
APART = 0.1  # share of each range between starting points
BASIN = 0.02  # of each range: climbs that end nearer to each other than this went up the same hill
FINAL_REGION = 0.01  # of each range, about where the climb on fewer samples ended
SHORT = 3000  # samples of a path that is climbed on as a whole; of a longer one, on what stands for it
ROUNDS, STRETCHES = 2, 120  # rounds in which such samples are renewed; stretches whose extremes are added
EXCHANGES = 4  # most exchanges until the representative samples miss nothing at the finalists
PARENTS = 6  # placements of least surface error, around which the next are tried
MISSED = 1e-3  # of the mean: overestimate of a figure from which samples have missed something


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
    searches
        Searches from the beginning, each with a seed of its own.
    alone
        Whether the front is the present placement alone, in spite of all of them.
    """

    front: FloatArray
    figures: PlacementFigures
    best: int
    present: PlacementFigures | None
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
        result = _result(search, _candidates(search, np.random.default_rng(search.rules.seed + searches - 1)))
        gain = result.figures.objectives - (now.objectives if now is not None and len(start) else NO_FLOORS)
        same = len(gain) == 1 and (np.abs(gain) <= SAME * result.figures.mean[0]).all()
        alone = bool(len(search.bounds.free) and same)
        if not alone or searches == SEARCHES:
            break
    search.report(4, 4)
    return replace(result, searches=searches, alone=alone)


def _candidates(search: Search, rng: np.random.Generator) -> FloatArray:
    """Candidates for the front (k, 6), the present placement first if it is eligible."""
    bounds = search.bounds
    unit = rng.uniform(size=(max(SCOUTS * len(bounds.free), 1), len(bounds.free)))
    scouts = np.vstack([search.start, bounds.placements(unit)])
    known = search.few.figures(scouts)
    search.rules = replace(search.rules, extrapolated=_extrapolation_allowed(search, scouts, known))
    search.report(1, 4)
    archive, figures = _evolved(search, scouts, known, rng)
    search.report(2, 4)
    ends = climbed(search, np.vstack([archive, scouts]), PlacementFigures.joined([figures, known]))
    search.report(3, 4)
    most = max(search.rules.points, WHOLE_POSES // max(len(search.path), 1))
    if len(archive) > most:  # on a long path, no more than the front needs
        figures = search.evaluators["middle"].figures(archive)
        rows = front_rows(figures, search.rules_for("middle").violation(figures) == 0.0)
        archive = archive[thin(figures.take(rows).objectives, rows, most) if len(rows) else slice(0, most)]
    return np.vstack([search.start, archive, ends])


def _result(search: Search, candidates: FloatArray) -> PlacementResult:
    """Front of the candidates on the whole path, and the recommendation. Raises `UnreachableError`."""
    candidates = candidates[np.lexsort(np.round(candidates.T[::-1], 9))]  # of equals the first is kept
    figures = search.whole.figures(candidates)
    if not search.kept(figures).any():
        raise _infeasible(search, candidates[int(np.argmin(search.rules.violation(figures)))])
    if search.errors is not None:
        candidates, figures = _with_least_errors(search, candidates, figures, search.errors)
    best = _recommended(search, figures, candidates)
    rows = front_rows(_rounded(figures), search.kept(figures))
    if best not in rows:  # it equals another in all three
        rows = np.append(rows, best)
    rows = rows[np.argsort(figures.mean[rows], kind="stable")]
    rows = thin(figures.take(rows).objectives, rows, search.rules.points, best)
    return PlacementResult(
        front=candidates[rows],
        figures=figures.take(rows),
        best=int(np.flatnonzero(rows == best)[0]),
        present=search.now,
    )


def front_rows(figures: PlacementFigures, kept: BoolArray) -> IntArray:
    """Kept rows that no other beats in all of mean, range and weakest, by rising mean; equal ones appear once."""
    rows = np.flatnonzero(kept & np.isfinite(figures.mean))
    values, first = np.unique(figures.objectives[rows], axis=0, return_index=True)
    rows = rows[first]
    no_worse = np.asarray((values[:, None] >= values[None]).all(axis=2))  # [i, j]: i is at least as good as j in all
    no_worse[np.diag_indices(len(rows))] = False
    return np.asarray(rows[~no_worse.any(axis=0)], dtype=np.int64)


def thin(objectives: FloatArray, rows: IntArray, points: int, best: int = -1) -> IntArray:
    """At most `points` of rows (n,) with objectives (n, 3), spread over the front by farthest-point selection.

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
    """Largest share of samples outside the strut law: the present one; if that is out of reach, the least found.

    `few` are the figures of the scouts on few samples.
    """
    now = search.now
    if search.rules.allow_extrapolation or now is None:
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
    """Archive of non-dominated placements evolved from the scouts, with their figures on few samples.

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
    """Non-dominated placements, thinned; if too few keep the rules, also those closest to keeping them."""
    violation = search.rules_for("few").violation(figures)
    rows = front_rows(figures, violation == 0.0)
    rows = thin(figures.take(rows).objectives, rows, ARCHIVE) if len(rows) else rows
    if len(rows) < CHILDREN // 3:
        order = np.argsort(violation, kind="stable")
        rows = np.unique(np.append(rows, order[: CHILDREN // 3]))
    return placements[rows], figures.take(rows)


def _with_least_errors(
    search: Search, candidates: FloatArray, figures: PlacementFigures, errors: Errors
) -> tuple[FloatArray, PlacementFigures]:
    """The candidates and further ones, ever closer to the least surface error within rules and present figures."""
    rng, bounds = np.random.default_rng(search.rules.seed), search.bounds
    pool, known = candidates, figures
    for spread in np.geomspace(WIDE, NARROW, GENERATIONS) if len(bounds.free) else ():
        rows = _allowed(search, known)
        rows = rows[np.argsort(errors(pool[rows]), kind="stable")[:PARENTS]]
        unit = np.repeat(bounds.unit(pool[rows]), CHILDREN // len(rows), axis=0)
        children = bounds.placements(unit + spread * rng.normal(size=unit.shape))
        pool = np.vstack([pool[rows], children[search.kept(search.few.figures(children))]])
        known = search.whole.figures(pool)
    return np.vstack([candidates, pool]), PlacementFigures.joined([figures, known])


def _allowed(search: Search, figures: PlacementFigures) -> IntArray:
    """Rows that keep the rules and are no worse than present in any figure; if there are none, the least worse."""
    now, possible = search.now, np.flatnonzero(search.kept(figures))
    if now is not None and search.present is not None and len(possible):
        fall = (now.objectives[0] - figures.objectives[possible]).max(axis=1)
        slack = NO_WORSE * float(now.mean[0])
        possible = possible[fall <= slack if (fall <= slack).any() else fall <= fall.min() + slack]
    return possible


def _recommended(search: Search, figures: PlacementFigures, candidates: FloatArray) -> int:
    """Row of the recommendation: the best of those that are no worse in any figure, otherwise the least worse."""
    possible = _allowed(search, figures)
    if search.errors is not None:
        return int(possible[np.argmin(search.errors(candidates[possible]))])
    goal = Goal(defaults.OBJECTIVES[search.rules.objective], NO_FLOORS)
    equal = _rounded(figures.take(possible))
    return int(possible[np.lexsort((*(-equal.objectives.T), -goal.value(equal)))[0]])


def _rounded(figures: PlacementFigures) -> PlacementFigures:
    """Figures rounded so that equal ones compare equal: a symmetric machine's placements differ by rounding alone."""
    unit = SAME * float(np.nanmax(figures.mean))
    mean, spread, lowest = (np.round(v / unit) * unit for v in (figures.mean, figures.spread, figures.lowest))
    return replace(figures, mean=mean, spread=spread, lowest=lowest)


def climbed(search: Search, candidates: FloatArray, figures: PlacementFigures) -> FloatArray:
    """Ends of the front and recommendations of each objective, climbed to from candidates with figures on few samples.

    Whichever objective is asked for, all are climbed to: no answer may be beaten by the end of another one's front.
    """
    ends = _climbed_to(search, candidates, figures, ENDS, STARTS)
    if search.now is not None and search.present is not None:
        floors = search.now.objectives[0]
        below = [goal for goal, tops in zip(ENDS, ends, strict=True) if _falls(search, tops, floors)]
        if below:
            goals = [Goal(goal.weights, floors) for goal in below]
            ends += _climbed_to(search, candidates, figures, goals, [FLOORED_STARTS] * len(goals))
            if _falls(search, np.vstack(ends), floors):
                ends += _climbed_to(search, candidates, figures, [Goal(None, floors)], STARTS[:1])
    return np.vstack(ends)


def _falls(search: Search, placements: FloatArray, floors: FloatArray) -> bool:
    """True if each of some placements is worse than the floors in some figure."""
    return bool((Goal(ENDS[0].weights, floors).worsening(search.whole.figures(placements)) > 0.0).all())


def _climbed_to(
    search: Search, candidates: FloatArray, figures: PlacementFigures, goals: Sequence[Goal], starts: Sequence[int]
) -> list[FloatArray]:
    """Ends of climbs from the best candidates to each goal: many on few samples, few on more, one on the whole path.

    `figures` are those of the candidates on few samples. There are several hills, and a slope that few samples show is
    not always the whole path's. All climb together, each to its own goal.
    """
    few, free = search.climber("few"), len(search.bounds.free)
    tops = [
        search.best_apart(candidates, figures, goal, count * free, APART)
        for goal, count in zip(goals, starts, strict=True)
    ]
    for _ in range(HEATS):  # the better half of the climbs continues, those up the same hill counted once
        ends = _together(few, tops, goals, CLIMB_STEPS)
        known = few.evaluator.figures(np.vstack(ends))
        last = np.cumsum([len(placements) for placements in ends]).tolist()
        tops = [
            search.best_apart(
                placements, known.take(slice(stop - len(placements), stop)), goal,
                max((len(placements) + 1) // 2, FINALISTS), BASIN,
            )
            for placements, stop, goal in zip(ends, last, goals, strict=True)
        ]  # fmt: skip
    tops = [placements[:FINALISTS] for placements in tops]
    if search.evaluators["middle"] is not search.whole:
        tops = _exchanged(search, tops, goals)
    best = [
        placements[search.ranked(goal, search.whole.figures(placements))[0]]
        for placements, goal in zip(tops, goals, strict=True)
    ]
    return [np.vstack(pair) for pair in zip(tops, _finished(search, best, goals), strict=True)]


def _exchanged(search: Search, tops: list[FloatArray], goals: Sequence[Goal]) -> list[FloatArray]:
    """Ends of climbs on more samples, to which the deciding ones at these ends are added until none is missing."""
    for _ in range(EXCHANGES):
        search.heed(np.vstack([placements[:1] for placements in tops]))
        climber = search.climber("middle")
        tops = _together(climber, tops, goals, POLISH_STEPS)
        best = np.vstack([placements[:1] for placements in tops])
        seen, true = climber.evaluator.figures(best), search.whole.figures(best)
        missed = (seen.objectives - true.objectives > MISSED * true.mean[:, None]).any(axis=1) | ~search.kept(true)
        if not missed.any():
            break
    return tops


def _together(climber: Climber, first: list[FloatArray], goals: Sequence[Goal], steps: int) -> list[FloatArray]:
    """Ends of climbs from placements (k, 6) to each goal."""
    each = [goal for goal, placements in zip(goals, first, strict=True) for _ in placements]
    ends = climber.climb(np.vstack(first), each, steps)
    return np.split(ends, np.cumsum([len(placements) for placements in first])[:-1])


def _finished(search: Search, best: list[FloatArray], goals: Sequence[Goal]) -> list[FloatArray]:
    """For each goal, ends (k, 6) of climbs on the whole path from a placement (6,) near its top.

    A long path is climbed on samples that stand for it, to which those are added that decide on it there: the extremes
    of each of its stretches (an exchange method of semi-infinite programming; Hettich and Kortanek, SIAM Review 35
    (1993) 380).
    """
    if len(search.path) <= SHORT:
        tops = search.climber("whole").climb(np.array(best), goals, FINAL_STEPS, FINAL_REGION)
        return [placement[None] for placement in tops]
    ends = []
    for first, goal in zip(best, goals, strict=True):
        tops = first[None]
        for _ in range(ROUNDS):
            deciding = search.whole.deciding_rows(tops[-1], STRETCHES)
            path = with_rows(search.evaluators["middle"].path, search.path, deciding)
            climber = Climber(search.evaluator(path), search.bounds, search.rules)
            tops = np.vstack([tops, climber.climb(tops[-1:], goal, FINAL_STEPS, FINAL_REGION)])
        ends.append(tops[1:])
    return ends


def _infeasible(search: Search, placement: FloatArray) -> UnreachableError:
    """Error naming the rule, the line and the amount by which it is broken at the least bad placement."""
    path, rules, machine = search.path, search.rules, search.model.machine
    position, _, abc = placed_path(path, placement)
    rotation = rotation_matrices(abc)
    limits = reach(machine, position, solved(machine, position, rotation, path.tool_length), rotation)
    rows, row = search.whole.rows(placement[None]), int(np.argmin(limits.margin))
    margin, clearance = float(limits.margin[row]), rows.clearance[0]
    hint = "widen the bounds, or cut the part in two set-ups"
    if margin < 0.0:
        fault = f"breaks a limit: {limits.describe(row)}"
    elif clearance.min() < 0.0:
        row = int(np.argmin(clearance))
        box = min(rules.keepouts, key=lambda box: float(box.clearances(position[row])))
        fault = f"runs {mm_from_m(-float(clearance[row])):.1f} mm deep into the keep-out {box.name}"
    elif margin < rules.margin:
        fault = f"has a margin of {100.0 * margin:.2f} % of the limit's span: {limits.describe(row)}"
        hint = f"widen the bounds, or ask for less than --margin {100.0 * rules.margin:g}"
    else:
        room = np.where(path.cutting, rows.law[0], np.inf)
        row, hint = int(np.argmin(room)), "widen the bounds, or allow it with --allow-extrapolation"
        fault = f"takes a strut {mm_from_m(-float(room[row])):.3g} mm out of the lengths of its law"
    x, y, z, _, _, turned = pose_in_mm(placement[:6].tolist())
    return UnreachableError(
        f"no placement is feasible: at the closest one (X{x:.1f} Y{y:.1f} Z{z:.1f}, turned by {turned:.1f} degrees) "
        f"{'' if path.cutting[row] else 'the rapid of '}line {int(path.line[row])} {fault}",
        hint=hint,
    )
