"""What to measure next after a diagnosis, and how much the choice between its explanations matters on a tool path."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.stiffness.effects.contract import Conditions
from toolpath_stiff.stiffness.model import build_model, setup_of
from toolpath_stiff.updating.diagnosis.diagnose import Diagnosis
from toolpath_stiff.updating.inference.predict import scaled_law
from toolpath_stiff.updating.inference.verdict import NONE
from toolpath_stiff.updating.planning.plan import plan_measurements
from toolpath_stiff.updating.planning.plan_between import rivals_of
from toolpath_stiff.updating.planning.plan_files import plan_rows
from toolpath_stiff.updating.planning.plan_menu import Costs, Menu

if TYPE_CHECKING:
    from toolpath_stiff.nc import Program
    from toolpath_stiff.units import Pose

POSES = 6
PATH_STEP = 5e-3  # m between samples: the mean of a path needs no more


def next_measurements(
    diagnosis: Diagnosis, poses: int = POSES, seed: int = 0
) -> tuple[list[dict[str, Any]], list[str]]:
    """Rows of a plan that would tell the plausible explanations apart, each with its reason; and remarks.

    Empty unless the verdict is `ambiguous`: there is nothing to tell apart.
    """
    # Under several noise models the most demanding one that leaves rivals: a plan for it serves the others, too.
    open_ones = [j for j in diagnosis.judgements.values() if j.verdict == "ambiguous"]
    if diagnosis.verdict != "ambiguous" or not open_ones:
        return [], []
    judgement = open_ones[-1]
    rivals = rivals_of(judgement)
    if len(rivals) < 2:
        return [], []
    noise = (float(np.sqrt(np.mean(judgement.noise.repeat**2))), judgement.noise.clamping)
    try:
        plan = plan_measurements(
            diagnosis.machine, rivals, noise, poses, menu=Menu.of(diagnosis.data), costs=Costs(), seed=seed,
            effect_files=diagnosis.predictor.effect_files, strut_spread=judgement.noise.strut_spread,
        )  # fmt: skip
    except InputError as error:
        return [], [f"no plan could be made: {error}"]
    rows = plan_rows(plan.visits, plan.chosen, set(diagnosis.data.point.tolist()))
    for row in rows:
        row["why"] = plan.why[int(row["clamp"]) - 1]
    remarks = [
        f"{pair.first} and {pair.second}: tip stiffness cannot tell them apart; put an indicator "
        + " or ".join(f"{place}" for place in dict.fromkeys(pair.indicators.values()))
        for pair in plan.pairs
        if not pair.separable
    ]
    return rows, remarks


def choice_on_path(
    diagnosis: Diagnosis, program: Program, origin: Pose | None = None, given: Conditions | None = None
) -> dict[str, Any]:
    """Mean, range and minimum along a program under each plausible explanation: how much the choice matters.

    Where the program is out of reach, or a model has no answer there, the reason instead. `given` is under what the
    program runs; unless it names a set-up, the one that an explanation belongs to: there the choice matters.
    """
    from toolpath_stiff.analysis import analyse
    from toolpath_stiff.analysis.statistics import stiffness_figures

    names = [name for name in diagnosis.explanations if name == NONE or name in diagnosis.fits]
    conditions = given or Conditions(diagnosis.machine.setup, diagnosis.machine.temperature)
    if conditions.setup is None:
        effects = [active for name in names if name != NONE for active in diagnosis.fits[name].effects]
        conditions = replace(conditions, setup=next(filter(None, map(setup_of, effects)), None))
    found: dict[str, Any] = {"program": program.name, "setup": conditions.setup, "explanations": {}}
    for name in names:
        fit = diagnosis.base if name == NONE else diagnosis.fits[name]
        machine = diagnosis.machine.with_changes(strut_law=scaled_law(diagnosis.machine.strut_law, fit.law))
        try:
            model = build_model(machine, diagnosis.predictor.effect_files, fit.effects, conditions)
            model = replace(model, instruments=())  # readings differ, the machine under the tool does not
            analysis = analyse(model, program, origin=origin, step=PATH_STEP)
        except TpsError as error:
            return {"program": program.name, "reason": str(error)}
        figures = stiffness_figures(analysis, analysis.headline)
        found["explanations"][name] = {
            key: round(figures[key], 1) for key in ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm")
        }
    means = [entry["mean_N_per_mm"] for entry in found["explanations"].values()]
    if means:
        found["mean_spread_percent"] = round(100.0 * (max(means) - min(means)) / float(np.mean(means)), 2)
    return found
