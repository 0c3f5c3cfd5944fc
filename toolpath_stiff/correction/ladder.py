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

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.correction.machines import fitted_machine
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.diagnosis.diagnose import FEWEST
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.candidates import Candidate, testable_effects
from toolpath_stiff.inference.drawn import Drawn, drawn, seen_readings
from toolpath_stiff.inference.errors import AS_GIVEN, LAW_REFITTED
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import add_effect, base_fit, baseline
from toolpath_stiff.inference.gates import gain_threshold, simulate
from toolpath_stiff.inference.hypotheses import Family, score_families, signatures, tables_of
from toolpath_stiff.inference.left_out import HeldOut, error_falls, gain_in_standard_errors, held_out, of_readings
from toolpath_stiff.inference.noise import Noise, noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.question import question
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.readings.measurements import Measurements
from toolpath_stiff.stiffness.contract import Effect

if TYPE_CHECKING:
    from toolpath_stiff.correction.additions import Addition


NEEDED = 1.0  # standard errors by which the error at left-out points must fall


TRIED = 4  # candidates a step of `--auto`, the most likely first


MOST_EFFECTS = 4  # that `--auto` adds


# Share of the mean error, or of what scatter alone leaves of it, by which it may rise: a likelier strut law can raise
# it a little (9.62 to 9.72 % on the paper's Table 1).
WORSE = 0.05


@dataclass(frozen=True)
class Step:
    """One rung of the ladder: what it is called, its fit to all readings, its errors over those of the tip.

    Attributes
    ----------
    name, fit
        What it is called; its fit, that of loops beside the tip included.
    held
        Of the m readings of the tip at left-out points.
    tip
        (n,) which readings these are.
    """

    name: str
    fit: Fit
    held: HeldOut
    tip: NDArray[np.bool_]

    @classmethod
    def of(cls, name: str, fit: Fit, data: Measurements) -> Step:
        """Of a fit to these data."""
        return cls(name, fit, held_out(fit, data.point).of_readings(data.tip), data.tip)

    @property
    def residual(self) -> FloatArray:
        """(m,) ln measured - ln modelled of the tip."""
        return self.fit.residual[self.tip]

    @property
    def error(self) -> float:
        """Mean of |modelled - measured| / measured over the readings of the tip."""
        return float(of_readings(self.fit, self.tip).errors.mean())


@dataclass(frozen=True)
class Support:
    """Whether the data support an effect.

    Attributes
    ----------
    effect
        Its name.
    gain_in_se
        Fall of the error at left-out points over its standard error; nan where nothing can be left out.
    fall
        That fall, relative.
    error, held_out_error
        Mean errors with it, in sample and at left-out points.
    likelihood_gain, threshold
        Twice the log likelihood gained, in units of the scatter that remains; what chance alone reaches.
    reasons
        Why not, sentences; none if it is supported.
    """

    effect: str
    gain_in_se: float
    fall: float
    error: float
    held_out_error: float
    likelihood_gain: float
    threshold: float
    reasons: tuple[str, ...]

    @property
    def supported(self) -> bool:
        """Whether nothing speaks against it."""
        return not self.reasons


@dataclass(frozen=True)
class Update:
    """What an update did.

    Attributes
    ----------
    machine, data, noise
        What was updated, by what; the largest of the noise models.
    problem
        Model and scatter.
    steps
        The ladder, from the machine file as it stands to the last model.
    refitted
        The strut law refitted alone: the second step, unless the law is kept.
    supports
        Of every effect that was asked for, or that `auto` took.
    turned_down
        Of the effects that `auto` tried last and did not take.
    forced, auto, law_asked
        As asked; whether a refitted strut law alone is an update.
    objective
        "likelihood", or "mean-error" for the paper's own estimation.
    question
        Whether these are readings of this machine, and why it is asked; "" where nothing says that they are not.
    drawn
        How effects stand whose form was read off these readings; None where there are none.
    """

    machine: Machine
    data: Measurements
    noise: Noise
    problem: Problem
    steps: tuple[Step, ...]
    refitted: Step
    supports: tuple[Support, ...]
    turned_down: tuple[Support, ...]
    forced: bool
    auto: bool
    law_asked: bool = False
    objective: str = "likelihood"
    question: str = ""
    drawn: Drawn | None = None

    @property
    def described(self) -> Drawn | None:
        """`drawn`, if new readings have not confirmed it."""
        return None if self.drawn is None or self.drawn.confirmed else self.drawn

    @property
    def last(self) -> Step:
        """The last model of the ladder; the machine file as given where nothing is to be changed."""
        return self.steps[-1] if self.changed else self.steps[0]

    @property
    def changed(self) -> bool:
        """Whether there is something to be written."""
        return bool(self.steps[-1].fit.names) or self.law_asked

    @property
    def worse(self) -> bool:
        """Whether the last model fits worse than the machine as given; such a machine is never written.

        Counted by the mean error, which users see. The fit is by likelihood, which bounds the factor by which readings
        are off, not the difference: where nothing fits, the one can fall while the other multiplies.
        """
        before, after = self.steps[0].error, self.steps[-1].error
        return not after - before <= max(WORSE * before, WORSE * self.noise.floor_percent / 100.0)

    @property
    def supported(self) -> bool:
        """Whether nothing speaks against what is to be changed."""
        return not self.question and all(one.supported for one in self.supports)

    @property
    def accepted(self) -> bool:
        """Whether a machine is to be written."""
        return self.changed and not self.worse and (self.forced or self.supported)

    @property
    def widening(self) -> float:
        """Factor on standard deviations: how much wider the residuals are than the noise model says, at least 1."""
        # A bootstrap over points has the residuals' own width already.
        return float(np.sqrt(dispersion(self.last.fit))) if self.objective == "likelihood" else 1.0

    def fitted(self, provenance: dict[str, object]) -> Machine:
        """The machine with the last model."""
        return fitted_machine(self.machine, self.last.fit, provenance, self.widening, self.data.setup.tolist())


