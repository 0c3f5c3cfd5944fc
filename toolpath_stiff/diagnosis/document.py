"""A diagnosis as a document: the content of diagnose.json, in shop units; None stands for what JSON cannot hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

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
from toolpath_stiff.documents import Document, to_dict
from toolpath_stiff.hints import Asked
from toolpath_stiff.inference.candidates import Component
from toolpath_stiff.inference.confounding import CONFOUNDED
from toolpath_stiff.inference.errors import error_figures
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.hypotheses import Family, averaged_interval
from toolpath_stiff.inference.judgement import ADEQUATE, FALSE_ALARM, NONE, OUTSIDE, Judgement
from toolpath_stiff.inference.left_out import HeldOut, gain_in_standard_errors
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.portrait.document import alike_entry, portrait_entry
from toolpath_stiff.stiffness.contract import joined
from toolpath_stiff.units import DIGITS, certain, json_number, mm_from_m, n_per_um_from_n_per_m

if TYPE_CHECKING:
    from toolpath_stiff.diagnosis.result import Diagnosis


TOUCHES = 0.01  # of an interval's length from a bound: it reaches to the bound


def document(diagnosis: Diagnosis) -> dict[str, Any]:
    """Everything that `diagnose.json` holds."""
    main, alike = diagnosis.main, diagnosis.alike
    drawn = unconfirmed(diagnosis) or main.drawn
    likely = main.probability
    families = sorted(main.families, key=lambda f: (-likely.get(f.name, 0.0), -f.log_evidence, f.name))
    return {
        "verdict": diagnosis.verdict,
        "text": verdict_text(diagnosis),
        "question": main.question,
        "draft_status": None if drawn is None else drawn.document,
        "baseline": _baseline(diagnosis),
        "candidates": [_candidate(diagnosis, family) for family in families],
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
        "noise": _noise(main.noise),
        "gates": _gates(main),
        "detectable": _detectable(diagnosis),
        "confounding": {
            "effects": list(diagnosis.confounding.names),
            "matrix": [[json_number(x, 3) for x in row] for row in diagnosis.confounding.matrix.tolist()],
            "sets": [list(group) for group in diagnosis.confounding.sets],
            "threshold": CONFOUNDED,
        },
        "path": diagnosis.path,
        "portrait": None if diagnosis.portrait is None else portrait_entry(diagnosis.portrait),
        "looks_the_same": None if alike is None else alike_entry(diagnosis.explanations[0], alike),
        "not_excluded": _not_excluded(diagnosis),
        "not_excluded_text": beside_text(diagnosis.unexcluded),
        "assumptions": assumptions(diagnosis),
        "warnings": list(diagnosis.predictor.data.warnings),
        "notes": [*diagnosis.data.notes, *doubts(diagnosis)],
        "suspect_rows": list(diagnosis.suspects),
        "detectable_slips": [
            {"column": slip.column, "unit": slip.unit, "size": json_number(slip.size, 2)} for slip in diagnosis.slips
        ],
        "seed": diagnosis.seed,
        "machine": diagnosis.machine.name,
        "effects": diagnosis.predictor.effects_that_act,
        "data": list(diagnosis.names),
        "readings": len(diagnosis.data),
        "loops": certain(to_dict(diagnosis.loops)),
        "command": diagnosis.line,
    }


def _noise(noise: Noise) -> dict[str, str | float | None]:
    """The noise of the likeliest model."""
    return {
        "name": noise.name,
        "repeat_percent": _percent(noise.typical_repeat, 4),
        "clamping_percent": _percent(noise.clamping, 4),
        "strut_spread_percent": _percent(noise.strut_spread, 4),
        "joint_error_mm": json_number(float(mm_from_m(noise.joint_error)), 4),
        "origin": noise.origin,
    }


def _detectable(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The smallest sizes that these readings would show, effect by effect."""
    return [
        {
            "effect": smallest.effect,
            "parameter": smallest.parameter.name,
            "unit": smallest.parameter.unit,
            "size": json_number(smallest.value / smallest.parameter.si) if smallest.seen else None,
            "rms_percent": _percent(smallest.rms),
            "detectable": smallest.seen,
        }
        for smallest in diagnosis.detectable
    ]


