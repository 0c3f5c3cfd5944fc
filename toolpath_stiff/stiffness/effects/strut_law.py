"""Strut law: the stiffness of a strut is not linear in its length."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter, Values

SOURCE = "-3.1 % if compliance instead of stiffness is linear between the paper's 46.5 and 32.5 N/um"
MEANING = "how much stiffer a strut is midway between L_1 and L_2 than on the straight line"


class StrutLawCurvature(Effect):
    """A curved deviation from the machine's linear law, none at its two lengths L_1 and L_2.

    The exponential keeps every stiffness positive however far the law is extrapolated.
    """

    name = "strut_law"
    title = "strut stiffness is curved over length"
    link = "struts"
    equation = "k(L) = k_linear(L) exp(q (1 - x^2)), x = (2 L - L_1 - L_2) / (L_2 - L_1)"
    source = "lowest-order deviation from the paper's equation 5 that leaves both its constants as they are"
    clause = (
        "midway between the strut law's two lengths struts are about {curvature} % {curvature:stiffer/softer} than on "
        "its straight line"
    )
    parameters = (Parameter("curvature", "%", 0.01, (-40.0, 40.0), (-4.0, 4.0), SOURCE, meaning=MEANING),)

    def strut_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Difference of the compliances with and without curvature.

        On top of a table or a constant law as on top of a straight line; x of a constant law runs from one end of the
        travel to the other.
        """
        law = path.machine.strut_law
        length = path.struts.lengths
        x = (2.0 * length - law.length_1 - law.length_2) / (law.length_2 - law.length_1)
        return np.asarray(np.expm1(-p["curvature"] * (1.0 - x * x)) / law.stiffness(length))
