"""Stiffness at single poses: along X, Y, Z, in the softest and the stiffest direction, with strut lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.loads import softest_directions, stiffest_directions
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import Reach, reach
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.effects.contract import DEFAULT_FORCE
from toolpath_stiff.stiffness.model import StiffnessModel

FloatArray = NDArray[np.float64]


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
    extrapolated: NDArray[np.bool_]
    reach: Reach


def evaluate_poses(
    model: StiffnessModel,
    position: FloatArray,
    abc: FloatArray,
    tool_length: float = np.nan,
    force: float = DEFAULT_FORCE,
) -> PoseReport:
    """Evaluate n poses: position (n, 3) m, abc (n, 3) rad; `tool_length` in m (nan: the reference tool)."""
    rotation = rotation_matrices(abc)
    struts = solve_struts(model.machine, position, rotation, tool_length)
    stand = reach(model.machine, position, struts, rotation)
    n, within = len(position), stand.reachable
    tip, turn = position[within], rotation[within]
    compliance = core.tip_compliance(model, tip, turn, tool_length, force)

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
