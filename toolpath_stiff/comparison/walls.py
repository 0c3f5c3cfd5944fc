"""Measured walls compared with the errors predicted for a cut: where the model of cut and machine fails.

A point is held against the final wall beside which it lies: its measured deviation along the normal, out of the part,
against the error that is predicted at its height. The lines of the program are the places; a line fails where its mean
residual is beyond twice what scatter and the band of the model explain.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.cutting.compensation import places_beside
from toolpath_stiff.cutting.cut import Cut
from toolpath_stiff.cutting.cutters import of_tools
from toolpath_stiff.cutting.passes import profile_at
from toolpath_stiff.cutting.tip import walls_beside
from toolpath_stiff.documents import certain, records, without_nan
from toolpath_stiff.errors import MeasurementError
from toolpath_stiff.nc.moves import Moves
from toolpath_stiff.readings.mapping import check_needed, mapped_table, number_columns
from toolpath_stiff.results import DataFrame, FolderResult, frame_of
from toolpath_stiff.tables import Columns
from toolpath_stiff.units import m_from_mm, m_from_um, mm_from_m, um_from_m

POINT, NORMAL = ("x_mm", "y_mm", "z_mm"), ("nx", "ny", "nz")
COLUMNS = Columns((*POINT, *NORMAL, "deviation_um"))
LAYOUT = (
    "x_mm,y_mm,z_mm of a point in program coordinates, nx,ny,nz out of the part, deviation_um unless the point has it"
)
FARTHEST = 5e-4  # m from a final wall, and above or below it, at which a point still belongs to it
ALONG = 0.9  # cosine between a point's normal and its wall's
SURE = 2.0  # standard deviations


def read_walls(file: str, columns: Mapped = None) -> tuple[FloatArray, FloatArray, FloatArray, tuple[str, ...]]:
    """Points (n, 3) m, unit normals (n, 3), deviations (n,) m, nan where the points have them; notes.

    Raises `InputError` with file and line.
    """
    table = mapped_table(file, "measured walls", COLUMNS, columns)
    check_needed(table, (*POINT, *NORMAL), LAYOUT)
    if not table.rows:
        raise MeasurementError("no measured point", expected=LAYOUT, file=table.file)
    values = number_columns(table, COLUMNS.numbers)
    normal, length = values[:, 3:6], np.linalg.norm(values[:, 3:6], axis=1, keepdims=True)
    if not length.all():
        line = table.rows[int(np.argmin(length))][0]
        raise MeasurementError("a normal of no length", expected="nx, ny, nz out of the part", file=file, line=line)
    return m_from_mm(values[:, :3]), normal / length, m_from_um(values[:, 6]), table.notes


@dataclass(frozen=True, eq=False, repr=False)
class WallComparison(FolderResult):
    """Measured points of walls compared with the errors predicted for a cut; SI, n points on a final wall.

    Attributes
    ----------
    line, side
        (n,) line of the program that makes the wall; 0 left, 1 right of its feed.
    height
        (n,) m above the lower end of the wall.
    measured, predicted, deviation
        (n,) m, + material left: measured, predicted at the point's height, the model's standard deviation there.
    others
        Points that lie on no final wall of the program.
    notes
        On how the file was read, and what the cut assumes.
    inputs
        Files that were read.
    """

    command: ClassVar[str] = "compare"
    shown_by: ClassVar[str] = "walls"

    line: IntArray
    side: IntArray
    height: FloatArray
    measured: FloatArray
    predicted: FloatArray
    deviation: FloatArray
    others: int
    notes: tuple[str, ...]
    inputs: tuple[str, ...] = ()

    @property
    def factor(self) -> tuple[float, float]:
        """Ratio of measured to predicted errors by least squares, and its standard deviation from their scatter."""
        square = float((self.predicted**2).sum())
        if not square:
            return float("nan"), float("nan")
        factor = float((self.measured * self.predicted).sum()) / square
        rest = self.measured - factor * self.predicted
        return factor, float(np.sqrt((rest**2).sum() / max(len(rest) - 1, 1) / square))

    @property
    def lines(self) -> list[dict[str, Any]]:
        """For each line and side: points, measured and predicted error, residual, its uncertainty, verdict."""
        keys, which = np.unique(np.stack([self.line, self.side]), axis=1, return_inverse=True)
        count = np.bincount(which)
        residuals = um_from_m(self.measured - self.predicted)
        values = {"measured": um_from_m(self.measured), "predicted": um_from_m(self.predicted), "residual": residuals}
        means = {name: np.bincount(which, column) / count for name, column in values.items()}
        squares = np.bincount(which, (residuals - means["residual"][which]) ** 2)
        pooled = squares.sum() / max(len(residuals) - len(count), 1)  # a line of few points takes the others' scatter
        scatter = np.maximum(squares / np.maximum(count - 1, 1), pooled) / count
        sure = SURE * np.sqrt(scatter + (np.bincount(which, um_from_m(self.deviation)) / count) ** 2)
        fails = np.abs(means["residual"]) > sure
        columns = {"line": keys[0], "side": np.array(["left", "right"])[keys[1]], "points": count}
        columns |= {f"{name}_um": column for name, column in means.items()} | {"sure_um": sure, "fails": fails}
        return records(columns)

    def to_dict(self) -> dict[str, Any]:
        """Content of compare.json."""
        factor, spread = self.factor
        sizes = {"measured": self.measured, "residual": self.measured - self.predicted}
        means = {f"mean_{name}_um": float(um_from_m(np.abs(values).mean())) for name, values in sizes.items()}
        document = {"points": len(self.line), "on_no_final_wall": self.others, **means, "factor": factor}
        further = {"factor_sd": spread, "lines": self.lines, "notes": list(self.notes)}
        return dict(certain(without_nan(document | further)))

    def to_frame(self) -> DataFrame:
        """One row per point: line, side, height on the wall (mm), measured and predicted error, its deviation (um)."""
        columns = {f"{name}_um": um_from_m(getattr(self, name)) for name in ("measured", "predicted", "deviation")}
        place = {"line": self.line, "side": np.array(["left", "right"])[self.side], "height_mm": mm_from_m(self.height)}
        return frame_of({**place, **columns})

    def _short(self) -> str:
        return f"{len(self.line)} points, measured {self.factor[0]:.2f} times the predicted"


def compare_walls(
    cut: Cut, moves: Moves, points: FloatArray, normal: FloatArray, deviation: FloatArray, notes: tuple[str, ...] = ()
) -> WallComparison:
    """Compare points (n, 3) m, normals (n, 3), deviations (n,) m (nan: taken from the points) with the walls of a cut.

    `moves` are the program's, in whose coordinates the points are. Raises `MeasurementError` where none lies on a wall.
    """
    upright = (cut.samples.abc[:, :2] == 0.0).all(axis=1)
    station, side = np.nonzero(np.isfinite(cut.wall_mean) & upright[:, None])
    aslant = np.isfinite(cut.wall_mean).any(axis=1) & ~upright
    notes = (*notes, *cut.lines_warning(aslant, "not compared: the tool is tilted"))
    samples, radius = cut.samples.take(station), of_tools(cut.cutters, cut.samples.tool[station], "radius")
    surface, into = walls_beside(cut.samples, cut.cutters, station, side)
    height = samples.position[:, 2, None] + cut.wall_heights[station, side] + np.array([-FARTHEST, FARTHEST])
    nearest = np.full(len(points), -1)
    for i, (point, towards) in enumerate(zip(points, normal, strict=True)):
        beside = (into @ towards < -ALONG) & (height[:, 0] <= point[2]) & (point[2] <= height[:, 1])
        if beside.any():
            away = np.where(beside, np.linalg.norm(surface[:, :2] - point[:2], axis=1), np.inf)
            nearest[i] = int(np.argmin(away))
    row = samples.move[nearest]
    first = np.searchsorted(cut.samples.move, row)
    last = np.searchsorted(cut.samples.move, row, side="right") - 1
    length = cut.samples.s[last] - cut.samples.s[first]
    _, aside = places_beside(moves, row, points, (samples.s[nearest] - cut.samples.s[first]) / length)
    off = radius[nearest] - (1.0 - 2.0 * side[nearest]) * aside
    on = (nearest >= 0) & (np.abs(off) <= FARTHEST)
    if not on.any():
        hint = "points are in program coordinates, mm, their normals point out of the part"
        raise MeasurementError("no measured point lies on a final wall of the program", hint=hint)
    rows, sides = station[nearest[on]], side[nearest[on]]
    ends, mean = cut.wall_heights[rows, sides], cut.wall_mean[rows, sides]
    height = np.clip(points[on, 2] - cut.samples.position[rows, 2], ends[:, 0], ends[:, 1])
    predicted = profile_at(cut.wall_profiles[rows, sides], ends, height[:, None])[:, 0]
    known = np.abs(mean) > 0.0  # an error of the coefficients scales the errors at all heights alike
    scaled = np.divide(np.abs(predicted), np.abs(mean), out=np.ones(len(mean)), where=known)
    return WallComparison(
        line=cut.samples.line[rows],
        side=sides,
        height=height - ends[:, 0],
        measured=np.where(np.isnan(deviation), off, deviation)[on],
        predicted=predicted,
        deviation=cut.deviation[rows, sides] * scaled,
        others=int((~on).sum()),
        notes=notes,
    )
