"""A diagnosis as a document: the content of diagnose.json, in shop units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.defaults import NORMAL_95
from toolpath_stiff.diagnosis.words import (
    assumptions,
    beside_text,
    doubts,
    next_steps,
    row_words,
    unconfirmed,
    verdict_text,
    why,
    would_tell,
)
from toolpath_stiff.hints import Asked
from toolpath_stiff.inference.candidates import Component
from toolpath_stiff.inference.confounding import CONFOUNDED
from toolpath_stiff.inference.detectable import Detectable
from toolpath_stiff.inference.drawn import DrawnEntry
from toolpath_stiff.inference.errors import error_figures
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.hypotheses import Family, averaged_interval
from toolpath_stiff.inference.judgement import ADEQUATE, FALSE_ALARM, NONE, OUTSIDE, Judgement
from toolpath_stiff.inference.left_out import gain_in_standard_errors
from toolpath_stiff.inference.slips import SuspectEntry
from toolpath_stiff.inference.unexcluded import Unexcluded
from toolpath_stiff.portrait.document import PortraitEntry, SameEntry, alike_entry, portrait_entry
from toolpath_stiff.stiffness.contract import joined
from toolpath_stiff.units import certain, json_number, mm_from_m, n_per_um_from_n_per_m

if TYPE_CHECKING:
    from toolpath_stiff.comparison.loop_readings import LoopsDocument
    from toolpath_stiff.diagnosis.result import Diagnosis


TOUCHES = 0.01  # of an interval's length from a bound: it reaches to the bound


class RoundedErrors(TypedDict):
    """Errors of a model over some readings, as the paper counts them; %, None where there is none."""

    mean_abs_error_percent: float | None
    bias_percent: float | None
    rms_percent: float | None


class HeldErrors(RoundedErrors):
    """The same, and at left-out points."""

    held_out_error_percent: float | None


class LawEntry(TypedDict):
    """The strut law at one length; None: at every length."""

    length_mm: float | None
    stiffness_N_per_um: float | None
    machine_file_N_per_um: float | None
    sd_percent: float | None


class BaselineEntry(HeldErrors):
    """The model without a further effect, its strut law refitted; and as given."""

    held_out_rms_percent: float | None
    noise_percent: float | None
    noise_floor_percent: float | None
    probability: float | None
    probability_outside: float | None
    adequate: bool
    words: str
    as_given: HeldErrors
    law: list[LawEntry]


class ParameterEntry(TypedDict):
    """A fitted parameter in its own unit with its 95 % interval; None stands for an infinite value."""

    value: float | None
    unit: str
    interval: list[float | None]


class Explanation(TypedDict):
    """How a hypothesis stands."""

    probability: float | None
    log_evidence: float | None
    words: str
    mean_abs_error_percent: float | None
    finding: str
    held_out_error_percent: float | None
    held_out_rms_percent: float | None
    held_out_gain_in_se: float | None
    adequate: bool


class CandidateEntry(Explanation):
    """A single effect."""

    effect: str
    title: str
    link: str
    parameters: dict[str, ParameterEntry]
    choice: dict[str, Any]
    eligible: bool
    remark: str


class TestedEntry(CandidateEntry):
    """A single effect that is there; the probability of its absolute test, None where that was not made."""

    adequate_probability: float | None


class _Common(TypedDict):
    """What every candidate's entry begins with."""

    effect: str
    title: str
    link: str
    probability: float | None
    log_evidence: float | None
    words: str


class PairEntry(Explanation):
    """Two effects; parameters by effect, with what it acts on."""

    effects: list[str]
    parameters: dict[str, dict[str, Any]]
    adequate_probability: float | None


class NoiseEntry(TypedDict):
    """The noise model that is written out."""

    name: str
    repeat_percent: float | None
    clamping_percent: float | None
    strut_spread_percent: float | None
    joint_error_mm: float | None
    origin: str


class GatesEntry(TypedDict):
    """The absolute test of the model without a further effect."""

    baseline_probability: float | None
    squares: float | None
    squares_probability: float | None
    simulated_squares: list[float | None]
    structure_probability: float | None
    structure: str
    gain_probability: float | None
    gain_threshold: float | None


class InShort(TypedDict):
    """A judgement under one noise model."""

    verdict: str
    plausible: list[str]
    noise_percent: float | None
    origin: str
    probability: dict[str, float | None]
    baseline_gate_probability: float | None
    structure: str


class DetectableEntry(TypedDict):
    """The smallest size of a parameter that these data would have shown, in its own unit."""

    effect: str
    parameter: str
    unit: str
    size: float | None
    rms_percent: float | None
    detectable: bool


class SlipSizeEntry(TypedDict):
    """By how much a column of a clamping's readings must be off to stand out; None where that is not known."""

    column: str
    unit: str
    size: float | None


