"""The figures of a path tool by tool and operation by operation: the same for both."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.cut_classes import headline_of, headline_words
from toolpath_stiff.analysis.path_analysis import Analysis
from toolpath_stiff.nc.moves import RAPID
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m, um_from_m

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

FIGURES = ("mean_N_per_mm", "min_N_per_mm", "max_N_per_mm", "range_N_per_mm", "mean_deflection_um")


def weighted_figures(stiffness: FloatArray, weight: FloatArray, force: float) -> dict[str, float | None]:
    """Mean by weight, min, max, range in N/mm and mean deflection in um; None for each where there is nothing.

    stiffness (n,) N/m; weight (n,); force N.
    """
    if not len(stiffness):
        return dict.fromkeys(FIGURES)
    low, high = float(stiffness.min()), float(stiffness.max())
    return {
        "mean_N_per_mm": n_per_mm_from_n_per_m(float(np.average(stiffness, weights=weight))),
        "min_N_per_mm": n_per_mm_from_n_per_m(low),
        "max_N_per_mm": n_per_mm_from_n_per_m(high),
        "range_N_per_mm": n_per_mm_from_n_per_m(high - low),
        "mean_deflection_um": um_from_m(float(np.average(force / stiffness, weights=weight))),
    }


def class_figures(analysis: Analysis, rows: IntArray) -> dict[str, Any]:
    """The headline figures of the samples `rows`, what they are about, their weakest place, and the plunges beside.

    `rows` (m,) are rows of samples, in order; only those in the statistics count. `plunges` is None without any.
    """
    counted, plunging = analysis.counted[rows], analysis.plunging[rows]
    about = rows[headline_of(counted, plunging)]
    return {
        "headline": headline_words(analysis.load, counted, plunging),
        **_figures_and_weakest(analysis, about),
        "plunges": _plunges(analysis, rows[plunging]) if plunging.any() else None,
    }


def _plunges(analysis: Analysis, rows: IntArray) -> dict[str, Any]:
    samples = analysis.samples
    return {
        "samples": len(rows),
        "moves": len(np.unique(samples.move[rows])),
        "length_mm": mm_from_m(float(samples.weight[rows].sum())),
        **_figures_and_weakest(analysis, rows),
    }


def _figures_and_weakest(analysis: Analysis, rows: IntArray) -> dict[str, Any]:
    stiffness = analysis.at.stiffness[rows]
    return {
        **weighted_figures(stiffness, analysis.samples.weight[rows], analysis.force),
        "weakest": describe_sample(analysis, int(rows[np.argmin(stiffness)])) if len(rows) else None,
    }


def per_operation(analysis: Analysis) -> list[dict[str, Any]]:
    """The figures of each operation, in the order of the run; their lengths, times and samples add up to the whole."""
    operations = analysis.operations
    parts = _Parts(analysis, operations.of_move, len(operations.rows))
    return [
        {
            "operation": operation.number,
            "name": operation.name,
            "tool": operation.tool,
            "first_line": operation.first_line,
            "last_line": operation.last_line,
            **parts.row(part),
        }
        for part, operation in enumerate(operations.rows)
    ]


def per_tool(analysis: Analysis) -> list[dict[str, Any]]:
    """The figures of each tool that cuts, in order of use; a tool that cuts with two lengths has two rows.

    Rapids with a length that the tool never cuts with (before G43) count with the first that it does.
    """
    moves = analysis.program.moves
    remarks = {tool.number: tool.remark for tool in analysis.program.tools}
    tools, tool = np.unique(moves.tool, return_inverse=True)
    lengths, length = np.unique(moves.tool_length, return_inverse=True)  # nan, the reference tool's, is one of them
    many = len(lengths)
    of_move = tool * many + length
    used, first = np.unique(of_move[moves.motion != RAPID], return_index=True)
    order = used[np.argsort(first)].tolist()
    first_of_tool: dict[int, int] = {}
    for part in order:
        first_of_tool.setdefault(part // many, part)
    counts_with = [
        part if part in order else first_of_tool.get(part // many, part) for part in range(len(tools) * many)
    ]
    parts = _Parts(analysis, np.array(counts_with)[of_move], len(counts_with))
    rows = []
    for part in order:
        number, tool_length = int(tools[part // many]), float(lengths[part % many])
        about = {
            "tool": number,
            "remark": remarks.get(number, ""),
            "length_mm": None if math.isnan(tool_length) else mm_from_m(tool_length),
        }
        rows.append({**about, **parts.row(part)})
    return rows


class _Parts:
    """A path in parts, each move in one of them: `of_move` (n_moves,) says in which of `count`."""

    def __init__(self, analysis: Analysis, of_move: IntArray, count: int) -> None:
        self.analysis = analysis
        samples, moves = analysis.samples, analysis.program.moves
        first = np.searchsorted(samples.move, np.arange(len(moves)))
        last = np.append(first[1:], len(samples)) - 1
        length, cutting = samples.s[last] - samples.s[first], moves.motion != RAPID
        time = np.diff(np.append(samples.t[first], samples.t[-1]))  # with the dwell after each move but the last
        self.cutting_length = np.bincount(of_move, np.where(cutting, length, 0.0), count)
        self.rapid_length = np.bincount(of_move, np.where(cutting, 0.0, length), count)
        self.time = np.bincount(of_move, time, count)
        self.out_of_reach = analysis.out_of_reach
        self.margin = np.where(samples.cutting & analysis.at.reachable, analysis.at.margin, np.inf)
        of_sample = of_move[samples.move]
        order = np.argsort(of_sample, kind="stable")
        ends = np.searchsorted(of_sample[order], np.arange(count + 1))
        self.rows = [order[ends[part] : ends[part + 1]] for part in range(count)]

    def row(self, part: int) -> dict[str, Any]:
        """Length, time, figures, weakest place and nearest limit of one part."""
        analysis, rows = self.analysis, self.rows[part]
        nearest = int(rows[np.argmin(self.margin[rows])])
        known = bool(np.isfinite(self.margin[nearest]))
        return {
            "cutting_length_mm": mm_from_m(float(self.cutting_length[part])),
            "rapid_length_mm": mm_from_m(float(self.rapid_length[part])),
            "time_s": float(self.time[part]),
            **class_figures(analysis, rows),
            "min_margin": float(self.margin[nearest]) if known else None,
            "min_margin_limit": analysis.at.reach.describe(nearest) if known else None,
            "min_margin_line": int(analysis.samples.line[nearest]) if known else None,
            "out_of_reach_samples": int(self.out_of_reach[rows].sum()),
        }


def describe_sample(analysis: Analysis, row: int) -> dict[str, Any]:
    """Line, source text, position and stiffness of one sample."""
    samples = analysis.samples
    line = int(samples.line[row])
    x, y, z = (mm_from_m(float(v)) for v in samples.position[row])
    a, b, c = (deg_from_rad(float(v)) for v in samples.abc[row])
    source = analysis.program.source
    return {
        "line": line,
        "text": source[line - 1].strip() if 0 < line <= len(source) else "",
        "s_mm": mm_from_m(float(samples.s[row])),
        "x_mm": x,
        "y_mm": y,
        "z_mm": z,
        "a_deg": a,
        "b_deg": b,
        "c_deg": c,
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(float(analysis.at.stiffness[row])),
    }
