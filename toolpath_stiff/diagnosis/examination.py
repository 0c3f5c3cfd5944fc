"""Findings of a diagnosis: judgements under each noise model, fits, errors held out; a row for each hypothesis."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import zip_longest
from typing import Any, ClassVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.loop_readings import LoopMean
from toolpath_stiff.defaults import NORMAL_95
from toolpath_stiff.documents import DIGITS, Document, json_number
from toolpath_stiff.hints import Asked
from toolpath_stiff.inference.candidates import Component
from toolpath_stiff.inference.drawn import Drawn
from toolpath_stiff.inference.errors import AS_GIVEN, error_figures
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.hypotheses import Family, averaged_interval
from toolpath_stiff.inference.judgement import ADEQUATE, FALSE_ALARM, NONE, OUTSIDE, Judgement, shortened
from toolpath_stiff.inference.left_out import HeldOut, gain_in_standard_errors
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.inference.nuisances import fitted_nuisances
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.rivals import entries, lowers_error
from toolpath_stiff.inference.slips import SuspectEntry
from toolpath_stiff.inference.unexcluded import Unexcluded
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.planning.result import PlanRow
from toolpath_stiff.portrait.alike import Alike
from toolpath_stiff.portrait.portrait import Portrait
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.results import DataFrame, FolderResult, frame_of
from toolpath_stiff.stiffness.sizes import joined

NAMING = ("identified", "described")  # verdicts that give one explanation as the answer
SHOWN = 0.005  # probability below which a hypothesis is ruled out, and printed as "< 0.5 %"
TOUCHES = 0.01  # of an interval's length: an end this close to a bound counts as at the bound


@dataclass(frozen=True)
class FittedSize:
    """A parameter's value, its unit and 95 % interval; None stands for infinite."""

    value: float | None
    unit: str
    interval: tuple[float | None, float | None]


@dataclass(frozen=True)
class HypothesisRow:
    """A hypothesis, its figures rounded as in documents; None for a figure it does not have.

    Attributes
    ----------
    name, label
        Effects as "a + b", `none`, "as given", "outside the catalogue"; the same with what they act on.
    standing
        Whether it is left standing.
    title, finding
        In general, and with the fitted sizes; "" where there is no effect.
    probability, log_evidence, words
        Against all others; above that of no effect; in words.
    sizes, choice
        Effect -> key -> size; effect -> what it acts on.
    adequate, adequate_probability
        Whether it leaves no more than noise would, and how often noise leaves as much.
    eligible, remark
        Whether it is offered as an explanation, and why not.
    """

    name: str
    label: str
    standing: bool = False
    title: str = ""
    finding: str = ""
    probability: float | None = None
    log_evidence: float | None = None
    words: str = ""
    sizes: Mapping[str, Mapping[str, FittedSize]] = field(default_factory=dict)
    choice: Mapping[str, Document] = field(default_factory=dict)
    mean_abs_error_percent: float | None = None
    held_out_error_percent: float | None = None
    held_out_rms_percent: float | None = None
    held_out_gain_in_se: float | None = None
    adequate: bool | None = None
    adequate_probability: float | None = None
    eligible: bool = True
    remark: str = ""

    @property
    def offered(self) -> bool:
        """True if it may be relied on."""
        return self.eligible or self.standing


