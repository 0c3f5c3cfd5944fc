"""Gauge scale: the readings of one direction or one set-up are off by a factor."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import EffectError
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter, Values, setup_parameter
from toolpath_stiff.stiffness.sizes import about

ALONG = 0.999  # |d_axis| from which a reading counts as taken along that axis: 2.6 degrees, no one aligns better
WHICH = "1, 2, 3: readings along X, Y, Z; 0: every direction"
SOURCE = (
    "load cells: 0.02 to 0.1 % of full scale (senstech.co.kr, terms); a wrong range or lever: "
    "engineering experience, no source"
)


class GaugeScale(Effect):
    """Readings multiplied by 1 + s where direction and set-up are the chosen ones.

    A factor on all readings is a change of the strut law and cannot be seen beside it.
    """

    name = "gauge_scale"
    title = "a gauge's readings are off by a factor"
    link = "instrument"
    holds_for = "all"
    equation = "k_read = (1 + s) k, for one direction, one set-up, or both"
    source = "wrong range, unit or lever of a force gauge or indicator"
    parameters = (
        Parameter("direction", "", 1.0, (0, 3), (1, 3), "direction of the measurements", 0.0, WHICH, "integer"),
        setup_parameter('name of the set-up; "": every one'),
        Parameter("scale", "%", 0.01, (-20.0, 20.0), (-5.0, 5.0), SOURCE, meaning="how much too high the readings are"),
    )

    def reading(self, stiffness: FloatArray, path: LoadPath, p: Values) -> FloatArray:
        """Stiffness scaled where the gauge was used."""
        used = np.ones(len(stiffness), dtype=bool)
        if p["direction"]:
            if path.direction is None:
                raise EffectError("gauge_scale needs the direction of each reading")
            used &= np.abs(path.direction[:, int(p["direction"]) - 1]) >= ALONG
        if p["setup"]:
            used &= path.setup == p["setup"] if path.setup is not None else False
        return np.where(used, (1.0 + p["scale"]) * stiffness, stiffness)

    def finding(self, p: Values) -> str:
        """Clause on which readings are off, to which side, and by how much."""
        where = f" along {'XYZ'[p['direction'] - 1]}" if p["direction"] else ""
        where += f" in set-up {p['setup']}" if p["setup"] else ""
        return f"readings{where} are about {about(p['scale'])} % too {'high' if p['scale'] > 0.0 else 'low'}"
