"""What rival explanations of the same data expect of further readings, and how far they are apart.

Each rival has been fitted to the data so far. What it expects of new readings y = ln k is normal: its prediction, with
the covariance C = N + G P G^T, where N is the scatter of the readings, P the covariance of its fitted parameters (strut
law included) and G how the readings hang on them. So a difference that refitting would close is no difference.

The gap of two rivals is that of Buzzi-Ferraris and Forzatti (1983, Chemical Engineering Science 38, 225; several
responses 1984, ibid. 39, 81),

    gap^2 = (m_i - m_j)^T (C_i + C_j)^-1 (m_i - m_j),

in standard deviations; where C_i = C_j its square is the expected logarithm of the Bayes factor. Readings of different
visits are independent but for the parameters and for what the machine file does not know of the machine (struts that
are not quite alike, joints not quite in place: columns B), which are the same everywhere. With
F = [G_i L_i, G_j L_j, sqrt(2) B], P = L L^T, every visit adds its own

    a = d^T N^-1 d,    h = F^T N^-1 d,    M = F^T N^-1 F,    and    gap^2 = sum a - (sum h)^T (1 + sum M)^-1 (sum h)

(Woodbury). One visit more costs a solution of a dozen equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.model import ActiveEffect, StiffnessModel, load_path
from toolpath_stiff.updating.inference.candidates import Component
from toolpath_stiff.updating.inference.noise import CLAMPING, JOINT_ERROR, STRUT_SPREAD
from toolpath_stiff.updating.inference.prediction import JOINT_STEP, Predictor
from toolpath_stiff.updating.measurements import Measurements
from toolpath_stiff.updating.planning.visits import Visits

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LAW_STEP = 1e-4  # of the strut law's logarithms, for differences
LARGEST_STEP = 0.3  # of a size, for differences: a secant over the posterior's width where that is wide
SMALL_SHARE = 1e-3  # of the largest usual size: the step where the size is nothing


@dataclass(frozen=True)
class Rival:
    """An explanation of the data, as fitted to them.

    Attributes
    ----------
    name
        For people: `none`, or the effects joined by " + ".
    law
        (2,) logarithms of the factors on the strut law's stiffnesses.
    effects
        What it adds to the machine file.
    covariance
        (2 + p, 2 + p) of the law and of the p real parameters of the effects that are `free`, as sizes from their
        neutral values (`candidates.Component`); None: law and parameters are known.
    free
        Which real parameters these are, counted over all effects; None: all.
    weight
        Its probability, up to a common factor.
    """

    name: str
    law: tuple[float, float] | FloatArray = (0.0, 0.0)
    effects: tuple[ActiveEffect, ...] = ()
    covariance: FloatArray | None = None
    free: tuple[int, ...] | None = None
    weight: float = 1.0

    @property
    def components(self) -> list[tuple[int, Component]]:
        """The free real parameters: which effect, which component."""
        every = [
            (k, Component.of(parameter))
            for k, active in enumerate(self.effects)
            for parameter in active.effect.parameters
            if not parameter.discrete
        ]
        return every if self.free is None else [every[i] for i in self.free]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its effects."""
        return tuple(active.effect.name for active in self.effects)


@dataclass(frozen=True)
class Forecast:
    """What a rival expects of m readings: mean (m,) of ln k, and a factor (m, q) of its own covariance."""

    name: str
    weight: float
    mean: FloatArray
    factor: FloatArray


@dataclass(frozen=True)
class ReadingNoise:
    """Scatter of ln readings: of each, of each clamping (relative sd), and of the machine as a factor (m, k)."""

    repeat: float
    clamping: float
    machine: FloatArray

    def shared_out(self, repeats: float) -> ReadingNoise:
        """The noise of the mean of so many re-clamped readings; the machine stays as it is."""
        return ReadingNoise(self.repeat / np.sqrt(repeats), self.clamping / np.sqrt(repeats), self.machine)