class ConfoundingEntry(TypedDict):
    """Which effects these data cannot tell apart."""

    effects: list[str]
    matrix: list[list[float | None]]
    sets: list[list[str]]
    threshold: float


class NotExcluded(TypedDict):
    """An effect that may be there beside the likeliest explanation: up to which size, and what would tell."""

    effect: str
    title: str
    parameter: str
    unit: str
    choice: dict[str, Any]
    up_to: float | None
    rms_percent: float | None
    left_percent: float | None
    probability: float | None
    would_tell: str


class CannotTest(TypedDict):
    """An effect and the columns that the data lack for it."""

    effect: str
    missing: list[str]


class DiagnosisDocument(TypedDict):
    """The content of diagnose.json."""

    verdict: str
    text: str
    question: str
    draft_status: DrawnEntry | None
    baseline: BaselineEntry
    candidates: list[CandidateEntry]
    pairs: list[PairEntry]
    plausible: list[str]
    explanations: list[str]
    best: str | None
    why: list[str]
    cannot_test: list[CannotTest]
    next_measurements: list[dict[str, Any]]
    next: list[str]
    by_noise: dict[str, InShort]
    noise: NoiseEntry
    gates: GatesEntry
    detectable: list[DetectableEntry]
    confounding: ConfoundingEntry
    path: dict[str, Any] | None
    portrait: PortraitEntry | None
    looks_the_same: SameEntry | None
    not_excluded: list[NotExcluded]
    not_excluded_text: str
    assumptions: list[str]
    warnings: list[str]
    notes: list[str]
    suspect_rows: list[SuspectEntry]
    detectable_slips: list[SlipSizeEntry]
    seed: int
    machine: str
    effects: list[str]
    data: list[str]
    readings: int
    loops: LoopsDocument
    command: str


def document(diagnosis: Diagnosis) -> DiagnosisDocument:
    """Everything that `diagnose.json` holds."""
    main = diagnosis.main
    return {
        "verdict": diagnosis.verdict,
        "text": verdict_text(diagnosis),
        "question": main.question,
        "draft_status": None if (drawn := unconfirmed(diagnosis) or main.drawn) is None else drawn.document,
        "baseline": _baseline(diagnosis),
        "candidates": _candidates(diagnosis),
        "pairs": _pairs(diagnosis),
        "plausible": list(diagnosis.plausible),
        "explanations": list(diagnosis.explanations),
        "best": diagnosis.best,
        "why": [*why(diagnosis), *diagnosis.remarks],
        "cannot_test": [
            {"effect": name, "missing": list(columns)} for name, columns in sorted(diagnosis.cannot_test.items())
        ],
        "next_measurements": list(diagnosis.next_measurements),
        "next": next_steps(diagnosis, diagnosis.asked or Asked(diagnosis.names)),
        "by_noise": {name: _in_short(judgement) for name, judgement in diagnosis.judgements.items()},
        "noise": _noise(main),
        "gates": _gates(main),
        "detectable": [_detectable(one) for one in diagnosis.detectable],
        "confounding": {
            "effects": list(diagnosis.confounding.names),
            "matrix": [[json_number(x, 3) for x in row] for row in diagnosis.confounding.matrix.tolist()],
            "sets": [list(group) for group in diagnosis.confounding.sets],
            "threshold": CONFOUNDED,
        },
        "path": diagnosis.path,
        "portrait": None if diagnosis.portrait is None else portrait_entry(diagnosis.portrait),
        "looks_the_same": (
            None if diagnosis.alike is None else alike_entry(diagnosis.explanations[0], diagnosis.alike)
        ),
        "not_excluded": [_not_excluded(one) for one in diagnosis.unexcluded],
        "not_excluded_text": beside_text(diagnosis.unexcluded),
        "assumptions": assumptions(diagnosis),
        "warnings": list(diagnosis.predictor.data.warnings),
        "notes": [*diagnosis.data.notes, *doubts(diagnosis)],
        "suspect_rows": list(diagnosis.suspects),
        "detectable_slips": [
            {"column": one.column, "unit": one.unit, "size": json_number(one.size, 2)} for one in diagnosis.slips
        ],
        "seed": diagnosis.seed,
        "machine": diagnosis.machine.name,
        "effects": diagnosis.predictor.effects_that_act,
        "data": list(diagnosis.names),
        "readings": len(diagnosis.data),
        "loops": certain(diagnosis.loops),
        "command": diagnosis.line,
    }


