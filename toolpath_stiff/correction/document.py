"""An update as a document: the content of update.json, in shop units; and the residuals as a table."""

from __future__ import annotations

from typing import Any, NotRequired, TypedDict

import numpy as np

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.comparison.residuals import directions
from toolpath_stiff.correction.ladder import NEEDED, Step, Support, Update
from toolpath_stiff.correction.strut_law import StrutLawSearch
from toolpath_stiff.correction.update import Correction
from toolpath_stiff.defaults import NORMAL_95
from toolpath_stiff.diagnosis.rows import held_errors, interval, rounded_errors
from toolpath_stiff.documents import Document
from toolpath_stiff.inference.errors import LAW_REFITTED, deviation_percent, errors_text
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.left_out import error_falls, gain_in_standard_errors
from toolpath_stiff.inference.prediction import scaled_law
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.stiffness.sizes import joined
from toolpath_stiff.units import deg_from_rad, json_number, mm_from_m, n_per_mm_from_n_per_m, n_per_um_from_n_per_m

UPDATED, REFUSED, FORCED, NOTHING = "updated", "refused", "forced", "nothing added"


class LawEntry(TypedDict):
    """The strut law at one length, N/um; None: at every length."""

    length_mm: float | None
    stiffness: float | None
    sd: float | None


class SupportEntry(TypedDict):
    """Whether the data support an effect."""

    effect: str
    supported: bool
    reasons: list[str]
    mean_abs_error_percent: float | None
    held_out_error_percent: float | None
    held_out_reduction_percent: float | None
    held_out_gain_in_se: float | None
    likelihood_gain: float | None
    threshold: float | None


class NoiseEntry(TypedDict):
    """The noise model."""

    name: str
    origin: str


class UncertaintyEntry(TypedDict):
    """Joint uncertainty of what was fitted."""

    parameters: list[str]
    sd: list[float | None]
    correlation: list[list[float | None]]


class SearchEntry(TypedDict):
    """Starts and ends of the paper's own search."""

    starts_N_per_um: list[list[float]]
    ends_N_per_um: list[list[float]]
    end_errors_percent: list[float]
    agreeing: int


class UpdateDocument(TypedDict):
    """The content of update.json."""

    verdict: str
    text: str
    question: str
    objective: str
    baseline: Document
    strut_law_refitted: Document
    steps: list[Document]
    support: list[SupportEntry]
    described: list[str]  # effects whose form was read off these readings, and that no others have confirmed
    rejected: list[SupportEntry]
    noise_percent: float | None
    noise_floor_percent: float | None
    noise: NoiseEntry
    widening: float | None
    uncertainty: UncertaintyEntry | None
    assumptions: list[str]
    warnings: list[str]
    notes: list[str]
    machine: str
    effects: list[str]
    machine_file: str | None
    data: list[str]
    readings: int
    provenance: dict[str, Any]
    seed: int
    next: list[str]
    search: NotRequired[SearchEntry]


def document(correction: Correction) -> UpdateDocument:
    """Everything that `update.json` holds."""
    update, updated = correction.update, correction.machine
    steps = [_step(update, k) for k in range(len(update.steps))]
    verdict = _verdict(update)
    uncertainty = updated.uncertainty if updated is not None else None
    found: UpdateDocument = {
        "verdict": verdict,
        "text": _text(update, verdict),
        "question": update.question,
        "objective": update.objective,
        "baseline": steps[0],
        "strut_law_refitted": rounded_errors(update.refitted.residual),
        "steps": steps,
        "support": [_support(one) for one in update.supports],
        "described": [] if update.described is None else list(update.described.names),
        "rejected": [_support(one) for one in update.turned_down],
        "noise_percent": json_number(100.0 * update.noise.typical),
        "noise_floor_percent": json_number(update.noise.floor_percent),
        "noise": {"name": update.noise.name, "origin": update.noise.origin},
        "widening": json_number(update.widening),
        "uncertainty": None
        if uncertainty is None
        else {
            "parameters": list(uncertainty.names),
            "sd": [json_number(float(sd)) for sd in uncertainty.sd],
            "correlation": [[json_number(float(x), 3) for x in row] for row in uncertainty.correlation],
        },
        "assumptions": _assumptions(update),
        "warnings": list(update.problem.predictor.data.warnings),
        "notes": list(update.data.notes),
        "machine": update.machine.name,
        "effects": update.problem.predictor.effects_that_act,
        "machine_file": correction.machine_file,
        "data": list(correction.files),
        "readings": len(update.data.of_tip),
        "provenance": dict(correction.provenance),
        "seed": correction.seed,
        "next": list(correction.next),
    }
    if correction.search is not None:
        found["search"] = _search(correction.search)
    return found


