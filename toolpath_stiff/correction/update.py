"""A model corrected: what it lacks is added, fitted, judged, and written to a machine file with its origin."""

from dataclasses import replace

import numpy as np

from toolpath_stiff.correction.ladder import build_ladder
from toolpath_stiff.correction.machines import data_hash
from toolpath_stiff.correction.result import Update
from toolpath_stiff.correction.steps import LadderStep
from toolpath_stiff.correction.strut_law import (
    bar_curve,
    leave_points_out,
    minimise_mean_error,
    resampled_covariance,
)
from toolpath_stiff.correction.task import MEAN_ERROR, UpdateTask
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import Asked, command_line, hint, options
from toolpath_stiff.inference.errors import AS_GIVEN, LAW_REFITTED
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.fits import baseline
from toolpath_stiff.inference.left_out import HeldOut
from toolpath_stiff.stiffness.model import build_model, setup_of


def update(task: UpdateTask) -> Update:
    """Fit effects to measurements, judge whether the data support them, and make the machine that carries them.

    Raises
    ------
    InputError
        Too few readings, an effect named twice or present already, unknown or without its column, nothing to do.

    Examples
    --------
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.readings.measurements import read_measurements
    >>> nist = load_machine("nist")
    >>> result = update(UpdateTask(nist, read_measurements("nist-table1", nist), strut_law=True))
    >>> [f"{step.name}: {100 * step.error:.2f} %" for step in result.steps]
    ['as given: 9.62 %', 'strut law refitted: 9.72 %']
    """
    task = replace(task, files=tuple(task.files) or tuple(dict.fromkeys(task.data.file.tolist())))
    effect_files = tuple(map(str, task.effect_files))
    request = task.request or Asked(tuple(task.files), task.machine.name, effect_files, task.noise, task.strut_spread)
    if task.objective == MEAN_ERROR:
        if task.add or task.auto or not task.strut_law:
            raise InputError(
                "--objective mean-error is the paper's own estimation, of the strut law alone",
                expected="--strut-law, without --add and --auto",
            )
        result = update_by_mean_error(replace(task, data=task.data.of_tip))
    else:
        result = build_ladder(task)
    # Where its results go does not matter to the command that repeats the fit.
    words = options(
        add=list(task.add), strut_law=task.strut_law, keep_strut_law=task.keep_strut_law, auto=task.auto,
        force=task.force, objective=task.objective if task.objective == MEAN_ERROR else None, seed=task.seed or None,
    )  # fmt: skip
    result = replace(result, provenance=_provenance(result, request.command("update", *words)))
    if result.corrected is None:
        return result
    # An effect that belongs to a set-up acts only where that is named.
    setups = filter(None, map(setup_of, build_model(result.corrected, task.effect_files).effects))
    shown = options(machine=task.machine_file, effects=list(task.effect_files), setup=next(setups, None))
    compare = hint("what is left", request.command("compare", machine=task.machine_file))
    also = "the stiffness over the workspace (analyze, place and pose take the same options)"
    return replace(result, next=[compare, hint(also, command_line("map", *shown))])


def _provenance(update: Update, command: str) -> Document:
    """Where the fitted values come from. No date: the same data and command give the same bytes."""
    last = update.last
    return {
        **({} if update.described is None else {"described": f"not confirmed: {update.described.reason}"}),
        "data": list(update.task.files),
        "data_sha256": data_hash(update.task.files),
        "readings": len(update.task.data),
        "command": command,
        "noise": update.noise.origin,
        "mean_error_before_percent": round(100.0 * update.steps[0].error, 3),
        "mean_error_after_percent": round(100.0 * last.error, 3),
        "left_out_error_after_percent": round(100.0 * last.held.mean_error, 3),
    }


def update_by_mean_error(task: UpdateTask) -> Update:
    """The strut law with the smallest mean error, its errors at left-out points and its uncertainty.

    Noise is for the noise floor only: the objective does not know of it. Raises `InputError` as `minimise_mean_error`.
    """
    predictor, say, data = task.problem.predictor, task.progress, task.data
    say("searching from several starts")
    search = minimise_mean_error(predictor, task.seed)
    (as_given, law_refitted), law = baseline(task.problem), search.law
    say("leaving points out, drawing points anew")
    modelled = predictor.log_stiffness(law)
    last = Fit(
        (), (), (), law, task.problem.observed - modelled, predictor.law_columns(modelled, law),
        resampled_covariance(predictor, law, task.seed), task.problem.scatter,
    )  # fmt: skip
    left_out = HeldOut(leave_points_out(predictor, law), np.zeros((0, 2)), data.point)
    steps = LadderStep.of(AS_GIVEN, as_given, data), LadderStep.of("strut law by mean error", last, data, left_out)
    bars = None
    if not any(entry.name == "platform_flexibility" for entry in task.machine.effects):
        say("the platform's bars, soft to rigid")
        bars = bar_curve(task.machine, data, seed=task.seed, starts=1)
    return Update(task, steps, LadderStep.of(LAW_REFITTED, law_refitted, data), search=search, bars=bars)
