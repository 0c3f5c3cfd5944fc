"""Two effects at once, and the alternative to every explanation: something that no effect of the catalogue describes.

Pairs are tried only where no single effect will do: from each of the best singles, the partners that would gain most.
With some hundred pairs to choose from one of them fits many a strange machine tolerably, so that pairs compete with the
forms of discrepancy: only if the catalogue's physics explains more than a smooth unknown does it get the name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.updating.inference.candidates import Table, tabulate
from toolpath_stiff.updating.inference.evidence import Problem, Score
from toolpath_stiff.updating.inference.gates import Structure, set_wild_aside
from toolpath_stiff.updating.inference.ranking import Family

FloatArray = NDArray[np.float64]

STARTS = 5  # singles from which pairs are built
PARTNERS = 6  # partners tried for each
AMPLITUDES = np.geomspace(0.003, 0.3, 9)  # rms of a discrepancy of ln k; as wide as the effects' own prior
FORMS = 5  # forms of discrepancy that are weighed, those that stick out most


@dataclass(frozen=True)
class Pair:
    """Two effects together."""

    names: tuple[str, str]
    score: Score
    log_evidence: float

    @property
    def name(self) -> str:
        """Both effects: "a + b"."""
        return " + ".join(self.names)


def score_pairs(problem: Problem, families: Sequence[Family], starts: Sequence[Family]) -> list[Pair]:
    """The pairs worth looking at that hold one of the first of `starts`, the most likely first; each pair once."""
    best: dict[tuple[str, str], Pair] = {}
    tables = [(family.name, table) for family in families for table in family.tables]
    for first in [family for family in starts if family.best is not None][:STARTS]:
        assert first.best is not None
        projected = problem.projected(first.best.jacobian)
        pulls, _ = set_wild_aside((first.best.residual @ projected)[None], projected)
        partners = [(name, table) for name, table in tables if name != first.name]
        gains = [_gain(table, pulls[0], projected, problem) for _, table in partners]
        for index in np.argsort(gains)[::-1][:PARTNERS]:
            name, table = partners[int(index)]
            found = _together(problem, first.best, _beside(problem, first.best, table))
            if found is None:
                continue
            key = (first.name, name) if first.name < name else (name, first.name)
            choices = len(first.tables) * sum(1 for other, _ in tables if other == name)
            evidence = found.log_evidence - np.log(choices)
            if key not in best or evidence > best[key].log_evidence:
                best[key] = Pair(key, found, float(evidence))
    return sorted(best.values(), key=lambda pair: (-pair.log_evidence, pair.names))


def _beside(problem: Problem, first: Score, table: Table) -> Table:
    """The partner's table where the first effect is at work already, if one of the two is an instrument.

    An instrument's factor acts on the whole compliance, the partner's included; mechanical effects add up as they are.
    """
    owner = first.candidates[0]
    if not (owner.effect.is_instrument or table.candidate.effect.is_instrument):
        return table
    beside = [owner.active(first.sizes[0])]
    return tabulate(table.candidate, problem.predictor, first.law, beside) or table


def _gain(table: Table, pulls: FloatArray, projected: FloatArray, problem: Problem) -> float:
    """Largest linear gain of a partner's components, signs respected one by one."""
    columns = -table.columns / problem.base_compliance[:, None]
    slopes = columns.T @ pulls
    information = np.einsum("np,nm,mp->p", columns, projected, columns)
    gains = []
    for slope, own, component in zip(slopes, information, table.candidate.components, strict=True):
        if own > 0.0 and np.sign(slope) in component.signs:
            gains.append(slope**2 / own)
    return float(sum(gains))


def _together(problem: Problem, first: Score, table: Table) -> Score | None:
    """The first effect's components refitted along with each subset of the partner's; the best."""
    count = len(first.sizes[0])
    found: Score | None = None
    subsets = list(table.candidate.subsets())
    for subset in subsets:
        free = (*first.free, *(count + j for j in subset))
        score = problem.score_subset([first.tables[0], table], free, first)
        if score is None or not score.possible:
            continue
        weighted = score.log_evidence - np.log(len(subsets)) - np.log(max(len(list(first.candidates[0].subsets())), 1))
        if found is None or weighted > found.log_evidence:
            found = _replace_evidence(score, float(weighted))
    return found


def _replace_evidence(score: Score, log_evidence: float) -> Score:
    from dataclasses import replace

    return replace(score, log_evidence=log_evidence)


def discrepancy_evidence(problem: Problem, score: Score, forms: Mapping[str, FloatArray]) -> tuple[float, str]:
    """Log evidence of a fit plus a discrepancy of unknown form and amplitude, and the likeliest form.

    The gain over the fit alone is, for one form K and amplitude t, with P the projected inverse covariance and z = P r,

        -1/2 ln |1 + t^2 L^T P L| + 1/2 z^T L t^2 (1 + t^2 L^T P L)^-1 L^T z,      K = L L^T,

    averaged over amplitudes and forms.
    """
    projected = problem.projected(score.jacobian)
    pulls, _ = set_wild_aside((score.residual @ projected)[None], projected)
    surprises = Structure(dict(forms), projected).surprises(pulls)[0]
    gains, names = [], list(forms)
    order = np.argsort(surprises)[::-1][:FORMS]
    for index in order:
        values, vectors = np.linalg.eigh(forms[names[int(index)]])
        kept = values > 1e-9 * values[-1]
        root = vectors[:, kept] * np.sqrt(values[kept])
        own, turn = np.linalg.eigh(root.T @ projected @ root)
        own = np.maximum(own, 0.0)
        loads = (turn.T @ (root.T @ pulls[0])) ** 2
        squared = AMPLITUDES[:, None] ** 2
        each = -0.5 * np.log1p(squared * own).sum(axis=1) + 0.5 * (squared * loads / (1.0 + squared * own)).sum(axis=1)
        gains.append(float(np.logaddexp.reduce(each)) - np.log(len(AMPLITUDES)))
    if not gains:
        return score.log_evidence, ""
    likeliest = names[int(order[int(np.argmax(gains))])]
    return score.log_evidence + float(np.logaddexp.reduce(gains)) - np.log(len(forms)), likeliest
