"""Kinematics of the nominal machine: strut lengths at poses, and reach."""

import numpy as np
from scipy.spatial.transform import Rotation

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.rig.nominal import Nominal


def rotations(angles: FloatArray) -> FloatArray:
    """(n, 3, 3) R = Rz(yaw) Ry(pitch) Rx(roll) from (n, 3) roll, pitch, yaw in rad."""
    return np.asarray(Rotation.from_euler("xyz", angles).as_matrix())


def commanded_lengths(nominal: Nominal, tips: FloatArray, turned: FloatArray, extension: FloatArray) -> FloatArray:
    """(n, 6) m, strut lengths for tool tips (n, 3), rotations (n, 3, 3) and tools longer by `extension` (n,)."""
    strut = platform_points(nominal.platform_joints, tips, turned, extension) - nominal.frame_joints
    return np.asarray(np.linalg.norm(strut, axis=2))


def platform_points(points: FloatArray, tips: FloatArray, turned: FloatArray, extension: FloatArray) -> FloatArray:
    """(n, k, 3) m in base axes: platform points (k, 3), given from the reference tool's tip."""
    raised = points + extension[:, None, None] * np.array([0.0, 0.0, 1.0])
    return np.asarray(tips[:, None, :] + np.einsum("nij,nkj->nki", turned, raised))


def reachable(nominal: Nominal, tips: FloatArray, angles: FloatArray, extension: FloatArray) -> BoolArray:
    """(n,) True where strut lengths and joint swings stay within the nominal machine's limits."""
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
    """`strut_directions` at the neutral pose, (1, 6, 3) each."""
    pose = nominal.neutral_pose[None]
    return strut_directions(nominal, pose[:, :3], rotations(pose[:, 3:]), np.zeros(1))
