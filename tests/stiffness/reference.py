"""The paper's direct stiffness method: a solver of 25 elements, which the exact route is held against.

As plain as can be, one pose at a time: struts and bars are pin-jointed truss elements (Armenakas 1991; the paper's
equations 2 and 3). Assemble, apply a force at the tool tip, solve by Gaussian elimination, k = F / x (equation 4). It
knows neither effects nor batches. Nodes as in `platform_flexibility`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.stiffness.effects.platform_flexibility import TIP, platform_bars, platform_nodes


def structure_stiffness(machine: Hexapod, position: ArrayLike, rotation: ArrayLike) -> FloatArray:
    """Structure stiffness matrix at one pose, (24, 24) N/m; nodes as in the module's heading, base axes.

    Parameters
    ----------
    machine
        Its platform bars must have a finite stiffness.
    position
        (3,) m, tool tip.
    rotation
        (3, 3) orientation of the platform.
    """
    bar_stiffness = machine.platform_bar_stiffness
    assert np.isfinite(bar_stiffness)
    nodes = np.asarray(position, dtype=float) + platform_nodes(machine.platform_joints) @ np.asarray(rotation).T
    structure = np.zeros((24, 24))
    for i, j in platform_bars(machine.platform_joints):
        block = bar_stiffness * axis_products(nodes[i], nodes[j])
        at_i, at_j = slice(3 * i, 3 * i + 3), slice(3 * j, 3 * j + 3)
        structure[at_i, at_i] += block
        structure[at_j, at_j] += block
        structure[at_i, at_j] -= block
        structure[at_j, at_i] -= block
    law = machine.strut_law
    for i in range(6):
        strut = nodes[i] - machine.frame_joints[i]
        length = np.sqrt(strut @ strut)
        stiffness = law.stiffness(length)
        # The frame joint is held, so only the platform joint's block enters.
        at_i = slice(3 * i, 3 * i + 3)
        structure[at_i, at_i] += stiffness * axis_products(machine.frame_joints[i], nodes[i])
    return structure


def axis_products(start: FloatArray, end: FloatArray) -> FloatArray:
    """(3, 3) c_i c_j of an element's direction cosines c.

    Times E A / L they are the blocks [[+, -], [-, +]] of a truss element in global coordinates (equation 3).
    """
    axis = end - start
    return np.asarray(np.outer(axis, axis) / (axis @ axis))


def tip_compliance(machine: Hexapod, position: ArrayLike, rotation: ArrayLike) -> FloatArray:
    """(3, 3) m/N, displacements of the tip under unit forces along x, y, z."""
    loads = np.zeros((24, 3))
    loads[3 * TIP : 3 * TIP + 3] = np.eye(3)
    displacements = np.linalg.solve(structure_stiffness(machine, position, rotation), loads)
    return np.asarray(displacements[3 * TIP : 3 * TIP + 3])
