"""Tool tip and tool axis on the part, from the machine axes that a program was posted for. SI.

The chain runs from the tool to the work. With all rotary axes at 0 the tip stands at the numbers X of the linear axes,
its axis along +z, and part and machine coordinates are one. Each rotary axis then turns tip q and axis k by its angle t
about its line, which has the direction n and goes through c:

    q' = c + R(n, t) (q - c),    k' = R(n, t) k,    R right-handed (ISO 841: the tool against the work)

Heads first, from the spindle back to the column: their lines ride with the linear axes, c = X + pivot + L z with L the
tool's length from the gauge line. Then tables, from the base to the work: c stays. It is the forward kinematics of
R.-S. Lee, C.-H. She, Int J Adv Manuf Technol 13 (1997) 658-665, written with rotations about lines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.nc.posted.kinematics import HEAD, PostedKinematics, RotaryAxis

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

UPRIGHT = 1e-9  # of a unit vector: a tool axis along y has no pitch
Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class ToolPoses:
    """Tips (n, 3) in m and unit vectors of the tool's axis (n, 3), tip to spindle, in part coordinates."""

    tip: FloatArray
    axis: FloatArray


def tool_poses(
    kinematics: PostedKinematics,
    xyz: FloatArray,
    abc: FloatArray,
    tool_length: FloatArray | float = math.nan,
    tip_held: BoolArray | bool = False,
) -> ToolPoses:
    """Where the tool stands on the part: the forward kinematics of the machine that a program was posted for.

    Parameters
    ----------
    kinematics
        With its tables' points in the coordinates of `xyz`.
    xyz
        (n, 3) m, X Y Z as programmed.
    abc
        (n, 3) rad, A B C as programmed.
    tool_length
        (n,) or one, m, from the spindle's gauge line to the tip; heads without tool centre point control alone need it.
    tip_held
        (n,) or one, whether tool centre point control is on where it is not for good (`kinematics.tcp`): X Y Z are the
        tip's on the part.
    """
    held = np.broadcast_to(np.asarray(tip_held) | kinematics.tcp, (len(xyz),))
    axis = np.tile(Z, (len(xyz), 1))
    tip = np.array(xyz, dtype=float)
    for rotary in kinematics.from_tool_to_work:
        angle = abc[:, rotary.column]
        axis = turned(axis, rotary, angle)
        if not kinematics.tcp:
            center = line_point(rotary, xyz, tool_length)
            # Where nothing turns the numbers stay to their last digit, and a tool's unknown length does not matter.
            turns = ~held & (angle != 0.0)
            tip = np.where(turns[:, None], center + turned(tip - center, rotary, angle), tip)
    return ToolPoses(tip, axis)


def roll_pitch(axis: FloatArray, pitch_before: float = 0.0) -> FloatArray:
    """Roll and pitch (n, 2), rad, of tool axes (n, 3) in their order, at a yaw of 0; see `tool_axis`.

    Pitch runs on from `pitch_before`, over half a turn too, and stays what it was where the axis lies along y and has
    none.
    """
    i, j, k = axis.T
    across = np.hypot(i, k)
    pitch = np.concatenate([[pitch_before], np.arctan2(i, k)])
    known = np.concatenate([[0], np.where(across > UPRIGHT, np.arange(1, len(pitch)), 0)])
    pitch = np.unwrap(pitch[np.maximum.accumulate(known)])[1:]
    return np.stack([np.arctan2(-j, across), pitch], axis=1) + 0.0


def turned(vectors: FloatArray, rotary: RotaryAxis, angle: FloatArray) -> FloatArray:
    """Vectors (n, 3) turned by angles (n,) about the axis' direction: Rodrigues' formula."""
    n = np.array(rotary.direction)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    along = (vectors[:, 0] * n[0] + vectors[:, 1] * n[1] + vectors[:, 2] * n[2])[:, None] * n
    return np.asarray(along + cos * (vectors - along) + sin * np.cross(n, vectors))


def line_point(rotary: RotaryAxis, xyz: FloatArray, tool_length: FloatArray | float) -> FloatArray:
    """(n, 3) a point of the rotary axis at the numbers X Y Z of the linear axes."""
    assert rotary.point is not None
    if rotary.turns == HEAD:
        reach = np.broadcast_to(np.asarray(tool_length, dtype=float), (len(xyz),))
        return np.asarray(xyz + np.array(rotary.point) + reach[:, None] * Z)
    return np.broadcast_to(np.array(rotary.point), xyz.shape)
