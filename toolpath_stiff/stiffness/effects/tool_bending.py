"""Tool bending: a slender tool bends, the longer the more."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Values, at_the_tip, compliance

SOURCE = (
    "M. Tsutsumi in Modular Design for Machine Tools, p. 446: 25 to 100 nm/N for a 45 x 160 mm arm in HSK-A63 or ISO 40"
)


class ToolBending(Effect):
    """A cantilever of one section from the spindle nose to the tip: c = l^3 / (3 E I).

    Tools are taken to be of one diameter, whatever their length; where the machine file does not say how long the
    reference tool is, the effect does nothing.
    """

    name = "tool_bending"
    title = "the tool bends, a longer one more"
    link = "tool"
    equation = "c += c_b ((l + e) / l)^3 across the tool, l = reference tool length, e = tool extension"
    source = "Euler and Bernoulli's cantilever"
    needs = ("tool_extension_mm",)
    clause = "the tool bends by about {compliance} nm/N at the reference length, a longer one by its cube"
    parameters = (compliance("compliance", 1000.0, (1.0, 100.0), SOURCE, "across the tool, at the reference length"),)

    def load_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Quadratic form of the tip force alone."""
        length = path.machine.reference_tool_length
        if not length > 0.0:
            return None
        axes, longer = path.rotation[:, :, :2], np.maximum(1.0 + path.tool_extension / length, 0.0)
        across = axes @ np.swapaxes(axes, 1, 2)
        return at_the_tip(path, (p["compliance"] * longer**3)[:, None, None] * across)
