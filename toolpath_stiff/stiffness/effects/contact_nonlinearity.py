"""Contact nonlinearity: joints whose contacts stiffen with their load."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import IDLE, Effect, LoadPath, Values, compliance

REFERENCE_FORCE = 500.0  # N, force in the strut at which the compliance is given
SOURCE = "Hertz: 7.5 nm/N a joint at 500 N for steel, ball in socket of effective radius 0.2 m (assumed)"
MEANING = "secant compliance of one strut's contacts together, at 500 N in the strut"


class ContactNonlinearity(Effect):
    """Hertzian contacts at both ends of each strut, without preload.

    Hertz: two spheres approach by (9 F^2 / (16 R E*^2))^(1/3), so that displacement over force, the secant
    compliance, falls as F^(-1/3). Preload would flatten that; it is left out.
    """

    name = "contact_nonlinearity"
    title = "contacts in the joints stiffen with load"
    link = "joints"
    equation = "c_i += c_0 (|F_i| / 500 N)^(-1/3), F_i = force in strut i"
    source = "Hertz (1882), point contact: approach grows as F^(2/3)"
    load_dependent = True
    needs = ("force_N",)
    clause = (
        "the contacts in the joints of a strut give way by about {compliance} nm/N at "
        f"{REFERENCE_FORCE:g} N, less under more load"
    )
    parameters = (compliance("compliance", 200.0, (3.0, 20.0), SOURCE, MEANING),)

    def strut_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Secant compliance of the contacts under the present strut forces."""
        if path.strut_forces is None:
            return None
        return np.asarray(p["compliance"] * np.cbrt(REFERENCE_FORCE / np.maximum(np.abs(path.strut_forces), IDLE)))
