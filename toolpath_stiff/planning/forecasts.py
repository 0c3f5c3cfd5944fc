"""Forecasts of rivals: mean and covariance of the readings under each."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.inference.candidates import Candidate
from toolpath_stiff.inference.element_predictor import predictor_of
from toolpath_stiff.inference.noise import JOINT_ERROR, REST
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.readings.measurements import Readings, measured_path
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.geometry_slopes import geometry_slopes

LAW_STEP = 1e-4  # of the strut law's logarithms, for differences
LARGEST_STEP = 0.3  # of a size, for differences: a secant over the posterior's width where that is wide
ALIKE = 1e-6  # relative difference within which two variances are equal
SMALL_SHARE = 1e-3  # of the largest usual size: the step where the size is nothing


@dataclass(frozen=True)
class Rival:
    """An explanation of the data, fitted to them.

    Attributes
    ----------
    name
        For people: `none`, or the effects joined by " + ".
    law
        (2,) logarithms of the factors on the strut law's stiffnesses.
    candidates, sizes
        What it adds to the machine file, as of `Fit`.
    covariance
        (2 + p, 2 + p) of the law and of the p sizes that are `free`; None: law and sizes are known.
    free
        Which sizes these are, counted over all candidates; None: all.
    weight
        Its probability, up to a common factor.
    """

    name: str
    law: tuple[float, float] | FloatArray = (0.0, 0.0)
    candidates: tuple[Candidate, ...] = ()
    sizes: tuple[FloatArray, ...] = ()
    covariance: FloatArray | None = None
    free: tuple[int, ...] | None = None
    weight: float = 1.0

    @property
    def effects(self) -> tuple[ActiveEffect, ...]:
        """Effects with their values."""
        return tuple(c.active(sizes) for c, sizes in zip(self.candidates, self.sizes, strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its effects."""
        return tuple(candidate.name for candidate in self.candidates)


@dataclass(frozen=True)
class Forecast:
    """Forecast of m readings by a rival: mean (m,) of ln k, and a factor (m, q) of the rival's own covariance."""

    name: str
    weight: float
    mean: FloatArray
    factor: FloatArray


def forecast_all(
    machine: MachineTool,
    rivals: Sequence[Rival],
    readings: Readings,
    effect_files: Sequence[str | Path] = (),
    strut_spread: float = STRUT_SPREAD,
) -> tuple[list[Forecast], BoolArray, FloatArray]:
    """Forecasts of the rivals, mask (m,) of readings that all of them predict, and the machine's own scatter.

    The last is (m, k), a factor of the covariance that the struts' spread (relative sd), the joints' errors (m, sd of
    each coordinate) and the links that the model takes for rigid (rms over the readings) cause.
    """
    predictor = predictor_of(machine, readings, effect_files)
    forecasts = [_forecast(rival, predictor) for rival in rivals]
    good = np.all([np.isfinite(f.mean) & np.isfinite(f.factor).all(axis=1) for f in forecasts], axis=0)
    # Readings of loops beside the tip depend too little on the joints' positions to count them.
    joints, tip = np.zeros((len(readings), 36)), readings.of_tip
    path = measured_path(predictor.base, tip)
    if isinstance(machine, Hexapod):
        joints[readings.tip] = geometry_slopes(predictor.base, path, tip.direction)[:, 6:] * JOINT_ERROR
    shared = [strut_spread * predictor.strut_columns(), joints, REST * predictor.rest_columns()]
    return forecasts, good, principal(np.concatenate(shared, axis=1))


def principal(columns: FloatArray, share: float = 1e-3) -> FloatArray:
    """(m, k) columns with the covariance of columns (m, q), up to a share of the variance."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    if not values.any():
        return columns[:, :0]
    least = values[np.cumsum(values) > share * values.sum()][0]
    # Equal eigenvalues, as of a symmetric machine, are kept all or none: their order is chance.
    return np.asarray(columns @ vectors[:, values >= (1.0 - ALIKE) * least])


def _forecast(rival: Rival, predictor: Predictor) -> Forecast:
    law = np.asarray(rival.law, dtype=float)
    mean = _answers(predictor, law, rival.effects)
    if rival.covariance is None:
        return Forecast(rival.name, rival.weight, mean, np.zeros((len(mean), 0)))
    covariance = np.asarray(rival.covariance, dtype=float)
    columns = []
    for k in range(2):
        moved = law.copy()
        moved[k] += LAW_STEP
        columns.append((_answers(predictor, moved, rival.effects) - mean) / LAW_STEP)
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    places = [(k, j) for k, sizes in enumerate(rival.sizes) for j in range(len(sizes))]
    free = range(len(places)) if rival.free is None else rival.free
    for index, sd in zip(free, deviations[2:].tolist(), strict=True):
        columns.append(_slope(rival, *places[index], sd, predictor, law, mean))
    # Of the correlations: units differ so much that variances of 1e-18 would be rounding beside those of 1e7.
    scale = np.where(deviations > 0.0, deviations, 1.0)
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T) / np.outer(scale, scale))
    factor = (np.stack(columns, axis=1) * deviations) @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    return Forecast(rival.name, rival.weight, mean, factor)


def _slope(
    rival: Rival, k: int, j: int, sd: float, predictor: Predictor, law: FloatArray, mean: FloatArray
) -> FloatArray:
    """(m,) d ln k / d size j of effect k, by a difference within the bounds."""
    candidate, sizes = rival.candidates[k], rival.sizes[k].copy()
    component, size = candidate.components[j], float(sizes[j])
    usual = component.typical()[1]
    least = SMALL_SHARE * (usual if np.isfinite(usual) and usual > 0.0 else 1.0)
    step = max(min(sd, LARGEST_STEP * abs(size)), least)
    low, high = component.bounds
    if size + step > high and size - step >= low:
        step = -step
    sizes[j] += step
    effects = replace(rival, sizes=(*rival.sizes[:k], sizes, *rival.sizes[k + 1 :])).effects
    return (_answers(predictor, law, effects) - mean) / step


def _answers(predictor: Predictor, law: FloatArray, effects: Sequence[ActiveEffect]) -> FloatArray:
    """(m,) ln k; nan only for readings for which the model has no stiffness.

    `Predictor` answers all readings or none; halving finds those at fault.
    """
    logs = predictor.log_stiffness(law, effects)
    if not np.isnan(logs).all() or len(logs) <= 1:
        return logs
    parts = (predictor.data.select(rows) for rows in np.array_split(np.arange(len(logs)), 2))
    halves = (predictor_of(predictor.stated, part, predictor.effect_files) for part in parts)
    return np.concatenate([_answers(half, law, effects) for half in halves])
