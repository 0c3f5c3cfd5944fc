"""Frame sway: the frame gives way as a whole, on its mounts or by bending."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import (
    Effect,
    LoadPath,
    Values,
    at_the_tip,
    body_on_springs,
    compliance,
    rocking,
)
from toolpath_stiff.stiffness.effects.frame_compliance import BUILT, frame_vertices

LEVER = f"{BUILT} at a lever of about 1 m"


class FrameSway(Effect):
    """The frame shifts and rocks about the base frame's origin as one body, alike in X and Y.

    A body that is the same after a third of a turn gives way alike in all horizontal directions (Neumann's principle:
    Nye 1985, Physical Properties of Crystals). The struts hand it the tip's whole force and moment, so that the tip
    moves as on a table that does the same.
    """

    name = "frame_sway"
    title = "the frame as a whole gives way"
    link = "frame"
    holds_for = "all"
    equation = "c += c_h (d_x^2 + d_y^2) + c_v d_z^2 + c_t ((p x d)_x^2 + (p x d)_y^2)"
    source = "springs in series, base axes"
    clause = "the frame as a whole gives way by about {sizes}"
    parts = (
        ("sideways", "nm/N sideways"),
        ("vertical", "nm/N vertically"),
        ("rocking", "nrad/(N m) in rocking"),
    )
    parameters = (
        compliance("sideways", 200.0, (2.0, 10.0), BUILT, "compliance of the frame along X and Y"),
        compliance("vertical", 200.0, (2.0, 10.0), BUILT, "compliance of the frame along Z"),
        rocking("rocking", LEVER, "rotation about X and Y per moment"),
    )

    def load_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Quadratic form of the tip force, in base axes."""
        return at_the_tip(path, body_on_springs(path, (p["sideways"], p["sideways"], p["vertical"]), p["rocking"]))

    def vertex_displacement(self, path: LoadPath, p: Values, forces: FloatArray, vertex: int) -> FloatArray | None:
        """Displacement with the body that all six struts pull on."""
        joints = path.machine.frame_joints
        pulls = forces[..., None] * path.struts.directions
        moment = np.cross(joints, pulls).sum(axis=1) * np.array([1.0, 1.0, 0.0])
        middle = joints[frame_vertices(joints)[vertex - 1][0]].mean(axis=0)
        shift = pulls.sum(axis=1) * np.array([p["sideways"], p["sideways"], p["vertical"]])
        return np.asarray(shift + p["rocking"] * np.cross(moment, middle))
