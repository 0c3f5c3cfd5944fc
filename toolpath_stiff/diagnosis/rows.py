"""What became of each hypothesis, in shop units: a row each, for documents, tables and pictures alike."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.defaults import NORMAL_95
from toolpath_stiff.diagnosis.examination import Examination
from toolpath_stiff.documents import DIGITS, json_number
from toolpath_stiff.inference.candidates import Component
from toolpath_stiff.inference.errors import AS_GIVEN, error_figures
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.hypotheses import Family, averaged_interval
from toolpath_stiff.inference.judgement import ADEQUATE, FALSE_ALARM, NONE, OUTSIDE
from toolpath_stiff.inference.left_out import HeldOut, gain_in_standard_errors
from toolpath_stiff.stiffness.sizes import joined

SHOWN = 0.005  # probability below which a hypothesis is ruled out, and printed as "< 0.5 %"


TOUCHES = 0.01  # of an interval's length from a bound: it reaches to the bound


@dataclass(frozen=True)
class FittedSize:
    """A parameter's value, its unit and 95 % interval; None stands for infinite."""

    value: float | None
    unit: str
    interval: tuple[float | None, float | None]


@dataclass(frozen=True)
class HypothesisRow:
    """A hypothesis: figures rounded as documents have them, None where there is none.

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
    choice: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
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
        """Whether it may be relied on."""
        return self.eligible or self.standing


@dataclass(frozen=True)
class HypothesisRows:
    """All hypotheses; pairs and candidates with the likeliest first. `best`: the explanation that is written about."""

    as_given: HypothesisRow
    refitted: HypothesisRow
    outside: HypothesisRow
    pairs: tuple[HypothesisRow, ...]
    candidates: tuple[HypothesisRow, ...]
    best: HypothesisRow | None


def rows_of(diagnosis: Examination) -> HypothesisRows:
    """The rows of a diagnosis."""
    main = diagnosis.main
    # Nothing is fitted: leaving points out changes nothing.
    error, title = percent_of(float(diagnosis.as_given.errors.mean())), "the machine file as it stands"
    as_given = HypothesisRow(
        AS_GIVEN, AS_GIVEN, title=title, mean_abs_error_percent=error, held_out_error_percent=error
    )
    refitted = replace(
        _row(diagnosis, NONE, main.base.log_evidence),
        label="strut law refitted (none)", title="no further effect", held_out_gain_in_se=None,
    )  # fmt: skip
    likely = main.probability
    chance = json_number(likely.get(OUTSIDE, 0.0))
    families = sorted(main.families, key=lambda f: (-likely.get(f.name, 0.0), -f.log_evidence, f.name))
    candidates = [_candidate(diagnosis, family) for family in families]
    tried = [pair for pair in main.pairs if pair.name in diagnosis.fits and pair.name in main.gates]
    pairs = [_row(diagnosis, pair.name, pair.log_evidence) for pair in tried]
    pairs.sort(key=lambda row: (-(row.probability or 0.0), -(row.log_evidence or 0.0)))
    every = [*candidates, *pairs]
    offered = max((row for row in every if row.offered), key=lambda row: row.probability or 0.0, default=None)
    return HypothesisRows(
        as_given, refitted, HypothesisRow(OUTSIDE, OUTSIDE, title="a smooth unknown", probability=chance), tuple(pairs),
        tuple(candidates), next((row for row in every if row.name == diagnosis.best), offered),
    )  # fmt: skip


def _row(diagnosis: Examination, name: str, log_evidence: float) -> HypothesisRow:
    """A hypothesis with its final fit; the model alone where the effect fits best when it is absent."""
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


def _candidate(diagnosis: Examination, family: Family) -> HypothesisRow:
    """A single effect; where it fits best when it is absent, without sizes."""
    main, name = diagnosis.main, family.name
    alone = main.base_gate.probability > FALSE_ALARM
    row = replace(_row(diagnosis, name, family.log_evidence), title=family.effect.title)
    if not row.sizes:
        return replace(row, adequate=alone, eligible=False, remark="fits best when it is absent")
    bounded = diagnosis.fits[name].at_upper_bound()
    remark = "" if name in main.gates or alone else "not tested further"
    return replace(row, eligible=not bounded, remark=f"{', '.join(bounded)} at its bound" if bounded else remark)


def row_words(diagnosis: Examination, name: str) -> str:
    """How a hypothesis stands: by its odds against the likeliest, unless a gate has settled it."""
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
    """How a hypothesis stands against the likeliest one, by twice the logarithm of the odds (RadVel's wording)."""
    if probability < SHOWN:
        return "ruled out"
    twice = 2.0 * float(np.log(best / probability))
    limits = ((0.0, "best"), (2.0, "nearly indistinguishable"), (4.0, "somewhat disfavoured"))
    return next((words for limit, words in limits if twice < limit or twice <= 0.0), "strongly disfavoured")


def fitted_sizes(fit: Fit, family: Family | None = None) -> dict[str, dict[str, FittedSize]]:
    """Effect -> key -> value, unit, 95 % interval of all effects of a fit."""
    sizes: dict[str, dict[str, FittedSize]] = {}
    index = 0
    for candidate, values in zip(fit.candidates, fit.sizes, strict=True):
        entries = sizes.setdefault(candidate.name, {})
        for component, size in zip(candidate.components, values.tolist(), strict=True):
            parameter = component.parameter
            low, high = sorted(
                component.value(end) / parameter.si for end in interval(fit, index, component, size, family)
            )
            value = json_number(component.value(size) / parameter.si)
            entries[parameter.key] = FittedSize(value, parameter.unit, (json_number(low), json_number(high)))
            index += 1
    return sizes


def interval(
    fit: Fit, index: int, component: Component, size: float, family: Family | None = None
) -> tuple[float, float]:
    """95 % interval of a size, within the bounds.

    From its profile where that was scanned, averaged over subsets of components where there are several, else normal.
    """
    low_bound, high_bound = component.bounds
    best = family.best if family is not None else None
    if best is not None and best.interval is not None and index == 0:
        # The scan ran on the table; the final fit with the model itself may sit a little beside it. What reached to a
        # bound does so still.
        shift, near = size - float(best.sizes[0][0]), TOUCHES * float(np.ptp(best.interval))
        low, high = (float(end) for end in best.interval)
        low = low_bound if low - low_bound < near else max(min(low + shift, size), low_bound)
        high = high_bound if high_bound - high < near else min(max(high + shift, size), high_bound)
        return low, high
    averaged = None if family is None else averaged_interval(family, index)
    if index in fit.free:
        reach = NORMAL_95 * fit.deviation(index)
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
    """A share in per cent, rounded as documents have it."""
    return json_number(100.0 * share, digits)


def rounded_errors(residual: FloatArray) -> dict[str, float | None]:
    """`error_figures` as a document has them."""
    figures: Mapping[str, Any] = error_figures(residual)
    return {name: json_number(value) for name, value in figures.items()}


def held_errors(held: HeldOut) -> dict[str, float | None]:
    """Errors at left-out points."""
    return {"held_out_error_percent": percent_of(held.mean_error), "held_out_rms_percent": percent_of(held.rms)}
