"""Thermal drift: the indicator wanders while the load is applied."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter, Values

SOURCE = "engineering experience, no source: a steel strut of 3 m grows 35 um/K, rooms change by 1 K/h"


class ThermalDrift(Effect):
    """A displacement that grows with the time since the indicator was zeroed is read as deflection."""

    name = "thermal_drift"
    title = "the indicator drifts while it is read"
    link = "instrument"
    holds_for = "all"
    equation = "F / k_read = F / k + rate time"
    source = "growth of the loop between work and tip at a constant rate"
    needs = ("time_min",)
    clause = "the indicator drifts by about {rate} um/min towards {rate:larger/smaller} deflection while it is read"
    parameters = (
        Parameter(
            "rate", "um/min", 1e-6 / 60.0, (-20.0, 20.0), (-1.0, 1.0), SOURCE, meaning="drift towards larger deflection"
        ),
    )

    def reading(self, stiffness: FloatArray, path: LoadPath, p: Values) -> FloatArray:
        """Force over the deflection as read; nan where drift against the load cancels the whole deflection."""
        if path.time is None:
            return stiffness
        deflection = path.force / stiffness + p["rate"] * path.time
        return np.where(deflection > 0.0, path.force / np.where(deflection > 0.0, deflection, 1.0), np.nan)
