"""The nominal machine, read from its TOML file by the rig's own reader, and its kinematics.

The rig must not trust the reader of the model that it judges, so it has this one. It takes what it needs (joints,
tool, strut law, limits of strut length and swing) and refuses machine files that carry effects: what the machine
hides is the rig's to choose. `true_poses` says where the platform really stands when the control, with the nominal
geometry, commands a pose.
"""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_text
from toolpath_stiff.toml_reader import TomlReader
from toolpath_stiff.units import m_from_mm, n_per_m_from_n_per_um, rad_from_deg

SECTIONS = ("platform", "limits", "reference_tool", "strut_law", "frame_joints", "platform_joints")  # read here


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
        """Shortest and longest strut that the law is given for, m; of one point the travel."""
        if len(self.law_lengths) == 1:
            return self.strut_range
        return float(self.law_lengths[0]), float(self.law_lengths[-1])

    @property
    def vertices(self) -> IntArray:
        """(6,) number of the frame vertex that holds each strut, counted from 0 in the order of the struts."""
        azimuth = np.arctan2(self.frame_joints[:, 1], self.frame_joints[:, 0])
        angles: list[float] = []
        numbers = np.empty(6, dtype=np.int64)
        for strut, angle in enumerate(azimuth):
            turns = [abs(math.remainder(angle - other, 2.0 * math.pi)) for other in angles]
            if not turns or min(turns) > VERTEX_WIDTH:
                angles.append(float(angle))
                turns.append(0.0)
            numbers[strut] = int(np.argmin(turns))
        return numbers


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
    packaged = folder / f"{machine}.toml"
    if not packaged.is_file():
        names = sorted(Path(item.name).stem for item in folder.iterdir() if item.name.endswith(".toml"))
        raise InputError(f"no machine {machine!r}", expected=f"{', '.join(names)}, or a file ending in .toml")
    return deepcopy(_packaged(machine))  # its arrays are the caller's own


@cache
def _packaged(machine: str) -> Nominal:
    """A machine that ships with the package, read once."""
    file = f"{machine}.toml"
    return parse_nominal((resources.files("toolpath_stiff") / "data" / "machines" / file).read_text("utf-8"), file)


def parse_nominal(text: str, file: str) -> Nominal:
    """Nominal machine from the text of a machine file; `file` names it in messages. Raises `InputError`."""
    toml = TomlReader(text, file)
    table = toml.data
    for name in SECTIONS:
        _section(toml, name)
    for kind in ("effect", "instrument"):
        if table.get(kind):
            raise InputError(
                f"the machine carries [[{kind}]] already",
                expected="a nominal machine",
                hint="take the effects out; the rig adds its own hidden one",
                file=file,
                line=toml.line_of(kind),
            )
    bars = table.get("platform", {}).get("bar_stiffness_N_per_m", math.inf)
    if bars != math.inf:
        raise toml.error(
            f"[platform] bar_stiffness_N_per_m = {bars}",
            "inf",
            "the rig's nominal platform is rigid; a flexible one is the hidden effect platform_flexibility",
            where="platform.bar_stiffness_N_per_m",
        )
    angles = _section(toml, "limits.joint_angle")
    neutral = _numbers(toml, "limits.joint_angle", "neutral_pose_mm_deg", 6) if angles else np.zeros(6)
    lengths, stiffnesses = _law(toml)
    return Nominal(
        name=str(table.get("name", "machine")),
        text=text,
        frame_joints=_joints(toml, "frame_joints"),
        platform_joints=_joints(toml, "platform_joints"),
        tool_length=m_from_mm(float(_numbers(toml, "reference_tool", "length_mm", 1)[0])),
        law_lengths=lengths,
        law_stiffnesses=stiffnesses,
        strut_range=(
            m_from_mm(float(_numbers(toml, "limits.strut_length", "min_mm", 1)[0])),
            m_from_mm(float(_numbers(toml, "limits.strut_length", "max_mm", 1)[0])),
        ),
        swing=None
        if not angles
        else (
            rad_from_deg(float(_numbers(toml, "limits.joint_angle", "frame_max_deg", 1)[0])),
            rad_from_deg(float(_numbers(toml, "limits.joint_angle", "platform_max_deg", 1)[0])),
        ),
        neutral_pose=np.concatenate([m_from_mm(neutral[:3]), rad_from_deg(neutral[3:])]),
    )


