"""Diagnosis: which physical effect is missing from the model, if any.

Reads the verdict of `verdict` for each noise model, takes what they have in common, and writes it down with what a user
needs to judge it: fits with intervals, errors held out by point, what these data cannot tell, what to measure next.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from toolpath_stiff.analysis.results import analyze
from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.comparison.loop_readings import beside_tip
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.diagnosis.examination import NAMING, SHOWN, Diagnosis
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.inference import slips
from toolpath_stiff.inference.candidates import testable_effects
from toolpath_stiff.inference.discrepancies import FORMS
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.fits import baseline, refine
from toolpath_stiff.inference.judgement import FALSE_ALARM, NONE, Judgement, judge, unexcluded
from toolpath_stiff.inference.left_out import held_out, of_readings
from toolpath_stiff.inference.noise import noise_models
from toolpath_stiff.inference.prediction import Predictor, scaled_law
from toolpath_stiff.inference.rivals import INSTRUMENT
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.planning.plan import RivalPlan, reading_words
from toolpath_stiff.planning.result import plan
from toolpath_stiff.portrait.alike import looks_the_same
from toolpath_stiff.portrait.portrait import Portrait, draw_portrait
from toolpath_stiff.poses import Pose
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.stiffness.contract import Conditions
from toolpath_stiff.stiffness.model import build_model

Judged = tuple[dict[str, Judgement], Judgement]  # by the name of their noise model; the one that is written out
PATH_STEP = 5e-3  # m between samples: the mean of a path needs no more
FEWEST = 6  # readings below which a diagnosis is refused: strut law, one effect and a few to spare


def check_measured(data: Readings, purpose: str, fewest: int = FEWEST) -> None:
    """Raise `InputError` if readings are too few, or some have no stiffness."""
    lacking = int(np.isnan(data.stiffness).sum())
    if len(data) < fewest or lacking:
        raise InputError(
            f"{len(data)} reading{'s' * (len(data) != 1)}, {lacking} without a stiffness",
            expected=f"at least {fewest} measured stiffnesses {purpose}",
        )


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
    """Find the physical effect that the model lacks, if any: everything that `tps diagnose` reports.

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
    check_measured(data.of_tip, "to diagnose from")

    def judged(data: Readings) -> Judged:
        predictor, judgements = Predictor(machine, data, effect_files), {}
        effects = testable_effects(predictor)[0]
        for model in noise_models(data, noise, strut_spread):
            progress(f"searching {len(effects)} effects, noise {model.name}")
            judgements[model.name] = judge(Problem.of(predictor, model), model, effects, seed)
        predictor.tables.pop(FORMS, None)  # 0.4 GB for 5,000 readings, not needed after the judgement
        # Of several noise models the one with the largest noise, which leaves most standing, is reported in full.
        return judgements, max(judgements.values(), key=lambda judgement: judgement.noise.typical)

    judgements, main, data, suspects = _without_slips(judged, data, progress)
    progress("final fits, errors held out by point")
    effects, cannot = testable_effects(main.problem.predictor)
    tested, tip = {family.name for family in main.families}, data.tip
    cannot |= {effect.name: () for effect in effects if effect.name not in tested}
    as_given, refitted = baseline(main.problem)
    # Families judged on tables only, and not ruled out, are fitted again with the model itself.
    fits = {family.name: family.best for family in main.families if family.best is not None} | main.fits
    likely = [name for name in fits if name not in main.fits and main.probability.get(name, 0.0) >= SHOWN]
    fits |= {name: refine(main.problem, fits[name]) for name in likely}
    likeliest = fits.get(max(main.probability, key=lambda name: main.probability[name], default=NONE), main.base)
    log_model = main.problem.observed - likeliest.residual
    diagnosis = Diagnosis(
        common_verdict(list(judgements.values())), judgements, main, data.of_tip, machine, cannot,
        of_readings(as_given, tip), of_readings(refitted, tip),
        {name: of_readings(fit, tip) for name, fit in fits.items()},
        held_out(refitted, data.point).of_readings(tip),
        {name: held_out(fit, data.point).of_readings(tip) for name, fit in fits.items()},
        tuple(dict.fromkeys(data.file.tolist())), seed, suspects=suspects,
        unexcluded=unexcluded(main),
        loops=beside_tip(main.problem.predictor.data, log_model, main.problem.scatter.covariance),
    )  # fmt: skip
    return with_alike(replace(diagnosis, portrait=portrait_of(diagnosis, progress)))


