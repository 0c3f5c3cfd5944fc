"""What sizes of an effect are expected before anything is measured.

Flat in the logarithm of the change that the effect makes to the stiffness: the same for every effect, so that none is
preferred for the unit of its parameter. A size far from what is usual for the effect counts less. Bounds alone exclude.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.updating.candidates import Table

FloatArray = NDArray[np.float64]

# Rms change of ln stiffness between which an effect's size is expected, flat in its logarithm; assumed: effects are
# "a few to thirty per cent", smaller ones do no harm, larger ones are seen with the naked eye.
EXPECTED = (0.005, 0.30)
TAIL = 1.0  # sd of ln size beyond them
USUAL = np.log(10.0)  # distance in ln size from the typical range at which the prior has halved


def _log_expected(rms: FloatArray) -> FloatArray:
    """Log prior density of ln rms change, not normalised: flat between `EXPECTED`, normal tails."""
    logs = np.log(np.maximum(rms, 1e-9))
    low, high = np.log(EXPECTED[0]), np.log(EXPECTED[1])
    beyond = np.maximum(0.0, np.maximum(low - logs, logs - high))
    return np.asarray(-0.5 * (beyond / TAIL) ** 2)


def _log_usual(sizes: FloatArray, typical: tuple[float, float]) -> FloatArray:
    """Log weight for being far from the typical range: a tenth of it or ten times it counts half."""
    logs = np.log(np.maximum(np.abs(sizes), 1e-300))
    low = np.log(typical[0]) if typical[0] > 0.0 else -np.inf
    high = np.log(typical[1]) if 0.0 < typical[1] < np.inf else np.inf
    with np.errstate(invalid="ignore"):
        beyond = np.maximum(0.0, np.maximum(low - logs, logs - high))
    return np.asarray(-np.log1p((beyond / USUAL) ** 2))


NORMALISER = np.log(EXPECTED[1] / EXPECTED[0]) + np.sqrt(2.0 * np.pi) * TAIL  # of `_log_expected`


def log_prior_of_component(table: Table, j: int, size: float, sd: float, compliance: FloatArray) -> float:
    """Log prior density at a size (of one sign); averaged over the posterior's width where that is wide."""
    component = table.candidate.components[j]
    around = max(size, sd)
    unit = np.zeros(len(table.candidate.components))
    unit[j] = around * component.signs[0] if size > 0 and len(component.signs) == 1 else around
    rms = float(np.sqrt(np.mean(np.log1p(np.maximum(table.delta(unit) / compliance, -0.9)) ** 2)))
    logs = _log_expected(np.array([rms])) + _log_usual(np.array([around]), component.typical())
    return float(logs[0] - np.log(NORMALISER) - np.log(around) - np.log(len(component.signs)))


@dataclass(frozen=True)
class SizePrior:
    """Prior of one size, tabulated; beyond the table it is 0."""

    sizes: FloatArray
    log_density: FloatArray  # of the size itself, normalised

    @classmethod
    def of(cls, table: Table, sizes: FloatArray, compliance: FloatArray) -> SizePrior:
        change = np.log1p(np.maximum(table.delta(sizes[:, None]) / compliance, -0.999))
        rms = np.sqrt(np.mean(change**2, axis=1))
        component = table.candidate.components[0]
        logs = _log_expected(rms) + _log_usual(sizes, component.typical()) - np.log(np.abs(sizes))
        mass = sum(_trapezoid(sizes[side], logs[side]) for side in (sizes < 0.0, sizes > 0.0) if side.any())
        return cls(sizes, logs - np.log(mass))

    def integrate(self, sizes: FloatArray, log_likelihood: FloatArray) -> tuple[float, FloatArray]:
        """Log of the integral over sizes (g,) of both signs, and the 95 % interval of the size."""
        density = np.empty(len(sizes))
        for side in (sizes < 0.0, sizes > 0.0):
            if side.any():
                own = (self.sizes < 0.0) if sizes[side][0] < 0.0 else (self.sizes > 0.0)
                # Interpolated in the logarithm of the size, where it is smooth.
                order = np.argsort(np.log(np.abs(self.sizes[own])))
                density[side] = np.interp(
                    np.log(np.abs(sizes[side])),
                    np.log(np.abs(self.sizes[own]))[order],
                    (self.log_density[own] + np.log(np.abs(self.sizes[own])))[order],
                ) - np.log(np.abs(sizes[side]))
        logs = log_likelihood + density
        top = float(logs.max())
        weights = np.exp(logs - top)
        pieces = 0.5 * (weights[1:] + weights[:-1]) * np.diff(sizes)
        pieces[(sizes[1:] > 0.0) & (sizes[:-1] < 0.0)] = 0.0
        total = max(float(pieces.sum()), 1e-300)
        cumulative = np.concatenate([[0.0], np.cumsum(pieces)]) / total
        interval = np.interp([0.025, 0.975], cumulative, sizes)
        return top + float(np.log(total)), interval


def _trapezoid(x: FloatArray, logs: FloatArray) -> float:
    weights = np.exp(logs)
    return float((0.5 * (weights[1:] + weights[:-1]) * np.abs(np.diff(x))).sum())


def log_mean_likelihood(table: Table, j: int, peak: float, sd: float, compliance: FloatArray) -> float:
    """ln of the prior mean of exp(-(size - peak)^2 / (2 sd^2)), which is 1 at its peak, wherever that lies."""
    component = table.candidate.components[j]
    unit = np.zeros(len(table.candidate.components))
    unit[j] = 1.0
    # The effect is linear in its components: ln size and ln rms change differ by a constant, for changes of a few %.
    scale = float(np.sqrt(np.mean((table.delta(unit) / compliance) ** 2)))
    logs = np.linspace(np.log(EXPECTED[0] * 0.05), np.log(EXPECTED[1] * 20.0), 1200)
    sizes = np.exp(logs) / scale
    fine = peak + sd * np.linspace(-6.0, 6.0, 240)
    fine = fine[(fine > sizes[0]) & (fine < sizes[-1])]
    sizes = np.unique(np.concatenate([sizes, fine]))
    prior = _log_expected(sizes * scale) + _log_usual(sizes, component.typical())
    weight = np.exp(prior) / NORMALISER / len(component.signs)
    total = 0.0
    for sign in component.signs:
        inside = sizes <= component.reach(sign)
        likelihood = np.exp(-0.5 * ((sign * sizes - peak) / sd) ** 2)
        values = (weight * likelihood)[inside]
        total += float((0.5 * (values[1:] + values[:-1]) * np.diff(np.log(sizes[inside]))).sum())
    return float(np.log(max(total, 1e-300)))
