"""Rows of `placements.csv`: a placement and its figures, in the shop's units."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from toolpath_stiff.analysis.loads import Load, plunging_rows
from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.analysis.statistics import share, stiffness_figures
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.placement.evaluator import Evaluator
from toolpath_stiff.placement.paths import WorkPath
from toolpath_stiff.placement.search import PlacementResult
from toolpath_stiff.poses import Pose, ShopPose, pose_in_mm, pose_in_si
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import n_per_mm_from_n_per_m, um_from_m

# The three objectives and where their values stand.
FIGURES = {"mean": "mean_N_per_mm", "range": "range_N_per_mm", "weakest": "min_N_per_mm"}


@dataclass(frozen=True)
class PlacementRow:
    """A placement and its figures. The present one has no number, and no margins beside the front's."""

    number: int | None
    x_mm: float
    y_mm: float
    z_mm: float
    a_deg: float
    b_deg: float
    rotation_deg: float
    mean_N_per_mm: float  # noqa: N815
    range_N_per_mm: float  # noqa: N815
    min_N_per_mm: float  # noqa: N815
    mean_deflection_um: float
    plunge_mean_N_per_mm: float | None  # noqa: N815
    plunge_min_N_per_mm: float | None  # noqa: N815
    extrapolated_share: float
    margin: float | None = None
    rapid_margin: float | None = None

    @property
    def origin_mm_deg(self) -> ShopPose:
        """X, Y, Z in mm, A, B, C in degrees."""
        return self.x_mm, self.y_mm, self.z_mm, self.a_deg, self.b_deg, self.rotation_deg

    @property
    def origin(self) -> Pose:
        """The placement in m and rad."""
        return pose_in_si(self.origin_mm_deg)


COLUMNS = tuple(field.name for field in fields(PlacementRow))
PLACEMENT = COLUMNS[1:7]


def placement_mm_deg(placement: Pose | FloatArray) -> ShopPose:
    """A placement (6,) in mm and degrees; the rotation within 0 to 360."""
    x, y, z, a, b, c = pose_in_mm(map(float, placement))
    return x, y, z, a, b, c % 360.0


def numbered_rows(
    model: StiffnessModel, path: WorkPath, load: Load, search: PlacementResult, force: float
) -> list[PlacementRow]:
    """The front, numbered from 1 by rising mean; deflections under `force` in N."""
    front, figures = search.front, search.figures
    plunge_mean = plunge_lowest = np.full(len(front), np.nan)
    plunging = plunging_rows(load, path.tangent, path.abc, path.cutting & (path.weight > 0.0)) & ~path.headline
    if plunging.any():  # a class of their own
        plunges = Evaluator(model, path.alone(plunging), load, force).figures(front)
        plunge_mean, plunge_lowest = plunges.mean, plunges.lowest
    stiffnesses = (figures.mean, figures.spread, figures.lowest, plunge_mean, plunge_lowest)
    mean, spread, lowest, *of_plunges = (n_per_mm_from_n_per_m(values) for values in stiffnesses)
    deflection = um_from_m(force * figures.compliance)
    shares = (figures.extrapolated, figures.margin, figures.rapid_margin)
    rows = []
    for i, values in enumerate(np.stack([mean, spread, lowest, deflection, *of_plunges, *shares], axis=1).tolist()):
        cells: list[Any] = [value if np.isfinite(value) else None for value in values]
        rows.append(PlacementRow(i + 1, *placement_mm_deg(front[i]), *cells))
    return rows


def analyzed_row(analysis: Analysis, number: int | None = None, like: PlacementRow | None = None) -> PlacementRow:
    """Placement and figures of an analysis, the headline's and the plunges' beside; margins as of a row `like` it."""
    headline, plunges = (stiffness_figures(analysis, rows) for rows in (analysis.headline, analysis.set_aside))
    return PlacementRow(
        number,
        *placement_mm_deg(analysis.origin),
        headline["mean_N_per_mm"],
        headline["range_N_per_mm"],
        headline["min_N_per_mm"],
        headline["mean_deflection_um"],
        plunges["mean_N_per_mm"],
        plunges["min_N_per_mm"],
        share(analysis.at.extrapolated, analysis.samples.cutting),
        like.margin if like else None,
        like.rapid_margin if like else None,
    )
