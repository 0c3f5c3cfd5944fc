"""Link length error: a link of a chain is longer than the machine file says."""

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, Parameter, Values, element_parameter

TYPICAL = f"{EXPERIENCE}: tolerances of castings before calibration; a figure of the wrong model more"


class LinkLengthError(Effect):
    """The joint's axis lies further from that of the joint before it, along the line between their origins.

    A joint whose origin is that of the joint before it has no such link: there the effect does nothing.
    """

    name = "link_length_error"
    title = "a link is longer than the file says"
    link = "joints"
    holds_for = "elements"
    unknown_to_control = True
    equation = "o_j += e (o_j - o_i) / |o_j - o_i| in the frame of the joint i before"
    source = "geometry"
    clause = "the link before {element} is about {error} mm {error:longer/shorter} than the machine file says"
    parameters = (
        element_parameter("the joint at the link's end, by its name in `tps machine show`"),
        Parameter("error", "mm", 1e-3, (-20.0, 20.0), (-2.0, 2.0), TYPICAL, meaning="true less stated length"),
    )

    def stands(self, machine: MachineTool, joints: FloatArray, p: Values) -> tuple[MachineTool, FloatArray]:
        """The machine with the longer link, at the same joint values."""
        return machine.with_longer_link(machine.joint_of(p["element"]), p["error"]), joints
