"""A diagnosis as JSON: the content of diagnose.json, in shop units; None stands for what JSON cannot hold."""

import numpy as np

from toolpath_stiff.diagnosis.examination import Examination, HypothesisRow, percent_of, rounded_errors
from toolpath_stiff.diagnosis.words import assumptions, beside_text, doubts, next_steps, verdict_text, why
from toolpath_stiff.documents import Document, certain, json_number, to_dict
from toolpath_stiff.inference.detectable import Detectable
from toolpath_stiff.inference.judgement import Judgement
from toolpath_stiff.inference.unexcluded import Unexcluded
from toolpath_stiff.inference.votes import vote_document
from toolpath_stiff.planning.plan import reading_words, telling
from toolpath_stiff.portrait.words import alike_entry, portrait_entry
from toolpath_stiff.units import mm_from_m, n_per_um_from_n_per_m

FIGURES = ("probability", "log_evidence", "words")
ERRORS = (
    "mean_abs_error_percent", "finding", "held_out_error_percent", "held_out_rms_percent", "held_out_gain_in_se",
)  # fmt: skip


def document_of(diagnosis: Examination) -> Document:
    """Everything that `diagnose.json` holds."""
    main, noise, rows = diagnosis.main, diagnosis.noise, diagnosis.rows
    drawn = diagnosis.unconfirmed or main.drawn
    links = {family.name: family.effect.link for family in main.families}
    return {
        "verdict": diagnosis.verdict,
        "text": verdict_text(diagnosis),
        "question": main.question,
        "draft_status": None if drawn is None else drawn.document,
        "baseline": _baseline(diagnosis),
        "candidates": [{**_candidate(row, links[row.name]), **_vote(main, row.name)} for row in rows.candidates],
        "pairs": [{**_pair(row), **_vote(main, row.name)} for row in rows.pairs],
        "votes": [vote_document(rival, differences) for rival, differences in main.votes.items()],
        "nuisances": diagnosis.nuisances,
        "plausible": diagnosis.plausible,
        "explanations": list(diagnosis.explanations),
        "entries": [list(names) for names in diagnosis.entries],
        "best": diagnosis.best,
        "why": why(diagnosis),
        "cannot_test": [
            {"effect": name, "missing": list(lacks)} for name, lacks in sorted(diagnosis.cannot_test.items())
        ],
        "next_measurements": list(diagnosis.next_measurements),
        "next": next_steps(diagnosis),
        "by_noise": {name: _in_short(judgement) for name, judgement in diagnosis.judgements.items()},
        "noise": {
            "name": noise.name,
            "repeat_percent": percent_of(noise.typical_repeat, 4),
            "clamping_percent": percent_of(noise.clamping, 4),
            "strut_spread_percent": percent_of(noise.strut_spread, 4),
            "origin": noise.origin,
        },
        "gates": _gates(main),
        "detectable": [_detectable(smallest) for smallest in diagnosis.detectable],
        "path": diagnosis.path,
        "portrait": None if diagnosis.portrait is None else portrait_entry(diagnosis.portrait),
        "looks_the_same": alike_entry(diagnosis.alike),
        "not_excluded": [_not_excluded(hidden) for hidden in diagnosis.unexcluded],
        "not_excluded_text": beside_text(diagnosis.unexcluded),
        "assumptions": assumptions(diagnosis),
        "warnings": list(diagnosis.predictor.data.warnings),
        "notes": [*diagnosis.data.notes, *doubts(diagnosis)],
        "suspect_rows": to_dict(diagnosis.suspects),
        "seed": diagnosis.seed,
        "machine": diagnosis.machine.name,
        "effects": diagnosis.predictor.effects_that_act,
        "data": list(diagnosis.names),
        "readings": len(diagnosis.data),
        "loops": certain(to_dict(diagnosis.loops)),
        "command": diagnosis.line,
    }


