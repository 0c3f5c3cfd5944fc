"""What a comparison says: the content of compare.json in shop units, made of the answers under each noise model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, TextArray
from toolpath_stiff.comparison.loop_readings import BesideTip
from toolpath_stiff.comparison.principles import CheckOutcome, NotChecked
from toolpath_stiff.comparison.residuals import Residuals, directions, plane_heights_mm, planes
from toolpath_stiff.comparison.structure import (
    EXCESSES,
    SIGNIFICANT,
    FoundPattern,
    FoundPatterns,
    Pattern,
    Scattering,
    far_off,
)
from toolpath_stiff.comparison.words import sentence
from toolpath_stiff.inference.doubts import question
from toolpath_stiff.inference.errors import deviation_percent, error_figures, errors_text
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.inference.prediction import scaled_law
from toolpath_stiff.inference.slips import SuspectEntry, suspect_entries, suspect_rows
from toolpath_stiff.readings.history import StrutHistory
from toolpath_stiff.units import mm_from_m, n_per_um_from_n_per_m


@dataclass(frozen=True)
class GroupErrors:
    """Errors of some readings, and what scatter alone would leave, by noise."""

    readings: int
    mean_abs_error_percent: float
    bias_percent: float
    rms_percent: float
    scatter_rms_percent: dict[str, float]
    explained_by_scatter_percent: dict[str, float]


@dataclass(frozen=True)
class LawRefitted:
    """What refitting the strut law would leave; N/um at two lengths, of a constant law one stiffness and no length."""

    mean_abs_error_percent: float
    bias_percent: float
    rms_percent: float
    at_mm: list[float]
    N_per_um: list[float]


@dataclass(frozen=True)
class AllErrors(GroupErrors):
    """Of all readings."""

    probability: dict[str, float]
    excess_scatter_percent: dict[str, float]
    strut_law_refitted: LawRefitted | None


@dataclass(frozen=True)
class PatternTest:
    """A pattern on its own."""

    pattern: str
    variable: str
    direction: str
    kind: str
    readings: int
    same: list[str]
    statistic: float
    p_adjusted: float


@dataclass(frozen=True)
class PatternHint:
    """A pattern in words."""

    text: str
    statistic: float
    p_adjusted: float
    pattern: str
    variable: str
    direction: str
    kind: str
    readings: int
    size_percent: float
    indistinguishable_from: list[str]


@dataclass(frozen=True)
class FarReading:
    """A reading far from the model; `reading` is counted from 1 in the order of the files."""

    file: str
    line: int
    reading: int
    point: str
    direction: str
    deviation_percent: float
    standard_deviations: float


@dataclass(frozen=True)
class ModelFree:
    """Checks that need no stiffness model, and those that these data do not allow."""

    checks: list[CheckOutcome]
    cannot_check: list[NotChecked]


@dataclass(frozen=True)
class NoiseFigures:
    """A noise model."""

    name: str
    repeat_percent: float
    clamping_percent: float
    strut_spread_percent: float
    origin: str

    @classmethod
    def of(cls, noise: Noise) -> NoiseFigures:
        """Of a noise model in relative standard deviations."""
        repeat, clamping, spread = (100.0 * s for s in (noise.typical_repeat, noise.clamping, noise.strut_spread))
        return cls(noise.name, repeat, clamping, spread, noise.origin)


@dataclass(frozen=True)
class ComparisonSummary:
    """The content of compare.json."""

    machine: str
    effects: list[str]
    data: list[str]
    readings: int
    seed: int
    baseline: AllErrors
    by_direction: dict[str, GroupErrors]
    by_plane: dict[str, GroupErrors]
    by_setup: dict[str, GroupErrors]
    by_plane_and_direction: dict[str, GroupErrors]
    findings: list[PatternHint]
    by_noise: dict[str, list[PatternHint]]
    tests: list[PatternTest]
    outliers: list[FarReading]
    loops: BesideTip
    history: StrutHistory
    model_free: ModelFree
    noise: list[NoiseFigures]
    not_tested: list[str]
    assumptions: list[str]
    warnings: list[str]
    notes: list[str]
    suspect_rows: list[SuspectEntry]
    hints: list[PatternHint]
    text: str
    question: str
    next: tuple[str, ...] = ()  # commands that go on from here


HINTS = 3  # patterns named where none stands out


MOST_ALIKE = 6  # patterns named as not to be told apart


@dataclass(frozen=True)
class Answer:
    """Everything under one noise model."""

    noise: Noise
    scattering: Scattering
    structure: FoundPatterns
    law: Fit | None
    model_free: list[CheckOutcome]
    problem: Problem

    def least_p(self, pattern: Pattern) -> float:
        """Smallest adjusted probability that a pattern got, tested alone or beside others."""
        tests = (*self.structure.tests, *self.structure.patterns)
        return min((test.p_adjusted for test in tests if test.pattern is pattern), default=1.0)


def summary_of(
    residuals: Residuals,
    answers: Sequence[Answer],
    cannot: list[NotChecked],
    beside: tuple[BesideTip, StrutHistory],
    seed: int,
) -> ComparisonSummary:
    """The content of compare.json, its figures not rounded yet.

    Parameters
    ----------
    residuals
        Of n readings.
    answers
        One a noise model.
    cannot
        Checks without a model that the data do not allow.
    beside
        Readings of other loops; struts alone over their dates.
    seed
        Of the simulated scatter.
    """
    data, last, values = residuals.predictor.data, answers[-1], residuals.values
    question_text = question(residuals.predictor)

    def by(label: TextArray) -> dict[str, GroupErrors]:
        return {str(level): _errors(values, answers, label == level) for level in np.unique(label)}

    where, along = planes(data), directions(data)
    baseline = _baseline(values, answers)
    by_noise = {
        answer.noise.name: [
            _hint(detection, values, first=i == 0) for i, detection in enumerate(answer.structure.patterns)
        ]
        for answer in answers
    }
    findings, tests = _shared_findings(answers, by_noise), _tests(answers)
    noises = [NoiseFigures.of(answer.noise) for answer in answers]
    suspects = suspect_entries([] if last.law is None else suspect_rows(last.problem, last.law), data, left_out=None)
    doubts = [*dict.fromkeys(answer.noise.remark for answer in answers if answer.noise.remark)]
    doubts += [suspect.words for suspect in suspects]
    text = [question_text, overall_text(baseline, noises, pattern=bool(findings))]
    text += [f"{doubt[:1].upper()}{doubt[1:]}." for doubt in doubts]
    return ComparisonSummary(
        machine=residuals.predictor.machine.name,
        effects=residuals.predictor.effects_that_act,
        data=list(dict.fromkeys(data.file.tolist())),
        readings=len(data),
        seed=seed,
        baseline=baseline,
        by_direction=by(along),
        by_plane={name: by(where)[name] for name in plane_heights_mm(data)},
        by_setup=by(data.setup),
        by_plane_and_direction=by(np.array([f"{p} / {d}" for p, d in zip(where, along, strict=True)])),
        findings=findings,
        by_noise=by_noise,
        tests=tests,
        outliers=_far_readings(residuals, last),
        loops=beside[0],
        history=beside[1],
        model_free=ModelFree(_checks(answers), cannot),
        noise=noises,
        not_tested=[*(f"no column {name}" for name in data.missing), *residuals.notes],
        assumptions=_assumptions([answer.noise for answer in answers]),
        warnings=list(data.warnings),
        notes=[*data.notes, *doubts],
        suspect_rows=suspects,
        hints=[] if findings else _hints(last, tests, values),
        text=" ".join(filter(None, text)),
        question=question_text,
    )


def _errors(values: FloatArray, answers: Sequence[Answer], rows: BoolArray) -> GroupErrors:
    """Errors of some readings, and what scatter alone would give."""
    squares = {answer.noise.name: float(answer.scattering.square[rows].mean()) for answer in answers}
    measured = max(float((values[rows] ** 2).mean()), 1e-300)
    return GroupErrors(
        readings=int(rows.sum()),
        **error_figures(values[rows]),
        scatter_rms_percent={name: 100.0 * square**0.5 for name, square in squares.items()},
        explained_by_scatter_percent={name: 100.0 * min(1.0, s / measured) for name, s in squares.items()},
    )


def _baseline(values: FloatArray, answers: Sequence[Answer]) -> AllErrors:
    """The machine file as it stands, over all readings."""
    return AllErrors(
        **vars(_errors(values, answers, np.ones(len(values), dtype=bool))),
        probability={answer.noise.name: answer.structure.probability for answer in answers},
        excess_scatter_percent={answer.noise.name: 100.0 * answer.structure.excess for answer in answers},
        strut_law_refitted=_refitted(answers[-1]),
    )


def _refitted(last: Answer) -> LawRefitted | None:
    """What refitting the strut law's constants would leave, as in a diagnosis; None with too few readings."""
    if last.law is None:
        return None
    law = scaled_law(last.problem.predictor.machine.strut_law, last.law.law)
    lengths = [] if law.constant else [mm_from_m(law.length_1), mm_from_m(law.length_2)]
    stiffness = [n_per_um_from_n_per_m(law.stiffness_1), n_per_um_from_n_per_m(law.stiffness_2)]
    # Of a constant law one, which belongs to no length.
    return LawRefitted(**error_figures(last.law.residual), at_mm=lengths, N_per_um=stiffness[: len(law.parameters)])


