"""Diagnosis: which physical effect is missing from the model, if any.

Reads the verdict of `verdict` for each noise model, takes what they have in common, and writes it down with what a user
needs to judge it: fits with intervals, errors held out by point, what these data cannot tell, what to measure next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.comparison.loop_readings import beside_tip
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.diagnosis.examination import NAMING
from toolpath_stiff.diagnosis.result import Diagnosis
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.inference import slips
from toolpath_stiff.inference.candidates import testable_effects
from toolpath_stiff.inference.confounding import confounding
from toolpath_stiff.inference.detectable import detectable_sizes
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.fits import baseline, refine
from toolpath_stiff.inference.judgement import FALSE_ALARM, NONE, Judgement, judge, unexcluded
from toolpath_stiff.inference.left_out import held_out, of_readings
from toolpath_stiff.inference.noise import noise_models
from toolpath_stiff.inference.prediction import Predictor, scaled_law
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.planning.menu import Menu
from toolpath_stiff.planning.plan import plan_measurements
from toolpath_stiff.planning.rivals import rivals_of
from toolpath_stiff.planning.rows import plan_rows
from toolpath_stiff.portrait.alike import Alike, looks_the_same
from toolpath_stiff.portrait.portrait import Portrait, draw_portrait
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.stiffness.contract import Conditions
from toolpath_stiff.stiffness.model import build_model

if TYPE_CHECKING:
    from toolpath_stiff.nc.moves import ReadProgram
    from toolpath_stiff.poses import Pose


FEWEST = 6  # readings below which a diagnosis is refused: strut law, one effect and a few to spare


def diagnose(
    machine: Hexapod,
    data: Readings,
    *,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    progress: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Find out which physical effect the model lacks, if any: everything that `tps diagnose` says.

    Parameters
    ----------
    machine, data
        The model and n readings of the machine.
    noise
        Relative sd of one reading, re-clamping included, or (repeat, clamping); None: from the data.
    strut_spread
        Relative sd of the struts' stiffnesses.
    effect_files
        A user's own effects, which take part.
    seed
        Of the bootstrap.
    progress
        Told what is being done.

    Raises
    ------
    InputError
        Too few readings, or what `Predictor` and `noise_models` refuse.

    Examples
    --------
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.readings.measurements import read_measurements
    >>> nist = load_machine("nist")
    >>> found = diagnose(nist, read_measurements("nist-table1", nist), noise=0.10)
    >>> found.verdict
    'ambiguous'
    """
    if len(data.of_tip) < FEWEST or np.isnan(data.stiffness).any():
        raise InputError(
            f"{len(data.of_tip)} readings, {int(np.isnan(data.stiffness).sum())} without a stiffness",
            expected=f"at least {FEWEST} measured stiffnesses to diagnose from",
        )

    def judged(data: Readings) -> Judged:
        predictor, judgements = Predictor(machine, data, effect_files), {}
        effects = testable_effects(predictor)[0]
        for model in noise_models(data, noise, strut_spread):
            progress(f"searching {len(effects)} effects, noise {model.name}")
            judgements[model.name] = judge(Problem.of(predictor, model), model, effects, seed)
        # Of several noise models the one with the largest noise is written out: the one that leaves most standing.
        return judgements, max(judgements.values(), key=lambda judgement: judgement.noise.typical)

    judgements, main, data, suspects = _without_slips(judged, data, progress)
    progress("final fits, errors held out by point")
    effects, cannot = testable_effects(main.problem.predictor)
    tested = {family.name for family in main.families}
    cannot |= {effect.name: () for effect in effects if effect.name not in tested}
    as_given, refitted = baseline(main.problem)
    # Of every family that the judgement has only on tables, the best once more with the model itself.
    best = {family.name: family.best for family in main.families if family.best is not None}
    fits = main.fits | {name: refine(main.problem, fit) for name, fit in best.items() if name not in main.fits}
    held = {name: held_out(fit, data.point) for name, fit in fits.items()}
    likeliest = fits.get(max(main.probability, key=lambda name: main.probability[name], default=NONE), main.base)
    log_model, tip = main.problem.observed - likeliest.residual, data.tip
    verdict, plausible = common_verdict(list(judgements.values()))
    diagnosis = Diagnosis(
        verdict, list(plausible), judgements, main, data.of_tip, machine, cannot,
        of_readings(as_given, tip), of_readings(refitted, tip),
        {name: of_readings(fit, tip) for name, fit in fits.items()},
        held_out(refitted, data.point).of_readings(tip),
        {name: left_out.of_readings(tip) for name, left_out in held.items()},
        confounding(main.problem, main.families),
        tuple(detectable_sizes(main.problem, main.families, main.base_gate.gain_threshold)),
        tuple(dict.fromkeys(data.file.tolist())), seed, suspects=suspects,
        unexcluded=tuple(hidden for hidden in unexcluded(main) if hidden.effect.name not in plausible),
        loops=beside_tip(main.problem.predictor.data, log_model, main.problem.scatter.covariance),
    )  # fmt: skip
    return replace(diagnosis, portrait=portrait_of(diagnosis, progress), alike=alike_of(diagnosis))


