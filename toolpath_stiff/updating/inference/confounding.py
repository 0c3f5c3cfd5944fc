"""What a design of measurements can and cannot tell: confounded effects, smallest sizes that would have been seen.

Both from the effects' small-size signatures, whitened with the noise and projected beside the strut law, whose
constants are refitted along with everything.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.stiffness.effects.contract import Parameter
from toolpath_stiff.updating.inference.candidates import Table
from toolpath_stiff.updating.inference.evidence import Problem
from toolpath_stiff.updating.inference.ranking import Family

FloatArray = NDArray[np.float64]

CONFOUNDED = 0.95  # canonical correlation above which two effects cannot be told apart by these data
POWER_80 = 0.8416  # normal quantile of 80 % power


@dataclass(frozen=True)
class Confounding:
    """Largest canonical correlation of any two effects' signatures.

    Attributes
    ----------
    names
        Effects, ordered so that those of one set stand together.
    matrix
        (m, m) from 0 to 1.
    sets
        Sets of two and more effects, linked by correlations above `CONFOUNDED`.
    """

    names: tuple[str, ...]
    matrix: FloatArray
    sets: tuple[tuple[str, ...], ...]


def confounding(problem: Problem, families: Sequence[Family]) -> Confounding:
    """The confounding of effects on these data; for an effect with choices, that of its worst choice."""
    values, vectors = np.linalg.eigh(problem.sight.projected)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    names = sorted(family.name for family in families)
    bases: dict[str, list[FloatArray]] = {}
    for family in families:
        bases[family.name] = []
        for table in family.tables:
            columns = root.T @ (table.columns / problem.base_compliance[:, None])
            lengths = np.linalg.norm(columns, axis=0)
            if lengths.max() > 0.0:
                kept = columns[:, lengths > 1e-9 * lengths.max()] / lengths[lengths > 1e-9 * lengths.max()]
                bases[family.name].append(np.linalg.qr(kept)[0])
    matrix = np.eye(len(names))
    for i, first in enumerate(names):
        for j, second in enumerate(names[:i]):
            matrix[i, j] = matrix[j, i] = max(
                (float(np.linalg.norm(a.T @ b, 2)) for a in bases[first] for b in bases[second]), default=0.0
            )
    matrix = np.clip(matrix, 0.0, 1.0)
    sets = _linked(matrix > CONFOUNDED)
    # Sets first, each as a block; then the rest, every one next to what it resembles most.
    order = [i for group in sorted(sets, key=lambda group: (-len(group), group)) for i in group]
    return Confounding(
        tuple(names[i] for i in order),
        matrix[np.ix_(order, order)],
        tuple(tuple(names[i] for i in group) for group in sets if len(group) > 1),
    )


def _linked(close: NDArray[np.bool_]) -> list[list[int]]:
    """Connected components of a symmetric relation."""
    left, groups = set(range(len(close))), []
    while left:
        group, edge = set(), {min(left)}
        while edge:
            group |= edge
            edge = {j for i in edge for j in np.flatnonzero(close[i]).tolist()} - group
        groups.append(sorted(group))
        left -= group
    return groups


@dataclass(frozen=True)
class Detectable:
    """Smallest size of one parameter that these data would have shown.

    Attributes
    ----------
    effect, parameter
        Which.
    value
        SI value of the parameter at that size; nan if no size shows.
    rms
        Rms change of ln stiffness that it makes; the largest possible one if no size shows.
    seen
        Whether any size within the bounds would have been seen.
    """

    effect: str
    parameter: Parameter
    value: float
    rms: float
    seen: bool


def detectable_sizes(problem: Problem, families: Sequence[Family], gain_threshold: float) -> list[Detectable]:
    """Per parameter, the size seen with 80 % power at the threshold that the best of all candidates must pass.

    Of an effect with choices the choice that is hardest to see counts. Only the parameter itself differs from neutral.
    """
    wanted = np.sqrt(gain_threshold) + POWER_80
    found = []
    for family in sorted(families, key=lambda family: family.name):
        for j, component in enumerate(family.tables[0].candidate.components):
            worst: Detectable | None = None
            for table in family.tables:
                for sign in component.signs:
                    if table.knots and sign not in table.knots:
                        continue
                    one = _smallest(problem, table, j, sign, float(wanted))
                    # Hardest to see: not at all, else by the largest change.
                    if worst is None or (one.seen, -one.rms) < (worst.seen, -worst.rms):
                        worst = one
            if worst is not None:
                found.append(worst)
    return found


def _smallest(problem: Problem, table: Table, j: int, sign: float, wanted: float) -> Detectable:
    component = table.candidate.components[j]
    prior = problem.prior(table, j)
    sizes = np.zeros((len(prior.log_sizes[sign]), len(table.candidate.components)))
    sizes[:, j] = sign * np.exp(prior.log_sizes[sign])
    change = problem.sight.change(table.delta(sizes))
    lengths = np.maximum.accumulate(problem.sight.length(change))
    rms = np.sqrt(np.mean(change**2, axis=1))
    name, parameter = table.candidate.name, component.parameter
    if lengths[-1] < wanted:
        return Detectable(name, parameter, float("nan"), float(rms[-1]), seen=False)
    log_size = float(np.interp(wanted, lengths, prior.log_sizes[sign]))
    at = float(np.interp(log_size, prior.log_sizes[sign], rms))
    return Detectable(name, parameter, component.value(sign * float(np.exp(log_size))), at, seen=True)
