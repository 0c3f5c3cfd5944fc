"""The colour scale of stiffness, shared by the pictures and the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.units import n_per_mm_from_n_per_m

if TYPE_CHECKING:
    from toolpath_stiff.analysis import Analysis

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

CLASSES = 32  # colours; more cannot be told apart along a line, and each costs a drawing call
FENCE = 3.0  # interquartile ranges beyond the quartiles; Tukey, Exploratory Data Analysis, 1977: "far out"
UNREACHABLE, PLUNGE = -1, CLASSES  # without a colour of the scale; a lower class wins where segments are joined


def scale_limits(analysis: Analysis, show_plunges: bool = False) -> tuple[float, float]:
    """Ends of the colour scale in N/mm: lowest and highest of the headline, values far out (`FENCE`) set aside.

    A few short cuts, stiffer by far than the rest, would otherwise take all the contrast. The legend marks an end
    that values lie beyond. With `show_plunges` the plunges beside the headline are on the scale, all of them.
    """
    stiffness, weight = _scaled_samples(analysis)
    order = np.argsort(stiffness, kind="stable")
    length = np.cumsum(weight[order])
    lower, upper = stiffness[order[np.searchsorted(length, [0.25 * length[-1], 0.75 * length[-1]])]]
    reach = FENCE * (upper - lower)
    inside = stiffness[(stiffness >= lower - reach) & (stiffness <= upper + reach)]
    values = inside if np.ptp(inside) > 0.0 else stiffness
    low, high = float(values.min()), float(values.max())
    if show_plunges and analysis.set_aside.any():
        plunges = n_per_mm_from_n_per_m(analysis.at.stiffness[analysis.set_aside])
        low, high = min(low, float(plunges.min())), max(high, float(plunges.max()))
    if high - low < 1e-6 * high:  # a constant: keep the scale from collapsing
        low, high = low * (1.0 - 1e-3), high * (1.0 + 1e-3)
    return low, high


def _scaled_samples(analysis: Analysis) -> tuple[FloatArray, FloatArray]:
    """Stiffness in N/mm and length of the headline samples.

    A program that only turns rotary axes has none: then every reachable cutting sample counts alike.
    """
    about, weight = analysis.headline, analysis.samples.weight
    if not about.any():
        about, weight = analysis.samples.cutting & analysis.at.reachable, np.ones(len(weight))
    return n_per_mm_from_n_per_m(analysis.at.stiffness[about]), weight[about]


def segment_classes(stiffness: FloatArray, limits: tuple[float, float]) -> IntArray:
    """(n,) class 0 to CLASSES - 1 of segments of the path.

    `stiffness` and `limits` in N/mm; values beyond the limits take the end classes; UNREACHABLE where there is none.
    """
    low, high = limits
    missing = np.isnan(stiffness)
    part = (np.where(missing, low, stiffness) - low) / (high - low)
    classes = np.clip((part * CLASSES).astype(np.int64), 0, CLASSES - 1)
    return np.where(missing, UNREACHABLE, classes)


def legend_extend(analysis: Analysis, limits: tuple[float, float]) -> str:
    """Which ends of the scale headline values lie beyond: "neither", "min", "max" or "both" (matplotlib's words)."""
    stiffness = _scaled_samples(analysis)[0]
    below, above = bool(stiffness.min() < limits[0]), bool(stiffness.max() > limits[1])
    return {(False, False): "neither", (True, False): "min", (False, True): "max"}.get((below, above), "both")
