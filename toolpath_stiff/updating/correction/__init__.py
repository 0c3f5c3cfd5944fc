"""A model corrected: what it lacks is added, fitted, judged, and written to a machine file with its origin.

The paper's own estimation: strut law and platform bars that make the mean relative error smallest.

Clinton, Zhang and Wavering (1997) choose the strut's stiffness at two lengths so that |model - measured| / measured,
averaged over all readings, is smallest, and show in their Figure 3 how that error hangs on the stiffness of the bars
that stand for the platform. The objective has a kink wherever the model meets a reading: a search without derivatives
(Nelder and Mead 1965) from several starts; the paper searched one variable at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import Asked, command_line, hint, options
from toolpath_stiff.machine.model import Machine, StrutLaw
from toolpath_stiff.stiffness.model import build_model, setup_of
from toolpath_stiff.units import n_per_um_from_n_per_m
from toolpath_stiff.updating.correction.ladder import Step, Update, build_ladder, parse_addition
from toolpath_stiff.updating.correction.machines import data_hash
from toolpath_stiff.updating.inference import question
from toolpath_stiff.updating.inference.evidence import Fit, Problem
from toolpath_stiff.updating.inference.fits import AS_GIVEN, LAW_REFITTED, Baseline, HeldOut
from toolpath_stiff.updating.inference.noise import noise_models
from toolpath_stiff.updating.inference.prediction import NO_CHANGE, Predictor, at_both_ends, scaled_law
from toolpath_stiff.updating.measurements import Measurements

LIKELIHOOD, MEAN_ERROR = OBJECTIVES = ("likelihood", "mean-error")
STARTS = 6
START_SPREAD = 0.2  # sd of the starts' logarithms: a law wrong by 20 %
FIRST_STEPS = 0.05 * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
SAME = 1e-5  # of the mean error: two ends that close are one minimum

# N/m; the paper's Figure 3 spans platforms far softer than any real one up to rigid ones.
FIGURE_3_BARS = tuple(float(k) for k in np.geomspace(1e8, 1e13, 26))


@dataclass(frozen=True)
class Correction:
    """What an update found, and the machine that came of it.

    Attributes
    ----------
    update
        Steps, and whether the data support them.
    machine
        The machine with what was added; None where nothing is to be written.
    provenance
        Where the fitted values come from, as the machine file has it.
    files, machine_file, seed
        Names of the measurement files; of the machine file that is written, None if there is none.
    next
        Commands that use the new machine.
    search, bars
        Of the paper's own estimation: how its searches ended; its Figure 3. None otherwise.
    """

    update: Update
    machine: Machine | None
    provenance: dict[str, Any]
    files: tuple[str, ...]
    machine_file: str | None
    seed: int
    next: tuple[str, ...] = ()
    search: StrutLawSearch | None = None
    bars: BarCurve | None = None


def update(
    machine: Machine,
    data: Measurements,
    add: Sequence[str] = (),
    *,
    strut_law: bool = False,
    keep_strut_law: bool = False,
    auto: bool = False,
    force: bool = False,
    objective: str = LIKELIHOOD,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    files: Sequence[str] = (),
    machine_file: str = "machine.toml",
    asked: Asked | None = None,
    progress: Callable[[str], None] | None = None,
) -> Correction:
    """Fit effects to measurements, judge whether the data support them, and make the machine that carries them.

    Parameters
    ----------
    machine, data
        The model and n readings.
    add
        Effects to be added: `weak_strut`, or with what they act on, `weak_strut:strut=3`.
    strut_law
        Write the refitted strut law even if no effect is added.
    keep_strut_law
        Keep the strut law of the machine file; else its two stiffnesses are fitted along with every effect.
    auto
        Go on adding effects while the data support them.
    force
        Keep what the data do not support, or readings hardly of this machine; never what fits worse than `machine`.
    objective
        "likelihood"; or "mean-error", the paper's own estimation, of the strut law alone.
    noise, strut_spread, effect_files, seed, progress
        As in `diagnose`.
    files
        Names of the measurement files, whose bytes are hashed for the record; empty: those that `data` names.
    machine_file
        Name that the new machine file is to have, for the record and the commands that use it.
    asked
        What the commands that go on from here carry.

    Raises
    ------
    InputError
        Too few readings, an effect named twice or present already, unknown or without its column, nothing to do.

    Examples
    --------
    >>> from toolpath_stiff.machine import load_machine
    >>> from toolpath_stiff.updating.measurements import read_measurements
    >>> nist = load_machine("nist")
    >>> found = update(nist, read_measurements("nist-table1", nist), strut_law=True)
    >>> [f"{step.name}: {100 * step.error:.2f} %" for step in found.update.steps]
    ['as given: 9.62 %', 'strut law refitted: 9.72 %']
    """
    files = tuple(files) or tuple(dict.fromkeys(data.file.tolist()))
    asked = asked or Asked(files, machine.name, tuple(map(str, effect_files)), noise, strut_spread)
    flags = {"strut_law": strut_law, "keep_strut_law": keep_strut_law, "auto": auto, "force": force}
    search = None
    if objective == MEAN_ERROR:
        check_mean_error(add, strut_law, auto)
        found, search = update_by_mean_error(
            machine, data.of_tip, force=force, noise=noise, strut_spread=strut_spread, effect_files=effect_files,
            seed=seed, progress=progress,
        )  # fmt: skip
    else:
        found = build_ladder(
            machine, data, [parse_addition(text, data, effect_files) for text in add], strut_law=strut_law,
            keep_law=keep_strut_law, auto=auto, force=force, noise=noise, strut_spread=strut_spread,
            effect_files=effect_files, seed=seed, progress=progress,
        )  # fmt: skip
    # Where its results go does not matter to the command that repeats the fit.
    own = options(add=list(add), **flags, objective=objective if search is not None else None, seed=seed or None)
    provenance = _provenance(found, files, asked.command("update", *own))
    updated = found.fitted(provenance) if found.accepted else None
    return Correction(
        found,
        updated,
        provenance,
        files,
        machine_file if updated is not None else None,
        seed,
        () if updated is None else _next(updated, machine_file, asked, effect_files),
        search,
        None if search is None else _bars(machine, data, seed, progress),
    )


def check_mean_error(add: Sequence[str], strut_law: bool, auto: bool) -> None:
    """Raise `InputError` where the paper's own estimation is asked for more than it can do."""
    if add or auto or not strut_law:
        raise InputError(
            "--objective mean-error is the paper's own estimation, of the strut law alone",
            expected="--strut-law, without --add and --auto",
            hint="effects are fitted by likelihood",
        )


