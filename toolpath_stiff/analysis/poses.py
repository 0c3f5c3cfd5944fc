"""Stiffness, strut lengths and reach at poses of a machine: of a path, single ones, on a grid.

A grid is that of planes of the workspace under one load, as the paper's Figures 8 and 9.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.loads import (
    Load,
    geometric_directions,
    load_directions,
    softest_directions,
    stiffest_directions,
)
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.errors import InputError, PoseError, UnreachableError
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import Limit, Reach, gauge_of, machine_limits, reach
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import mm_from_m

BLOCK = 16_384  # poses at a time: the work arrays stay in the processor's cache
MOST_NEW = 0.8  # share of rows; where fewer are poses of their own, each pose is evaluated once
Progress = Callable[[int, int], None]

MOST_POINTS = 5_000_000


@dataclass(frozen=True)
class PoseStiffness:
    """What the machine does at n poses. SI.

    Attributes
    ----------
    stiffness
        (n,) N/m along the load, displacement measured along it; nan where the pose is out of reach.
    substituted
        (n,) the asked load direction does not exist there, the softest one stands in.
    strut_lengths
        (n, 6) m.
    extrapolated
        (n,) a strut is longer or shorter than the strut law was given for.
    margin, limit, limit_value
        (n,) as in `Reach`.
    limits
        The machine's limits.
    """

    stiffness: FloatArray
    substituted: BoolArray
    strut_lengths: FloatArray
    extrapolated: BoolArray
    margin: FloatArray
    limit: IntArray
    limit_value: FloatArray
    limits: tuple[Limit, ...]

    @property
    def reachable(self) -> BoolArray:
        """(n,) whether every limit is kept."""
        return np.asarray(self.margin >= 0.0)

    @property
    def reach(self) -> Reach:
        """The limits' side of it, for `Reach.describe`."""
        return Reach(self.margin, self.limit, self.limit_value, self.limits)


def evaluate(
    model: StiffnessModel,
    position: FloatArray,
    abc: FloatArray,
    tangent: FloatArray,
    tool_length: FloatArray | float = np.nan,
    load: Load | None = None,
    force: float = defaults.FORCE,
    progress: Progress | None = None,
) -> PoseStiffness:
    """Evaluate n poses.

    Parameters
    ----------
    model
        Machine and effects.
    position, abc
        (n, 3) m and (n, 3) rad: tool tip; roll, pitch, yaw.
    tangent
        (n, 3) unit vectors of the motion (0 where there is none); only some loads ask for it.
    tool_length
        m, scalar or (n,); nan: the reference tool.
    load
        Direction of the load, tangential unless given.
    force
        N; only load-dependent effects ask for it.
    progress
        Called with (poses done, poses in all).

    Examples
    --------
    >>> from toolpath_stiff.analysis.loads import parse_load
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.stiffness.model import build_model
    >>> position, zeros = np.array([[0.0, 0.0, 0.8], [0.2, 0.0, 0.8]]), np.zeros((2, 3))
    >>> found = evaluate(build_model(load_machine("nist")), position, zeros, zeros, load=parse_load("x"))
    >>> (found.stiffness / 1e3).round()  # N/mm
    array([54823., 49735.])
    """
    n = len(position)
    load = load or Load()
    lengths = np.broadcast_to(np.asarray(tool_length, dtype=float), (n,))
    new = _new_poses(position, abc, lengths)
    route = core.choose_route(model, int(np.count_nonzero(new)))  # by all poses, not by those of a block
    result = PoseStiffness(
        stiffness=np.empty(n),
        substituted=np.zeros(n, dtype=bool),
        strut_lengths=np.empty((n, 6)),
        extrapolated=np.zeros(n, dtype=bool),
        margin=np.empty(n),
        limit=np.zeros(n, dtype=np.int64),
        limit_value=np.empty(n),
        limits=machine_limits(model.machine),
    )
    for start in range(0, n, BLOCK):
        rows = slice(start, min(start + BLOCK, n))
        left: slice | IntArray = rows
        if route != "exact" and load.kind != "softest":
            left = _evaluate_fast(model.machine, rows, new, position, abc, tangent, lengths, load, route, result)
        if isinstance(left, slice) or len(left):
            _evaluate_rows(model, left, position, abc, tangent, lengths, load, force, route, result)
        if progress:
            progress(rows.stop, n)
    return result


