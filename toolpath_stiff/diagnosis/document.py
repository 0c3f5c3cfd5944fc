"""A diagnosis as JSON: content of diagnose.json, in shop units; None stands for values that JSON cannot hold."""

import numpy as np

from toolpath_stiff.diagnosis.examination import Diagnosis, HypothesisRow, percent_of, rounded_errors
from toolpath_stiff.diagnosis.words import assumptions, beside_text, doubts, next_steps, verdict_text, why
from toolpath_stiff.documents import Document, certain, json_number, to_dict
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


def document_of(diagnosis: Diagnosis) -> Document:
    """Content of diagnose.json."""
    main, noise, rows = diagnosis.main, diagnosis.noise, diagnosis.rows
    drawn = diagnosis.unconfirmed or main.drawn
    links = {family.name: family.effect.link for family in main.families}
    return {
        "verdict": diagnosis.verdict,
        "text": verdict_text(diagnosis),
        "question": main.question,
        "draft_status": None if drawn is None else drawn.document,
        "baseline": _baseline(diagnosis),
        "candidates": [_candidate(row, main, links[row.name]) for row in rows.candidates],
        "pairs": [_pair(row, main) for row in rows.pairs],
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
        "bounds": [_not_excluded(hidden) for hidden in diagnosis.unexcluded],
        "path": diagnosis.path,
        "portrait": None if diagnosis.portrait is None else portrait_entry(diagnosis.portrait),
        "looks_the_same": alike_entry(diagnosis.alike),
        "not_excluded": [_not_excluded(hidden) for hidden in diagnosis.beside],
        "not_excluded_text": beside_text(diagnosis.beside),
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


def _baseline(diagnosis: Diagnosis) -> Document:
    """The model as given, and with its strut law refitted."""
    law, rows = diagnosis.machine.strut_law, diagnosis.rows
    count = len(law.parameters)  # a constant law has one stiffness, which belongs to no length
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


def _hypothesis(row: HypothesisRow, judgement: Judgement, head: Document, parameters: Document) -> Document:
    """Figures of effects, with the vote of the first explanation against them (None for that one and for parts of it).

    Without the probability of its gate where an effect fits best when it is absent.
    """
    tested = ("adequate", "adequate_probability") if row.sizes else ("adequate",)
    votes = judgement.votes.get(row.name)
    vote = None if votes is None else vote_document(row.name, votes)
    return {**head, **_part(row, FIGURES), **parameters, **_part(row, (*ERRORS, *tested)), "vote": vote}


def _candidate(row: HypothesisRow, judgement: Judgement, link: str) -> Document:
    """A single effect, as an entry of the document."""
    parameters = {"parameters": to_dict(row.sizes.get(row.name, {})), "choice": row.choice.get(row.name, {})}
    head = {"effect": row.name, "title": row.title, "link": link}
    return {**_hypothesis(row, judgement, head, parameters), **_part(row, ("eligible", "remark"))}


def _pair(row: HypothesisRow, judgement: Judgement) -> Document:
    """Several effects, as an entry of the document; parameters by effect, with the elements they act on."""
    parameters = {name: to_dict(sizes) | dict(row.choice[name]) for name, sizes in row.sizes.items()}
    return _hypothesis(row, judgement, {"effects": row.name.split(" + ")}, {"parameters": parameters})


def _not_excluded(hidden: Unexcluded) -> Document:
    """Largest size of an effect that the readings do not show, as an entry of the document."""
    return {
        "effect": hidden.effect.name,
        "title": hidden.effect.title,
        "parameter": hidden.parameter.name,
        "unit": hidden.parameter.unit,
        "choice": dict(hidden.candidate.choice),
        "up_to": json_number(hidden.value / hidden.parameter.si, 2),
        "rms_percent": percent_of(hidden.rms, 2),
        "left_percent": percent_of(hidden.left, 2),
        "probability": json_number(hidden.probability, 2),
        "would_tell": reading_words(telling(hidden.effect)),
    }


def _gates(judgement: Judgement) -> Document:
    """Absolute test of the model without a further effect, as an entry of the document."""
    gate = judgement.base_gate
    return {
        "baseline_probability": json_number(gate.probability, 3),
        "squares": json_number(gate.squares),
        "squares_probability": json_number(gate.squares_probability, 3),
        "simulated_squares": [json_number(x) for x in np.sort(gate.simulated).tolist()],
        "structure_probability": json_number(gate.structure_probability, 3),
        "structure": gate.worst,
        "gain_probability": json_number(gate.gain_probability, 3),
    }


def _in_short(judgement: Judgement) -> Document:
    """Summary of a judgement under one noise model."""
    return {
        "verdict": judgement.verdict,
        "plausible": list(judgement.plausible),
        "noise_percent": percent_of(judgement.noise.typical, 4),
        "origin": judgement.noise.origin,
        "probability": {name: json_number(weight, 4) for name, weight in judgement.likely if weight > 1e-4},
        "structure": judgement.base_gate.worst,
    }
