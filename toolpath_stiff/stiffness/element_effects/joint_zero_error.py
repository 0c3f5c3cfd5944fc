"""Joint zero error: a joint stands turned from what its encoder says."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, Parameter, Values, element_parameter

TYPICAL = f"{EXPERIENCE}: a marker or notch of the joint set by eye; a lost motor position more"


class JointZeroError(Effect):
    """The true joint value is the control's and a constant: the tip and what follows turn about the joint's axis."""

    name = "joint_zero_error"
    title = "a joint's zero is off"
    link = "joints"
    holds_for = "elements"
    unknown_to_control = True
    equation = "q_true = q + e for the joint"
    source = "geometry"
    clause = "{element} stands about {error} deg from the value that the control takes"
    parameters = (
        element_parameter("which joint, by its name in `tps machine show`"),
        Parameter("error", "deg", np.pi / 180.0, (-5.0, 5.0), (-0.3, 0.3), TYPICAL, meaning="true less believed value"),
    )

    def stands(self, machine: MachineTool, joints: FloatArray, p: Values) -> tuple[MachineTool, FloatArray]:
        """Joint values with the joint turned by the error."""
        return machine, joints + p["error"] * (np.arange(joints.shape[1]) == machine.joint_of(p["element"]))