def _not_excluded(one: Unexcluded) -> NotExcluded:
    return {
        "effect": one.effect.name,
        "title": one.effect.title,
        "parameter": one.parameter.name,
        "unit": one.parameter.unit,
        "choice": dict(one.candidate.choice),
        "up_to": json_number(one.value / one.parameter.si, 2),
        "rms_percent": json_number(100.0 * one.rms, 2),
        "left_percent": json_number(100.0 * one.left, 2),
        "probability": json_number(one.probability, 2),
        "would_tell": would_tell(one),
    }


def _detectable(one: Detectable) -> DetectableEntry:
    return {
        "effect": one.effect,
        "parameter": one.parameter.name,
        "unit": one.parameter.unit,
        "size": json_number(one.value / one.parameter.si) if one.seen else None,
        "rms_percent": json_number(100.0 * one.rms),
        "detectable": one.seen,
    }


def rounded_errors(residual: FloatArray) -> RoundedErrors:
    """`error_figures` as a document has them."""
    found = error_figures(residual)
    return {
        "mean_abs_error_percent": json_number(found["mean_abs_error_percent"]),
        "bias_percent": json_number(found["bias_percent"]),
        "rms_percent": json_number(found["rms_percent"]),
    }


def _baseline(diagnosis: Diagnosis) -> BaselineEntry:
    held = diagnosis.held_out_base
    law = diagnosis.machine.strut_law
    count = len(law.parameters)  # of a constant law one, which belongs to no length
    factors = np.exp(diagnosis.base.law[:count])
    deviations = np.sqrt(np.diag(diagnosis.base.covariance)[:count])
    ends = ((law.length_1, law.stiffness_1), (law.length_2, law.stiffness_2))[:count]
    return {
        **rounded_errors(diagnosis.base.residual),
        "held_out_error_percent": json_number(100.0 * held.mean_error),
        "held_out_rms_percent": json_number(100.0 * held.rms),
        "noise_percent": json_number(100.0 * diagnosis.noise.typical),
        "noise_floor_percent": json_number(diagnosis.noise.floor_percent),
        "probability": json_number(diagnosis.main.probability.get(NONE, 0.0)),
        "probability_outside": json_number(diagnosis.main.probability.get(OUTSIDE, 0.0)),
        "adequate": bool(diagnosis.main.base_gate.probability > FALSE_ALARM),
        "words": row_words(diagnosis, NONE),
        # Nothing is fitted: leaving points out changes nothing.
        "as_given": {
            **rounded_errors(diagnosis.as_given.residual),
            "held_out_error_percent": json_number(100.0 * float(diagnosis.as_given.errors.mean())),
        },
        "law": [
            {
                "length_mm": None if law.constant else json_number(float(mm_from_m(length)), 7),
                "stiffness_N_per_um": json_number(n_per_um_from_n_per_m(stiffness * factor)),
                "machine_file_N_per_um": json_number(n_per_um_from_n_per_m(stiffness)),
                "sd_percent": json_number(100.0 * deviation, 3),
            }
            for (length, stiffness), factor, deviation in zip(ends, factors, deviations, strict=True)
        ],
    }


def _candidates(diagnosis: Diagnosis) -> list[CandidateEntry]:
    main = diagnosis.main
    ranked = sorted(main.families, key=lambda f: (-main.probability.get(f.name, 0.0), -f.log_evidence, f.name))
    return [_candidate(diagnosis, family) for family in ranked]


def _candidate(diagnosis: Diagnosis, family: Family) -> CandidateEntry | TestedEntry:
    main = diagnosis.main
    fit = diagnosis.fits.get(family.name)
    gate = main.gates.get(family.name)
    base_passes = main.base_gate.probability > FALSE_ALARM
    common: _Common = {
        "effect": family.name,
        "title": family.effect.title,
        "link": family.effect.link,
        "probability": json_number(main.probability.get(family.name, 0.0)),
        "log_evidence": json_number(family.log_evidence - main.base.log_evidence),
        "words": row_words(diagnosis, family.name),
    }
    if fit is None or not any(size.any() for size in fit.sizes):
        return {
            **common,
            "parameters": {},
            "choice": {},
            "mean_abs_error_percent": json_number(100.0 * float(diagnosis.base.errors.mean())),
            "finding": "",
            "held_out_error_percent": json_number(100.0 * diagnosis.held_out_base.mean_error),
            "held_out_rms_percent": json_number(100.0 * diagnosis.held_out_base.rms),
            "held_out_gain_in_se": 0.0,
            "adequate": base_passes,
            "eligible": False,
            "remark": "fits best when it is absent",
        }
    held = diagnosis.held_out[family.name]
    adequate = gate.probability > ADEQUATE if gate is not None else base_passes
    bounded = fit.at_upper_bound()
    remark = f"{', '.join(bounded)} at its bound" if bounded else ""
    if not remark and gate is None and not base_passes:
        remark = "not tested further"
    return {
        **common,
        "parameters": parameters(fit, family),
        "choice": dict(fit.candidates[0].choice),
        "mean_abs_error_percent": json_number(100.0 * float(fit.errors.mean())),
        "finding": joined(fit.findings),
        "held_out_error_percent": json_number(100.0 * held.mean_error),
        "held_out_rms_percent": json_number(100.0 * held.rms),
        "held_out_gain_in_se": json_number(gain_in_standard_errors(diagnosis.held_out_base, held), 3),
        "adequate": bool(adequate),
        "adequate_probability": None if gate is None else json_number(gate.probability, 3),
        "eligible": not bounded,
        "remark": remark,
    }