def _new_poses(position: FloatArray, abc: FloatArray, tool_length: FloatArray) -> BoolArray:
    """(n,) whether a row is another pose than the one before it, of more than two alike every other one.

    At a corner of a path the end of one move and the start of the next are one pose under two loads. True throughout
    where few rows are such.
    """
    new = np.zeros(len(position), dtype=bool)
    new[:1] = True
    tools = () if isinstance(_one_if_equal(tool_length), float) else (tool_length,)
    for values in (*position.T, *abc.T, *tools):
        new[1:] |= values[1:] != values[:-1]
    if np.count_nonzero(new) > MOST_NEW * len(new):
        return np.ones_like(new)
    third = ~(new[1:] | new[:-1])
    if third.any():
        row = np.arange(len(new))
        new |= (row - np.maximum.accumulate(np.where(new, row, 0))) % 2 == 0
    return new


def _evaluate_fast(
    machine: Machine,
    rows: slice,
    new: BoolArray,
    position: FloatArray,
    abc: FloatArray,
    tangent: FloatArray,
    tool_length: FloatArray,
    load: Load,
    route: str,
    result: PoseStiffness,
) -> IntArray:
    """Poses of struts on a rigid platform along loads that the geometry directs: margins and stiffness at once.

    `new` (n,) as of `_new_poses`. Returns the rows that are left: other directions, poses near singular ones, and where
    an angle near zero decides.
    """
    left: list[Any] = []
    samples = _rows_of_poses(rows, new[rows])
    poses = samples[0]
    rotation = rotation_matrices(abc[poses]) if np.any(abc[rows] != 0.0) else None
    directed = [geometric_directions(load, position[some], rotation, tangent[some]) for some in samples]
    turns = None if rotation is None else np.ascontiguousarray(rotation.reshape(-1, 9).T)
    tip, towards = np.ascontiguousarray(position[poses].T), np.stack([direction.T for direction, _ in directed])
    for tool, some in _of_one_tool(tool_length[poses]):
        turn = None if turns is None else turns[:, some]
        there = tip[:, some]
        compliance, determinant, lengths, good = core.compliance_along_columns(
            machine, there, towards[:, :, some], turn, tool, route
        )
        stand, sure = gauge_of(machine).reach(there, lengths, determinant, turn, tool)
        extrapolated = machine.strut_law.room(lengths).min(axis=0) < 0.0
        for into, (_, known), along in zip(samples, directed, compliance, strict=True):
            at = _part(into, some)
            certain = sure & good & known[some] & (along > 0.0) & (along < np.inf)
            along[~(stand.reachable & known[some])] = np.nan
            result.stiffness[at] = 1.0 / along
            result.strut_lengths[at] = lengths.T
            result.extrapolated[at] = extrapolated
            result.margin[at], result.limit[at], result.limit_value[at] = stand.margin, stand.limit, stand.value
            if not certain.all():
                left.append(_part(at, np.flatnonzero(~certain)))  # they are looked at one by one
    return np.unique(np.concatenate(left)) if left else np.empty(0, dtype=np.int64)


def _part(rows: slice | IntArray, some: slice | IntArray) -> slice | IntArray:
    """Some of the rows; `some` counts from the first of them, and is all of them if it is a slice."""
    if isinstance(some, slice):
        return rows
    return rows.start + some if isinstance(rows, slice) else rows[some]


def _rows_of_poses(rows: slice, new: BoolArray) -> list[slice | IntArray]:
    """Rows of the first sample of each pose of a block, and of the last; `new` (n,) of its rows as of `_new_poses`."""
    if new.all():
        return [rows]
    first = np.flatnonzero(new[1:]) + 1
    first = rows.start + np.concatenate([[0], first])
    return [first, np.append(first[1:], rows.stop) - 1]


def _of_one_tool(tool_length: FloatArray) -> list[tuple[float, IntArray | slice]]:
    """Each tool length, nan counts as one, and the rows that have it."""
    one = _one_if_equal(tool_length)
    if isinstance(one, float):
        return [(one, slice(None))]
    lengths, number = np.unique(tool_length, return_inverse=True)
    return [(float(length), np.flatnonzero(number == i)) for i, length in enumerate(lengths)]


