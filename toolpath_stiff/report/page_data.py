"""The samples as the page holds them: quantised columns in base64, thinned if there are very many."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.statistics import stiffness_figures, weakest_places
from toolpath_stiff.nc.moves import MOTION_NAMES
from toolpath_stiff.report.profile_picture import extremes_by_column, profile_curve
from toolpath_stiff.report.scale import CLASSES, legend_extend, scale_limits
from toolpath_stiff.report.wording import plain
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

if TYPE_CHECKING:
    from toolpath_stiff.analysis import Analysis

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MOST_SAMPLES = 200_000  # on the page: some 5 MB; the tables are always of all samples
OTHER_COLUMNS = 4000  # columns of pixels that the other machine's curve is thinned to
NONE = 65535  # a value that does not exist
OUT_OF_REACH, PLUNGE = 8, 16  # flags beside the motion


def page_data(analysis: Analysis, required: float | None, other: Analysis | None) -> dict[str, Any]:
    """What the page's script reads: lengths in mm, angles in degrees, stiffness in N/mm.

    Positions are 16-bit fractions of the path's own box (`frame`: a 1 m box gives 0.015 mm), stiffness and margin of
    their own ranges, NONE where there is none.
    """
    rows = page_rows(analysis)
    samples, at = analysis.samples.take(rows), analysis.at
    points = mm_from_m(samples.position)
    frame = np.stack([points.min(axis=0), points.max(axis=0)], axis=1)
    box = mm_from_m(analysis.samples.position[analysis.samples.cutting])
    stiffness, stiffness_range = _fractions(n_per_mm_from_n_per_m(at.stiffness[rows]))
    margin, margin_range = _fractions(at.margin[rows])
    kind = samples.motion + OUT_OF_REACH * ~at.reachable[rows] + PLUNGE * analysis.set_aside[rows]
    tool_starts = np.flatnonzero(np.diff(samples.tool, prepend=-1) != 0)
    return {
        "machine": plain(analysis.machine.name),
        "source": list(analysis.program.source),
        "count": len(rows),
        "samples": len(analysis.samples),
        "motions": MOTION_NAMES,
        "frame": frame.tolist(),
        "box": np.stack([box.min(axis=0), box.max(axis=0)], axis=1).tolist(),
        "position": _base64(_quantised(points, frame[:, 0], frame[:, 1], 65535)),
        "stiffness": stiffness,
        "stiffness_range": stiffness_range,
        "margin": margin,
        "margin_range": margin_range,
        **_angles(deg_from_rad(samples.abc)),
        "line": _base64(samples.line.astype("<u4")),
        "s": _base64(mm_from_m(samples.s).astype("<f4")),
        "kind": _base64(kind.astype("u1")),
        "tools": [[int(i), int(samples.tool[i])] for i in tool_starts],
        "operations": _operations(analysis, samples.move),
        "weakest": [int(np.searchsorted(rows, row)) for row in weakest_places(analysis)],
        "scale": _scale(analysis, False),
        "scale_with_plunges": _scale(analysis, True) if analysis.set_aside.any() else None,
        "plunges": [stiffness_figures(analysis, analysis.set_aside)[f"{end}_N_per_mm"] for end in ("min", "max")],
        "colours": class_colours(0.0, 0.93),  # the lightest yellow does not show on white,
        "colours_dark": class_colours(0.22, 1.0),  # nor the darkest violet on black
        "mean": stiffness_figures(analysis, analysis.headline)["mean_N_per_mm"],
        "required": None if required is None else n_per_mm_from_n_per_m(required),
        "other": None if other is None else _other_curve(other),
    }


def _scale(analysis: Analysis, show_plunges: bool) -> dict[str, Any]:
    """Ends of the colour scale, N/mm, and whether values lie beyond them."""
    limits = scale_limits(analysis, show_plunges)
    extend = legend_extend(analysis, limits)
    return {"ends": limits, "beyond_low": extend in ("min", "both"), "beyond_high": extend in ("max", "both")}


def page_rows(analysis: Analysis) -> IntArray:
    """Rows of the samples that the page holds: all of them, or the extremes of equal stretches of rows."""
    n = len(analysis.samples)
    if n <= MOST_SAMPLES:
        return np.arange(n)
    change = np.flatnonzero(np.diff(analysis.samples.motion) != 0)
    ends = np.concatenate([change, change + 1]) if 2 * len(change) < MOST_SAMPLES // 4 else change[:0]
    stiffness = np.where(analysis.samples.cutting, analysis.at.stiffness, np.nan)
    curves = [(stiffness, 6)]  # and the share of the page's samples that a curve gets a column of pixels for
    if analysis.set_aside.any():  # a column's extremes may be plunges: the headline has its own
        curves = [(np.where(analysis.set_aside, np.nan, stiffness), 8), (stiffness, 24)]
    extremes = [extremes_by_column(np.arange(n, dtype=float), k, MOST_SAMPLES // part) for k, part in curves]
    even = np.linspace(0, n - 1, MOST_SAMPLES // 12).astype(np.int64)  # rapids and gaps keep their shape too
    firsts = np.searchsorted(analysis.samples.move, [row.first_move for row in analysis.operations.rows])
    wanted = np.array([0, *weakest_places(analysis)], dtype=np.int64)
    return np.unique(np.concatenate([*extremes, even, ends, wanted, firsts, np.maximum(firsts - 1, 0)]))


def _operations(analysis: Analysis, move: IntArray) -> list[list[Any]]:
    """First row on the page, name and first line of each operation; `move` (n,) of the page's rows."""
    rows = analysis.operations.rows
    firsts = np.searchsorted(move, [row.first_move for row in rows]).tolist()
    return [[first, plain(row.name), row.first_line] for first, row in zip(firsts, rows, strict=True)]


def _other_curve(other: Analysis) -> dict[str, str]:
    s, stiffness = profile_curve(other)
    keep = extremes_by_column(s, stiffness, OTHER_COLUMNS)
    return {
        "machine": plain(other.machine.name),
        "s": _base64(s[keep].astype("<f4")),
        "stiffness": _base64(stiffness[keep].astype("<f4")),
        "plunge": _base64(other.set_aside[keep].astype("u1")),
    }


def _angles(degrees: FloatArray) -> dict[str, Any]:
    """Roll, pitch and yaw, if any sample has one."""
    if not degrees.any():
        return {"angles": None, "angle_ranges": None}
    packed = [_fractions(column) for column in degrees.T]
    return {"angles": [text for text, _ in packed], "angle_ranges": [ends for _, ends in packed]}


def _fractions(values: FloatArray) -> tuple[str, list[float]]:
    """16-bit fractions of the range of the finite values, in base64, and that range."""
    finite = np.isfinite(values)
    low, high = (float(values[finite].min()), float(values[finite].max())) if finite.any() else (0.0, 0.0)
    fractions = _quantised(np.where(finite, values, low), np.float64(low), np.float64(high), NONE - 1)
    return _base64(np.where(finite, fractions, NONE).astype("<u2")), [low, high]


def _quantised(values: FloatArray, low: Any, high: Any, steps: int) -> NDArray[np.uint16]:
    span = np.where(high > low, high - low, 1.0)
    return np.asarray(np.round((values - low) / span * steps)).astype("<u2")


def _base64(array: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")


def class_colours(start: float, end: float) -> list[str]:
    """CSS colours of the classes, weakest first: viridis, perceptually uniform."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colour) for colour in colormaps["viridis"](np.linspace(start, end, CLASSES))]
