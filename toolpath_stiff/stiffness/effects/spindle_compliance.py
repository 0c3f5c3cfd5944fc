"""Spindle compliance: shaft, bearings, holder and tool give way between platform and tip."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Values, at_the_tip, compliance

RADIAL = (
    "FAG spindle bearing catalogue, pairs 7014 to 7020: 0.4 to 1.8 nm/N at the bearings; M. Tsutsumi in "
    "Modular Design for Machine Tools, p. 446: 25 to 100 nm/N for a 45 x 160 mm arm in HSK-A63 or ISO 40"
)
AXIAL = "FAG spindle bearing catalogue, pairs 7014 to 7020, medium preload: 127 to 387 N/um"


class SpindleCompliance(Effect):
    """A spring of radial and axial compliance at the tip, in platform axes.

    The figures are those at the tip of the tool in use. How much a longer tool bends is not modelled: it depends on
    the tool's shape, which no machine file knows.
    """

    name = "spindle_compliance"
    title = "spindle, holder and tool give way"
    link = "tool"
    holds_for = "all"
    equation = "c += (R^T d)^T diag(c_r, c_r, c_a) (R^T d)"
    source = "springs in series; the load's components in platform axes"
    clause = "spindle, holder and tool give way by about {sizes} the tool axis"
    parts = (("radial", "nm/N across"), ("axial", "nm/N along"))
    parameters = (
        compliance("radial", 1000.0, (1.0, 30.0), RADIAL, "compliance across the tool axis"),
        compliance("axial", 1000.0, (2.6, 7.9), AXIAL, "compliance along the tool axis"),
    )

    def load_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Quadratic form of the tip force alone."""
        on_platform = np.diag([p["radial"], p["radial"], p["axial"]])
        return at_the_tip(path, path.rotation @ on_platform @ np.swapaxes(path.rotation, 1, 2))
