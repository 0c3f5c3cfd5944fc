"""Machine files, kinematics and limits of six-strut platforms."""

from toolpath_stiff.machine.file import load_machine, packaged_machines, parse_machine
from toolpath_stiff.machine.kinematics import Struts, forward_kinematics, joint_angles, singularity_index, solve_struts
from toolpath_stiff.machine.limits import Limit, Reach, machine_limits, reach
from toolpath_stiff.machine.model import EffectEntry, Limits, Machine, StrutLaw
from toolpath_stiff.machine.writer import machine_toml

__all__ = [
    "EffectEntry",
    "Limit",
    "Limits",
    "Machine",
    "Reach",
    "StrutLaw",
    "Struts",
    "forward_kinematics",
    "joint_angles",
    "load_machine",
    "machine_limits",
    "machine_toml",
    "packaged_machines",
    "parse_machine",
    "reach",
    "singularity_index",
    "solve_struts",
]
