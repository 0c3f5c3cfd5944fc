"""Rotations of the platform: roll, pitch, yaw about the base frame's x, y, z.

Convention: R = Rz(yaw) Ry(pitch) Rx(roll). The paper's equation 7 (its rotation matrix) is lost in the
text, so the order is assumed; it is of no consequence while the spindle is vertical.
"""

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray


def rotation_matrices(abc: ArrayLike) -> FloatArray:
    """Rotation matrices of roll, pitch, yaw.

    Parameters
    ----------
    abc
        (..., 3) roll a, pitch b, yaw c in rad.

    Returns
    -------
    (..., 3, 3) rotation matrices, R = Rz(c) Ry(b) Rx(a).

    Examples
    --------
    >>> rotation_matrices([0.0, 0.0, np.pi / 2]).round(9)[:2, 0].tolist()  # x turns onto y
    [0.0, 1.0]
    """
    angles = np.asarray(abc, dtype=float)
    cosine, sine = np.cos(angles), np.sin(angles)
    ca, cb, cc = cosine[..., 0], cosine[..., 1], cosine[..., 2]  # much faster than `moveaxis` for a single pose
    sa, sb, sc = sine[..., 0], sine[..., 1], sine[..., 2]
    rotation = np.empty((*angles.shape[:-1], 3, 3))
    rotation[..., 0, 0] = cc * cb
    rotation[..., 0, 1] = cc * sb * sa - sc * ca
    rotation[..., 0, 2] = cc * sb * ca + sc * sa
    rotation[..., 1, 0] = sc * cb
    rotation[..., 1, 1] = sc * sb * sa + cc * ca
    rotation[..., 1, 2] = sc * sb * ca - cc * sa
    rotation[..., 2, 0] = -sb
    rotation[..., 2, 1] = cb * sa
    rotation[..., 2, 2] = cb * ca
    return rotation


def roll_pitch_yaw(rotation: ArrayLike) -> FloatArray:
    """Roll, pitch, yaw of rotation matrices, the inverse of `rotation_matrices`.

    Parameters
    ----------
    rotation
        (..., 3, 3) rotation matrices.

    Returns
    -------
    (..., 3) a, b, c in rad; b in [-pi/2, pi/2]. At b = +-pi/2, where roll and yaw turn about the same
    axis, yaw is set to 0.

    Examples
    --------
    >>> roll_pitch_yaw(rotation_matrices([0.1, -0.2, 0.3])).round(9).tolist()
    [0.1, -0.2, 0.3]
    """
    matrix = np.asarray(rotation, dtype=float)
    cos_b = np.hypot(matrix[..., 0, 0], matrix[..., 1, 0])
    pitch = np.arctan2(-matrix[..., 2, 0], cos_b)
    lock = cos_b < 1e-12
    roll = np.where(
        lock,
        np.arctan2(-matrix[..., 1, 2], matrix[..., 1, 1]),
        np.arctan2(matrix[..., 2, 1], matrix[..., 2, 2]),
    )
    yaw = np.where(lock, 0.0, np.arctan2(matrix[..., 1, 0], matrix[..., 0, 0]))
    return np.stack([roll, pitch, yaw], axis=-1)


def along_tool_axis(vector: FloatArray, abc: FloatArray) -> FloatArray:
    """(n,) components of vectors (n, 3) along the tool axis, the platform's z, at roll, pitch, yaw (n, 3) rad."""
    if not abc[:, :2].any():  # upright
        return vector[:, 2]
    (ca, cb, cc), (sa, sb, sc) = np.cos(abc).T, np.sin(abc).T
    x, y, z = vector.T
    return np.asarray(x * (cc * sb * ca + sc * sa) + y * (sc * sb * ca - cc * sa) + z * (cb * ca))


def rotation_about_z(angle: ArrayLike) -> FloatArray:
    """Rotation matrices about z, (..., 3, 3), of angles (...) in rad.

    Examples
    --------
    >>> rotation_about_z([0.0, np.pi / 2]).shape
    (2, 3, 3)
    """
    value = np.asarray(angle, dtype=float)
    zeros = np.zeros_like(value)
    return rotation_matrices(np.stack([zeros, zeros, value], axis=-1))
