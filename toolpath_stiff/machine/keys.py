"""What a machine file may hold: sections, keys, units, bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
INFINITY = math.inf


@dataclass(frozen=True)
class Key:
    """What a key of a machine file may hold.

    `shape` () for a number, (3,) or (6, 3) for lists; a tuple of two lengths in `lengths` admits either.
    Bounds are inclusive unless `open_low`.
    """

    unit: str = ""
    shape: tuple[int, ...] = ()
    low: float = -1e5
    high: float = 1e5
    required: bool = True
    text: bool = False
    infinite: bool = False
    open_low: bool = False
    also_length: int | None = None


JOINTS_MM = Key(unit="mm", shape=(6, 3), required=False)
# Rows of radius, angle about Z, height: keeps the symmetry of a machine exact, and reads better.
JOINTS_CYLINDRICAL = Key(unit="mm, deg, mm", shape=(6, 3), required=False)
SECTIONS: dict[str, dict[str, Key]] = {
    "": {
        "name": Key(text=True),
        "title": Key(text=True, required=False),
        "source": Key(text=True, required=False),
    },
    "frame_joints": {"mm": JOINTS_MM, "cylindrical_mm_deg": JOINTS_CYLINDRICAL},
    "platform_joints": {"mm": JOINTS_MM, "cylindrical_mm_deg": JOINTS_CYLINDRICAL},
    "reference_tool": {"length_mm": Key(unit="mm", low=0.0, high=2000.0)},
    "strut_law": {
        "length_mm": Key(unit="mm", shape=(2,), low=0.0, open_low=True),
        "stiffness_N_per_um": Key(unit="N/um", shape=(2,), low=0.0, high=1e5, open_low=True),
    },
    "platform": {"bar_stiffness_N_per_m": Key(unit="N/m", low=1e5, high=INFINITY, infinite=True, open_low=True)},
    "limits.strut_length": {
        "min_mm": Key(unit="mm", low=0.0),
        "max_mm": Key(unit="mm", low=0.0, open_low=True),
    },
    "limits.joint_angle": {
        "frame_max_deg": Key(unit="deg", low=0.0, high=180.0, open_low=True, infinite=True),
        "platform_max_deg": Key(unit="deg", low=0.0, high=180.0, open_low=True, infinite=True),
        "neutral_pose_mm_deg": Key(unit="mm, deg", shape=(6,)),
    },
    "limits.workspace": {"min_mm": Key(unit="mm", shape=(3,)), "max_mm": Key(unit="mm", shape=(3,))},
    "limits.singularity": {"min_index": Key(low=0.0, high=1.0)},
    "setup": {
        "default_origin_mm": Key(unit="mm[, deg]", shape=(3,), also_length=6),
        "rapid_mm_per_min": Key(unit="mm/min", low=0.0, high=1e6, open_low=True),
        "name": Key(text=True, required=False),
        "names": Key(text=True, shape=(0,), required=False),
        "temperature_C": Key(unit="degrees C", low=-50.0, high=200.0, required=False),
    },
}
OPTIONAL_SECTIONS = ("limits.joint_angle", "limits.workspace", "limits.singularity", "platform", "setup")


def as_array(raw: Any) -> FloatArray | None:
    """A float array of TOML numbers and lists of them; None for anything else (booleans too)."""

    def numeric(item: Any) -> bool:
        if isinstance(item, list):
            return all(numeric(part) for part in item)
        return isinstance(item, int | float) and not isinstance(item, bool)

    if not numeric(raw):
        return None
    try:
        return np.array(raw, dtype=float)
    except ValueError:  # rows of unequal length
        return None


def describe(rule: Key) -> str:
    """What a key may hold, in words."""
    if rule.text:
        return "a text"
    shape = {
        (): "a number",
        (2,): "2 numbers",
        (3,): "3 numbers",
        (6,): "6 numbers",
        (6, 3): "6 rows of 3 numbers",
    }[rule.shape]
    if rule.also_length:
        shape = f"{rule.shape[0]} or {rule.also_length} numbers"
    unit = f" in {rule.unit}" if rule.unit else ""
    low = f"above {rule.low:g}" if rule.open_low else f"at least {rule.low:g}"
    high = "" if math.isinf(rule.high) else f", at most {rule.high:g}"
    return f"{shape}{unit}, {low}{high}"


def shorten(raw: Any) -> str:
    """A value as it stands, cut for a message."""
    text = repr(raw)
    return text if len(text) <= 60 else text[:57] + "..."
