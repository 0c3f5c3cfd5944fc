"""Weak element: one element of the load path is softer than the machine file says."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, LoadPath, Parameter, Values, element_parameter
from toolpath_stiff.stiffness.sizes import about

MEANING = "stiffness of this element over that in the machine file"


class WeakElement(Effect):
    """The stiffness of one element is multiplied by a factor, in all its directions."""

    name = "weak_element"
    title = "one element is weak"
    link = "struts"
    holds_for = "elements"
    equation = "C_e = C_e(file) / factor for element e"
    source = "a loose bolt, worn bearing, lost preload"
    parameters = (
        element_parameter("which element, by its name in `tps machine show`"),
        Parameter("factor", "", 1.0, (0.005, 1.0), (0.4, 0.9), EXPERIENCE, 1.0, MEANING),
    )

    def element_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Excess of this element's compliance over the file's."""
        more = path.element_zeros()
        columns, load = path.element(p["element"])
        more[:, columns] = (1.0 / p["factor"] - 1.0) * load.compliance
        return np.asarray(more)

    def finding(self, p: Values) -> str:
        """Clause on which element is soft, and by how much."""
        return f"{p['element']} is about {about(100.0 * (1.0 - p['factor']))} % too soft"
