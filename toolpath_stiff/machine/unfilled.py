"""Machine files from descriptions without stiffness: geometry and limits as read, compliances left to fill in."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.machine.chain import FixedFrame
from toolpath_stiff.machine.writer import toml_text, value_text
from toolpath_stiff.rotations import roll_pitch_yaw
from toolpath_stiff.units import deg_from_rad, mm_from_m

EXPERIENCE = "engineering experience, no source"
# Typical values with their sources: comments in the file, never figures of the machine.
JOINTS = f"""[[element]]
name = "joints"
type = "joint"
# One number a rotary joint. Typical of robots of 100 to 300 kg payload: 200 to 800 of the first three, 1000 to 5000 of
# the wrist ({EXPERIENCE}). How to measure yours: Dumas, Caro, Garnier, Furet, Robotics and Computer-Integrated
# Manufacturing 27 (2011) 881. bending_nrad_per_Nm, about both other axes, may be added: a third of these.
# torsion_nrad_per_Nm = []"""
SPRING = f"""# Typical of a carriage on preloaded guides: 2 to 5 across, 5 to 15 along the screw, rotations of 20 to 60
# ({EXPERIENCE}).
# centre_mm = []
# translation_nm_per_N = []
# rotation_nrad_per_Nm = []"""
SPINDLE = f"""[[element]]
name = "spindle"
type = "spring"
at = "tip"
# Typical, with holder and tool: 5 to 15 across, 3 to 6 along the axis ({EXPERIENCE}).
# translation_nm_per_N = []
rotation_nrad_per_Nm = [0.0, 0.0, 0.0]"""


def section(heading: str, values: Document) -> str:
    """Section of a machine file, "[name]" or "[[name]]", "" for the keys above all; None marks values to fill in."""
    rows = [f"# {key} =" if value is None else f"{key} = {value_text(value)}" for key, value in values.items()]
    return "\n".join([heading, *rows] if heading else rows)


def file_text(name: str, kind: str, source: str, notes: Sequence[str], parts: Sequence[str]) -> str:
    """Text of a machine file."""
    top = [
        *(f"# {note}" for note in notes),
        "# Fill in what is commented out below: no stiffness is known, nor what is missing.",
    ]
    top += [f"name = {toml_text(name)}", f'kind = "{kind}"', f"source = {toml_text(source)}"]
    return "\n\n".join(["\n".join(top), *parts]) + "\n"


def axis_row(name: str, linear: bool, place: Document, limits: FloatArray | None, side: str = "tool") -> str:
    """One `[[axis]]`, with limits in m or rad; None: to be filled in; -inf and inf: none."""
    unit, kind = ("mm", "linear") if linear else ("deg", "rotary")
    ends = (None, None) if limits is None else (mm_from_m if linear else deg_from_rad)(np.asarray(limits)).tolist()
    keys = {"name": name, "type": kind, **({"side": side} if side != "tool" else {}), **place}
    return section("[[axis]]", {**keys, f"min_{unit}": ends[0], f"max_{unit}": ends[1]})


def place_keys(place: FixedFrame, axis: FloatArray) -> Document:
    """Keys of an axis with this placement in the previous frame."""
    angles = roll_pitch_yaw(place.axes)
    turned = {"rpy_deg": deg_from_rad(angles)} if angles.any() else {}
    return {"xyz_mm": mm_from_m(place.origin), **turned, "axis": axis}


def tool_section(tip: FixedFrame) -> str:
    """`[tool]` section for a tip in the last frame."""
    keys = {"tip_mm": mm_from_m(tip.origin), "x_axis": tip.axes[:, 0], "z_axis": tip.axes[:, 2]}
    return "# z_axis runs from the tip to the shank: check it.\n" + section("[tool]", keys)


def carriages(names: Sequence[tuple[str, str]]) -> list[str]:
    """Springs of the axes (name, side), to be filled in."""
    parts = []
    for name, side in names:
        keys = {"name": f"{name} axis", "type": "spring", "side": side, "frame": name}
        parts.append(f"{section('[[element]]', keys)}\n{SPRING}")
    return parts