Judged = tuple[dict[str, Judgement], Judgement]  # by the name of their noise model; the one that is written out


def _without_slips(
    judged: Callable[[Readings], Judged], data: Readings, progress: Callable[[str], None]
) -> tuple[dict[str, Judgement], Judgement, Readings, tuple[slips.SuspectEntry, ...]]:
    """Judgements of the readings without rows that are clearly mistyped, these readings, suspects."""
    judgements, main = judged(data)
    if main.question or data.beside is not None:
        return judgements, main, data, ()
    suspects = slips.suspect_rows(main.problem, main.likeliest)
    clear = [suspect for suspect in suspects if suspect.clear]
    clear = [suspect for suspect in clear if suspect not in slips.alone(data, clear)]
    kept = np.ones(len(data), dtype=bool)
    kept[[int(row) for suspect in clear for row in suspect.rows]] = False
    if clear and kept.sum() >= FEWEST:
        # Where something is missing, any freedom helps: a slip is one only if nothing is left once it is mended.
        progress("once more with the rows mended that look mistyped")
        clear = clear if judged(slips.mended(data, clear))[1].explained else []
    entries = slips.suspect_entries(suspects, data, left_out=clear)
    if clear:
        progress("once more without the rows that look mistyped")
        data = data.select(kept)
        judgements, main = judged(data)
    return judgements, main, data, tuple(entries)


def common_verdict(judgements: Sequence[Judgement]) -> tuple[str, tuple[str, ...]]:
    """The verdict that all noise models share, and names that hold the truth under any; else `ambiguous`."""
    verdicts = {judgement.verdict for judgement in judgements}
    plausible = tuple(dict.fromkeys(name for judgement in judgements for name in judgement.plausible))
    same = len({frozenset(judgement.plausible) for judgement in judgements}) == 1
    if len(verdicts) == 1:
        (verdict,) = verdicts
        return verdict if same or verdict not in NAMING else "ambiguous", plausible
    if verdicts == set(NAMING) and same:
        return "described", plausible
    return "ambiguous", plausible or (NONE,)


def portrait_of(diagnosis: Diagnosis, progress: Callable[[str], None]) -> Portrait | None:
    """What the missing thing looks like: of unexplained readings, and of what the best explanation leaves behind.

    None where nothing stands out of what is left, and where the readings do not look as if they were of this machine.
    """
    main, verdict = diagnosis.main, diagnosis.verdict
    if main.question or verdict == "adequate":
        return None
    base = main.base
    if verdict != "unexplained":
        gate = main.gates.get(diagnosis.best or "")
        if diagnosis.best is None or gate is None or gate.probability > FALSE_ALARM:
            return None
        base = diagnosis.fits[diagnosis.best]
    problem, noise = main.problem, diagnosis.noise
    if noise.tip is not None:  # its terms are compliances at the tip: other loops are left out
        if verdict != "unexplained":
            return None
        noise = noise.select(noise.tip)
        problem = Problem.of(Predictor(diagnosis.machine, diagnosis.data, diagnosis.predictor.effect_files), noise)
        base = problem.score_base()
    progress("describing what is missing")
    portrait = draw_portrait(problem, base, noise, diagnosis.seed)
    return portrait if portrait.terms or verdict == "unexplained" else None


