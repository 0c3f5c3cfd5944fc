"""Joint compliance: the joints at both ends of a strut, its nut and bearings, a constant in series with it."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Values, compliance

SOURCE = (
    "two joints in series: 94 N/um each for a flexure joint (T. Dehaeze, test bench of flexible joints, "
    "by finite elements), over 100 N/um for a kinematic coupling (Schouten, Rosielle, Schellekens 1997); "
    "lower end: engineering experience, no source"
)


class JointCompliance(Effect):
    """The same constant compliance in series with each strut.

    Nut, thrust bearing and drive add to the same constant; tip stiffness cannot tell them from the joints.
    """

    name = "joint_compliance"
    title = "joints give way along the struts"
    link = "joints"
    equation = "c_i += c_j"
    source = "springs in series"
    clause = "joints and nut of every strut give way by about {compliance} nm/N"
    parameters = (
        compliance("compliance", 200.0, (3.0, 20.0), SOURCE, "both joints, nut and bearings of one strut together"),
    )

    def strut_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """The constant compliance, for every strut and pose."""
        return np.full((len(path), 6), p["compliance"])
