"""Kinematics of a six-strut platform: strut lengths of poses, and poses of strut lengths.

Inverse, batched, the paper's equations 6 to 11: P_i = R P_i + q (eqs. 6, 8, 9), S_i = P_i - B_i (eq. 10), L_i = |S_i|
(eq. 11), with q the tool tip: the programmed position is the tip, and the platform joints are given relative to it.

Forward, by Newton's method: a six-strut platform has up to 40 assembly modes (Merlet, Parallel Robots, 2006, chapter
4); Newton's method finds the one that the start lies in, normally the machine's neutral pose. Each step solves
J dx = dL, strut elongation per twist of the tip.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import ArrayColumns, FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.machine.newton import newton
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import mm_from_m

# Largest step of Newton's method, m and rad: beyond some tenths of a radian its linear model of a turn fails.
LARGEST_STEPS = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3])


@dataclass(frozen=True)
class Struts(ArrayColumns):
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
    def joints(self) -> FloatArray:
        """(n, 6) m, joint values that the control moves: the lengths."""
        return self.lengths

    @cached_property
    def jacobian(self) -> FloatArray:
        """(n, 6, 6) rows [u_i, r_i x u_i]: strut elongation rates per twist of the tip."""
        r, u = self.arms, self.directions
        rows = np.empty((*u.shape[:-1], 6))
        rows[..., :3] = u
        # For few poses `np.cross` takes several times as long; the digits are the same.
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            rows[..., 3 + i] = r[..., j] * u[..., k] - r[..., k] * u[..., j]
        return rows


def solve_struts(
    machine: Hexapod, position: ArrayLike, rotation: ArrayLike | None = None, tool_length: ArrayLike = np.nan
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

    Examples
    --------
    On the machine's axis the struts have two lengths, three struts each:

    >>> from toolpath_stiff.machine.file import load_machine
    >>> struts = solve_struts(load_machine("nist"), [0.0, 0.0, 0.8])
    >>> struts.lengths.round(4)
    array([[2.8847, 2.8699, 2.8847, 2.8699, 2.8847, 2.8699]])
    >>> struts.jacobian.shape
    (1, 6, 6)
    """
    tip = np.atleast_2d(np.asarray(position, dtype=float))
    joints = machine.platform_joints_for(tool_length)
    if rotation is not None:
        joints = np.asarray(joints @ np.swapaxes(np.asarray(rotation, dtype=float), -1, -2))
    arms = np.broadcast_to(joints, (len(tip), 6, 3))
    struts = tip[:, None, :] + arms - machine.frame_joints
    lengths = np.sqrt(np.einsum("nij,nij->ni", struts, struts))
    return Struts(lengths=lengths, directions=struts / lengths[..., None], arms=arms)


def solve_struts_at(machine: Hexapod, pose: ArrayLike) -> Struts:
    """Struts at poses (n, 6) or (6,): x, y, z in m, roll, pitch, yaw in rad."""
    values = np.atleast_2d(np.asarray(pose, dtype=float))
    return solve_struts(machine, values[:, :3], rotation_matrices(values[:, 3:]))


def neutral_axes(machine: Hexapod) -> tuple[FloatArray, FloatArray]:
    """Neutral axes of the frame joints (base axes) and platform joints (platform axes), (6, 3) each.

    They lie along the struts at the machine's neutral pose.
    """

    def axes() -> tuple[FloatArray, FloatArray]:
        neutral = machine.limits.neutral_pose
        directions = solve_struts_at(machine, neutral).directions[0]
        return directions, directions @ rotation_matrices(neutral[3:])

    return machine.once("neutral axes", axes)


def joint_angles(machine: Hexapod, struts: Struts, rotation: ArrayLike | None = None) -> tuple[FloatArray, FloatArray]:
    """Swing of the frame joints and platform joints from their neutral axes.

    Returns
    -------
    frame, platform
        (n, 6) rad each.
    """
    frame_axes, platform_axes = neutral_axes(machine)
    if rotation is not None:
        platform_axes = platform_axes @ np.swapaxes(np.asarray(rotation, dtype=float), -1, -2)
    return _angle(struts.directions, frame_axes), _angle(struts.directions, platform_axes)