def _evaluate_rows(
    model: StiffnessModel,
    rows: slice | IntArray,
    position: FloatArray,
    abc: FloatArray,
    tangent: FloatArray,
    tool_length: FloatArray,
    load: Load,
    force: float,
    route: str,
    result: PoseStiffness,
) -> None:
    machine = model.machine
    tip, angles, tool = position[rows], abc[rows], tool_length[rows]
    rotation = rotation_matrices(angles) if np.any(angles != 0.0) else None
    struts = solve_struts(machine, tip, rotation, _one_if_equal(tool))
    stand = reach(machine, tip, struts, rotation)
    within = stand.reachable
    compliance = np.full((len(tip), 3, 3), np.nan)
    turned = None if rotation is None else rotation[within]
    compliance[within] = core.tip_compliance(model, tip[within], turned, tool[within], force, route)
    _refuse_no_number(machine, tip, within & np.isnan(compliance[:, 0, 0]))
    softest = partial(_softest, model, tip, rotation, tool, force, within) if model.load_dependent else None
    direction, substituted = load_directions(load, compliance, tip, rotation, tangent[rows], softest)
    along = np.full(len(tip), np.nan)
    if model.load_dependent:
        along[within] = core.compliance_along(model, direction[within], tip[within], turned, tool[within], force)
    else:
        along = np.einsum("ni,nij,nj->n", direction, compliance, direction)
    stiffness = 1.0 / along
    _refuse_no_number(machine, tip, within & ~((stiffness > 0.0) & (stiffness < np.inf)))
    result.stiffness[rows] = stiffness
    result.substituted[rows] = substituted
    result.strut_lengths[rows] = struts.lengths
    result.extrapolated[rows] = machine.strut_law.extrapolates(struts.lengths).any(axis=1)
    result.margin[rows] = stand.margin
    result.limit[rows] = stand.limit
    result.limit_value[rows] = stand.value


def _refuse_no_number(machine: Machine, tip: FloatArray, bad: BoolArray) -> None:
    """Raise `PoseError` where the limits let poses pass (n,) that have no stiffness."""
    if bad.any():
        x, y, z = (mm_from_m(float(v)) + 0.0 for v in tip[int(np.argmax(bad))])
        raise PoseError(
            f"machine {machine.name} is singular at X{x:g} Y{y:g} Z{z:g} mm: the tip has no stiffness there",
            hint="keep such poses out of reach: min_index of [limits.singularity] in the machine file, such as 0.05",
        )


def _softest(
    model: StiffnessModel,
    tip: FloatArray,
    rotation: FloatArray | None,
    tool: FloatArray,
    force: float,
    within: BoolArray,
    rows: BoolArray,
    across: FloatArray | None,
) -> FloatArray:
    """Softest directions under the load, of some rows; nan where these are out of reach."""
    found = np.full((int(rows.sum()), 3), np.nan)
    inside = within[rows]
    some = rows & within
    turn = None if rotation is None else rotation[some]
    normals = None if across is None else across[inside]
    found[inside] = core.extreme_directions(model, tip[some], turn, tool[some], force, across=normals)
    return found


def _one_if_equal(tool_length: FloatArray) -> FloatArray | float:
    """A single tool length where all are equal (all nan counts): the kinematics is then cheaper."""
    if len(tool_length) and (np.isnan(tool_length).all() or np.ptp(tool_length) == 0.0):
        return float(tool_length[0])
    return tool_length


@dataclass(frozen=True)
class PoseReport:
    """Stiffness at n poses. SI; nan where a pose is out of reach.

    Attributes
    ----------
    along_axes
        (n, 3) N/m along X, Y, Z of the machine.
    softest, stiffest
        (n, 3) unit vectors of the softest and the stiffest direction.
    softest_stiffness, stiffest_stiffness
        (n,) N/m along them.
    strut_lengths
        (n, 6) m.
    extrapolated
        (n,) a strut is outside the range that the strut law was given for.
    reach
        Margins and limits.
    """

    along_axes: FloatArray
    softest: FloatArray
    softest_stiffness: FloatArray
    stiffest: FloatArray
    stiffest_stiffness: FloatArray
    strut_lengths: FloatArray
    extrapolated: BoolArray
    reach: Reach


