"""The rivals that a plan is to tell apart: as a diagnosis left them, as the user names them, or before any data.

What each of them expects of readings is its forecast.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.candidates import Component
from toolpath_stiff.inference.errors import AS_GIVEN, LAW_REFITTED, error_figures
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit, Problem
from toolpath_stiff.inference.fits import Baseline, fit_effects, refine
from toolpath_stiff.inference.hypotheses import score_family
from toolpath_stiff.inference.judgement import NONE, Judgement
from toolpath_stiff.inference.noise import JOINT_ERROR
from toolpath_stiff.inference.prediction import JOINT_STEP, Predictor
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.readings.measurements import Measurements
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.contract import Effect
from toolpath_stiff.stiffness.model import StiffnessModel, load_path

LAW_STEP = 1e-4  # of the strut law's logarithms, for differences


LARGEST_STEP = 0.3  # of a size, for differences: a secant over the posterior's width where that is wide


ALIKE = 1e-6  # relative difference within which two variances are equal


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
    # What a loop beside the tip reads hangs on the joints' places too little to count them.
    joints = np.zeros((len(readings), 36))
    joints[readings.tip] = joint_columns(predictor.base, readings.of_tip) * joint_error
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
    if not values.any():
        return columns[:, :0]
    least = values[np.cumsum(values) > share * values.sum()][0]
    # Of equal values, which a symmetric machine has, all or none: which of them comes first is chance.
    return np.asarray(columns @ vectors[:, values >= (1.0 - ALIKE) * least])


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


LEAST_WEIGHT = 0.02  # probability below which an explanation is no rival


UNKNOWN_SIZE = 0.5  # relative sd of a size that nothing has been measured of; assumed


def rival_of_fit(name: str, fit: Fit, weight: float = 1.0) -> Rival:
    """A rival as fitted to the data so far."""
    return Rival(name, fit.law, fit.effects, fit.covariance, fit.free, weight)


def rivals_of(judgement: Judgement) -> list[Rival]:
    """The explanations that a diagnosis leaves standing, with their probabilities.

    Where it leaves one or none standing, the most likely others beside it, at `LEAST_WEIGHT`: what a plan would
    confirm the answer against.
    """
    found = []
    for name, weight in sorted(judgement.probability.items(), key=lambda item: (-item[1], item[0])):
        fit = _fit_of(judgement, name) if weight >= LEAST_WEIGHT or name in judgement.explanations else None
        if fit is not None:
            found.append(rival_of_fit(name, fit, max(weight, LEAST_WEIGHT)))
    for name in (NONE, *(family.name for family in judgement.families)):
        if len(found) >= 2:
            break
        fit = _fit_of(judgement, name)
        if fit is not None and name not in {rival.name for rival in found}:
            found.append(rival_of_fit(name, fit, LEAST_WEIGHT))
    return found


def _fit_of(judgement: Judgement, name: str) -> Fit | None:
    """The final fit of a hypothesis; None if there is none to be had."""
    if name == NONE:
        return fit_effects(judgement.problem, (), (), (), judgement.base.law)
    if name in judgement.fits:
        return judgement.fits[name]
    best = next((family.best for family in judgement.families if family.name == name), None)
    return None if best is None else refine(judgement.problem, best)


def fitted_rivals(problem: Problem, names: Sequence[str], effects: Mapping[str, Effect]) -> list[Rival]:
    """Effects by name, or `none`, fitted to the data, all of the same weight.

    Raises
    ------
    InputError
        An effect that does not exist, that the data lack a column for, or that the data leave at nothing.
    """
    _check(names, effects)
    base = problem.score_base()
    found = []
    lacking = problem.predictor.data.cannot_test(effects[name] for name in names if name != NONE)
    for name in names:
        if name == NONE:
            found.append(rival_of_fit(NONE, fit_effects(problem, (), (), (), base.law)))
            continue
        if name in lacking:
            raise InputError(
                f"the data cannot be fitted with {name}: column {lacking[name][0]} is missing",
                hint="plan without data: leave the files out",
            )
        family = score_family(problem, effects[name], base)
        if family is None or family.best is None:
            raise InputError(
                f"fitted to these data, {name} comes out at nothing: it is no other explanation than {NONE}",
                hint="plan without data (leave the files out) for the size that it usually has",
            )
        found.append(rival_of_fit(name, refine(problem, family.best)))
    return found


def unfitted_rivals(names: Sequence[str], effects: Mapping[str, Effect], setup: str = "") -> list[Rival]:
    """Effects by name, or `none`, at their usual sizes, before any data; `setup` is what a set-up's own effect is of.

    The size is the middle of the usual range on a logarithmic scale and known within `UNKNOWN_SIZE` of it; the strut
    law within `LAW_PRIOR`.

    Raises
    ------
    InputError
        An effect that does not exist.
    """
    _check(names, effects)
    found = []
    for name in names:
        if name == NONE:
            found.append(Rival(NONE, (0.0, 0.0), (), np.diag([LAW_PRIOR**2] * 2)))
            continue
        effect = effects[name]
        sizes = [usual_size(Component.of(p)) for p in effect.parameters if not p.discrete]
        values: dict[str, Any] = {}
        discrete = sum(parameter.discrete for parameter in effect.parameters)
        for parameter in effect.parameters:
            if parameter.kind == "real":
                component = Component.of(parameter)
                values[parameter.name] = component.value(usual_size(component))
            elif parameter.kind == "integer":  # 0 means all: with other choices beside it that is no effect at all
                values[parameter.name] = max(int(parameter.bounds[0]), int(discrete > 1))
            else:
                values[parameter.name] = setup if discrete == 1 else ""
        covariance = np.diag([LAW_PRIOR**2] * 2 + [(UNKNOWN_SIZE * size) ** 2 for size in sizes])
        found.append(Rival(name, (0.0, 0.0), (ActiveEffect(effect, values),), covariance))
    return found


def errors_so_far(problem: Problem, rivals: Sequence[Rival]) -> dict[str, float]:
    """Mean errors on the data so far, %: as given, strut law refitted, then with each rival that is an effect."""
    baseline = Baseline.of(problem)
    found = {AS_GIVEN: baseline.as_given.residual, LAW_REFITTED: baseline.refitted.residual}
    for rival in rivals:
        if rival.effects:
            modelled = problem.predictor.log_stiffness(np.asarray(rival.law), rival.effects)
            found[f"with {rival.name}"] = problem.observed - modelled
    return {name: error_figures(residual)["mean_abs_error_percent"] for name, residual in found.items()}


def usual_size(component: Component) -> float:
    """The middle of the usual sizes on a logarithmic scale, a fifth of the largest where the usual range holds 0."""
    low, high = component.typical()
    sign = component.signs[-1]
    if not np.isfinite(high):
        high = component.reach(sign)
    if low <= 0.0:
        low = 0.04 * high
    return sign * float(np.sqrt(low * high))


def _check(names: Sequence[str], effects: Mapping[str, Effect]) -> None:
    if len(set(names)) != len(names) or len(names) < 2:
        raise InputError(f"--between {','.join(names)}", expected="two or more different effects, or none")
    for name in names:
        if name != NONE and name not in effects:
            near = difflib.get_close_matches(name, [*effects, NONE], n=1)
            raise InputError(
                f"unknown effect {name!r}",
                expected=f"{NONE}, {', '.join(effects)}",
                hint=f"did you mean {near[0]}?" if near else "",
            )
