"""Elements of a load path: the compliant parts between work and tool, and their loads under a wrench at the tip.

A wrench w = (force, moment about the tip), base axes, puts the loads S w on an element; its compliances c turn them
into the tip's motion C w, C = sum S^T diag(c) S over all elements, whether they carry the tool or the work. A body that
gives way is a spring of three translations and three rotations at a place o, in axes R: its force is R^T f, its moment
R^T (m + (p - o) x f) under a force f and moment m at the tip p.
Arrays lead with the pose; they are made as columns (poses last) and handed out transposed, so that sums over many
poses run along memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import ArrayColumns, BoolArray, FloatArray, IntArray

TORSION = ".torsion_nrad_per_Nm"  # after a joint's name: its torsion among fitted parameters
SIX = ("along x", "along y", "along z", "about x", "about y", "about z")


@dataclass(frozen=True)
class Element:
    """A compliant part of the load path, the same at every pose.

    Attributes
    ----------
    name
        The machine's word for it: "joint 3", "X carriage", "rod 2".
    link
        Where it is in the load path: tool, joints, struts, frame, table.
    directions
        Names of its loads, as many as it has compliances.
    """

    name: str
    link: str
    directions: tuple[str, ...] = SIX


def joint_element(joint: str) -> str:
    """Name of the element of a turning joint: "joint 3" for J3, "joint A" for A."""
    return f"joint {joint[1:]}" if joint[:1] in "Jj" and joint[1:].isdigit() else f"joint {joint}"


def turns(element: Element) -> bool:
    """True for a joint that turns: its last load is the moment about its axis."""
    return element.link == "joints" and element.directions == SIX


@dataclass(frozen=True)
class Spring:
    """A compliant body at a place, at n poses; quantities constant over poses have no leading axis.

    Attributes
    ----------
    place
        (n, 3) or (3,) m, base axes.
    axes
        (n, 3, 3) or (3, 3), columns are its axes; None: base axes.
    compliance
        (6,) or (n, 6): three m/N along, three rad/(N m) about its axes.
    """

    place: FloatArray
    axes: FloatArray | None
    compliance: FloatArray

    def rows(self, tip: FloatArray) -> FloatArray:
        """(n, 6, 6) its force and moment, in its axes, per unit wrench at the tip (n, 3)."""
        columns = np.eye(3) if self.axes is None else self.axes
        turn = np.swapaxes(np.broadcast_to(columns, (len(tip), 3, 3)), 1, 2)
        rows = np.zeros((len(tip), 6, 6))
        rows[:, :3, :3] = rows[:, 3:, 3:] = turn
        rows[:, 3:, :3] = turn @ cross_form(tip - self.place)  # the moment about its place: m + (p - o) x f
        return rows

    def take(self, rows: IntArray | BoolArray | slice) -> Spring:
        """Spring at some of the poses."""
        axes = self.axes if self.axes is None or self.axes.ndim == 2 else self.axes[rows]
        place, compliance = (array if array.ndim == 1 else array[rows] for array in (self.place, self.compliance))
        return Spring(place, axes, compliance)


@dataclass(frozen=True)
class LoadRows:
    """Loads given directly, at n poses: of a strut, a rod, a carriage of rods.

    Attributes
    ----------
    loads
        (n, k, 6) per unit wrench at the tip.
    compliance
        (k,) or (n, k) m/N, rad/(N m).
    """

    loads: FloatArray
    compliance: FloatArray

    def rows(self, tip: FloatArray) -> FloatArray:
        """(n, k, 6) loads per unit wrench at the tip."""
        return np.broadcast_to(self.loads, (len(tip), *self.loads.shape[1:]))

    def take(self, rows: IntArray | BoolArray | slice) -> LoadRows:
        """Loads at some of the poses."""
        return LoadRows(self.loads[rows], self.compliance if self.compliance.ndim == 1 else self.compliance[rows])


@dataclass(frozen=True)
class Stance(ArrayColumns):
    """Stance of a machine at n poses.

    Attributes
    ----------
    joints
        (n, j) m or rad; nan where no joint values reach the pose.
    position
        (n, 3) m, the tip in base axes.
    rotation
        (n, 3, 3) tool axes in base axes; None: the base's.
    work_axes
        (n, 3, 3), turn vectors in work axes into base axes; None: the work does not turn.
    configuration
        (n,) index into the machine's configurations.
    loads
        What each of the machine's elements carries.
    """

    joints: FloatArray
    position: FloatArray
    rotation: FloatArray | None
    work_axes: FloatArray | None
    configuration: IntArray
    loads: tuple[Spring | LoadRows, ...]

    def __len__(self) -> int:
        return len(self.joints)

    @property
    def axes(self) -> FloatArray:
        """(n, 3, 3) tool axes in base axes."""
        return np.broadcast_to(np.eye(3) if self.rotation is None else self.rotation, (len(self), 3, 3))

    def take(self, rows: IntArray | BoolArray | slice) -> Stance:
        """Stance at some of the poses."""
        return replace(super().take(rows), loads=tuple(load.take(rows) for load in self.loads))

    def tip_compliance(self) -> FloatArray:
        """(n, 6, 6) compliance of the tip: m/N, rad/N, rad/(N m); rows and columns force first, base axes."""
        total = np.zeros((len(self), 6, 6))
        for load in self.loads:
            rows = load.rows(self.position)
            total += np.einsum("nki,nk,nkj->nij", rows, np.broadcast_to(load.compliance, rows.shape[:2]), rows)
        return total


def cross_form(vector: FloatArray) -> FloatArray:
    """(..., 3, 3) matrices of the cross product with vectors (..., 3) from the left."""
    form = np.zeros((*vector.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        form[..., i, j], form[..., j, i] = -vector[..., k], vector[..., k]
    return form


def beam_compliance(length: FloatArray | float, stiffness: Sequence[float]) -> FloatArray:
    """(..., 6) compliance of an Euler-Bernoulli beam as a spring at its middle, local x along it.

    There its couplings vanish: L/EA, L^3/12EIz, L^3/12EIy, L/GJ, L/EIy, L/EIz; moved to the loaded end they are the
    cantilever's (Gere and Timoshenko, Mechanics of Materials, appendix G). `stiffness` is EA (N), EIy, EIz, GJ (N m2).
    """
    ea, eiy, eiz, gj = stiffness
    span = np.asarray(length, dtype=float)
    bending = span**3 / 12.0
    return np.stack([span / ea, bending / eiz, bending / eiy, span / gj, span / eiy, span / eiz], axis=-1)


def beam_axes(along: FloatArray, near_z: FloatArray) -> FloatArray:
    """(..., 3, 3) columns: x along vectors (..., 3), z closest to others (..., 3) or (3,), y = z cross x."""
    x = along / np.linalg.norm(along, axis=-1, keepdims=True)
    z = near_z - (x * near_z).sum(axis=-1, keepdims=True) * x
    z = z / np.linalg.norm(z, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def rod_forces(directions: FloatArray, arms: FloatArray) -> FloatArray:
    """(n, 6, 6) forces in six rods per unit wrench at the tip, W^-1, W = [u_i; r_i x u_i]; nan where it is singular.

    Of rods along unit vectors u_i (n, 6, 3) that meet the platform at r_i (n, 6, 3) from the tip.
    """
    wrenches = np.swapaxes(np.concatenate([directions, np.cross(arms, directions)], axis=-1), -1, -2)
    try:
        return np.asarray(np.linalg.inv(wrenches))
    except np.linalg.LinAlgError:
        singular = ~(np.abs(np.linalg.det(wrenches)) > 0.0)
        return np.where(
            singular[:, None, None], np.nan, np.linalg.inv(np.where(singular[:, None, None], np.eye(6), wrenches))
        )


def body_under_rods(forces: FloatArray, directions: FloatArray, arms: FloatArray, axes: FloatArray) -> FloatArray:
    """(n, 6, 6) force and moment on a body that carries k rods, in its axes, per unit wrench at the tip.

    `forces` (n, k, 6) are the rods', along `directions` (n, k, 3) at `arms` (n, k, 3) or (k, 3) from the body's place;
    `axes` (3, 3) or (n, 3, 3).
    """
    moments = np.cross(np.broadcast_to(arms, directions.shape), directions)
    local = np.concatenate([directions @ axes, moments @ axes], axis=-1)
    return np.asarray(np.swapaxes(local, -1, -2) @ forces)
