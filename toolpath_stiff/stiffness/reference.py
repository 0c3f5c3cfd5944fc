"""The reference solver: the paper's 25-element direct stiffness method, one pose at a time, as plain as can be.

Six struts and the nineteen bars of the platform truss (`platform_truss`) are pin-jointed truss elements
(Armenakas 1991; the paper's equations 2 and 3). Assemble, apply a force at the tool tip, solve by Gaussian
elimination, k = F / x (equation 4). It knows neither effects nor batches: it exists to test the exact route.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.stiffness.platform_truss import TIP, platform_bars, platform_nodes

FloatArray = NDArray[np.float64]


def structure_stiffness(machine: Machine, position: ArrayLike, rotation: ArrayLike) -> FloatArray:
    """Structure stiffness matrix at one pose, (24, 24) N/m; nodes as in `platform_truss`, base axes.

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
    if not np.isfinite(bar_stiffness):
        raise InputError(
            "the reference solver cannot take rigid platform bars",
            expected="a finite bar stiffness",
            hint="use 1e12 N/m, which lowers the tip stiffness by 5e-5",
        )
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
        stiffness = law.stiffness_1 + law.slope * (length - law.length_1)
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


def tip_compliance(machine: Machine, position: ArrayLike, rotation: ArrayLike) -> FloatArray:
    """(3, 3) m/N, displacements of the tip under unit forces along x, y, z."""
    loads = np.zeros((24, 3))
    loads[3 * TIP : 3 * TIP + 3] = np.eye(3)
    displacements = np.linalg.solve(structure_stiffness(machine, position, rotation), loads)
    return np.asarray(displacements[3 * TIP : 3 * TIP + 3])


def wrench_compliance(machine: Machine, position: ArrayLike, rotation: ArrayLike) -> FloatArray:
    """(6, 6) compliance of the tip: m/N, m/(N m), rad/N, rad/(N m) blocks.

    A truss node has no rotation, so a moment acts through the smallest forces on the six platform joints that
    add up to it, and the tip's rotation is its work-conjugate, the least-squares rotation of the six joints.
    """
    joints = platform_nodes(machine.platform_joints)[:6] @ np.asarray(rotation).T
    arms = joints - joints.mean(axis=0)
    inertia = sum(((arm @ arm) * np.eye(3) - np.outer(arm, arm) for arm in arms), np.zeros((3, 3)))
    loads = np.zeros((24, 6))
    loads[3 * TIP : 3 * TIP + 3, :3] = np.eye(3)
    for column in range(3):
        turn = np.linalg.solve(inertia, np.eye(3)[column])
        for i, arm in enumerate(arms):
            loads[3 * i : 3 * i + 3, 3 + column] = np.cross(turn, arm)
    structure = structure_stiffness(machine, position, rotation)
    return np.asarray(loads.T @ np.linalg.solve(structure, loads))