def _angle(first: FloatArray, second: FloatArray) -> FloatArray:
    """Angle between unit vectors (..., 3), exact near 0 where arccos is not (Kahan's formula)."""
    apart = np.linalg.norm(first - second, axis=-1)
    together = np.linalg.norm(first + second, axis=-1)
    return np.asarray(2.0 * np.arctan2(apart, together))


def singularity_index(machine: Hexapod, struts: Struts) -> FloatArray:
    """|det J| relative to its value at the neutral pose, (n,): 1 there, 0 where the machine is singular.

    The determinant of the six strut screws does not depend on the point that moments are taken about, so
    neither tool length nor the choice of units enters the ratio.
    """
    with np.errstate(divide="ignore", invalid="ignore"):  # nan, if singular at the neutral pose, is out of reach
        return np.asarray(np.abs(np.linalg.det(struts.jacobian)) / neutral_determinant(machine))


def neutral_determinant(machine: Hexapod) -> float:
    """|det J| at the neutral pose, m^3."""

    def determinant() -> float:
        return float(np.abs(np.linalg.det(solve_struts_at(machine, machine.limits.neutral_pose).jacobian[0])))

    return machine.once("neutral determinant", determinant)


def forward_kinematics(
    machine: Hexapod, lengths: ArrayLike, start: ArrayLike | None = None, tool_length: ArrayLike = np.nan
) -> FloatArray:
    """Poses at which the struts have given lengths.

    Parameters
    ----------
    machine
        The machine.
    lengths
        (n, 6) or (6,) m.
    start
        (6,) or (n, 6) pose to start from, m and rad; the machine's neutral pose unless given.
    tool_length
        m, scalar or (n,); nan: the reference tool.

    Returns
    -------
    (n, 6) x, y, z in m, roll, pitch, yaw in rad.

    Raises
    ------
    InputError
        Lengths that no pose near the start has; the message names the row.

    Examples
    --------
    >>> from toolpath_stiff.machine.file import load_machine
    >>> machine = load_machine("nist")
    >>> lengths = solve_struts(machine, [0.1, -0.05, 0.8]).lengths
    >>> forward_kinematics(machine, lengths).round(9)[0, :3]
    array([ 0.1 , -0.05,  0.8 ])
    """
    wanted = np.atleast_2d(np.asarray(lengths, dtype=float))

    def equations(poses: FloatArray) -> tuple[FloatArray, FloatArray]:
        struts = solve_struts(machine, poses[:, :3], rotation_matrices(poses[:, 3:]), tool_length)
        slopes = struts.jacobian
        return struts.lengths - wanted, np.concatenate([slopes[..., :3], slopes[..., 3:] @ _turning(poses)], axis=-1)

    first = np.asarray(machine.limits.neutral_pose if start is None else start, dtype=float)
    poses = newton(equations, np.broadcast_to(first, (len(wanted), 6)), LARGEST_STEPS)
    if failed := np.flatnonzero(np.isnan(poses).any(axis=1)).tolist():
        row = ", ".join(f"{mm_from_m(length):.3f}" for length in wanted[failed[0]])
        mistake = f"row {failed[0] + 1}: no pose near the start has struts of {row} mm"
        raise InputError(mistake, hint="check the lengths, or give a start nearer to the pose")
    return poses


def _turning(poses: FloatArray) -> FloatArray:
    """(n, 3, 3) axes about which roll, pitch and yaw turn the platform, as columns (R = Rz Ry Rx)."""
    axes, yaw = rotation_matrices(poses[:, 3:]), poses[:, 5]
    axes[..., 1] = np.column_stack([-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)])
    axes[..., 2] = [0.0, 0.0, 1.0]
    return axes
