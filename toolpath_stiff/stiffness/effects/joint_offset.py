"""Joint offset: one joint does not stand where the machine file has it."""

import numpy as np

from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, Parameter, Values
from toolpath_stiff.stiffness.sizes import sizes_in_words

WHICH = "1 to 6: the joints of struts 1 to 6 on the frame; 7 to 12: those on the platform"


class JointOffset(Effect):
    """A single joint of frame or platform is moved, unknown to the control.

    The platform goes where struts of the commanded lengths put the true joints.
    """

    name = "joint_offset"
    title = "a joint stands off its place"
    link = "geometry"
    equation = "A_i += (x, y, z) or P_i += (x, y, z)"
    source = "geometry"
    unknown_to_control = True
    told_by = "measuring the joint's place, with a tracker or an arm"
    vector = True
    parameters = (
        Parameter("joint", "", 1.0, (1, 12), (1, 12), "number of the strut", 1.0, WHICH, "integer"),
        *(
            Parameter(
                axis, "mm", 1e-3, (-30.0, 30.0), (-3.0, 3.0), EXPERIENCE, meaning=f"true place less the file's, {axis}"
            )
            for axis in "xyz"
        ),
    )

    def geometry(self, machine: Hexapod, p: Values) -> Hexapod:
        """The machine with that joint moved."""
        number, ends = int(p["joint"]) - 1, ("frame_joints", "platform_joints")
        name, joints = ends[number // 6], np.array(getattr(machine, ends[number // 6]))
        joints[number % 6] += [p[axis] for axis in "xyz"]
        return machine.with_changes(**{name: joints})

    def finding(self, p: Values) -> str:
        """Clause on which joint is displaced, and how far."""
        number = int(p["joint"]) - 1
        sizes = sizes_in_words([(p[axis], f"mm along {'-' if p[axis] < 0.0 else ''}{axis.upper()}") for axis in "xyz"])
        end = "platform" if number // 6 else "frame"
        return f"the joint of strut {number % 6 + 1} on the {end} stands off its place by about {sizes}"
