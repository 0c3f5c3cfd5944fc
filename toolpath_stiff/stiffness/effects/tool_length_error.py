"""Tool length error: the tool is longer than the control believes."""

import numpy as np

from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, Parameter, Values

POCKET = f"{EXPERIENCE}: the tool of the neighbouring pocket"
MEANING = "true tool length less the entered one"


class ToolLengthError(Effect):
    """The platform stands where the control puts it; the true tip, where the load acts, lies further along the tool."""

    name = "tool_length_error"
    title = "a wrong tool length was entered"
    link = "geometry"
    equation = "r_i += R (0, 0, e), tip -= R (0, 0, e): the struts stay, their arms about the tip grow"
    source = "geometry"
    unknown_to_control = True
    clause = "the tool is about {error} mm {error:longer/shorter} than the length that was entered"
    parameters = (Parameter("error", "mm", 1e-3, (-60.0, 60.0), (-10.0, 10.0), POCKET, meaning=MEANING),)

    def geometry(self, machine: Hexapod, p: Values) -> Hexapod:
        """The machine with platform joints further above the tip."""
        return machine.with_changes(platform_joints=machine.platform_joints + np.array([0.0, 0.0, p["error"]]))
