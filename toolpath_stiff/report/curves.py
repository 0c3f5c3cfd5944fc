"""Stiffness along a path as drawn on page and pictures: curves of few points, ends of scales, boxes."""

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.path.sampling import Samples
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

FENCE = 3.0  # interquartile ranges beyond the quartiles; Tukey, Exploratory Data Analysis, 1977: "far out"


def profile_curve(analysis: Analysis) -> tuple[FloatArray, FloatArray]:
    """Path length in mm and stiffness in N/mm of every sample; nan on rapids, out of reach, and plunges set aside."""
    stiffness = n_per_mm_from_n_per_m(analysis.at.stiffness)
    drawn = analysis.samples.cutting & ~analysis.set_aside
    return mm_from_m(analysis.samples.s), np.where(drawn, stiffness, np.nan)


def profile_band(analysis: Analysis) -> tuple[FloatArray, FloatArray] | None:
    """Lower and upper end of the 95 % band of every sample in N/mm, nan as in `profile_curve`; None without a band."""
    band = analysis.parameter_band
    if band is None:
        return None
    _, k = profile_curve(analysis)
    reach = defaults.NORMAL_95 * n_per_mm_from_n_per_m(band.deviation)
    return k - reach, k + reach


def extremes_by_column(x: FloatArray, y: FloatArray, columns: int) -> IntArray:
    """Rows, in order, that draw the same picture as all rows on `columns` pixels.

    Of every run of rows in one column of pixels the first, the last, the lowest and the highest are kept, so no
    extreme is lost; of a run of nan the first, which keeps the gap. x ascends.
    """
    if len(x) <= 4 * columns:
        return np.arange(len(x))
    span = float(x[-1] - x[0])
    column = np.zeros(len(x), dtype=np.int32) if span == 0.0 else ((x - x[0]) / span * columns).astype(np.int32)
    missing = np.isnan(y)
    fresh = np.concatenate([[True], (column[1:] != column[:-1]) | (missing[1:] != missing[:-1])])
    first = np.flatnonzero(fresh)
    last = np.append(first[1:], len(x)) - 1
    lengths = last - first + 1
    run = np.repeat(np.arange(len(first), dtype=np.int32), lengths)
    lowest = np.flatnonzero(y == np.repeat(np.minimum.reduceat(y, first), lengths))
    highest = np.flatnonzero(y == np.repeat(np.maximum.reduceat(y, first), lengths))
    kept = fresh.copy()
    kept[last] = kept[lowest[np.diff(run[lowest], prepend=-1) != 0]] = True  # the first of equals
    kept[highest[np.diff(run[highest], append=-1) != 0]] = True  # the last of equals
    return np.flatnonzero(kept & (fresh | ~missing))


def cutting_box(samples: Samples) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest position (3,) of the cutting samples, mm."""
    low, high = np.empty(3), np.empty(3)
    for axis in range(3):  # one by one, as a copy of all positions is a tenth of a long path's memory
        along = samples.position[samples.cutting, axis]
        low[axis], high[axis] = mm_from_m(float(along.min())), mm_from_m(float(along.max()))
    return low, high


def _charted(analysis: Analysis) -> FloatArray:
    """N/mm of the headline samples; if the program only turns rotary axes, of every sample in reach."""
    rows = analysis.headline if analysis.headline.any() else analysis.samples.cutting & analysis.at.reachable
    return n_per_mm_from_n_per_m(analysis.at.stiffness[rows])


def scale_limits(analysis: Analysis) -> tuple[float, float]:
    """Ends of the colour scale in N/mm: lowest and highest headline value, outliers set aside.

    A few short cuts, stiffer by far than the rest, would otherwise take all the contrast. The legend marks an end
    that values lie beyond.
    """
    stiffness = _charted(analysis)
    lower, upper = np.quantile(stiffness, (0.25, 0.75))
    reach = FENCE * (upper - lower)
    inside = stiffness[(stiffness >= lower - reach) & (stiffness <= upper + reach)]
    values = inside if np.ptp(inside) > 0.0 else stiffness
    low, high = float(values.min()), float(values.max())
    if high - low < 1e-6 * high:  # a constant: keep the scale from collapsing
        low, high = low * (1.0 - 1e-3), high * (1.0 + 1e-3)
    return low, high


def beyond_scale(analysis: Analysis, limits: tuple[float, float]) -> tuple[bool, bool]:
    """True if headline values lie below the scale; True if they lie above."""
    stiffness = _charted(analysis)
    return bool(stiffness.min() < limits[0]), bool(stiffness.max() > limits[1])