def _section(toml: TomlReader, name: str) -> dict[str, Any]:
    """A table by its dotted name, empty where there is none. Raises `InputError`."""
    content = toml.data
    for part in name.split("."):
        content = toml.table(name, content.get(part, {}), f"a section [{name}]")
    return content


def _numbers(toml: TomlReader, section: str, key: str, count: int) -> FloatArray:
    """(count,) the numbers under a key."""
    given = _section(toml, section).get(key)
    try:
        values = np.atleast_1d(np.asarray(given, dtype=float))
    except (TypeError, ValueError):
        values = np.array([math.nan])
    if values.shape != (count,) or not np.isfinite(values).all():
        words = f"{key} = {'missing' if given is None else repr(given)}"
        raise toml.error(words, f"{count} number{'s' * (count > 1)}", where=f"{section}.{key}")
    return values


def _law(toml: TomlReader) -> tuple[FloatArray, FloatArray]:
    """(p,) m and (p,) N/m of the strut law: a stiffness for each of two or more lengths, or one without a length."""
    lengths, stiffnesses = (_section(toml, "strut_law").get(key) for key in ("length_mm", "stiffness_N_per_um"))
    if lengths is None and not isinstance(stiffnesses, list):
        constant = n_per_m_from_n_per_um(_numbers(toml, "strut_law", "stiffness_N_per_um", 1))
        return np.zeros(1), constant
    count = max(2, len(lengths) if isinstance(lengths, list) else 0)
    points = m_from_mm(_numbers(toml, "strut_law", "length_mm", count))
    if count > 2 and not (np.diff(points) > 0.0).all():
        raise toml.error(f"length_mm = {lengths!r}", "rising lengths", where="strut_law.length_mm")
    return points, n_per_m_from_n_per_um(_numbers(toml, "strut_law", "stiffness_N_per_um", count))


def _joints(toml: TomlReader, section: str) -> FloatArray:
    """(6, 3) m, joints given as x, y, z or as radius, angle, height."""
    content = _section(toml, section)
    rows = content.get("mm", content.get("cylindrical_mm_deg"))
    try:
        joints = np.asarray(rows, dtype=float)
    except (TypeError, ValueError):
        joints = np.empty(0)
    if joints.shape != (6, 3) or not np.isfinite(joints).all():
        raise toml.error(f"[{section}] has no six joints", "mm or cylindrical_mm_deg, 6 rows of 3", where=section)
    if "mm" in content:
        return m_from_mm(joints)
    radius, angle, height = m_from_mm(joints[:, 0]), rad_from_deg(joints[:, 1]), m_from_mm(joints[:, 2])
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def rotations(angles: FloatArray) -> FloatArray:
    """(n, 3, 3) R = Rz(yaw) Ry(pitch) Rx(roll) from (n, 3) roll, pitch, yaw in rad."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles).T, np.sin(angles).T
    return np.stack(
        [
            np.stack([cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], axis=-1),
            np.stack([sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], axis=-1),
            np.stack([-sp, cp * sr, cp * cr], axis=-1),
        ],
        axis=1,
    )


def commanded_lengths(nominal: Nominal, tips: FloatArray, turned: FloatArray, extension: FloatArray) -> FloatArray:
    """(n, 6) m, strut lengths for tool tips (n, 3), rotations (n, 3, 3) and tools longer by `extension` (n,)."""
    joints = platform_points(nominal.platform_joints, tips, turned, extension)
    return np.asarray(np.linalg.norm(joints - nominal.frame_joints, axis=2))


def platform_points(points: FloatArray, tips: FloatArray, turned: FloatArray, extension: FloatArray) -> FloatArray:
    """(n, k, 3) m in base axes: platform points (k, 3), given from the reference tool's tip."""
    raised = points + extension[:, None, None] * np.array([0.0, 0.0, 1.0])
    return np.asarray(tips[:, None, :] + np.einsum("nij,nkj->nki", turned, raised))


