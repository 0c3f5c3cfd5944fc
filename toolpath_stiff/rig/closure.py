"""True poses of the platform when the control commands poses with the nominal geometry."""

import numpy as np
from scipy.spatial.transform import Rotation

from toolpath_stiff.arrays import FloatArray


class ClosureError(RuntimeError):
    """Struts of the commanded lengths do not carry the true platform anywhere near the commanded pose."""


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
        orientation = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ orientation
        if np.abs(step).max() < 1e-12:
            return position, orientation
    raise ClosureError("the closure equations of the platform did not converge")
