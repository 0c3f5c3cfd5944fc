"""Content of compare.json in shop units, made from the results under each noise model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, TextArray
from toolpath_stiff.comparison.loop_readings import LoopMean
from toolpath_stiff.comparison.principles import CheckOutcome
from toolpath_stiff.comparison.residuals import directions, plane_heights_mm, planes
from toolpath_stiff.comparison.structure import EXCESSES, SIGNIFICANT, FoundPatterns, far_off
from toolpath_stiff.comparison.words import sentence
from toolpath_stiff.inference.doubts import question
from toolpath_stiff.inference.errors import deviation_percent, error_figures, errors_text
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import base_fit
from toolpath_stiff.inference.noise import Noise, Scatter
from toolpath_stiff.inference.prediction import Predictor, scaled_law
from toolpath_stiff.inference.slips import SuspectEntry, suspect_entries, suspect_rows
from toolpath_stiff.machine.model import Hexapod, StrutLaw
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.units import mm_from_m, n_per_um_from_n_per_m

FEWEST_TO_REFIT = 6  # readings; two constants of the strut law are refitted


@dataclass(frozen=True)
class GroupErrors:
    """Errors of a group of readings, and the error that scatter alone would leave, by noise model."""

    readings: int
    mean_abs_error_percent: float
    bias_percent: float
    rms_percent: float
    scatter_rms_percent: dict[str, float]
    explained_by_scatter_percent: dict[str, float]


@dataclass(frozen=True)
class LawRefitted:
    """Errors left after refitting the strut law; its N/um at two lengths (a constant law: one value, no length)."""

    mean_abs_error_percent: float
    bias_percent: float
    rms_percent: float
    at_mm: list[float]
    N_per_um: list[float]


@dataclass(frozen=True)
class AllErrors(GroupErrors):
    """Errors of all readings."""

    probability: dict[str, float]
    excess_scatter_percent: dict[str, float]
    strut_law_refitted: LawRefitted | None


@dataclass(frozen=True)
class PatternFinding:
    """A pattern found, in words."""

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
class NoiseFigures:
    """Figures of a noise model."""

    name: str
    repeat_percent: float
    clamping_percent: float
    strut_spread_percent: float
    origin: str

    @classmethod
    def of(cls, noise: Noise) -> NoiseFigures:
        """Figures of a noise model given in relative standard deviations."""
        repeat, clamping, spread = (100.0 * sd for sd in (noise.typical_repeat, noise.clamping, noise.strut_spread))
        return cls(noise.name, repeat, clamping, spread, noise.origin)


@dataclass(frozen=True, kw_only=True)
class ComparisonSummary:
    """Content of compare.json.

    `model_free`: checks that need no stiffness model; `not_checked`: those that these data do not allow -> why.
    """

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
    findings: list[PatternFinding]
    outliers: list[FarReading]
    loops: Sequence[LoopMean] = ()
    model_free: list[CheckOutcome]
    not_checked: dict[str, str]
    noise: list[NoiseFigures]
    not_tested: list[str]
    assumptions: list[str]
    warnings: list[str]
    notes: list[str]
    suspect_rows: list[SuspectEntry]
    text: str
    question: str
    next: tuple[str, ...] = ()  # commands that go on from here


MOST_ALIKE = 6  # most patterns named as indistinguishable


def summary_of(
    predictor: Predictor,
    values: FloatArray,
    structures: Sequence[FoundPatterns],
    outcomes: Sequence[Sequence[CheckOutcome]],
    not_checked: dict[str, str],
    notes: Sequence[str],
    seed: int,
) -> ComparisonSummary:
    """Content of compare.json, with unrounded figures.

    Parameters
    ----------
    predictor, values
        Model and n readings; their residuals.
    structures, outcomes
        Under each noise model: what they show, and the checks without a model.
    not_checked, notes
        Checks without a model that the data do not allow; what was left out of the search for patterns.
    seed
        Of the simulated scatter.
    """
    data, last, question_text = predictor.data, structures[-1], question(predictor)

    def by(label: TextArray) -> dict[str, GroupErrors]:
        return {str(level): _errors(values, structures, label == level) for level in np.unique(label)}

    where, along = planes(data), directions(data)
    machine = predictor.base.machine
    hexapod = machine if isinstance(machine, Hexapod) else None
    law, suspects = None, suspect_entries([], data, left_out=None)
    if hexapod and len(values) >= FEWEST_TO_REFIT:
        problem = Problem(predictor, Scatter.of(last.scattering.noise, last.scattering.covariance))
        law = base_fit(problem, law_free=True)
        suspects = suspect_entries(suspect_rows(problem, law), data, left_out=None)
    baseline = AllErrors(
        **vars(_errors(values, structures, np.ones(len(values), dtype=bool))),
        probability={found.scattering.noise.name: found.probability for found in structures},
        excess_scatter_percent={found.scattering.noise.name: 100.0 * found.excess for found in structures},
        strut_law_refitted=_refitted(hexapod.strut_law, law) if hexapod and law else None,
    )
    findings, noises = _findings(structures, values), [found.scattering.noise for found in structures]
    doubts = [*dict.fromkeys(noise.remark for noise in noises if noise.remark)]
    doubts += [suspect.words for suspect in suspects]
    text = [question_text, overall_text(baseline, pattern=bool(findings))]
    text += [f"{doubt[:1].upper()}{doubt[1:]}." for doubt in doubts]
    return ComparisonSummary(
        machine=machine.name,
        effects=predictor.effects_that_act,
        data=list(dict.fromkeys(data.file.tolist())),
        readings=len(data),
        seed=seed,
        baseline=baseline,
        by_direction=by(along),
        by_plane={name: by(where)[name] for name in plane_heights_mm(data)},
        by_setup=by(data.setup),
        by_plane_and_direction=by(np.array([f"{p} / {d}" for p, d in zip(where, along, strict=True)])),
        findings=findings,
        outliers=_far_readings(data, values, last),
        model_free=[_outcome(of_noises) for of_noises in zip(*outcomes, strict=True)],
        not_checked=not_checked,
        noise=[NoiseFigures.of(noise) for noise in noises],
        not_tested=[*(f"no column {name}" for name in data.missing), *notes],
        assumptions=_assumptions(noises, hexapod is not None),
        warnings=list(data.warnings),
        notes=[*data.notes, *doubts],
        suspect_rows=suspects,
        text=" ".join(filter(None, text)),
        question=question_text,
    )


def _errors(values: FloatArray, structures: Sequence[FoundPatterns], rows: BoolArray) -> GroupErrors:
    """Errors of a group of readings, and those that scatter alone would give."""
    squares = {f.scattering.noise.name: float(f.scattering.square[rows].mean()) for f in structures}
    measured = max(float((values[rows] ** 2).mean()), 1e-300)
    return GroupErrors(
        readings=int(rows.sum()),
        **error_figures(values[rows]),
        scatter_rms_percent={name: 100.0 * square**0.5 for name, square in squares.items()},
        explained_by_scatter_percent={name: 100.0 * min(1.0, s / measured) for name, s in squares.items()},
    )


def _refitted(given: StrutLaw, fit: Fit) -> LawRefitted:
    """Errors left after refitting the strut law's constants, as a diagnosis does."""
    law = scaled_law(given, fit.law)
    return LawRefitted(
        **error_figures(fit.residual),
        # A constant law has one stiffness, which belongs to no length.
        at_mm=[] if law.constant else [mm_from_m(law.length_1), mm_from_m(law.length_2)],
        N_per_um=[n_per_um_from_n_per_m(k) for k in (law.stiffness_1, law.stiffness_2)][: len(law.parameters)],
    )


