"""Tools of a search: evaluators of the whole path and of representative samples, bounds and rules."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.placement.climb import Climber
from toolpath_stiff.placement.evaluator import Evaluator, PlacementFigures
from toolpath_stiff.placement.goals import Bounds, Goal, SearchRules
from toolpath_stiff.placement.paths import WorkPath, representative_path, with_rows
from toolpath_stiff.placement.surface_error import Errors
from toolpath_stiff.stiffness.model import StiffnessModel

SCOUT_SAMPLES, POLISH_SAMPLES = 120, 400
HEEDED = 4  # stretches whose extremes are added to the few samples, for each placement checked
NO_FLOORS = np.full(3, -np.inf)
ENDS = [Goal(weights, NO_FLOORS) for weights in defaults.OBJECTIVES.values()]


@dataclass
class Search:
    """One search for placements: evaluators of few samples, of more, of the whole path; bounds and rules.

    Attributes
    ----------
    model, path, load, force
        The machine, the path in the set-up frame, the load.
    bounds, rules
        What may vary; what a placement must keep and is to be good at. The rules get their largest share of
        extrapolated samples when the scouts are back.
    present
        (6,) where program zero sits now: what the recommendation must not be worse than; None where it is out of reach.
    report
        Called with (stages done, stages in all).
    start, now
        The present placement where it lies within the bounds, (0, 6) or (1, 6); its figures, within them or not.
    errors
        Surface error of placements, where that is the objective.
    """

    model: StiffnessModel
    path: WorkPath
    load: Load
    bounds: Bounds
    rules: SearchRules = field(default_factory=SearchRules)
    force: float = defaults.FORCE
    present: FloatArray | None = None
    report: Callable[[int, int], None] = lambda done, total: None
    start: FloatArray = field(init=False)
    now: PlacementFigures | None = None
    errors: Errors | None = None
    evaluators: dict[str, Evaluator] = field(default_factory=dict)
    made: list[Evaluator] = field(default_factory=list)
    heeded: IntArray = field(init=False)

    def __post_init__(self) -> None:
        self.start, self.heeded = np.zeros((0, len(self.bounds.low))), np.zeros(0, dtype=np.int64)
        self.evaluators["whole"] = self.evaluator(self.path)
        for name, count in (("middle", POLISH_SAMPLES), ("few", SCOUT_SAMPLES)):
            short = len(self.path) <= count
            self.evaluators[name] = self.whole if short else self.evaluator(representative_path(self.path, count))
        if self.present is not None:
            self.now = self.whole.figures(self.present[None])
            self.start = self.present[None] if self.bounds.holds(self.present) else self.start
            self.present = self.present if self.now.margin[0] >= 0.0 else None

    def heed(self, placements: FloatArray) -> None:
        """Add to the representative samples those that decide on the whole path at some placements."""
        deciding = [self.whole.deciding_rows(placement, HEEDED) for placement in placements]
        rows = np.setdiff1d(np.concatenate(deciding), self.heeded)
        self.heeded = np.concatenate([self.heeded, rows])
        for name, evaluator in self.evaluators.items():
            if evaluator is not self.whole:
                self.evaluators[name] = self.evaluator(with_rows(evaluator.path, self.path, rows))

    def evaluator(self, path: WorkPath) -> Evaluator:
        """Evaluator of a part of the path."""
        self.made.append(Evaluator(self.model, path, self.load, self.force, self.rules.keepouts))
        return self.made[-1]

    @property
    def whole(self) -> Evaluator:
        """Evaluator of the whole path."""
        return self.evaluators["whole"]

    @property
    def few(self) -> Evaluator:
        """Evaluator of the few representative samples."""
        return self.evaluators["few"]

    @property
    def poses(self) -> int:
        """Number of poses evaluated so far."""
        return sum(evaluator.poses for evaluator in self.made)

    def climber(self, name: str) -> Climber:
        """Climber on some of the samples."""
        return Climber(self.evaluators[name], self.bounds, self.rules_for(name))

    def rules_for(self, name: str) -> SearchRules:
        """Rules adapted to some samples: among representative ones another share is outside the law."""
        if name == "whole" or self.present is None or not 0.0 < self.rules.extrapolated < np.inf:
            return self.rules
        now = self.evaluators[name].figures(self.present[None])
        return replace(self.rules, extrapolated=float(now.extrapolated[0]))

    def kept(self, figures: PlacementFigures) -> BoolArray:
        """(k,) placements that keep the rules on the whole path."""
        return np.asarray(self.rules.violation(figures) == 0.0)

    def ranked(self, goal: Goal, figures: PlacementFigures) -> IntArray:
        """Rows, best first: by the rules, then by what must not get worse, then by value."""
        return np.lexsort((-goal.value(figures), goal.worsening(figures), self.rules.violation(figures)))

    def best_apart(
        self, placements: FloatArray, figures: PlacementFigures, goal: Goal, count: int, distance: float
    ) -> FloatArray:
        """The best of some placements for a goal that are not close to each other."""
        ranked = placements[self.ranked(goal, figures)]
        return ranked[self.bounds.apart(ranked, count, distance)]