def _checks(answers: Sequence[Answer]) -> list[CheckOutcome]:
    """The checks without a model; one holds if it does under any noise model."""
    checks = []
    for outcomes in zip(*(answer.model_free for answer in answers), strict=True):
        holds, p = any(outcome.holds for outcome in outcomes), max(outcome.p_adjusted for outcome in outcomes)
        text = [outcome.text for outcome in outcomes if outcome.holds == holds][-1]
        checks.append(replace(outcomes[-1], holds=holds, p_adjusted=p, text=text))
    return checks


def _tests(answers: Sequence[Answer]) -> list[PatternTest]:
    """Every pattern on its own, the strongest first; probabilities are the larger of the noise models."""
    p = [{test.pattern: test.p_adjusted for test in answer.structure.tests} for answer in answers]
    tests = [
        PatternTest(
            *_about(test.pattern), list(test.pattern.same), test.statistic,
            max(of_noise.get(test.pattern, test.p_adjusted) for of_noise in p),
        )
        for test in answers[-1].structure.tests
    ]  # fmt: skip
    return sorted(tests, key=lambda test: -abs(test.statistic))


def _about(pattern: Pattern) -> tuple[str, str, str, str, int]:
    return pattern.name, pattern.variable, pattern.direction, pattern.kind, int(pattern.rows.sum())


