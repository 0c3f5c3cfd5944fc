"""All candidates against the data: searched, grouped by effect, weighed against each other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.stiffness.effects.contract import Effect
from toolpath_stiff.updating.inference.candidates import Table, candidates_of, tabulate
from toolpath_stiff.updating.inference.evidence import Problem, Score

FloatArray = NDArray[np.float64]

NOTHING = -1e9  # log evidence of what cannot be


@dataclass(frozen=True)
class Family:
    """One effect with everything that it may act on.

    Attributes
    ----------
    effect
        The effect.
    tables
        One a choice that does something to these data.
    best
        The best fit whose sizes lie within their bounds; None if every fit ends at nothing.
    log_evidence
        Averaged over choices and subsets of components: a choice of six costs ln 6.
    subsets
        Fits of the choice of `best` with each subset of components that is possible, and their log prior weights.
    """

    effect: Effect
    tables: tuple[Table, ...]
    best: Score | None
    log_evidence: float
    subsets: tuple[tuple[Score, float], ...] = ()

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name


def score_family(problem: Problem, effect: Effect, base: Score) -> Family | None:
    """Search one effect; None if it does nothing to these data."""
    data = problem.predictor.data
    tables, evidences = [], []
    best: Score | None = None
    subsets: tuple[tuple[Score, float], ...] = ()
    for candidate in candidates_of(effect, data):
        table = tabulate(candidate, problem.predictor, np.zeros(2))
        if table is None:
            continue
        tables.append(table)
        scores = _scores(problem, table, base)
        for score, log_weight in scores:
            evidences.append(score.log_evidence + log_weight)
            if score.possible and (best is None or score.log_evidence > best.log_evidence):
                best = score
        if best is not None and best.tables[0] is table:
            subsets = tuple((score, log_weight) for score, log_weight in scores if score.possible)
    if not tables:
        return None
    total = float(np.logaddexp.reduce(evidences)) - np.log(len(tables)) if evidences else NOTHING
    return Family(effect, tuple(tables), best, total, subsets)


def _scores(problem: Problem, table: Table, base: Score) -> list[tuple[Score, float]]:
    """Fits of one candidate with the log prior weight of each subset of components."""
    if table.knots:
        return [(problem.score_single(table, base), 0.0)]
    subsets = list(table.candidate.subsets())
    found = ((problem.score_subset([table], free, base), -float(np.log(len(subsets)))) for free in subsets)
    return [(score, weight) for score, weight in found if score is not None]


def score_families(
    problem: Problem, effects: Iterable[Effect], base: Score, progress: Callable[[str], None] | None = None
) -> list[Family]:
    """All effects that do something to these data, the most likely first."""
    found = []
    for effect in effects:
        if progress is not None:
            progress(effect.name)
        family = score_family(problem, effect, base)
        if family is not None:
            found.append(family)
    return sorted(found, key=lambda family: (-family.log_evidence, family.name))


def signatures(problem: Problem, families: Sequence[Family]) -> list[list[FloatArray]]:
    """One-sided small-size signatures d ln k / d size of every candidate: subsets of columns (n, p), sizes >= 0."""
    found = []
    for family in families:
        for table in family.tables:
            columns = -table.columns / problem.base_compliance[:, None]
            components = table.candidate.components
            if len(components) == 1:
                found.append([columns * sign for sign in components[0].signs])
            else:
                toward = np.array([c.signs[-1] for c in components])
                found.append([(columns * toward)[:, list(subset)] for subset in table.candidate.subsets()])
    return found


def probabilities(log_evidence: Mapping[str, float], prior: Mapping[str, float]) -> dict[str, float]:
    """Posterior of hypotheses from log evidences and prior weights (which need not sum to 1); none if all are out."""
    names = [name for name in log_evidence if prior.get(name, 0.0) > 0.0]
    logs = np.array([log_evidence[name] + np.log(prior[name]) for name in names])
    if not names or logs.max() <= 0.5 * NOTHING:
        return dict.fromkeys(log_evidence, 0.0)
    weights = np.exp(logs - logs.max())
    found = dict(zip(names, (weights / weights.sum()).tolist(), strict=True))
    return {name: found.get(name, 0.0) for name in log_evidence}
