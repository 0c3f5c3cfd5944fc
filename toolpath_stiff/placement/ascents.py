"""Climbs from the best of many placements to the ends of the front and to what each objective recommends."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.placement.climb import Climber
from toolpath_stiff.placement.evaluator import PlacementFigures
from toolpath_stiff.placement.goals import Goal
from toolpath_stiff.placement.paths import with_rows
from toolpath_stiff.placement.working import ENDS, Search

# Climbs to one goal, for each that is free: on few samples, from the best of these on more, from the best on all.
STARTS, FLOORED_STARTS, FINALISTS = (4, 3, 12, 3), 2, 3  # of each objective; the range has most hills
HEATS, CLIMB_STEPS, POLISH_STEPS, FINAL_STEPS = 3, 4, 6, 6
APART = 0.1  # of each range, where they start
BASIN = 0.02  # of each range: climbs that end nearer to each other than this went up the same hill
FINAL_REGION = 0.01  # of each range, about where the climb on fewer samples ended
SHORT = 3000  # samples of a path that is climbed on as a whole; of a longer one, on what stands for it
ROUNDS, STRETCHES = 2, 120  # of that: how often it is told anew, and stretches whose extremes join it
EXCHANGES = 4  # at most, until the samples that stand for the path miss nothing at the finalists
MISSED = 1e-3  # of the mean: a figure that they put so much too high is missed


def climbed(search: Search, candidates: FloatArray, figures: PlacementFigures) -> FloatArray:
    """The ends of the front and what each objective recommends, climbed to from candidates with figures on few samples.

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
    """True where each of some placements is worse in something than the floors."""
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
    for _ in range(HEATS):  # the better half of the climbs, those up the same hill counted once, goes on
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
    """Ends of climbs on more samples, to which what decides at these ends is added until they miss nothing there."""
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
    """For each goal (k, 6) the end of a climb on the whole path, from a placement (6,) near its top.

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
