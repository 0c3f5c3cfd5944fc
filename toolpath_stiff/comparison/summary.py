"""What a comparison says: the content of compare.json, in shop units."""

from __future__ import annotations

from dataclasses import dataclass

from toolpath_stiff.comparison.loop_readings import BesideTip
from toolpath_stiff.comparison.principles import CheckOutcome, NotChecked
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.inference.slips import SuspectEntry
from toolpath_stiff.readings.history import StrutHistory


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
    next: list[str]