def repeat_and_clamping(relative: float | tuple[float, float]) -> tuple[float, float]:
    """Relative sd of a reading and of a clamping, from these or from that of a reading in total.

    Raises
    ------
    InputError
        A noise that cannot be.
    """
    if isinstance(relative, tuple):
        repeat, clamping = relative
    else:
        clamping = float(min(CLAMPING, relative / np.sqrt(2.0)))
        repeat = float(np.sqrt(max(relative**2 - clamping**2, 0.0)))
    if not (0.0 < repeat <= 1.0 and 0.0 <= clamping <= 1.0):
        raise InputError(f"a noise of {relative!r}", expected="more than 0 and at most 1 (100 %)")
    return repeat, clamping


def forecast_all(
    machine: Machine,
    rivals: Sequence[Rival],
    readings: Measurements,
    effect_files: Sequence[str | Path] = (),
    strut_spread: float = STRUT_SPREAD,
    joint_error: float = JOINT_ERROR,
) -> tuple[list[Forecast], NDArray[np.bool_], FloatArray]:
    """The rivals' forecasts, which readings (m,) all of them can answer, and what the machine scatters by.

    The last is (m, k), a factor of the covariance that the struts' spread (relative sd) and the joints' errors (m, sd
    of each coordinate) cause.

    Raises
    ------
    InputError
        A rival's covariance does not fit its parameters; the machine is wrong.
    """
    predictor = Predictor(machine, readings, effect_files)
    forecasts = [_forecast(rival, predictor) for rival in rivals]
    good = np.all([np.isfinite(f.mean) & np.isfinite(f.factor).all(axis=1) for f in forecasts], axis=0)
    joints = joint_columns(predictor.base, readings) * joint_error
    return forecasts, good, principal(np.concatenate([strut_spread * predictor.strut_columns(), joints], axis=1))


def joint_columns(model: StiffnessModel, readings: Measurements) -> FloatArray:
    """(m, 36) d ln k / d (coordinate of a frame or platform joint), 1/m; the control does not know of the error.

    As `Predictor.joint_columns`, but every pose is solved once for all its directions, without load-dependent effects:
    plans choose from thousands of readings.
    """
    keys = np.concatenate([readings.position, readings.angles, readings.tool_extension[:, None]], axis=1)
    _, first, which = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    which = which.reshape(-1)
    places = readings.select(first)

    def log_stiffness(of: StiffnessModel) -> FloatArray:
        length = places.tool_extension + of.machine.reference_tool_length
        path = load_path(of, places.position, places.rotation, length, setup=places.setup)
        tensor = exact.tip_compliance(of, path)[which]
        return np.asarray(-np.log(np.einsum("mi,mij,mj->m", readings.direction, tensor, readings.direction)))

    base, columns = log_stiffness(model), []
    for name in ("frame_joints", "platform_joints"):
        for strut, axis in product(range(6), range(3)):
            joints = np.array(getattr(model.machine, name))
            joints[strut, axis] += JOINT_STEP
            true = model.machine.with_changes(**{name: joints})
            moved = replace(model, machine=true, control=model.control or model.machine)
            columns.append((log_stiffness(moved) - base) / JOINT_STEP)
    return np.stack(columns, axis=1)


