"""An update as a document: the content of update.json, in shop units; and the residuals as a table."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.machine.model import Machine
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m
from toolpath_stiff.updating.comparison.residual_variables import directions
from toolpath_stiff.updating.diagnosis.diagnosis_document import interval, json_number
from toolpath_stiff.updating.inference.fit import NORMAL_95, Fit
from toolpath_stiff.updating.inference.held_out import gain_in_standard_errors
from toolpath_stiff.updating.inference.predict import scaled_law
from toolpath_stiff.updating.update.update import NEEDED, Step, Support, Update

FloatArray = NDArray[np.float64]

MEAN_OVER_SD = 0.80  # mean absolute value of a normal deviate over its standard deviation: sqrt(2 / pi)
UPDATED, REFUSED, FORCED, NOTHING = "updated", "refused", "forced", "nothing added"


def document(
    update: Update,
    updated: Machine | None,
    *,
    files: Sequence[str],
    machine_file: str | None,
    provenance: Mapping[str, Any],
    seed: int,
) -> dict[str, Any]:
    """Everything that `update.json` holds.

    Parameters
    ----------
    update
        What was done.
    updated
        The machine that is written, None if there is none.
    files, machine_file
        Names of the measurement files and of the new machine file.
    provenance
        As in the machine file.
    seed
        For the record.
    """
    steps = [_step(update, k) for k in range(len(update.steps))]
    verdict = _verdict(update)
    uncertainty = updated.uncertainty if updated is not None else None
    return {
        "verdict": verdict,
        "text": _text(update, verdict, steps),
        "objective": update.objective,
        "baseline": steps[0],
        "steps": steps,
        "support": [_support(one) for one in update.supports],
        "turned_down": [_support(one) for one in update.turned_down],
        "noise_percent": json_number(100.0 * update.noise.typical),
        "noise_floor_percent": json_number(100.0 * MEAN_OVER_SD * update.noise.typical),
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
        "machine_file": machine_file,
        "data": list(files),
        "readings": len(update.data),
        "provenance": dict(provenance),
        "seed": seed,
    }


def _verdict(update: Update) -> str:
    if not update.changed:
        return NOTHING
    if not all(one.supported for one in update.supports):
        return FORCED if update.forced else REFUSED
    return UPDATED


def _text(update: Update, verdict: str, steps: list[dict[str, Any]]) -> str:
    first, last = steps[0], steps[-1]
    errors = _fell("mean error", first["mean_abs_error_percent"], last["mean_abs_error_percent"])
    if last["held_out_error_percent"] is not None and first["held_out_error_percent"] is not None:
        held = _fell("at left-out points", first["held_out_error_percent"], last["held_out_error_percent"])
        errors += f", {held}"
    names = " and ".join(last["effects"])
    if verdict == NOTHING:
        return "These data bear no further effect: the machine stays as it is."
    against = "; ".join(f"{one.effect}: {', and '.join(one.reasons)}" for one in update.supports if not one.supported)
    if verdict == REFUSED:
        return f"The data do not bear {against}. (--force writes it all the same.) With it, {errors}."
    if verdict == FORCED:
        return f"Added by force, although the data do not bear it ({against}). {_capital(errors)}."
    if not names:
        return f"Strut law fitted; no effect added. {_capital(errors)}."
    return f"Added {names}. {_capital(errors)}."


def _fell(what: str, before: float, after: float) -> str:
    return f"{what} from {before:.2f} to {after:.2f} %"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _step(update: Update, k: int) -> dict[str, Any]:
    step = update.steps[k]
    held = step.held
    along = directions(update.data)
    found: dict[str, Any] = {
        "name": step.name,
        "effects": list(step.fit.names),
        **_errors(step.fit.residual),
        "held_out_error_percent": json_number(100.0 * held.mean_error),
        "held_out_rms_percent": json_number(100.0 * held.rms),
        "by_direction": {
            name: {
                "readings": int((along == name).sum()),
                **_errors(step.fit.residual[along == name]),
                "held_out_error_percent": json_number(100.0 * float(held.errors[along == name].mean())),
            }
            for name in np.unique(along).tolist()
        },
        "strut_law_N_per_um": _law(update.machine, step, update.widening),
        "parameters": step_parameters(step.fit, update.widening),
        "wild_readings": len(step.fit.scatter.wild),
    }
    if k:
        before = update.steps[k - 1].held
        gain = gain_in_standard_errors(before, held)
        fall = before.mean_error - held.mean_error
        found["held_out_gain_in_se"] = json_number(gain, 3)
        found["held_out_se_percent"] = json_number(100.0 * abs(fall / gain), 3) if gain else None
    return found


def _errors(residual: FloatArray) -> dict[str, Any]:
    """Of (modelled - measured) / measured."""
    relative = np.expm1(-residual)
    return {
        "mean_abs_error_percent": json_number(100.0 * float(np.abs(relative).mean())),
        "bias_percent": json_number(100.0 * float(relative.mean())),
        "rms_percent": json_number(100.0 * float(np.sqrt(np.mean(relative**2)))),
    }


def _law(machine: Machine, step: Step, widening: float) -> list[dict[str, Any]]:
    law = scaled_law(machine.strut_law, step.fit.law)
    deviations = widening * np.sqrt(np.maximum(np.diag(step.fit.covariance)[:2], 0.0))
    ends = ((law.length_1, law.stiffness_1), (law.length_2, law.stiffness_2))
    return [
        {
            "length_mm": json_number(float(mm_from_m(length)), 7),
            "stiffness": json_number(stiffness / 1e6),
            "sd": json_number(stiffness / 1e6 * float(deviation), 3) if step.fit.law_free else None,
        }
        for (length, stiffness), deviation in zip(ends, deviations, strict=True)
    ]


def step_parameters(fit: Fit, widening: float = 1.0) -> dict[str, Any]:
    """Effect -> key -> value, unit and 95 % interval, and the effect's choice. None stands for infinite."""
    found: dict[str, Any] = {}
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


