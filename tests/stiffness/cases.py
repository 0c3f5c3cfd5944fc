"""Machines, poses and small effects that the tests of the stiffness room share."""

from __future__ import annotations

import csv
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from tests.stiffness.reference import structure_stiffness
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.machine.model import Hexapod, StrutLaw
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.contract import LoadPath
from toolpath_stiff.stiffness.effects.platform_flexibility import TIP, platform_nodes
from toolpath_stiff.stiffness.model import StiffnessModel

FloatArray = NDArray[np.float64]
AXES = ("x", "y", "z")


def table_1() -> dict[str, FloatArray]:
    """The paper's Table 1: column -> (14,), mm and N/mm."""
    text = (resources.files("toolpath_stiff") / "data" / "nist_table1.csv").read_text("utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def table_1_positions() -> FloatArray:
    """(14, 3) m, tool tips of Table 1."""
    table = table_1()
    return np.stack([table[f"{axis}_mm"] for axis in AXES], axis=1) / 1e3


def table_1_stiffness(which: str) -> FloatArray:
    """(14, 3) N/mm, "measured" or "modeled" along X, Y, Z."""
    table = table_1()
    return np.stack([table[f"{which}_{axis}_N_per_mm"] for axis in AXES], axis=1)


def nist(bars: float = np.inf) -> Hexapod:
    """The packaged machine with platform bars of that stiffness (N/m)."""
    return load_machine("nist").with_changes(platform_bar_stiffness=bars)


def random_poses(n: int, seed: int, tilt_deg: float = 25.0) -> tuple[FloatArray, FloatArray]:
    """Tips (n, 3) m in the measured part of the workspace and orientations (n, 3, 3)."""
    rng = np.random.default_rng(seed)
    position = rng.uniform([-0.3, -0.3, 0.35], [0.3, 0.3, 1.27], (n, 3))
    return position, rotation_matrices(np.radians(rng.uniform(-tilt_deg, tilt_deg, (n, 3))))


def orthogonal_hexapod(offset: float = 0.0) -> Hexapod:
    """Two struts along each axis, h = 0.2 m either side, so that every stiffness can be had by hand.

    Struts 1, 2 run along x at y = +-h, 3, 4 along y at z = +-h, 5, 6 along z at x = +-h, 1, 2 and 3 m long, 10, 20
    and 30 N/um stiff. They cross the axes at `offset` (m) above the tip, which sits at the origin.
    """
    h = 0.2
    arms = h * np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0]], dtype=float)
    axes = np.repeat(np.eye(3), 2, axis=0)
    joints = arms + np.array([0.0, 0.0, offset])
    return Hexapod(
        name="orthogonal",
        title="orthogonal hexapod",
        source="made for the tests",
        frame_joints=joints - axes * np.repeat([1.0, 2.0, 3.0], 2)[:, None],
        platform_joints=joints,
        reference_tool_length=0.1,
        strut_law=StrutLaw(1.0, 10e6, 3.0, 30e6),
    )


def compliance_of_wrenches(model: StiffnessModel, path: LoadPath) -> FloatArray:
    """(n, 6, 6) compliance of a model's tip for forces and moments."""
    return exact.respond(path, *exact.assemble_links(model, path), np.broadcast_to(np.eye(6), (len(path), 6, 6)))[0]


def wrench_compliance(machine: Hexapod, position: FloatArray, rotation: FloatArray) -> FloatArray:
    """(6, 6) compliance of the reference truss at the tip: m/N, m/(N m), rad/N, rad/(N m) blocks.

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
