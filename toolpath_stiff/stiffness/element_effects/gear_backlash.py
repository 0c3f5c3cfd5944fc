"""Gear backlash: a joint turns some way before its gear carries."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter, Values, element_parameter

TYPICAL = (
    "between both sides 1 to 1.5 arcmin in RV reducers of robots (zhygear.com, Analysis and Control of Backlash in RV "
    "Reducers); worn ones more: engineering experience, no source"
)
SMALLEST = 1e-3  # N m in a joint: below, the gap adds nothing that shows


class GearBacklash(Effect):
    """Lost turn g of a joint under load: a displacement that does not grow with the load.

    Secant compliance: the joint gives g + c |M| under the moment M about its axis. The arm's weight, which may hold the
    gap closed on one side, is left out: the gap is taken up in full by any load.
    """

    name = "gear_backlash"
    title = "backlash in a joint's gear"
    link = "joints"
    holds_for = "elements"
    load_dependent = True
    equation = "c_z += g / |M|, M the moment about the joint's axis"
    source = "secant through a gap"
    needs = ("force_N",)
    clause = "{element} turns by about {gap} arcsec before its gear carries"
    parameters = (
        element_parameter("which joint, by its name in `tps machine show`"),
        Parameter("gap", "arcsec", np.pi / 648000.0, (0.0, 3600.0), (10.0, 90.0), TYPICAL, meaning="turn to one side"),
    )

    def element_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Secant compliance under the present moment."""
        if path.element_loads is None:
            return None
        more, torsion = path.element_zeros(), path.element(p["element"])[0].start + 5
        more[:, torsion] = p["gap"] / np.maximum(np.abs(path.element_loads[:, torsion]), SMALLEST)
        return more
