"""Figures of a machine of elements: joints and their limits, compliant elements, other limits, set-up."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.elements import Spring
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.units import deg_from_rad, mm_from_m, nm_from_m

Row = tuple[str, str, str, str]  # section, quantity, value, unit


def element_rows(machine: MachineTool) -> list[Row]:
    """Rows of its joints and elements; compliances that change with the pose are those at the neutral pose."""
    rows: list[Row] = []
    for name, kind, ends in zip(machine.joint_names, machine.joint_kinds, machine.joint_limits, strict=True):
        linear = kind == "linear"
        low, high = (mm_from_m if linear else deg_from_rad)(np.asarray(ends))
        rows.append(("limits", f"{name} from, to", f"{low:g}, {high:g}", "mm" if linear else "deg"))
    neutral = np.array([machine.limits.neutral_pose[:3]])
    for element, load in zip(machine.elements, machine.solve(neutral).loads, strict=True):
        values = nm_from_m(np.broadcast_to(load.compliance, (1, load.compliance.shape[-1]))[0])
        quantity = f"{element.name} ({element.link})"
        if isinstance(load, Spring):
            rows += [
                ("element", f"{quantity} {word}", _numbers(part), unit)
                for word, part, unit in (("along", values[:3], "nm/N"), ("about", values[3:], "nrad/(N m)"))
                if part.any()
            ]
        else:
            rows.append(("element", quantity, _numbers(values), "nm/N"))
    for name, least in zip(machine.singularity_names, machine.singularity_margins, strict=True):
        rows.append(("singularity", f"{name} at least", f"{least:g}", ""))
    return rows


def _numbers(values: FloatArray) -> str:
    return ", ".join(f"{value:.4g}" for value in values)