def _hint(test: FoundPattern, values: FloatArray, *, first: bool) -> PatternHint:
    """A pattern as compare.json has it; `first` as of `sentence`."""
    text, size = sentence(test, values, first)
    alike = [*test.pattern.same, *(other.name for other in test.alike)][:MOST_ALIKE]
    return PatternHint(text, test.statistic, test.p_adjusted, *_about(test.pattern), size, alike)


def _shared_findings(answers: Sequence[Answer], by_noise: dict[str, list[PatternHint]]) -> list[PatternHint]:
    """Findings that hold under every noise model, with the larger of their probabilities."""
    fewest = min(answers, key=lambda answer: len(answer.structure.patterns))
    kept = []
    for detection, finding in zip(fewest.structure.patterns, by_noise[fewest.noise.name], strict=True):
        others = [answer.least_p(detection.pattern) for answer in answers if answer is not fewest]
        kept.append(replace(finding, p_adjusted=max([finding.p_adjusted, *others])))
    return [finding for finding in kept if finding.p_adjusted < SIGNIFICANT]


def _hints(last: Answer, tests: list[PatternTest], values: FloatArray) -> list[PatternHint]:
    """The strongest patterns, each of another variable and not like one before, where nothing stands out."""
    kept: list[PatternHint] = []
    alike: set[Pattern] = set()
    p = {test.pattern: test.p_adjusted for test in tests}
    for test in sorted(last.structure.tests, key=lambda test: -abs(test.statistic)):
        if len(kept) < HINTS and test.pattern not in alike and test.pattern.variable not in {h.variable for h in kept}:
            kept.append(replace(_hint(test, values, first=True), p_adjusted=p[test.pattern.name]))
            alike |= {*test.alike}
    return kept


def _far_readings(residuals: Residuals, last: Answer) -> list[FarReading]:
    rest, far, ratio = far_off(residuals.values, last.scattering, last.structure)
    data = residuals.predictor.data
    numbers, off = np.arange(1, len(data) + 1), deviation_percent(rest)
    columns = (data.file, data.line, numbers, data.point, directions(data), off, ratio)
    return [FarReading(*row) for row in zip(*(column[far].tolist() for column in columns), strict=True)]


def _assumptions(noises: Sequence[Noise]) -> list[str]:
    noise = noises[0]
    return [
        *(f"noise, {model.name}: {model.origin}" for model in noises),
        f"struts alike to {100 * noise.strut_spread:.2g} %, joints where the machine file has them to "
        f"{mm_from_m(noise.joint_error):.2g} mm (standard deviations, assumed)",
        f"{100 * noise.outliers:.2g} % of the readings wild, {noise.outlier_width:g} times wider (assumed)",
        "findings and pictures: the machine file as given, its strut law not refitted",
        f"scatter from place to place beyond the noise is looked for from {100 * EXCESSES[1]:.2g} % up",
    ]


def overall_text(figures: AllErrors, noises: Sequence[NoiseFigures], *, pattern: bool) -> str:
    """Error, bias and what scatter explains, in a few sentences; `pattern`: one stands out."""
    bias, refit = figures.bias_percent, figures.strut_law_refitted
    side = f"{abs(bias):.1f} % {'softer' if bias < 0.0 else 'stiffer'}"
    balance = "neither softer nor stiffer" if abs(bias) < 0.05 else side
    errors = errors_text(figures.mean_abs_error_percent, None if refit is None else refit.mean_abs_error_percent)
    parts = []
    for name in (noise.name for noise in noises):
        guesses = {"low": "with the low guess of the noise", "high": "with the high guess"}
        parts.append(
            f"{guesses.get(name, f'with the noise as {name}')}, scatter alone would leave "
            f"{figures.scatter_rms_percent[name]:.1f} % rms, {figures.explained_by_scatter_percent[name]:.0f} % of the "
            f"mean square (p = {figures.probability[name]:.2g})"
        )
    scatter = "; ".join(parts)
    return (
        f"Mean error {errors} ({figures.readings} reading{'' if figures.readings == 1 else 's'}). As given, "
        f"{balance} than modelled on balance, rms {figures.rms_percent:.1f} %. {scatter[0].upper()}{scatter[1:]}."
        + ("" if pattern else " No pattern stands out from scatter.")
    )
