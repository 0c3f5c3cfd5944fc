"""The nominal machine, read from its TOML file by the rig's own reader.

The rig must not trust the reader of the model that it judges, so it has this one. It takes what it needs (joints,
tool, strut law, limits of strut length and swing) and refuses machine files that carry effects: what the machine
hides is the rig's to choose.
"""

import math
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_text
from toolpath_stiff.toml_reader import TomlReader
from toolpath_stiff.units import m_from_mm, n_per_m_from_n_per_um, rad_from_deg

# Joints of one vertex of the frame lie within this angle about the machine's axis; vertices are far more apart.
VERTEX_WIDTH = rad_from_deg(15.0)


@dataclass(frozen=True)
class Nominal:
    """The machine as the controller believes it to be; SI.

    Attributes
    ----------
    text
        The machine file as given.
    frame_joints, platform_joints
        (6, 3) m; base frame, and platform frame with the reference tool's tip as the origin.
    tool_length
        m, length of the reference tool.
    law_lengths, law_stiffnesses
        (p,) m and N/m; the stiffness of a strut is linear in its length between two points, and along the first and the
        last two outside. One point: the same at every length.
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
    def law_ends(self) -> tuple[float, float]:
        """Shortest and longest strut for which the law is given, m; for a law of one point, the travel."""
        if len(self.law_lengths) == 1:
            return self.strut_range
        return float(self.law_lengths[0]), float(self.law_lengths[-1])

    @property
    def corners(self) -> int:
        """Number of the frame's vertices."""
        return int(self.vertices.max()) + 1

    @property
    def vertices(self) -> IntArray:
        """(6,) number of the frame vertex that holds each strut, counted from 0 in the order of the struts."""
        azimuth = np.arctan2(self.frame_joints[:, 1], self.frame_joints[:, 0])
        apart = np.abs(np.mod(azimuth[:, None] - azimuth + np.pi, 2.0 * np.pi) - np.pi)
        first = (apart <= VERTEX_WIDTH).argmax(axis=1)
        return np.asarray(np.unique(first, return_inverse=True)[1], dtype=np.int64)


def load_nominal(machine: str = defaults.MACHINE) -> Nominal:
    """Nominal machine by the name of a packaged file or by path.

    Raises
    ------
    InputError
        There is no such file, or it lacks what the rig needs, or it carries effects.
    """
    if machine.endswith(".toml") or "/" in machine:
        return parse_nominal(read_text(machine, "the machine file"), machine)
    folder = resources.files("toolpath_stiff") / "data" / "machines"
    names = sorted(Path(item.name).stem for item in folder.iterdir() if item.name.endswith(".toml"))
    if machine not in names:
        raise InputError(f"no machine {machine!r}", expected=f"{', '.join(names)}, or a file ending in .toml")
    return parse_nominal((folder / f"{machine}.toml").read_text("utf-8"), f"{machine}.toml")


def parse_nominal(text: str, file: str) -> Nominal:
    """Nominal machine from the text of a machine file; `file` names it in messages. Raises `InputError`."""
    toml = TomlReader(text, file)
    for kind in ("effect", "instrument"):
        if toml.data.get(kind):
            hint = "take the effects out; the rig adds its own hidden one"
            raise toml.error(f"the machine carries [[{kind}]] already", "a nominal machine", hint, where=kind)
    where = "platform.bar_stiffness_N_per_m"
    if (bars := _value(toml, where)) not in (None, math.inf):
        hint = "the rig's nominal platform is rigid; a flexible one is the hidden effect platform_flexibility"
        raise toml.error(f"{where} = {bars}", "inf", hint, where=where)
    if _value(toml, "strut_law.length_mm") is None:  # the same at every length
        lengths, stiffnesses = np.zeros(1), _numbers(toml, "strut_law.stiffness_N_per_um")[None]
    else:
        lengths = m_from_mm(_numbers(toml, "strut_law.length_mm", -1))
        stiffnesses = _numbers(toml, "strut_law.stiffness_N_per_um", len(lengths))
        if len(lengths) < 2 or (len(lengths) > 2 and not (np.diff(lengths) > 0.0).all()):
            raise toml.error("strut_law.length_mm", "two or more lengths, rising", where="strut_law.length_mm")
    swing, neutral = None, np.zeros(6)
    if _value(toml, "limits.joint_angle"):
        neutral = _numbers(toml, "limits.joint_angle.neutral_pose_mm_deg", 6)
        frame, platform = (_numbers(toml, f"limits.joint_angle.{end}_max_deg") for end in ("frame", "platform"))
        swing = rad_from_deg(float(frame)), rad_from_deg(float(platform))
    shortest, longest = (_numbers(toml, f"limits.strut_length.{end}_mm") for end in ("min", "max"))
    return Nominal(
        name=str(toml.data.get("name", "machine")),
        text=text,
        frame_joints=_joints(toml, "frame_joints"),
        platform_joints=_joints(toml, "platform_joints"),
        tool_length=m_from_mm(float(_numbers(toml, "reference_tool.length_mm"))),
        law_lengths=lengths,
        law_stiffnesses=n_per_m_from_n_per_um(stiffnesses),
        strut_range=(m_from_mm(float(shortest)), m_from_mm(float(longest))),
        swing=swing,
        neutral_pose=np.concatenate([m_from_mm(neutral[:3]), rad_from_deg(neutral[3:])]),
    )


def _value(toml: TomlReader, where: str) -> Any:
    """Value of a dotted name; None if there is none."""
    value: Any = toml.data
    for part in where.split("."):
        value = value.get(part) if isinstance(value, dict) else None
    return value


def _numbers(toml: TomlReader, where: str, *shape: int) -> FloatArray:
    """Finite numbers of a dotted name, in an array of that shape; -1: any length. Raises `InputError`."""
    value = _value(toml, where)
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        numbers = np.array(math.nan)
    fits = len(numbers.shape) == len(shape) and all(a in (b, -1) for a, b in zip(shape, numbers.shape, strict=True))
    if not fits or not np.isfinite(numbers).all():
        expected = f"{' x '.join(map(str, shape)).replace('-1', 'some')} numbers" if shape else "a number"
        raise toml.error(f"{where} = {'missing' if value is None else repr(value)}", expected, where=where)
    return numbers


def _joints(toml: TomlReader, section: str) -> FloatArray:
    """(6, 3) m, joints given as x, y, z or as radius, angle, height."""
    if _value(toml, f"{section}.mm") is not None:
        return m_from_mm(_numbers(toml, f"{section}.mm", 6, 3))
    radius, angle, height = _numbers(toml, f"{section}.cylindrical_mm_deg", 6, 3).T
    radius, angle, height = m_from_mm(radius), rad_from_deg(angle), m_from_mm(height)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