def _provenance(update: Update, files: Sequence[str], command: str) -> dict[str, Any]:
    """Where the fitted values come from. No date: the same data and command give the same bytes."""
    described = {} if update.described is None else {"described": f"not confirmed: {update.described.reason}"}
    return {
        **described,
        "data": list(files),
        "data_sha256": data_hash(files),
        "readings": len(update.data),
        "command": command,
        "noise": update.noise.origin,
        "mean_error_before_percent": round(100.0 * update.steps[0].error, 3),
        "mean_error_after_percent": round(100.0 * update.last.error, 3),
        "left_out_error_after_percent": round(100.0 * update.last.held.mean_error, 3),
    }


def _next(updated: Machine, machine_file: str, asked: Asked, effect_files: Sequence[str | Path]) -> tuple[str, ...]:
    """Commands that use the new machine; an effect that belongs to a set-up acts only where that is named."""
    model = build_model(updated, effect_files)
    setups = [name for active in model.effects if (name := setup_of(active))]
    shown = options(machine=machine_file, effects=list(effect_files), setup=setups[0] if setups else None)
    also = " (analyze, place and pose take the same options)"
    return (
        hint("what is left", asked.command("compare", machine=machine_file)),
        hint(f"the stiffness over the workspace{also}", command_line("map", *shown)),
    )


def _bars(machine: Machine, data: Measurements, seed: int, progress: Callable[[str], None] | None) -> BarCurve | None:
    """The paper's Figure 3; None where the machine carries bars as an effect."""
    if any(entry.name == "platform_flexibility" for entry in machine.effects):
        return None
    if progress is not None:
        progress("the platform's bars, soft to rigid")
    return bar_curve(machine, data, seed=seed, starts=1)


@dataclass(frozen=True)
class StrutLawSearch:
    """Result of the search.

    Attributes
    ----------
    law
        (2,) logarithms of the factors on the machine's strut law.
    strut_law
        The law found.
    error, error_before
        Mean |model - measured| / measured with it, and with the machine's own law.
    starts, ends
        (s, 2) logarithms where each search began and ended.
    end_errors
        (s,) mean error at each end.
    """

    law: FloatArray
    strut_law: StrutLaw
    error: float
    error_before: float
    starts: FloatArray
    ends: FloatArray
    end_errors: FloatArray

    @property
    def agreeing(self) -> int:
        """How many searches ended at the smallest error found."""
        return int((self.end_errors <= self.error * (1.0 + SAME)).sum())


def mean_error(predictor: Predictor, law: ArrayLike = NO_CHANGE) -> float:
    """Mean |model - measured| / measured as the paper counts it; inf where the law leaves a strut no stiffness."""
    ratio = np.exp(predictor.log_stiffness(law)) / predictor.data.stiffness
    error = float(np.abs(ratio - 1.0).mean())
    return error if np.isfinite(error) else np.inf