def true_poses(
    lengths: FloatArray, frame: FloatArray, platform: FloatArray, tips: FloatArray, turned: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Poses (n, 3), (n, 3, 3) of the platform at which the true joints have the commanded strut lengths (n, 6).

    Newton's method on the six closure equations, from the commanded pose; `platform` (6, 3) m counts from the origin
    of the platform frame. Joint errors are millimetres, so three or four steps reach rounding.

    Raises
    ------
    RuntimeError
        No convergence: the errors are beyond anything that the rig draws.
    """
    position, orientation = tips.copy(), turned.copy()
    for _ in range(20):
        arms = np.einsum("nij,kj->nki", orientation, platform)
        strut = position[:, None, :] + arms - frame
        reached = np.linalg.norm(strut, axis=2)
        gap = lengths - reached
        if np.abs(gap).max() < 1e-13:
            return position, orientation
        unit = strut / reached[:, :, None]
        step = np.linalg.solve(np.concatenate([unit, np.cross(arms, unit)], axis=2), gap[:, :, None])[:, :, 0]
        position = position + step[:, :3]
        orientation = _turn(step[:, 3:]) @ orientation
        if np.abs(step).max() < 1e-12:
            return position, orientation
    raise RuntimeError("the closure equations of the platform did not converge")


def _turn(vector: FloatArray) -> FloatArray:
    """(n, 3, 3) rotation matrices of rotation vectors (n, 3) (Rodrigues)."""
    angle = np.linalg.norm(vector, axis=1)
    x, y, z = vector.T
    zero = np.zeros_like(x)
    skew = np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], 1)
    # sin(t)/t and (1 - cos t)/t^2 through sinc, which is safe at 0.
    first = np.sinc(angle / np.pi)[:, None, None]
    second = 0.5 * np.sinc(angle / (2.0 * np.pi))[:, None, None] ** 2
    return np.asarray(np.eye(3) + first * skew + second * (skew @ skew))


def reachable(nominal: Nominal, tips: FloatArray, angles: FloatArray, extension: FloatArray) -> BoolArray:
    """(n,) whether strut lengths and joint swings stay within the nominal machine's limits."""
    turned = rotations(angles)
    lengths = commanded_lengths(nominal, tips, turned, extension)
    low, high = nominal.strut_range
    inside = ((lengths >= low) & (lengths <= high)).all(axis=1)
    if nominal.swing is None:
        return np.asarray(inside)
    rest, moved = (
        strut_directions(nominal, *pose)
        for pose in (
            (nominal.neutral_pose[None, :3], rotations(nominal.neutral_pose[None, 3:]), np.zeros(1)),
            (tips, turned, extension),
        )
    )
    for limit, before, after in zip(nominal.swing, rest, moved, strict=True):
        cosine = np.clip(np.einsum("nki,nki->nk", np.broadcast_to(before, after.shape), after), -1.0, 1.0)
        inside &= (np.arccos(cosine) <= limit).all(axis=1)
    return np.asarray(inside)


def strut_directions(
    nominal: Nominal, tips: FloatArray, turned: FloatArray, extension: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (n, 6, 3) along the struts in base axes and in platform axes."""
    strut = platform_points(nominal.platform_joints, tips, turned, extension) - nominal.frame_joints
    unit = strut / np.linalg.norm(strut, axis=2, keepdims=True)
    return unit, unit @ turned
