"""Tool length error: the tool is longer than the control believes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.machine.model import Machine
from toolpath_stiff.stiffness.effects.contract import Effect, Parameter

FloatArray = NDArray[np.float64]


class ToolLengthError(Effect):
    """The platform stands where the control puts it; the true tip, where the load acts, lies further along the tool."""

    name = "tool_length_error"
    title = "a wrong tool length was entered"
    link = "geometry"
    equation = "r_i += R (0, 0, e), tip -= R (0, 0, e): the struts stay, their arms about the tip grow"
    source = "geometry"
    parameters = (
        Parameter(
            name="error",
            unit="mm",
            si=1e-3,
            bounds=(-60.0, 60.0),
            typical=(-10.0, 10.0),
            source="engineering experience, no source: the tool of the neighbouring pocket",
            meaning="true tool length less the entered one",
        ),
    )

    def tip_offset(self, p: Mapping[str, float]) -> FloatArray | None:
        """The true tip lies below the programmed one."""
        return np.array([0.0, 0.0, -p["error"]])

    def geometry(self, machine: Machine, p: Mapping[str, float]) -> Machine:
        """Platform joints further above the tip."""
        return machine.with_changes(platform_joints=machine.platform_joints + np.array([0.0, 0.0, p["error"]]))
