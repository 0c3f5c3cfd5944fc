"""Indicator off the tip: the deflection is read, or the load acts, above the tip on the tool."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, LoadPath, Parameter, Values

MEANING = "how far above the tip, along the tool, the indicator touches (or the load acts)"
LEAST_READ = 0.05  # of the deflection: less is never read


class IndicatorOffTip(Effect):
    """The indicator reads the point r above the tip, which the platform's rotation moves by theta x r less.

    Load above the tip and indicator at it read the same (Maxwell and Betti): d^T C_vt (r x d) = (C_tv d) . (r x d).
    The rotation is that of the struts by their law; what else turns the platform is left out.
    """

    name = "indicator_off_tip"
    title = "the indicator touches above the tip"
    link = "instrument"
    equation = "F / k_read = F / k + d . (theta x r), r = R (0, 0, h), theta = rotation of the platform under F d"
    source = "rigid body; reciprocity of displacements (Maxwell 1864, Betti 1872)"
    clause = "the indicator touches about {height} mm above the tip, or the load acts there"
    told_by = "readings with the indicator at the tip itself, or a second indicator above it"
    parameters = (Parameter("height", "mm", 1e-3, (0.0, 200.0), (2.0, 50.0), EXPERIENCE, meaning=MEANING),)

    def reading(self, stiffness: FloatArray, path: LoadPath, p: Values) -> FloatArray:
        """Load over the deflection of the point that the indicator touches."""
        if path.direction is None:
            return stiffness
        jacobian, load = path.struts.jacobian, np.zeros((len(path), 6, 1))
        load[:, :3, 0] = path.direction
        stretches = np.linalg.solve(np.swapaxes(jacobian, 1, 2), load)[..., 0]
        stretches /= path.machine.strut_law.stiffness(path.struts.lengths)
        turned = np.linalg.solve(jacobian, stretches[..., None])[:, 3:, 0]
        moved = np.einsum("ni,ni->n", np.cross(turned, p["height"] * path.rotation[:, :, 2]), path.direction)
        return np.asarray(stiffness / np.maximum(1.0 + moved * stiffness, LEAST_READ))
