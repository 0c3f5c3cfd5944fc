"""Weak strut: one strut is softer than the others."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, LoadPath, Parameter, Values
from toolpath_stiff.stiffness.sizes import about

MEANING = "stiffness of this strut over that of the others"


class WeakStrut(Effect):
    """The stiffness of one strut, after the machine's strut law, is multiplied by a factor."""

    name = "weak_strut"
    title = "one strut is weak"
    link = "struts"
    equation = "k_s(L) = factor k_linear(L) for strut s"
    source = "worn nut, lost preload"
    parameters = (
        Parameter("strut", "", 1.0, (1, 6), (1, 6), "number of the strut", 1.0, "which strut", "integer"),
        Parameter("factor", "", 1.0, (0.3, 1.0), (0.4, 0.9), EXPERIENCE, 1.0, MEANING),
    )

    def strut_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Excess of this strut's compliance over the law's."""
        more = np.zeros((len(path), 6))
        which = int(p["strut"]) - 1
        more[:, which] = (1.0 / p["factor"] - 1.0) / path.machine.strut_law.stiffness(path.struts.lengths[:, which])
        return more

    def finding(self, p: Values) -> str:
        """Clause on which strut is soft, and by how much."""
        return f"strut {p['strut']} is about {about(100.0 * (1.0 - p['factor']))} % too soft"