def alike_of(diagnosis: Diagnosis) -> Alike | None:
    """What else would look the same as the one effect that is named: parts that the catalogue does not have."""
    main = diagnosis.main
    named = diagnosis.fits.get(diagnosis.best or "")
    if diagnosis.verdict not in NAMING or named is None or main.noise.tip is not None:
        return None
    return looks_the_same(main.problem, diagnosis.base, named, diagnosis.noise, diagnosis.seed)


POSES = 6


PATH_STEP = 5e-3  # m between samples: the mean of a path needs no more


def with_plan(diagnosis: Diagnosis, progress: Callable[[str], None] = lambda text: None) -> Diagnosis:
    """With rows of a plan that would tell the plausible explanations apart, each with its reason; and remarks.

    Of an answer that is only `described`, what would confirm it. No rows with any other verdict than these two, and
    where they would gain nothing: the first remark says so.
    """
    # Under several noise models the most demanding one that leaves rivals: a plan for it serves the others, too.
    open_ones = [j for j in diagnosis.judgements.values() if j.verdict == diagnosis.verdict]
    if diagnosis.verdict not in ("ambiguous", "described") or not open_ones:
        return diagnosis
    progress("planning the next measurements")
    judgement = open_ones[-1]
    rivals = rivals_of(judgement)
    if len(rivals) < 2:
        return diagnosis
    noise = (float(np.sqrt(np.mean(judgement.noise.repeat**2))), judgement.noise.clamping)
    try:
        plan = plan_measurements(
            diagnosis.machine, rivals, noise, POSES, menu=Menu.of(diagnosis.data), seed=diagnosis.seed,
            effect_files=diagnosis.predictor.effect_files, strut_spread=judgement.noise.strut_spread,
        )  # fmt: skip
    except InputError as error:
        return replace(diagnosis, remarks=(f"no plan could be made: {error}",))
    if not plan.gains:
        return replace(diagnosis, remarks=(plan.nothing_gained,))
    rows = plan_rows(plan.visits, plan.chosen, set(diagnosis.data.point.tolist()))
    for row in rows:
        row["why"] = plan.why[int(row["clamp"]) - 1]
    remarks = [
        f"{' and '.join(pair.effects)}: tip stiffness cannot tell them apart; put an indicator "
        + " or ".join(f"{place}" for place in dict.fromkeys(pair.indicator_across.values()))
        for pair in plan.pairs
        if not pair.separable
    ]
    return replace(diagnosis, next_measurements=tuple(rows), remarks=tuple(remarks))


def choice_on_path(
    diagnosis: Diagnosis, program: ReadProgram, origin: Pose | None = None, given: Conditions | None = None
) -> dict[str, Any]:
    """Mean, range and minimum along a program under each plausible explanation: how much the choice matters.

    Where the program is out of reach, or a model has no answer there, the reason instead. `given` is under what the
    program runs; unless it names a set-up, the one that an explanation belongs to: there the choice matters.
    """
    from toolpath_stiff.analysis.results import analyze
    from toolpath_stiff.analysis.statistics import stiffness_figures

    names = [name for name in diagnosis.explanations if name == NONE or name in diagnosis.fits]
    conditions = given or Conditions(diagnosis.machine.setup, diagnosis.machine.temperature)
    if conditions.setup is None:
        effects = [active for name in names if name != NONE for active in diagnosis.fits[name].effects]
        conditions = replace(conditions, setup=next(filter(None, (active.setup for active in effects)), None))
    shown = {}
    for name in names:
        fit = diagnosis.base if name == NONE else diagnosis.fits[name]
        machine = diagnosis.machine.with_changes(strut_law=scaled_law(diagnosis.machine.strut_law, fit.law))
        try:
            model = build_model(machine, diagnosis.predictor.effect_files, fit.effects, conditions)
            model = replace(model, instruments=())  # readings differ, the machine under the tool does not
            analysis = analyze(model, program, origin=origin, step=PATH_STEP)
        except TpsError as error:
            return {"program": program.name, "reason": str(error)}
        figures = stiffness_figures(analysis, analysis.headline)
        shown[name] = {key: round(figures[key], 1) for key in ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm")}
    means = [figures["mean_N_per_mm"] for figures in shown.values()]
    spread = (
        {"mean_spread_percent": round(100.0 * (max(means) - min(means)) / float(np.mean(means)), 2)} if means else {}
    )
    return {"program": program.name, "setup": conditions.setup, "explanations": shown, **spread}
