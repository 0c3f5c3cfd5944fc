"""`residuals.csv`: one row per reading, its pose and the values it is compared with."""

from collections.abc import Iterable, Mapping

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.units import deg_from_rad, mm_from_m

PLACE = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "dx", "dy", "dz")


def residual_rows(
    data: Readings, names: Mapping[str, Iterable[object]], figures: Mapping[str, tuple[FloatArray, str]]
) -> str:
    """Table: file, line, point, further names, pose, direction, figures (n,) with their formats; nan is empty."""
    place = np.concatenate([mm_from_m(data.position), deg_from_rad(data.angles), data.direction], axis=1)
    every = {name: (place[:, k], ".6g") for k, name in enumerate(PLACE)} | dict(figures)
    named = {"file": data.file, "line": data.line, "point": data.point, **names}
    columns = [["" if np.isnan(x) else f"{x:{form}}" for x in (v + 0.0).tolist()] for v, form in every.values()]
    return csv_text([*named, *every], zip(*named.values(), *columns, strict=True))
