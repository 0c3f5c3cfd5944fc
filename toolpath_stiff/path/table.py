"""The sampled path of a program as a table in the shop's units."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import IntArray
from toolpath_stiff.column_files import csv_pieces
from toolpath_stiff.documents import to_dict, without_nan
from toolpath_stiff.files import write_atomically
from toolpath_stiff.nc.moves import MOTION_NAMES
from toolpath_stiff.path.sampling import Samples
from toolpath_stiff.results import DataFrame, Result, frame_of
from toolpath_stiff.units import deg_from_rad, mm_from_m, mm_per_min_from_m_per_s, per_min_from_rad_per_s


def decimals_of(column: str) -> int:
    """Decimals of a column, by the unit in its name: a tenth of a micrometre is finer than any machine moves."""
    return 4 if column.endswith("_mm") else 6


# Column -> decimals; None: a whole number or a word.
PATH_COLUMNS: dict[str, int | None] = {
    **dict.fromkeys(("line", "motion", "tool")),
    **{name: decimals_of(name) for name in ("s_mm", "t_s", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")},
    "feed_mm_per_min": 3,
}


def path_columns(samples: Samples, rows: slice | IntArray = slice(None)) -> dict[str, NDArray[Any]]:
    r"""Column of `PATH_COLUMNS` -> values, for some rows.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> from toolpath_stiff.path.sampling import sample_moves
    >>> samples = sample_moves(parse_program("G21 G90 F600\nG1 X40\nM30\n").moves, step=0.02)
    >>> columns = path_columns(samples)
    >>> columns["x_mm"].tolist(), columns["motion"].tolist()
    ([0.0, 20.0, 40.0], ['feed', 'feed', 'feed'])
    """
    axes = zip("xyz", mm_from_m(samples.position[rows]).T, strict=True)
    angles = zip("abc", deg_from_rad(samples.abc[rows]).T, strict=True)
    return {
        "line": samples.line[rows].astype(np.int64),
        "motion": np.array(MOTION_NAMES)[samples.motion[rows]],
        "tool": samples.tool[rows],
        "s_mm": mm_from_m(samples.s[rows]),
        "t_s": samples.t[rows],
        **{f"{axis}_mm": column for axis, column in axes},
        **{f"{axis}_deg": column for axis, column in angles},
        "feed_mm_per_min": mm_per_min_from_m_per_s(samples.feed[rows]),
    }


@dataclass(frozen=True, repr=False)
class SampledPath(Result):
    r"""The sampled path of a program, without a machine.

    Attributes
    ----------
    samples
        Arrays in SI.
    name, warnings, unsupported
        The program's; what deserves a look; "line:column: word: reason" of what was not acted upon.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> path = tps.sample_path(slot, step_mm=10)
    >>> path
    <SampledPath: slot.nc, 9 samples>
    >>> path.to_dict()["x_mm"][-2:]
    [30.0, 40.0]
    >>> b"".join(path.csv()).decode().splitlines()[0][:26]
    'line,motion,tool,s_mm,t_s,'
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path.save(pathlib.Path(folder, "path.csv")).name
    'path.csv'
    """

    command: ClassVar[str] = "path"

    name: str
    samples: Samples
    warnings: list[str]
    unsupported: list[str]

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the command."""
        columns = without_nan(to_dict(self._columns()))
        return {"program": self.name, "warnings": self.warnings, "unsupported": self.unsupported, **columns}

    def to_frame(self) -> DataFrame:
        """The samples, one a row."""
        return frame_of(self._columns())

    def _columns(self) -> dict[str, NDArray[Any]]:
        return {**path_columns(self.samples), "spindle_rpm": per_min_from_rad_per_s(self.samples.spindle)}

    def csv(self) -> Iterator[bytes]:
        """The table as the command writes it, in pieces."""
        return csv_pieces(partial(path_columns, self.samples), len(self.samples), PATH_COLUMNS)

    def __str__(self) -> str:
        return b"".join(self.csv()).decode()

    def _short(self) -> str:
        return f"{self.name}, {len(self.samples)} samples"

    def save(self, file: str | Path) -> Path:
        """Write the table as CSV, whole or not at all."""
        return write_atomically(file, self.csv())
