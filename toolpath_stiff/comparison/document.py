"""A comparison as a document: the content of compare.json, in shop units; and its findings as sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NotRequired, TypedDict, cast

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.loop_readings import LoopsDocument
from toolpath_stiff.comparison.principles import CheckEntry
from toolpath_stiff.comparison.residuals import Variable, directions, planes, sentence
from toolpath_stiff.comparison.structure import (
    EXCESSES,
    SIGNIFICANT,
    FoundPattern,
    FoundPatterns,
    Pattern,
    Scattering,
    far_off,
)
from toolpath_stiff.inference.errors import ErrorFigures, deviation_percent, error_figures, errors_text
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.inference.prediction import Predictor, scaled_law
from toolpath_stiff.inference.question import question
from toolpath_stiff.inference.slips import SuspectEntry
from toolpath_stiff.readings.history import HistoryDocument
from toolpath_stiff.readings.measurements import Measurements
from toolpath_stiff.units import certain, mm_from_m, n_per_um_from_n_per_m

HINTS = 3  # patterns named where none stands out


MOST_ALIKE = 6  # patterns named as not to be told apart


class Figures(ErrorFigures):
    """The same beside what scatter alone would leave: {noise: figure}."""

    readings: int
    scatter_rms_percent: dict[str, float]
    explained_by_scatter_percent: dict[str, float]


class PlaneFigures(Figures):
    """Of the readings in a plane."""

    z_mm: float


class LawFigures(TypedDict):
    """A strut law: N/um at two lengths; of a constant law one stiffness and no length."""

    at_mm: list[float]
    N_per_um: list[float]


class RefitFigures(ErrorFigures):
    """What refitting the strut law would leave."""

    strut_law: LawFigures
    excess_scatter_percent: float | None


class BaselineFigures(Figures):
    """All readings."""

    probability: dict[str, float]
    excess_scatter_percent: dict[str, float]
    strut_law_refitted: RefitFigures | None


class TestFigures(TypedDict):
    """A statistic and its adjusted probability."""

    statistic: float
    p_adjusted: float


class PatternTest(TestFigures):
    """A pattern on its own."""

    pattern: str
    variable: str
    direction: str
    kind: str
    readings: int
    same: list[str]


class FindingEntry(TestFigures):
    """A pattern that stands out."""

    text: str
    pattern: str
    variable: str
    direction: str
    kind: str
    readings: int
    size_percent: float
    indistinguishable_from: list[str]
    after_strut_law_refit: NotRequired[TestFigures | None]


class FarOffEntry(TypedDict):
    """A reading far from the model."""

    file: str
    line: int
    reading: int
    point: str
    direction: str
    deviation_percent: float
    standard_deviations: float


class ModelFree(TypedDict):
    """Checks that need no stiffness model, and those that these data do not allow."""

    checks: list[CheckEntry]
    cannot_check: list[dict[str, str]]


class NoiseEntry(TypedDict):
    """A noise model."""

    name: str
    repeat_percent: float
    clamping_percent: float
    strut_spread_percent: float
    origin: str


class ComparisonDocument(TypedDict):
    """The content of compare.json."""

    machine: str
    effects: list[str]
    data: list[str]
    readings: int
    seed: int
    baseline: BaselineFigures
    by_direction: dict[str, Figures]
    by_plane: dict[str, PlaneFigures]
    by_setup: dict[str, Figures]
    by_plane_and_direction: dict[str, Figures]
    findings: list[FindingEntry]
    by_noise: dict[str, list[FindingEntry]]
    tests: list[PatternTest]
    outliers: list[FarOffEntry]
    loops: LoopsDocument
    history: HistoryDocument
    model_free: ModelFree
    noise: list[NoiseEntry]
    not_tested: list[str]
    assumptions: list[str]
    warnings: list[str]
    notes: list[str]
    suspect_rows: list[SuspectEntry]
    hints: list[FindingEntry]
    text: str
    question: str
    next: list[str]


@dataclass(frozen=True)
class Answer:
    """Everything under one noise model."""

    noise: Noise
    scattering: Scattering
    structure: FoundPatterns
    refitted: FoundPatterns | None
    law: Fit | None
    model_free: list[CheckEntry]
    problem: Problem


def _figures(residual: FloatArray, answers: list[Answer], rows: NDArray[np.bool_]) -> Figures:
    """Errors of some readings, and what scatter alone would give: {noise: figure}."""
    scatter_rms, explained = {}, {}
    for one in answers:
        square = float(one.scattering.square[rows].mean())
        scatter_rms[one.noise.name] = 100.0 * square**0.5
        share = min(1.0, square / max(float((residual[rows] ** 2).mean()), 1e-300))
        explained[one.noise.name] = 100.0 * share
    return {
        "readings": int(rows.sum()),
        **error_figures(residual[rows]),
        "scatter_rms_percent": scatter_rms,
        "explained_by_scatter_percent": explained,
    }


def _by(label: NDArray[np.str_], residual: FloatArray, answers: list[Answer]) -> dict[str, Figures]:
    """Figures for every level of a label."""
    return {str(level): _figures(residual, answers, label == level) for level in np.unique(label)}


def document_of(
    predictor: Predictor,
    answers: list[Answer],
    residual: FloatArray,
    looked_for: list[Pattern],
    numbers: list[Variable],
    cannot: list[dict[str, str]],
    notes: list[str],
    seed: int,
    following: list[str],
    suspects: list[SuspectEntry],
    loops: LoopsDocument,
    history: HistoryDocument,
) -> ComparisonDocument:
    """The content of compare.json; `following` are the commands that go on from here."""
    data, asked = predictor.data, question(predictor)
    by_noise = {
        one.noise.name: [as_finding(f, i, one.structure, one.refitted, looked_for, numbers, residual)
                         for i, f in enumerate(one.structure.found)]
        for one in answers
    }  # fmt: skip
    where, along = planes(data), directions(data)
    cells = np.array([f"{p} / {d}" for p, d in zip(where, along, strict=True)])
    baseline = _baseline(predictor, answers, residual)
    findings, tests = merged_findings(by_noise, answers_tests(answers, looked_for)), _tests(answers, looked_for)
    noises = [_noise(one.noise) for one in answers]
    doubts = [
        *dict.fromkeys(one.noise.remark for one in answers if one.noise.remark),
        *(one["words"] for one in suspects),
    ]
    written: ComparisonDocument = {
        "machine": predictor.machine.name,
        "effects": predictor.effects_that_act,
        "data": list(dict.fromkeys(data.file.tolist())),
        "readings": len(data),
        "seed": seed,
        "baseline": baseline,
        "by_direction": _by(along, residual, answers),
        "by_plane": _by_height(where, data, _by(where, residual, answers)),
        "by_setup": _by(data.setup, residual, answers),
        "by_plane_and_direction": _by(cells, residual, answers),
        "findings": findings,
        "by_noise": by_noise,
        "tests": tests,
        "outliers": _far_off_entries(residual, answers[-1], looked_for, data),
        "loops": loops,
        "history": history,
        "model_free": {"checks": _checks(answers), "cannot_check": cannot},
        "noise": noises,
        "not_tested": [*(f"no column {name}" for name in data.missing), *notes],
        "assumptions": _assumptions(answers),
        "warnings": list(data.warnings),
        "notes": [*data.notes, *doubts],
        "suspect_rows": suspects,
        "hints": [] if findings else _hints(answers[-1], tests, looked_for, numbers, residual),
        "text": _in_words(asked, overall_text(len(data), baseline, noises, findings), doubts),
        "question": asked,
        "next": following,
    }
    return cast(ComparisonDocument, certain(written))


def _in_words(asked: str, overall: str, doubts: list[str]) -> str:
    """What is said of the whole: a question first if there is one, then the error, then what is doubtful."""
    return " ".join(filter(None, (asked, overall, *(f"{d[:1].upper()}{d[1:]}." for d in doubts))))


def _baseline(predictor: Predictor, answers: list[Answer], residual: FloatArray) -> BaselineFigures:
    """The machine file as it stands, over all readings."""
    return {
        **_figures(residual, answers, np.ones(len(residual), dtype=bool)),
        "probability": {one.noise.name: one.structure.probability for one in answers},
        "excess_scatter_percent": {one.noise.name: 100.0 * one.structure.excess for one in answers},
        "strut_law_refitted": _refit_figures(predictor, answers[-1]),
    }


def _by_height(where: NDArray[np.str_], data: Measurements, by_plane: dict[str, Figures]) -> dict[str, PlaneFigures]:
    """The planes with their heights, from low to high."""
    heights = {name: float(mm_from_m(data.position[where == name, 2]).mean()) for name in by_plane}
    return {name: {**by_plane[name], "z_mm": heights[name]} for name in sorted(by_plane, key=lambda n: heights[n])}


def _checks(answers: list[Answer]) -> list[CheckEntry]:
    """The checks without a model; one holds if it does under any noise model."""
    free: list[CheckEntry] = [{**one} for one in answers[-1].model_free]
    for i, one in enumerate(free):
        one["holds"] = any(a.model_free[i]["holds"] for a in answers)
        one["p_adjusted"] = max(a.model_free[i]["p_adjusted"] for a in answers)
        same = [a.model_free[i] for a in answers if a.model_free[i]["holds"] == one["holds"]]
        one["text"] = same[-1]["text"]
    return free


def answers_tests(answers: list[Answer], looked_for: list[Pattern]) -> dict[str, dict[str, float]]:
    """Noise -> pattern -> smallest adjusted probability that it got, tested alone or beside others."""
    found: dict[str, dict[str, float]] = {}
    for one in answers:
        best = {looked_for[t.pattern].name: t.p_adjusted for t in one.structure.tests}
        for t in one.structure.found:
            best[looked_for[t.pattern].name] = min(t.p_adjusted, best.get(looked_for[t.pattern].name, 1.0))
        found[one.noise.name] = best
    return found


def _tests(answers: list[Answer], looked_for: list[Pattern]) -> list[PatternTest]:
    """Every pattern on its own, the strongest first; probabilities are the larger of the noise models."""
    rows: list[PatternTest] = []
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
    one: Answer, tests: list[PatternTest], looked_for: list[Pattern], numbers: list[Variable], residual: FloatArray
) -> list[FindingEntry]:
    """The strongest patterns, each of another variable and not like one before, where nothing stands out."""
    kept: list[FindingEntry] = []
    alike: set[int] = set()
    by_name = {row["pattern"]: row["p_adjusted"] for row in tests}
    for test in sorted(one.structure.tests, key=lambda t: -abs(t.statistic)):
        if len(kept) == HINTS:
            break
        if test.pattern not in alike:
            entry = as_finding(test, 0, one.structure, None, looked_for, numbers, residual)
            kept.append({**entry, "p_adjusted": by_name[entry["pattern"]]})
            alike |= {test.pattern, *test.alike}
            alike |= {i for i, p in enumerate(looked_for) if p.variable == entry["variable"]}
    return kept


def _far_off_entries(
    residual: FloatArray, one: Answer, looked_for: list[Pattern], data: Measurements
) -> list[FarOffEntry]:
    """Readings far from the model, `reading` counted from 1 in the order of the files."""
    rest, far, ratio = far_off(residual, one.scattering, one.structure, looked_for)
    return [
        {
            "file": str(data.file[i]),
            "line": int(data.line[i]),
            "reading": i + 1,
            "point": str(data.point[i]),
            "direction": str(directions(data)[i]),
            "deviation_percent": float(deviation_percent(rest[i])),
            "standard_deviations": float(ratio[i]),
        }
        for i in far.tolist()
    ]


def _refit_figures(predictor: Predictor, one: Answer) -> RefitFigures | None:
    """What refitting the strut law's constants would leave, as in a diagnosis; None with too few readings."""
    if one.law is None:
        return None
    law = scaled_law(predictor.machine.strut_law, one.law.law)
    count = len(law.parameters)  # of a constant law one, which belongs to no length
    return {
        **error_figures(one.law.residual),
        "strut_law": {
            "at_mm": [] if law.constant else [mm_from_m(law.length_1), mm_from_m(law.length_2)],
            "N_per_um": [n_per_um_from_n_per_m(law.stiffness_1), n_per_um_from_n_per_m(law.stiffness_2)][:count],
        },
        "excess_scatter_percent": None if one.refitted is None else 100.0 * one.refitted.excess,
    }


