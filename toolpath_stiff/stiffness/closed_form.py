"""Strut forces in closed form (`elimination`) for struts on a rigid platform, many poses at a time, with numpy only.

Nothing pivots, so the split is chosen once a machine (best determinants at its neutral pose), and every pose whose
determinants are small is handed to a pivoted solve.

Arrays are (component, strut, pose) with poses last, in blocks that stay in cache, so that memory does not grow with the
number of poses.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.machine.kinematics import solve_struts_at
from toolpath_stiff.machine.model import Hexapod, StrutLaw
from toolpath_stiff.stiffness.elimination import Vector, cross, dot, forces, over_struts, strut

BLOCK = 4096  # poses: with fewer, calls take the time; more do not fit the processor's cache
# Determinants of unit directions lie within 0 and 1. Above this the elimination loses up to seven of sixteen digits:
# at one pose in a hundred three or more, at most less than one (144,000 poses of random machines, many near singular).
SMALL_DETERMINANT = 1e-3


@dataclass(frozen=True)
class ClosedForm:
    """A machine prepared for the kernel: joints in the order of the split, strut law, size.

    Attributes
    ----------
    order
        (6,) struts, triplet A first.
    frame, platform
        (3, 6) m, joints in that order; platform joints relative to the tip, platform frame.
    law
        Stiffness of a strut by its length.
    arm
        m, size of the arms, which makes the second determinant a number without unit.
    """

    order: list[int]
    frame: FloatArray
    platform: FloatArray
    law: StrutLaw
    arm: float


def prepare(machine: Hexapod, tool_length: float = np.nan) -> ClosedForm:
    """Kernel form of a machine with a tool of a length (m; nan: the reference tool), made once for a machine."""

    def on_joints() -> ClosedForm:
        order, arm = machine.once("split", lambda: _split(machine))
        bodies = (machine.frame_joints, machine.platform_joints_for(tool_length))
        frame, platform = (np.ascontiguousarray(joints[order].T) for joints in bodies)
        return ClosedForm(order, frame, platform, machine.strut_law, arm)

    return machine.once(("closed form", str(float(tool_length))), on_joints)


def _split(machine: Hexapod) -> tuple[list[int], float]:
    """Struts, triplet A first, with the best determinants at the neutral pose; size of the arms, m.

    The elimination divides by det U_A and by det S, which is det J / det U_A.
    """
    struts = solve_struts_at(machine, machine.limits.neutral_pose)
    arm = float(np.linalg.norm(machine.platform_joints - machine.platform_joints.mean(axis=0), axis=1).mean())
    triplets = list(combinations(range(6), 3))
    first = np.abs(np.linalg.det(struts.directions[0][np.array(triplets)]))
    second = np.abs(np.linalg.det(struts.jacobian[0])) / arm**3 / np.maximum(first, 1e-12)
    best = triplets[int(np.round(np.minimum(first, second), 9).argmax())]  # the first of equal ones
    return [*best, *(i for i in range(6) if i not in best)], arm


def compliance_along_columns(
    kernel: ClosedForm,
    position: FloatArray,
    direction: FloatArray,
    rotation: FloatArray | None = None,
    strut_forces: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Compliance along one direction a pose, with the quantities that limits depend on.

    Parameters
    ----------
    kernel
        From `prepare`.
    position, direction
        (3, n) m and unit vectors, poses last; or (k, 3, n) vectors, k a pose.
    rotation
        (9, n) rows of the rotation matrices one after the other; None: vertical spindle.
    strut_forces
        (n, 6), to be filled with the forces in the machine's struts, N per N along the last of the directions.

    Returns
    -------
    compliance, determinant, lengths, good
        (n,) or (k, n) m/N; (n,) |det J| in m^3 (`kinematics.singularity_index` is its ratio to the neutral pose's);
        (6, n) m, struts in the machine's order; (n,) false where a determinant is small or the strut law gives no
        stiffness, and the exact route must be asked.
    """
    n, loads = position.shape[1], direction if direction.ndim == 3 else direction[None]
    compliance, determinant, lengths = np.empty((len(loads), n)), np.empty(n), np.empty((6, n))
    good = np.empty(n, dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for start in range(0, n, BLOCK):
            rows = slice(start, start + BLOCK)
            balanced, in_order, determinant[rows], sure = _balanced(kernel, position, loads, rotation, rows)
            lengths[kernel.order, rows] = in_order
            stiffness = kernel.law.stiffness(in_order)
            good[rows] = sure & (stiffness.min(axis=0) > 0.0)
            softness = np.divide(1.0, stiffness, out=stiffness)
            for along, force in zip(compliance, balanced, strict=True):
                along[rows] = over_struts(force, force, softness)
            if strut_forces is not None:
                strut_forces[rows, kernel.order] = np.array(balanced[-1]).T
            del balanced, in_order, stiffness, softness  # makes room in the cache for the next block
    good &= np.isfinite(compliance).all(axis=0)
    return compliance if direction.ndim == 3 else compliance[0], determinant, lengths, good


def _balanced(
    kernel: ClosedForm, position: FloatArray, loads: FloatArray, rotation: FloatArray | None, rows: slice
) -> tuple[list[Sequence[FloatArray]], FloatArray, FloatArray, BoolArray]:
    """Strut forces that balance each load at some poses, and strut lengths, both in the kernel's order.

    Then |det J|, and where neither of the determinants that the elimination divides by is small.
    """
    tip = position[:, rows]
    if rotation is None:
        arms, vectors = kernel.platform[:, :, None], tip[:, None] + (kernel.platform - kernel.frame)[:, :, None]
    else:
        turn = rotation[:, rows].reshape(3, 3, -1)
        arms = kernel.platform[0][:, None] * turn[:, 0, None]
        vectors = np.empty_like(arms)
        for d in (1, 2):
            arms += np.multiply(kernel.platform[d][:, None], turn[:, d, None], out=vectors)
        np.add(arms, tip[:, None], out=vectors)
        vectors -= kernel.frame[:, :, None]
    directions, moments, lengths = strut(vectors, arms)
    w, first = _inverse([c[:3] for c in directions])  # U_A^-1; matrices are columns
    rows_of_t = dot(w[:, :, None], [c[3:] for c in directions])  # t = U_A^-1 U_B
    of_a = np.concatenate([c[:3] for c in moments]).reshape(3, 3, -1).swapaxes(0, 1)
    taken = dot(of_a[:, :, None], rows_of_t[:, None])
    q, second = _inverse([whole[3:] - part for whole, part in zip(moments, taken, strict=True)])
    balanced = [forces(rows_of_t.swapaxes(0, 1), of_a, q, dot(w, load[:, rows])) for load in loads]
    large = (np.abs(first) > SMALL_DETERMINANT) & (np.abs(second) > SMALL_DETERMINANT * kernel.arm**3)
    return balanced, lengths, np.abs(first * second), large


def _inverse(matrix: Vector) -> tuple[FloatArray, FloatArray]:
    """Inverse of matrices, each row the components (3, m) of three columns: columns (3, m), and the determinant."""
    a, b, c = ([row[j] for row in matrix] for j in range(3))
    rows = np.concatenate([*cross(b, c), *cross(c, a), *cross(a, b)]).reshape(3, 3, -1)
    determinant = dot(a, rows[0])
    rows /= determinant
    return rows.swapaxes(0, 1), determinant
