"""Set-up compliance: a riser block or fixture that only one set-up has."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, LoadPath, Values, compliance, setup_parameter


class SetupCompliance(Effect):
    """Compliance along X, Y, Z in the rows of one set-up; elsewhere, and where no set-up is known, nothing."""

    name = "setup_compliance"
    title = "one set-up's riser or fixture gives way"
    link = "table"
    holds_for = "all"
    equation = "c += d^T diag(c_x, c_y, c_z) d where setup = s"
    source = "springs in series, base axes; the paper measured its upper plane on a riser (Figure 6)"
    needs = ("setup",)
    clause = "set-up {setup} (riser or fixture) gives way by about {sizes}"
    parts = tuple((axis, f"nm/N along {axis.upper()}") for axis in "xyz")
    parameters = (
        setup_parameter("name of the set-up"),
        *(
            compliance(axis, 200.0, (1.0, 10.0), EXPERIENCE, f"compliance of this set-up along {axis.upper()}")
            for axis in "xyz"
        ),
    )

    def load_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Quadratic form of the tip force in the rows of the set-up."""
        if path.setup is None:
            return None
        form = np.zeros((len(path), 12, 12))
        form[path.setup == p["setup"], 6:9, 6:9] = np.diag([p["x"], p["y"], p["z"]])
        return form
