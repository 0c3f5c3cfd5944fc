"""Tip compliance in closed form (`elimination`), many poses at a time, numpy alone; for struts on a rigid platform.

Nothing pivots, so the split is chosen once a machine (best determinants at its neutral pose), and every pose whose
determinants are small is handed to a pivoted solve.

Arrays are (component, strut, pose) with poses last, in blocks that stay in cache, so that memory does not grow with the
number of poses.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.machine.kinematics import LENGTH_TOLERANCE, solve_struts_at
from toolpath_stiff.machine.model import Hexapod, StrutLaw
from toolpath_stiff.stiffness.elimination import Vector, cross, dot, forces, over_struts, strut

BLOCK = 2048  # poses: some 1 MB of work arrays, which stay in a core's second-level cache
# Determinants of unit directions lie within 0 and 1. Above this the elimination loses up to seven of sixteen digits:
# at one pose in a hundred three or more, at most less than one (144,000 poses of random machines, many near singular).
SMALL_DETERMINANT = 1e-3
FOLLOWING_STEPS = 25  # a platform radius 1 mm off takes three


@dataclass(frozen=True)
class ClosedForm:
    """A machine prepared for the kernel: joints in the order of the split, strut law, scale.

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


def prepare(machine: Hexapod, tool_length: float = np.nan, split_of: Hexapod | None = None) -> ClosedForm:
    """The kernel's form of a machine with a tool of that length (m; nan: the reference tool), made once a machine.

    `split_of`: in the order of struts of another machine, which differs from it by little.
    """

    def on_joints() -> ClosedForm:
        other = split_of or machine
        order, arm = other.once("split", lambda: _split(other))
        bodies = (machine.frame_joints, machine.platform_joints_for(tool_length))
        frame, platform = (np.ascontiguousarray(joints[order].T) for joints in bodies)
        return ClosedForm(order, frame, platform, machine.strut_law, arm)

    key = ("closed form", "reference" if np.isnan(tool_length) else float(tool_length))
    return on_joints() if split_of else machine.once(key, on_joints)


def _split(machine: Hexapod) -> tuple[list[int], float]:
    """Struts, triplet A first, by the best determinants at the neutral pose; m, the size of the arms."""
    struts = solve_struts_at(machine, machine.limits.neutral_pose)
    directions, arms = struts.directions[0], struts.arms[0]
    arm = float(np.linalg.norm(machine.platform_joints - machine.platform_joints.mean(axis=0), axis=1).mean())
    moments = np.cross(arms, directions)

    def quality(first: tuple[int, ...]) -> float:
        """The smaller of the two determinants that the split divides by."""
        a, b = list(first), [i for i in range(6) if i not in first]
        leading = np.linalg.det(directions[a])
        if abs(leading) < 1e-12:
            return 0.0
        rest = moments[b].T - moments[a].T @ np.linalg.solve(directions[a].T, directions[b].T)
        return float(min(abs(leading), abs(np.linalg.det(rest)) / arm**3))

    best = max(combinations(range(6), 3), key=quality)
    return [*best, *(i for i in range(6) if i not in best)], arm


def well_conditioned(kernel: ClosedForm, first: FloatArray, second: FloatArray) -> BoolArray:
    """Where neither of the determinants that the elimination divides by is small."""
    small = SMALL_DETERMINANT
    return np.asarray((np.abs(first) > small) & (np.abs(second) > small * kernel.arm**3))


class _Block:
    """Struts of some poses, and what the elimination takes of them, matrices as columns.

    `w` is U_A^-1, `t` U_A^-1 U_B, `moments` M_A, `q` the inverse of S = M_B - M_A U_A^-1 U_B.
    """

    def __init__(self, kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None) -> None:
        """Of positions (3, m) and rotations (3, 3, m); None: vertical spindle."""
        self.kernel = kernel
        self.arms, vectors = _struts(kernel, position, rotation)
        self.directions, moments, self.lengths = strut(vectors, self.arms)
        self.w, first = _inverse([c[:3] for c in self.directions])
        self.rows = dot(self.w[:, :, None], [c[3:] for c in self.directions])  # of t
        self.t = self.rows.swapaxes(0, 1)
        self.moments = np.concatenate([c[:3] for c in moments]).reshape(3, 3, -1).swapaxes(0, 1)
        taken = dot(self.moments[:, :, None], self.rows[:, None])
        s = [whole[3:] - part for whole, part in zip(moments, taken, strict=True)]
        self.q, second = _inverse(s)
        self.determinant = np.abs(first * second)
        self.good = well_conditioned(kernel, first, second)

    def strut_compliances(self) -> tuple[FloatArray, BoolArray]:
        """1 / k(L), (6, m) m/N, and where every strut has a stiffness above zero: beyond, the exact route complains."""
        stiffness = self.kernel.law.stiffness(self.lengths)
        law_holds = stiffness.min(axis=0) > 0.0
        return np.divide(1.0, stiffness, out=stiffness), np.asarray(law_holds)

    def forces(self, load: Vector) -> Sequence[FloatArray]:
        """Forces in the six struts that balance forces (3, m) at the tip."""
        return forces(self.t, self.moments, self.q, dot(self.w, load))


