"""Sizes of hidden effects: how visible an effect is in a campaign, and its strength for a wanted size.

The size is the root mean square change of the readings' logarithm. It is drawn log-uniform from just detectable on that
campaign (`DETECTABLE`) to 30 %, as far as the effect's bounds allow.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from scipy.linalg import solve_triangular

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.rig.closure import ClosureError
from toolpath_stiff.rig.draws import Shape
from toolpath_stiff.rig.effects import HIDEABLE, with_effect
from toolpath_stiff.rig.fem_faults import FAULTS
from toolpath_stiff.rig.hidden import HiddenMachine, Nuisances, readings
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.unknowns import UNKNOWNS

LARGEST = 0.30  # rms change of ln stiffness
UNKNOWN_SIZES = (0.04, 0.15)  # rms change of ln stiffness that an unknown is drawn with, log-uniform
FAULT_SIZES = (0.04, 0.20)  # the same for a fault of finite elements, within its limit
LARGEST_SINGLE = 1.0  # change of one reading: one nearly three times the others would be thrown away (assumed)
# Whitened length of an effect's signature, beside strut law and nuisances, that is found with 80 % power at 5 %
# among some twenty candidates: z(1 - 0.0025/2) + z(0.8) = 3.02 + 0.84 (normal quantiles, Bonferroni).
DETECTABLE = 3.9
FREE_LAW = 1.0  # prior sd of the logarithms of the two strut stiffnesses: free, next to 2 % noise


class Scale:
    """Visibility of an effect in one campaign, and its strength for a wanted size; `start` is the sound machine."""

    def __init__(
        self, nominal: Nominal, rows: Rows, clamps: IntArray, nuisances: Nuisances, start: HiddenMachine
    ) -> None:
        self.nominal, self.rows, self.start = nominal, rows, start
        self.setups = sorted(set(rows.setup.tolist()))
        self.base = np.log(readings(nominal, start, rows))
        self.whitened_length = whitened_length(clamps, _spread(self, nuisances), nuisances)

    def change(self, machine: HiddenMachine) -> FloatArray:
        """(n,) change of ln stiffness; infinite beyond `LARGEST_SINGLE`, or where an indicator would run backwards.

        And of a machine that cannot take a pose of the campaign.
        """
        try:
            shown = readings(self.nominal, machine, self.rows)
        except ClosureError:
            return np.full(len(self.base), math.inf)
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = np.log(shown)
        change = np.where(np.isfinite(logs), logs - self.base, math.inf)
        return np.where(np.abs(change) <= LARGEST_SINGLE, change, math.inf)

    def draw(self, name: str, size: float | None, rng: Generator) -> tuple[Shape, dict[str, float]]:
        """Draw an effect's parameters; returns them with their size and detectability."""
        shape = HIDEABLE[name].shape(rng, self.nominal.corners, self.setups)
        fraction = rng.random()
        strength, change = self._reach(name, shape, 0.03)
        rms, seen = _rms(change), self._detectability(change)
        if size is None:
            # To first order both grow in proportion to the strength.
            smallest, largest = min(max(rms * DETECTABLE / max(seen, 1e-12), 1e-4), LARGEST), LARGEST
            if name in UNKNOWNS or name in FAULTS:
                smallest, largest = UNKNOWN_SIZES if name in UNKNOWNS else FAULT_SIZES
            size = smallest * (largest / smallest) ** fraction
        strength, change = self._reach(name, shape, size, start=strength)
        parameters = {
            key: float(f"{value:.4g}") if isinstance(value, float) else value
            for key, value in HIDEABLE[name].grown(strength, shape).items()
        }
        # Further digits depend on the processor.
        figures = {"size": _rms(change), "detectability": self._detectability(change)}
        return parameters, {key: float(f"{value:.6g}") for key, value in figures.items()}

    def _reach(self, name: str, shape: Shape, size: float, start: float = 0.02) -> tuple[float, FloatArray]:
        """Strength in (0, 1] at which the rms change is `size` within 2 %, and that change; 1 if none reaches it.

        The change grows about in proportion to the strength, so scaling the strength by what is missing converges.
        """
        low, high, strength = 0.0, math.inf, start
        change = np.zeros(len(self.base))
        for _ in range(25):
            change = self.change(with_effect(self.start, name, HIDEABLE[name].grown(strength, shape)))
            rms = _rms(change)
            if abs(rms - size) <= 0.02 * size or (rms < size and strength == 1.0):
                break
            low, high = (strength, high) if rms < size else (low, strength)
            wanted = min(strength * size / rms, 1.0) if 0.0 < rms < math.inf else 0.5 * strength
            # A step that leaves the bracket is replaced by halving the bracket.
            strength = wanted if low < wanted < high else 0.5 * (low + min(high, 1.0))
        return strength, change

    def _detectability(self, change: FloatArray) -> float:
        return self.whitened_length(change) if np.isfinite(change).all() else math.inf


def _rms(change: FloatArray) -> float:
    return float(np.sqrt(np.mean(change**2)))


def whitened_length(clamps: IntArray, spread: FloatArray, nuisances: Nuisances) -> Callable[[FloatArray], float]:
    """Whitened length sqrt(x^T C^-1 x) of x (n,), by the covariance C of ln readings.

    That has repeat noise, clamping, and strut spread and a free strut law as one standard deviation of each, `spread`
    (n, 8), moves the readings.
    """
    together = clamps[:, None] == clamps
    covariance = max(nuisances.repeat, 1e-3) ** 2 * np.eye(len(clamps)) + nuisances.clamping**2 * together
    factor = np.linalg.cholesky(covariance + spread @ spread.T)
    return lambda x: float(np.linalg.norm(solve_triangular(factor, x, lower=True)))


def _spread(scale: Scale, nuisances: Nuisances) -> FloatArray:
    """(n, 8) changes of ln readings by one standard deviation of each strut and of the strut law at its two ends.

    (n, 7) of a law with one stiffness; of a law with more than two the points between move with the ends.
    """
    step, lengths, (first, last) = 1e-4, scale.nominal.law_lengths, scale.nominal.law_ends
    toward = (lengths - first) / (last - first)
    weaker = (dataclasses.replace(scale.start, strut_factors=1.0 + step * strut) for strut in np.eye(6))
    columns = [nuisances.strut_spread * scale.change(machine) / step for machine in weaker]
    for moved in [np.ones(1)] if len(lengths) == 1 else [1.0 - toward, toward]:
        stiffer = scale.nominal.law_stiffnesses * (1.0 + step * moved)
        other = dataclasses.replace(scale.nominal, law_stiffnesses=stiffer)
        columns.append(FREE_LAW * (np.log(readings(other, scale.start, scale.rows)) - scale.base) / step)
    return np.column_stack(columns)
