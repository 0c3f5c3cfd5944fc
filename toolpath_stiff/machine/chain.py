"""Chains of joints: frames of all links at n poses, described by Denavit-Hartenberg rows or by origin and axis.

Every joint turns about, or slides along, the z axis of its own frame, whose place in the frame before is constant.
Within, arrays are columns: rotations (3, 3, n), vectors (3, n), joint values (j, n); n = 1 while nothing has moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rotations import rotation_matrices

TINY = 1e-15  # entries of a rotation matrix below it are the rounding of a right angle


@dataclass(frozen=True)
class Frame:
    """A frame in base axes at n poses: axes (3, 3, n), the middle index is the column; origin (3, n)."""

    axes: FloatArray
    origin: FloatArray

    def moved(self, place: FixedFrame) -> Frame:
        """Frame fixed in this one at a placement."""
        return Frame(turned(self.axes, place.axes), self.origin + applied(self.axes, place.origin))

    def point(self, place: FloatArray) -> FloatArray:
        """(n, 3) a point (3,) of this frame in base axes; (3,) if the frame is the same at all poses."""
        return rows_of(self.origin + applied(self.axes, place) if place.any() else self.origin)

    @property
    def placement(self) -> FixedFrame:
        """Placement in the base, for a frame that is the same at all poses."""
        return FixedFrame(self.axes[..., 0], self.origin[:, 0])

    def turn(self, axes: FloatArray) -> FloatArray:
        """(n, 3, 3) axes (3, 3) of this frame in base axes; (3, 3) if the frame is the same at all poses."""
        return rows_of(turned(self.axes, axes))


@dataclass(frozen=True)
class FixedFrame:
    """Constant placement of one body in another: axes (3, 3), its axes as columns; origin (3,) m."""

    axes: FloatArray
    origin: FloatArray

    def then(self, other: FixedFrame) -> FixedFrame:
        """Composition with `other`, a placement given in this one's frame."""
        return FixedFrame(self.axes @ other.axes, self.axes @ other.origin + self.origin)

    def longer(self, by: float) -> FixedFrame:
        """Placement moved further away by this many m; one at the origin stays there."""
        length = float(np.linalg.norm(self.origin))
        return FixedFrame(self.axes, self.origin * (1.0 + by / length)) if length else self

    def inverse(self) -> FixedFrame:
        """Placement of the other body in this one."""
        return FixedFrame(self.axes.T, -self.axes.T @ self.origin)


def placement(xyz: ArrayLike = (0.0, 0.0, 0.0), rpy: ArrayLike = (0.0, 0.0, 0.0)) -> FixedFrame:
    """Placement from m and roll, pitch, yaw in rad, R = Rz(yaw) Ry(pitch) Rx(roll), as in URDF; right angles exact."""
    axes = rotation_matrices(np.asarray(rpy, dtype=float))
    return FixedFrame(np.where(np.abs(axes) < TINY, 0.0, axes), np.asarray(xyz, dtype=float))


STILL = placement()


@dataclass(frozen=True)
class ChainJoint:
    """One joint of a chain.

    Attributes
    ----------
    name
        Its name.
    linear
        Whether it slides; else it turns.
    place
        Its frame in the frame before, at value 0; it moves along or about z.
    low, high
        m or rad; inf: no limit.
    given
        The axes that its description gave the frame, in the frame.
    speed
        m/s or rad/s that it reaches; inf: nobody says.
    stands
        m or rad: where it stands on a machine whose poses do not take it.
    """

    name: str
    linear: bool
    place: FixedFrame
    low: float = -np.inf
    high: float = np.inf
    given: FixedFrame = STILL
    speed: float = np.inf
    stands: float = 0.0


def modified_dh(alpha: float, a: float, offset: float, d: float) -> FixedFrame:
    """FixedFrame at joint value 0 by modified DH: Rx(alpha) Tx(a) Rz(offset) Tz(d) (Craig, Robotics, 3.6)."""
    return placement((a, 0.0, 0.0), (alpha, 0.0, 0.0)).then(placement((0.0, 0.0, d), (0.0, 0.0, offset)))