def parameters(fit: Fit, family: Family | None = None) -> dict[str, ParameterEntry]:
    """Key -> value, unit, 95 % interval, of all effects of a fit; None stands for an infinite value."""
    found: dict[str, ParameterEntry] = {}
    index = 0
    for candidate, sizes in zip(fit.candidates, fit.sizes, strict=True):
        for component, size in zip(candidate.components, sizes, strict=True):
            low, high = interval(fit, index, component, float(size), family)
            si = component.parameter.si
            ends = sorted((component.value(low) / si, component.value(high) / si))
            found[component.parameter.key] = {
                "value": json_number(component.value(float(size)) / si),
                "unit": component.parameter.unit,
                "interval": [json_number(ends[0]), json_number(ends[1])],
            }
            index += 1
    return found


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


def _pairs(diagnosis: Diagnosis) -> list[PairEntry]:
    found: list[PairEntry] = []
    for pair in diagnosis.main.pairs:
        name = " + ".join(pair.names)
        fit = diagnosis.fits.get(name)
        gate = diagnosis.main.gates.get(name)
        if fit is None or gate is None:
            continue
        held = diagnosis.held_out[name]
        found.append(
            {
                "effects": list(pair.names),
                "probability": json_number(diagnosis.main.probability.get(name, 0.0)),
                "log_evidence": json_number(pair.log_evidence - diagnosis.main.base.log_evidence),
                "words": row_words(diagnosis, name),
                "parameters": pair_parameters(fit),
                "mean_abs_error_percent": json_number(100.0 * float(fit.errors.mean())),
                "finding": joined(fit.findings),
                "held_out_error_percent": json_number(100.0 * held.mean_error),
                "held_out_rms_percent": json_number(100.0 * held.rms),
                "held_out_gain_in_se": json_number(gain_in_standard_errors(diagnosis.held_out_base, held), 3),
                "adequate": bool(gate.probability > ADEQUATE),
                "adequate_probability": json_number(gate.probability, 3),
            }
        )
    return sorted(found, key=lambda pair: (-(pair["probability"] or 0.0), -(pair["log_evidence"] or 0.0)))


def pair_parameters(fit: Fit) -> dict[str, dict[str, Any]]:
    """Effect -> its parameters and choice."""
    flat = list(parameters(fit).items())
    found: dict[str, dict[str, Any]] = {}
    start = 0
    for candidate in fit.candidates:
        count = len(candidate.components)
        found[candidate.name] = dict(flat[start : start + count]) | dict(candidate.choice)
        start += count
    return found


def _noise(judgement: Judgement) -> NoiseEntry:
    noise = judgement.noise
    return {
        "name": noise.name,
        "repeat_percent": json_number(100.0 * noise.typical_repeat, 4),
        "clamping_percent": json_number(100.0 * noise.clamping, 4),
        "strut_spread_percent": json_number(100.0 * noise.strut_spread, 4),
        "joint_error_mm": json_number(float(mm_from_m(noise.joint_error)), 4),
        "origin": noise.origin,
    }


def _gates(judgement: Judgement) -> GatesEntry:
    gate = judgement.base_gate
    return {
        "baseline_probability": json_number(gate.probability, 3),
        "squares": json_number(gate.squares),
        "squares_probability": json_number(gate.squares_probability, 3),
        "simulated_squares": [json_number(x) for x in np.sort(gate.simulated).tolist()],
        "structure_probability": json_number(gate.structure_probability, 3),
        "structure": gate.worst,
        "gain_probability": json_number(gate.gain_probability, 3),
        "gain_threshold": json_number(gate.gain_threshold),
    }


def _in_short(judgement: Judgement) -> InShort:
    return {
        "verdict": judgement.verdict,
        "plausible": list(judgement.plausible),
        "noise_percent": json_number(100.0 * judgement.noise.typical, 4),
        "origin": judgement.noise.origin,
        "probability": {
            name: json_number(weight, 4)
            for name, weight in sorted(judgement.probability.items(), key=lambda item: (-item[1], item[0]))
            if weight > 1e-4
        },
        "baseline_gate_probability": json_number(judgement.base_gate.probability, 3),
        "structure": judgement.base_gate.worst,
    }
