"""Stiffness, strut lengths and reach at poses of a machine, block by block."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.loads import Load, load_directions
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import Limit, Reach, machine_limits, reach
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.effects.contract import DEFAULT_FORCE
from toolpath_stiff.stiffness.model import StiffnessModel

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

BLOCK = 16_384  # poses at a time: the work arrays stay in the processor's cache
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class PoseStiffness:
    """What the machine does at n poses. SI.

    Attributes
    ----------
    stiffness
        (n,) N/m along the load, displacement measured along it; nan where the pose is out of reach.
    direction
        (n, 3) unit vectors of the load.
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
    direction: FloatArray
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
    force: float = DEFAULT_FORCE,
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
    """
    n = len(position)
    load = load or Load()
    lengths = np.broadcast_to(np.asarray(tool_length, dtype=float), (n,))
    route = core.choose_route(model, n)  # by all poses, not by those of a block
    result = PoseStiffness(
        stiffness=np.empty(n),
        direction=np.empty((n, 3)),
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
        _evaluate_block(model, rows, position, abc, tangent, lengths, load, force, route, result)
        if progress:
            progress(rows.stop, n)
    return result


def _evaluate_block(
    model: StiffnessModel,
    rows: slice,
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
    softest = partial(_softest, model, tip, rotation, tool, force, within) if model.load_dependent else None
    direction, substituted = load_directions(load, compliance, tip, rotation, tangent[rows], softest)
    along = np.full(len(tip), np.nan)
    if model.load_dependent:
        along[within] = core.compliance_along(model, direction[within], tip[within], turned, tool[within], force)
    else:
        along = np.einsum("ni,nij,nj->n", direction, compliance, direction)
    result.stiffness[rows] = 1.0 / along
    result.direction[rows] = direction
    result.substituted[rows] = substituted
    result.strut_lengths[rows] = struts.lengths
    result.extrapolated[rows] = machine.strut_law.extrapolates(struts.lengths).any(axis=1)
    result.margin[rows] = stand.margin
    result.limit[rows] = stand.limit
    result.limit_value[rows] = stand.value


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