def _inverse(matrix: Vector) -> tuple[FloatArray, FloatArray]:
    """Inverse of matrices, each row the components (3, m) of three columns: columns (3, m), and the determinant."""
    a, b, c = ([row[j] for row in matrix] for j in range(3))
    rows = np.concatenate([*cross(b, c), *cross(c, a), *cross(a, b)]).reshape(3, 3, -1)
    determinant = dot(a, rows[0])
    rows /= determinant
    return rows.swapaxes(0, 1), determinant


def _struts(kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    """Arms and struts as vectors in base axes, (3, 6, m) or (3, 6, 1)."""
    if rotation is None:
        arms = kernel.platform[:, :, None]
        return arms, position[:, None] + (kernel.platform - kernel.frame)[:, :, None]
    arms = kernel.platform[0][:, None] * rotation[:, 0, None]
    vectors = np.empty_like(arms)
    for d in (1, 2):
        arms += np.multiply(kernel.platform[d][:, None], rotation[:, d, None], out=vectors)
    np.add(arms, position[:, None], out=vectors)
    vectors -= kernel.frame[:, :, None]
    return arms, vectors


def _blocks(n: int) -> Iterator[slice]:
    return (slice(start, min(start + BLOCK, n)) for start in range(0, n, BLOCK))


def _turns(rotation: FloatArray | None, rows: slice) -> FloatArray | None:
    return None if rotation is None else rotation[:, rows].reshape(3, 3, -1)


def tip_compliance(
    kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, BoolArray]:
    """Tip compliance and where it may be trusted.

    Parameters
    ----------
    kernel
        From `prepare`.
    position
        (n, 3) m.
    rotation
        (n, 3, 3); None: vertical spindle.

    Returns
    -------
    compliance, good
        (n, 3, 3) m/N; (n,) false where a determinant is small and a pivoted solve must be used instead.
    """
    n = len(position)
    compliance, good = np.empty((n, 3, 3)), np.empty(n, dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for rows in _blocks(n):
            turn = None if rotation is None else np.ascontiguousarray(np.moveaxis(rotation[rows], 0, -1))
            block = _Block(kernel, np.ascontiguousarray(position[rows].T), turn)
            out = compliance[rows]
            unit = block.w.swapaxes(0, 1)  # U_A^-1 F of three unit forces F at once
            t, moments, q = (matrix[:, :, None] for matrix in (block.t, block.moments, block.q))
            influence = np.concatenate(forces(t, moments, q, unit)).reshape(6, 3, -1)
            strut_compliance, law_holds = block.strut_compliances()
            weighted = influence * strut_compliance[:, None]
            for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
                out[:, i, j] = out[:, j, i] = (weighted[:, i] * influence[:, j]).sum(axis=0)
            good[rows] = law_holds & block.good & np.isfinite(out[:, 2, 2])
            del block, influence, weighted, strut_compliance, t, moments, q, unit
    return compliance, good


def compliance_along_columns(
    kernel: ClosedForm, position: FloatArray, direction: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Compliance along one direction a pose, with what the limits ask for; cheaper than the whole tensor.

    Parameters
    ----------
    kernel
        From `prepare`.
    position, direction
        (3, n) m and unit vectors, poses last; or (k, 3, n) vectors, k a pose.
    rotation
        (9, n) rows of the rotation matrices one after the other; None: vertical spindle.

    Returns
    -------
    compliance, determinant, lengths, good
        (n,) or (k, n) m/N; (n,) |det J| in m^3 (`kinematics.singularity_index` is its ratio to the neutral pose's);
        (6, n) m, struts in the machine's order; (n,) as in `tip_compliance`.
    """
    n, loads = position.shape[1], direction if direction.ndim == 3 else direction[None]
    compliance, determinant, lengths = np.empty((len(loads), n)), np.empty(n), np.empty((6, n))
    good = np.empty(n, dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for rows in _blocks(n):
            block = _Block(kernel, position[:, rows], _turns(rotation, rows))
            for number, values in zip(kernel.order, block.lengths, strict=True):
                lengths[number, rows] = values
            strut_compliance, law_holds = block.strut_compliances()
            determinant[rows], good[rows] = block.determinant, law_holds & block.good
            for load, along in zip(loads, compliance, strict=True):
                force = block.forces(load[:, rows])
                along[rows] = over_struts(force, force, strut_compliance)
                good[rows] &= np.isfinite(along[rows])
            del block, force, strut_compliance  # the next block takes their room in the cache
    return compliance if direction.ndim == 3 else compliance[0], determinant, lengths, good


def strut_forces_columns(
    kernel: ClosedForm, position: FloatArray, direction: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, BoolArray]:
    """Strut forces (n, 6) N per N along one direction a pose, and where they may be trusted (n,).

    Arguments as of `compliance_along_columns`, with one direction.
    """
    n = position.shape[1]
    force, good = np.empty((n, 6)), np.empty(n, dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for rows in _blocks(n):
            block = _Block(kernel, position[:, rows], _turns(rotation, rows))
            force[rows, kernel.order] = np.array(block.forces(direction[:, rows])).T
            good[rows] = block.good & np.isfinite(force[rows]).all(axis=1)
            del block
    return force, good


def followed_columns(
    kernel: ClosedForm, control: ClosedForm, position: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Where a platform goes whose struts get the lengths that a control computes for the poses on its own geometry.

    `control` has the joints of the control's machine in the order of `kernel`; the other arguments as of
    `compliance_along_columns`. Newton's method with the first inverse throughout: geometries differ by little.

    Returns
    -------
    position, rotation, good
        (3, n) m, (9, n), and (n,) where the lengths are met.
    """
    n = position.shape[1]
    tips, turns, good = position.copy(), np.empty((9, n)), np.empty(n, dtype=bool)
    turns[:] = np.eye(3).reshape(9, 1) if rotation is None else rotation
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for rows in _blocks(n):
            tip, turn, programmed = tips[:, rows], turns[:, rows].reshape(3, 3, -1), _turns(rotation, rows)
            wanted, left = _lengths(control, tip, programmed), np.full(tip.shape[1], np.inf)
            block = _Block(kernel, tip, programmed)
            missing, before = wanted - block.lengths, np.array(kernel.arm)
            for _ in range(FOLLOWING_STEPS):
                shift, spin = _twist(block, missing)
                tip, turn = tip + shift, _spun(spin, turn)
                error = np.abs(missing).max(axis=0)
                left = error * error / before  # a step shortens what is missing as the one before it did
                if not (left > LENGTH_TOLERANCE).any():
                    break
                missing = wanted - _lengths(kernel, tip, turn)
                before = np.maximum(error, LENGTH_TOLERANCE)
            tips[:, rows], turns[:, rows] = tip, turn.reshape(9, -1)
            good[rows] = left <= LENGTH_TOLERANCE
    return tips, turns, good


def _lengths(kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None) -> FloatArray:
    vectors = _struts(kernel, position, rotation)[1]
    return np.sqrt(dot(vectors, vectors))


def _twist(block: _Block, missing: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shift (3, m) and turn (3, m) of the tip that lengthen the struts by (6, m)."""
    a, b = missing[:3], missing[3:]
    x = b - dot(block.rows, a)
    spin = np.array([dot(column, x) for column in block.q])
    rest = a - dot(block.moments.swapaxes(0, 1), spin)
    return np.array([dot(column, rest) for column in block.w]), spin


def _spun(spin: FloatArray, turn: FloatArray) -> FloatArray:
    """Orientations (3, 3, m) turned further by small vectors (3, m), by Cayley's formula: a rotation to all digits."""
    half = 0.5 * spin
    scale = 2.0 / (1.0 + dot(half, half))
    across = np.array(cross(half, turn))
    return np.asarray(turn + scale * (across + np.array(cross(half, across))))
