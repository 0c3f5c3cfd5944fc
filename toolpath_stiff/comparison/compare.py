"""`tps compare`: how far the model is from the measurements, where, and how much of it is more than scatter.

What is tested are residuals r = ln(measured / modelled), on which noise and effects are both additive. How errors are
counted and which sign they have: `baseline`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.document import Answer, ComparisonDocument, document_of
from toolpath_stiff.comparison.loop_readings import LoopsDocument, loops_document, strut_history
from toolpath_stiff.comparison.principles import LinkShares, assess, load_path_shares, model_free_checks
from toolpath_stiff.comparison.residuals import Label, Variable, labels, patterns, variables
from toolpath_stiff.comparison.structure import Scattering, find_structure
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import Content
from toolpath_stiff.hints import Asked, hint
from toolpath_stiff.inference.candidates import Candidate, Component
from toolpath_stiff.inference.covariances import Covariance, Groups
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import Baseline, fit_effects
from toolpath_stiff.inference.noise import Noise, Scatter, covariance, noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.slips import suspect_entries, suspect_rows
from toolpath_stiff.machine.model import EffectEntry, Machine
from toolpath_stiff.readings.history import NOTHING, HistoryDocument
from toolpath_stiff.readings.measurements import Measurements, model_stiffness
from toolpath_stiff.results import FolderResult
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.contract import read_parameters

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

DRAWS = 2000  # simulated sets of readings: probabilities down to 0.05 %


FEWEST_TO_REFIT = 6  # readings; two constants of the strut law are refitted


TELLS_LAW = 0.01  # smallest over largest singular value from which data tell the law's two constants apart


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
    document
        Content of compare.json.
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
    shown_by: ClassVar[str] = "compare.page"

    predictor: Predictor
    data: Measurements
    noises: tuple[Noise, ...]
    log_model: FloatArray
    residual: FloatArray
    scatter: FloatArray
    covariance: Covariance
    places: Groups
    excess: float
    numbers: tuple[Variable, ...]
    names: tuple[Label, ...]
    shares: LinkShares
    document: ComparisonDocument
    inputs: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The content of compare.json."""
        return dict(self.document)

    def to_frame(self) -> pd.DataFrame:
        """One row a reading, as in `residuals.csv`: measured, modelled, deviation, and what it may vary with."""
        import pandas as pd

        return pd.read_csv(StringIO(self.view.residuals_csv(self)))

    def plot(self) -> Figure:
        """Measured against modelled."""
        figure: Figure = self.view.measured_modelled_png.figure(self)
        return figure

    def files(self, *, plots: bool = True) -> Mapping[str, Content | Callable[[], Content]]:
        """The files of `tps compare`."""
        files: Mapping[str, Content] = self.view.files(self, plots=plots)
        return files

    def _short(self) -> str:
        return f"{self.document['machine']}, mean error {self.document['baseline']['mean_abs_error_percent']:.2f} %"

    def variance(self, weights: FloatArray) -> float:
        """Of a combination of residuals with weights (n,), by noise and by what it leaves unexplained."""
        of_places = float((self.places.sums(weights) ** 2).sum())
        return float(self.covariance.squares(weights)) + self.excess**2 * of_places


