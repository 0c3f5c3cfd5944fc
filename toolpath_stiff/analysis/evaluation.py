"""Stiffness along a load, strut lengths and reach at many poses, block by block, fast where that is safe."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.loads import Load, geometric_directions, load_directions
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import Extremes, Reach, machine_limits, reach
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import mm_from_m

BLOCK = 16_384  # poses at a time: the work arrays stay in the processor's cache
MOST_NEW = 0.8  # share of rows; where fewer are poses of their own, each pose is evaluated once
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Evaluation:
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
    reach
        Margins and limits.
    """

    stiffness: FloatArray
    substituted: BoolArray
    strut_lengths: FloatArray
    extrapolated: BoolArray
    reach: Reach

    @property
    def reachable(self) -> BoolArray:
        """(n,) whether every limit is kept."""
        return self.reach.reachable

    def put(
        self,
        rows: slice | IntArray,
        stiffness: FloatArray,
        strut_lengths: FloatArray,
        extrapolated: BoolArray,
        stand: Reach,
    ) -> None:
        """Enter the figures of some rows."""
        self.stiffness[rows], self.strut_lengths[rows], self.extrapolated[rows] = stiffness, strut_lengths, extrapolated
        for name in ("margin", "limit", "value"):
            getattr(self.reach, name)[rows] = getattr(stand, name)


def evaluate(
    model: StiffnessModel,
    position: FloatArray,
    abc: FloatArray,
    tangent: FloatArray,
    tool_length: FloatArray | float = np.nan,
    load: Load | None = None,
    force: float = defaults.FORCE,
    progress: Progress | None = None,
) -> Evaluation:
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
    lengths = np.broadcast_to(np.asarray(tool_length, dtype=float), (n,))
    new = _new_poses(position, abc, lengths)
    route = core.choose_route(model, int(np.count_nonzero(new)))  # by all poses, not by those of a block
    result = Evaluation(
        stiffness=np.empty(n),
        substituted=np.zeros(n, dtype=bool),
        strut_lengths=np.empty((n, 6)),
        extrapolated=np.zeros(n, dtype=bool),
        reach=Reach(np.empty(n), np.zeros(n, dtype=np.int64), np.empty(n), machine_limits(model.machine)),
    )
    task = _Task(model, position, abc, tangent, lengths, load or Load(), force, route, result)
    for start in range(0, n, BLOCK):
        rows = slice(start, min(start + BLOCK, n))
        left: slice | IntArray = rows
        if route != "exact" and task.load.kind != "softest":
            left = _evaluate_fast(task, rows, new)
        if isinstance(left, slice) or len(left):
            _evaluate_rows(task, left)
        if progress:
            progress(rows.stop, n)
    return result


@dataclass(frozen=True)
class _Task:
    """Poses as of `evaluate`, how they are evaluated, and where the figures go."""

    model: StiffnessModel
    position: FloatArray
    abc: FloatArray
    tangent: FloatArray
    tool_length: FloatArray
    load: Load
    force: float
    route: str
    result: Evaluation


def _new_poses(position: FloatArray, abc: FloatArray, tool_length: FloatArray) -> BoolArray:
    """(n,) True for another pose than the one before it, of more than two alike every other one.

    At a corner of a path the end of one move and the start of the next are one pose under two loads. True throughout
    where few rows are such.
    """
    new = other_poses(position, abc, tool_length)
    if np.count_nonzero(new) > MOST_NEW * len(new):
        return np.ones_like(new)
    third = ~(new[1:] | new[:-1])
    if third.any():
        row = np.arange(len(new))
        new |= (row - np.maximum.accumulate(np.where(new, row, 0))) % 2 == 0
    return new


def other_poses(position: FloatArray, abc: FloatArray, tool_length: FloatArray) -> BoolArray:
    """(n,) True for another pose than the one before it: a move begins where the last one has ended."""
    other = np.zeros(len(position), dtype=bool)
    other[:1] = True
    for values in (*position.T, *abc.T, np.nan_to_num(tool_length, nan=-1.0)):
        other[1:] |= values[1:] != values[:-1]
    return other


