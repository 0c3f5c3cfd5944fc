"""Stand compliance: the stand that holds indicator and load gives way and is read as the machine."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, LoadPath, Values, compliance


class StandCompliance(Effect):
    """A deflection in proportion to the load, sideways alike in X and Y, that is not the machine's.

    A table of the same compliance reads the same: which of the two it is no reading of the tip can tell.
    """

    name = "stand_compliance"
    title = "the indicator's stand gives way"
    link = "instrument"
    equation = "1 / k_read = 1 / k + c_h (d_x^2 + d_y^2) + c_v d_z^2"
    source = "springs in series, base axes; a stand that also takes the load"
    clause = "the stand of the indicator gives way by about {sizes}"
    parts = (("sideways", "nm/N sideways"), ("vertical", "nm/N vertically"))
    told_by = "an indicator on another stand, or between the table and the floor"
    parameters = (
        compliance("sideways", 200.0, (1.0, 10.0), EXPERIENCE, "compliance of the stand along X and Y"),
        compliance("vertical", 200.0, (1.0, 10.0), EXPERIENCE, "compliance of the stand along Z"),
    )

    def reading(self, stiffness: FloatArray, path: LoadPath, p: Values) -> FloatArray:
        """Load over the deflection with the stand's."""
        if path.direction is None:
            return stiffness
        along = path.direction**2 @ np.array([p["sideways"], p["sideways"], p["vertical"]])
        return np.asarray(stiffness / (1.0 + along * stiffness))
