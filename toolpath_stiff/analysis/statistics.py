"""Figures of a path: length-weighted mean, extremes, the weakest places, shares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.breakdown import class_figures, describe_sample, per_operation, per_tool, weighted_figures
from toolpath_stiff.analysis.parameter_band import band_figures
from toolpath_stiff.analysis.path_analysis import Analysis, assumptions
from toolpath_stiff.nc.moves import RAPID
from toolpath_stiff.stiffness.acting import effects_stated
from toolpath_stiff.units import deg_from_rad, mm_from_m

if TYPE_CHECKING:
    from toolpath_stiff.path import Samples

BoolArray = NDArray[np.bool_]


def stiffness_figures(analysis: Analysis, rows: BoolArray) -> dict[str, Any]:
    """Mean (by length), min, max, range in N/mm and mean deflection in um of some counted samples.

    None for each where there are no such samples.
    """
    return weighted_figures(analysis.at.stiffness[rows], analysis.samples.weight[rows], analysis.force)


def path_length(samples: Samples, rapid: bool) -> float:
    """Length in m of the rapid, or of the cutting moves."""
    if not len(samples):
        return 0.0
    step = np.diff(samples.s, prepend=samples.s[0])
    step[np.diff(samples.move, prepend=samples.move[0]) != 0] = 0.0  # a move's first sample repeats the last end
    return float(step[(samples.motion == RAPID) == rapid].sum())


def weakest_places(analysis: Analysis, count: int = 3) -> list[int]:
    """Rows of the weakest headline samples, one a place: apart by at least a twentieth of the path, other lines."""
    rows = np.flatnonzero(analysis.headline)
    if not len(rows):
        return []
    s, line = analysis.samples.s, analysis.samples.line
    apart = (s[rows[-1]] - s[rows[0]]) / 20.0
    chosen: list[int] = []
    while len(rows) and len(chosen) < count:
        best = int(rows[np.argmin(analysis.at.stiffness[rows])])
        chosen.append(best)
        rows = rows[(np.abs(s[rows] - s[best]) >= apart) & (line[rows] != line[best])]
    return chosen


def summarise(analysis: Analysis) -> dict[str, Any]:
    """The figures of `summary.json`, in the shop's units."""
    from toolpath_stiff import __version__

    samples = analysis.samples
    places = weakest_places(analysis)
    cutting = samples.cutting & analysis.at.reachable
    x, y, z, a, b, c = analysis.origin
    nearest = int(np.argmin(np.where(cutting, analysis.at.margin, np.inf)))
    band = band_figures(analysis)
    return {
        "program": analysis.program.name,
        "interpreter": analysis.program.interpreter,
        "kinematics": analysis.program.kinematics,
        "machine": analysis.machine.name,
        "load": str(analysis.load),
        "force_N": analysis.force,
        "step_mm": mm_from_m(analysis.step),
        "origin_mm_deg": [mm_from_m(x), mm_from_m(y), mm_from_m(z), *(deg_from_rad(v) for v in (a, b, c))],
        "origin_source": analysis.origin_source,
        "samples": len(samples),
        "cutting_length_mm": mm_from_m(path_length(samples, rapid=False)),
        "rapid_length_mm": mm_from_m(path_length(samples, rapid=True)),
        "time_s": float(samples.t[-1]) if len(samples) else 0.0,
        **class_figures(analysis, np.arange(len(samples))),
        **({} if band is None else {"parameter_uncertainty": band}),
        "weakest_places": [describe_sample(analysis, row) for row in places],
        "per_tool": per_tool(analysis),
        "per_operation": per_operation(analysis),
        "min_margin": float(analysis.at.margin[nearest]),
        "min_margin_limit": analysis.at.reach.describe(nearest),
        "min_margin_line": int(samples.line[nearest]),
        "out_of_reach_samples": int(analysis.out_of_reach.sum()),
        "extrapolated_share": share(analysis.at.extrapolated, cutting),
        **effects_stated(analysis.model),
        "unsupported": [
            {"line": u.line, "column": u.column, "word": u.word, "reason": u.reason}
            for u in analysis.program.unsupported
        ],
        "assumptions": assumptions(analysis),
        "warnings": list(analysis.warnings),
        "version": __version__,
    }


def share(condition: BoolArray, among: BoolArray) -> float:
    """Share of the rows of `among` for which `condition` holds; 0 of none."""
    total = int(among.sum())
    return float((condition & among).sum()) / total if total else 0.0
