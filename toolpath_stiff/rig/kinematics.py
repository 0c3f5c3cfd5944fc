"""Kinematics of the nominal machine: strut lengths of poses, what is in reach, and where the platform really stands.

The control commands a pose with the nominal geometry; `true_poses` says where the true joints then put the platform.
"""

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.rig.nominal import Nominal


def rotations(angles: FloatArray) -> FloatArray:
    """(n, 3, 3) R = Rz(yaw) Ry(pitch) Rx(roll) from (n, 3) roll, pitch, yaw in rad."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles).T, np.sin(angles).T
    return np.stack(
        [
            np.stack([cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], axis=-1),
            np.stack([sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], axis=-1),
            np.stack([-sp, cp * sr, cp * cr], axis=-1),
        ],
        axis=1,
    )


def commanded_lengths(nominal: Nominal, tips: FloatArray, turned: FloatArray, extension: FloatArray) -> FloatArray:
    """(n, 6) m, strut lengths for tool tips (n, 3), rotations (n, 3, 3) and tools longer by `extension` (n,)."""
    joints = platform_points(nominal.platform_joints, tips, turned, extension)
    return np.asarray(np.linalg.norm(joints - nominal.frame_joints, axis=2))


def platform_points(points: FloatArray, tips: FloatArray, turned: FloatArray, extension: FloatArray) -> FloatArray:
    """(n, k, 3) m in base axes: platform points (k, 3), given from the reference tool's tip."""
    raised = points + extension[:, None, None] * np.array([0.0, 0.0, 1.0])
    return np.asarray(tips[:, None, :] + np.einsum("nij,nkj->nki", turned, raised))


class ClosureError(RuntimeError):
    """Struts of the commanded lengths carry the true platform nowhere near the commanded pose."""


def true_poses(
    lengths: FloatArray, frame: FloatArray, platform: FloatArray, tips: FloatArray, turned: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Poses (n, 3), (n, 3, 3) of the platform at which the true joints have the commanded strut lengths (n, 6).

    Newton's method on the six closure equations, from the commanded pose; `platform` (6, 3) m counts from the origin
    of the platform frame. Joint errors are millimetres, so three or four steps reach rounding.

    Raises
    ------
    ClosureError
        The true machine cannot take a pose: struts of these lengths carry no platform near it.
    """
    position, orientation = tips.copy(), turned.copy()
    for _ in range(20):
        arms = np.einsum("nij,kj->nki", orientation, platform)
        strut = position[:, None, :] + arms - frame
        reached = np.linalg.norm(strut, axis=2)
        gap = lengths - reached
        if np.abs(gap).max() < 1e-13:
            return position, orientation
        unit = strut / reached[:, :, None]
        step = np.linalg.solve(np.concatenate([unit, np.cross(arms, unit)], axis=2), gap[:, :, None])[:, :, 0]
        position = position + step[:, :3]
        orientation = _turn(step[:, 3:]) @ orientation
        if np.abs(step).max() < 1e-12:
            return position, orientation
    raise ClosureError("the closure equations of the platform did not converge")


def _turn(vector: FloatArray) -> FloatArray:
    """(n, 3, 3) rotation matrices of rotation vectors (n, 3) (Rodrigues)."""
    angle = np.linalg.norm(vector, axis=1)
    x, y, z = vector.T
    zero = np.zeros_like(x)
    skew = np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], 1)
    # sin(t)/t and (1 - cos t)/t^2 through sinc, which is safe at 0.
    first = np.sinc(angle / np.pi)[:, None, None]
    second = 0.5 * np.sinc(angle / (2.0 * np.pi))[:, None, None] ** 2
    return np.asarray(np.eye(3) + first * skew + second * (skew @ skew))


def reachable(nominal: Nominal, tips: FloatArray, angles: FloatArray, extension: FloatArray) -> BoolArray:
    """(n,) whether strut lengths and joint swings stay within the nominal machine's limits."""
    turned = rotations(angles)
    lengths = commanded_lengths(nominal, tips, turned, extension)
    low, high = nominal.strut_range
    inside = ((lengths >= low) & (lengths <= high)).all(axis=1)
    if nominal.swing is None:
        return np.asarray(inside)
    rest, moved = neutral_directions(nominal), strut_directions(nominal, tips, turned, extension)
    for limit, before, after in zip(nominal.swing, rest, moved, strict=True):
        cosine = np.clip(np.einsum("nki,nki->nk", np.broadcast_to(before, after.shape), after), -1.0, 1.0)
        inside &= (np.arccos(cosine) <= limit).all(axis=1)
    return np.asarray(inside)


def strut_directions(
    nominal: Nominal, tips: FloatArray, turned: FloatArray, extension: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (n, 6, 3) along the struts in base axes and in platform axes."""
    strut = platform_points(nominal.platform_joints, tips, turned, extension) - nominal.frame_joints
    unit = strut / np.linalg.norm(strut, axis=2, keepdims=True)
    return unit, unit @ turned


def neutral_directions(nominal: Nominal) -> tuple[FloatArray, FloatArray]:
    """The same (1, 6, 3) at the neutral pose."""
    pose = nominal.neutral_pose[None]
    return strut_directions(nominal, pose[:, :3], rotations(pose[:, 3:]), np.zeros(1))
