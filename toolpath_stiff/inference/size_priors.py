"""Priors of sizes: flat in the logarithm of the change they make, over the expected and visible range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.candidates import CandidateTable
from toolpath_stiff.inference.covariances import Precision

# Rms change of ln stiffness between which an effect's size is expected, flat in its logarithm; assumed: effects are
# "a few to thirty per cent", smaller ones do no harm, larger ones are seen with the naked eye.
EXPECTED = (0.005, 0.30)
TAIL = 1.0  # sd in ln of the rms change beyond these limits
USUAL = np.log(10.0)  # distance in ln size from the typical range at which the prior has halved
# Mean and sd of ln(change by a component / change by the strongest): what gives way along X gives way along Y, too, by
# an amount of the same order; assumed.
COMPARABLE = (-0.7, 0.9)
VISIBLE = 3.0  # whitened length from which a signature is visible
FADES = 0.7  # sd by which visibility fades below
LIKELY = 3.84  # 95 % quantile of chi-square with one degree of freedom


@dataclass(frozen=True)
class Sight:
    """Visibility in these data: base model compliance (n,) and inverse covariance of its refit's residuals."""

    compliance: FloatArray
    projected: Precision

    def change(self, delta: FloatArray) -> FloatArray:
        """(..., n) change of ln compliance by added compliances (..., n)."""
        return np.asarray(np.log1p(np.maximum(delta / self.compliance, -0.9)))

    def length(self, change: FloatArray) -> FloatArray:
        """(...,) whitened length of changes (..., n) beside the strut law."""
        return np.asarray(np.sqrt(np.maximum(self.projected.squares(change), 0.0)))


def log_expected(rms: FloatArray) -> FloatArray:
    """Log prior density of ln rms change, not normalised: flat within `EXPECTED`, normal tails."""
    logs = np.log(np.maximum(rms, 1e-9))
    low, high = np.log(EXPECTED[0]), np.log(EXPECTED[1])
    beyond = np.maximum(0.0, np.maximum(low - logs, logs - high))
    return np.asarray(-0.5 * (beyond / TAIL) ** 2)


def log_usual(sizes: FloatArray, typical: tuple[float, float]) -> FloatArray:
    """Log weight for distance from the typical range: at a tenth or ten times of it the weight is one half."""
    logs = np.log(np.maximum(np.abs(sizes), 1e-300))
    low = np.log(typical[0]) if typical[0] > 0.0 else -np.inf
    high = np.log(typical[1]) if 0.0 < typical[1] < np.inf else np.inf
    with np.errstate(invalid="ignore"):
        beyond = np.maximum(0.0, np.maximum(low - logs, logs - high))
    return np.asarray(-np.log1p((beyond / USUAL) ** 2))


def log_comparable(ratio: float) -> float:
    """Log density of ln(ratio) of a component's change of stiffness to that of the effect's strongest component."""
    return float(
        -0.5 * ((np.log(max(ratio, 1e-9)) - COMPARABLE[0]) / COMPARABLE[1]) ** 2
        - np.log(np.sqrt(2.0 * np.pi) * COMPARABLE[1])
    )


@dataclass(frozen=True)
class SizePrior:
    """Prior of one component's size, tabulated over the sizes that its table covers; beyond them it is 0.

    Attributes
    ----------
    log_sizes, log_density
        Sign -> (g,) logarithms of sizes, and of the density over the logarithm of the size, normalised over all signs.
    """

    log_sizes: dict[float, FloatArray]
    log_density: dict[float, FloatArray]

    @classmethod
    def of(cls, table: CandidateTable, j: int, sight: Sight) -> SizePrior:
        """Prior of component `j` of a table."""
        component = table.candidate.components[j]
        logs, density, lengths = {}, {}, {}
        for sign in component.signs:
            if table.knots and sign not in table.knots:
                continue
            logs[sign] = np.log(_sizes(table, j, sign, sight))
            sizes = (sign * np.exp(logs[sign]))[:, None] * np.eye(len(table.candidate.components))[j]
            change = sight.change(table.delta(sizes))
            lengths[sign], rms = sight.length(change), np.sqrt(np.mean(change**2, axis=1))
            density[sign] = log_expected(rms) + log_usual(sizes[:, j], component.typical())
        longest = max(float(length.max()) for length in lengths.values())
        if longest >= VISIBLE:  # otherwise no size is visible and all are alike
            for sign, length in lengths.items():
                density[sign] = density[sign] - 0.5 * (np.maximum(VISIBLE - length, 0.0) / FADES) ** 2
        mass = max(sum(float(np.trapezoid(np.exp(density[sign]), logs[sign])) for sign in logs), 1e-300)
        return cls(logs, {sign: density[sign] - np.log(mass) for sign in logs})

    def log_at(self, sizes: FloatArray) -> FloatArray:
        """(g,) log density of the size itself."""
        out = np.full(len(sizes), -1e9)
        for sign, logs in self.log_sizes.items():
            where = sizes * sign > 0.0
            log_size = np.log(np.abs(sizes[where]))
            out[where] = np.interp(log_size, logs, self.log_density[sign], left=-1e9, right=-1e9) - log_size
        return out

    def log_mean_likelihood(self, peak: float, sd: float) -> float:
        """Ln of the prior mean of exp(-(size - peak)^2 / (2 sd^2)), for a peak at any size."""
        total = 0.0
        for sign, logs in self.log_sizes.items():
            fine = sign * (peak + sd * np.linspace(-6.0, 6.0, 241))
            inside = (fine > np.exp(logs[0])) & (fine < np.exp(logs[-1]))
            nodes = np.unique(np.concatenate([logs, np.log(fine[inside])]))
            likelihood = np.exp(-0.5 * ((sign * np.exp(nodes) - peak) / sd) ** 2)
            values = np.exp(np.interp(nodes, logs, self.log_density[sign])) * likelihood
            total += float(np.trapezoid(values, nodes))
        return float(np.log(max(total, 1e-300)))

    def log_density_around(self, size: float, sd: float) -> float:
        """Log density at a size, or at its standard deviation `sd` if that is larger."""
        return float(max(self.log_at(np.array([np.sign(size) * max(abs(size), sd)]))[0], -60.0))


def _sizes(table: CandidateTable, j: int, sign: float, sight: Sight) -> FloatArray:
    """Sizes of one sign at which the prior is tabulated."""
    if table.knots:
        logs = table.knots[sign][0]
        return np.exp(np.linspace(logs[0], logs[-1], 96))
    # Linear in its components: the rms change of a unit gives the sizes that change a few per cent.
    unit = sign * np.eye(len(table.candidate.components))[j]
    scale = max(float(np.sqrt(np.mean((table.delta(unit) / sight.compliance) ** 2))), 1e-300)
    largest = min(20.0 * EXPECTED[1] / scale, table.candidate.components[j].reach(sign))
    return np.geomspace(min(0.05 * EXPECTED[0] / scale, 0.1 * largest), largest, 160)