def build_ladder(
    machine: Machine,
    data: Measurements,
    additions: Sequence[Addition] = (),
    *,
    strut_law: bool = False,
    keep_law: bool = False,
    auto: bool = False,
    force: bool = False,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Update:
    """Fit effects to measurements and judge them.

    Parameters
    ----------
    machine, data
        The model and n readings.
    additions
        The effects to be added.
    strut_law
        Write the refitted strut law even if no effect is added.
    keep_law
        Keep the strut law of the machine file; else its two stiffnesses are fitted along with every effect.
    auto
        Go on adding effects while the data support them.
    force
        Keep what the data do not support.
    noise, strut_spread, effect_files, seed, progress
        As in `diagnose`.

    Raises
    ------
    InputError
        Too few readings, an effect named twice or present already, or nothing to do.
    """
    _check(machine, data, additions, strut_law, keep_law, auto)
    say = progress or (lambda text: None)
    # Of several noise models the one with the largest noise, as in a diagnosis.
    worst = max(noise_models(data, noise, strut_spread), key=lambda one: one.typical)
    problem = Problem.of(Predictor(machine, data, effect_files), worst)
    work = _Work(problem, worst, not keep_law, seed, tuple(effect_files), say)
    as_given, law_refitted = baseline(problem)
    steps = [work.step(AS_GIVEN, as_given)]
    refitted = work.step(LAW_REFITTED, law_refitted)
    if not keep_law:
        steps.append(refitted)
    asked = [addition.candidates(data) for addition in additions]
    steps += work.ladder(steps[-1], asked)
    names = [candidates[0].name for candidates in asked]
    supports = tuple(
        work.support(work.without(steps[-1], j), steps[-1].fit, j, asked[names.index(name)])
        for j, name in enumerate(steps[-1].fit.names)
    )
    turned_down: tuple[Support, ...] = ()
    while auto and len(steps[-1].fit.candidates) < MOST_EFFECTS:
        better, tried = work.next_effect(steps[-1])
        if better is None:
            turned_down = tried
            break
        steps.append(better)
        supports = (*supports, tried[-1])
    return Update(
        machine, data, worst, problem, tuple(steps), refitted, supports, turned_down, force, auto, strut_law,
        question=question(problem.predictor), drawn=work.drawn(steps[-1]),
    )  # fmt: skip


def _check(
    machine: Machine, data: Measurements, additions: Sequence[Addition], strut_law: bool, keep_law: bool, auto: bool
) -> None:
    if strut_law and keep_law:
        raise InputError("--strut-law and --keep-strut-law", expected="one of them")
    if not additions and not strut_law and not auto:
        raise InputError("nothing to update", expected="--add EFFECT, --strut-law or --auto")
    lacking = int(np.isnan(data.stiffness).sum())
    if len(data) < FEWEST or lacking:
        raise InputError(
            f"{len(data)} readings, {lacking} without a stiffness",
            expected=f"at least {FEWEST} measured stiffnesses to update from",
        )
    names = [addition.effect.name for addition in additions]
    present = {entry.name for entry in (*machine.effects, *machine.instruments)}
    if np.isfinite(machine.platform_bar_stiffness):
        present.add("platform_flexibility")
    for name in names:
        if names.count(name) > 1 or name in present:
            found = "is given twice" if names.count(name) > 1 else f"is in machine {machine.name} already"
            raise InputError(f"--add {name}: the effect {found}", hint="a machine carries an effect once")


def _falls(before: Step, after: Step) -> bool:
    """Whether the mean error falls, in sample and at left-out points."""
    return after.error < before.error and not after.held.mean_error >= before.held.mean_error


def dispersion(fit: Fit) -> float:
    """Weighted squares of a fit over their degrees of freedom, at least 1."""
    squares = float(fit.scatter.precision.squares(fit.residual))
    fitted = len(fit.free) + (2 if fit.law_free else 0)
    return max(1.0, squares / max(len(fit.residual) - fitted, 1))


@dataclass(frozen=True)
class _Field:
    """All candidates on a machine: the problem, its base model, the effects, the gain that chance alone reaches."""

    problem: Problem
    base: Fit
    effects: tuple[Effect, ...]
    threshold: float

    @cached_property
    def families(self) -> list[Family]:
        """The effects, the most likely first."""
        return score_families(self.problem, self.effects, self.base)


class _Work:
    """What one update passes from step to step."""

    def __init__(
        self,
        problem: Problem,
        noise: Noise,
        law_free: bool,
        seed: int,
        effect_files: tuple[str | Path, ...],
        say: Callable[[str], None],
    ) -> None:
        self.problem, self.noise, self.law_free, self.seed = problem, noise, law_free, seed
        self.effect_files, self.say = effect_files, say
        self.data = problem.predictor.data
        self.fields: dict[tuple[str, ...], _Field] = {}

    def step(self, name: str, fit: Fit) -> Step:
        return Step.of(name, fit, self.data)

    def added(self, before: Step, candidates: Sequence[Candidate]) -> Step:
        """A rung higher."""
        fit = add_effect(self.problem, before.fit, candidates, self.law_free)
        return self.step(f"+ {fit.candidates[-1].label}", fit)

    def ladder(self, start: Step, asked: Sequence[Sequence[Candidate]]) -> list[Step]:
        """Steps that add the effects asked for, each lower than the one before; one step if no order does."""
        rest, steps = list(asked), [start]
        while rest:
            self.say(f"fitting {', '.join(candidates[0].name for candidates in rest)}")
            trials = [self.added(steps[-1], candidates) for candidates in rest]
            best = min(range(len(rest)), key=lambda k: trials[k].error)
            if len(asked) > 1 and not _falls(steps[-1], trials[best]):
                return [self.together(start, asked)]
            steps.append(trials[best])
            rest.pop(best)
        return steps[1:]

    def together(self, before: Step, asked: Sequence[Sequence[Candidate]]) -> Step:
        """Several effects as one step."""
        fit = before.fit
        for candidates in asked:
            fit = add_effect(self.problem, fit, candidates, self.law_free)
        labels = [candidate.label for candidate in fit.candidates[-len(asked) :]]
        return self.step(f"+ {' + '.join(labels)}", fit)

    def without(self, full: Step, j: int) -> Step:
        """The model with all effects but one, fitted again."""
        fit = base_fit(self.problem, self.law_free)
        for k, candidate in enumerate(full.fit.candidates):
            if k != j:
                fit = add_effect(self.problem, fit, [candidate], self.law_free)
        return self.step("", fit)

    def drawn(self, full: Step) -> Drawn | None:
        """How the effects stand that were drawn from the readings, against the model without them."""
        seen = [seen_readings([c.effect], self.data).any() for c in full.fit.candidates]
        if not any(seen):
            return None
        fit = base_fit(self.problem, self.law_free)
        for candidate, was in zip(full.fit.candidates, seen, strict=True):
            if not was:
                fit = add_effect(self.problem, fit, [candidate], self.law_free)
        return drawn(full.fit, {" + ".join(fit.names) or "none": fit}, self.data)

    def field(self, others: Fit) -> _Field:
        """What an effect is judged against on a machine that carries the other effects."""
        key = tuple(candidate.label for candidate in others.candidates)
        if key not in self.fields:
            self.say("searching all effects for what chance alone would gain")
            machine = self.problem.predictor.machine
            carrying = fitted_machine(machine, others, {"command": "", "data_sha256": ""})
            problem = Problem.of(Predictor(carrying, self.data, self.effect_files), self.noise)
            base = problem.score_base()
            effects, _ = testable_effects(problem.predictor)
            tables = [table for effect in effects for table in tables_of(problem, effect)]
            draws = simulate(self.noise, problem.scatter.covariance, self.seed)
            threshold = gain_threshold(problem, base.jacobian, draws, signatures(problem, tables))
            self.fields[key] = _Field(problem, base, effects, threshold)
        return self.fields[key]

    def support(self, before: Step, fit: Fit, j: int, candidates: Sequence[Candidate]) -> Support:
        """Judge effect j of a fit against the model with the other effects."""
        name, after = fit.names[j], self.step("", fit)
        fall = float(error_falls(before.held, after.held).mean())
        in_se = gain_in_standard_errors(before.held, after.held)
        field = self.field(before.fit)
        problem, threshold = field.problem, field.threshold
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
        return Support(name, in_se, fall, after.error, after.held.mean_error, gained, threshold, tuple(reasons))

    def next_effect(self, before: Step) -> tuple[Step | None, tuple[Support, ...]]:
        """The most likely effect that the data support on top of a step, and the supports of all that were tried."""
        families = self.field(before.fit).families
        tried: list[Support] = []
        for family in [f for f in families if f.best is not None][:TRIED]:
            self.say(f"fitting {family.name}")
            candidates = [table.candidate for table in family.tables]
            step = self.added(before, candidates)
            tried.append(self.support(before, step.fit, len(step.fit.candidates) - 1, candidates))
            if tried[-1].supported:
                return step, tuple(tried)
        return None, tuple(tried)
