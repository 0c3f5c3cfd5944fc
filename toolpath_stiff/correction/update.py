"""A model corrected: what it lacks is added, fitted, judged, and written to a machine file with its origin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff.correction.additions import parse_addition
from toolpath_stiff.correction.ladder import build_ladder
from toolpath_stiff.correction.machines import data_hash
from toolpath_stiff.correction.result import Update
from toolpath_stiff.correction.steps import LadderStep
from toolpath_stiff.correction.strut_law import (
    BarCurve,
    bar_curve,
    leave_points_out,
    minimise_mean_error,
    resampled_covariance,
)
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import Asked, command_line, hint, options
from toolpath_stiff.inference.doubts import question
from toolpath_stiff.inference.errors import AS_GIVEN, LAW_REFITTED
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import baseline
from toolpath_stiff.inference.left_out import HeldOut
from toolpath_stiff.inference.noise import noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.stiffness.model import build_model, setup_of

LIKELIHOOD, MEAN_ERROR = OBJECTIVES = ("likelihood", "mean-error")


def update(
    machine: Hexapod,
    data: Readings,
    add: Sequence[str] = (),
    *,
    strut_law: bool = False,
    keep_strut_law: bool = False,
    auto: bool = False,
    force: bool = False,
    objective: str = LIKELIHOOD,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    files: Sequence[str] = (),
    machine_file: str = "machine.toml",
    asked: Asked | None = None,
    progress: Callable[[str], None] | None = None,
) -> Update:
    """Fit effects to measurements, judge whether the data support them, and make the machine that carries them.

    Parameters
    ----------
    machine, data
        The model and n readings.
    add
        Effects to be added: `weak_strut`, or with what they act on, `weak_strut:strut=3`.
    strut_law
        Write the refitted strut law even if no effect is added.
    keep_strut_law
        Keep the strut law of the machine file; else its two stiffnesses are fitted along with every effect.
    auto
        Go on adding effects while the data support them.
    force
        Keep what the data do not support, or readings hardly of this machine; never what fits worse than `machine`.
    objective
        "likelihood"; or "mean-error", the paper's own estimation, of the strut law alone.
    noise, strut_spread, effect_files, seed, progress
        As in `diagnose`.
    files
        Names of the measurement files, whose bytes are hashed for the record; empty: those that `data` names.
    machine_file
        Name that the new machine file is to have, for the record and the commands that use it.
    asked
        What the commands that go on from here carry.

    Raises
    ------
    InputError
        Too few readings, an effect named twice or present already, unknown or without its column, nothing to do.

    Examples
    --------
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.readings.measurements import read_measurements
    >>> nist = load_machine("nist")
    >>> result = update(nist, read_measurements("nist-table1", nist), strut_law=True)
    >>> [f"{step.name}: {100 * step.error:.2f} %" for step in result.steps]
    ['as given: 9.62 %', 'strut law refitted: 9.72 %']
    """
    files = tuple(files) or tuple(dict.fromkeys(data.file.tolist()))
    request = asked or Asked(files, machine.name, tuple(map(str, effect_files)), noise, strut_spread)
    common: dict[str, Any] = {
        "force": force, "noise": noise, "strut_spread": strut_spread, "effect_files": effect_files, "seed": seed,
        "progress": progress,
    }  # fmt: skip
    if objective == MEAN_ERROR:
        if add or auto or not strut_law:
            raise InputError(
                "--objective mean-error is the paper's own estimation, of the strut law alone",
                expected="--strut-law, without --add and --auto",
                hint="effects are fitted by likelihood",
            )
        result = update_by_mean_error(machine, data.of_tip, **common)
        result = replace(result, bars=_bars(machine, data, seed, progress))
    else:
        additions = [parse_addition(text, data, effect_files) for text in add]
        result = build_ladder(
            machine, data, additions, strut_law=strut_law, keep_law=keep_strut_law, auto=auto, **common
        )
    # Where its results go does not matter to the command that repeats the fit.
    words = options(
        add=list(add), strut_law=strut_law, keep_strut_law=keep_strut_law, auto=auto, force=force,
        objective=objective if objective == MEAN_ERROR else None, seed=seed or None,
    )  # fmt: skip
    result = replace(
        result, names=files, seed=seed, machine_file=machine_file,
        provenance=_provenance(result, files, request.command("update", *words)),
    )  # fmt: skip
    if result.corrected is None:
        return result
    return replace(result, next=_next(result.corrected, machine_file, request, effect_files))


def update_by_mean_error(
    machine: Hexapod,
    data: Readings,
    *,
    force: bool = False,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Update:
    """The strut law with the smallest mean error, its errors at left-out points and its uncertainty.

    Parameters
    ----------
    machine, data
        The model and n readings.
    force
        Keep the law even of readings that hardly are of this machine.
    noise, strut_spread
        For the noise floor only: the objective does not know of noise.
    effect_files
        A user's own effects, which the machine may carry.
    seed
        Of the searches' starts and of the bootstrap over points.
    progress
        Told what is being done.

    Raises
    ------
    InputError
        As `minimise_mean_error`.
    """
    say = progress or (lambda text: None)
    say("searching from several starts")
    predictor = Predictor(machine, data, effect_files)
    search = minimise_mean_error(predictor, seed)
    worst = max(noise_models(data, noise, strut_spread), key=lambda model: model.typical)
    problem = Problem.of(predictor, worst)
    (as_given, law_refitted), law = baseline(problem), search.law
    say("leaving points out, drawing points anew")
    modelled = predictor.log_stiffness(law)
    last = Fit(
        (), (), (), law, problem.observed - modelled, predictor.law_columns(modelled, law),
        resampled_covariance(predictor, law, seed), problem.scatter,
    )  # fmt: skip
    left_out = HeldOut(leave_points_out(predictor, law), np.zeros((0, 2)), data.point)
    steps = LadderStep.of(AS_GIVEN, as_given, data), LadderStep.of("strut law by mean error", last, data, left_out)
    refitted = LadderStep.of(LAW_REFITTED, law_refitted, data)
    return Update(
        machine, data, worst, problem, steps, refitted, forced=force, law_asked=True, objective="mean-error",
        question=question(predictor), search=search, seed=seed,
    )  # fmt: skip


def _provenance(update: Update, files: Sequence[str], command: str) -> dict[str, Any]:
    """Where the fitted values come from. No date: the same data and command give the same bytes."""
    described = {} if update.described is None else {"described": f"not confirmed: {update.described.reason}"}
    return {
        **described,
        "data": list(files),
        "data_sha256": data_hash(files),
        "readings": len(update.data),
        "command": command,
        "noise": update.noise.origin,
        "mean_error_before_percent": round(100.0 * update.steps[0].error, 3),
        "mean_error_after_percent": round(100.0 * update.last.error, 3),
        "left_out_error_after_percent": round(100.0 * update.last.held.mean_error, 3),
    }


def _next(updated: Hexapod, machine_file: str, request: Asked, effect_files: Sequence[str | Path]) -> list[str]:
    """Commands that use the new machine; an effect that belongs to a set-up acts only where that is named."""
    model = build_model(updated, effect_files)
    setups = [name for active in model.effects if (name := setup_of(active))]
    shown = options(machine=machine_file, effects=list(effect_files), setup=setups[0] if setups else None)
    also = " (analyze, place and pose take the same options)"
    return [
        hint("what is left", request.command("compare", machine=machine_file)),
        hint(f"the stiffness over the workspace{also}", command_line("map", *shown)),
    ]


def _bars(machine: Hexapod, data: Readings, seed: int, progress: Callable[[str], None] | None) -> BarCurve | None:
    """The paper's Figure 3; None where the machine carries bars as an effect."""
    if any(entry.name == "platform_flexibility" for entry in machine.effects):
        return None
    if progress is not None:
        progress("the platform's bars, soft to rigid")
    return bar_curve(machine, data, seed=seed, starts=1)