def compare(
    machine: Machine,
    data: Measurements,
    *,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
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
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.readings.measurements import read_measurements
    >>> nist = load_machine("nist")
    >>> found = compare(nist, read_measurements("nist-table1", nist), noise=0.05, draws=200)
    >>> round(found.document["baseline"]["mean_abs_error_percent"], 2)
    9.62
    """
    every, data = data, data.of_tip
    if not len(data):
        raise InputError(
            "no reading of the tip",
            expected="readings of tool against work beside those of other loops",
            hint="`tps reduce` shows struts measured alone over their dates, raw records or stiffnesses",
        )
    predictor = Predictor(machine, data, effect_files)
    log_model = _log_model(predictor, data)
    residual = np.log(data.stiffness) - log_model
    numbers, (names, notes) = variables(predictor, log_model), labels(data)
    looked_for = patterns(data, numbers, names)
    noises = noise_models(data, noise, strut_spread)
    checks, cannot = model_free_checks(machine, data)
    law_columns, place = predictor.law_columns(log_model), _places(data)
    if machine.strut_law.constant:  # the second does nothing
        law_columns = law_columns[:, :1]

    def answer(model: Noise) -> Answer:
        spread = covariance(model, predictor)
        scattering = Scattering(model, spread, data.clamp, place, draws, seed)
        structure = find_structure(residual, looked_for, scattering)
        refitted = law = None
        problem = Problem(predictor, Scatter.of(model, spread))
        if len(data) >= FEWEST_TO_REFIT:
            law = Baseline.of(problem).refitted
            if np.linalg.cond(law_columns) < 1.0 / TELLS_LAW:
                refitted = find_structure(residual, looked_for, scattering, law_columns.T, most=0)
        free = assess(checks, data, spread, scattering.draws(0.0))
        return Answer(model, scattering, structure, refitted, law, free, problem)

    answers = [answer(one) for one in noises]
    last = answers[-1]
    files = tuple(dict.fromkeys(data.file.tolist()))
    asked = asked or Asked(files, machine.name, tuple(map(str, effect_files)), noise, strut_spread)
    document = document_of(
        predictor, answers, residual, looked_for, numbers, cannot, notes, seed,
        [hint("which effect would explain it", asked.command("diagnose"))],
        suspect_entries([] if last.law is None else suspect_rows(last.problem, last.law), data, left_out=None),
        *_loops(machine, every, effect_files, noise_models(every, noise, strut_spread)[-1], seed),
    )  # fmt: skip
    return Comparison(
        predictor, data, noises, log_model, residual, np.sqrt(last.scattering.square), last.scattering.covariance,
        last.scattering.places, last.structure.excess, tuple(numbers), tuple(names),
        load_path_shares(predictor.base, data), document,
    )  # fmt: skip


def _log_model(predictor: Predictor, data: Measurements) -> FloatArray:
    """Logarithm of the modelled stiffness (N/m) of every reading, (n,)."""
    log_model = predictor.log_stiffness()
    bad = np.flatnonzero(~np.isfinite(log_model))
    if len(bad):
        model_stiffness(predictor.base, data)  # which effect leaves none, at which pose, if it is one
        raise InputError(
            "the model has no stiffness for this reading",
            hint="check the pose and the machine file's effects",
            file=str(data.file[bad[0]]),
            line=int(data.line[bad[0]]),
        )
    return log_model


def _loops(
    machine: Machine, data: Measurements, effect_files: Sequence[str | Path], noise: Noise, seed: int
) -> tuple[LoopsDocument, HistoryDocument]:
    """Readings of loops beside the tip against the machine as its file has it; struts alone over their dates."""
    if data.beside is None:
        return {"by_loop": [], "readings": []}, NOTHING
    predictor = Predictor(machine, data, effect_files)
    log_model = predictor.log_stiffness()
    return loops_document(data, log_model, covariance(noise, predictor)), strut_history(data, log_model, seed)


def _places(data: Measurements) -> NDArray[np.int64]:
    """(n,) number of the place: pose, direction, tool and set-up, whatever the load and the repeat."""
    columns = [np.round(data.position, 6), np.round(data.angles, 6), np.round(data.direction, 6)]
    setup = np.unique(data.setup, return_inverse=True)[1].astype(float)
    columns += [data.tool_extension[:, None], setup.reshape(-1, 1)]
    found = np.unique(np.concatenate(columns, axis=1), axis=0, return_inverse=True)[1]
    return np.asarray(found.reshape(-1), dtype=np.int64)


class ByHand:
    """The model against n readings with effects of sizes that somebody sets: made once, then at once for any sizes.

    Attributes
    ----------
    problem
        Readings, model and scatter, under the noise that a diagnosis writes out in full.
    """

    def __init__(
        self,
        machine: Machine,
        data: Measurements,
        *,
        noise: float | tuple[float, float] | None = None,
        strut_spread: float = STRUT_SPREAD,
        effect_files: Sequence[str | Path] = (),
    ) -> None:
        noises = noise_models(data, noise, strut_spread)
        self.problem = Problem.of(Predictor(machine, data, effect_files), max(noises, key=lambda one: one.typical))

    def fit(self, entries: Sequence[EffectEntry] = (), law_free: bool = True, near: Fit | None = None) -> Fit:
        """The strut law fitted beside effects of these sizes, or left as it is.

        With `near`, a fit of other sizes, from its law on and with the readings wild that are wild there: to find out
        which are takes most of the time where readings are many.

        Raises
        ------
        InputError
            An effect is unknown, or has keys or values that it cannot have.
        """
        candidates, sizes = [], []
        for entry in entries:
            effect = find_effect(entry.name, self.problem.predictor.effect_files)
            values = read_parameters(effect, entry, "by hand")
            real = tuple(Component.of(one) for one in effect.parameters if not one.discrete)
            choice = tuple((one.name, values[one.name]) for one in effect.parameters if one.discrete)
            candidates.append(Candidate(effect, choice, real))
            sizes.append(np.array([component.size(values[component.parameter.name]) for component in real]))
        if near is not None:
            return fit_effects(self.problem, candidates, sizes, (), near.law, near.scatter, law_free)
        fit = fit_effects(self.problem, candidates, sizes, (), np.zeros(2), self.problem.scatter, law_free)
        again = self.problem.scatter.with_wild(fit.residual)
        if law_free and again.wild != fit.scatter.wild:
            fit = fit_effects(self.problem, candidates, sizes, (), fit.law, again, law_free)
        return fit
