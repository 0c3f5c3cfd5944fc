"""The samples as a table: `samples.csv`, Parquet, a pandas DataFrame; all with the same columns."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.path_analysis import Analysis
from toolpath_stiff.nc.moves import MOTION_NAMES
from toolpath_stiff.units import (
    deg_from_rad,
    mm_from_m,
    mm_per_min_from_m_per_s,
    n_per_mm_from_n_per_m,
    um_from_m,
)

if TYPE_CHECKING:
    import pandas as pd

ROWS_AT_A_TIME = 10_000

# Column -> decimals; None: a whole number or a word. A millionth of a millimetre is finer than any machine and
# lets sums over a long path keep their digits.
COLUMNS: dict[str, int | None] = {
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
    "stiffness_N_per_mm": 4,
    "deflection_um": 6,
    **{f"strut{i}_mm": 6 for i in range(1, 7)},
    "margin": 6,
    "margin_limit": None,
}


def sample_columns(analysis: Analysis, rows: slice = slice(None)) -> dict[str, NDArray[Any]]:
    """Column name -> values in the shop's units, for some rows."""
    samples, at = analysis.samples, analysis.at
    names = np.array([limit.name for limit in at.limits] or ["none"])
    columns: dict[str, NDArray[Any]] = {
        "line": samples.line[rows],
        "motion": np.array(MOTION_NAMES)[samples.motion[rows]],
        "tool": samples.tool[rows],
        "s_mm": mm_from_m(samples.s[rows]),
        "t_s": samples.t[rows],
        "feed_mm_per_min": mm_per_min_from_m_per_s(samples.feed[rows]),
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(at.stiffness[rows]),
        "deflection_um": um_from_m(analysis.deflection[rows]),
        "margin": at.margin[rows],
        "margin_limit": names[at.limit[rows]],
    }
    for i, axis in enumerate("xyz"):
        columns[f"{axis}_mm"] = mm_from_m(samples.position[rows, i])
    for i, axis in enumerate("abc"):
        columns[f"{axis}_deg"] = deg_from_rad(samples.abc[rows, i])
    for i in range(6):
        columns[f"strut{i + 1}_mm"] = mm_from_m(at.strut_lengths[rows, i])
    return {name: columns[name] for name in COLUMNS}


def samples_frame(analysis: Analysis) -> pd.DataFrame:
    """The samples as a DataFrame, full precision."""
    import pandas as pd

    return pd.DataFrame(sample_columns(analysis))


def samples_csv(analysis: Analysis) -> Iterator[str]:
    """`samples.csv` in pieces: the heading, then blocks of rows. A value that does not exist is an empty cell."""
    yield ",".join(COLUMNS) + "\n"
    for start in range(0, len(analysis.samples), ROWS_AT_A_TIME):
        yield csv_rows(sample_columns(analysis, slice(start, start + ROWS_AT_A_TIME)), COLUMNS)


def csv_rows(columns: dict[str, NDArray[Any]], decimals: dict[str, int | None]) -> str:
    """Rows of a CSV file from columns; one template formats a whole row, many times faster than `csv`."""
    template = ",".join("%s" if decimals[name] is None else f"%.{decimals[name]}f" for name in columns) + "\n"
    values = []
    for name, column in columns.items():
        digits = decimals[name]
        # Adding 0.0 turns the minus zero of rounding into zero.
        values.append(column.tolist() if digits is None else (np.round(column, digits) + 0.0).tolist())
    text = "".join([template % row for row in zip(*values, strict=True)])
    return text.replace("nan", "") if "nan" in text else text
