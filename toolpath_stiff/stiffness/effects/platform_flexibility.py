"""Platform flexibility: the nineteen bars of the platform truss give way under the joint forces."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter, Values
from toolpath_stiff.stiffness.sizes import about
from toolpath_stiff.stiffness.truss import free_platform_flexibility
from toolpath_stiff.units import n_per_um_from_n_per_m

SOURCE = "Clinton, Zhang, Wavering (1997), Figure 3: above 1e10 N/m the bars are rigid"


class PlatformFlexibility(Effect):
    """Bars of equal stiffness k_p between joints, hub and tip."""

    name = "platform_flexibility"
    title = "flexible platform (bars of the platform truss)"
    link = "platform"
    equation = "c += l^T G l / k_p, l = (-f_i R^T u_i, R^T F): self-balanced loads on the free truss"
    source = "Clinton, Zhang, Wavering (1997), Figures 2b and 3"
    parameters = (
        Parameter(
            "bar_stiffness", "N/m", 1.0, (1e8, np.inf), (3e8, 1e10), SOURCE, np.inf, "stiffness of each platform bar"
        ),
    )

    def load_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Quadratic form of the free truss; the tool's length moves the tip node."""
        if np.isinf(p["bar_stiffness"]):
            return None
        loads = platform_loads(path)
        form = np.empty((len(path), 12, 12))
        for extension in np.unique(path.tool_extension):
            rows = path.tool_extension == extension
            joints = path.machine.platform_joints + np.array([0.0, 0.0, extension])
            flexibility = free_platform_flexibility(joints) / p["bar_stiffness"]
            form[rows] = np.swapaxes(loads[rows], 1, 2) @ flexibility @ loads[rows]
        return form

    def finding(self, p: Values) -> str:
        """Which part gives way, by how much."""
        stiffness = n_per_um_from_n_per_m(p["bar_stiffness"])
        return f"the platform is flexible: its bars have about {about(stiffness)} N/um each"


def platform_loads(path: LoadPath) -> FloatArray:
    """(n, 21, 12): joint forces -f_i R^T u_i and tip force R^T F (platform axes) per strut force and wrench."""
    loads = np.zeros((len(path), 21, 12))
    directions = path.struts.directions @ path.rotation  # rows R^T u_i
    for i in range(6):
        loads[:, 3 * i : 3 * i + 3, i] = -directions[:, i]
    loads[:, 18:, 6:9] = np.swapaxes(path.rotation, 1, 2)
    return loads
