"""What a placement hands to tables, JSON and pictures: everything in the shop's units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis import Analysis
from toolpath_stiff.analysis.cut_classes import plunging_rows
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.analysis.path_analysis import assumptions
from toolpath_stiff.analysis.statistics import share, stiffness_figures
from toolpath_stiff.nc.moves import Program
from toolpath_stiff.placement.batch import Evaluator, PlacementFigures
from toolpath_stiff.placement.search import PlacementResult
from toolpath_stiff.placement.work_path import WorkPath
from toolpath_stiff.rewriting import offset_blocks
from toolpath_stiff.stiffness.acting import effects_stated
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import (
    Pose,
    deg_from_rad,
    m_from_mm,
    mm_from_m,
    n_per_mm_from_n_per_m,
    rad_from_deg,
    um_from_m,
)

FloatArray = NDArray[np.float64]

PLACEMENT = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "rotation_deg")
# The three objectives and where their values stand.
FIGURES = {"mean": "mean_N_per_mm", "range": "range_N_per_mm", "weakest": "min_N_per_mm"}
COLUMNS = (
    "number",
    *PLACEMENT,
    *FIGURES.values(),
    "mean_deflection_um",
    "plunge_mean_N_per_mm",
    "plunge_min_N_per_mm",
    "extrapolated_share",
    "margin",
    "rapid_margin",
)


def pose_of(placement: FloatArray) -> Pose:
    """A placement as a tuple."""
    x, y, z, a, b, c = (float(v) for v in placement)
    return (x, y, z, a, b, c)


def placement_row(placement: FloatArray) -> dict[str, float]:
    """The numbers of a placement in mm and degrees; the rotation within 0 to 360."""
    x, y, z, a, b, c = pose_of(placement)
    return {
        "x_mm": mm_from_m(x),
        "y_mm": mm_from_m(y),
        "z_mm": mm_from_m(z),
        "a_deg": deg_from_rad(a),
        "b_deg": deg_from_rad(b),
        "rotation_deg": deg_from_rad(c) % 360.0,
    }


def placement_of(row: dict[str, Any]) -> FloatArray:
    """(6,) m and rad of a row in mm and degrees."""
    values = np.array([row[key] for key in PLACEMENT], dtype=float)
    return np.concatenate([m_from_mm(values[:3]), rad_from_deg(values[3:])])


def front_rows(
    model: StiffnessModel, path: WorkPath, load: Load, found: PlacementResult, force: float
) -> list[dict[str, Any]]:
    """Rows of `placements.csv`, numbered from 1 by rising mean; deflections under `force` in N."""
    plunges = _plunge_figures(model, path, load, found.front, force)
    rows = []
    for i, placement in enumerate(found.front):
        figures = found.figures.take(slice(i, i + 1))
        values = (figures.mean[0], figures.spread[0], figures.lowest[0])
        beside = (None, None) if plunges is None else (plunges.mean[i], plunges.lowest[i])
        mean, lowest = (None if v is None or np.isnan(v) else n_per_mm_from_n_per_m(float(v)) for v in beside)
        rows.append(
            {
                "number": i + 1,
                **placement_row(placement),
                **{k: n_per_mm_from_n_per_m(float(v)) for k, v in zip(FIGURES.values(), values, strict=True)},
                "mean_deflection_um": um_from_m(force * float(figures.compliance[0])),
                "plunge_mean_N_per_mm": mean,
                "plunge_min_N_per_mm": lowest,
                "extrapolated_share": float(figures.extrapolated[0]),
                "margin": _finite(figures.margin[0]),
                "rapid_margin": _finite(figures.rapid_margin[0]),
            }
        )
    return rows


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _plunge_figures(
    model: StiffnessModel, path: WorkPath, load: Load, front: FloatArray, force: float
) -> PlacementFigures | None:
    """Figures of the plunges alone at each placement of the front; None where they are no class of their own."""
    beside = plunging_rows(load, path.tangent, path.abc, path.cutting & (path.weight > 0.0)) & ~path.headline
    return Evaluator(model, path.alone(beside), load, force).figures(front) if beside.any() else None


def figures_of(analysis: Analysis) -> dict[str, Any]:
    """Placement and figures of one analysis: the headline's, and the plunges' beside."""
    found, beside = (stiffness_figures(analysis, rows) for rows in (analysis.headline, analysis.set_aside))
    return {
        **placement_row(np.array(analysis.origin)),
        **{key: found[key] for key in (*FIGURES.values(), "mean_deflection_um")},
        "plunge_mean_N_per_mm": beside["mean_N_per_mm"],
        "plunge_min_N_per_mm": beside["min_N_per_mm"],
        "extrapolated_share": share(analysis.at.extrapolated, analysis.samples.cutting),
    }


def placement_summary(
    program: Program,
    best: Analysis,
    front: list[dict[str, Any]],
    search: dict[str, Any],
    chosen: dict[str, Any],
    before: dict[str, Any] | None,
    reason: str,
    worse: list[dict[str, Any]],
    written: dict[str, Any] | None,
    warnings: list[str],
) -> dict[str, Any]:
    """The figures of `placement.json`."""
    return {
        "warnings": warnings,
        "worse": worse,
        "program": program.name,
        "machine": best.machine.name,
        **effects_stated(best.model),
        "load": str(best.load),
        "force_N": best.force,
        "objective": search["options"]["--objective"],
        "chosen": chosen,
        "picked": chosen["number"] != search["recommended"],
        "recommended": front[search["recommended"] - 1],
        "before": before,
        "before_reason": reason or None,
        "costs": _costs(front, chosen),
        "front": front,
        "binding_limits": _binding_limits(best),
        "offset_blocks": _offsets(program, best.origin),
        "written": written,
        "search": search,
        "assumptions": assumptions(best),
    }


def _costs(front: list[dict[str, Any]], chosen: dict[str, Any]) -> dict[str, dict[str, float]]:
    """What the choice costs in each objective: the best on the front beside it."""
    return {
        name: {
            "chosen_N_per_mm": chosen[key],
            "best_on_front_N_per_mm": (min if name == "range" else max)(row[key] for row in front),
        }
        for name, key in FIGURES.items()
    }


def _binding_limits(best: Analysis) -> list[dict[str, Any]]:
    """The limits that the cuts come nearest to, at most three."""
    near = np.argsort(best.at.margin + np.where(best.samples.cutting, 0.0, np.inf), kind="stable")[:200]
    names = list(dict.fromkeys(best.at.limits[int(best.at.limit[i])].name for i in near))[:3]
    smallest = float(best.at.margin[best.samples.cutting].min())
    return [{"limit": name, **({"smallest_margin": smallest} if i == 0 else {})} for i, name in enumerate(names)]


def _offsets(program: Program, placement: Pose) -> dict[str, str | None]:
    blocks = offset_blocks(program, placement)
    return {
        "linuxcnc": blocks.linuxcnc or None,
        "linuxcnc_reason": blocks.linuxcnc_reason or None,
        "fanuc": blocks.fanuc or None,
        "fanuc_reason": blocks.fanuc_reason or None,
    }
