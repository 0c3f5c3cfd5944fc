"""The paper's platform: a pin-jointed truss, which the effect `platform_flexibility` uses by itself.

Nodes 0 to 5 are the platform joints, 6 the hub (where the tool axis meets the plane of the joints), 7 the tool
tip. 19 bars: 6 rim bars between neighbouring joints, 6 spokes to the hub, 6 from joint to tip, 1 from hub to tip
(Clinton, Zhang, Wavering 1997, Figure 2b and "twenty-five elements" with the six struts).
"""

from functools import lru_cache

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import EffectError

HUB, TIP = 6, 7


def platform_nodes(platform_joints: FloatArray) -> FloatArray:
    """(8, 3) m, nodes of the truss in the platform frame with the tip at the origin.

    `platform_joints` (6, 3) m, relative to the tip. The hub lies on the tool axis at the joints' mean height.
    """
    hub = np.array([0.0, 0.0, platform_joints[:, 2].mean()])
    return np.vstack([platform_joints, hub, np.zeros(3)])


def platform_bars(platform_joints: FloatArray) -> list[tuple[int, int]]:
    """The 19 bars as pairs of nodes; the rim joins joints that are neighbours in angle about the tool axis."""
    order = np.argsort(np.arctan2(platform_joints[:, 1], platform_joints[:, 0]), kind="stable")
    rim = [(int(order[i]), int(order[(i + 1) % 6])) for i in range(6)]
    spokes = [(i, HUB) for i in range(6)]
    legs = [(i, TIP) for i in range(6)]
    return [*rim, *spokes, *legs, (HUB, TIP)]


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


@lru_cache(maxsize=64)  # a fit asks for the same joints at every size of the bars
def _free_flexibility(joints: bytes) -> FloatArray:
    """`free_platform_flexibility` of six joints, as one array that nobody writes to."""
    platform_joints = np.frombuffer(joints).reshape(6, 3)
    nodes = platform_nodes(platform_joints)
    stiffness = np.zeros((24, 24))
    for i, j in platform_bars(platform_joints):
        bar = nodes[j] - nodes[i]
        length = np.linalg.norm(bar)
        if length < 1e-9:
            raise EffectError(
                f"platform nodes {i + 1} and {j + 1} coincide, so the platform truss has a bar of no length",
                hint="set bar_stiffness_N_per_m = inf (a rigid platform)",
            )
        unit = bar / length
        ends = np.zeros(24)
        ends[3 * i : 3 * i + 3], ends[3 * j : 3 * j + 3] = -unit, unit
        stiffness += np.outer(ends, ends)
    rigid = _rigid_motions(nodes)
    basis, _ = np.linalg.qr(rigid)
    # Springs on the rigid motions alone: balanced loads do not feel them, and the matrix can be inverted.
    held = stiffness + basis @ basis.T
    if np.linalg.cond(held) > 1e10:
        raise EffectError(
            "the platform truss is a mechanism: its bars do not lock the joints and the tip",
            hint="set bar_stiffness_N_per_m = inf (a rigid platform)",
        )
    loaded = np.r_[0:18, 21:24]
    flexibility = np.linalg.inv(held)[np.ix_(loaded, loaded)]
    balance = np.eye(21)
    resultants = rigid[loaded].T  # (6, 21): total force and moment about the tip
    arms = rigid[:18]  # (18, 6)
    balance[:18] -= arms @ np.linalg.solve(arms.T @ arms, resultants)
    loaded_flexibility = np.asarray(balance.T @ flexibility @ balance)
    loaded_flexibility.flags.writeable = False
    return loaded_flexibility


def _rigid_motions(nodes: FloatArray) -> FloatArray:
    """(3 N, 6) displacements of the nodes for unit translations and unit rotations about the tip."""
    motions = np.zeros((3 * len(nodes), 6))
    for i, node in enumerate(nodes):
        rows = slice(3 * i, 3 * i + 3)
        motions[rows, :3] = np.eye(3)
        motions[rows, 3:] = np.cross(np.eye(3), node).T
    return motions
