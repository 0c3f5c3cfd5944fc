"""Tool axes, and the roll and pitch that give them. Degrees."""

from __future__ import annotations

import math


def roll_pitch_of_axis(i: float, j: float, k: float) -> tuple[float, float]:
    """Roll and pitch in degrees that turn the spindle's z onto a tool axis, at a yaw of 0.

    With R = Rz(c) Ry(b) Rx(a) and c = 0 the tool axis, from the tip to the spindle, is R z = (sin b cos a, -sin a,
    cos b cos a) (the convention of `path.rotations`). Roll is in [-90, 90]; where it is +-90, pitch is 0.

    Parameters
    ----------
    i, j, k
        The tool axis from tip to spindle, of any length above 0.
    """
    across = math.hypot(i, k)
    pitch = math.degrees(math.atan2(i, k)) if across else 0.0
    return math.degrees(math.atan2(-j, across)), pitch
