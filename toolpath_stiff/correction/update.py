"""Update a machine: fit the effects that a user names (or that the data ask for), and judge whether data support them.

Everything starts from the machine file as given and then from its strut law refitted, which every effect is added to
unless the law is kept. Effects that are given together are steps in the order in which each lets the error fall; where
there is no such order, they are one step.

An effect is supported if

- the error at left-out points falls by more than one standard error of that fall, paired by point;
- no parameter ends at its upper bound, and not all end at zero;
- of an effect of the machine, no error of the instrument predicts left-out poses as well (`inference.votes`), and the
  other way, unless the user says which to believe;
- its gain in likelihood, the strut law refitted with and without it, is more than the best of all candidates reaches
  by chance in one campaign of twenty: the relative gate of the diagnosis. The gain is counted in units of the scatter
  that remains, so that data which no effect explains do not lend every effect significance.

Of several effects each is judged beside the others. Effects of the machine that a refitted law can stand for are judged
beside the file's law, with and without them, where that law predicts with them as well as a refitted one: which of the
two gives way the readings do not tell, but either takes the error away. Where `--auto` finds no effect it does so with
the law.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from toolpath_stiff.correction.additions import parse_addition
from toolpath_stiff.correction.as_built import last_step
from toolpath_stiff.correction.machines import data_hash, fitted_machine
from toolpath_stiff.correction.mean_error import update_by_mean_error
from toolpath_stiff.correction.result import NEEDED, Update
from toolpath_stiff.correction.steps import LadderStep, Support, dispersion
from toolpath_stiff.correction.task import INSTRUMENT, MACHINE, MEAN_ERROR, UpdateTask
from toolpath_stiff.diagnosis.diagnose import check_measured
from toolpath_stiff.diagnosis.examination import percent_of
from toolpath_stiff.documents import json_number
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import Asked, command_line, hint, options
from toolpath_stiff.inference.candidates import Candidate, candidates_of, testable_effects
from toolpath_stiff.inference.drawn import Drawn, drawn, seen_readings
from toolpath_stiff.inference.errors import AS_GIVEN, LAW_REFITTED
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import add_effect, base_fit, baseline, refine
from toolpath_stiff.inference.gates import gain_threshold, simulate
from toolpath_stiff.inference.hypotheses import Family, score_families, signatures, tables_of
from toolpath_stiff.inference.left_out import gain_in_standard_errors
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.prequential import votes
from toolpath_stiff.inference.rivals import rivals_of_law
from toolpath_stiff.inference.votes import outvoted, standard_error
from toolpath_stiff.planning.plan import reading_words, telling
from toolpath_stiff.stiffness.model import build_model
from toolpath_stiff.stiffness.sizes import joined

TRIED = 4  # candidates a step of `--auto`, the most likely first
MOST_EFFECTS = 4  # that `--auto` adds
LAW_GIVEN = "strut law as given"


def update(task: UpdateTask, build: Callable[[Any], Update] | None = None) -> Update:
    """Fit effects to measurements, judge whether the data support them, and make the machine with them.

    `build` makes the ladder; unless given, `build_ladder`.

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
    ['as given: 9.62 %', 'strut law refitted: 9.70 %']
    """
    task = replace(task, files=tuple(task.files) or tuple(dict.fromkeys(task.data.file.tolist())))
    effect_files = tuple(map(str, task.effect_files))
    request = task.request or Asked(tuple(task.files), task.machine.name, effect_files)
    result = update_by_mean_error(task) if task.objective == MEAN_ERROR else (build or build_ladder)(task)
    if build is None and result.changed and not (result.question or result.search):
        built, step = last_step(task, result.last)
        written = replace(result, as_built=built, steps=(*result.steps[: None if built else -1], step))
        result = written if written.accepted or result.accepted else result
    # Where its results go does not matter to the command that repeats the fit.
    words = options(
        add=list(task.add), strut_law=task.strut_law and build is None,
        joints=task.strut_law and build is not None, keep_strut_law=task.keep_strut_law, auto=task.auto,
        force=task.force, believe=task.believe, objective=task.objective if result.search else None,
        seed=task.seed or None,
    )  # fmt: skip
    # No date, so that the same data and command give the same bytes.
    provenance = {
        **({} if result.described is None else {"described": f"not confirmed: {result.described.reason}"}),
        "data": list(task.files),
        "data_sha256": data_hash(task.files),
        "readings": len(result.task.data),
        "command": request.command("update", *words),
        "noise": result.noise.origin,
        "mean_error_before_percent": round(100.0 * result.steps[0].error, 3),
        "mean_error_after_percent": round(100.0 * result.last.error, 3),
        "left_out_error_after_percent": round(100.0 * result.last.held.mean_error, 3),
    }
    result = replace(result, provenance=provenance)
    if result.corrected is None:
        return result
    # An effect of a set-up acts only where the set-up is named.
    setups = (active.setup for active in build_model(result.corrected, task.effect_files).effects if active.setup)
    shown = options(machine=task.machine_file, effects=list(task.effect_files), setup=next(setups, None))
    compare = hint("what is left", request.command("compare", machine=task.machine_file))
    also = "the stiffness over the workspace (analyze, place and pose take the same options)"
    return replace(result, next=[compare, hint(also, command_line("map", *shown))])


def build_ladder(task: UpdateTask) -> Update:
    """Fit effects to measurements and judge them.

    Raises
    ------
    InputError
        Too few readings, an effect unknown, named twice or present already, or nothing to do.
    """
    wanted = [parse_addition(text, task.data, task.effect_files) for text in task.add]
    by_name = {candidates[0].name: candidates for candidates in wanted}
    _check(task, [candidates[0].name for candidates in wanted])
    as_given, law_refitted = baseline(task.problem)
    refitted = LadderStep.of(LAW_REFITTED, law_refitted, task.data)
    steps = [LadderStep.of(AS_GIVEN, as_given, task.data), *([] if task.keep_strut_law else [refitted])]
    steps += ladder_of(task, steps[-1], wanted)
    tried, supports = list[Support](), _supports(task, steps[-1].fit, list(by_name.values()))
    while task.auto and len(steps[-1].fit.candidates) < MOST_EFFECTS:
        better, tried = next_effect(task, steps[-1], _field_of)
        if better is None:
            break
        steps.append(better)
        supports.append(tried[-1])
        tried = []
    if task.auto and len(steps[-1].fit.candidates) > 1:  # each was judged before those after it were there
        supports = _supports(task, steps[-1].fit, [[candidate] for candidate in steps[-1].fit.candidates])
    names = steps[-1].fit.names
    if steps[-1].fit.law_free and (names or task.strut_law or task.auto):
        chosen = steps[-1].fit.candidates
        anew = [by_name.get(c.name) or candidates_of(c.effect, task.data) for c in chosen]
        given, law = _law_support(task, steps[-1], anew)
        kept = not (law.supported or task.force) and names
        if kept and not all(support.supported for support in supports):
            beside_given = _supports(task, given.fit, [[candidate] for candidate in given.fit.candidates])
            supports = beside_given if all(support.supported for support in beside_given) else supports
        steps += [given] if kept else []
        asked = names or task.strut_law or law.supported or law.instruments
        (tried if kept or not asked else supports).append(law)
    return Update(
        task, tuple(steps), refitted, tuple(supports), turned_down=tuple(tried), drawn=_drawn(task, steps[-1].fit)
    )


def _supports(task: UpdateTask, full: Fit, groups: Sequence[Sequence[Candidate]]) -> list[Support]:
    """Support for each effect of a fit beside the others; each is one of the candidates of its group."""
    by_name, supports = {candidates[0].name: candidates for candidates in groups}, []
    for j, name in enumerate(full.names):
        others = [[candidate] for k, candidate in enumerate(full.candidates) if k != j]
        alone = fitted_with(task, base_fit(task.problem, full.law_free), others)
        before = LadderStep.of("", alone, task.data)
        supports.append(support_of(task, _field_of(task, before.fit), before, full, j, by_name[name]))
    return supports


def _check(task: UpdateTask, names: Sequence[str]) -> None:
    if not names and not task.strut_law and not task.auto:
        raise InputError("nothing to update", expected="--add EFFECT, --strut-law or --auto")
    check_measured(task.data, "to update from")
    present = [entry.name for entry in (*task.machine.effects, *task.machine.instruments)]
    if np.isfinite(task.machine.platform_bar_stiffness):
        present.append("platform_flexibility")
    for name in names:
        if (*present, *names).count(name) > 1:
            fault = f"--add {name}: given twice, or in machine {task.machine.name} already"
            raise InputError(fault, hint="a machine carries an effect once")


def fitted_with(task: UpdateTask, fit: Fit, groups: Iterable[Sequence[Candidate]]) -> Fit:
    """A fit with one further effect from each group."""
    for candidates in groups:
        fit = add_effect(task.problem, fit, candidates, fit.law_free)
    return fit


def step_up(task: UpdateTask, before: LadderStep, groups: Sequence[Sequence[Candidate]]) -> LadderStep:
    """The next rung: one effect more, or several in one step."""
    fit = fitted_with(task, before.fit, groups)
    labels = [candidate.label for candidate in fit.candidates[-len(groups) :]]
    return LadderStep.of(f"+ {' + '.join(labels)}", fit, task.data)


def ladder_of(task: UpdateTask, start: LadderStep, wanted: Sequence[Sequence[Candidate]]) -> list[LadderStep]:
    """Steps that add the requested effects, each with a lower error than the last; one step if no order gives that."""
    rest, steps = list(wanted), [start]
    while rest:
        task.progress(f"fitting {', '.join(candidates[0].name for candidates in rest)}")
        trials = [step_up(task, steps[-1], [candidates]) for candidates in rest]
        best = min(range(len(rest)), key=lambda k: trials[k].error)
        lower = trials[best].error < steps[-1].error
        if len(wanted) > 1 and (not lower or trials[best].held.mean_error >= steps[-1].held.mean_error):
            return [step_up(task, start, wanted)]
        steps.append(trials[best])
        rest.pop(best)
    return steps[1:]


def _drawn(task: UpdateTask, full: Fit) -> Drawn | None:
    """Status of the effects whose form was read off these readings, against the model without them; None if none."""
    others = [[c] for c in full.candidates if not seen_readings([c.effect], task.data).any()]
    if len(others) == len(full.candidates):
        return None
    fit = fitted_with(task, base_fit(task.problem, not task.keep_strut_law), others)
    return drawn(full, {" + ".join(fit.names) or "none": fit}, task.data)


class Field:
    """All candidate effects on a machine that carries other effects.

    Attributes
    ----------
    problem, none
        Model and scatter; the fit of the machine as it is there, its law refitted.
    threshold
        The gain that chance alone reaches.
    families
        `_families`, worked out once.
    """

    def __init__(self, problem: Problem, threshold: float) -> None:
        self.problem, self.threshold, self.none = problem, threshold, base_fit(problem, law_free=True)
        self.families = cache(self._families)

    def _families(self, *, of_instrument: bool) -> tuple[Family, ...]:
        """Effects of the instrument, or of the machine, the likeliest first."""
        every = testable_effects(self.problem.predictor)[0]
        effects = [effect for effect in every if effect.is_instrument == of_instrument]
        return tuple(f for f in score_families(self.problem, effects, self.none) if f.best is not None)


def _field_of(task: UpdateTask, others: Fit) -> Field:
    """Field against which an effect is judged, on a machine that carries the other effects."""
    task.progress("searching all effects for what chance alone would gain")
    carrying = fitted_machine(task.machine, others, {"command": "", "data_sha256": ""})
    problem = Problem.of(Predictor(carrying, task.data, task.effect_files), task.noise_model)
    effects = testable_effects(problem.predictor)[0]
    tables = [table for effect in effects for table in tables_of(problem, effect)]
    draws = simulate(task.noise_model, problem.scatter.covariance, task.seed)
    return Field(problem, gain_threshold(problem, problem.score_base().jacobian, draws, signatures(problem, tables)))


def support_of(
    task: UpdateTask, others: Field, before: LadderStep, fit: Fit, j: int, candidates: Sequence[Candidate]
) -> Support:
    """Judge effect j of a fit against the model with the other effects, the strut law as free as in that fit."""
    after = LadderStep.of("", fit, task.data)
    in_se = gain_in_standard_errors(before.held, after.held)
    believed = INSTRUMENT if fit.candidates[j].effect.is_instrument else MACHINE
    as_free = fit.law_free == others.none.law_free
    none = others.none if as_free else base_fit(others.problem, fit.law_free)
    alone = add_effect(others.problem, none, candidates, fit.law_free)
    gained = 2.0 * (alone.log_posterior - none.log_posterior) / dispersion(alone)
    reasons = []
    if not fit.sizes[j].any():
        reasons.append("it fits best when it is absent")
    names = {component.parameter.name for component in fit.candidates[j].components}
    bounded = [parameter for parameter in fit.at_upper_bound() if parameter in names]
    if bounded:
        reasons.append(f"{', '.join(bounded)} ends at its bound: the data would pull it beyond what is possible")
    if np.isnan(in_se):
        reasons.append("fewer than three points: none can be left out, so nothing can be said of unseen ones")
    elif in_se <= NEEDED:
        change = f"from {100 * before.held.mean_error:.2f} to {100 * after.held.mean_error:.2f} %"
        reasons.append(
            f"the error at left-out points goes {change}, {in_se:.1f} standard errors: more than {NEEDED:g} needed"
        )
    if gained <= others.threshold:
        reasons.append(
            f"twice the log likelihood rises by {gained:.1f}: the best of all candidates gains {others.threshold:.1f} "
            "by chance once in twenty campaigns"
        )
    if not as_free:
        refitted = refine(task.problem, before.fit)
        if outvoted(votes(task.problem, refitted, {LAW_GIVEN: fit})[LAW_GIVEN]):
            reasons.append(f"the {LAW_REFITTED} alone predicts left-out poses better")
        elif believed == INSTRUMENT != task.believe and not outvoted(votes(task.problem, fit, {"": refitted})[""]):
            reasons.append(f"the {LAW_REFITTED} alone predicts left-out poses as well")
    instruments = dict[str, str]()
    if not reasons:  # an effect refused anyway needs no vote
        if believed == MACHINE and not as_free:
            rivals = rivals_of_law(task.problem, before.fit)
        else:
            families = others.families(of_instrument=believed == MACHINE)
            likely = {family.name: family.best.candidates for family in families if family.best}
            law_free = others.none.law_free
            rivals = {name: add_effect(task.problem, before.fit, c, law_free) for name, c in likely.items()}
            fit = fit if as_free else refine(task.problem, fit)
        instruments = as_well(task.problem, fit, rivals)
        reasons += mistakable(task, instruments, believed)
    return Support(
        fit.names[j], not reasons, tuple(reasons), percent_of(after.error), percent_of(after.held.mean_error),
        json_number(in_se, 3), json_number(gained), json_number(others.threshold), tuple(instruments),
    )  # fmt: skip


def _law_support(
    task: UpdateTask, after: LadderStep, groups: Sequence[Sequence[Candidate]]
) -> tuple[LadderStep, Support]:
    """Judge the refitted strut law of a step against the same effects with the file's law, one chosen of each group.

    Anew: a gauge that reads too much in one set-up is, beside another law, one that reads too little in the other.
    """
    task.progress("judging the strut law")
    fit, problem = after.fit, task.problem
    given = LadderStep.of(LAW_GIVEN, fitted_with(task, base_fit(problem, law_free=False), groups), task.data)
    differences = votes(problem, fit, {LAW_GIVEN: given.fit})[LAW_GIVEN]
    reasons, instruments = [], dict[str, str]()
    if outvoted(differences):
        instruments = as_well(problem, fit, rivals_of_law(problem, given.fit))
        reasons = mistakable(task, instruments, MACHINE)
    else:
        gain = f"{differences.sum():+.1f} +- {standard_error(differences):.1f} in log probability"
        reasons.append(f"the refitted one gains {gain}, no more than chance")
    gained = 2.0 * (fit.log_posterior - given.fit.log_posterior) / dispersion(fit)
    return given, Support(
        LAW_REFITTED, not reasons, tuple(reasons), percent_of(after.error), percent_of(after.held.mean_error),
        json_number(gain_in_standard_errors(given.held, after.held), 3), json_number(gained), None, tuple(instruments),
    )  # fmt: skip


def as_well(problem: Problem, fit: Fit, rivals: Mapping[str, Fit]) -> dict[str, str]:
    """Rivals that a fit does not outvote -> reading that would tell them apart."""
    against = votes(problem, fit, rivals)
    return {
        name: reading_words(telling(rivals[name].candidates[-1].effect))
        for name, differences in against.items()
        if not outvoted(differences)
    }


def mistakable(task: UpdateTask, rivals: Mapping[str, str], believed: str) -> list[str]:
    """Reason why a machine effect may be an instrument's error, or the reverse; empty if the user has decided."""
    if not rivals or task.believe == believed:
        return []
    kind = "an error of the instrument" if believed == MACHINE else "an effect of the machine"
    tells = joined([f"{tells} would tell {name}" for name, tells in rivals.items()])
    return [
        f"{kind} predicts left-out poses as well: {joined(list(rivals))}; {tells}; "
        f"--believe {believed} (believe='{believed}') takes it for the {believed}'s"
    ]


def next_effect(
    task: UpdateTask, before: LadderStep, field_of: Callable[[UpdateTask, Fit], Field]
) -> tuple[LadderStep | None, list[Support]]:
    """The most likely effect that the data support on top of a step, and the judgement of each effect tried."""
    others, tried = field_of(task, before.fit), list[Support]()
    families = [family for side in (True, False) for family in others.families(of_instrument=side)]
    for family in sorted(families, key=lambda f: (-f.log_evidence, f.name))[:TRIED]:
        task.progress(f"fitting {family.name}")
        candidates = family.best.candidates if family.best else ()  # the choice that is the likeliest by its tables
        step = step_up(task, before, [candidates])
        tried.append(support_of(task, others, before, step.fit, len(step.fit.candidates) - 1, candidates))
        if tried[-1].supported:
            return step, tried
    return None, tried
