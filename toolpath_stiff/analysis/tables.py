"""The samples as a table: `samples.csv`, Parquet, a pandas DataFrame; all with the same columns."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.cut_classes import along_tool_axis
from toolpath_stiff.analysis.path_analysis import Analysis
from toolpath_stiff.column_files import csv_pieces, parquet_pieces
from toolpath_stiff.path import PATH_COLUMNS, Samples, path_columns
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m, um_from_m

if TYPE_CHECKING:
    import pandas as pd

COLUMNS: dict[str, int | None] = {
    **PATH_COLUMNS,
    "stiffness_N_per_mm": 4,
    "deflection_um": 6,
    **{f"strut{i}_mm": 6 for i in range(1, 7)},
    "margin": 6,
    "margin_limit": None,
    "operation": None,
    "cut": None,
}


def sample_columns(analysis: Analysis, rows: slice = slice(None)) -> dict[str, NDArray[Any]]:
    """Column name -> values in the shop's units, for some rows."""
    at = analysis.at
    names = np.array([limit.name for limit in at.limits] or ["none"])
    return {
        **path_columns(analysis.samples, rows),
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(at.stiffness[rows]),
        "deflection_um": um_from_m(analysis.force / at.stiffness[rows]),
        **{f"strut{i + 1}_mm": mm_from_m(at.strut_lengths[rows, i]) for i in range(6)},
        "margin": at.margin[rows],
        "margin_limit": names[at.limit[rows]],
        "operation": analysis.operations.of_move[analysis.samples.move[rows]] + 1,
        "cut": _cut(analysis.samples.take(rows)),
    }


def _cut(samples: Samples) -> NDArray[np.str_]:
    """(n,) "across" or "plunge", whatever the load; "" on rapids and where the tip does not move."""
    moving = samples.cutting & samples.tangent.any(axis=1)
    return np.where(moving, np.where(along_tool_axis(samples.tangent, samples.abc), "plunge", "across"), "")


def samples_frame(analysis: Analysis) -> pd.DataFrame:
    """The samples as a DataFrame, full precision."""
    import pandas as pd

    return pd.DataFrame(sample_columns(analysis))


def samples_csv(analysis: Analysis) -> Iterator[bytes]:
    """`samples.csv` in pieces: the heading, then blocks of rows. A value that does not exist is an empty cell."""
    return csv_pieces(partial(sample_columns, analysis), len(analysis.samples), COLUMNS)


def samples_parquet(analysis: Analysis) -> Iterator[bytes]:
    """`samples.parquet` in pieces, full precision. A value that does not exist is null."""
    return parquet_pieces(partial(sample_columns, analysis), len(analysis.samples))
