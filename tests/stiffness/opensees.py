"""The nist machine built again in OpenSees, by hand: joints at 30, 90, ... 330 degrees, hub, tip; 25 bars."""

import importlib
from typing import Any

import numpy as np

from toolpath_stiff.machine.model import Hexapod

RIM = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0)]
BARS = RIM + [(i, 6) for i in range(6)] + [(i, 7) for i in range(6)] + [(6, 7)]


def compliance(machine: Hexapod, tip: np.ndarray, turn: np.ndarray, bar_stiffness: float) -> np.ndarray:
    """Compliance (3, 3) of the tip, m/N, with platform bars of a stiffness in N/m."""
    ops: Any = importlib.import_module("openseespy.opensees")  # its functions are unknown to a type checker
    nodes = [*(tip + turn @ joint for joint in machine.platform_joints), tip + turn @ [0.0, 0.0, 0.29697], tip]
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 3)
    for tag, node in enumerate([*nodes, *machine.frame_joints]):
        ops.node(tag, *(float(value) for value in node))
    for tag in range(8, 14):
        ops.fix(tag, 1, 1, 1)
    ops.uniaxialMaterial("Elastic", 1, 1.0)
    ends = [(i, j, bar_stiffness) for i, j in BARS]
    for i in range(6):
        length = np.linalg.norm(nodes[i] - machine.frame_joints[i])
        ends.append((8 + i, i, 46.5e6 + (length - 2.5616) * (32.5e6 - 46.5e6) / (3.2132 - 2.5616)))
    for tag, (i, j, stiffness) in enumerate(ends):
        start, end = np.array(ops.nodeCoord(i)), np.array(ops.nodeCoord(j))
        ops.element("Truss", tag, i, j, float(stiffness * np.linalg.norm(end - start)), 1)
    ops.system("FullGeneral")
    ops.numberer("Plain")
    ops.constraints("Plain")
    ops.integrator("LoadControl", 1.0)
    ops.algorithm("Linear")
    ops.analysis("Static")
    columns = np.empty((3, 3))
    for axis in range(3):
        ops.timeSeries("Constant", axis + 1)
        ops.pattern("Plain", axis + 1, axis + 1)
        ops.load(7, *(1.0 if k == axis else 0.0 for k in range(3)))
        assert ops.analyze(1) == 0
        columns[:, axis] = ops.nodeDisp(7)
        ops.remove("loadPattern", axis + 1)
    ops.wipe()
    return columns
