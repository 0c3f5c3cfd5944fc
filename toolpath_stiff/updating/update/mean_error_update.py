"""The paper's own estimation as an update: the strut law alone, by the smallest mean error."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from toolpath_stiff.machine.model import Machine
from toolpath_stiff.updating.diagnosis.diagnose import make_problem
from toolpath_stiff.updating.inference.baseline import AS_GIVEN, LAW_REFITTED, Baseline
from toolpath_stiff.updating.inference.fit import Fit
from toolpath_stiff.updating.inference.held_out import HeldOut, held_out
from toolpath_stiff.updating.inference.noise import STRUT_SPREAD, noise_models
from toolpath_stiff.updating.inference.predict import Predictor
from toolpath_stiff.updating.readings.measurements import Measurements
from toolpath_stiff.updating.update.strut_law_search import (
    StrutLawSearch,
    leave_points_out,
    minimise_mean_error,
    resampled_covariance,
)
from toolpath_stiff.updating.update.update import Step, Update


def update_by_mean_error(
    machine: Machine,
    data: Measurements,
    *,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> tuple[Update, StrutLawSearch]:
    """The strut law with the smallest mean error, its errors at left-out points and its uncertainty.

    Parameters
    ----------
    machine, data
        The model and n readings.
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
    found = minimise_mean_error(Predictor(machine, data, effect_files), seed)
    worst = max(noise_models(data, noise, strut_spread), key=lambda one: one.typical)
    problem, _ = make_problem(machine, data, worst, effect_files)
    predictor = problem.predictor
    baseline = Baseline.of(problem)
    given = baseline.as_given
    say("leaving points out, drawing points anew")
    last = Fit(
        (), (), (), found.law, problem.observed - predictor.log_stiffness(found.law),
        predictor.law_columns(predictor.log_stiffness(found.law), found.law),
        resampled_covariance(predictor, found.law, seed), problem.scatter,
    )  # fmt: skip
    left_out = HeldOut(leave_points_out(predictor, found.law), np.zeros((0, 2)), data.point)
    steps = (
        Step(AS_GIVEN, given, held_out(given, data.point)),
        Step("strut law by mean error", last, left_out),
    )
    refitted = Step(LAW_REFITTED, baseline.refitted, held_out(baseline.refitted, data.point))
    return Update(
        machine, data, worst, problem, steps, refitted, (), (), False, False, law_asked=True, objective="mean-error"
    ), found
