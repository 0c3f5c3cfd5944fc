"""Stand compliance: the stand of the indicator gives way and is read as the machine."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, LoadPath, Values, compliance, rocking


class StandCompliance(Effect):
    """A deflection in proportion to the load, sideways alike in X and Y, that is not the machine's.

    A column that tilts on its foot, below the tip, reads it sideways by the square of its height, counted from the base
    frame's origin. A table or a frame that gives way alike reads the same: no reading of the tip can tell them apart.
    """

    name = "stand_compliance"
    title = "the indicator's stand gives way"
    link = "instrument"
    holds_for = "all"
    equation = "1 / k_read = 1 / k + (c_h + c_t z^2) (d_x^2 + d_y^2) + c_v d_z^2"
    source = "springs in series, base axes; a stand that also takes the load"
    clause = "the stand of the indicator gives way by about {sizes}"
    parts = (
        ("sideways", "nm/N sideways"),
        ("vertical", "nm/N vertically"),
        ("tilting", "nrad/(N m) in tilting"),
    )
    told_by = "an indicator on another stand, or between the table and the floor"
    parameters = (
        compliance("sideways", 200.0, (1.0, 10.0), EXPERIENCE, "compliance of the stand along X and Y"),
        compliance("vertical", 200.0, (1.0, 10.0), EXPERIENCE, "compliance of the stand along Z"),
        rocking("tilting", EXPERIENCE, "rotation of its foot per moment"),
    )

    def reading(self, stiffness: FloatArray, path: LoadPath, p: Values) -> FloatArray:
        """Load over the deflection, with the stand's added."""
        if path.direction is None:
            return stiffness
        x, y, z = path.direction.T**2
        along = (p["sideways"] + p["tilting"] * path.position[:, 2] ** 2) * (x + y) + p["vertical"] * z
        return np.asarray(stiffness / (1.0 + along * stiffness))
