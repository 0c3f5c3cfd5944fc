"""`tps compare`: how far the model is from the measurements, where, and how much of it is more than scatter.

What is tested are residuals r = ln(measured / modelled), on which noise and effects are both additive. How errors are
counted and which sign they have: `baseline`.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import Asked, hint
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.units import mm_from_m
from toolpath_stiff.updating.comparison.principles import Shares, assess, load_path_shares, model_free_checks
from toolpath_stiff.updating.comparison.residuals import (
    Label,
    Variable,
    as_finding,
    directions,
    labels,
    merged_findings,
    overall_text,
    patterns,
    planes,
    variables,
)
from toolpath_stiff.updating.comparison.structure import (
    EXCESSES,
    Pattern,
    Scattering,
    Structure,
    far_off,
    find_structure,
)
from toolpath_stiff.updating.inference.evidence import Fit, Problem
from toolpath_stiff.updating.inference.fits import Baseline, deviation_percent, error_figures
from toolpath_stiff.updating.inference.noise import STRUT_SPREAD, Noise, Scatter, covariance, noise_models
from toolpath_stiff.updating.inference.prediction import Predictor, scaled_law
from toolpath_stiff.updating.measurements import Measurements

FloatArray = NDArray[np.float64]

DRAWS = 2000  # simulated sets of readings: probabilities down to 0.05 %
HINTS = 3  # patterns named where none stands out
FEWEST_TO_REFIT = 6  # readings; two constants of the strut law are refitted
TELLS_LAW = 0.01  # smallest over largest singular value from which data tell the law's two constants apart


@dataclass(frozen=True)
class Comparison:
    """A comparison of n readings with a model.

    Attributes
    ----------
    predictor, data
        Model and readings.
    noises
        One, or a low and a high guess.
    log_model
        (n,) ln(N/m) that the readings should show.
    residual
        (n,) ln(measured / modelled).
    scatter
        (n,) standard deviation of `residual` from scatter alone, under the last noise.
    covariance
        (n, n) of the residuals under the last noise, with the excess scatter that was found.
    numbers, names
        What the residuals were held against.
    shares
        Compliance by link.
    document
        Content of compare.json.
    """

    predictor: Predictor
    data: Measurements
    noises: tuple[Noise, ...]
    log_model: FloatArray
    residual: FloatArray
    scatter: FloatArray
    covariance: FloatArray
    numbers: tuple[Variable, ...]
    names: tuple[Label, ...]
    shares: Shares
    document: dict[str, Any]


@dataclass(frozen=True)
class _Answer:
    """Everything under one noise model."""

    noise: Noise
    scattering: Scattering
    structure: Structure
    refitted: Structure | None
    law: Fit | None
    model_free: list[dict[str, Any]]


def compare(
    machine: Machine,
    data: Measurements,
    *,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    jobs: int = 1,
    draws: int = DRAWS,
    asked: Asked | None = None,
) -> Comparison:
    """How far the model is from measurements, where, and how much of it is more than scatter.

    The machine is compared as its file has it; `Comparison.document` is the content of compare.json.

    Parameters
    ----------
    machine, data
        The model's machine; n readings on it.
    noise
        Relative sd of one reading, or (repeat, clamping); None: from the data, else a low and a high guess.
    strut_spread
        Relative sd of the struts' stiffnesses.
    effect_files
        A user's own effects, which the machine file may name.
    seed
        Of the simulated scatter.
    jobs
        Threads; the low and the high guess are independent.
    draws
        Simulated sets of readings.
    asked
        What the commands that go on from here carry.

    Raises
    ------
    InputError
        The model has no stiffness at a measured pose; a noise that cannot be.

    Examples
    --------
    >>> from toolpath_stiff.machine import load_machine
    >>> from toolpath_stiff.updating.measurements import read_measurements
    >>> nist = load_machine("nist")
    >>> found = compare(nist, read_measurements("nist-table1", nist), noise=0.05, draws=200)
    >>> round(found.document["baseline"]["mean_abs_error_percent"], 2)
    9.62
    """
    predictor = Predictor(machine, data, effect_files)
    log_model = predictor.log_stiffness()
    bad = np.flatnonzero(~np.isfinite(log_model))
    if len(bad):
        raise InputError(
            "the model has no stiffness for this reading",
            hint="check the pose and the machine file's effects",
            file=str(data.file[bad[0]]),
            line=int(data.line[bad[0]]),
        )
    residual = np.log(data.stiffness) - log_model
    numbers, (names, notes) = variables(predictor, log_model), labels(data)
    looked_for = patterns(data, numbers, names)
    noises = noise_models(data, noise, strut_spread)
    checks, cannot = model_free_checks(machine, data)
    joints, law_columns, place = predictor.joint_columns(), predictor.law_columns(log_model), _places(data)

    def answer(model: Noise) -> _Answer:
        spread = covariance(model, predictor, joints)
        scattering = Scattering(model, spread, data.clamp, place, draws, seed)
        structure = find_structure(residual, looked_for, scattering)
        refitted = law = None
        if len(data) >= FEWEST_TO_REFIT:
            law = Baseline.of(Problem(predictor, Scatter.of(model, spread), spread)).refitted
            if np.linalg.cond(law_columns) < 1.0 / TELLS_LAW:
                refitted = find_structure(residual, looked_for, scattering, law_columns.T, most=0)
        free = assess(checks, data, spread, scattering.draws(0.0))
        return _Answer(model, scattering, structure, refitted, law, free)

    with ThreadPoolExecutor(max_workers=max(1, jobs)) as pool:
        answers = list(pool.map(answer, noises))
    document = _document(predictor, answers, residual, looked_for, numbers, cannot, notes, seed)
    asked = asked or Asked(tuple(document["data"]), machine.name, tuple(map(str, effect_files)), noise, strut_spread)
    document["next"] = [hint("which effect would explain it", asked.command("diagnose"))]
    last = answers[-1]
    whole = last.scattering.covariance + last.structure.excess**2 * (place[:, None] == place[None, :])
    return Comparison(
        predictor, data, noises, log_model, residual, np.sqrt(last.scattering.square), whole, tuple(numbers),
        tuple(names), load_path_shares(predictor.base, data), document,
    )  # fmt: skip


def _places(data: Measurements) -> NDArray[np.int64]:
    """(n,) number of the place: pose, direction, tool and set-up, whatever the load and the repeat."""
    columns = [np.round(data.position, 6), np.round(data.angles, 6), np.round(data.direction, 6)]
    setup = np.unique(data.setup, return_inverse=True)[1].astype(float)
    columns += [data.tool_extension[:, None], setup.reshape(-1, 1)]
    found = np.unique(np.concatenate(columns, axis=1), axis=0, return_inverse=True)[1]
    return np.asarray(found.reshape(-1), dtype=np.int64)


def _figures(residual: FloatArray, answers: list[_Answer], rows: NDArray[np.bool_]) -> dict[str, Any]:
    """Errors of some readings, and what scatter alone would give: {noise: figure}."""
    found: dict[str, Any] = {"readings": int(rows.sum()), **error_figures(residual[rows])}
    found["scatter_rms_percent"] = {}
    found["explained_by_scatter_percent"] = {}
    for one in answers:
        square = float(one.scattering.square[rows].mean())
        found["scatter_rms_percent"][one.noise.name] = 100.0 * square**0.5
        share = min(1.0, square / max(float((residual[rows] ** 2).mean()), 1e-300))
        found["explained_by_scatter_percent"][one.noise.name] = 100.0 * share
    return found


def _by(label: NDArray[np.str_], residual: FloatArray, answers: list[_Answer]) -> dict[str, Any]:
    """Figures for every level of a label."""
    return {str(level): _figures(residual, answers, label == level) for level in np.unique(label)}


def _document(
    predictor: Predictor,
    answers: list[_Answer],
    residual: FloatArray,
    looked_for: list[Pattern],
    numbers: list[Variable],
    cannot: list[dict[str, str]],
    notes: list[str],
    seed: int,
) -> dict[str, Any]:
    """Content of compare.json."""
    data = predictor.data
    everything = np.ones(len(data), dtype=bool)
    baseline = _figures(residual, answers, everything)
    baseline["probability"] = {one.noise.name: one.structure.probability for one in answers}
    baseline["excess_scatter_percent"] = {one.noise.name: 100.0 * one.structure.excess for one in answers}
    baseline["strut_law_refitted"] = _refit_figures(predictor, answers[-1])
    by_noise = {
        one.noise.name: [as_finding(f, i, one.structure, one.refitted, looked_for, numbers, residual)
                         for i, f in enumerate(one.structure.found)]
        for one in answers
    }  # fmt: skip
    where = planes(data)
    by_plane = _by(where, residual, answers)
    for name, figures in by_plane.items():
        figures["z_mm"] = float(mm_from_m(data.position[where == name, 2]).mean())
    by_plane = dict(sorted(by_plane.items(), key=lambda item: item[1]["z_mm"]))
    along = directions(data)
    cells = np.array([f"{p} / {d}" for p, d in zip(where, along, strict=True)])
    free = [dict(one) for one in answers[-1].model_free]
    for i, one in enumerate(free):
        one["holds"] = any(a.model_free[i]["holds"] for a in answers)
        one["p_adjusted"] = max(a.model_free[i]["p_adjusted"] for a in answers)
        same = [a.model_free[i] for a in answers if a.model_free[i]["holds"] == one["holds"]]
        one["text"] = same[-1]["text"]
    document: dict[str, Any] = {
        "machine": predictor.machine.name,
        "effects": predictor.effects_that_act,
        "data": list(dict.fromkeys(data.file.tolist())),
        "readings": len(data),
        "seed": seed,
        "baseline": baseline,
        "by_direction": _by(along, residual, answers),
        "by_plane": by_plane,
        "by_setup": _by(data.setup, residual, answers),
        "by_plane_and_direction": _by(cells, residual, answers),
        "findings": merged_findings(by_noise, answers_tests(answers, looked_for)),
        "by_noise": by_noise,
        "tests": _tests(answers, looked_for),
        "far_off": _far_off_entries(residual, answers[-1], looked_for, data),
        "model_free": {"checks": free, "cannot_check": cannot},
        "noise": [_noise(one.noise) for one in answers],
        "not_tested": [*(f"no column {name}" for name in data.missing), *notes],
        "assumptions": _assumptions(answers),
        "warnings": list(data.warnings),
        "notes": list(data.notes),
    }
    document["hints"] = _hints(answers[-1], document, looked_for, numbers, residual)
    document["text"] = overall_text(document)
    return document


def answers_tests(answers: list[_Answer], looked_for: list[Pattern]) -> dict[str, dict[str, float]]:
    """Noise -> pattern -> smallest adjusted probability that it got, tested alone or beside others."""
    found: dict[str, dict[str, float]] = {}
    for one in answers:
        best = {looked_for[t.pattern].name: t.p_adjusted for t in one.structure.tests}
        for t in one.structure.found:
            best[looked_for[t.pattern].name] = min(t.p_adjusted, best.get(looked_for[t.pattern].name, 1.0))
        found[one.noise.name] = best
    return found


def _tests(answers: list[_Answer], looked_for: list[Pattern]) -> list[dict[str, Any]]:
    """Every pattern on its own, the strongest first; probabilities are the larger of the noise models."""
    rows = []
    for test in answers[-1].structure.tests:
        one = looked_for[test.pattern]
        others = [next((t for t in a.structure.tests if t.pattern == test.pattern), test) for a in answers]
        rows.append(
            {
                "pattern": one.name,
                "variable": one.variable,
                "direction": one.direction,
                "kind": one.kind,
                "readings": int(one.rows.sum()),
                "same": list(one.same),
                "statistic": test.statistic,
                "p_adjusted": max(t.p_adjusted for t in others),
            }
        )
    return sorted(rows, key=lambda row: -abs(row["statistic"]))


def _hints(
    one: _Answer, document: dict[str, Any], looked_for: list[Pattern], numbers: list[Variable], residual: FloatArray
) -> list[dict[str, Any]]:
    """The strongest patterns, each of another variable and not like one before, where nothing stands out."""
    kept: list[dict[str, Any]] = []
    alike: set[int] = set()
    by_name = {row["pattern"]: row["p_adjusted"] for row in document["tests"]}
    for test in sorted(one.structure.tests, key=lambda t: -abs(t.statistic)):
        if len(kept) == HINTS or document["findings"]:
            break
        if test.pattern not in alike:
            entry = as_finding(test, 0, one.structure, None, looked_for, numbers, residual)
            kept.append({**entry, "p_adjusted": by_name[entry["pattern"]]})
            alike |= {test.pattern, *test.alike}
            alike |= {i for i, p in enumerate(looked_for) if p.variable == entry["variable"]}
    return kept


def _far_off_entries(
    residual: FloatArray, one: _Answer, looked_for: list[Pattern], data: Measurements
) -> list[dict[str, Any]]:
    """Readings far from the model, `reading` counted from 1 in the order of the files."""
    rest, far, ratio = far_off(residual, one.scattering, one.structure, looked_for)
    return [
        {
            "file": str(data.file[i]),
            "line": int(data.line[i]),
            "reading": i + 1,
            "point": str(data.point[i]),
            "direction": str(directions(data)[i]),
            "off_percent": float(deviation_percent(rest[i])),
            "standard_deviations": float(ratio[i]),
        }
        for i in far.tolist()
    ]


def _refit_figures(predictor: Predictor, one: _Answer) -> dict[str, Any] | None:
    """What refitting the strut law's two constants would leave, as in a diagnosis; None with too few readings."""
    if one.law is None:
        return None
    law = scaled_law(predictor.machine.strut_law, one.law.law)
    return {
        **error_figures(one.law.residual),
        "strut_law": {
            "at_mm": [mm_from_m(law.length_1), mm_from_m(law.length_2)],
            "N_per_um": [law.stiffness_1 / 1e6, law.stiffness_2 / 1e6],
        },
        "excess_scatter_percent": None if one.refitted is None else 100.0 * one.refitted.excess,
    }


def _noise(noise: Noise) -> dict[str, Any]:
    return {
        "name": noise.name,
        "repeat_percent": float(100.0 * np.sqrt(np.mean(noise.repeat**2))),
        "clamping_percent": 100.0 * noise.clamping,
        "strut_spread_percent": 100.0 * noise.strut_spread,
        "origin": noise.origin,
    }


def _assumptions(answers: list[_Answer]) -> list[str]:
    noise = answers[0].noise
    return [
        *(f"noise, {one.noise.name}: {one.noise.origin}" for one in answers),
        f"struts alike to {100 * noise.strut_spread:.2g} %, joints where the machine file has them to "
        f"{mm_from_m(noise.joint_error):.2g} mm (standard deviations, assumed)",
        f"{100 * noise.outliers:.2g} % of the readings wild, {noise.outlier_width:g} times wider (assumed)",
        "findings and pictures: the machine file as given, its strut law not refitted",
        f"scatter from place to place beyond the noise is looked for from {100 * EXCESSES[1]:.2g} % up",
    ]