def _not_excluded(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Effects that the readings neither show nor exclude."""
    return [
        {
            "effect": hidden.effect.name,
            "title": hidden.effect.title,
            "parameter": hidden.parameter.name,
            "unit": hidden.parameter.unit,
            "choice": dict(hidden.candidate.choice),
            "up_to": json_number(hidden.value / hidden.parameter.si, 2),
            "rms_percent": _percent(hidden.rms, 2),
            "left_percent": _percent(hidden.left, 2),
            "probability": json_number(hidden.probability, 2),
            "would_tell": would_tell(hidden),
        }
        for hidden in diagnosis.unexcluded
    ]


def _percent(share: float, digits: int = DIGITS) -> float | None:
    return json_number(100.0 * share, digits)


def rounded_errors(residual: FloatArray) -> dict[str, float | None]:
    """`error_figures` as a document has them."""
    figures = error_figures(residual)
    return {
        "mean_abs_error_percent": json_number(figures["mean_abs_error_percent"]),
        "bias_percent": json_number(figures["bias_percent"]),
        "rms_percent": json_number(figures["rms_percent"]),
    }


def held_errors(held: HeldOut) -> dict[str, float | None]:
    """Errors at left-out points."""
    return {"held_out_error_percent": _percent(held.mean_error), "held_out_rms_percent": _percent(held.rms)}


def _baseline(diagnosis: Diagnosis) -> Document:
    law, probability = diagnosis.machine.strut_law, diagnosis.main.probability
    count = len(law.parameters)  # of a constant law one, which belongs to no length
    factors = np.exp(diagnosis.base.law[:count])
    deviations = np.sqrt(np.diag(diagnosis.base.covariance)[:count])
    ends = ((law.length_1, law.stiffness_1), (law.length_2, law.stiffness_2))[:count]
    return {
        **rounded_errors(diagnosis.base.residual),
        **held_errors(diagnosis.held_out_base),
        "noise_percent": _percent(diagnosis.noise.typical),
        "noise_floor_percent": json_number(diagnosis.noise.floor_percent),
        "probability": json_number(probability.get(NONE, 0.0)),
        "probability_outside": json_number(probability.get(OUTSIDE, 0.0)),
        "adequate": bool(diagnosis.main.base_gate.probability > FALSE_ALARM),
        "words": row_words(diagnosis, NONE),
        # Nothing is fitted: leaving points out changes nothing.
        "as_given": {
            **rounded_errors(diagnosis.as_given.residual),
            "held_out_error_percent": _percent(float(diagnosis.as_given.errors.mean())),
        },
        "law": [
            {
                "length_mm": None if law.constant else json_number(float(mm_from_m(length)), 7),
                "stiffness_N_per_um": json_number(n_per_um_from_n_per_m(stiffness * factor)),
                "machine_file_N_per_um": json_number(n_per_um_from_n_per_m(stiffness)),
                "sd_percent": _percent(deviation, 3),
            }
            for (length, stiffness), factor, deviation in zip(ends, factors, deviations, strict=True)
        ],
    }


def _standing(diagnosis: Diagnosis, name: str, log_evidence: float) -> Document:
    """How a hypothesis stands against the others."""
    return {
        "probability": json_number(diagnosis.main.probability.get(name, 0.0)),
        "log_evidence": json_number(log_evidence - diagnosis.main.base.log_evidence),
        "words": row_words(diagnosis, name),
    }


def _errors(diagnosis: Diagnosis, fit: Fit, held: HeldOut) -> Document:
    """Errors of a fit, and by how much those at left-out points fall."""
    base = diagnosis.held_out_base
    return {
        "mean_abs_error_percent": _percent(float(fit.errors.mean())),
        "finding": joined(fit.findings),
        **held_errors(held),
        "held_out_gain_in_se": 0.0 if held is base else json_number(gain_in_standard_errors(base, held), 3),
    }


def _candidate(diagnosis: Diagnosis, family: Family) -> Document:
    """A single effect; where it fits best when it is absent, without sizes."""
    fit, gate = diagnosis.fits.get(family.name), diagnosis.main.gates.get(family.name)
    base_passes = diagnosis.main.base_gate.probability > FALSE_ALARM
    effect = {"effect": family.name, "title": family.effect.title, "link": family.effect.link}
    common = {**effect, **_standing(diagnosis, family.name, family.log_evidence)}
    if fit is None or not any(size.any() for size in fit.sizes):
        return {
            **common,
            "parameters": {},
            "choice": {},
            **_errors(diagnosis, diagnosis.base, diagnosis.held_out_base),
            "finding": "",
            "adequate": base_passes,
            "eligible": False,
            "remark": "fits best when it is absent",
        }
    bounded = fit.at_upper_bound()
    remark = f"{', '.join(bounded)} at its bound" if bounded else ""
    return {
        **common,
        "parameters": parameters(fit, family),
        "choice": dict(fit.candidates[0].choice),
        **_errors(diagnosis, fit, diagnosis.held_out[family.name]),
        "adequate": bool(base_passes if gate is None else gate.probability > ADEQUATE),
        "adequate_probability": None if gate is None else json_number(gate.probability, 3),
        "eligible": not bounded,
        "remark": remark or ("not tested further" if gate is None and not base_passes else ""),
    }


def parameters(fit: Fit, family: Family | None = None) -> Mapping[str, Document]:
    """Key -> value, unit, 95 % interval, of all effects of a fit; None stands for an infinite value."""
    fitted = [
        (component, float(size))
        for candidate, sizes in zip(fit.candidates, fit.sizes, strict=True)
        for component, size in zip(candidate.components, sizes, strict=True)
    ]
    entries = {}
    for index, (component, size) in enumerate(fitted):
        si = component.parameter.si
        ends = sorted(component.value(end) / si for end in interval(fit, index, component, size, family))
        entries[component.parameter.key] = {
            "value": json_number(component.value(size) / si),
            "unit": component.parameter.unit,
            "interval": [json_number(end) for end in ends],
        }
    return entries


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


def _pairs(diagnosis: Diagnosis) -> list[Document]:
    """Pairs that were tested, the likeliest first; parameters by effect, with what it acts on."""
    entries = []
    for pair in diagnosis.main.pairs:
        name = " + ".join(pair.names)
        fit, gate = diagnosis.fits.get(name), diagnosis.main.gates.get(name)
        if fit is None or gate is None:
            continue
        entry = {
            "effects": list(pair.names),
            **_standing(diagnosis, name, pair.log_evidence),
            "parameters": pair_parameters(fit),
            **_errors(diagnosis, fit, diagnosis.held_out[name]),
            "adequate": bool(gate.probability > ADEQUATE),
            "adequate_probability": json_number(gate.probability, 3),
        }
        entries.append(entry)
    return sorted(entries, key=lambda entry: (-(entry["probability"] or 0.0), -(entry["log_evidence"] or 0.0)))


def pair_parameters(fit: Fit) -> dict[str, Document]:
    """Effect -> its parameters and choice."""
    flat = list(parameters(fit).items())
    found: dict[str, Document] = {}
    start = 0
    for candidate in fit.candidates:
        count = len(candidate.components)
        found[candidate.name] = dict(flat[start : start + count]) | dict(candidate.choice)
        start += count
    return found


def _gates(judgement: Judgement) -> Document:
    """The absolute test of the model without a further effect."""
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


def _in_short(judgement: Judgement) -> Document:
    """A judgement under one noise model."""
    likely = sorted(judgement.probability.items(), key=lambda item: (-item[1], item[0]))
    return {
        "verdict": judgement.verdict,
        "plausible": list(judgement.plausible),
        "noise_percent": _percent(judgement.noise.typical, 4),
        "origin": judgement.noise.origin,
        "probability": {name: json_number(weight, 4) for name, weight in likely if weight > 1e-4},
        "baseline_gate_probability": json_number(judgement.base_gate.probability, 3),
        "structure": judgement.base_gate.worst,
    }
