"""What a placement search hands to tables, JSON and pictures: everything in the shop's units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis import Analysis, analyse
from toolpath_stiff.analysis.path_analysis import assumptions
from toolpath_stiff.analysis.statistics import share, stiffness_figures
from toolpath_stiff.errors import UnreachableError
from toolpath_stiff.nc.moves import Program
from toolpath_stiff.placement.search import PlacementResult
from toolpath_stiff.rewriting import offset_blocks
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import Pose, deg_from_rad, mm_from_m, n_per_mm_from_n_per_m, um_from_m

FloatArray = NDArray[np.float64]

COLUMNS = (
    "x_mm",
    "y_mm",
    "z_mm",
    "a_deg",
    "b_deg",
    "rotation_deg",
    "mean_N_per_mm",
    "range_N_per_mm",
    "min_N_per_mm",
    "mean_deflection_um",
    "extrapolated_share",
    "margin",
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


def front_rows(
    model: StiffnessModel, program: Program, found: PlacementResult, step: float, force: float
) -> list[dict[str, float]]:
    """Rows of `placements.csv`, by rising mean; deflections under `force` in N."""
    rows = []
    for i, placement in enumerate(found.front):
        row = placement_row(placement)
        row["mean_N_per_mm"] = n_per_mm_from_n_per_m(float(found.figures.mean[i]))
        row["range_N_per_mm"] = n_per_mm_from_n_per_m(float(found.figures.spread[i]))
        row["min_N_per_mm"] = n_per_mm_from_n_per_m(float(found.figures.lowest[i]))
        row["mean_deflection_um"] = um_from_m(force * float(found.figures.compliance[i]))
        row["extrapolated_share"] = _extrapolated(model, program, placement, step)
        row["margin"] = float(found.figures.margin[i])
        rows.append(row)
    return rows


def _extrapolated(model: StiffnessModel, program: Program, placement: FloatArray, step: float) -> float:
    """Share of the cutting samples outside the strut law's range, at a step coarse enough to be quick."""
    analysis = analyse(model, program, origin=pose_of(placement), step=max(step, 5e-3))
    return share(analysis.at.extrapolated, analysis.samples.cutting)


def figures_of(analysis: Analysis) -> dict[str, Any]:
    """Placement and figures of one analysis."""
    found = stiffness_figures(analysis, analysis.counted)
    keys = ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm", "mean_deflection_um")
    extrapolated = share(analysis.at.extrapolated, analysis.samples.cutting)
    row = placement_row(np.array(analysis.origin))
    return {**row, **{key: found[key] for key in keys}, "extrapolated_share": extrapolated}


def analyse_before(
    model: StiffnessModel, program: Program, origin: Pose, **options: Any
) -> tuple[Analysis | None, str]:
    """The program where it is now, or None and why."""
    try:
        return analyse(model, program, origin=origin, **options), ""
    except UnreachableError as error:
        return None, str(error)


def placement_summary(
    program: Program,
    found: PlacementResult,
    best: Analysis,
    before: Analysis | None,
    reason: str,
    front: list[dict[str, float]],
    objective: str,
    seed: int,
) -> dict[str, Any]:
    """The figures of `placement.json`."""
    placement = pose_of(found.best)
    blocks = offset_blocks(program, placement)
    near = np.argsort(best.at.margin + np.where(best.samples.cutting, 0.0, np.inf), kind="stable")[:200]
    binding = list(dict.fromkeys(best.at.limits[int(best.at.limit[i])].name for i in near))[:3]
    costs = {}
    for goal, key, sign in (("mean", "mean_N_per_mm", 1), ("range", "range_N_per_mm", -1), ("min", "min_N_per_mm", 1)):
        reached = max(front, key=lambda row: sign * row[key])
        costs[goal] = {
            "recommended_N_per_mm": figures_of(best)[key],
            "best_on_front_N_per_mm": reached[key],
        }
    return {
        "program": program.name,
        "machine": best.machine.name,
        "load": str(best.load),
        "force_N": best.force,
        "objective": objective,
        "recommended": figures_of(best),
        "before": figures_of(before) if before else None,
        "before_reason": reason or None,
        "costs": costs,
        "front": front,
        "binding_limits": [
            {"limit": name, "smallest_margin": float(best.at.margin[best.samples.cutting].min())}
            for name in binding[:1]
        ]
        + [{"limit": name} for name in binding[1:]],
        "offset_blocks": {
            "linuxcnc": blocks.linuxcnc or None,
            "linuxcnc_reason": blocks.linuxcnc_reason or None,
            "fanuc": blocks.fanuc or None,
            "fanuc_reason": blocks.fanuc_reason or None,
        },
        "seed": seed,
        "pose_evaluations": found.pose_evaluations,
        "assumptions": assumptions(best),
        "warnings": list(best.warnings),
    }