def evaluate_poses(
    model: StiffnessModel,
    position: FloatArray,
    abc: FloatArray,
    tool_length: float = np.nan,
    force: float = defaults.FORCE,
) -> PoseReport:
    """Evaluate n poses: position (n, 3) m, abc (n, 3) rad; `tool_length` in m (nan: the reference tool)."""
    rotation = rotation_matrices(abc)
    struts = solve_struts(model.machine, position, rotation, tool_length)
    stand = reach(model.machine, position, struts, rotation)
    n, within = len(position), stand.reachable
    tip, turn = position[within], rotation[within]
    compliance = core.tip_compliance(model, tip, turn, tool_length, force)
    _refuse_no_number(model.machine, tip, np.isnan(compliance[:, 0, 0]))

    def along(direction: FloatArray) -> FloatArray:
        if model.load_dependent:
            return core.compliance_along(model, direction, tip, turn, tool_length, force)
        return np.asarray(np.einsum("ni,nij,nj->n", direction, compliance, direction))

    if model.load_dependent:
        soft, stiff = (core.extreme_directions(model, tip, turn, tool_length, force, which) for which in (True, False))
    else:
        soft, stiff = softest_directions(compliance), stiffest_directions(compliance)
    axes = np.stack([along(np.broadcast_to(axis, (len(tip), 3))) for axis in np.eye(3)], axis=1)
    everything = {
        "axes": 1.0 / axes,
        "soft": soft,
        "stiff": stiff,
        "k_soft": 1.0 / along(soft),
        "k_stiff": 1.0 / along(stiff),
    }

    def spread(name: str) -> FloatArray:
        values = everything[name]
        full = np.full((n, *values.shape[1:]), np.nan)
        full[within] = values
        return full

    return PoseReport(
        along_axes=spread("axes"),
        softest=spread("soft"),
        softest_stiffness=spread("k_soft"),
        stiffest=spread("stiff"),
        stiffest_stiffness=spread("k_stiff"),
        strut_lengths=struts.lengths,
        extrapolated=np.asarray(model.machine.strut_law.extrapolates(struts.lengths).any(axis=1)),
        reach=stand,
    )


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
    _check_map(x, y, load)
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


def _check_map(x: tuple[float, float], y: tuple[float, float], load: Load) -> None:
    if load.kind in ("tangential", "normal"):
        raise InputError(
            f"load {load} needs a path, and a map has none", expected="radial, axial, softest, x, y, z or DX,DY,DZ"
        )
    if not (x[0] < x[1] and y[0] < y[1]):
        raise InputError("the area of the map has no extent", expected="LO:HI with LO below HI in x and in y")


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


RAY_STEP, RAY_END, RAY_EXACT = 0.05, 5.0, 1e-4  # m: marching out, at most so far, and how exact the end is


def reach_along(machine: Machine, start: FloatArray, directions: FloatArray, turn: FloatArray) -> FloatArray:
    """(n,) m that the tool tip can go from a place (3,) along unit vectors (n, 3) before the first limit.

    `turn` (3, 3) is the orientation, which is kept. 0 where the place itself is out of reach.
    """

    def inside(lengths: FloatArray) -> BoolArray:
        tips = start + lengths[:, None] * directions
        turns = np.broadcast_to(turn, (len(tips), 3, 3))
        return np.asarray(reach(machine, tips, solve_struts(machine, tips, turns), turns).reachable)

    steps = np.arange(0.0, RAY_END, RAY_STEP)
    good = np.stack([inside(np.full(len(directions), step)) for step in steps], axis=1)
    first = np.where(good.all(axis=1), len(steps), np.argmin(good, axis=1))
    low, high = np.maximum(first - 1, 0) * RAY_STEP, first * RAY_STEP
    for _ in range(int(np.ceil(np.log2(RAY_STEP / RAY_EXACT)))):
        middle = 0.5 * (low + high)
        within = inside(middle)
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return np.where(first > 0, low, 0.0)