def _baseline(diagnosis: Examination) -> Document:
    """The model as given, and with its strut law refitted."""
    law, rows = diagnosis.machine.strut_law, diagnosis.rows
    count = len(law.parameters)  # of a constant law one, which belongs to no length
    factors, deviations = np.exp(diagnosis.base.law[:count]), np.sqrt(np.diag(diagnosis.base.covariance)[:count])
    ends = ((law.length_1, law.stiffness_1), (law.length_2, law.stiffness_2))[:count]
    return {
        **rounded_errors(diagnosis.base.residual),
        **_part(rows.refitted, ERRORS[2:4]),
        "noise_percent": percent_of(diagnosis.noise.typical),
        "noise_floor_percent": json_number(diagnosis.noise.floor_percent),
        "probability": rows.refitted.probability,
        "probability_outside": rows.outside.probability,
        **_part(rows.refitted, ("adequate", "words")),
        "as_given": {**rounded_errors(diagnosis.as_given.residual), **_part(rows.as_given, ERRORS[2:3])},
        "law": [
            {
                "length_mm": None if law.constant else json_number(float(mm_from_m(length)), 7),
                "stiffness_N_per_um": json_number(n_per_um_from_n_per_m(stiffness * factor)),
                "sd_percent": percent_of(deviation, 3),
            }
            for (length, stiffness), factor, deviation in zip(ends, factors, deviations, strict=True)
        ],
    }


def _part(row: HypothesisRow, names: tuple[str, ...]) -> Document:
    return {name: getattr(row, name) for name in names}


def _candidate(row: HypothesisRow, link: str) -> Document:
    """A single effect; without the probability of its gate where it fits best when it is absent."""
    return {
        "effect": row.name,
        "title": row.title,
        "link": link,
        **_part(row, FIGURES),
        "parameters": to_dict(row.sizes.get(row.name, {})),
        "choice": row.choice.get(row.name, {}),
        **_part(row, ERRORS),
        **_part(row, ("adequate", *(["adequate_probability"] if row.sizes else []), "eligible", "remark")),
    }


def _vote(judgement: Judgement, name: str) -> Document:
    """The vote for the first explanation against a rival; None of that itself and of its own part."""
    votes = judgement.votes
    return {"vote": vote_document(name, votes[name]) if name in votes else None}


def _pair(row: HypothesisRow) -> Document:
    """Several effects; parameters by effect, with what it acts on."""
    return {
        "effects": row.name.split(" + "),
        **_part(row, FIGURES),
        "parameters": {name: to_dict(sizes) | dict(row.choice[name]) for name, sizes in row.sizes.items()},
        **_part(row, (*ERRORS, "adequate", "adequate_probability")),
    }


def _detectable(smallest: Detectable) -> Document:
    """The smallest size of a parameter that these readings would show."""
    return {
        "effect": smallest.effect,
        "parameter": smallest.parameter.name,
        "unit": smallest.parameter.unit,
        "size": json_number(smallest.value / smallest.parameter.si) if smallest.seen else None,
        "rms_percent": percent_of(smallest.rms),
        "detectable": smallest.seen,
    }


def _not_excluded(hidden: Unexcluded) -> Document:
    """An effect that the readings neither show nor exclude."""
    return {
        "effect": hidden.effect.name,
        "title": hidden.effect.title,
        "parameter": hidden.parameter.name,
        "unit": hidden.parameter.unit,
        "choice": dict(hidden.candidate.choice),
        "up_to": json_number(hidden.value / hidden.parameter.si, 2),
        "rms_percent": percent_of(hidden.rms, 2),
        "probability": json_number(hidden.probability, 2),
        "would_tell": reading_words(telling(hidden.effect)),
    }


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
    return {
        "verdict": judgement.verdict,
        "plausible": list(judgement.plausible),
        "noise_percent": percent_of(judgement.noise.typical, 4),
        "origin": judgement.noise.origin,
        "probability": {name: json_number(weight, 4) for name, weight in judgement.likely if weight > 1e-4},
        "structure": judgement.base_gate.worst,
    }
