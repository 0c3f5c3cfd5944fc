"""Joint moment stiffness: the joints resist turning, so that the struts are not pinned."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter, Values
from toolpath_stiff.stiffness.sizes import about

SOURCE = (
    "5 N m/rad for a flexure joint (T. Dehaeze, test bench of flexible joints); 4 E I / L for locked "
    "joints: 0.84e5, 1.75e5, 5.5e5 for steel of 50, 60, 80 mm diameter, 3 m long"
)
MEANING = "rotational stiffness at each end of the strut"
WHICH = "which strut's joints; 0 is all struts'"


class JointMomentStiffness(Effect):
    """Rotational springs kappa at both ends of every strut, or of one, which stays straight.

    A twist (v, theta) of the platform about the tip moves the platform joint by v_i = v + theta x r_i. The strut's
    axis turns by phi_i = u_i x v_i / L_i, which is its rotation against the frame. Against the platform it turns by
    phi_i - (1 - u_i u_i^T) theta; spinning about its own axis is taken to be free. Both rotations are linear in the
    twist, phi = B x, and twice the energy is kappa x^T B^T B x, so K = kappa sum_i (B_f^T B_f + B_p^T B_p).

    A strut clamped at one end resists rotation of that end by 4 E I / L if the far end is held (beam theory), which
    sets the size of kappa for joints locked by friction: below their friction moment they stick.
    """

    name = "joint_moment_stiffness"
    title = "joints resist turning (struts are not pinned)"
    link = "joints"
    equation = "K += kappa sum_i (B_fi^T B_fi + B_pi^T B_pi), B: rotations of strut i against frame and platform"
    source = "derived here from rotational springs at the ends of straight struts"
    parameters = (
        Parameter("strut", "", 1.0, (0, 6), (0, 6), "number of the strut", 0.0, WHICH, "integer"),
        Parameter("stiffness", "N m/rad", 1.0, (0.0, 2e6), (5.0, 5.5e5), SOURCE, meaning=MEANING),
    )

    def parallel_stiffness(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Stiffness of the rotational springs about the tip: of all twelve, or of one strut's two."""
        if p["stiffness"] == 0.0:
            return None
        struts = slice(None) if p["strut"] == 0 else slice(int(p["strut"]) - 1, int(p["strut"]))
        rotations = end_rotations(path)[:, struts].reshape(len(path), -1, 6)
        return np.asarray(p["stiffness"] * np.swapaxes(rotations, 1, 2) @ rotations)

    def finding(self, p: Values) -> str:
        """Clause on the resistance of the joints to turning."""
        size = f"{about(p['stiffness'] / 1e3)} kN m/rad at each end"
        if p["strut"]:
            return f"the joints of strut {p['strut']} resist turning by about {size}"
        return f"the joints resist turning by about {size} of each strut"


def end_rotations(path: LoadPath) -> FloatArray:
    """(n, 6, 6, 6) B of each strut: its rotation against the frame and against the platform, 3 each, of a tip twist."""
    axis, each = path.struts.directions[..., None, :], np.broadcast_to(np.eye(3), (len(path), 6, 3, 3))
    move = np.concatenate([each, np.cross(np.eye(3), path.struts.arms[..., None, :])], axis=-2)  # of six unit twists
    against_frame = np.cross(axis, move) / path.struts.lengths[..., None, None]
    against_platform = against_frame.copy()
    against_platform[..., 3:, :] -= np.eye(3) - axis * np.swapaxes(axis, -1, -2)
    return np.swapaxes(np.concatenate([against_frame, against_platform], axis=-1), -1, -2)
