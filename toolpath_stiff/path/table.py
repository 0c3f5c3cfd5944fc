"""The sampled path as a table in the shop's units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.nc.moves import MOTION_NAMES
from toolpath_stiff.path.samples import Samples
from toolpath_stiff.units import deg_from_rad, mm_from_m, mm_per_min_from_m_per_s

# Column -> decimals; None: a whole number or a word. A millionth of a millimetre is finer than any machine and
# lets sums over a long path keep their digits.
PATH_COLUMNS: dict[str, int | None] = {
    "line": None,
    "motion": None,
    "tool": None,
    "s_mm": 6,
    "t_s": 6,
    "x_mm": 6,
    "y_mm": 6,
    "z_mm": 6,
    "a_deg": 6,
    "b_deg": 6,
    "c_deg": 6,
    "feed_mm_per_min": 3,
}


def path_columns(samples: Samples, rows: slice = slice(None)) -> dict[str, NDArray[Any]]:
    """Column of `PATH_COLUMNS` -> values, for some rows."""
    position, abc = mm_from_m(samples.position[rows]), deg_from_rad(samples.abc[rows])
    return {
        "line": samples.line[rows],
        "motion": np.array(MOTION_NAMES)[samples.motion[rows]],
        "tool": samples.tool[rows],
        "s_mm": mm_from_m(samples.s[rows]),
        "t_s": samples.t[rows],
        "x_mm": position[:, 0],
        "y_mm": position[:, 1],
        "z_mm": position[:, 2],
        "a_deg": abc[:, 0],
        "b_deg": abc[:, 1],
        "c_deg": abc[:, 2],
        "feed_mm_per_min": mm_per_min_from_m_per_s(samples.feed[rows]),
    }