def _noise(noise: Noise) -> NoiseEntry:
    return {
        "name": noise.name,
        "repeat_percent": 100.0 * noise.typical_repeat,
        "clamping_percent": 100.0 * noise.clamping,
        "strut_spread_percent": 100.0 * noise.strut_spread,
        "origin": noise.origin,
    }


def _assumptions(answers: list[Answer]) -> list[str]:
    noise = answers[0].noise
    return [
        *(f"noise, {one.noise.name}: {one.noise.origin}" for one in answers),
        f"struts alike to {100 * noise.strut_spread:.2g} %, joints where the machine file has them to "
        f"{mm_from_m(noise.joint_error):.2g} mm (standard deviations, assumed)",
        f"{100 * noise.outliers:.2g} % of the readings wild, {noise.outlier_width:g} times wider (assumed)",
        "findings and pictures: the machine file as given, its strut law not refitted",
        f"scatter from place to place beyond the noise is looked for from {100 * EXCESSES[1]:.2g} % up",
    ]


def as_finding(
    found: FoundPattern,
    step: int,
    structure: FoundPatterns,
    refitted: FoundPatterns | None,
    looked_for: list[Pattern],
    numbers: list[Variable],
    residual: FloatArray,
) -> FindingEntry:
    """A finding as compare.json has it."""
    pattern = looked_for[found.pattern]
    text, size = sentence(found, pattern, {one.name: one for one in numbers}, residual, step == 0)
    entry: FindingEntry = {
        "text": text,
        "statistic": found.statistic,
        "p_adjusted": found.p_adjusted,
        "pattern": pattern.name,
        "variable": pattern.variable,
        "direction": pattern.direction,
        "kind": pattern.kind,
        "readings": int(pattern.rows.sum()),
        "size_percent": size,
        "indistinguishable_from": [*pattern.same, *(looked_for[j].name for j in found.alike)][:MOST_ALIKE],
    }
    if refitted is not None:
        test = next((t for t in refitted.tests if t.pattern == found.pattern), None)
        entry["after_strut_law_refit"] = (
            None if test is None else {"statistic": test.statistic, "p_adjusted": test.p_adjusted}
        )
    return entry


