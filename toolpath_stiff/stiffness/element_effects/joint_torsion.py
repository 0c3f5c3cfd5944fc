"""Joint torsion: a rotary joint gives way about its axis, in gear, bearing and servo."""

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, LoadPath, Parameter, Values, element_parameter

TYPICAL = f"{EXPERIENCE}: a robot's joints from base to wrist"


class JointTorsion(Effect):
    """Compliance of a joint about its axis, beside that of the machine file."""

    name = "joint_torsion"
    title = "a joint gives way about its axis"
    link = "joints"
    holds_for = "elements"
    equation = "c_z += c for the joint's torsion"
    source = "springs in series"
    clause = "{element} gives way by about {compliance} nrad/(N m) about its axis"
    parameters = (
        element_parameter("which joint, by its name in `tps machine show`"),
        Parameter("compliance", "nrad/N/m", 1e-9, (0.0, 1e5), (200.0, 5000.0), TYPICAL, meaning="rotation per moment"),
    )

    def element_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Compliance of its rotation about z alone."""
        more = path.element_zeros()
        more[:, path.element(p["element"])[0].start + 5] = p["compliance"]
        return more