def _evaluate_fast(task: _Task, rows: slice, new: BoolArray) -> IntArray:
    """Poses of struts on a rigid platform along loads that the geometry directs: margins and stiffness at once.

    `new` (n,) as of `_new_poses`. Returns the rows that are left: other directions, poses near singular ones, and where
    an angle near zero decides.
    """
    machine, result, abc = task.model.machine, task.result, task.abc
    left: list[Any] = []
    samples = _rows_of_poses(rows, new[rows])
    poses = samples[0]
    rotation = rotation_matrices(abc[poses]) if np.any(abc[rows] != 0.0) else None
    directed = [geometric_directions(task.load, task.position[some], rotation, task.tangent[some]) for some in samples]
    turns = None if rotation is None else np.ascontiguousarray(rotation.reshape(-1, 9).T)
    tip, towards = np.ascontiguousarray(task.position[poses].T), np.stack([direction.T for direction, _ in directed])
    for tool, some in core.rows_of_tools(task.tool_length[poses]):
        turn = None if turns is None else turns[:, some]
        there = tip[:, some]
        compliance, determinant, lengths, good = core.compliance_along_columns(
            machine, there, towards[:, :, some], turn, tool, task.route
        )
        stand, sure = Extremes(machine, there, lengths, determinant, turn, tool).reach()
        extrapolated = machine.strut_law.room(lengths).min(axis=0) < 0.0
        for into, (_, known), along in zip(samples, directed, compliance, strict=True):
            into_rows = _part(into, some)
            certain = sure & good & known[some] & (along > 0.0) & (along < np.inf)
            along[~(stand.reachable & known[some])] = np.nan
            result.put(into_rows, 1.0 / along, lengths.T, extrapolated, stand)
            if not certain.all():
                left.append(_part(into_rows, np.flatnonzero(~certain)))  # they are looked at one by one
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


def _evaluate_rows(task: _Task, rows: slice | IntArray) -> None:
    """Any poses under any load, one by one where effects ask for it."""
    model, machine, force = task.model, task.model.machine, task.force
    tip, angles, tool = task.position[rows], task.abc[rows], task.tool_length[rows]
    rotation = rotation_matrices(angles) if np.any(angles != 0.0) else None
    struts = solve_struts(machine, tip, rotation, tool)
    stand = reach(machine, tip, struts, rotation)
    within = stand.reachable
    compliance = np.full((len(tip), 3, 3), np.nan)
    turned = None if rotation is None else rotation[within]
    compliance[within] = core.tip_compliance(model, tip[within], turned, tool[within], force)
    refuse_no_number(machine, tip, within & np.isnan(compliance[:, 0, 0]))

    direction, substituted = load_directions(task.load, compliance, tip, rotation, task.tangent[rows])
    if model.load_dependent:
        there = (tip[within], turned, tool[within], force)
        along = np.full(len(tip), np.nan)
        along[within] = core.compliance_along(model, direction[within], *there)
    else:
        along = np.einsum("ni,nij,nj->n", direction, compliance, direction)
    stiffness = 1.0 / along
    refuse_no_number(machine, tip, within & ~((stiffness > 0.0) & (stiffness < np.inf)))
    task.result.substituted[rows] = substituted
    extrapolated = np.asarray(machine.strut_law.extrapolates(struts.lengths).any(axis=1))
    task.result.put(rows, stiffness, struts.lengths, extrapolated, stand)


def refuse_no_number(machine: Hexapod, tip: FloatArray, bad: BoolArray) -> None:
    """Raise `InputError` where the limits let poses pass (n,) that have no stiffness."""
    if bad.any():
        x, y, z = (mm_from_m(float(v)) + 0.0 for v in tip[int(np.argmax(bad))])
        raise InputError(
            f"machine {machine.name} is singular at X{x:g} Y{y:g} Z{z:g} mm: the tip has no stiffness there",
            hint="keep such poses out of reach: min_index of [limits.singularity] in the machine file, such as 0.05",
        )