def standard_dh(alpha: float, a: float, offset: float, d: float) -> FixedFrame:
    """FixedFrame after a joint by standard DH: Rz(offset) Tz(d) Tx(a) Rx(alpha) (Denavit and Hartenberg, 1955)."""
    return placement((0.0, 0.0, d), (0.0, 0.0, offset)).then(placement((a, 0.0, 0.0), (alpha, 0.0, 0.0)))


def aligned(axis: ArrayLike) -> FixedFrame:
    """A placement whose z is a direction, turned from z by the shortest way."""
    direction = np.asarray(axis, dtype=float)
    x, y, z = direction / np.linalg.norm(direction)
    if z < -1.0 + 1e-12:
        return placement(rpy=(np.pi, 0.0, 0.0))
    share = 1.0 / (1.0 + z)  # Rodrigues' formula about (-y, x, 0)
    axes = np.array([[1.0 - x * x * share, -x * y * share, x], [-x * y * share, 1.0 - y * y * share, y], [-x, -y, z]])
    return FixedFrame(axes, np.zeros(3))


def chain_frames(joints: Sequence[ChainJoint], values: FloatArray) -> list[Frame]:
    """Frames of the base and of every joint, moved, at joint values (j, n) m or rad."""
    frames = [Frame(np.eye(3)[..., None], np.zeros((3, 1)))]
    for joint, value in zip(joints, values, strict=True):
        before = frames[-1]
        x, y, z = (applied(before.axes, column) for column in joint.place.axes.T)
        origin = before.origin + applied(before.axes, joint.place.origin)
        if joint.linear:
            frames.append(Frame(np.stack([x, y, z], axis=1), origin + value * z))
        else:
            frames.append(Frame(_about_z(x, y, z, value), origin))
    return frames


def _about_z(x: FloatArray, y: FloatArray, z: FloatArray, angle: FloatArray) -> FloatArray:
    """(3, 3, n) axes x, y, z (3, n) turned about z."""
    cosine, sine = np.cos(angle), np.sin(angle)
    axes = np.empty((3, 3, len(angle)))
    part = np.empty((3, len(angle)))
    np.add(np.multiply(x, cosine, out=axes[:, 0]), np.multiply(y, sine, out=part), out=axes[:, 0])
    np.subtract(np.multiply(y, cosine, out=axes[:, 1]), np.multiply(x, sine, out=part), out=axes[:, 1])
    axes[:, 2] = z
    return axes


def turned(axes: FloatArray, by: FloatArray) -> FloatArray:
    """(3, 3, n) product of rotations (3, 3, n) and a constant one (3, 3)."""
    if np.array_equal(by, np.eye(3)):
        return axes
    return np.stack([applied(axes, column) for column in by.T], axis=1)


def turned_from_left(by: FloatArray, axes: FloatArray) -> FloatArray:
    """(3, 3, n) product of a constant rotation (3, 3) and rotations (3, 3, n)."""
    return turned(axes.swapaxes(0, 1), by.T).swapaxes(0, 1)


def applied(axes: FloatArray, vector: FloatArray) -> FloatArray:
    """(3, n) product of rotations (3, 3, n) and a constant vector (3,); 0 and 1 cost no multiplication."""
    total = None
    for k, factor in enumerate(vector.tolist()):
        if factor:
            term = axes[:, k] if factor == 1.0 else axes[:, k] * factor
            total = term if total is None else total + term
    return np.zeros((3, axes.shape[2])) if total is None else total


def columns_of(rows: FloatArray) -> FloatArray:
    """Rows (n, ...) as columns (..., n), a view."""
    return np.moveaxis(rows, 0, -1)


def rows_of(columns: FloatArray) -> FloatArray:
    """Columns (..., n) as rows (n, ...), a view; without that axis if n is 1."""
    return columns[..., 0] if columns.shape[-1] == 1 else np.moveaxis(columns, -1, 0)
