"""Struts and joints as built, according to the machine file: each slightly off the drawing."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Values


class AsBuilt(Effect):
    """`[as_built]` of a machine file as an effect: not in the catalogue, as it is not fitted the way effects are."""

    name = "as_built"
    title = "struts and joints as built"
    link = "geometry"
    equation = "k_i = exp(s_i) k_law(L), A_i += a_i, P_i += b_i"
    source = "geometry"
    unknown_to_control = True
    parameters = ()

    def strut_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Excess of each strut's compliance over the law's."""
        return np.asarray(np.expm1(-p["struts"]) / path.machine.strut_law.stiffness(path.struts.lengths))

    def geometry(self, machine: Hexapod, p: Values) -> Hexapod:
        """The machine with all joints moved."""
        frame, platform = p["joints"].reshape(2, 6, 3)
        joints = {"frame_joints": machine.frame_joints + frame, "platform_joints": machine.platform_joints + platform}
        return machine.with_changes(**joints)


def as_built(offsets: FloatArray) -> ActiveEffect:
    """Effect of `Hexapod.as_built`, (42,)."""
    return ActiveEffect(AsBuilt(), {"struts": offsets[:6], "joints": offsets[6:]})
