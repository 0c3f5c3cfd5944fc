"""Smallest sizes that readings would have shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.inference.candidates import Table
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.hypotheses import Family
from toolpath_stiff.stiffness.contract import Parameter

POWER_80 = 0.8416  # normal quantile of 80 % power


TIED = 1e-9  # share by which changes differ that are one and the same: of a factor and of its inverse


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
                    # Hardest to see: not at all, else by the largest change; of two alike the first.
                    if worst is None or _harder(one, worst):
                        worst = one
            if worst is not None:
                found.append(worst)
    return found


def _harder(one: Detectable, other: Detectable) -> bool:
    return one.rms > (1.0 + TIED) * other.rms if one.seen == other.seen else not one.seen


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
