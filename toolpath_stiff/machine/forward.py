"""Forward kinematics: the pose that given strut lengths put the platform in, by Newton's method.

A six-strut platform has up to 40 assembly modes (Merlet, Parallel Robots, 2006, chapter 4); Newton's method finds the
one that the start lies in, normally the machine's neutral pose. Each step solves J dx = dL with J as in `kinematics`:
strut elongation per twist of the tip.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices
from toolpath_stiff.units import mm_from_m

FloatArray = NDArray[np.float64]

LENGTH_TOLERANCE = 1e-12  # m, a few units in the last place of a strut's length
MOST_STEPS = 50
# Farthest step of Newton's method: beyond some tenths of a radian its linear model of a rotation is worthless.
LARGEST_TURN = 0.3  # rad
LARGEST_SHIFT = 0.5  # m


def forward_kinematics(
    machine: Machine, lengths: ArrayLike, start: ArrayLike | None = None, tool_length: float = np.nan
) -> FloatArray:
    """Poses at which the struts have the given lengths.

    Parameters
    ----------
    machine
        The machine.
    lengths
        (n, 6) or (6,) m.
    start
        (6,) or (n, 6) pose to start from, m and rad; the machine's neutral pose unless given.
    tool_length
        m; nan: the reference tool.

    Returns
    -------
    (n, 6) x, y, z in m, roll, pitch, yaw in rad.

    Raises
    ------
    InputError
        Not six finite lengths above 0 in each row, or lengths that no pose near the start has; the message names the
        row.
    """
    wanted = np.atleast_2d(np.asarray(lengths, dtype=float))
    _check_lengths(wanted)
    first = np.asarray(machine.limits.neutral_pose if start is None else start, dtype=float)
    poses = np.broadcast_to(first, (len(wanted), 6))
    position, rotation = poses[:, :3].copy(), rotation_matrices(poses[:, 3:])
    error = np.full(len(wanted), np.inf)
    for _ in range(MOST_STEPS):
        struts = solve_struts(machine, position, rotation, tool_length)
        missing = wanted - struts.lengths
        error = np.abs(missing).max(axis=1)
        # The last digits differ from step to step; one more step after reaching them changes nothing.
        if (error < LENGTH_TOLERANCE).all() or not np.isfinite(error).all():
            break
        twist = _newton_step(struts.jacobian, missing)
        position = position + twist[:, :3]
        rotation = _turn(twist[:, 3:]) @ rotation
    failed = np.flatnonzero(~(error < 1e3 * LENGTH_TOLERANCE))
    if len(failed):
        row = int(failed[0])
        shown = ", ".join(f"{mm_from_m(v):.3f}" for v in wanted[row])
        raise InputError(
            f"row {row + 1}: no pose near the start has struts of {shown} mm",
            hint="check the lengths, or give a start nearer to the pose",
        )
    return np.concatenate([position, roll_pitch_yaw(rotation)], axis=1)


def _check_lengths(lengths: FloatArray) -> None:
    """One bad row must not be blamed on another: rows are solved together."""
    if lengths.ndim != 2 or lengths.shape[1] != 6:
        raise InputError(f"strut lengths of shape {lengths.shape}", expected="(n, 6) or (6,)")
    bad = np.flatnonzero(~(np.isfinite(lengths) & (lengths > 0.0)).all(axis=1))
    if len(bad):
        row = int(bad[0])
        shown = ", ".join(f"{mm_from_m(v):.3f}" for v in lengths[row])
        raise InputError(f"row {row + 1}: strut lengths {shown} mm", expected="six finite lengths above 0")


def _newton_step(jacobian: FloatArray, missing: FloatArray) -> FloatArray:
    """Twists (n, 6), shortened where they are too large to be trusted."""
    twist = np.einsum("nij,nj->ni", np.linalg.pinv(jacobian), missing)
    shift = np.linalg.norm(twist[:, :3], axis=1) / LARGEST_SHIFT
    turn = np.linalg.norm(twist[:, 3:], axis=1) / LARGEST_TURN
    return np.asarray(twist / np.maximum(1.0, np.maximum(shift, turn))[:, None])


def _turn(vector: FloatArray) -> FloatArray:
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3), Rodrigues' formula."""
    angle = np.linalg.norm(vector, axis=1)[:, None, None]
    x, y, z = vector.T
    zero = np.zeros_like(x)
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    safe = np.where(angle > 1e-8, angle, 1.0)
    first = np.where(angle > 1e-8, np.sin(safe) / safe, 1.0)
    second = np.where(angle > 1e-8, (1.0 - np.cos(safe)) / safe**2, 0.5)
    return np.asarray(np.eye(3) + first * skew + second * (skew @ skew))