def _search(search: StrutLawSearch) -> SearchEntry:
    """Starts and ends of the paper's search, in N/um."""
    machine_law = n_per_um_from_n_per_m(
        np.array([search.strut_law.stiffness_1, search.strut_law.stiffness_2]) / np.exp(search.law)
    )
    return {
        "starts_N_per_um": np.round(machine_law * np.exp(search.starts), 3).tolist(),
        "ends_N_per_um": np.round(machine_law * np.exp(search.ends), 3).tolist(),
        "end_errors_percent": np.round(100.0 * search.end_errors, 4).tolist(),
        "agreeing": search.agreeing,
    }


def _verdict(update: Update) -> str:
    if not update.changed:
        return NOTHING
    if update.worse or not (update.supported or update.forced):
        return REFUSED
    return UPDATED if update.supported else FORCED


def _text(update: Update, verdict: str) -> str:
    """What was done, the cause first, then the error step by step."""
    asked = f"{update.question} " if update.question else ""
    if verdict == NOTHING:
        said = "These data support no further effect: the machine stays as it is."
        return f"{asked}{said} Mean error: {_errors(update)}."
    fit = update.steps[-1].fit
    errors = f"Mean error: {_errors(update)}{_left_out(update)}."
    if update.worse:
        return f"{asked}The new machine would fit worse than the one given: it is not written. {errors}"
    against = "; ".join(f"{one.effect}: {', and '.join(one.reasons)}" for one in update.supports if not one.supported)
    if verdict == REFUSED:
        said = f"The data do not support {against}." if against else "The machine stays as it is."
        return f"{asked}{said} (--force, force=True, writes it all the same.) {errors}"
    if verdict == FORCED:
        said = f" ({against})" if against else ""
        return f"{asked}Added by force, although the data do not support it{said}. {_unconfirmed(update)}{errors}"
    if not fit.names:
        return f"Strut law refitted; no effect added. {errors}"
    cause = joined(fit.findings)
    word = "added" if update.described is None else "added as described, not as identified"
    return f"{cause[:1].upper()}{cause[1:]} ({joined(fit.names)} {word}). {_unconfirmed(update)}{errors}"


def _unconfirmed(update: Update) -> str:
    """Of effects whose form was read off these readings: that, and what the others say; "" where there are none."""
    return "" if update.described is None else f"But {update.described.reason}. "


def _errors(update: Update) -> str:
    """Mean error of every step; of a law that is kept also what refitting it would leave."""
    steps = [(step.name.replace("+ ", "with ", 1), 100.0 * step.error) for step in update.steps]
    law = [(f"({LAW_REFITTED} alone)", 100.0 * update.refitted.error)]
    shown = steps[1:] if update.refitted in update.steps or update.objective != "likelihood" else [*law, *steps[1:]]
    return errors_text(steps[0][1], None, shown)


def _left_out(update: Update) -> str:
    """The last model's error at left-out points."""
    held = 100.0 * update.steps[-1].held.mean_error
    return f" ({held:.2f} % at left-out points)" if np.isfinite(held) else ""


def _step(update: Update, k: int) -> Document:
    step = update.steps[k]
    held = step.held
    along = directions(update.data.of_tip)
    found: dict[str, Any] = {
        "name": step.name,
        "effects": list(step.fit.names),
        **rounded_errors(step.residual),
        "findings": list(step.fit.findings),
        **held_errors(held),
        "by_direction": {
            name: {
                "readings": int((along == name).sum()),
                **rounded_errors(step.residual[along == name]),
                "held_out_error_percent": json_number(100.0 * float(held.errors[along == name].mean())),
            }
            for name in np.unique(along).tolist()
        },
        "strut_law_N_per_um": _law(update.machine, step, update.widening),
        "parameters": step_parameters(step.fit, update.widening),
        "outliers": len(step.fit.scatter.wild),
    }
    if k:
        before = update.steps[k - 1].held
        gain = gain_in_standard_errors(before, held)
        fall = float(error_falls(before, held).mean())
        found["held_out_gain_in_se"] = json_number(gain, 3)
        found["held_out_se_percent"] = json_number(100.0 * abs(fall / gain), 3) if gain else None
    return found


def _law(machine: Machine, step: Step, widening: float) -> list[LawEntry]:
    law = scaled_law(machine.strut_law, step.fit.law)
    count = len(law.parameters)  # of a constant law one, which belongs to no length
    deviations = widening * np.sqrt(np.maximum(np.diag(step.fit.covariance)[:count], 0.0))
    ends = ((law.length_1, law.stiffness_1), (law.length_2, law.stiffness_2))[:count]
    return [
        {
            "length_mm": None if law.constant else json_number(float(mm_from_m(length)), 7),
            "stiffness": json_number(n_per_um_from_n_per_m(stiffness)),
            "sd": json_number(n_per_um_from_n_per_m(stiffness) * float(deviation), 3) if step.fit.law_free else None,
        }
        for (length, stiffness), deviation in zip(ends, deviations, strict=True)
    ]