@dataclass(frozen=True)
class HypothesisRows:
    """All hypotheses; pairs and candidates sorted, the likeliest first. `best`: the explanation that is reported."""

    as_given: HypothesisRow
    refitted: HypothesisRow
    outside: HypothesisRow
    pairs: tuple[HypothesisRow, ...]
    candidates: tuple[HypothesisRow, ...]
    best: HypothesisRow | None


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(FolderResult):
    """Verdict on the physical effect that the model lacks, if any, with its grounds; arrays in SI.

    Attributes
    ----------
    verdict
        Common to all noise models; see `inference.judgement`.
    judgements
        Name of the noise model -> judgement. The one that is written out in full is `main`.
    main
        The judgement of the measured or stated noise, else of the high guess.
    data, machine
        What was diagnosed.
    cannot_test
        Effect -> missing columns; empty where nothing in these data depends on the effect.
    as_given, base, fits
        The machine file as it stands; its strut law refitted; effect or "a + b" -> final fit of all that were offered.
    held_out_base, held_out
        Errors at left-out points.
    names, seed, line, asked, inputs
        For the record, and for the commands that go on from here: names of the measurement files, the command; files
        that were read.
    next_measurements, remarks
        Where the verdict is `ambiguous`: rows of a plan that would tell the explanations apart; what it cannot do.
        Where it is `described`: of a plan that would confirm it.
    path
        How much the choice between the explanations matters on a program (`choice_on_path`); None where there is none.
    portrait
        What the missing thing looks like (`portrait_of`); None where nothing is missing or left behind.
    alike
        Named effect -> what else would look the same in its place (`with_alike`).
    unexcluded
        How far each further effect may go beside the likeliest explanation.
    suspects
        Rows that look mistyped; `data` no longer holds those that are clear.
    loops
        Readings of indicators beside the tip against the likeliest explanation. Everything above with an entry a
        reading is of those of the tip.
    """

    command: ClassVar[str] = "diagnose"
    shown_by: ClassVar[str] = "diagnose"

    verdict: str
    judgements: dict[str, Judgement]
    main: Judgement
    data: Readings
    machine: Hexapod
    cannot_test: dict[str, tuple[str, ...]]
    as_given: Fit
    base: Fit
    fits: dict[str, Fit]
    held_out_base: HeldOut
    held_out: dict[str, HeldOut]
    names: tuple[str, ...]
    seed: int
    line: str = ""
    asked: Asked | None = None
    next_measurements: tuple[PlanRow, ...] = ()
    remarks: tuple[str, ...] = ()
    path: Document | None = None
    portrait: Portrait | None = None
    alike: Mapping[str, Alike] = field(default_factory=dict)
    unexcluded: tuple[Unexcluded, ...] = ()
    suspects: tuple[SuspectEntry, ...] = ()
    loops: tuple[LoopMean, ...] = ()
    inputs: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Content of diagnose.json."""
        return dict(self.view.document(self))

    def to_frame(self) -> DataFrame:
        """Candidates, one a row: probability, errors, reason for not being offered."""
        return frame_of(self.to_dict()["candidates"])

    def _short(self) -> str:
        return f"{self.verdict}: {', '.join(self.plausible)}" if self.plausible else self.verdict

    @property
    def noise(self) -> Noise:
        """Noise model of `main`."""
        return self.main.noise

    @property
    def predictor(self) -> Predictor:
        """Model predictions for the data."""
        return self.main.problem.predictor

    @cached_property
    def explanations(self) -> tuple[str, ...]:
        """Hypotheses left standing, the most likely first: effects, `none`, "a + b"; a single one if it is the answer.

        Of several noise models by turns, as many entries as of one.
        """
        most = 1 if self.verdict in NAMING else None
        turns = zip_longest(*(judgement.explanations[:most] for judgement in self.judgements.values()))
        standing = tuple(dict.fromkeys(name for turn in turns for name in turn if name))
        return standing if len(self.judgements) == 1 else shortened(self.main.problem, self._standing_fits, standing)

    @property
    def plausible(self) -> list[str]:
        """Names of the effects in `explanations`, each once."""
        return [*dict.fromkeys(name for explanation in self.explanations for name in explanation.split(" + "))]

    @property
    def entries(self) -> list[tuple[str, ...]]:
        """Explanations, grouped where they sit at one place and these readings could not tell them apart."""
        return entries(self.main.problem, self._standing_fits, self.explanations)

    @property
    def beside(self) -> list[Unexcluded]:
        """Effects outside the explanations that may be present beside the likeliest one, at a size that matters."""
        return [hidden for hidden in self.unexcluded if hidden.matters and hidden.effect.name not in self.plausible]

    @property
    def _standing_fits(self) -> dict[str, Fit]:
        bests = {family.name: family.best for family in self.main.families if family.best is not None}
        return {NONE: self.main.base} | bests | self.main.fits

    @cached_property
    def best(self) -> str | None:
        """Name of the best explanation by an effect or a pair; None if there is none.

        The likeliest, of equals the one with more evidence; what lowers no error at left-out points is none. Those that
        are left standing come first.
        """
        names = [*self.explanations, *(name for name, weight in self.main.likely if weight > 0.0)]
        names += [family.name for family in self.main.families]
        return next((name for name in names if name in self.fits and self._answers(name)), None)

    def _answers(self, name: str) -> bool:
        """True if an explanation has a size other than zero and lowers the error at left-out points."""
        there = any(size.any() for size in self.fits[name].sizes)
        return there and lowers_error(self.held_out_base, self.held_out[name])

    @cached_property
    def nuisances(self) -> list[Document]:
        """Deviations of struts and joints fitted with the likeliest explanation, the most conspicuous first.

        Of the model alone where nothing is missing.
        """
        fit = self.main.base if self.verdict == "adequate" else self.main.likeliest
        return fitted_nuisances(fit, self.main.noise)

    @property
    def likeliest(self) -> Fit:
        """Fit of the best explanation; if there is none, of the strut law alone."""
        return self.base if self.best is None else self.fits[self.best]

    @property
    def after(self) -> FloatArray:
        """(n,) residuals of the best explanation; if there is none or none is needed, of the refitted strut law."""
        return self.base.residual if self.verdict == "adequate" else self.likeliest.residual

    @property
    def unconfirmed(self) -> Drawn | None:
        """Status of an answer that is only `described`, under the noise model that confirms it least."""
        drawn = (judgement.drawn for judgement in self.judgements.values() if judgement.verdict == "described")
        return next(filter(None, drawn), None)

    @cached_property
    def rows(self) -> HypothesisRows:
        """All hypotheses with their figures, in shop units."""
        main, likely = self.main, self.main.probability
        error = percent_of(float(self.as_given.errors.mean()))  # nothing fitted: leaving points out has no effect
        refitted = replace(_row(self, NONE, main.base.log_evidence), held_out_gain_in_se=None)
        families = sorted(main.families, key=lambda f: (-likely.get(f.name, 0.0), -f.log_evidence, f.name))
        candidates = [_candidate(self, family) for family in families]
        tried = [pair for pair in main.pairs if pair.name in self.fits and pair.name in main.gates]
        pairs = [_row(self, pair.name, pair.log_evidence) for pair in tried]
        pairs.sort(key=lambda row: (-(row.probability or 0.0), -(row.log_evidence or 0.0)))
        every = [*candidates, *pairs]
        offered = max((row for row in every if row.offered), key=lambda row: row.probability or 0.0, default=None)
        as_given = HypothesisRow(AS_GIVEN, AS_GIVEN, title="the machine file as it stands")
        outside = HypothesisRow(OUTSIDE, OUTSIDE, title="a smooth unknown")
        return HypothesisRows(
            replace(as_given, mean_abs_error_percent=error, held_out_error_percent=error),
            replace(refitted, label="strut law refitted (none)", title="no further effect"),
            replace(outside, probability=json_number(likely.get(OUTSIDE, 0.0))),
            tuple(pairs), tuple(candidates), next((row for row in every if row.name == self.best), offered),
        )  # fmt: skip


def _row(diagnosis: Diagnosis, name: str, log_evidence: float) -> HypothesisRow:
    """A hypothesis with its final fit; with that of the model alone if its effect fits best when absent."""
    main, base = diagnosis.main, diagnosis.held_out_base
    fit, held = diagnosis.fits.get(name, diagnosis.base), diagnosis.held_out.get(name, base)
    if not any(size.any() for size in fit.sizes):
        fit, held = diagnosis.base, base
    labels = {candidate.name: candidate.label for candidate in fit.candidates}
    gate, alone = main.gates.get(name), main.base_gate.probability > FALSE_ALARM
    return HypothesisRow(
        name,
        " + ".join(labels.get(effect, effect) for effect in name.split(" + ")),
        name in diagnosis.explanations,
        finding=joined(fit.findings) if fit.findings else "",
        probability=json_number(main.probability.get(name, 0.0)),
        log_evidence=json_number(log_evidence - main.base.log_evidence),
        words=row_words(diagnosis, name),
        sizes=fitted_sizes(fit, next((family for family in main.families if family.name == name), None)),
        choice={candidate.name: dict(candidate.choice) for candidate in fit.candidates},
        mean_abs_error_percent=percent_of(float(fit.errors.mean())),
        held_out_error_percent=percent_of(held.mean_error),
        held_out_rms_percent=percent_of(held.rms),
        held_out_gain_in_se=0.0 if held is base else json_number(gain_in_standard_errors(base, held), 3),
        adequate=alone if gate is None else gate.probability > ADEQUATE,
        adequate_probability=None if gate is None else json_number(gate.probability, 3),
    )


def _candidate(diagnosis: Diagnosis, family: Family) -> HypothesisRow:
    """A single effect; without sizes if it fits best when absent."""
    name, alone = family.name, diagnosis.main.base_gate.probability > FALSE_ALARM
    row = replace(_row(diagnosis, name, family.log_evidence), title=family.effect.title)
    if not row.sizes:
        return replace(row, adequate=alone, eligible=False, remark="fits best when it is absent")
    bounded = diagnosis.fits[name].at_upper_bound()
    remark = "" if name in diagnosis.main.gates or alone else "not tested further"
    return replace(row, eligible=not bounded, remark=f"{', '.join(bounded)} at its bound" if bounded else remark)


def row_words(diagnosis: Diagnosis, name: str) -> str:
    """Words on how a hypothesis stands: by its odds against the likeliest, unless a gate has settled it."""
    main = diagnosis.main
    probability = main.probability.get(name, 0.0)
    if main.base_gate.probability > FALSE_ALARM:
        return "enough" if name == NONE else "no more than chance" if probability >= SHOWN else "not needed"
    gate = main.base_gate if name == NONE else main.gates.get(name)
    if probability < SHOWN and gate is not None and gate.probability <= (FALSE_ALARM if name == NONE else ADEQUATE):
        return "does not fit"
    words = odds_words(probability, max(main.probability.values(), default=0.0))
    return "closest" if words == "best" and main.verdict == "unexplained" else words


def odds_words(probability: float, best: float) -> str:
    """Words on a hypothesis against the likeliest, by twice the logarithm of the odds (RadVel's wording)."""
    if probability < SHOWN:
        return "ruled out"
    twice = 2.0 * float(np.log(best / probability))
    limits = ((0.0, "best"), (2.0, "nearly indistinguishable"), (4.0, "somewhat disfavoured"))
    return next((words for limit, words in limits if twice < limit or twice <= 0.0), "strongly disfavoured")


def fitted_sizes(fit: Fit, family: Family | None = None, widening: float = 1.0) -> dict[str, dict[str, FittedSize]]:
    """Effect -> key -> value, unit, 95 % interval for all effects of a fit; standard deviations times `widening`."""
    sizes: dict[str, dict[str, FittedSize]] = {candidate.name: {} for candidate in fit.candidates}
    owners = [candidate.name for candidate in fit.candidates for _ in candidate.components]
    for index, (owner, (component, size)) in enumerate(zip(owners, fit.parts, strict=True)):
        ends = [component.value(end) for end in interval(fit, index, component, size, family, widening)]
        value, low, high = (json_number(x / component.parameter.si) for x in (component.value(size), *sorted(ends)))
        sizes[owner][component.parameter.key] = FittedSize(value, component.parameter.unit, (low, high))
    return sizes


def interval(
    fit: Fit, index: int, component: Component, size: float, family: Family | None, widening: float
) -> tuple[float, float]:
    """95 % interval of a size, within the bounds.

    Averaged over subsets of components where there are several, else normal.
    """
    low_bound, high_bound = component.bounds
    best = family.best if family is not None else None
    averaged = None if family is None else averaged_interval(family, index)
    if index in fit.free:
        reach = NORMAL_95 * widening * fit.deviation(index)
        low, high = (-reach, reach) if averaged is None or best is None else averaged - float(best.sizes[0][index])
        low, high = size + min(float(low), 0.0), size + max(float(high), 0.0)
        near = TOUCHES * (high - low)
        return low_bound if low - low_bound < near else low, high_bound if high_bound - high < near else high
    pull, deviation = fit.absent.get(index, (0.0, 0.0))
    upper = max(pull, 0.0) + NORMAL_95 * deviation
    if averaged is not None:
        upper = max(upper, float(averaged[1]))
    return max(0.0, low_bound), min(upper, high_bound)


def percent_of(share: float, digits: int = DIGITS) -> float | None:
    """A share in per cent, rounded as in documents."""
    return json_number(100.0 * share, digits)


def rounded_errors(residual: FloatArray) -> dict[str, float | None]:
    """`error_figures`, rounded as in documents."""
    figures: Document = error_figures(residual)
    return {name: json_number(value) for name, value in figures.items()}


def held_errors(held: HeldOut) -> dict[str, float | None]:
    """Errors at left-out points, rounded as in documents."""
    return {"held_out_error_percent": percent_of(held.mean_error), "held_out_rms_percent": percent_of(held.rms)}
