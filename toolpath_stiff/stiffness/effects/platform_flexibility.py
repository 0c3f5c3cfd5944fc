"""Platform flexibility: the nineteen bars of the platform truss give way under the joint forces.

The paper's platform is a pin-jointed truss. Nodes 0 to 5 are the platform joints, 6 the hub (where the tool axis meets
the plane of the joints), 7 the tool tip. 19 bars: 6 rim bars between neighbouring joints, 6 spokes to the hub, 6 from
joint to tip, 1 from hub to tip (Clinton, Zhang, Wavering 1997, Figure 2b and "twenty-five elements" with the struts).
"""

from functools import lru_cache

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import EffectError
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter, Values
from toolpath_stiff.stiffness.sizes import about
from toolpath_stiff.units import n_per_um_from_n_per_m

HUB, TIP = 6, 7
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
        """Clause on the stiffness of the bars."""
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


def platform_nodes(platform_joints: FloatArray) -> FloatArray:
    """(8, 3) m, nodes of the truss in the platform frame with the tip at the origin.

    `platform_joints` (6, 3) m, relative to the tip. The hub lies on the tool axis at the joints' mean height.
    """
    return np.vstack([platform_joints, [0.0, 0.0, platform_joints[:, 2].mean()], np.zeros(3)])


def platform_bars(platform_joints: FloatArray) -> list[tuple[int, int]]:
    """The 19 bars as pairs of nodes; the rim joins joints that are neighbours in angle about the tool axis."""
    order = np.argsort(np.arctan2(platform_joints[:, 1], platform_joints[:, 0]), kind="stable")
    rim = [(int(order[i]), int(order[(i + 1) % 6])) for i in range(6)]
    return [*rim, *((i, HUB) for i in range(6)), *((i, TIP) for i in range(6)), (HUB, TIP)]


def free_platform_flexibility(platform_joints: FloatArray) -> FloatArray:
    """Flexibility of the free platform truss for bars of 1 N/m: (21, 21), 1/(N/m) relative to that.

    Loads l are the forces on the six joints and on the tip, in platform axes (18 + 3 components); l^T G l is twice
    the energy stored, for bars of unit stiffness. Loads that do not balance are first balanced by the smallest joint
    forces that do so: a moment at the tip, or what springs parallel to the struts carry, enters that way. For
    balanced loads (forces at the tip alone, pin-jointed struts) this changes nothing.

    Raises
    ------
    InputError
        Two joints coincide, or the bars form a mechanism, so that this truss cannot stand for the platform.
    """
    return _free_flexibility(np.asarray(platform_joints, dtype=float).tobytes())


@lru_cache(maxsize=64)  # a fit evaluates the same joints at every size of the bars
def _free_flexibility(joints: bytes) -> FloatArray:
    """`free_platform_flexibility` of six joints, as one read-only array."""
    platform_joints = np.frombuffer(joints).reshape(6, 3)
    nodes = platform_nodes(platform_joints)
    first, last = np.array(platform_bars(platform_joints)).T
    bars, each = nodes[last] - nodes[first], np.arange(len(first))
    ends = np.zeros((len(first), len(nodes), 3))  # stretch of a bar by motions of its ends
    with np.errstate(invalid="ignore"):  # a bar without a length
        ends[each, last] = bars / np.linalg.norm(bars, axis=1, keepdims=True)
    ends[each, first] = -ends[each, last]
    stretch = ends.reshape(len(first), -1)
    motions = np.zeros((len(nodes), 3, 6))  # for unit translations and unit rotations about the tip
    motions[:, :, :3] = np.eye(3)
    motions[:, :, 3:] = np.swapaxes(np.cross(np.eye(3), nodes[:, None]), 1, 2)
    rigid = motions.reshape(-1, 6)
    basis, _ = np.linalg.qr(rigid)
    # Springs on the rigid motions alone: balanced loads do not feel them, and the matrix can be inverted.
    held = stretch.T @ stretch + basis @ basis.T
    if not np.linalg.cond(held) < 1e10:
        raise EffectError(
            "the platform truss is a mechanism: its bars do not lock the joints and the tip, or one has no length",
            hint="set bar_stiffness_N_per_m = inf (a rigid platform)",
        )
    loaded = np.r_[0:18, 21:24]
    flexibility, balance, arms = np.linalg.inv(held)[np.ix_(loaded, loaded)], np.eye(21), rigid[:18]
    resultants = rigid[loaded].T  # (6, 21): total force and moment about the tip
    balance[:18] -= arms @ np.linalg.solve(arms.T @ arms, resultants)
    loaded_flexibility = np.asarray(balance.T @ flexibility @ balance)
    loaded_flexibility.flags.writeable = False
    return loaded_flexibility
