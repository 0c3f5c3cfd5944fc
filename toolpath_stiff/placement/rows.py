"""Rows of `placements.csv`: a placement and its figures, in the shop's units."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from toolpath_stiff.analysis.loads import Load, plunging_rows
from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.analysis.statistics import share, stiffness_figures
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.placement.evaluator import Evaluator
from toolpath_stiff.placement.paths import WorkPath
from toolpath_stiff.placement.search import PlacementResult
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
    def origin_mm_deg(self) -> tuple[float, ...]:
        """X, Y, Z in mm, A, B, C in degrees."""
        return self.x_mm, self.y_mm, self.z_mm, self.a_deg, self.b_deg, self.rotation_deg

    def figures(self) -> dict[str, float | None]:
        """The row without number and margins, as `placement.json` has the present placement."""
        return {name: value for name, value in vars(self).items() if name not in ("number", "margin", "rapid_margin")}

    @property
    def origin(self) -> Pose:
        """The placement in m and rad."""
        x, y, z = (m_from_mm(v) for v in self.origin_mm_deg[:3])
        a, b, c = (rad_from_deg(v) for v in self.origin_mm_deg[3:])
        return x, y, z, a, b, c


COLUMNS = tuple(field.name for field in fields(PlacementRow))
PLACEMENT = COLUMNS[1:7]


def placement_mm_deg(placement: Pose | FloatArray) -> tuple[float, float, float, float, float, float]:
    """A placement (6,) in mm and degrees; the rotation within 0 to 360."""
    x, y, z, a, b, c = (float(v) for v in placement)
    return mm_from_m(x), mm_from_m(y), mm_from_m(z), deg_from_rad(a), deg_from_rad(b), deg_from_rad(c) % 360.0


def front_rows(
    model: StiffnessModel, path: WorkPath, load: Load, search: PlacementResult, force: float
) -> list[PlacementRow]:
    """The front, numbered from 1 by rising mean; deflections under `force` in N."""
    figures = search.figures
    values = [figures.mean, figures.spread, figures.lowest, np.full((2, len(search.front)), np.nan)]
    plunging = plunging_rows(load, path.tangent, path.abc, path.cutting & (path.weight > 0.0)) & ~path.headline
    if plunging.any():  # a class of their own
        plunges = Evaluator(model, path.alone(plunging), load, force).figures(search.front)
        values[3] = np.array([plunges.mean, plunges.lowest])
    stiffness = n_per_mm_from_n_per_m(np.vstack(values)).T.tolist()
    return [
        PlacementRow(
            i + 1,
            *placement_mm_deg(placement),
            mean,
            spread,
            lowest,
            um_from_m(force * float(figures.compliance[i])),
            _finite(plunge_mean),
            _finite(plunge_lowest),
            float(figures.extrapolated[i]),
            _finite(figures.margin[i]),
            _finite(figures.rapid_margin[i]),
        )
        for i, (placement, (mean, spread, lowest, plunge_mean, plunge_lowest)) in enumerate(
            zip(search.front, stiffness, strict=True)
        )
    ]


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


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
