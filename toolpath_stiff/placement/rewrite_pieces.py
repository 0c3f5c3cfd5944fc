"""Moves cut into pieces: arcs that no plane expresses any more, and turns of the tool that words express at ends only.

Set-up frame of the untouched program; mm and degrees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.nc.recorder import Arc
from toolpath_stiff.path.rotations import rotation_matrices
from toolpath_stiff.placement.rewrite_turn import Turn

FloatArray = NDArray[np.float64]

LARGEST_CHORD = math.pi / 2.0  # of a circle, whatever the tolerance
# A control interpolates A, B and C; between its ends a turned move leans a little otherwise. So little changes a
# stiffness by parts in ten thousand at most, as a radian changes it by about itself.
LEAN = 0.01
LEVER = 100.0  # mm along the tool at which a tolerance in mm is one in degrees
BETWEEN = np.array([0.25, 0.5, 0.75])


def chords(arc: Arc, start: Sequence[float], end: Sequence[float], tolerance: float) -> int:
    """Number of chords that stay within `tolerance` (mm) of an arc: r (1 - cos(step / 2)) <= tolerance."""
    radius = max(math.dist(start[:3], arc.center), _radius_at_end(arc, end))
    step = 2.0 * math.acos(max(1.0 - tolerance / radius, -1.0))
    return math.ceil(abs(arc.sweep) / min(step, LARGEST_CHORD) - 1e-9)


def _radius_at_end(arc: Arc, end: Sequence[float]) -> float:
    out = np.array(end[:3]) - np.array(arc.center)
    normal = np.array(arc.normal)
    return float(np.linalg.norm(out - (out @ normal) * normal))


def points_between(start: Sequence[float], end: Sequence[float], arc: Arc | None, count: int) -> list[list[float]]:
    """Ends (6) of `count` equal pieces of a move; the last one is its end to the last digit."""
    first, last = np.array(start), np.array(end)
    points = [list(map(float, first + i / count * (last - first))) for i in range(1, count)]
    if arc is not None:
        for i, point in enumerate(points, 1):
            point[:3] = _on_arc(arc, first[:3], last[:3], i / count)
    return [*points, list(end)]


def _on_arc(arc: Arc, start: FloatArray, end: FloatArray, u: float) -> list[float]:
    """Point at the share u of an arc, helix or spiral: radius and height change evenly, as in `path.sampling`."""
    center, normal = np.array(arc.center), np.array(arc.normal)
    outward = start - center
    climb = float((end - start) @ normal)
    lift = float(outward @ normal)
    outward = outward - lift * normal
    radius = float(np.linalg.norm(outward))
    growth = _radius_at_end(arc, list(end)) - radius
    e1 = outward / radius
    e2 = np.cross(normal, e1)
    angle = u * arc.sweep
    point = center + (radius + u * growth) * (math.cos(angle) * e1 + math.sin(angle) * e2) + (lift + u * climb) * normal
    return [float(v) for v in point]


def lean(turn: Turn, programmed: Sequence[Sequence[float]], written: Sequence[Sequence[float]]) -> float:
    """Largest angle (degrees) between the tool as placed and as written, midway in a move; rotary words of both ends.

    Both controls go evenly from the first angles to the last; only at the ends are these the same rotation.
    """
    (a0, a1), (w0, w1) = np.array(programmed, dtype=float), np.array(written, dtype=float)
    wanted = turn.rotations(a0 + BETWEEN[:, None] * (a1 - a0))
    found = rotation_matrices(np.radians(w0 + BETWEEN[:, None] * (w1 - w0)))
    return max(angle_between(one, other) for one, other in zip(wanted, found, strict=True))


def angle_between(first: FloatArray, second: FloatArray) -> float:
    """Angle in degrees between two rotations; exact for small ones, where the cosine has no digits left."""
    chord = float(np.linalg.norm(first - second)) / (2.0 * math.sqrt(2.0))
    return 2.0 * math.degrees(math.asin(min(chord, 1.0)))
