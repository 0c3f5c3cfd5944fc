"""Load cell curvature: the load cell's signal is not in proportion to its load."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter, Values

SOURCE = (
    "0.02 to 0.1 % of full scale (senstech.co.kr, terms); overloaded, off its axis or in a bent mount: "
    "engineering experience, no source"
)
LEAST_READ = 0.05  # of the load: less is never read


class LoadCellCurvature(Effect):
    """Readings grow with the load by the same share at every pose and in every direction.

    What does not grow with the load is a change of the strut law and cannot be seen beside it.
    """

    name = "load_cell_curvature"
    title = "the load cell is curved with load"
    link = "instrument"
    holds_for = "all"
    equation = "k_read = (1 + q F) k"
    source = "the first term of a load cell's deviation from its straight line, F_read = F + q F^2"
    needs = ("force_N",)
    clause = "the load cell reads about {curvature} % too {curvature:much/little} for each kN of load"
    told_by = "known weights on the load cell, or a second load cell"
    parameters = (
        Parameter(
            "curvature", "%/kN", 1e-5, (-20.0, 20.0), (-1.0, 1.0), SOURCE, meaning="growth of the readings with load"
        ),
    )

    def reading(self, stiffness: FloatArray, path: LoadPath, p: Values) -> FloatArray:
        """Stiffness scaled by the load."""
        return np.asarray(stiffness * np.maximum(1.0 + p["curvature"] * path.force, LEAST_READ))