def _support(one: Support) -> dict[str, Any]:
    return {
        "effect": one.effect,
        "supported": one.supported,
        "reasons": list(one.reasons),
        "mean_abs_error_percent": json_number(100.0 * one.error),
        "held_out_error_percent": json_number(100.0 * one.held_out_error),
        "held_out_fall_percent": json_number(100.0 * one.fall),
        "held_out_gain_in_se": json_number(one.gain_in_se, 3),
        "likelihood_gain": json_number(one.likelihood_gain),
        "threshold": json_number(one.threshold),
    }


def _assumptions(update: Update) -> list[str]:
    found = [
        f"noise: {update.noise.origin}",
        "'as given' nothing is fitted, so leaving points out changes nothing: where the machine file's figures were "
        "fitted to these readings, its error at left-out points looks better than it is",
    ]
    if update.objective != "likelihood":
        found.append(
            "smallest mean |model - measured| / measured, as the paper counts it; standard deviations by a bootstrap "
            "over the measuring points"
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
    """One row a reading: measured, modelled before and after, errors, and the error where its point was left out."""
    data, before, after = update.data, update.steps[0].fit.residual, update.last.fit.residual
    held = update.last.held.residual
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(
        [
            "file", "line", "point", "setup", "direction", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "dx",
            "dy", "dz", "measured_N_per_mm", "before_N_per_mm", "after_N_per_mm", "before_error_percent",
            "after_error_percent", "left_out_error_percent", "wild",
        ]
    )  # fmt: skip
    along = directions(data)
    for i in range(len(data)):
        pose = [*mm_from_m(data.position[i]), *deg_from_rad(data.angles[i]), *data.direction[i]]
        measured = float(n_per_mm_from_n_per_m(data.stiffness[i]))
        modelled = [measured * float(np.exp(-residual[i])) for residual in (before, after)]
        errors = [100.0 * float(np.expm1(-residual[i])) for residual in (before, after, held)]
        table.writerow(
            [
                data.file[i], data.line[i], data.point[i], data.setup[i], along[i],
                *(f"{value + 0.0:.6g}" for value in pose), f"{measured:.1f}", *(f"{value:.1f}" for value in modelled),
                *("" if np.isnan(error) else f"{error + 0.0:.3f}" for error in errors),
                int(i in update.last.fit.scatter.wild),
            ]
        )  # fmt: skip
    return out.getvalue()
