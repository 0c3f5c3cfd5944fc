"""Joint clearance: every strut loses some motion before it carries its load."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import EXPERIENCE, IDLE, Effect, LoadPath, Parameter, Values

MEANING = "motion of one strut to one side before it carries: half its total play"


class JointClearance(Effect):
    """Lost motion g in each loaded strut: a displacement that does not grow with the load.

    Secant compliance: the strut gives g + c F_i under its force F_i, that is g / |F_i| + c. Weight and preload, which
    would close a gap for good, are left out.
    """

    name = "joint_clearance"
    title = "lost motion in joints and nuts"
    link = "joints"
    equation = "c_i += g / |F_i|, F_i = force in strut i"
    source = "secant through a gap, taken up in full by any load"
    load_dependent = True
    needs = ("force_N",)
    clause = "every strut moves about {lost_motion} um to each side before it carries its load"
    parameters = (Parameter("lost_motion", "um", 1e-6, (0.0, 200.0), (1.0, 10.0), EXPERIENCE, meaning=MEANING),)

    def strut_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Secant compliance of the gaps under the present strut forces."""
        if path.strut_forces is None:
            return None
        return np.asarray(p["lost_motion"] / np.maximum(np.abs(path.strut_forces), IDLE))
