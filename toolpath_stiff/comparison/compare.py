"""`tps compare`: how far the model is from the measurements, where, and how much of it is more than scatter.

What is tested are residuals r = ln(measured / modelled), on which noise and effects are both additive. How errors are
counted and which sign they have: `baseline`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.load_path import LinkShares, load_path_shares
from toolpath_stiff.comparison.loop_readings import BesideTip, beside_tip, strut_history
from toolpath_stiff.comparison.principles import Check, assess, model_free_checks
from toolpath_stiff.comparison.residuals import ReadingNames, Residuals, Variable
from toolpath_stiff.comparison.structure import Scattering, find_structure
from toolpath_stiff.comparison.summary import Answer, ComparisonSummary, summary_of
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.documents import certain, to_dict
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.covariances import Covariance, Groups
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.fits import base_fit
from toolpath_stiff.inference.noise import Noise, Scatter, covariance, noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.readings.history import StrutHistory
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.results import FolderResult

if TYPE_CHECKING:
    import pandas as pd

DRAWS = 2000  # simulated sets of readings: probabilities down to 0.05 %


FEWEST_TO_REFIT = 6  # readings; two constants of the strut law are refitted


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(FolderResult):
    """How far the model is from n readings of the tip, where, and how much of it is more than scatter.

    Readings of other loops are in the document only.

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
    covariance, places, excess
        Of the residuals under the last noise; readings that are mechanically the same, and the relative sd by which
        these scatter more than noise.
    numbers, names
        What the residuals were held against.
    shares
        Compliance by link.
    summary
        What it says, in shop units: compare.json.
    inputs
        Files that were read.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> comparison = tps.compare("nist-table1", "nist", noise_percent=5)
    >>> round(comparison.to_dict()["baseline"]["mean_abs_error_percent"], 2)
    9.62
    >>> comparison.to_frame()[["direction", "measured_N_per_mm", "modelled_N_per_mm"]].shape
    (42, 3)
    >>> list(comparison.files(plots=False)), type(comparison.plot()).__name__
    (['compare.json', 'residuals.csv'], 'Figure')
    """

    command: ClassVar[str] = "compare"
    shown_by: ClassVar[str] = "compare"

    predictor: Predictor
    data: Readings
    noises: tuple[Noise, ...]
    log_model: FloatArray
    residual: FloatArray
    scatter: FloatArray
    covariance: Covariance
    places: Groups
    excess: float
    numbers: tuple[Variable, ...]
    names: tuple[ReadingNames, ...]
    shares: LinkShares
    summary: ComparisonSummary
    inputs: tuple[str, ...] = ()

    @cached_property
    def document(self) -> dict[str, Any]:
        """The content of compare.json."""
        document: dict[str, Any] = to_dict(self.summary)
        return document

    def to_dict(self) -> dict[str, Any]:
        """The content of compare.json."""
        return dict(self.document)

    def to_frame(self) -> pd.DataFrame:
        """One row a reading, as in `residuals.csv`: measured, modelled, deviation, and what it may vary with."""
        import pandas as pd

        return pd.read_csv(StringIO(self.view.residuals_csv(self)))

    def _short(self) -> str:
        return f"{self.summary.machine}, mean error {self.summary.baseline.mean_abs_error_percent:.2f} %"

    def variance(self, weights: FloatArray) -> float:
        """Of a combination of residuals with weights (n,), by noise and by what it leaves unexplained."""
        of_places = float((self.places.sums(weights) ** 2).sum())
        return float(self.covariance.squares(weights)) + self.excess**2 * of_places


def compare(
    machine: Hexapod,
    data: Readings,
    *,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    draws: int = DRAWS,
) -> Comparison:
    """How far the model is from measurements, where, and how much of it is more than scatter.

    The machine is compared as its file has it; `Comparison.summary` is what compare.json holds.

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
    draws
        Simulated sets of readings.

    Raises
    ------
    InputError
        The model has no stiffness at a measured pose; a noise that cannot be.

    Examples
    --------
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.readings.measurements import read_measurements
    >>> nist = load_machine("nist")
    >>> found = compare(nist, read_measurements("nist-table1", nist), noise=0.05, draws=200)
    >>> round(found.summary.baseline.mean_abs_error_percent, 2)
    9.62
    """
    every, data = data, data.of_tip
    if not len(data):
        raise InputError(
            "no reading of the tip",
            expected="readings of tool against work beside those of other loops",
            hint="`tps reduce` shows struts measured alone over their dates, raw records or stiffnesses",
        )
    residuals = Residuals.of(Predictor(machine, data, effect_files))
    noises = noise_models(data, noise, strut_spread)
    checks, cannot = model_free_checks(machine, data)
    answers = [_answer(residuals, checks, noise_model, draws, seed) for noise_model in noises]
    beside = _beside_tip(machine, every, effect_files, noise_models(every, noise, strut_spread)[-1], seed)
    scattering = answers[-1].scattering
    summary = certain(summary_of(residuals, answers, cannot, beside, seed))
    return Comparison(
        residuals.predictor, data, noises, residuals.log_model, residuals.values, np.sqrt(scattering.square),
        scattering.covariance, scattering.places, answers[-1].structure.excess, tuple(residuals.numbers),
        tuple(residuals.names), load_path_shares(residuals.predictor.base, data), summary,
    )  # fmt: skip


def _answer(residuals: Residuals, checks: list[Check], noise: Noise, draws: int, seed: int) -> Answer:
    """Everything under one noise model."""
    predictor, values = residuals.predictor, residuals.values
    spread = covariance(noise, predictor)
    scattering = Scattering(noise, spread, predictor.data.clamp, residuals.places, draws, seed)
    structure = find_structure(values, residuals.patterns, scattering)
    problem = Problem(predictor, Scatter.of(noise, spread))
    law = base_fit(problem, law_free=True) if len(values) >= FEWEST_TO_REFIT else None
    model_free = assess(checks, predictor.data, spread, scattering.draws(0.0))
    return Answer(noise, scattering, structure, law, model_free, problem)


def _beside_tip(
    machine: Hexapod, data: Readings, effect_files: Sequence[str | Path], noise: Noise, seed: int
) -> tuple[BesideTip, StrutHistory]:
    """Readings of loops beside the tip against the machine as its file has it; struts alone over their dates."""
    if data.beside is None:
        return BesideTip(), StrutHistory()
    predictor = Predictor(machine, data, effect_files)
    log_model = predictor.log_stiffness()
    return beside_tip(data, log_model, covariance(noise, predictor)), strut_history(data, log_model, seed)
