"""Gear backlash: a joint turns some way before its gear carries."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter, Values, element_parameter

TYPICAL = (
    "between both sides 1 to 1.5 arcmin in RV reducers of robots (zhygear.com, Analysis and Control of Backlash in RV "
    "Reducers); worn ones more: engineering experience, no source"
)
CLOSED = (
    "lost motion is stated between -3 and 3 % of the rated moment, of 58 to 4410 N m (Nabtesco, RV-E series, RV-6E to "
    "RV-450E)"
)
SMALLEST = 1e-3  # N m in a joint: below it the gap adds nothing visible


class GearBacklash(Effect):
    """Lost turn g of a joint under load: a displacement that does not grow with the load.

    Under the moment M about its axis the joint gives g h(M) + c M, h(M) = M / sqrt(M^2 + M0^2): all of the gap once M
    is well above the moment M0 that closes it (0: any load does). It counts from the moment W of the weight, where the
    machine file has masses: one that holds the gap closed on one side hides it. Secant compliance.
    """

    name = "gear_backlash"
    title = "backlash in a joint's gear"
    link = "joints"
    holds_for = "elements"
    load_dependent = True
    equation = "c_z += g (h(W + M) - h(W)) / M, h(M) = M / sqrt(M^2 + M0^2), M about the joint's axis, W of the weight"
    source = "secant through a gap that closes gradually"
    needs = ("force_N",)
    clause = "{element} turns by about {gap} arcsec before its gear carries"
    parameters = (
        element_parameter("which joint, by its name in `tps machine show`"),
        Parameter("gap", "arcsec", np.pi / 648000.0, (0.0, 3600.0), (10.0, 90.0), TYPICAL, meaning="turn to one side"),
        Parameter("closing", "N m", 1.0, (0.0, 500.0), (2.0, 130.0), CLOSED, meaning="moment that closes the gap"),
    )

    def element_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Secant compliance under the present moment."""
        if path.element_loads is None:
            return None
        more, torsion = path.element_zeros(), path.element(p["element"])[0].start + 5
        weight, moment = path.weight_loads[:, torsion], path.element_loads[:, torsion]
        moment = np.where(np.abs(moment) < SMALLEST, SMALLEST, moment)
        share = [m / np.hypot(m, max(p["closing"], SMALLEST)) for m in (weight + moment, weight)]
        more[:, torsion] = p["gap"] * (share[0] - share[1]) / moment
        return more
