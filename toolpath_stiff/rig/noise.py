"""Nuisances: what every real campaign adds, whether or not something is hidden."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from toolpath_stiff.rig.hidden import HiddenMachine
from toolpath_stiff.units import n_per_m_from_n_per_mm, n_per_mm_from_n_per_m

FloatArray = NDArray[np.float64]

# Resolution of what is printed: whole N/mm, as in the paper's Table 1 (published).
PRINTED_N_PER_MM = 1.0


@dataclass(frozen=True)
class Nuisances:
    """Standard deviations. The sizes are the issue's; repeat noise is the caller's (2 % unless said).

    Attributes
    ----------
    repeat
        Relative, of one reading.
    clamping
        Relative, common to the rows of one clamp.
    strut_spread
        Relative, of the struts' stiffnesses.
    joint_error
        m, of each coordinate of each joint.
    outliers
        Share of readings whose repeat noise is `outlier_width` times as wide.
    """

    repeat: float = 0.02
    clamping: float = 0.01
    strut_spread: float = 0.01
    joint_error: float = 0.5e-3
    outliers: float = 0.02
    outlier_width: float = 4.0
    rounded: bool = True

    @classmethod
    def none(cls) -> Nuisances:
        """No nuisance at all, not even rounding."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, rounded=False)


def disturb_machine(hidden: HiddenMachine, nuisances: Nuisances, rng: Generator) -> HiddenMachine:
    """The machine with its struts spread and its joints displaced."""
    return dataclasses.replace(
        hidden,
        strut_factors=hidden.strut_factors * (1.0 + nuisances.strut_spread * rng.standard_normal(6)),
        frame_errors=hidden.frame_errors + nuisances.joint_error * rng.standard_normal((6, 3)),
        platform_errors=hidden.platform_errors + nuisances.joint_error * rng.standard_normal((6, 3)),
    )


def disturb_readings(
    stiffness: FloatArray, clamps: NDArray[np.int64], nuisances: Nuisances, rng: Generator
) -> FloatArray:
    """(n,) N/m as printed, from what undisturbed instruments would show; `clamps` (n,) numbers the clamps from 0."""
    n = len(stiffness)
    wide = np.where(rng.random(n) < nuisances.outliers, nuisances.outlier_width, 1.0)
    repeat = nuisances.repeat * wide * rng.standard_normal(n)
    clamping = nuisances.clamping * rng.standard_normal(int(clamps.max()) + 1)[clamps]
    # On the logarithm, so that no reading can come out negative.
    shown = stiffness * np.exp(repeat + clamping)
    if not nuisances.rounded:
        return np.asarray(shown)
    printed = np.round(n_per_mm_from_n_per_m(shown) / PRINTED_N_PER_MM) * PRINTED_N_PER_MM
    return np.asarray(n_per_m_from_n_per_mm(printed))


def reading_sd(stiffness: FloatArray, nuisances: Nuisances) -> FloatArray:
    """(n,) N/m, one reading's standard deviation, re-clamping included, as an experimenter would state it."""
    return np.asarray(stiffness * np.hypot(nuisances.repeat, nuisances.clamping))
