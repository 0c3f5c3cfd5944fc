"""Stiffness over planes of the workspace, as the paper's Figures 8 and 9: a grid of poses under one load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.evaluate import Progress, evaluate
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.errors import InputError, UnreachableError
from toolpath_stiff.stiffness.effects.contract import DEFAULT_FORCE
from toolpath_stiff.stiffness.model import StiffnessModel

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MOST_POINTS = 5_000_000


@dataclass(frozen=True)
class StiffnessMap:
    """Stiffness on a grid. SI.

    Attributes
    ----------
    x, y, z
        (nx,), (ny,), (nz,) m, coordinates of the grid.
    stiffness
        (nz, ny, nx) N/m along the load; nan where out of reach.
    reachable
        (nz, ny, nx).
    load, abc
        The load's direction; roll, pitch, yaw of the platform in rad.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    stiffness: FloatArray
    reachable: BoolArray
    load: Load
    abc: tuple[float, float, float]


def map_stiffness(
    model: StiffnessModel,
    x: tuple[float, float],
    y: tuple[float, float],
    heights: list[float],
    load: Load,
    points: int = 61,
    abc: tuple[float, float, float] = (0.0, 0.0, 0.0),
    force: float = DEFAULT_FORCE,
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
    """
    if load.kind in ("tangential", "normal"):
        raise InputError(
            f"load {load} needs a path, and a map has none", expected="radial, axial, softest, x, y, z or DX,DY,DZ"
        )
    if not (x[0] < x[1] and y[0] < y[1]):
        raise InputError("the area of the map has no extent", expected="LO:HI with LO below HI in x and in y")
    spacing = max(x[1] - x[0], y[1] - y[0]) / (points - 1)
    nx, ny = (int(np.ceil((hi - lo) / spacing - 1e-9)) + 1 for lo, hi in (x, y))
    if nx * ny * len(heights) > MOST_POINTS:
        raise InputError(f"{nx * ny * len(heights)} grid points", expected=f"at most {MOST_POINTS}")
    xs, ys, zs = np.linspace(*x, nx), np.linspace(*y, ny), np.array(heights)
    grid = np.stack(np.meshgrid(zs, ys, xs, indexing="ij")[::-1], axis=-1).reshape(-1, 3)
    turned = np.broadcast_to(np.array(abc), grid.shape)
    found = evaluate(model, grid, turned, np.zeros_like(grid), load=load, force=force, progress=progress)
    if not found.reachable.any():
        nearest = int(np.argmax(found.margin))
        raise UnreachableError(
            f"nothing of the map is within reach; the nearest point: {found.reach.describe(nearest)}"
        )
    shape = (len(zs), ny, nx)
    return StiffnessMap(xs, ys, zs, found.stiffness.reshape(shape), found.reachable.reshape(shape), load, abc)


def around_axis(model: StiffnessModel, radius: float, height: float, load: Load, angles: FloatArray) -> FloatArray:
    """Stiffness N/m on a circle about the machine axis at angles (n,) rad; nan where out of reach."""
    position = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(len(angles), height)])
    zeros = np.zeros_like(position)
    return evaluate(model, position, zeros, zeros, load=load).stiffness


def turning_points(model: StiffnessModel, radius: float, height: float, load: Load) -> dict[str, list[float]]:
    """Angles in rad of the maxima and minima on a circle about the machine axis, to a hundredth of a degree.

    Where the whole circle varies by less than a millionth there are none.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, 36000, endpoint=False)
    values = around_axis(model, radius, height, load, angles)
    if np.isnan(values).any() or np.ptp(values) < 1e-6 * values.mean():
        return {"maxima": [], "minima": []}
    before, after = np.roll(values, 1), np.roll(values, -1)
    return {
        "maxima": [float(a) for a in angles[(values > before) & (values >= after)]],
        "minima": [float(a) for a in angles[(values < before) & (values <= after)]],
    }
