"""An update as a document: the content of update.json, in shop units; and the residuals as a table."""

import numpy as np

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.correction.outcome import UpdateOutcome
from toolpath_stiff.correction.steps import Support
from toolpath_stiff.correction.strut_law import StrutLawSearch
from toolpath_stiff.correction.words import assumptions, text
from toolpath_stiff.diagnosis.rows import held_errors, percent_of, rounded_errors
from toolpath_stiff.documents import Document, json_number, to_dict
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.inference.left_out import error_falls, gain_in_standard_errors
from toolpath_stiff.machine.model import Uncertainty
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m, n_per_um_from_n_per_m


def document_of(update: UpdateOutcome) -> Document:
    """Everything that `update.json` holds."""
    steps = [rounded_step(update, k) for k in range(len(update.steps))]
    document: Document = {
        "verdict": update.verdict,
        "text": text(update),
        "question": update.question,
        "objective": update.task.objective,
        "baseline": steps[0],
        "strut_law_refitted": rounded_errors(update.refitted.residual),
        "steps": steps,
        "support": [_support(support) for support in update.supports],
        "described": [] if update.described is None else list(update.described.names),
        "rejected": [_support(support) for support in update.turned_down],
        "noise_percent": percent_of(update.noise.typical),
        "noise_floor_percent": json_number(update.noise.floor_percent),
        "noise": {"name": update.noise.name, "origin": update.noise.origin},
        "widening": json_number(update.widening),
        "uncertainty": _uncertainty(None if update.corrected is None else update.corrected.uncertainty),
        "assumptions": assumptions(update),
        "warnings": list(update.problem.predictor.data.warnings),
        "notes": list(update.task.data.notes),
        "machine": update.task.machine.name,
        "effects": update.problem.predictor.effects_that_act,
        "machine_file": update.task.machine_file if update.accepted else None,
        "data": list(update.task.files),
        "readings": len(update.task.data.of_tip),
        "provenance": dict(update.provenance),
        "seed": update.task.seed,
        "next": list(update.next),
    }
    return document if update.search is None else {**document, "search": _search(update.search)}


def rounded_step(update: UpdateOutcome, k: int) -> Document:
    """Step k; of all but the first also what it gains over the one before."""
    step, widening = update.steps[k], update.widening
    document: Document = {
        "name": step.name,
        "effects": list(step.fit.names),
        **rounded_errors(step.residual),
        "findings": list(step.fit.findings),
        **held_errors(step.held),
        "by_direction": step.by_direction,
        "strut_law_N_per_um": to_dict(step.law_ends(update.task.machine.strut_law, widening)),
        "parameters": to_dict(step.sizes(widening)),
        "outliers": len(step.fit.scatter.wild),
    }
    if not k:
        return document
    before = update.steps[k - 1].held
    gain, fall = gain_in_standard_errors(before, step.held), float(error_falls(before, step.held).mean())
    return {
        **document,
        "held_out_gain_in_se": json_number(gain, 3),
        "held_out_se_percent": percent_of(abs(fall / gain), 3) if gain else None,
    }


def _support(support: Support) -> Document:
    return {
        "effect": support.effect,
        "supported": support.supported,
        "reasons": list(support.reasons),
        "mean_abs_error_percent": percent_of(support.error),
        "held_out_error_percent": percent_of(support.held_out_error),
        "held_out_gain_in_se": json_number(support.gain_in_se, 3),
        "likelihood_gain": json_number(support.likelihood_gain),
        "threshold": json_number(support.threshold),
    }


def _uncertainty(uncertainty: Uncertainty | None) -> Document | None:
    """Joint uncertainty of what was fitted."""
    if uncertainty is None:
        return None
    return {
        "parameters": list(uncertainty.names),
        "sd": [json_number(sd) for sd in uncertainty.sd.tolist()],
        "correlation": [[json_number(x, 3) for x in row] for row in uncertainty.correlation.tolist()],
    }


def _search(search: StrutLawSearch) -> Document:
    """Starts and ends of the paper's search, in N/um."""
    law = np.array([search.strut_law.stiffness_1, search.strut_law.stiffness_2]) / np.exp(search.law)
    machine_law = n_per_um_from_n_per_m(law)
    return {
        "starts_N_per_um": np.round(machine_law * np.exp(search.starts), 3).tolist(),
        "ends_N_per_um": np.round(machine_law * np.exp(search.ends), 3).tolist(),
        "end_errors_percent": np.round(100.0 * search.end_errors, 4).tolist(),
        "agreeing": search.agreeing,
    }


def residuals_csv(update: UpdateOutcome) -> str:
    """One row a reading of the tip: measured, modelled as given and after, deviations, that with its point left out."""
    data, given, last = update.task.data.of_tip, update.steps[0], update.last
    wild = np.isin(np.flatnonzero(update.task.data.tip), last.fit.scatter.wild)
    head = [
        "file", "line", "point", "setup", "direction", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "dx",
        "dy", "dz", "measured_N_per_mm", "as_given_N_per_mm", "after_N_per_mm", "as_given_deviation_percent",
        "after_deviation_percent", "left_out_deviation_percent", "wild",
    ]  # fmt: skip
    rows, residuals = [], (given.residual, last.residual, last.held.residual)
    for i in range(len(data)):
        pose = [*mm_from_m(data.position[i]), *deg_from_rad(data.angles[i]), *data.direction[i]]
        measured = float(n_per_mm_from_n_per_m(data.stiffness[i]))
        stiffnesses = [measured, *(measured * float(np.exp(-residual[i])) for residual in residuals[:2])]
        errors = [float(deviation_percent(residual[i])) for residual in residuals]
        rows.append(
            [
                data.file[i], data.line[i], data.point[i], data.setup[i], last.along[i],
                *(f"{value + 0.0:.6g}" for value in pose), *(f"{value:.1f}" for value in stiffnesses),
                *("" if np.isnan(error) else f"{error + 0.0:.3f}" for error in errors), int(wild[i]),
            ]
        )  # fmt: skip
    return csv_text(head, rows)
