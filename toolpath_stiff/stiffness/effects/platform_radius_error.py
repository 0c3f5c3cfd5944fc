"""Platform radius error: the platform joints sit on a larger circle than the machine file says."""

import numpy as np

from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, Parameter, Values

MEANING = "true radius less that of the machine file"


class PlatformRadiusError(Effect):
    """Every platform joint is moved outwards from the tool axis, unknown to the control.

    The platform then misses the programmed pose, a little with a vertical spindle, and so much when it is tilted that
    this changes the stiffness as strongly as the joints' places themselves.
    """

    name = "platform_radius_error"
    title = "platform radius differs from the drawing"
    link = "geometry"
    equation = "P_i += e (P_ix, P_iy, 0) / |(P_ix, P_iy)|"
    source = "geometry"
    unknown_to_control = True
    clause = "the platform's joints stand about {error} mm further {error:out/in} than in the machine file"
    parameters = (Parameter("error", "mm", 1e-3, (-60.0, 60.0), (-3.0, 3.0), EXPERIENCE, meaning=MEANING),)

    def geometry(self, machine: Hexapod, p: Values) -> Hexapod:
        """The machine with joints on the wider circle; one on the tool axis has no outward direction and stays."""
        joints = machine.platform_joints.copy()
        radius = np.hypot(joints[:, 0], joints[:, 1])
        off_axis = radius > 0.0
        joints[off_axis, :2] *= (1.0 + p["error"] / radius[off_axis])[:, None]
        return machine.with_changes(platform_joints=joints)
