"""Joint bending: a rotary joint gives way across its axis, in bearings and housing."""

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, LoadPath, Parameter, Values, element_parameter

TYPICAL = f"{EXPERIENCE}: a quarter to a half of the torsion"


class JointBending(Effect):
    """Compliance of a joint about the two axes across its own, alike, beside that of the machine file."""

    name = "joint_bending"
    title = "a joint gives way across its axis"
    link = "joints"
    holds_for = "elements"
    equation = "c_x, c_y += c for the joint's bending"
    source = "springs in series"
    clause = "{element} gives way by about {compliance} nrad/(N m) across its axis"
    parameters = (
        element_parameter("which joint, by its name in `tps machine show`"),
        Parameter("compliance", "nrad/N/m", 1e-9, (0.0, 1e5), (50.0, 1500.0), TYPICAL, meaning="rotation per moment"),
    )

    def element_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Compliance of its rotations about x and y."""
        more, first = path.element_zeros(), path.element(p["element"])[0].start
        more[:, first + 3 : first + 5] = p["compliance"]
        return more