def minimise_mean_error(predictor: Predictor, seed: int = 0, starts: int = STARTS) -> StrutLawSearch:
    """The strut law with the smallest mean error.

    Parameters
    ----------
    predictor
        Machine and n readings.
    seed
        Of the starts; the first one is always the machine's own law.
    starts
        How many searches.

    Raises
    ------
    InputError
        A reading without a stiffness, or fewer than three.
    """
    _check(predictor.data)
    rng = np.random.default_rng(seed)
    begin = np.concatenate([np.zeros((1, 2)), rng.normal(0.0, START_SPREAD, (starts - 1, 2))])
    given = predictor.machine.strut_law
    begin = at_both_ends(given, begin)
    found, errors = zip(*(_search(predictor, start) for start in begin), strict=True)
    ends = at_both_ends(given, np.array(found))
    best = int(np.argmin(errors))
    law = ends[best]
    return StrutLawSearch(
        law=law,
        strut_law=scaled_law(given, law),
        error=errors[best],
        error_before=mean_error(predictor),
        starts=begin,
        ends=ends,
        end_errors=np.array(errors),
    )


def _search(predictor: Predictor, start: FloatArray) -> tuple[FloatArray, float]:
    """Where one search ends, and the mean error there."""
    objective = _objective(predictor)
    at = start
    # A second search from the first one's end: a simplex can collapse on a kink.
    for _ in range(2):
        at = _downhill(objective, at, 1e-7, 1e-10)
    return at, mean_error(predictor, at)


def _downhill(objective: Callable[[FloatArray], float], start: FloatArray, xatol: float, fatol: float) -> FloatArray:
    from scipy.optimize import minimize

    options: Any = {"xatol": xatol, "fatol": fatol, "initial_simplex": start + FIRST_STEPS}
    return np.asarray(minimize(objective, start, method="Nelder-Mead", options=options).x)


def _objective(predictor: Predictor, weight: FloatArray | None = None) -> Callable[[FloatArray], float]:
    """Mean error as a function of the law, each reading with its weight (n,).

    Of a machine without further effects the struts alone are computed anew: its platform bars are in series.
    """
    measured = predictor.data.stiffness
    weight = np.full(len(measured), 1.0 / len(measured)) if weight is None else weight / weight.sum()
    plain = predictor.base.is_plain and not predictor.base.instruments
    rest = np.exp(-predictor.log_stiffness()) - predictor.strut_part() if plain else None

    def objective(law: FloatArray) -> float:
        if rest is None:
            ratio = np.exp(predictor.log_stiffness(law)) / measured
        else:
            ratio = 1.0 / (measured * (predictor.strut_part(law) + rest))
        error = float(weight @ np.abs(ratio - 1.0))
        return error if np.isfinite(error) and (ratio > 0.0).all() else np.inf

    return objective


RESAMPLES = 200
ROUGH = (1e-5, 1e-7)  # law and mean error of a resampled search: its own scatter is a thousand times larger


def leave_points_out(predictor: Predictor, law: FloatArray) -> FloatArray:
    """(n,) ln measured - ln modelled, each reading by the law with the smallest mean error over the other points.

    nan with fewer than three points.
    """
    data = predictor.data
    labels = np.unique(data.point)
    residual = np.full(len(data), np.nan)
    for label in labels if len(labels) > 2 else ():
        out = data.point == label
        found = _downhill(_objective(predictor, (~out).astype(float)), law, *ROUGH)
        residual[out] = np.log(data.stiffness[out]) - predictor.log_stiffness(found)[out]
    return residual


def resampled_covariance(predictor: Predictor, law: FloatArray, seed: int = 0, draws: int = RESAMPLES) -> FloatArray:
    """(2, 2) covariance of the law: the bootstrap over points (Efron and Tibshirani 1993, chapter 6)."""
    labels, which = np.unique(predictor.data.point, return_inverse=True)
    rng = np.random.default_rng(seed)
    laws = []
    for _ in range(draws):
        count = np.bincount(rng.integers(len(labels), size=len(labels)), minlength=len(labels))
        laws.append(_downhill(_objective(predictor, count[which.reshape(-1)].astype(float)), law, *ROUGH))
    return np.asarray(np.cov(np.array(laws).T))