def merged_findings(by_noise: dict[str, list[FindingEntry]], tests: dict[str, dict[str, float]]) -> list[FindingEntry]:
    """Findings that hold under every noise model, with the larger of their probabilities."""
    fewest = min(by_noise, key=lambda name: len(by_noise[name]))
    kept: list[FindingEntry] = []
    for one in by_noise[fewest]:
        others = [tests[name].get(one["pattern"], 1.0) for name in by_noise if name != fewest]
        worst = max([one["p_adjusted"], *others])
        if worst < SIGNIFICANT:
            kept.append({**one, "p_adjusted": worst})
    return kept


def overall_text(
    readings: int, figures: BaselineFigures, noises: Sequence[NoiseEntry], findings: Sequence[FindingEntry]
) -> str:
    """Error, bias and what scatter explains, in a few sentences."""
    bias, refit = figures["bias_percent"], figures["strut_law_refitted"]
    text = (
        f"Mean error {errors_text(figures['mean_abs_error_percent'], refit and refit['mean_abs_error_percent'])} "
        f"({readings} reading{'' if readings == 1 else 's'}). As given, {_balance(bias)}, "
        f"rms {figures['rms_percent']:.1f} %."
    )
    parts = []
    for noise in noises:
        name = noise["name"]
        scatter, share = figures["scatter_rms_percent"][name], figures["explained_by_scatter_percent"][name]
        p = figures["probability"][name]
        guesses = {"low": "with the low guess of the noise", "high": "with the high guess"}
        known = guesses.get(name, f"with the noise as {name}")
        parts.append(
            f"{known}, scatter alone would leave {scatter:.1f} % rms, {share:.0f} % of the mean square (p = {p:.2g})"
        )
    text += " " + "; ".join(parts)[0].upper() + "; ".join(parts)[1:] + "."
    if not findings:
        text += " No pattern stands out from scatter."
    return text


def _balance(bias: float) -> str:
    """To which side the machine differs from its model, %."""
    if abs(bias) < 0.05:
        return "neither softer nor stiffer than modelled on balance"
    return f"{abs(bias):.1f} % {'softer' if bias < 0.0 else 'stiffer'} than modelled on balance"
