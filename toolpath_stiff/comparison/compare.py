"""`tps compare`: size of the model's error, where it is, and how much of it is more than scatter.

What is tested are residuals r = ln(measured / modelled), on which noise and effects are both additive. How errors are
counted and which sign they have: `baseline`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.load_path import load_path_shares
from toolpath_stiff.comparison.loop_readings import beside_tip
from toolpath_stiff.comparison.principles import assess, model_free_checks
from toolpath_stiff.comparison.residuals import ReadingNames, Variable, labels, modelled, patterns, variables
from toolpath_stiff.comparison.structure import FoundPattern, Scattering, find_structure, shared_tests
from toolpath_stiff.comparison.summary import ComparisonSummary, summary_of
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.documents import Document, certain, to_dict
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.element_predictor import predictor_of
from toolpath_stiff.inference.noise import Noise, covariance, noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.repeats import repeat_groups
from toolpath_stiff.machine.model import MachineTool, as_hexapod
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.results import DataFrame, FolderResult

DRAWS = 2000  # simulated sets of readings: probabilities down to 0.05 %


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(FolderResult):
    """Size of the model's error over n readings of the tip, where it is, and how much is more than scatter.

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
    numbers, names
        What the residuals were held against.
    tests
        Every pattern that was looked for, on its own.
    shares
        Compliance by link: (3,) m/N along X, Y, Z.
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
    numbers: tuple[Variable, ...]
    names: tuple[ReadingNames, ...]
    tests: tuple[FoundPattern, ...]
    shares: dict[str, FloatArray]
    summary: ComparisonSummary
    inputs: tuple[str, ...] = ()

    @cached_property
    def document(self) -> Document:
        """Content of compare.json."""
        return dict(to_dict(self.summary))

    def to_dict(self) -> dict[str, Any]:
        """Content of compare.json."""
        return dict(self.document)

    def to_frame(self) -> DataFrame:
        """One row per reading, as in `residuals.csv`: measured, modelled, deviation, and variables it may depend on."""
        import pandas as pd

        return pd.read_csv(StringIO(self.view.residuals_csv(self)))

    def _short(self) -> str:
        return f"{self.summary.machine}, mean error {self.summary.baseline.mean_abs_error_percent:.2f} %"


def compare(
    machine: MachineTool,
    data: Readings,
    *,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    draws: int = DRAWS,
) -> Comparison:
    """Compare model and measurements: size of the error, where it is, and how much of it is more than scatter.

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
    tip = data.of_tip
    if not len(tip):
        raise InputError(
            "no reading of the tip",
            expected="readings of tool against work beside those of other loops",
            hint="`tps reduce` shows struts measured alone over their dates, raw records or stiffnesses",
        )
    predictor = predictor_of(machine, tip, effect_files)
    log_model, noises = modelled(predictor), noise_models(tip, noise, strut_spread)
    values = np.log(tip.stiffness) - log_model
    numbers, (names, notes) = variables(predictor, log_model), labels(tip)
    looked_for = patterns(tip, numbers, names)
    places = repeat_groups(tip, apart=("force", "loop"))
    checks, not_checked = model_free_checks(machine, tip)
    structures, outcomes = [], []
    for model in noises:
        scattering = Scattering(model, covariance(model, predictor), tip.clamp, places, draws, seed)
        structures.append(find_structure(values, looked_for, scattering))
        outcomes.append(assess(checks, tip, scattering.covariance, scattering.draws(0.0)))
    summary = summary_of(predictor, values, structures, outcomes, not_checked, notes, seed)
    if data.beside is not None:  # other loops are compared with the machine as in its file
        every = Predictor(as_hexapod(machine, "a reading beside the tip"), data, effect_files)
        spread = covariance(noise_models(data, noise, strut_spread)[-1], every)
        summary = replace(summary, loops=beside_tip(data, every.log_stiffness(), spread))
    return Comparison(
        predictor,
        predictor.data,
        noises,
        log_model,
        values,
        np.sqrt(scattering.square),
        tuple(numbers),
        tuple(names),
        shared_tests(structures),
        load_path_shares(predictor.base, tip),
        certain(summary),
    )
