"""Change of tip stiffness by struts that are not alike and by displaced joints.

With strut forces f, J^T f = w, and the motion y = J^-1 e of a platform on struts that stretch by e, a change of the
geometry changes the compliance by -2 f^T dJ y: forces in equilibrium under the changed geometry do the virtual work
(the adjoint of Castigliano's theorem; rows of J are [u, r x u]). Struts keep their commanded lengths, so that a joint
off its place moves the platform as well: u . (dp + dphi x r + R db - da) = 0.
"""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.contract import LoadPath
from toolpath_stiff.stiffness.model import StiffnessModel


def geometry_slopes(model: StiffnessModel, path: LoadPath, direction: FloatArray) -> FloatArray:
    """(n, 42) d ln k along unit vectors (n, 3) by ln (stiffness of strut i), then by joint coordinates, 1/m.

    The coordinates are x, y, z of the six frame joints in the base frame, then of the platform joints in the
    platform's. What stands parallel to the struts, and how effects hang on the geometry, is left as it is.
    """
    path, form, twists, forces = exact.under_load(model, path, direction)
    u, r, jacobian = path.struts.directions, path.struts.arms, path.struts.jacobian
    stretch = np.einsum("nij,nj->ni", form[:, :6, :6], forces)
    motion = np.linalg.solve(jacobian, stretch[..., None])[..., 0]
    turn = motion[:, None, 3:]
    joints = motion[:, None, :3] + np.cross(turn, r)  # of the platform joints
    across = (joints - (joints * u).sum(axis=-1, keepdims=True) * u) / path.struts.lengths[..., None]
    by_direction, by_arm = forces[..., None] * across, forces[..., None] * np.cross(u, turn)
    by_motion = np.concatenate([by_direction, np.cross(r, by_direction + by_arm)], axis=-1).sum(axis=1)
    pushed = np.linalg.solve(np.swapaxes(jacobian, 1, 2), by_motion[..., None]) * u
    frame, platform = pushed - by_direction, by_direction + by_arm - pushed
    local = np.einsum("nji,nkj->nki", path.rotation, platform)
    compliance = (twists[:, :3] * direction).sum(axis=1)
    struts = forces**2 / path.machine.strut_law.stiffness(path.struts.lengths)
    columns = [struts, 2.0 * frame.reshape(-1, 18), 2.0 * local.reshape(-1, 18)]
    return np.asarray(np.concatenate(columns, axis=1) / compliance[:, None])