def step_parameters(fit: Fit, widening: float = 1.0) -> dict[str, dict[str, Any]]:
    """Effect -> key -> value, unit and 95 % interval, and the effect's choice. None stands for infinite."""
    found: dict[str, dict[str, Any]] = {}
    index = 0
    for candidate, sizes in zip(fit.candidates, fit.sizes, strict=True):
        entry: dict[str, Any] = {key: value for key, value in candidate.choice if value not in ("", 0)}
        for component, size in zip(candidate.components, sizes, strict=True):
            low, high = _interval(fit, index, component, float(size), widening)
            si = component.parameter.si
            ends = sorted((component.value(low) / si, component.value(high) / si))
            entry[component.parameter.key] = {
                "value": json_number(component.value(float(size)) / si),
                "unit": component.parameter.unit,
                "interval": [json_number(end) for end in ends],
            }
            index += 1
        found[candidate.name] = entry
    return found


def _interval(fit: Fit, index: int, component: Any, size: float, widening: float) -> tuple[float, float]:
    """95 % interval of a size within its bounds."""
    if index not in fit.free:
        return interval(fit, index, component, size)
    low_bound, high_bound = component.bounds
    reach = NORMAL_95 * widening * fit.deviation(index)
    return max(size - reach, low_bound), min(size + reach, high_bound)


def _support(one: Support) -> SupportEntry:
    return {
        "effect": one.effect,
        "supported": one.supported,
        "reasons": list(one.reasons),
        "mean_abs_error_percent": json_number(100.0 * one.error),
        "held_out_error_percent": json_number(100.0 * one.held_out_error),
        "held_out_reduction_percent": json_number(100.0 * one.fall),
        "held_out_gain_in_se": json_number(one.gain_in_se, 3),
        "likelihood_gain": json_number(one.likelihood_gain),
        "threshold": json_number(one.threshold),
    }


def _assumptions(update: Update) -> list[str]:
    found = [
        f"noise: {update.noise.origin}",
        "as given, nothing is fitted, so leaving points out changes nothing: where the machine file's figures were "
        "fitted to these readings, its error at left-out points looks better than it is",
    ]
    if update.objective != "likelihood":
        found.append(
            "smallest mean |modelled - measured| / measured, as the paper counts it; standard deviations by a "
            "bootstrap over the measuring points"
        )
        return found
    found.append(
        f"an effect is kept if the error at left-out points falls by more than {NEEDED:g} standard error, no parameter "
        "ends at its bound, and its gain in likelihood, the strut law refitted with and without it, is beyond what "
        "the best of all candidates gains by chance once in twenty campaigns"
    )
    if update.widening > 1.0:
        found.append(
            f"standard deviations are {update.widening:.2f} times those of the noise model: the residuals of the last "
            "model are that much wider"
        )
    return found


def residuals_csv(update: Update) -> str:
    """One row a reading of the tip: measured, modelled as given and after, deviations, that with its point left out."""
    data, before, after = update.data.of_tip, update.steps[0].residual, update.last.residual
    wild = np.isin(np.flatnonzero(update.data.tip), update.last.fit.scatter.wild)
    held = update.last.held.residual
    head = [
        "file", "line", "point", "setup", "direction", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "dx",
        "dy", "dz", "measured_N_per_mm", "as_given_N_per_mm", "after_N_per_mm", "as_given_deviation_percent",
        "after_deviation_percent", "left_out_deviation_percent", "wild",
    ]  # fmt: skip
    rows = []
    along = directions(data)
    for i in range(len(data)):
        pose = [*mm_from_m(data.position[i]), *deg_from_rad(data.angles[i]), *data.direction[i]]
        measured = float(n_per_mm_from_n_per_m(data.stiffness[i]))
        modelled = [measured * float(np.exp(-residual[i])) for residual in (before, after)]
        errors = [float(deviation_percent(residual[i])) for residual in (before, after, held)]
        rows.append(
            [
                data.file[i], data.line[i], data.point[i], data.setup[i], along[i],
                *(f"{value + 0.0:.6g}" for value in pose), f"{measured:.1f}", *(f"{value:.1f}" for value in modelled),
                *("" if np.isnan(error) else f"{error + 0.0:.3f}" for error in errors),
                int(wild[i]),
            ]
        )  # fmt: skip
    return csv_text(head, rows)
