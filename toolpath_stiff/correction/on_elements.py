"""Updates of machines of elements by pulls: ladder, judges and result as for hexapods, but without a strut law.

In the law's place are the torsions of the joints that turn, all fitted together: one step, written into the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, ClassVar

from toolpath_stiff.arrays import AnyArray
from toolpath_stiff.correction.additions import parse_addition
from toolpath_stiff.correction.machines import fitted_elements
from toolpath_stiff.correction.result import NEEDED, Update
from toolpath_stiff.correction.steps import LadderStep, Support, dispersion
from toolpath_stiff.correction.task import MACHINE, UpdateTask
from toolpath_stiff.correction.update import (
    MOST_EFFECTS,
    Field,
    as_well,
    fitted_with,
    ladder_of,
    mistakable,
    next_effect,
    support_of,
)
from toolpath_stiff.diagnosis.examination import percent_of
from toolpath_stiff.diagnosis.on_elements import NRAD, fitted_torsions, residual_columns
from toolpath_stiff.documents import Document, json_number, to_dict
from toolpath_stiff.errors import EffectError, InputError
from toolpath_stiff.inference.element_fits import GAIN, JOINTS, PullProblem, explanations, joints_say_more, question
from toolpath_stiff.inference.errors import AS_GIVEN
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.hypotheses import Family
from toolpath_stiff.inference.left_out import gain_in_standard_errors
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.inference.prequential import votes
from toolpath_stiff.inference.votes import outvoted
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.readings.pulls import Pulls
from toolpath_stiff.stiffness.catalogue import known_effects
from toolpath_stiff.stiffness.sizes import joined

FEWEST_POSES = 3
JOINTS_FIRST = "all joints refitted predict pose after pose better (--joints)"


@dataclass(frozen=True, eq=False)
class PullTask(UpdateTask):
    """A task with pulls in place of stiffnesses; `strut_law` asks for the torsions of the joints."""

    machine: MachineTool  # type: ignore[assignment]
    data: Pulls  # type: ignore[assignment]
    pulls: PullProblem | None = None

    @cached_property
    def problem(self) -> PullProblem:
        """Model and scatter."""
        assert self.pulls is not None
        return self.pulls

    @property
    def noise_model(self) -> Noise:
        """Scatter of the readings."""
        return self.problem.noise


class PullField(Field):
    """All candidate effects on top of a fit to pulls."""

    def __init__(self, task: UpdateTask, before: Fit) -> None:
        assert isinstance(task.problem, PullProblem)
        self.problem, self.threshold, self.none = task.problem, GAIN, before
        self.families = cache(self._families)

    @cached_property
    def _fits(self) -> list[Fit]:
        assert isinstance(self.problem, PullProblem)
        return explanations(self.problem, self.none)

    def _families(self, *, of_instrument: bool) -> tuple[Family, ...]:
        last = [(fit.candidates[-1].effect, fit) for fit in self._fits]
        return tuple(
            Family(effect, (), replace(fit, candidates=fit.candidates[-1:]), fit.log_posterior)
            for effect, fit in last
            if effect.is_instrument == of_instrument
        )


def build_pull_ladder(task: PullTask) -> ElementUpdate:
    """Fit the joints and effects to pulls and judge them.

    Raises
    ------
    InputError
        An effect is unknown or holds on hexapods only, nothing turns, or nothing is to be done.
    """
    problem, supports, tried = task.problem, list[Support](), list[Support]()
    if not task.add and not task.strut_law and not task.auto:
        raise InputError("nothing to update", expected="--add EFFECT, --joints or --auto")
    if (poses := int(problem.pulls.pose.max()) + 1) < FEWEST_POSES:
        raise InputError(f"pulls at {poses} poses", expected=f"{FEWEST_POSES} or more, of which each can be left out")
    wanted = [parse_addition(text, problem.pulls, task.effect_files, problem.candidates_of) for text in task.add]
    known = known_effects(task.effect_files, task.machine.kind)
    for (candidate, *_), text in zip(wanted, task.add, strict=True):
        if candidate.name not in known:
            raise EffectError(f"--add {text}: it holds on hexapods only", expected=f"one of {', '.join(known)}")
    steps = [LadderStep.of(AS_GIVEN, problem.none, task.data)]
    if task.auto and joints_say_more(problem, next(iter(explanations(problem, problem.none)), problem.none)):
        task = replace(task, strut_law=True)
    if task.strut_law:
        if not problem.torsions:
            raise InputError(f"machine {task.machine.name} has no joints that turn: nothing to refit")
        task.progress("fitting the torsions of the joints")
        steps.append(LadderStep.of(JOINTS, problem.joints_fitted, task.data))
    start = steps[-1]
    steps += ladder_of(task, start, wanted)
    count, full = len(start.fit.candidates), steps[-1].fit
    for j, candidate in enumerate(full.candidates[count:], count):
        others = [[other] for k, other in enumerate(full.candidates) if k >= count and k != j]
        before = LadderStep.of("", fitted_with(task, start.fit, others), task.data)
        supports.append(support_of(task, PullField(task, before.fit), before, full, j, [candidate]))
    if supports and not task.strut_law and joints_say_more(problem, full):
        supports = [replace(each, supported=False, reasons=(*each.reasons, JOINTS_FIRST)) for each in supports]
    while task.auto and len(steps[-1].fit.candidates) < count + MOST_EFFECTS:
        better, tried = next_effect(task, steps[-1], PullField)
        if better is None:
            break
        steps.append(better)
        supports.append(tried[-1])
        tried = []
    if task.strut_law:  # compared with the same effects on the file's torsions
        others = [[candidate] for candidate in steps[-1].fit.candidates[count:]]
        given = LadderStep.of(AS_GIVEN, fitted_with(task, problem.none, others), task.data)
        supports.insert(0, _support_of_joints(task, given, steps[-1]))
    return ElementUpdate(task, tuple(steps), start, tuple(supports), turned_down=tuple(tried))


def _support_of_joints(task: PullTask, given: LadderStep, fitted: LadderStep) -> Support:
    """Judge the torsions of all joints against the file's, at left-out poses and against instrument errors."""
    in_se, reasons, instruments = gain_in_standard_errors(given.held, fitted.held), list[str](), dict[str, str]()
    if not in_se > NEEDED:
        reasons.append(f"the error at left-out poses falls by {in_se:.1f} standard errors: {NEEDED:g} is needed")
    elif not outvoted(votes(task.problem, fitted.fit, {AS_GIVEN: given.fit})[AS_GIVEN]):
        reasons.append("the file's torsions predict pose after pose as well")
    else:
        families = PullField(task, given.fit).families(of_instrument=True)
        rivals = {family.name: family.best for family in families if family.best}
        instruments = as_well(task.problem, fitted.fit, rivals)
        reasons = mistakable(task, instruments, MACHINE)
    gained = 2.0 * (fitted.fit.log_posterior - given.fit.log_posterior) / dispersion(fitted.fit)
    return Support(
        JOINTS, not reasons, tuple(reasons), percent_of(fitted.error), percent_of(fitted.held.mean_error),
        json_number(in_se, 3), json_number(gained), None, tuple(instruments),
    )  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class ElementUpdate(Update):
    """A machine of elements corrected by pulls, or the reason why not; effects begin from the step `refitted`."""

    shown_by: ClassVar[str] = "update_elements"
    task: PullTask

    @property
    def question(self) -> str:
        """Reason to doubt that these are pulls of this machine; "" if there is none."""
        return question(self.task.problem)

    @property
    def objections(self) -> list[str]:
        """No conditions: pulls are not grouped by any."""
        return []

    @property
    def errors(self) -> None:
        """No error model: bands come from the fitted parameters alone."""

    @property
    def fitted_joints(self) -> dict[str, float]:
        """Joint -> nrad/(N m), if the joints were refitted."""
        problem = self.task.problem
        torsions = fitted_torsions(problem, self.steps[-1].fit) if self.task.strut_law else {}
        return {name: NRAD * value for name, value in torsions.items()}

    @property
    def cause(self) -> str:
        """Words on what was fitted."""
        joints = ", ".join(f"{name} {value:.0f}" for name, value in self.fitted_joints.items())
        parts = [f"the joints turn by, nrad/(N m): {joints}"] if joints else []
        return joined([*parts, *self.steps[-1].fit.findings[len(self.fitted_joints) :]])

    @property
    def added(self) -> Sequence[str]:
        """Names of the effects added."""
        joints = self.fitted_joints
        return [*([JOINTS] if joints else []), *self.steps[-1].fit.names[len(joints) :]]

    def fitted(self, provenance: Document) -> Any:
        """The machine with the last model; `provenance` states its origin."""
        torsions = list(self.fitted_joints.values())
        return fitted_elements(self.task.machine, self.last.fit, provenance, self.widening, torsions)

    def _text_of(self, machine: Any, heading: str) -> str:
        return "".join(f"# {line}\n" for line in heading.splitlines()) + str(machine.text)

    @cached_property
    def document(self) -> Document:
        """Content of update.json."""
        task, problem = self.task, self.task.problem
        return {
            "verdict": self.verdict,
            "text": self.text,
            "steps": [
                {
                    "name": step.name,
                    "effects": list(step.fit.names),
                    "findings": list(step.fit.findings),
                    "parameters": to_dict(step.sizes(self.widening)),
                    "mean_abs_error_percent": percent_of(step.error),
                    "held_out_error_percent": percent_of(step.held.mean_error),
                    "rms_error_percent": json_number(problem.error_percent(step.residual)),
                    "rms_error_at_left_out_poses_percent": json_number(problem.error_percent(step.held.residual)),
                }
                for step in self.steps
            ],
            "support": to_dict(self.supports),
            "rejected": to_dict(self.turned_down),
            "joints_fitted_nrad_per_Nm": self.fitted_joints,
            "noise": {"name": self.noise.name, "origin": self.noise.origin},
            "noise_floor_percent": json_number(self.noise.floor_percent),
            "machine": task.machine.name,
            "machine_file": task.machine_file if self.accepted else None,
            "data": list(task.files),
            "readings": len(task.data),
            "notes": list(task.data.notes),
            "provenance": dict(self.provenance),
            "next": list(self.next),
        }

    def columns(self) -> dict[str, AnyArray]:
        """Column of `residuals.csv` -> values."""
        further = {"after_um": self.last.residual, "left_out_um": self.last.held.residual}
        return residual_columns(self.task.problem, further)
