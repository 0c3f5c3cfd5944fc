"""The search for placements: a front of mean, range and weakest place, and one recommendation that is never worse.

Mean up, range down and weakest up are in conflict, so there is a front. Many placements at random and a small
evolution on a hundred-odd samples that stand for the path find where it lies; climbs (`climb`) then finish its ends
and the recommendation on the whole path. Every figure that is returned was computed on the whole path.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.errors import InputError, UnreachableError
from toolpath_stiff.hints import both_names
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import Reach, reach
from toolpath_stiff.path import place_orientations
from toolpath_stiff.placement.climb import Bounds, Climber, Goal, Rules, apart, front_rows, thin
from toolpath_stiff.placement.evaluator import Evaluator, Keepout, PlacementFigures, clearances
from toolpath_stiff.placement.paths import WorkPath, placed_path, representative_path, with_rows
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import deg_from_rad, mm_from_m

SCOUT_SAMPLES, POLISH_SAMPLES = 120, 400
SCOUTS = 250  # placements tried at random before the evolution, for each that is free of x, y, z, A, B, C
LEGS, GENERATIONS, CHILDREN, ARCHIVE = 3, 12, 60, 120  # after each leg the few samples hear of what they missed
WIDE, NARROW = 0.2, 0.003  # of each range: steps of the first and of the last generation
# Climbs to one goal, for each that is free: on few samples, from the best of these on more, from the best on all.
STARTS, FLOORED_STARTS, FINALISTS = (4, 3, 12, 3), 2, 3  # of each objective; the range has most hills
HEATS, CLIMB_STEPS, POLISH_STEPS, FINAL_STEPS = 3, 4, 6, 6
APART = 0.1  # of each range, where they start
BASIN = 0.02  # of each range: climbs that end nearer to each other than this went up the same hill
FINAL_REGION = 0.01  # of each range, about where the climb on fewer samples ended
SCOUTS_AT_A_TIME = 50  # until one keeps an anchored rapid within reach
SHORT = 3000  # samples of a path that is climbed on as a whole; of a longer one, on what stands for it
ROUNDS, STRETCHES = 2, 120  # of that: how often it is told anew, and stretches whose extremes join it
HEEDED = 4  # stretches whose extremes join the few samples, for each placement that these are held against
EXCHANGES = 4  # at most, until the samples that stand for the path miss nothing at the finalists
MISSED = 1e-3  # of the mean: a figure that they put so much too high is missed
SEARCHES = 3  # with other seeds, while nothing but the present placement is found
WHOLE_POSES = 2_000_000  # about, of the whole path to which the front's candidates are thinned
NO_WORSE = 1e-9  # of the mean: what rounding does to a figure that stays as it was
SAME = 1e-7  # of the mean: figures that differ by less count as equal; the order of the coordinates decides
NO_FLOORS = np.full(3, -np.inf)
ENDS = [Goal(weights, NO_FLOORS) for weights in defaults.OBJECTIVES.values()]


@dataclass(frozen=True)
class SearchRules:
    """What the user asks of a placement.

    Attributes
    ----------
    objective
        One of `defaults.OBJECTIVES`, for the recommendation.
    margin
        Smallest margin to any limit, as a share of its span.
    allow_extrapolation
        Whether struts may leave the lengths of their law at more samples than now.
    keepouts
        Boxes that the path must stay out of.
    seed
        Of the search; the same seed gives the same placements.
    points
        Most points of the front.
    """

    objective: str = defaults.OBJECTIVE
    margin: float = defaults.MARGIN
    allow_extrapolation: bool = False
    keepouts: tuple[Keepout, ...] = ()
    seed: int = defaults.PLACEMENT_SEED
    points: int = defaults.FRONT_POINTS


@dataclass(frozen=True)
class PlacementResult:
    """What a search found. SI.

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
    rapids_left_out
        (line, what it breaks) of rapids that no placement within the bounds keeps within reach.
    pose_evaluations
        Poses that the search evaluated.
    searches
        Searches from the beginning, each with a seed of its own.
    alone
        Whether the front is the present placement alone, in spite of all of them.
    """

    front: FloatArray
    figures: PlacementFigures
    best: int
    present: PlacementFigures | None
    rules: Rules
    rapids_left_out: tuple[tuple[int, str], ...] = ()
    pose_evaluations: int = 0
    searches: int = 1
    alone: bool = False

    @property
    def best_figures(self) -> PlacementFigures:
        """Figures of the recommended placement (one row)."""
        return self.figures.take(slice(self.best, self.best + 1))


@dataclass
class _Search:
    """The evaluators of one search: of a few samples, of more, of the whole path."""

    model: StiffnessModel
    path: WorkPath
    load: Load
    force: float
    bounds: Bounds
    asked: SearchRules
    present: FloatArray | None = None  # where it is within reach
    evaluators: dict[str, Evaluator] = field(default_factory=dict)
    rules: Rules = field(default_factory=Rules)
    heeded: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def sampled(self, path: WorkPath) -> None:
        """Evaluators of a path."""
        self.path = path
        before = self.poses
        whole = self.evaluator(path)
        whole.poses = before
        middle, few = (
            self.evaluator(representative_path(path, count)) if len(path) > count else whole
            for count in (POLISH_SAMPLES, SCOUT_SAMPLES)
        )
        self.evaluators = {"whole": whole, "middle": middle, "few": few}
        self.heeded = np.zeros(0, dtype=np.int64)

    def heed(self, placements: FloatArray) -> None:
        """Add to the samples that stand for the path those that decide on the whole of it at some placements."""
        whole = self.evaluators["whole"]
        deciding = [whole.deciding_rows(placement, HEEDED) for placement in placements]
        rows = np.setdiff1d(np.concatenate([self.heeded[:0], *deciding]), self.heeded)
        self.heeded = np.concatenate([self.heeded, rows])
        for name in ("middle", "few"):
            before = self.evaluators[name]
            if before is not whole:
                self.evaluators[name] = self.evaluator(with_rows(before.path, self.path, rows))
                self.evaluators[name].poses = before.poses

    def evaluator(self, path: WorkPath) -> Evaluator:
        """An evaluator of a part of the path."""
        return Evaluator(self.model, path, self.load, self.force, self.asked.keepouts)

    @property
    def poses(self) -> int:
        return sum(evaluator.poses for evaluator in set(self.evaluators.values()))

    def climber(self, name: str) -> Climber:
        return Climber(self.evaluators[name], self.bounds, self.rules_for(name))

    def rules_for(self, name: str) -> Rules:
        """The rules as some samples see them: of those that stand for the path another share is outside the law."""
        if name == "whole" or self.present is None or not 0.0 < self.rules.extrapolated < np.inf:
            return self.rules
        now = self.evaluators[name].figures(self.present[None])
        return replace(self.rules, extrapolated=float(now.extrapolated[0]))

    def kept(self, figures: PlacementFigures) -> BoolArray:
        return np.asarray(self.rules.violation(figures) == 0.0)


def search_placements(
    model: StiffnessModel,
    path: WorkPath,
    load: Load,
    bounds: Bounds,
    asked: SearchRules | None = None,
    *,
    force: float = defaults.FORCE,
    present: FloatArray | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> PlacementResult:
    """Search for placements of a path.

    Parameters
    ----------
    model, path, load, force
        The machine, the path in the set-up frame, the load.
    bounds
        What may vary.
    asked
        What a placement must keep and is to be good at.
    present
        (6,) where program zero sits now: what the recommendation must not be worse than.
    progress
        Called with (stages done, stages in all).

    Raises
    ------
    UnreachableError
        No placement keeps the rules; says which one binds at the least bad placement, at which line, by how much.
    """
    asked = asked or SearchRules()
    if asked.objective not in defaults.OBJECTIVES:
        raise InputError(f"objective {asked.objective!r}", expected=f"one of {', '.join(defaults.OBJECTIVES)}")
    report = progress or (lambda done, total: None)
    search = _Search(model, path, load, force, bounds, asked, rules=Rules(asked.margin))
    search.sampled(path)
    now = None if present is None else search.evaluators["whole"].figures(present[None])
    if now is not None and now.margin[0] >= 0.0:
        search.present = present
    start = present if present is not None and bounds.holds(present) else None
    rapids_left_out: tuple[tuple[int, str], ...] = ()
    for searches in range(1, SEARCHES + 1):
        rng = np.random.default_rng(asked.seed + searches - 1)
        candidates, left_out = _searched(search, rng, start, now, report)
        rapids_left_out += left_out
        found = _result(search, candidates, now, rapids_left_out)
        gain = found.figures.objectives - (NO_FLOORS if now is None or start is None else now.objectives)
        alone = bool(len(bounds.free) and len(gain) == 1 and (np.abs(gain) <= SAME * found.figures.mean[0]).all())
        if not alone or searches == SEARCHES:
            break
    report(4, 4)
    return replace(found, searches=searches, alone=alone)


def _searched(
    search: _Search,
    rng: np.random.Generator,
    start: FloatArray | None,
    now: PlacementFigures | None,
    report: Callable[[int, int], None],
) -> tuple[FloatArray, tuple[tuple[int, str], ...]]:
    """Candidates for the front (k, 6), the present placement first where it may be one; rapids that were left out."""
    bounds = search.bounds
    present = np.zeros((0, 6)) if start is None else start[None]
    unit = rng.uniform(size=(max(SCOUTS * len(bounds.free), 1), len(bounds.free)))
    scouts = np.vstack([present, bounds.placements(unit)])
    known, rapids_left_out = _let_go(search, scouts)
    allowed = _extrapolation_allowed(search, scouts, known, now)
    search.rules = replace(search.rules, extrapolated=allowed)
    report(1, 4)
    archive, figures = _evolved(search, scouts, known, rng)
    report(2, 4)
    ends = _climbed(search, np.vstack([archive, scouts]), PlacementFigures.joined([figures, known]), now)
    report(3, 4)
    return np.vstack([present, _for_the_front(search, archive), ends]), rapids_left_out


def _for_the_front(search: _Search, candidates: FloatArray) -> FloatArray:
    """Those of the candidates that are evaluated on the whole path: of a long one no more than the front needs."""
    most = max(search.asked.points, WHOLE_POSES // max(len(search.path), 1))
    if len(candidates) <= most:
        return candidates
    figures = search.evaluators["middle"].figures(candidates)
    rows = front_rows(figures, search.rules_for("middle").violation(figures) == 0.0)
    return candidates[thin(figures.take(rows).objectives, rows, most) if len(rows) else slice(0, most)]


def _result(
    search: _Search, candidates: FloatArray, now: PlacementFigures | None, rapids_left_out: tuple[tuple[int, str], ...]
) -> PlacementResult:
    """The front of the candidates on the whole path, and the recommendation. Raises `UnreachableError`."""
    candidates = candidates[np.lexsort(np.round(candidates.T[::-1], 9))]  # of equals the first stands
    figures = search.evaluators["whole"].figures(candidates)
    if not search.kept(figures).any():
        raise _infeasible(search, candidates[int(np.argmin(search.rules.violation(figures)))])
    best = _recommended(search, candidates, figures, now)
    rows = front_rows(_rounded(figures), search.kept(figures))
    if best not in rows:  # equal to another in all three
        rows = np.append(rows, best)
    rows = rows[np.argsort(figures.mean[rows], kind="stable")]
    rows = thin(figures.take(rows).objectives, rows, search.asked.points, best)
    return PlacementResult(
        front=candidates[rows],
        figures=figures.take(rows),
        best=int(np.flatnonzero(rows == best)[0]),
        present=now,
        rules=search.rules,
        rapids_left_out=rapids_left_out,
        pose_evaluations=search.poses,
    )


def _let_go(search: _Search, scouts: FloatArray) -> tuple[PlacementFigures, tuple[tuple[int, str], ...]]:
    """Drop anchored rapids that no placement keeps within reach where the cuts are.

    Returns the figures of the scouts on few samples, and the lines of these rapids and why.
    """
    few, whole = search.evaluators["few"], search.path.anchored
    found = [
        (few.summary(rows), np.minimum(rows.margin - search.rules.margin, rows.clearance))
        for rows in few.groups(scouts)
    ]
    figures, room = PlacementFigures.joined([part for part, _ in found]), np.concatenate([part for _, part in found])
    cuts = room[:, : len(few.path)][:, few.path.cutting].min(axis=1, initial=np.inf)
    possible = scouts[cuts >= 0.0] if (cuts >= 0.0).any() else scouts
    gone, told = [], []
    for move in np.unique(whole.move):
        rapid = whole.take(whole.move == move)
        alone = search.evaluator(replace(few.path.take(np.arange(0)), anchored=rapid))
        best, most = _roomiest(search, alone, possible)
        few.poses += alone.poses
        if most < 0.0:
            told.append((int(rapid.line[0]), _breaks(search, alone.path, best)))
            gone.append(move)
    if gone:
        search.sampled(replace(search.path, anchored=whole.take(~np.isin(whole.move, gone))))
        figures = search.evaluators["few"].figures(scouts)
    return figures, tuple(told)


def _roomiest(search: _Search, evaluator: Evaluator, placements: FloatArray) -> tuple[FloatArray, float]:
    """The first placement that keeps the rules at all samples, else the one that misses them least, and its room."""
    best, most = placements[0], -np.inf
    for start in range(0, len(placements), SCOUTS_AT_A_TIME):
        some = placements[start : start + SCOUTS_AT_A_TIME]
        rows = evaluator.rows(some)
        room = np.minimum(rows.margin - search.rules.margin, rows.clearance).min(axis=1)
        if room.max() > most:
            best, most = some[int(np.argmax(room))], float(room.max())
        if most >= 0.0:
            break
    return best, most


def _breaks(search: _Search, rapid: WorkPath, placement: FloatArray) -> str:
    """What the worst sample of an anchored rapid breaks at a placement, in words."""
    position, stand = _stand(search, rapid, placement)
    worst = int(np.argmin(stand.margin))
    if stand.margin[worst] >= search.rules.margin:
        boxes = [box.name for box in search.asked.keepouts if clearances(box, position).min() < 0.0]
        return f"it runs through the keep-out {boxes[0]}" if boxes else "it cannot be kept"
    return stand.describe(worst)


def _stand(search: _Search, path: WorkPath, placement: FloatArray) -> tuple[FloatArray, Reach]:
    """(m + q, 3) m of a path at a placement, anchored rapids last, and how these stand to the limits."""
    anchored, machine = path.anchored, search.model.machine
    turn = rotation_matrices(placement[None, 3:])
    position = np.concatenate([placed_path(path, placement)[0], anchored.placed(turn, placement[None, :3])[0]])
    rotation = rotation_matrices(place_orientations(np.concatenate([path.abc, anchored.abc]), placement))
    tools = np.concatenate([path.tool_length, anchored.tool_length])
    return position, reach(machine, position, solve_struts(machine, position, rotation, tools), rotation)


def _extrapolation_allowed(
    search: _Search, scouts: FloatArray, few: PlacementFigures, now: PlacementFigures | None
) -> float:
    """Largest share of samples outside the strut law: as now; where that is out of reach, the least that was found.

    `few` are the figures of the scouts on few samples.
    """
    if search.asked.allow_extrapolation or now is None:
        return np.inf
    if now.margin[0] >= 0.0:
        return float(now.extrapolated[0])
    possible = np.flatnonzero(search.kept(few))
    if not len(possible):
        return np.inf
    least = possible[np.argsort(few.extrapolated[possible], kind="stable")[:5]]
    return float(search.evaluators["whole"].figures(scouts[least]).extrapolated.min())


def _evolved(
    search: _Search, scouts: FloatArray, known: PlacementFigures, rng: np.random.Generator
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
            search.heed(np.vstack([archive[_ranked(search, goal, figures)[:1]] for goal in ENDS]))
            archive, figures = _survivors(search, archive, search.evaluators["few"].figures(archive))
        parents, one, other = (bounds.unit(archive[rng.integers(len(archive), size=CHILDREN)]) for _ in range(3))
        step = spread * rng.normal(size=parents.shape) * (rng.uniform(size=parents.shape) < 0.7)
        along = np.where(rng.uniform(size=(CHILDREN, 1)) < 0.5, 0.5, 0.0)
        children = bounds.placements(parents + step + along * (one - other))
        met = PlacementFigures.joined([figures, search.evaluators["few"].figures(children)])
        archive, figures = _survivors(search, np.vstack([archive, children]), met)
    return archive, figures


def _survivors(
    search: _Search, placements: FloatArray, figures: PlacementFigures
) -> tuple[FloatArray, PlacementFigures]:
    """What nothing dominates, thinned; where too little keeps the rules, the nearest to keeping them as well."""
    violation = search.rules_for("few").violation(figures)
    rows = front_rows(figures, violation == 0.0)
    rows = thin(figures.take(rows).objectives, rows, ARCHIVE) if len(rows) else rows
    if len(rows) < CHILDREN // 3:
        order = np.argsort(violation, kind="stable")
        rows = np.unique(np.append(rows, order[: CHILDREN // 3]))
    return placements[rows], figures.take(rows)


def _climbed(
    search: _Search, candidates: FloatArray, figures: PlacementFigures, now: PlacementFigures | None
) -> FloatArray:
    """The ends of the front and what each objective recommends, climbed to from candidates with figures on few samples.

    Whichever objective is asked for, all are climbed to: no answer may be beaten by the end of another one's front.
    """
    found = _climbed_to(search, candidates, figures, ENDS, STARTS)
    if now is not None and search.present is not None:
        floors = now.objectives[0]
        whole = search.evaluators["whole"]
        below = [goal for goal, ends in zip(ENDS, found, strict=True) if _falls(whole, ends, floors)]
        if below:
            goals = [Goal(goal.weights, floors) for goal in below]
            found += _climbed_to(search, candidates, figures, goals, [FLOORED_STARTS] * len(goals))
            if _falls(whole, np.vstack(found), floors):
                found += _climbed_to(search, candidates, figures, [Goal(None, floors)], STARTS[:1])
    return np.vstack(found)


def _falls(whole: Evaluator, placements: FloatArray, floors: FloatArray) -> bool:
    """Whether each of some placements is worse in something than the floors."""
    return bool((Goal(ENDS[0].weights, floors).worsening(whole.figures(placements)) > 0.0).all())


def _climbed_to(
    search: _Search, candidates: FloatArray, figures: PlacementFigures, goals: list[Goal], starts: Sequence[int]
) -> list[FloatArray]:
    """Where climbs from the best candidates to each goal end: many on few samples, few on more, one on the whole path.

    `figures` are those of the candidates on few samples. There are several hills, and a slope that few samples show is
    not always the whole path's. All climb together, each to its own goal.
    """
    few, whole = search.climber("few"), search.evaluators["whole"]
    free = len(search.bounds.free)
    found = [
        _best_apart(search, candidates, figures, goal, count * free, APART)
        for goal, count in zip(goals, starts, strict=True)
    ]
    for _ in range(HEATS):  # the better half of the climbs, those up the same hill counted once, goes on
        climbed = _together(few, found, goals, CLIMB_STEPS)
        known = few.evaluator.figures(np.vstack(climbed))
        ends = np.cumsum([0, *map(len, climbed)])
        found = [
            _best_apart(search, climbed[i], known.take(slice(ends[i], ends[i + 1])), goal, count, BASIN)
            for i, goal in enumerate(goals)
            for count in (max((len(climbed[i]) + 1) // 2, FINALISTS),)
        ]
    found = [placements[:FINALISTS] for placements in found]
    if search.evaluators["middle"] is not whole:
        found = _exchanged(search, found, goals)
    best = [
        placements[_ranked(search, goal, whole.figures(placements))[0]]
        for placements, goal in zip(found, goals, strict=True)
    ]
    last = _finished(search, best, goals)
    return [np.vstack(pair) for pair in zip(found, last, strict=True)]


def _exchanged(search: _Search, found: list[FloatArray], goals: list[Goal]) -> list[FloatArray]:
    """Where climbs on more samples end, to which what decides at their ends is added until they miss nothing there."""
    whole = search.evaluators["whole"]
    for _ in range(EXCHANGES):
        search.heed(np.vstack([placements[:1] for placements in found]))
        climber = search.climber("middle")
        found = _together(climber, found, goals, POLISH_STEPS)
        tops = np.vstack([placements[:1] for placements in found])
        seen, true = climber.evaluator.figures(tops), whole.figures(tops)
        missed = (seen.objectives - true.objectives > MISSED * true.mean[:, None]).any(axis=1) | ~search.kept(true)
        if not missed.any():
            break
    return found


def _together(climber: Climber, first: list[FloatArray], goals: list[Goal], steps: int) -> list[FloatArray]:
    """Where climbs from placements (k, 6) to each goal end."""
    each = [goal for goal, placements in zip(goals, first, strict=True) for _ in placements]
    climbed = climber.climb(np.vstack(first), each, steps)
    return np.split(climbed, np.cumsum([len(placements) for placements in first])[:-1])


def _best_apart(
    search: _Search, placements: FloatArray, figures: PlacementFigures, goal: Goal, count: int, distance: float
) -> FloatArray:
    """The best of some placements for a goal that are not beside each other."""
    ranked = placements[_ranked(search, goal, figures)]
    return ranked[apart(search.bounds, ranked, count, distance)]


def _finished(search: _Search, best: list[FloatArray], goals: list[Goal]) -> list[FloatArray]:
    """For each goal (k, 6) the end of a climb on the whole path, from a placement (6,) near its top.

    A long path is climbed on samples that stand for it, to which those are added that decide on it there: the extremes
    of each of its stretches (an exchange method of semi-infinite programming; Hettich and Kortanek, SIAM Review 35
    (1993) 380).
    """
    if len(search.path) <= SHORT:
        climbed = search.climber("whole").climb(np.array(best), goals, FINAL_STEPS, FINAL_REGION)
        return [placement[None] for placement in climbed]
    middle, everything = search.evaluators["middle"], search.evaluators["whole"]
    ends = []
    for first, goal in zip(best, goals, strict=True):
        found = first[None]
        for _ in range(ROUNDS):
            deciding = everything.deciding_rows(found[-1], STRETCHES)
            evaluator = search.evaluator(with_rows(middle.path, search.path, deciding))
            climber = Climber(evaluator, search.bounds, search.rules)
            found = np.vstack([found, climber.climb(found[-1:], goal, FINAL_STEPS, FINAL_REGION)])
            middle.poses += evaluator.poses
        ends.append(found[1:])
    return ends


def _ranked(search: _Search, goal: Goal, figures: PlacementFigures) -> IntArray:
    """Rows, best first: the rules, then what must not get worse, then the value."""
    return np.lexsort((-goal.value(figures), goal.worsening(figures), search.rules.violation(figures)))


def _recommended(
    search: _Search, candidates: FloatArray, figures: PlacementFigures, now: PlacementFigures | None
) -> int:
    """Row of the recommendation: the best of those that are no worse in anything, else the least worse."""
    goal = Goal(defaults.OBJECTIVES[search.asked.objective], NO_FLOORS)
    possible = np.flatnonzero(search.kept(figures))
    if now is not None and now.margin[0] >= 0.0:
        objectives = figures.objectives[possible]
        fall = (now.objectives[0] - objectives).max(axis=1)
        slack = NO_WORSE * float(now.mean[0])
        least = fall <= slack if (fall <= slack).any() else fall <= fall.min() + slack
        possible = possible[least]
    equal = _rounded(figures.take(possible))
    ranked = np.lexsort((*(-equal.objectives.T), -goal.value(equal)))
    return int(possible[ranked[0]])


def _rounded(figures: PlacementFigures) -> PlacementFigures:
    """Figures of which equal ones compare as equal: symmetric machines have placements that rounding alone parts."""
    unit = SAME * float(np.nanmax(figures.mean))
    mean, spread, lowest = (np.round(v / unit) * unit for v in (figures.mean, figures.spread, figures.lowest))
    return replace(figures, mean=mean, spread=spread, lowest=lowest)


def _infeasible(search: _Search, placement: FloatArray) -> UnreachableError:
    """The error that names the rule, the line and by how much, at the least bad placement."""
    path, rules = search.path, search.rules
    figures = search.evaluators["whole"].figures(placement[None])
    position, stand = _stand(search, path, placement)
    line = np.concatenate([path.line, path.anchored.line])
    cutting = np.concatenate([path.cutting, np.zeros(len(path.anchored), dtype=bool)])

    def least_bad(row: int) -> str:
        x, y, z = (mm_from_m(float(v)) for v in placement[:3])
        where = f"X{x:.1f} Y{y:.1f} Z{z:.1f}, turned by {deg_from_rad(float(placement[5])):.1f} degrees"
        return (
            f"no placement is feasible: at the least bad one ({where}) "
            f"{'' if cutting[row] else 'the rapid of '}line {int(line[row])}"
        )

    worst = int(np.argmin(stand.margin))
    margin = float(min(figures.margin[0], figures.rapid_margin[0]))
    if margin < 0.0:
        return UnreachableError(
            f"{least_bad(worst)} breaks a limit: {stand.describe(worst)}",
            hint="widen the bounds, or cut the part in two set-ups",
        )
    if figures.clearance[0] < 0.0:
        depths = [clearances(box, position) for box in search.asked.keepouts]
        deepest = int(np.argmin([depth.min() for depth in depths]))
        row = int(np.argmin(depths[deepest]))
        return UnreachableError(
            f"{least_bad(row)} runs {mm_from_m(-float(depths[deepest][row])):.1f} mm deep into the "
            f"keep-out {search.asked.keepouts[deepest].name}",
            hint="make the keep-out smaller or the bounds wider",
        )
    if margin < rules.margin:
        return UnreachableError(
            f"{least_bad(worst)} has a margin of {100.0 * margin:.2f} % of the limit's span: {stand.describe(worst)}",
            hint=f"widen the bounds, or ask for less than {both_names('--margin', f'{100.0 * rules.margin:g}')}",
        )
    room = search.evaluators["whole"].rows(placement[None]).law[0]
    shortest = int(np.argmin(np.where(path.cutting, room, np.inf)))
    return UnreachableError(
        f"{least_bad(shortest)} takes a strut {mm_from_m(-float(room[shortest])):.3g} mm out of the lengths of its "
        f"law, as {100.0 * figures.extrapolated[0]:.3g} % of the cutting samples do; now "
        f"{100.0 * rules.extrapolated:.3g} %",
        hint="widen the bounds, or allow it with --allow-extrapolation",
    )