def _without_slips(
    judged: Callable[[Readings], Judged], data: Readings, progress: Callable[[str], None]
) -> tuple[dict[str, Judgement], Judgement, Readings, tuple[slips.SuspectEntry, ...]]:
    """Judgements of the readings without clearly mistyped rows, the last of them, these readings, the suspect rows."""
    judgements, main = judged(data)
    if main.question or data.beside is not None:
        return judgements, main, data, ()
    suspects = slips.suspect_rows(main.problem, main.likeliest)
    clear = [suspect for suspect in suspects if suspect.clear]
    clear = [suspect for suspect in clear if suspect not in slips.alone(data, clear)]
    kept = np.ones(len(data), dtype=bool)
    kept[[int(row) for suspect in clear for row in suspect.rows]] = False
    if clear and kept.sum() >= FEWEST:
        # If something is missing, any freedom helps: a row is a slip only if correcting it leaves nothing unexplained.
        progress("once more with the rows mended that look mistyped")
        clear = [] if judged(slips.mended(data, clear))[1].verdict == "unexplained" else clear
    entries = tuple(slips.suspect_entries(suspects, data, left_out=clear))
    if not clear:
        return judgements, main, data, entries
    progress("once more without the rows that look mistyped")
    return *judged(data.select(kept)), data.select(kept), entries


def common_verdict(judgements: Sequence[Judgement]) -> str:
    """Verdict that all noise models share (if it names effects, the same ones); otherwise `ambiguous`."""
    verdicts = {judgement.verdict for judgement in judgements}
    same = len({frozenset(judgement.plausible) for judgement in judgements}) == 1
    if same and verdicts == set(NAMING):
        return "described"
    return verdicts.pop() if len(verdicts) == 1 and (same or not verdicts & set(NAMING)) else "ambiguous"


def portrait_of(diagnosis: Diagnosis, progress: Callable[[str], None]) -> Portrait | None:
    """Portrait of what is missing: from unexplained readings, or from what the best explanation leaves.

    None where nothing stands out of what is left, and where the readings do not look as if they were of this machine.
    """
    main, unexplained = diagnosis.main, diagnosis.verdict == "unexplained"
    problem, noise, base = main.problem, diagnosis.noise, main.base if unexplained else diagnosis.likeliest
    gate = main.gates.get(diagnosis.best or "")
    left = gate is not None and gate.probability <= FALSE_ALARM and noise.tip is None
    if main.question or diagnosis.verdict == "adequate" or not (unexplained or left):
        return None
    if noise.tip is not None:  # the terms are compliances at the tip, so other loops are left out
        noise = noise.select(noise.tip)
        problem = Problem.of(Predictor(diagnosis.machine, diagnosis.data, diagnosis.predictor.effect_files), noise)
        base = problem.score_base()
    progress("describing what is missing")
    portrait = draw_portrait(problem, base, noise, diagnosis.seed)
    return portrait if portrait.terms or unexplained else None


def with_alike(diagnosis: Diagnosis) -> Diagnosis:
    """Diagnosis with alternatives to each named effect: parts outside the catalogue that would look the same.

    `ambiguous` instead of a name where a part of the machine would look the same as an instrument's error.
    """
    main, named = diagnosis.main, diagnosis.fits.get(diagnosis.best or "")
    if diagnosis.verdict not in NAMING or named is None or main.noise.tip is not None:
        return diagnosis
    alike = looks_the_same(main.problem, diagnosis.base, named, diagnosis.noise, diagnosis.seed)
    same = [alike[c.name].links for c in named.candidates if c.effect.is_instrument and c.name in alike]
    if all(link == INSTRUMENT for links in same for link, _ in links):
        return replace(diagnosis, alike=alike)
    open_ones = {name: replace(judgement, verdict="ambiguous") for name, judgement in diagnosis.judgements.items()}
    return replace(diagnosis, verdict="ambiguous", judgements=open_ones, main=open_ones[main.noise.name], alike=alike)


