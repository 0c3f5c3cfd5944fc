"""Up to two rotary axes between work and tool, on either side: their angles from the tool's direction, in closed form.

R = e^(a1 t1) e^(a2 t2) R0 with the axes in the order from the work to the tool, a joint of the work with its sign
turned. The tool's axis has two pairs of angles (Paden and Kahan's second subproblem; Murray, Li, Sastry, A Mathematical
Introduction to Robotic Manipulation, 1994, 3.3); of both the one whose turn about the tool axis is the one asked for.
"""

from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.machine.chain import turned, turned_from_left

ON_AXIS = 1e-9  # sine of the angle between tool and first axis below which that axis only spins the tool
ASIDE = 1e-6  # rad by which the tool's direction may be off: more than the rounding of words leaves


@dataclass(frozen=True)
class RotaryAxes:
    """At most two rotary axes, from the work to the tool.

    Attributes
    ----------
    joints
        Their numbers among the machine's joints.
    axes
        Unit vectors (3,) in work axes at joint values of 0.
    home
        (3, 3) the tool's axes there.
    """

    joints: list[int]
    axes: tuple[FloatArray, ...]
    home: FloatArray

    def rotation(self, angles: FloatArray) -> FloatArray:
        """(3, 3, n) tool axes in work axes at angles (k, n) rad."""
        total = self.home[..., None]
        for axis, angle in zip(reversed(self.axes), angles[::-1], strict=True):
            total = turned_about(axis, angle, total)
        return total

    def angles(self, rotation: FloatArray) -> tuple[FloatArray, BoolArray]:
        """(k, n) rad that point the tool as (3, 3, n), and (n,) whether any do."""
        best, *others = self._pairs(rotation)
        stand = self.rotation(best)
        for pair in others:
            other = self.rotation(pair)
            # The trace of R^T R(angles) is 3 where the turn about the tool's axis agrees too.
            better = (rotation * other).sum(axis=(0, 1)) > (rotation * stand).sum(axis=(0, 1)) + ASIDE
            best, stand = np.where(better, pair, best), np.where(better, other, stand)
        pointing = (rotation[:, 2] * stand[:, 2]).sum(axis=0)
        return best, np.asarray(pointing > 1.0 - 0.5 * ASIDE**2)  # 1 - cos of the angle is half its square

    def _pairs(self, rotation: FloatArray) -> list[FloatArray]:
        n = rotation.shape[2]
        if not self.axes:
            return [np.empty((0, n))]
        if len(self.axes) == 1:
            return [angle_about(self.axes[0], turned(rotation, self.home.T))[None]]
        first, second = self.axes
        tool, home = rotation[:, 2], self.home[:, 2]
        together = float(first @ second)
        aside = second - together * first
        across = np.cross(first, second)
        along, high = _dot(first, tool), np.sqrt((np.cross(first[:, None], tool, axis=0) ** 2).sum(axis=0))
        share = (float(second @ home) - together * along) / float(aside @ aside)
        left = high**2 - share**2 * float(aside @ aside)
        with np.errstate(invalid="ignore"):
            left = np.sqrt(np.where(np.abs(left) < 1e-15, 0.0, left) / float(across @ across))
        pairs = []
        for sign in (1.0, -1.0):
            between = first[:, None] * along + aside[:, None] * share + sign * across[:, None] * left
            t2 = _turn_between(second, np.broadcast_to(home[:, None], between.shape), between)
            t1 = _turn_between(first, between, tool)
            if len(idle := np.flatnonzero(high < ON_AXIS)):
                still = turned_about(second, t2[idle], self.home[..., None])
                t1[idle] = angle_about(first, np.einsum("ijn,kjn->ikn", rotation[..., idle], still))
            pairs.append(np.stack([t1, t2]))
        return pairs


def turned_about(axis: FloatArray, angle: FloatArray, axes: FloatArray) -> FloatArray:
    """(3, 3, n) axes (3, 3, n) turned about a constant unit vector (Rodrigues' formula)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    if np.count_nonzero(axis) == 1:  # about x, y or z only two rows mix
        i = int(np.flatnonzero(axis)[0])
        j, k, sine = (i + 1) % 3, (i + 2) % 3, sine * axis[i]
        out = np.empty((3, 3, len(angle)))
        out[i] = axes[i]
        np.subtract(cosine * axes[j], sine * axes[k], out=out[j])
        np.add(sine * axes[j], cosine * axes[k], out=out[k])
        return out
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    along = turned_from_left(np.outer(axis, axis), axes)
    return np.asarray(cosine * (axes - along) + sine * turned_from_left(cross, axes) + along)


def angle_about(axis: FloatArray, rotation: FloatArray) -> FloatArray:
    """(n,) rad, angle of the turn about a unit vector closest to rotations (3, 3, n)."""
    twice_sine = sum(axis[i] * (rotation[k, j] - rotation[j, k]) for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)))
    trace = rotation[0, 0] + rotation[1, 1] + rotation[2, 2]
    return np.asarray(np.arctan2(twice_sine, trace - np.einsum("i,ijn,j->n", axis, rotation, axis)))


def _turn_between(axis: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """(n,) rad, angle about a unit vector that turns vectors (3, n) into others."""
    sine = _dot(axis, np.cross(start, end, axis=0))
    return np.asarray(np.arctan2(sine, (start * end).sum(axis=0) - _dot(axis, start) * _dot(axis, end)))


def _dot(vector: FloatArray, columns: FloatArray) -> FloatArray:
    """(n,) products of a constant vector and vectors (3, n), the same to the last bit on every processor."""
    return np.asarray((vector[:, None] * columns).sum(axis=0))
