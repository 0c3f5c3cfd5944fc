"""The turn of the work: points, rotary words, directions of the placed path; moves cut into pieces. mm, degrees.

The untouched program at the placement (o, Q) puts the set-up point p at o + Q p; the written one, at the original
origin (oo, Qo), must put its own point there: p_new = Qo^T (Q p + o - oo). Orientations follow the rule of `path`,
undone with the original: R_new = Qo^T Q R Rz(-C) Rz(Co). A block's moves are compared with those of the written block
in the same way.

Cut into pieces are arcs that no plane expresses any more, and turns of the tool that words express at ends only; they
are in the set-up frame of the untouched program.
"""

import math
from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.nc.courses import frame_of, point_on_arc
from toolpath_stiff.nc.moves import Arc, Move
from toolpath_stiff.poses import ShopPose
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_about_z, rotation_matrices

NOISE = 1e-12  # of a direction cosine: what is left of 0 or 1 after cosines and products
UPRIGHT = 1e-9  # degrees; smaller tilts are rounding
LARGEST_CHORD = math.pi / 2.0  # of a circle, whatever the tolerance
# A control interpolates A, B and C; between its ends a turned move leans a little otherwise. So little changes a
# stiffness by parts in ten thousand at most, as a radian changes it by about itself.
LEAN = 0.01
LEVER = 100.0  # mm along the tool at which a tolerance in mm is one in degrees
BETWEEN = np.array([0.25, 0.5, 0.75])


class Turn:
    """The rigid motion of the set-up frame that takes the original work to the placed one.

    Parameters
    ----------
    placement, original
        Origins as `--origin` takes them, but in mm and degrees.
    """

    def __init__(self, placement: ShopPose, original: ShopPose) -> None:
        new, old = (rotation_matrices(np.radians(origin[3:])) for origin in (placement, original))
        self.turn: FloatArray = _clean(old.T @ new)
        self.shift: FloatArray = old.T @ (np.array(placement[:3]) - np.array(original[:3]))
        self.turns = not np.array_equal(self.turn, np.eye(3))
        self._yaw = rotation_about_z(np.radians(original[5] - placement[5]))
        self._never_yaws = np.array_equal(_clean(self.turn @ self._yaw), np.eye(3))  # a turn about the vertical alone

    def point(self, point: Sequence[float]) -> list[float]:
        """The placed point of a point of the set-up frame, x, y, z in mm."""
        x, y, z = point
        return [a * x + b * y + c * z + s for (a, b, c), s in zip(self.turn.tolist(), self.shift.tolist(), strict=True)]

    def rotations(self, abc: FloatArray) -> FloatArray:
        """(n, 3, 3) rotations R_new of programmed roll, pitch, yaw (n, 3) in degrees."""
        return self.turn @ rotation_matrices(np.radians(abc)) @ self._yaw

    def angles(self, abc: Sequence[float], near: Sequence[float]) -> list[float]:
        """Rotary words a, b, c in degrees; of the many triples with the same rotation, the one closest to `near`."""
        if self.keeps(abc):
            return list(abc)
        a, b, c = np.degrees(roll_pitch_yaw(self.rotations(np.array([abc], dtype=float))[0]))
        same = [np.array([a, b, c]), np.array([a + 180.0, 180.0 - b, c + 180.0])]
        close = [angles - 360.0 * np.round((angles - np.array(near)) / 360.0) for angles in same]
        best = min(close, key=lambda angles: float(np.abs(angles - near).max()))
        return [float(v) for v in best]

    def keeps(self, abc: Sequence[float]) -> bool:
        """True if rotary words stay as they are: a vertical platform never yaws with the work."""
        return self._never_yaws and (not self.turns or max(abs(abc[0]), abs(abc[1])) < UPRIGHT)

    def in_program(self, rotation: float) -> FloatArray:
        """(3, 3) the turn in program axes that the rotation of a work offset (degrees) has already turned."""
        inner = rotation_about_z(np.radians(rotation))
        return _clean(inner.T @ self.turn @ inner)


def _clean(matrix: FloatArray) -> FloatArray:
    """Direction cosines rounded to exactly 0 or +-1 where they differ by noise only, so unturned axes stay exact."""
    whole = np.round(matrix)
    return np.where(np.abs(matrix - whole) < NOISE, whole, matrix) + 0.0