def with_plan(diagnosis: Diagnosis, progress: Callable[[str], None] = lambda text: None) -> Diagnosis:
    """Diagnosis with rows of a plan that would tell the plausible explanations apart, with reasons; and remarks.

    Of an answer that is only `described`, what would confirm it. No rows with any other verdict than these two, and
    where they would gain nothing: the first remark says so.
    """
    # Of several noise models, plan under the last that leaves rivals, with the rivals of all of them.
    open_ones = [j for j in diagnosis.judgements.values() if j.verdict == diagnosis.verdict]
    if diagnosis.verdict not in ("ambiguous", "described") or not open_ones:
        return diagnosis
    progress("planning the next measurements")
    try:
        proposal = plan(
            diagnosis.machine, diagnosis.data, seed=diagnosis.seed,
            judgement=replace(open_ones[-1], explanations=diagnosis.explanations),
            effect_files=diagnosis.predictor.effect_files, strut_spread=diagnosis.noise.strut_spread,
        )  # fmt: skip
    except InputError as error:
        return replace(diagnosis, remarks=(f"no plan could be made: {error}",))
    visits = proposal.choice
    assert isinstance(visits, RivalPlan)
    if not visits.gains:
        return replace(diagnosis, remarks=(visits.nothing_gained,))
    why = visits.why
    remarks = [
        f"{' and '.join(pair.effects)}: tip stiffness cannot tell them apart; this would: "
        + ", or ".join(dict.fromkeys(map(reading_words, pair.indicator_across.values())))
        for pair in visits.pairs
        if not pair.separable
    ]
    rows = tuple({**row, "why": why[int(row["clamp"]) - 1]} for row in proposal.rows)
    return replace(diagnosis, next_measurements=rows, remarks=tuple(remarks))


def choice_on_path(
    diagnosis: Diagnosis, program: ReadProgram, origin: Pose | None = None, given: Conditions | None = None
) -> Document:
    """Mean, range and minimum along a program under each plausible explanation, which show how much the choice matters.

    Where the program is out of reach, or a model has no answer there, the reason instead. `given` is under what the
    program runs; unless it names a set-up, the one that an explanation belongs to: there the choice matters.
    """
    fits = {NONE: diagnosis.base, **diagnosis.fits}
    fits = {name: fits[name] for name in diagnosis.explanations if name in fits}
    conditions = given or Conditions(diagnosis.machine.setup, diagnosis.machine.temperature)
    if conditions.setup is None:
        setups = (active.setup for fit in fits.values() for active in fit.effects)
        conditions = replace(conditions, setup=next(filter(None, setups), None))
    shown = {}
    for name, fit in fits.items():
        machine = diagnosis.machine.with_changes(strut_law=scaled_law(diagnosis.machine.strut_law, fit.law))
        try:
            model = build_model(machine, diagnosis.predictor.effect_files, fit.effects, conditions)
            model = replace(model, instruments=())  # instrument effects change readings, not the machine under the tool
            analysis = analyze(model, program, origin=origin, step=PATH_STEP)
        except TpsError as error:
            return {"program": program.name, "reason": str(error)}
        figures = stiffness_figures(analysis, analysis.headline)
        shown[name] = {key: round(figures[key], 1) for key in ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm")}
    document = {"program": program.name, "setup": conditions.setup, "explanations": shown}
    means = [figures["mean_N_per_mm"] for figures in shown.values()]
    if means:
        document["mean_spread_percent"] = round(100.0 * (max(means) - min(means)) / float(np.mean(means)), 2)
    return document
