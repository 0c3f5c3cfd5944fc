"""Inverse kinematics of a six-strut platform, batched: the paper's equations 6 to 11.

Base P_i = R P_i + q (eqs. 6, 8, 9), S_i = P_i - B_i (eq. 10), L_i = |S_i| (eq. 11), with q the tool tip: the
programmed position is the tip, and the platform joints are given relative to it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from toolpath_stiff.machine.model import Machine
from toolpath_stiff.rotations import rotation_matrices

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Struts:
    """The struts at n poses.

    Attributes
    ----------
    lengths
        (n, 6) m.
    directions
        (n, 6, 3) unit vectors u_i from frame joint to platform joint, base axes.
    arms
        (n, 6, 3) m, r_i from tool tip to platform joint, base axes.
    """

    lengths: FloatArray
    directions: FloatArray
    arms: FloatArray

    @property
    def jacobian(self) -> FloatArray:
        """(n, 6, 6) rows [u_i, r_i x u_i]: strut elongation rates per twist of the tip."""
        return np.concatenate([self.directions, np.cross(self.arms, self.directions)], axis=-1)


def solve_struts(
    machine: Machine,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    tool_length: ArrayLike = np.nan,
) -> Struts:
    """Lengths, directions and arms of the six struts.

    Parameters
    ----------
    machine
        The machine.
    position
        (n, 3) or (3,) m, tool tip in the base frame.
    rotation
        (n, 3, 3) or (3, 3) orientation of the platform; None: vertical spindle, no yaw.
    tool_length
        m, scalar or (n,); nan: the machine's reference tool.

    Returns
    -------
    Struts of n poses (n = 1 for a single position).
    """
    tip = np.atleast_2d(np.asarray(position, dtype=float))
    joints = platform_joints(machine, tool_length)
    if rotation is None:
        arms = np.broadcast_to(joints, (len(tip), 6, 3))
    else:
        arms = np.asarray(joints @ np.swapaxes(np.asarray(rotation, dtype=float), -1, -2))
        arms = np.broadcast_to(arms, (len(tip), 6, 3))
    struts = tip[:, None, :] + arms - machine.frame_joints
    lengths = np.sqrt(np.einsum("nij,nij->ni", struts, struts))
    return Struts(lengths=lengths, directions=struts / lengths[..., None], arms=arms)


def platform_joints(machine: Machine, tool_length: ArrayLike = np.nan) -> FloatArray:
    """(6, 3), or (n, 6, 3) for n tool lengths: platform joints relative to the tip, platform frame, m."""
    length = np.asarray(tool_length, dtype=float)
    if length.ndim == 0:
        return machine.platform_joints_for(float(length))
    extension = np.where(np.isnan(length), 0.0, length - machine.reference_tool_length)
    shift = np.zeros((len(length), 1, 3))
    shift[:, 0, 2] = extension
    return machine.platform_joints + shift


def solve_struts_at(machine: Machine, pose: ArrayLike) -> Struts:
    """Struts at poses (n, 6) or (6,): x, y, z in m, roll, pitch, yaw in rad."""
    values = np.atleast_2d(np.asarray(pose, dtype=float))
    return solve_struts(machine, values[:, :3], rotation_matrices(values[:, 3:]))


def neutral_axes(machine: Machine) -> tuple[FloatArray, FloatArray]:
    """Neutral axes of the frame joints (base axes) and of the platform joints (platform axes), (6, 3) each.

    They lie along the struts at the machine's neutral pose.
    """
    neutral = machine.limits.neutral_pose
    directions = solve_struts_at(machine, neutral).directions[0]
    return directions, directions @ rotation_matrices(neutral[3:])


def joint_angles(machine: Machine, struts: Struts, rotation: ArrayLike | None = None) -> tuple[FloatArray, FloatArray]:
    """Swing of the frame joints and of the platform joints from their neutral axes.

    Returns
    -------
    frame, platform
        (n, 6) rad each.
    """
    frame_axes, platform_axes = neutral_axes(machine)
    frame = _angle(struts.directions, frame_axes)
    if rotation is None:
        return frame, _angle(struts.directions, platform_axes)
    turned = platform_axes @ np.swapaxes(np.asarray(rotation, dtype=float), -1, -2)
    return frame, _angle(struts.directions, turned)


def _angle(first: FloatArray, second: FloatArray) -> FloatArray:
    """Angle between unit vectors (..., 3), exact near 0 where arccos is not (Kahan's formula)."""
    apart = np.linalg.norm(first - second, axis=-1)
    together = np.linalg.norm(first + second, axis=-1)
    return np.asarray(2.0 * np.arctan2(apart, together))


def singularity_index(machine: Machine, struts: Struts) -> FloatArray:
    """|det J| relative to its value at the neutral pose, (n,): 1 there, 0 where the machine is singular.

    The determinant of the six strut screws does not depend on the point that moments are taken about, so
    neither tool length nor the choice of units enters the ratio.
    """
    neutral = solve_struts_at(machine, machine.limits.neutral_pose)
    return np.asarray(np.abs(np.linalg.det(struts.jacobian)) / np.abs(np.linalg.det(neutral.jacobian[0])))
