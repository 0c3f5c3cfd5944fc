"""Oddities: physics that no effect of the catalogue describes, for testing the verdict "something else is missing".

Each is one formula on struts, joints, table or readings; `size` scales it. They are invented for the purpose, with
the shapes that damaged or badly set machines show; no source gives figures for them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from toolpath_stiff.rig.hidden import Rows

FloatArray = NDArray[np.float64]

REACH = 0.3  # m, half the width of the workspace that the paper measured
REFERENCE_LOAD = 1000.0  # N

# Name -> what it is. The second group needs columns (time, several loads) that only some campaigns have.
ODDITIES = {
    "loose_preload": "joints softer in tension than in compression",
    "screw_pitch_error": "strut stiffness varies periodically with length",
    "cracked_bed": "the workpiece side gives way where y is positive only",
    "ball_screw_torsion": "struts softer towards positive x, as if their screws twisted with the carriage",
    "strut_crosstalk": "the load of strut 1 moves strut 4 and the other way round",
    "saddle_overhang": "the workpiece side gives way along X, growing with the square of y",
    "cable_drag": "a cable pulls along X in proportion to x, and the gauge reads it",
}
ODDITIES_IN_TIME = {
    "warming_leg": "one strut softens in the course of the campaign",
    "joint_friction": "sticking joints: stiffer at small loads",
}
OUTSIDE = (*ODDITIES, *ODDITIES_IN_TIME)


@dataclass(frozen=True)
class Oddity:
    """One of the oddities.

    Attributes
    ----------
    kind
        Its name.
    size
        Relative change (1: 100 %), or compliance in m/N for `loose_preload`, `cracked_bed`, `saddle_overhang`.
    strut
        Number of the strut concerned, from 0 (`warming_leg`).
    wavelength, phase
        m and rad, of `screw_pitch_error`.
    """

    kind: str
    size: float
    strut: int = 0
    wavelength: float = 0.15
    phase: float = 0.0


def strut_block(odd: Oddity | None, stiffness: FloatArray, lengths: FloatArray, rows: Rows) -> FloatArray:
    """(n, 6, 6) N/m from the struts' own stiffnesses (n, 6)."""
    factor: FloatArray = np.ones(stiffness.shape)
    if odd is not None and odd.kind == "screw_pitch_error":
        factor += odd.size * np.sin(2.0 * np.pi * lengths / odd.wavelength + odd.phase)
    if odd is not None and odd.kind == "ball_screw_torsion":
        # Compliance greater by `size` at the right edge of the workspace, by less and less towards the left.
        factor /= 1.0 + odd.size * np.exp(rows.position[:, :1] / REACH - 1.0)
    if odd is not None and odd.kind == "warming_leg":
        factor[:, odd.strut] = 1.0 / (1.0 + odd.size * rows.elapsed)
    block = (stiffness * factor)[:, :, None] * np.eye(6)
    if odd is not None and odd.kind == "strut_crosstalk":
        # Flexibility with an off-diagonal term; below 1 the block stays positive definite.
        first, second = 0, 3  # struts 1 and 4
        coupled = odd.size * np.sqrt(1.0 / (stiffness[:, first] * stiffness[:, second]))
        flexibility = (1.0 / stiffness)[:, :, None] * np.eye(6)
        flexibility[:, first, second] = flexibility[:, second, first] = coupled
        return np.asarray(np.linalg.inv(flexibility))
    return block


def extra_joint(odd: Oddity | None, forces: FloatArray) -> FloatArray:
    """(n, 6) m/N along the struts, for strut forces (n, 6) N, tension positive."""
    if odd is None or odd.kind != "loose_preload":
        return np.zeros_like(forces)
    return np.where(forces > 0.0, odd.size, 0.0)


def extra_table(odd: Oddity | None, rows: Rows) -> FloatArray:
    """(n, 3) m/N along the base axes, on the workpiece side."""
    extra = np.zeros((len(rows.force), 3))
    y = rows.position[:, 1]
    if odd is not None and odd.kind == "cracked_bed":
        extra[:, :2] = np.where(y > 0.0, odd.size, 0.0)[:, None]
    if odd is not None and odd.kind == "saddle_overhang":
        extra[:, 0] = odd.size * (y / REACH) ** 2
    return extra


def reading_factor(odd: Oddity | None, rows: Rows) -> FloatArray:
    """(n,) on the stiffness that is read."""
    factor = np.ones(len(rows.force))
    if odd is not None and odd.kind == "cable_drag":
        factor += odd.size * rows.position[:, 0] / REACH * np.abs(rows.direction[:, 0])
    if odd is not None and odd.kind == "joint_friction":
        # Friction carries a share of the load that shrinks as the load grows.
        factor += odd.size * REFERENCE_LOAD / (REFERENCE_LOAD + rows.force)
    return factor