def _outcome(of_noises: Sequence[CheckOutcome]) -> CheckOutcome:
    """Outcome of a check without a model: it holds if it holds under any noise model."""
    holds = any(outcome.holds for outcome in of_noises)
    text = [outcome.text for outcome in of_noises if outcome.holds == holds][-1]
    return replace(of_noises[-1], holds=holds, p_adjusted=max(outcome.p_adjusted for outcome in of_noises), text=text)


def _findings(structures: Sequence[FoundPatterns], values: FloatArray) -> list[PatternFinding]:
    """Findings that hold under every noise model, with the largest of their probabilities."""
    fewest = min(structures, key=lambda structure: len(structure.patterns))
    findings = []
    for found in fewest.patterns:
        pattern = found.pattern
        p = max([found.p_adjusted, *(other.least_p(pattern) for other in structures if other is not fewest)])
        text, size = sentence(found, values, first=found is fewest.patterns[0])
        finding = PatternFinding(
            text=text,
            statistic=found.statistic,
            p_adjusted=p,
            pattern=pattern.name,
            variable=pattern.variable,
            direction=pattern.direction,
            kind=pattern.kind,
            readings=int(pattern.rows.sum()),
            size_percent=size,
            indistinguishable_from=[*pattern.same, *(other.name for other in found.alike)][:MOST_ALIKE],
        )
        findings += [finding] if p < SIGNIFICANT else []
    return findings


