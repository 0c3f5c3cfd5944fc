"""Rows of a measuring campaign in SI, as the simulated machine meets them."""

from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import ArrayColumns, FloatArray, TextArray

ROOM_TEMPERATURE = 20.0  # degrees C, reference temperature of length measurements (ISO 1)


@dataclass(frozen=True)
class Rows(ArrayColumns):
    """n rows of a campaign, SI.

    Attributes
    ----------
    position, angles
        (n, 3) m and rad: commanded tool tip; roll, pitch, yaw.
    direction
        (n, 3) unit vectors of the load.
    force
        (n,) N.
    extension
        (n,) m, tool longer than the reference tool.
    time
        (n,) s since the indicator was zeroed.
    elapsed
        (n,) 0 at the beginning of the campaign, 1 at its end.
    setup
        (n,) name of the clamping arrangement.
    temperature
        (n,) degrees C; None: 20 throughout.
    """

    position: FloatArray
    angles: FloatArray
    direction: FloatArray
    force: FloatArray
    extension: FloatArray
    time: FloatArray
    elapsed: FloatArray
    setup: TextArray
    temperature: FloatArray | None = None

    @property
    def warmth(self) -> FloatArray:
        """(n,) K above 20 degrees C."""
        return np.zeros(len(self.force)) if self.temperature is None else self.temperature - ROOM_TEMPERATURE