@dataclass(frozen=True)
class BarCurve:
    """The paper's Figure 3: mean error over the stiffness of the platform's bars.

    Attributes
    ----------
    bars
        (b,) N/m of each bar, inf last: a rigid platform.
    error
        (b,) mean relative error with the machine's own strut law.
    error_refitted
        (b,) with the law that makes it smallest there.
    stiffness
        (b, 2) N/m, that law at its two lengths.
    """

    bars: FloatArray
    error: FloatArray
    error_refitted: FloatArray
    stiffness: FloatArray

    @property
    def best(self) -> int:
        """Index of the bars with the smallest error after refitting."""
        return int(np.argmin(self.error_refitted))


def bar_curve(
    machine: Machine, data: Measurements, bars: Sequence[float] = FIGURE_3_BARS, seed: int = 0, starts: int = 3
) -> BarCurve:
    """Mean error for platforms from soft to rigid, with the machine's strut law and with the best one.

    Parameters
    ----------
    machine, data
        What was measured; the machine's own platform bars are replaced.
    bars
        N/m; a rigid platform is added.
    seed, starts
        As in `minimise_mean_error`.

    Raises
    ------
    InputError
        A bar stiffness of 0 or less, or the machine carries `platform_flexibility` as an effect.
    """
    if any(not k > 0.0 for k in bars):
        raise InputError(f"platform bars of {min(bars):g} N/m", expected="more than 0")
    stiffnesses = np.unique([*bars, np.inf])
    errors, refitted, laws = [], [], []
    for k in stiffnesses:
        predictor = Predictor(machine.with_changes(platform_bar_stiffness=float(k)), data)
        found = minimise_mean_error(predictor, seed, starts)
        errors.append(found.error_before)
        refitted.append(found.error)
        laws.append([found.strut_law.stiffness_1, found.strut_law.stiffness_2])
    return BarCurve(stiffnesses, np.array(errors), np.array(refitted), np.array(laws))


def bar_curve_csv(curve: BarCurve) -> str:
    """The curve as CSV: N/m, per cent, N/um."""
    rows = ["bar_stiffness_N_per_m,error_percent,error_refitted_percent,stiffness_1_N_per_um,stiffness_2_N_per_um"]
    for k, error, refitted, law in zip(curve.bars, curve.error, curve.error_refitted, curve.stiffness, strict=True):
        figures = (100 * error, 100 * refitted, n_per_um_from_n_per_m(law[0]), n_per_um_from_n_per_m(law[1]))
        rows.append(f"{k:.6g}," + ",".join(f"{value:.4f}" for value in figures))
    return "\n".join(rows) + "\n"


def _check(data: Measurements) -> None:
    lacking = int(np.isnan(data.stiffness).sum())
    if lacking or len(data) < 3:
        raise InputError(
            f"{len(data)} readings, {lacking} of them without a stiffness",
            expected="at least 3 measured stiffnesses for a law of two constants",
        )


# -- as an update ------------------------------------------------------------------------------------------------------
#
# The paper's own estimation as an update: the strut law alone, by the smallest mean error.


def update_by_mean_error(
    machine: Machine,
    data: Measurements,
    *,
    force: bool = False,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> tuple[Update, StrutLawSearch]:
    """The strut law with the smallest mean error, its errors at left-out points and its uncertainty.

    Parameters
    ----------
    machine, data
        The model and n readings.
    force
        Keep the law even of readings that hardly are of this machine.
    noise, strut_spread
        For the noise floor only: the objective does not know of noise.
    effect_files
        A user's own effects, which the machine may carry.
    seed
        Of the searches' starts and of the bootstrap over points.
    progress
        Told what is being done.

    Raises
    ------
    InputError
        As `minimise_mean_error`.
    """
    say = progress or (lambda text: None)
    say("searching from several starts")
    found = minimise_mean_error(Predictor(machine, data, effect_files), seed)
    worst = max(noise_models(data, noise, strut_spread), key=lambda one: one.typical)
    problem = Problem.of(Predictor(machine, data, effect_files), worst)
    predictor = problem.predictor
    baseline = Baseline.of(problem)
    given = baseline.as_given
    say("leaving points out, drawing points anew")
    last = Fit(
        (), (), (), found.law, problem.observed - predictor.log_stiffness(found.law),
        predictor.law_columns(predictor.log_stiffness(found.law), found.law),
        resampled_covariance(predictor, found.law, seed), problem.scatter,
    )  # fmt: skip
    left_out = HeldOut(leave_points_out(predictor, found.law), np.zeros((0, 2)), data.point)
    steps = (
        Step.of(AS_GIVEN, given, data),
        Step("strut law by mean error", last, left_out, data.tip),
    )
    refitted = Step.of(LAW_REFITTED, baseline.refitted, data)
    return Update(
        machine, data, worst, problem, steps, refitted, (), (), force, False, law_asked=True, objective="mean-error",
        question=question(predictor),
    ), found  # fmt: skip