def principal(columns: FloatArray, share: float = 1e-3) -> FloatArray:
    """(m, k) columns with the same covariance as (m, q), but for a share of the variance at most."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    kept = np.cumsum(values) > share * values.sum()
    return np.asarray(columns @ vectors[:, kept])


def _forecast(rival: Rival, predictor: Predictor) -> Forecast:
    law = np.asarray(rival.law, dtype=float)
    mean = _answers(predictor, law, rival.effects)
    if rival.covariance is None:
        return Forecast(rival.name, rival.weight, mean, np.zeros((len(mean), 0)))
    components = rival.components
    covariance = np.asarray(rival.covariance, dtype=float)
    if covariance.shape != (2 + len(components),) * 2:
        raise InputError(
            f"rival {rival.name}: a covariance of shape {covariance.shape}",
            expected=f"{2 + len(components)} rows and columns: the strut law's two and the free parameters",
        )
    columns = []
    for k in range(2):
        moved = law.copy()
        moved[k] += LAW_STEP
        columns.append((_answers(predictor, moved, rival.effects) - mean) / LAW_STEP)
    deviations = np.sqrt(np.maximum(np.diag(covariance)[2:], 0.0))
    for (k, component), sd in zip(components, deviations, strict=True):
        columns.append(_slope(rival, k, component, float(sd), predictor, law, mean))
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    factor = np.stack(columns, axis=1) @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    return Forecast(rival.name, rival.weight, mean, factor)


def _slope(
    rival: Rival, k: int, component: Component, sd: float, predictor: Predictor, law: FloatArray, mean: FloatArray
) -> FloatArray:
    """(m,) d ln k / d size, by a difference that stays within the bounds."""
    active = rival.effects[k]
    size = size_of(component, float(active.values[component.parameter.name]))
    usual = component.typical()[1]
    least = SMALL_SHARE * (usual if np.isfinite(usual) and usual > 0.0 else 1.0)
    step = max(min(sd, LARGEST_STEP * abs(size)), least)
    low, high = component.bounds
    if size + step > high and size - step >= low:
        step = -step
    value = component.value(size + step)
    moved = ActiveEffect(active.effect, {**active.values, component.parameter.name: value})
    effects = (*rival.effects[:k], moved, *rival.effects[k + 1 :])
    return (_answers(predictor, law, effects) - mean) / step


def size_of(component: Component, value: float) -> float:
    """The size from neutral of a parameter's SI value; the inverse of `Component.value`."""
    if component.inverse:
        return 1.0 / value
    return value - component.parameter.neutral * component.parameter.si


def _answers(predictor: Predictor, law: FloatArray, effects: Sequence[ActiveEffect]) -> FloatArray:
    """(m,) ln k, nan only for the readings that the model itself cannot answer.

    `Predictor` answers all readings or none; halving finds those at fault.
    """
    logs = predictor.log_stiffness(law, effects)
    if not np.isnan(logs).all() or len(logs) <= 1:
        return logs
    half = len(logs) // 2
    parts = (np.arange(half), np.arange(half, len(logs)))
    return np.concatenate(
        [
            _answers(Predictor(predictor.machine, predictor.data.select(part), predictor.effect_files), law, effects)
            for part in parts
        ]
    )


# -- gaps --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Shares:
    """What each of v visits adds to the gap of a pair: a (v,), h (v, q), M (v, q, q)."""

    a: FloatArray
    h: FloatArray
    M: FloatArray

    def gap(self, chosen: Sequence[int] | IntArray = (), repeats: float = 1.0) -> float:
        """Gap in standard deviations after the chosen visits, each clamped and read so often."""
        index = np.asarray(chosen, dtype=np.int64)
        squared = _squared_gap(self.a[index].sum(), self.h[index].sum(axis=0), self.M[index].sum(axis=0), repeats)
        return float(np.sqrt(max(float(squared), 0.0)))

    def gaps_with(self, chosen: Sequence[int] | IntArray) -> FloatArray:
        """(v,) gaps after the chosen visits and one more, for each that it could be."""
        index = np.asarray(chosen, dtype=np.int64)
        squared = _squared_gap(
            self.a + self.a[index].sum(), self.h + self.h[index].sum(axis=0), self.M + self.M[index].sum(axis=0), 1.0
        )
        return np.asarray(np.sqrt(np.maximum(squared, 0.0)))