def chords(arc: Arc, start: Sequence[float], end: Sequence[float], tolerance: float) -> int:
    """Number of chords that stay within `tolerance` (mm) of an arc: r (1 - cos(step / 2)) <= tolerance."""
    frame = frame_of(arc, start, end)
    radius = max(float(frame.radius_start[0]), float(frame.radius_end[0]))
    step = 2.0 * math.acos(max(1.0 - tolerance / radius, -1.0))
    return math.ceil(abs(arc.sweep) / min(step, LARGEST_CHORD) - 1e-9)


def point_at(start: Sequence[float], end: Sequence[float], arc: Arc | None, share: float) -> list[float]:
    """Point (6) at a share of a move."""
    point = [first + share * (last - first) for first, last in zip(start, end, strict=True)]
    return point if arc is None else [*point_on_arc(arc, start, end, share), *point[3:]]


def lean(turn: Turn, programmed: Sequence[Sequence[float]], written: Sequence[Sequence[float]]) -> float:
    """Largest angle (degrees) between the tool as placed and as written, within a move given by its end rotary words.

    Both controls go evenly from the first angles to the last; only at the ends are these the same rotation.
    """
    (a0, a1), (w0, w1) = np.array(programmed, dtype=float), np.array(written, dtype=float)
    wanted = turn.rotations(a0 + BETWEEN[:, None] * (a1 - a0))
    leaning = rotation_matrices(np.radians(w0 + BETWEEN[:, None] * (w1 - w0)))
    return max(map(angle_between, wanted, leaning))


def angle_between(first: FloatArray, second: FloatArray) -> float:
    """Angle in degrees between two rotations; exact for small ones, where the cosine has no digits left."""
    chord = float(np.linalg.norm(first - second)) / (2.0 * math.sqrt(2.0))
    return 2.0 * math.degrees(math.asin(min(chord, 1.0)))


# In units of the last decimal written. Ends: half a unit per axis, three axes, and the same of the start. On an arc a
# centre and a sweep add what their own words are rounded by.
END_UNITS, MIDDLE_UNITS = 2.0, 24.0
SHORTEST_UNITS = 4.0
# Where moves are compared: its name, share of the move, units by which they may be apart there.
PLACES = (
    ("at its start", 0.0, END_UNITS), ("at its end", 1.0, END_UNITS),
    *(("on its way", share, MIDDLE_UNITS) for share in BETWEEN.tolist()),
)  # fmt: skip


def differences(turn: Turn, wanted: list[Move], written: list[Move], unit: float) -> str:
    """Difference between a block's written and placed cutting moves beyond the rounding to `unit` mm; "" if none.

    Straight moves of a few units may vanish by rounding, or come to be.
    """
    if len(wanted) != len(written):
        wanted, written = ([move for move in moves if not _short(move, unit)] for moves in (wanted, written))
    if len(wanted) != len(written):
        return f"would be {len(written)} moves and not {len(wanted)}"
    pairs = zip(wanted, written, strict=True)
    return next((what for placed, move in pairs if (what := _difference(turn, placed, move, unit))), "")


def _short(move: Move, unit: float) -> bool:
    """True if rounding to `unit` may make a move vanish."""
    longest = max(abs(e - s) for s, e in zip(move.start, move.end, strict=True))
    return move.arc is None and longest < SHORTEST_UNITS * unit


def _difference(turn: Turn, wanted: Move, written: Move, unit: float) -> str:
    """Difference between a written and a placed move, "" if none; `unit` is that of all steps of a word (L in G91)."""
    for where, share, units in PLACES if wanted.arc or written.arc else PLACES[:2]:
        placed, point = (point_at(move.start, move.end, move.arc, share) for move in (wanted, written))
        apart = math.dist(turn.point(placed[:3]), point[:3])
        if apart > units * unit:
            return f"is {apart:.4g} mm off {where}"
        if units == END_UNITS and (placed[3:] != point[3:] or not turn.keeps(placed[3:])):
            angle = angle_between(turn.rotations(np.array([placed[3:]]))[0], rotation_matrices(np.radians(point[3:])))
            if angle > END_UNITS * unit:
                return f"has its tool axis {angle:.4g} degrees off {where}"
    return ""
