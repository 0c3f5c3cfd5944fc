"""Directions of the load at the tool tip, one option, `--load`, everywhere; cuts across the tool axis and along it.

A load along the motion points along the tool axis while the tool plunges. There a hexapod is twice as stiff as across
(Clinton, Zhang, Wavering 1997, Table 1: Z against X and Y), so three plunges of a few millimetres would rule
the range of a whole program. The headline figures are therefore those of the cuts across the axis; plunges have theirs
beside them.

Only a tangential load makes the difference. A normal load is always across the tool axis, at a plunge as well (the
softest direction across it), so its figures are all of one kind; the other loads do not look at the motion.
"""

from dataclasses import dataclass

import numpy as np

from toolpath_stiff import defaults, rotations
from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.errors import InputError

LOADS = ("tangential", "axial", "normal", "softest", "radial", "x", "y", "z")
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
# Below this sine of the angle between motion and tool axis (0.06 degrees) "sideways" has no meaning.
ALONG_AXIS = 1e-3

BLOCK = 16_384  # samples at a time: nine numbers for each


@dataclass(frozen=True)
class Load:
    """A load direction: one of `LOADS`, or "fixed" with a unit vector in machine axes."""

    kind: str = defaults.LOAD
    vector: tuple[float, float, float] | None = None

    def __str__(self) -> str:
        return self.kind if self.vector is None else ",".join(f"{v:g}" for v in self.vector)


def parse_load(text: str) -> Load:
    """Read `--load`: a name of `LOADS` or `DX,DY,DZ` (any length but zero). Raises `InputError`."""
    name = text.strip().lower()
    if name in LOADS:
        return Load(name)
    parts = name.split(",")
    try:
        vector = np.array([float(part) for part in parts])
    except ValueError:
        vector = np.array([])
    if vector.shape != (3,) or not np.isfinite(vector).all() or not np.abs(vector).max() > 0.0:
        raise InputError(
            f"load {text!r} is not a direction", expected=f"one of {', '.join(LOADS)}, or DX,DY,DZ such as 1,0,-0.5"
        )
    x, y, z = (vector / np.linalg.norm(vector)).tolist()
    return Load("fixed", (x, y, z))


def load_directions(
    load: Load, compliance: FloatArray, position: FloatArray, rotation: FloatArray | None, tangent: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Unit vectors of the load at n poses, and where the softest direction had to stand in.

    Parameters
    ----------
    load
        Which load.
    compliance
        (n, 3, 3) m/N of the tip.
    position
        (n, 3) m.
    rotation
        (n, 3, 3); None: vertical spindle.
    tangent
        (n, 3) unit vectors of the motion, 0 where the tip does not move.

    Returns
    -------
    directions, substituted
        (n, 3) and (n,): `substituted` where the asked direction does not exist.
    """
    directions, known = geometric_directions(load, position, rotation, tangent)
    if known.all():
        return directions, ~known
    plunge = ~known & np.any(tangent != 0.0, axis=1) & (load.kind != "softest")
    seen = compliance.copy()
    if plunge.any():  # the softest direction across the axis
        axis = np.broadcast_to(np.array(AXES["z"]), directions.shape) if rotation is None else rotation[:, :, 2]
        across = np.eye(3) - axis[plunge, :, None] * axis[plunge, None, :]
        seen[plunge] = across @ compliance[plunge] @ across
    directions = directions.copy()
    directions[~known] = principal_directions(seen[~known])
    return directions, ~known & (load.kind != "softest")


def geometric_directions(
    load: Load, position: FloatArray, rotation: FloatArray | None, tangent: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Unit vectors (n, 3) of the load, and (n,) True where they do not depend on the compliance."""
    n = len(position)
    everywhere = np.ones(n, dtype=bool)
    if load.vector is not None:
        return np.broadcast_to(np.array(load.vector), (n, 3)), everywhere
    if load.kind in AXES:
        return np.broadcast_to(np.array(AXES[load.kind]), (n, 3)), everywhere
    if load.kind == "softest":
        return np.full((n, 3), np.nan), ~everywhere
    if load.kind == "radial":
        across = -position * np.array([1.0, 1.0, 0.0])
        radius = np.linalg.norm(across, axis=1, keepdims=True)
        return np.where(radius < 1e-9, AXES["x"], across / np.maximum(radius, 1e-9)), everywhere
    axis = np.broadcast_to(np.array(AXES["z"]), (n, 3)) if rotation is None else rotation[:, :, 2]
    if load.kind == "axial":
        return axis, everywhere
    if load.kind == "normal":
        sideways = np.cross(axis, tangent)
        sine = np.linalg.norm(sideways, axis=1)
        return sideways / np.where(sine > 0.0, sine, 1.0)[:, None], sine >= ALONG_AXIS
    return tangent, np.any(tangent != 0.0, axis=1)


def principal_directions(compliance: FloatArray, softest: bool = True) -> FloatArray:
    """(n, 3) unit vectors of the largest eigenvalue of C, or the smallest; their largest component is positive."""
    finite = np.isfinite(compliance).all(axis=(1, 2))
    directions = np.full((len(compliance), 3), np.nan)
    vectors = np.linalg.eigh(compliance[finite])[1][:, :, -1 if softest else 0]
    largest = np.take_along_axis(vectors, np.abs(vectors).argmax(axis=1)[:, None], axis=1)
    directions[finite] = np.where(largest < 0.0, -vectors, vectors)
    return directions


def along_tool_axis(tangent: FloatArray, abc: FloatArray) -> BoolArray:
    """(n,) True where the tip moves along the tool axis, either way, within `defaults.PLUNGE_ANGLE`.

    Parameters
    ----------
    tangent
        (n, 3) unit vectors of the motion; 0 where the tip does not move, which is not along the axis.
    abc
        (n, 3) rad, roll, pitch, yaw of the platform; the tool axis is its z.

    Returns
    -------
    (n,) bool.
    """
    along = np.empty(len(tangent))
    for start in range(0, len(tangent), BLOCK):
        rows = slice(start, start + BLOCK)
        along[rows] = rotations.along_tool_axis(tangent[rows], abc[rows])
    return np.asarray(np.abs(along) >= np.cos(defaults.PLUNGE_ANGLE))


def plunging_rows(load: Load, tangent: FloatArray, abc: FloatArray, counted: BoolArray) -> BoolArray:
    """(n,) counted samples of plunges; none if the load does not follow the motion."""
    if load.kind != "tangential":
        return np.zeros(len(counted), dtype=bool)
    return np.asarray(counted & along_tool_axis(tangent, abc))


def headline_rows(counted: BoolArray, plunging: BoolArray) -> BoolArray:
    """(n,) counted samples that mean, range and weakest place are about, of a path or a part of it.

    Those that do not plunge; all of them where every one does.
    """
    across = counted & ~plunging
    return np.asarray(across if across.any() else counted)
