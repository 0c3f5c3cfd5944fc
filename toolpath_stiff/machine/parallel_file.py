"""Sections shared by files of machines with six legs: limits, tool, bodies at base and tip."""

from dataclasses import replace
from typing import Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.machine.common_sections import common_fields
from toolpath_stiff.machine.elements import Element
from toolpath_stiff.machine.model import Limits
from toolpath_stiff.machine.schema import NAMES, SETUP, Key, MachineToml, Sections
from toolpath_stiff.machine.serial_elements import ELEMENT, read_elements
from toolpath_stiff.poses import pose_in_si
from toolpath_stiff.units import m_from_mm, m_from_nm

STILL: tuple[tuple[()], tuple[()]] = ((), ())  # no joints on either side, only base and tip
LENGTH = Key(unit="mm", low=0.0, open_low=True)
HEIGHT, PER_ROD = Key(unit="mm"), Key(unit="nm/N", low=0.0, high=1e7)
CORNER = Key(unit="mm", shape=(3,), required=False)
GIVE = {key: replace(ELEMENT[key], required=True) for key in ("translation_nm_per_N", "rotation_nrad_per_Nm")}
SHARED = {
    "reference_tool": {"length_mm": Key(unit="mm", low=0.0, high=2000.0)},
    "workspace": {"min_mm": CORNER, "max_mm": CORNER},
    "singularity": {"min_index": Key(low=0.0, high=1.0), "neutral_pose_mm_deg": Key(shape=(6,), required=False)},
    "setup": SETUP,
    "element[]": ELEMENT,
    "pose[]": {},
}
OPTIONAL = ("reference_tool", "workspace", "singularity", "setup")
TOP = {**NAMES, "convention": Key(text=True, required=False)}


def shared_fields(toml: MachineToml, values: Sections) -> dict[str, Any]:
    """Arguments of a machine of six legs that do not come from its own sections."""
    common = common_fields(toml, values)
    singularity, box = values.get("singularity", {}), values.get("workspace", {})
    corners = np.array([box.get("min_mm", np.full(3, -np.inf)), box.get("max_mm", np.full(3, np.inf))])
    if not (corners[0] < corners[1]).all():
        raise toml.fault("workspace", "max_mm", ": not above min_mm", expected="max_mm > min_mm in x, y and z")
    neutral = singularity.get("neutral_pose_mm_deg")
    limits = Limits(
        workspace=m_from_mm(corners), neutral_pose=common["default_origin"] if neutral is None else pose_in_si(neutral)
    )
    return {
        **common,
        "limits": limits,
        "reference_tool_length": m_from_mm(values.get("reference_tool", {}).get("length_mm", np.nan)),
        "bodies": tuple(read_elements(toml, STILL).bodies[0]),
        "least_index": singularity.get("min_index", 0.0),
    }


def axial(name: str, count: int) -> tuple[Element, ...]:
    """Struts or rods of this name, numbered from 1."""
    return tuple(Element(f"{name} {i + 1}", "struts", ("axial",)) for i in range(count))


def give_of(section: Document) -> FloatArray:
    """(6,) m/N and rad/(N m) from the keys of `GIVE`."""
    return m_from_nm(np.concatenate([section[key] for key in GIVE]))


def span(toml: MachineToml, section: str, keys: tuple[str, str], low: float, high: float) -> tuple[float, float]:
    """Two limits given in mm, in m; the first must be below the second."""
    if not low < high:
        raise toml.fault(section, keys[1], f": {high:g} is not above {low:g}", expected="min below max, in mm")
    return m_from_mm(float(low)), m_from_mm(float(high))
