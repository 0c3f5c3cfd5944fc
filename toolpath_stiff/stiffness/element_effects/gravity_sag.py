"""Gravity sag: the arm's own weight turns its joints, and the control does not know."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.elements import turns
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, Parameter, Values

TYPICAL = f"{EXPERIENCE}: all of it, or a part where the control compensates or a balancer carries"


class GravitySag(Effect):
    """Every joint that turns is off by its torsion times the moment of the weight about its axis.

    Of the machine file's torsions and masses (`[[mass]]`; without them it does nothing). It moves the pose, by some mm
    on a robot; what a pull shows, read from zero under the weight, changes by a few tenths of a per cent.
    """

    name = "gravity_sag"
    title = "the arm sags under its own weight"
    link = "joints"
    holds_for = "elements"
    unknown_to_control = True
    equation = "q_j += share c_j W_j, W_j the weight's moment about joint j, c_j its torsion"
    source = "statics; springs"
    clause = "the arm sags under its own weight by about {share} % of what its joints' torsions let it"
    parameters = (Parameter("share", "%", 0.01, (0.0, 200.0), (30.0, 100.0), TYPICAL, meaning="of the whole sag"),)

    def stands(self, machine: MachineTool, joints: FloatArray, p: Values) -> tuple[MachineTool, FloatArray]:
        """Joint values with each joint turned by its torsion under the weight."""
        if not any(map(turns, machine.elements)):
            return machine, joints
        stance, sagged, start = machine.standing(joints), np.array(joints), 0
        weight = machine.weight_loads(stance)
        for element, load in zip(machine.elements, stance.loads, strict=True):
            if turns(element):
                sagged[:, machine.joint_of(element.name)] += p["share"] * load.compliance[..., 5] * weight[:, start + 5]
            start += load.compliance.shape[-1]
        return machine, sagged
