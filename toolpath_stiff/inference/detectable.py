"""Smallest sizes that readings would have shown."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.inference.candidates import CandidateTable
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
    wanted = float(np.sqrt(gain_threshold)) + POWER_80
    detectable = []
    for family in sorted(families, key=lambda family: family.name):
        for j in range(len(family.tables[0].candidate.components)):
            smallest = [
                _smallest(problem, table, j, sign, wanted)
                for table in family.tables
                for sign in problem.prior(table, j).log_sizes
            ]
            # Hardest to see: not at all, else by the largest change; of two alike the first.
            hidden = [size for size in smallest if not size.seen] or smallest
            largest = max((size.rms for size in hidden), default=0.0)
            detectable += [size for size in hidden if size.rms >= (1.0 - TIED) * largest][:1]
    return detectable


def _smallest(problem: Problem, table: CandidateTable, j: int, sign: float, wanted: float) -> Detectable:
    name, component, prior = table.candidate.name, table.candidate.components[j], problem.prior(table, j)
    logs, rms, lengths = prior.log_sizes[sign], prior.rms[sign], np.maximum.accumulate(prior.lengths[sign])
    if lengths[-1] < wanted:
        return Detectable(name, component.parameter, float("nan"), float(rms[-1]), seen=False)
    log_size = float(np.interp(wanted, lengths, logs))
    value = component.value(sign * float(np.exp(log_size)))
    return Detectable(name, component.parameter, value, float(np.interp(log_size, logs, rms)), seen=True)
