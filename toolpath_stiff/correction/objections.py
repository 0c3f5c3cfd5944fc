"""What speaks against a corrected machine as a whole, beside the support for each addition (`steps.Support`).

| objection | function |
| --- | --- |
| a path is under one load, in one set-up, with one tool: what falls on average may rise there | `risen_conditions` |
| what a diagnosis would rule out stands in for something else | `not_explained` |
| so does what leaves more than scatter, and a form beside which the strut law has to move | `insufficient_forms` |
| without the refitted strut law left-out points are predicted worse | `worse_for_kept_law` |
"""

from collections.abc import Iterator

import numpy as np

from toolpath_stiff.correction.steps import LadderStep
from toolpath_stiff.correction.task import UpdateTask
from toolpath_stiff.inference.doubts import gate_of
from toolpath_stiff.inference.errors import LAW_REFITTED
from toolpath_stiff.inference.judgement import ADEQUATE
from toolpath_stiff.inference.left_out import HeldOut, gain_in_standard_errors
from toolpath_stiff.inference.rivals import lowers_error
from toolpath_stiff.portrait.portrait import LACKING
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.stiffness.sizes import joined
from toolpath_stiff.units import mm_from_m

RISEN = 2.0  # standard errors by which the error at left-out points must rise


def risen_conditions(data: Readings, before: HeldOut, after: HeldOut) -> Iterator[str]:
    """Clauses on loads, set-ups and tools under which left-out points are predicted worse, beyond chance."""
    conditions = {
        "under {:g} N": data.force,
        "in set-up {}": data.setup,
        "with the tool {:+.4g} mm": mm_from_m(data.tool_extension),
    }
    for words, values in conditions.items():
        groups = np.unique(values)
        for value in groups.tolist() if len(groups) > 1 else ():
            old, new = (held.of_readings(values == value) for held in (before, after))
            if gain_in_standard_errors(old, new) < -RISEN and lowers_error(new, old):
                change = f"{100 * old.mean_error:.2f} to {100 * new.mean_error:.2f} %"
                yield f"{words.format(value)} the error at left-out points rises, {change}"


def not_explained(task: UpdateTask, step: LadderStep) -> str:
    """Clause on readings that a step does not explain, by the absolute gate of a diagnosis; "" if it may."""
    chance = gate_of(task.problem, task.noise_model, step.fit, task.seed).probability
    parts = joined(_parts(step))
    return f"the readings are not explained by {parts}: p = {chance:.2g}" if chance <= ADEQUATE else ""


def insufficient_forms(step: LadderStep, floor_percent: float, *, unconfirmed: bool) -> Iterator[str]:
    """Clauses on a form, `unconfirmed` or beside an instrument's error, that leaves more than scatter does.

    It acts differently elsewhere; and what an instrument's error leaves would be taken for the machine's.
    """
    if unconfirmed and step.fit.law_free:
        yield "what was read off these readings needs another strut law, too"
    beside = step.instruments and len(step.instruments) < len(_parts(step))
    of = "what was read off these readings leaves" if unconfirmed else f"{joined(_parts(step))} together leave"
    left = 100 * step.held.mean_error
    if (unconfirmed or beside) and left > LACKING * floor_percent:
        yield f"{of} {left:.2f} % at left-out points, scatter {floor_percent:.2f} %"


def worse_for_kept_law(step: LadderStep, refitted: LadderStep) -> Iterator[str]:
    """Clause on a strut law kept as given beside which left-out points are predicted worse, beyond chance."""
    of_machine = len(step.instruments) < len(step.fit.names)
    if of_machine and gain_in_standard_errors(refitted.held, step.held) < -RISEN:
        left, predicted = (100 * held.mean_error for held in (step.held, refitted.held))
        beside = f"{predicted:.2f} % beside the refitted one"
        yield f"{left:.2f} % are left at left-out points beside the strut law as given, {beside}"


def _parts(step: LadderStep) -> list[str]:
    """Names of the effects in a model, and of a refitted law."""
    return [*step.fit.names, *([LAW_REFITTED] if step.fit.law_free else [])]
