"""Stiffness on a grid: planes of the workspace under one load, as the paper's Figures 8 and 9."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.evaluation import Progress, evaluate
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError, UnreachableError
from toolpath_stiff.results import DataFrame, FolderResult, frame_of
from toolpath_stiff.stiffness.model import StiffnessModel, condition_warnings, effects_stated
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

MOST_POINTS = 5_000_000
COLUMNS = ("x_mm", "y_mm", "z_mm", "stiffness_N_per_mm", "reachable")


@dataclass(frozen=True, repr=False, eq=False)
class StiffnessMap(FolderResult):
    """Stiffness over planes of the workspace, along one load; arrays in SI.

    Attributes
    ----------
    model
        The machine with its effects.
    x, y, z
        (nx,), (ny,), (nz,) m, coordinates of the grid.
    stiffness
        (nz, ny, nx) N/m along the load; nan where out of reach.
    reachable
        (nz, ny, nx).
    load, abc
        The load's direction; roll, pitch, yaw of the platform in rad.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.map_stiffness("nist", z_mm=(800, 1200), points=5)
    >>> [plane["z_mm"] for plane in found.to_dict()["slices"]]
    [800.0, 1200.0]
    >>> found.to_frame().columns.tolist(), len(found.to_frame())
    (['x_mm', 'y_mm', 'z_mm', 'stiffness_N_per_mm', 'reachable'], 50)
    >>> found.columns()["x_mm"].size
    50
    >>> type(found.plot()).__name__
    'Figure'
    """

    command: ClassVar[str] = "map"
    shown_by: ClassVar[str] = "map"

    model: StiffnessModel
    x: FloatArray
    y: FloatArray
    z: FloatArray
    stiffness: FloatArray
    reachable: BoolArray
    load: Load
    abc: tuple[float, float, float]
    inputs: tuple[str, ...] = ()

    def to_dict(self) -> Document:
        """Extremes of each plane: `map.json`."""
        return {
            "machine": self.model.machine.name,
            "load": str(self.load),
            "abc_deg": [deg_from_rad(v) for v in self.abc],
            "points": int(self.stiffness.size),
            "slices": [self._slice(i) for i in range(len(self.z))],
            **effects_stated(self.model),
            "warnings": condition_warnings(self.model),
        }

    def _slice(self, i: int) -> Document:
        layer, reachable = n_per_mm_from_n_per_m(self.stiffness[i]), self.reachable[i]
        row: dict[str, object] = {"z_mm": mm_from_m(float(self.z[i])), "reachable_share": float(reachable.mean())}
        for name, extreme in (("softest", np.nanargmin), ("stiffest", np.nanargmax)) if reachable.any() else ():
            j, k = divmod(int(extreme(layer)), len(self.x))
            place = {"x_mm": mm_from_m(float(self.x[k])), "y_mm": mm_from_m(float(self.y[j]))}
            row[name] = {**place, "stiffness_N_per_mm": float(layer[j, k])}
        return row

    def columns(self) -> dict[str, AnyArray]:
        """Column of `map.csv` -> values, plane by plane."""
        zs, ys, xs = np.meshgrid(mm_from_m(self.z), mm_from_m(self.y), mm_from_m(self.x), indexing="ij")
        values = (xs, ys, zs, n_per_mm_from_n_per_m(self.stiffness), self.reachable)
        return {name: column.ravel() for name, column in zip(COLUMNS, values, strict=True)}

    def to_frame(self) -> DataFrame:
        """One row per point of the grid: x_mm, y_mm, z_mm, stiffness_N_per_mm (nan out of reach), reachable."""
        return frame_of(self.columns())

    def _short(self) -> str:
        return f"{self.model.machine.name}, load {self.load}, {self.stiffness.size} points"


def map_stiffness(
    model: StiffnessModel,
    x: tuple[float, float],
    y: tuple[float, float],
    heights: list[float],
    load: Load,
    points: int = 61,
    abc: tuple[float, float, float] = (0.0, 0.0, 0.0),
    force: float = defaults.FORCE,
    progress: Progress | None = None,
) -> StiffnessMap:
    """Evaluate a grid of poses.

    Parameters
    ----------
    model
        Machine and effects.
    x, y
        (low, high) m.
    heights
        z of the slices, m.
    load
        Any direction but tangential and normal, which need a path.
    points
        Grid points along the longer side; the other side has the same spacing or finer.
    abc
        Orientation of the platform, rad.

    Raises
    ------
    InputError
        The load needs a path, an area has no extent, or there are too many points.
    UnreachableError
        Nothing of the grid can be reached.

    Examples
    --------
    >>> from toolpath_stiff.analysis.loads import parse_load
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.stiffness.model import build_model
    >>> found = map_stiffness(build_model(load_machine("nist")), (-0.1, 0), (-0.1, 0), [0.8], parse_load("x"), points=3)
    >>> found.stiffness.shape, round(float(found.stiffness[0, 2, 2]) / 1e3)  # N/mm in the middle
    ((1, 3, 3), 54823)
    """
    if load.kind in ("tangential", "normal"):
        expected = "radial, axial, softest, x, y, z or DX,DY,DZ"
        raise InputError(f"load {load} needs a path, and a map has none", expected=expected)
    if not (x[0] < x[1] and y[0] < y[1]):
        raise InputError("the area of the map has no extent", expected="LO:HI with LO below HI in x and in y")
    spacing = max(x[1] - x[0], y[1] - y[0]) / (points - 1)
    nx, ny = (int(np.ceil((hi - lo) / spacing - 1e-9)) + 1 for lo, hi in (x, y))
    if nx * ny * len(heights) > MOST_POINTS:
        raise InputError(f"{nx * ny * len(heights)} grid points", expected=f"at most {MOST_POINTS}")
    xs, ys, zs = np.linspace(*x, nx), np.linspace(*y, ny), np.array(heights)
    grid = np.stack(np.meshgrid(zs, ys, xs, indexing="ij")[::-1], axis=-1).reshape(-1, 3)
    turned = np.broadcast_to(np.array(abc), grid.shape)
    evaluation = evaluate(model, grid, turned, np.zeros_like(grid), load=load, force=force, progress=progress)
    if not evaluation.reachable.any():
        nearest = int(np.argmax(evaluation.reach.margin))
        near = evaluation.reach.describe(nearest)
        raise UnreachableError(f"nothing of the map is within reach; the nearest point: {near}")
    shape = (len(zs), ny, nx)
    return StiffnessMap(
        model, xs, ys, zs, evaluation.stiffness.reshape(shape), evaluation.reachable.reshape(shape), load, abc
    )
