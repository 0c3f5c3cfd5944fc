"""An effect of one's own: whatever falsifies readings along X in proportion to x."""

import numpy as np

from toolpath_stiff.stiffness.effects import Effect, Parameter

SOURCE = "assumed: the residuals of one campaign"


class DragAlongX(Effect):
    """Something pulls along X, harder the farther the platform is from the axis, and the gauge reads it."""

    name = "drag_along_x"
    title = "a pull along X in proportion to x"
    link = "instrument"
    equation = "k_read = k (1 + s x / 300 mm) along X"
    source = SOURCE
    parameters = (Parameter("scale", "%", 0.01, (-50.0, 50.0), (-20.0, 20.0), SOURCE, meaning="change at x = 300 mm"),)

    def reading(self, stiffness, path, p):
        """What the gauge shows for a true stiffness, N/m."""
        along_x = np.abs(path.direction[:, 0])
        return stiffness * (1.0 + p["scale"] * along_x * path.position[:, 0] / 0.3)
