"""The nominal machine, read from its TOML file by the rig's own reader.

The rig must not trust the reader of the model that it judges, so it has this one. It takes what it needs (joints,
tool, strut law, limits of strut length and swing) and refuses machine files that carry effects: what the machine
hides is the rig's to choose.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_text
from toolpath_stiff.units import m_from_mm, rad_from_deg

FloatArray = NDArray[np.float64]

# Joints of one vertex of the frame lie within this angle about the machine's axis; vertices are far more apart.
VERTEX_WIDTH = rad_from_deg(15.0)


@dataclass(frozen=True)
class Nominal:
    """What the controller believes; SI.

    Attributes
    ----------
    text
        The machine file as it stands.
    frame_joints, platform_joints
        (6, 3) m; base frame, and platform frame with the reference tool's tip as the origin.
    tool_length
        m, length of the reference tool.
    law_lengths, law_stiffnesses
        (2,) m and N/m; the stiffness of a strut is linear in its length through both points.
    strut_range
        (2,) m, shortest and longest strut.
    swing
        Largest swing (rad) of a strut at its frame and its platform joint from the neutral pose; None: unlimited.
    neutral_pose
        x, y, z (m), roll, pitch, yaw (rad).
    """

    name: str
    text: str
    frame_joints: FloatArray
    platform_joints: FloatArray
    tool_length: float
    law_lengths: FloatArray
    law_stiffnesses: FloatArray
    strut_range: tuple[float, float]
    swing: tuple[float, float] | None
    neutral_pose: FloatArray

    @property
    def vertices(self) -> NDArray[np.int64]:
        """(6,) number of the frame vertex that holds each strut, counted from 0 in the order of the struts."""
        azimuth = np.arctan2(self.frame_joints[:, 1], self.frame_joints[:, 0])
        found: list[float] = []
        numbers = np.empty(6, dtype=np.int64)
        for strut, angle in enumerate(azimuth):
            turns = [abs(math.remainder(angle - other, 2.0 * math.pi)) for other in found]
            if not turns or min(turns) > VERTEX_WIDTH:
                found.append(float(angle))
                turns.append(0.0)
            numbers[strut] = int(np.argmin(turns))
        return numbers


def load_nominal(machine: str = "nist") -> Nominal:
    """Nominal machine by the name of a packaged file or by path.

    Raises
    ------
    InputError
        There is no such file, or it lacks what the rig needs, or it carries effects.
    """
    if machine.endswith(".toml") or "/" in machine:
        return parse_nominal(read_text(machine, "the machine file"), machine)
    folder = resources.files("toolpath_stiff") / "data" / "machines"
    packaged = folder / f"{machine}.toml"
    if not packaged.is_file():
        names = sorted(Path(item.name).stem for item in folder.iterdir() if item.name.endswith(".toml"))
        raise InputError(f"no machine {machine!r}", expected=f"{', '.join(names)}, or a file ending in .toml")
    return parse_nominal(packaged.read_text("utf-8"), f"{machine}.toml")


def parse_nominal(text: str, file: str) -> Nominal:
    """Nominal machine from the text of a machine file; `file` names it in messages. Raises `InputError`."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"not a TOML file: {error}", file=file) from None
    for kind in ("effect", "instrument"):
        if table.get(kind):
            raise InputError(
                f"the machine carries [[{kind}]] already",
                expected="a nominal machine",
                hint="take the effects out; the rig adds its own hidden one",
                file=file,
            )
    bars = table.get("platform", {}).get("bar_stiffness_N_per_m", math.inf)
    if bars != math.inf:
        raise InputError(
            f"[platform] bar_stiffness_N_per_m = {bars}",
            expected="inf",
            hint="the rig's nominal platform is rigid; a flexible one is the hidden effect platform_flexibility",
            file=file,
        )
    limits = table.get("limits", {})
    angles = limits.get("joint_angle")
    lengths = limits.get("strut_length", {})
    neutral = _numbers(angles or {}, "neutral_pose_mm_deg", 6, file) if angles else np.zeros(6)
    return Nominal(
        name=str(table.get("name", "machine")),
        text=text,
        frame_joints=_joints(table, "frame_joints", file),
        platform_joints=_joints(table, "platform_joints", file),
        tool_length=m_from_mm(float(_numbers(table.get("reference_tool", {}), "length_mm", 1, file)[0])),
        law_lengths=m_from_mm(_numbers(table.get("strut_law", {}), "length_mm", 2, file)),
        law_stiffnesses=_numbers(table.get("strut_law", {}), "stiffness_N_per_um", 2, file) * 1e6,
        strut_range=(
            m_from_mm(float(_numbers(lengths, "min_mm", 1, file)[0])),
            m_from_mm(float(_numbers(lengths, "max_mm", 1, file)[0])),
        ),
        swing=None
        if angles is None
        else (
            rad_from_deg(float(_numbers(angles, "frame_max_deg", 1, file)[0])),
            rad_from_deg(float(_numbers(angles, "platform_max_deg", 1, file)[0])),
        ),
        neutral_pose=np.concatenate([m_from_mm(neutral[:3]), rad_from_deg(neutral[3:])]),
    )


def _numbers(section: dict[str, Any], key: str, count: int, file: str) -> FloatArray:
    """(count,) the numbers under a key."""
    try:
        values = np.atleast_1d(np.asarray(section.get(key), dtype=float))
    except (TypeError, ValueError):
        values = np.array([math.nan])
    if values.shape != (count,) or not np.isfinite(values).all():
        raise InputError(
            f"{key} = {section.get(key, 'missing')!r}", expected=f"{count} number{'s' * (count > 1)}", file=file
        )
    return values


def _joints(table: dict[str, Any], section: str, file: str) -> FloatArray:
    """(6, 3) m, joints given as x, y, z or as radius, angle, height."""
    content = table.get(section, {})
    rows = content.get("mm", content.get("cylindrical_mm_deg"))
    try:
        joints = np.asarray(rows, dtype=float)
    except (TypeError, ValueError):
        joints = np.empty(0)
    if joints.shape != (6, 3) or not np.isfinite(joints).all():
        raise InputError(f"[{section}] has no six joints", expected="mm or cylindrical_mm_deg, 6 rows of 3", file=file)
    if "mm" in content:
        return m_from_mm(joints)
    radius, angle, height = m_from_mm(joints[:, 0]), rad_from_deg(joints[:, 1]), m_from_mm(joints[:, 2])
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