def _far_readings(data: Readings, values: FloatArray, last: FoundPatterns) -> list[FarReading]:
    rest, far, ratio = far_off(values, last)
    columns = (data.file, data.line, np.arange(1, len(data) + 1), data.point, directions(data),
               deviation_percent(rest), ratio)  # fmt: skip
    return [FarReading(*row) for row in zip(*(column[far].tolist() for column in columns), strict=True)]


def _assumptions(noises: Sequence[Noise], hexapod: bool) -> list[str]:
    noise = noises[0]
    spread = f"{100 * noise.strut_spread:.2g} %"
    alike = (
        f"struts alike to {spread}, joints where the machine file has them to "
        f"{mm_from_m(noise.joint_error):.2g} mm (standard deviations, assumed)"
    )
    own = f"elements as stiff as the machine file has them to {spread} (standard deviation, assumed), at their places"
    return [
        *(f"noise, {model.name}: {model.origin}" for model in noises),
        alike if hexapod else own,
        f"{100 * noise.outliers:.2g} % of the readings wild, {noise.outlier_width:g} times wider (assumed)",
        f"findings and pictures: the machine file as given{', its strut law not refitted' if hexapod else ''}",
        f"scatter from place to place beyond the noise is looked for from {100 * EXCESSES[1]:.2g} % up",
    ]


def overall_text(figures: AllErrors, *, pattern: bool) -> str:
    """Error, bias and the part that scatter explains, in a few sentences; `pattern`: a pattern stands out."""
    bias, refit = figures.bias_percent, figures.strut_law_refitted
    side = f"{abs(bias):.1f} % {'softer' if bias < 0.0 else 'stiffer'}"
    balance = "neither softer nor stiffer" if abs(bias) < 0.05 else side
    errors = errors_text(figures.mean_abs_error_percent, None if refit is None else refit.mean_abs_error_percent)
    guesses = {"low": "with the low guess of the noise", "high": "with the high guess"}
    scatter = "; ".join(
        f"{guesses.get(name, f'with the noise as {name}')}, scatter alone would leave {rms:.1f} % rms, "
        f"{figures.explained_by_scatter_percent[name]:.0f} % of the mean square (p = {figures.probability[name]:.2g})"
        for name, rms in figures.scatter_rms_percent.items()
    )
    return (
        f"Mean error {errors} ({figures.readings} reading{'' if figures.readings == 1 else 's'}). As given, "
        f"{balance} than modelled on balance, rms {figures.rms_percent:.1f} %. {scatter[0].upper()}{scatter[1:]}."
        + ("" if pattern else " No pattern stands out from scatter.")
    )