def _squared_gap(a: FloatArray, h: FloatArray, M: FloatArray, repeats: float) -> FloatArray:
    if h.shape[-1] == 0:
        return np.asarray(repeats * a)
    inner = np.eye(h.shape[-1]) + repeats * M
    solved = np.linalg.solve(inner, h[..., None])[..., 0]
    return np.asarray(repeats * a - repeats**2 * (h * solved).sum(axis=-1))


def _summed_products(columns: FloatArray, starts: IntArray) -> FloatArray:
    """(v, q, q) sums over each visit's rows of the products of columns (n, q); one column at a time to save memory."""
    q = columns.shape[1]
    products = np.empty((len(starts), q, q))
    for k in range(q):
        products[:, k, k:] = np.add.reduceat(columns[:, k : k + 1] * columns[:, k:], starts, axis=0)
        products[:, k:, k] = products[:, k, k:]
    return products


def pair_shares(visits: Visits, first: Forecast, second: Forecast, noise: ReadingNoise) -> Shares:
    """What every visit adds to the gap of two rivals."""
    difference = first.mean - second.mean
    F = np.concatenate([first.factor, second.factor, np.sqrt(2.0) * noise.machine], axis=1)
    columns = np.concatenate([difference[:, None], F], axis=1)[visits.members]
    starts, counts = visits.starts, visits.counts
    products = _summed_products(columns, starts)
    sums = np.add.reduceat(columns, starts, axis=0)
    # Inverse of 2 (r^2 1 + c^2 11^T) by Sherman and Morrison.
    common = noise.clamping**2 / (noise.repeat**2 + counts * noise.clamping**2)
    form = (products - common[:, None, None] * sums[:, :, None] * sums[:, None, :]) / (2.0 * noise.repeat**2)
    return Shares(form[:, 0, 0], form[:, 1:, 0], form[:, 1:, 1:])


# -- what would come of it ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Outcome:
    """What is to be expected of readings: mean probability of the truth, and how often one rival exceeds `SETTLED`."""

    truth: float
    settled: float


SETTLED = 0.95  # probability at which a question counts as settled
DRAWS = 400  # simulated results a rival


def expected_outcome(
    forecasts: Sequence[Forecast],
    rows: IntArray,
    visit_of: IntArray,
    noise: ReadingNoise,
    seed: int,
) -> Outcome:
    """Simulate the readings under every rival in turn and judge them by Bayes' rule.

    All rivals scatter by the mean of their covariances here, as in the gap: that one rival is vaguer than another is
    a matter of its prior, and not counted on.

    Parameters
    ----------
    forecasts
        Of all readings; their weights add up to 1.
    rows, visit_of
        (k,) the readings taken, and the number of the visit each belongs to.
    noise
        Of these readings.
    seed
        Of the draws.
    """
    from scipy.linalg import solve_triangular

    rng = np.random.default_rng(seed)
    weights = np.array([forecast.weight for forecast in forecasts])
    same = visit_of[:, None] == visit_of[None, :]
    covariance = noise.repeat**2 * np.eye(len(rows)) + noise.clamping**2 * same
    for factor, weight in [(noise.machine, 1.0), *((f.factor, f.weight) for f in forecasts)]:
        covariance += weight * factor[rows] @ factor[rows].T
    means = np.stack([forecast.mean[rows] for forecast in forecasts], axis=1)
    whitened = solve_triangular(np.linalg.cholesky(covariance), means, lower=True).T
    standard = rng.standard_normal((DRAWS, len(rows)))
    truth = settled = 0.0
    for i, weight in enumerate(weights):
        # Of -|z + (m_i - m_j)|^2 / 2 for every j, z standard normal.
        apart = whitened[i] - whitened
        logs = np.log(weights) - 0.5 * (apart**2).sum(axis=1) - standard @ apart.T
        probability = np.exp(logs - logs.max(axis=1, keepdims=True))
        probability /= probability.sum(axis=1, keepdims=True)
        truth += weight * float(probability[:, i].mean())
        settled += weight * float((probability.max(axis=1) >= SETTLED).mean())
    return Outcome(truth, settled)
