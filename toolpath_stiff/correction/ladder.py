"""Update a machine: fit the effects that a user names (or that the data ask for), and judge whether data support them.

Everything starts from the machine file as given and then from its strut law refitted, which every effect is added to
unless the law is kept. Effects that are given together are steps in the order in which each lets the error fall; where
there is no such order, they are one step.

An effect is supported if

- the error at left-out points falls by more than one standard error of that fall, paired by point;
- no parameter ends at its upper bound, and not all end at zero;
- its gain in likelihood, the strut law refitted with and without it, is more than the best of all candidates reaches
  by chance in one campaign of twenty: the relative gate of the diagnosis. The gain is counted in units of the scatter
  that remains, so that data which no effect explains do not lend every effect significance.

Of several effects each is judged beside the others.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from toolpath_stiff.correction.additions import parse_addition
from toolpath_stiff.correction.machines import fitted_machine
from toolpath_stiff.correction.result import Update
from toolpath_stiff.correction.steps import LadderStep, Support, dispersion
from toolpath_stiff.correction.task import UpdateTask
from toolpath_stiff.correction.words import NEEDED
from toolpath_stiff.diagnosis.diagnose import FEWEST
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.candidates import Candidate, testable_effects
from toolpath_stiff.inference.doubts import question
from toolpath_stiff.inference.drawn import Drawn, drawn, seen_readings
from toolpath_stiff.inference.errors import AS_GIVEN, LAW_REFITTED
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import add_effect, base_fit, baseline
from toolpath_stiff.inference.gates import gain_threshold, simulate
from toolpath_stiff.inference.hypotheses import score_families, signatures, tables_of
from toolpath_stiff.inference.left_out import gain_in_standard_errors
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.stiffness.contract import Effect

TRIED = 4  # candidates a step of `--auto`, the most likely first
MOST_EFFECTS = 4  # that `--auto` adds


def build_ladder(task: UpdateTask) -> Update:
    """Fit effects to measurements and judge them.

    Raises
    ------
    InputError
        Too few readings, an effect unknown, named twice or present already, or nothing to do.
    """
    wanted = [parse_addition(text, task.data, task.effect_files) for text in task.add]
    _check(task, [candidates[0].name for candidates in wanted])
    noise, problem = task.problem()
    work = _Work(task, problem, noise)
    as_given, law_refitted = baseline(problem)
    steps, refitted = [work.step(AS_GIVEN, as_given)], work.step(LAW_REFITTED, law_refitted)
    if work.law_free:
        steps.append(refitted)
    steps += work.ladder(steps[-1], wanted)
    full, by_name = steps[-1].fit, {candidates[0].name: candidates for candidates in wanted}
    supports = tuple(work.support(work.without(full, j), full, j, by_name[name]) for j, name in enumerate(full.names))
    turned_down: tuple[Support, ...] = ()
    while task.auto and len(steps[-1].fit.candidates) < MOST_EFFECTS:
        better, tried = work.next_effect(steps[-1])
        if better is None:
            turned_down = tried
            break
        steps.append(better)
        supports = (*supports, tried[-1])
    return Update(
        task, noise, problem, tuple(steps), refitted, supports, turned_down, question(problem.predictor),
        work.drawn(steps[-1].fit),
    )  # fmt: skip


def _check(task: UpdateTask, names: Sequence[str]) -> None:
    if not names and not task.strut_law and not task.auto:
        raise InputError("nothing to update", expected="--add EFFECT, --strut-law or --auto")
    lacking = int(np.isnan(task.data.stiffness).sum())
    if len(task.data) < FEWEST or lacking:
        raise InputError(
            f"{len(task.data)} readings, {lacking} without a stiffness",
            expected=f"at least {FEWEST} measured stiffnesses to update from",
        )
    present = [entry.name for entry in (*task.machine.effects, *task.machine.instruments)]
    if np.isfinite(task.machine.platform_bar_stiffness):
        present.append("platform_flexibility")
    for k, name in enumerate(names):
        if name in (*present, *names[:k]):
            raise InputError(
                f"--add {name}: given twice, or in machine {task.machine.name} already",
                hint="a machine carries an effect once",
            )


@dataclass(frozen=True)
class _Field:
    """All candidates on a machine: the problem, its base model, the effects, the gain that chance alone reaches."""

    problem: Problem
    base: Fit
    effects: tuple[Effect, ...]
    threshold: float


@dataclass
class _Work:
    """What one update passes from step to step."""

    task: UpdateTask
    problem: Problem
    noise: Noise
    fields: dict[tuple[str, ...], _Field] = field(default_factory=dict)

    @property
    def law_free(self) -> bool:
        return not self.task.keep_strut_law

    def step(self, name: str, fit: Fit) -> LadderStep:
        return LadderStep.of(name, fit, self.task.data)

    def fitted(self, fit: Fit, groups: Iterable[Sequence[Candidate]]) -> Fit:
        """A fit with one effect of each group on top."""
        for candidates in groups:
            fit = add_effect(self.problem, fit, candidates, self.law_free)
        return fit

    def together(self, before: LadderStep, groups: Sequence[Sequence[Candidate]]) -> LadderStep:
        """A rung higher: one effect, or several as one step."""
        fit = self.fitted(before.fit, groups)
        return self.step(f"+ {' + '.join(candidate.label for candidate in fit.candidates[-len(groups) :])}", fit)

    def ladder(self, start: LadderStep, wanted: Sequence[Sequence[Candidate]]) -> list[LadderStep]:
        """Steps that add the effects asked for, each lower than the one before; one step if no order does."""
        rest, steps = list(wanted), [start]
        while rest:
            self.task.progress(f"fitting {', '.join(candidates[0].name for candidates in rest)}")
            trials = [self.together(steps[-1], [candidates]) for candidates in rest]
            best = min(range(len(rest)), key=lambda k: trials[k].error)
            lower = trials[best].error < steps[-1].error
            if len(wanted) > 1 and (not lower or trials[best].held.mean_error >= steps[-1].held.mean_error):
                return [self.together(start, wanted)]
            steps.append(trials[best])
            rest.pop(best)
        return steps[1:]

    def without(self, full: Fit, j: int) -> LadderStep:
        """The model with all effects but one, fitted again."""
        others = [[candidate] for k, candidate in enumerate(full.candidates) if k != j]
        return self.step("", self.fitted(base_fit(self.problem, self.law_free), others))

    def drawn(self, full: Fit) -> Drawn | None:
        """How the effects stand that were drawn from the readings, against the model without them."""
        others = [[c] for c in full.candidates if not seen_readings([c.effect], self.task.data).any()]
        if len(others) == len(full.candidates):
            return None
        fit = self.fitted(base_fit(self.problem, self.law_free), others)
        return drawn(full, {" + ".join(fit.names) or "none": fit}, self.task.data)

    def field(self, others: Fit) -> _Field:
        """What an effect is judged against on a machine that carries the other effects."""
        key = tuple(candidate.label for candidate in others.candidates)
        if key not in self.fields:
            self.task.progress("searching all effects for what chance alone would gain")
            carrying = fitted_machine(self.problem.predictor.machine, others, {"command": "", "data_sha256": ""})
            problem = Problem.of(Predictor(carrying, self.task.data, self.task.effect_files), self.noise)
            base, effects = problem.score_base(), testable_effects(problem.predictor)[0]
            tables = [table for effect in effects for table in tables_of(problem, effect)]
            draws = simulate(self.noise, problem.scatter.covariance, self.task.seed)
            threshold = gain_threshold(problem, base.jacobian, draws, signatures(problem, tables))
            self.fields[key] = _Field(problem, base, effects, threshold)
        return self.fields[key]

    def support(self, before: LadderStep, fit: Fit, j: int, candidates: Sequence[Candidate]) -> Support:
        """Judge effect j of a fit against the model with the other effects."""
        name, after = fit.names[j], self.step("", fit)
        in_se = gain_in_standard_errors(before.held, after.held)
        others = self.field(before.fit)
        problem, threshold = others.problem, others.threshold
        none = base_fit(problem, law_free=True)
        alone = add_effect(problem, none, candidates, law_free=True)
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
        if gained <= threshold:
            reasons.append(
                f"twice the log likelihood rises by {gained:.1f}: the best of all candidates gains {threshold:.1f} by "
                "chance once in twenty campaigns"
            )
        return Support(name, in_se, after.error, after.held.mean_error, gained, threshold, tuple(reasons))

    def next_effect(self, before: LadderStep) -> tuple[LadderStep | None, tuple[Support, ...]]:
        """The most likely effect that the data support on top of a step, and the supports of all that were tried."""
        others, tried = self.field(before.fit), list[Support]()
        families = score_families(others.problem, others.effects, others.base)
        for family in [f for f in families if f.best is not None][:TRIED]:
            self.task.progress(f"fitting {family.name}")
            candidates = [table.candidate for table in family.tables]
            step = self.together(before, [candidates])
            tried.append(self.support(before, step.fit, len(step.fit.candidates) - 1, candidates))
            if tried[-1].supported:
                return step, tuple(tried)
        return None, tuple(tried)
