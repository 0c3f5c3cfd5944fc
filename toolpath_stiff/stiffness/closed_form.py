"""Tip compliance in closed form, many poses at a time, numpy alone; for struts on a rigid platform.

Equilibrium J^T f = w of the exact route, solved by 3 x 3 blocks instead of a pivoted 6 x 6: the struts are split into
two triplets A and B, forces are eliminated first,

    f_A = U_A^-1 (F - U_B f_B),    (M_B - M_A U_A^-1 U_B) f_B = -M_A U_A^-1 F,

with U the strut directions and M = r x u their moments about the tip as columns. 3 x 3 inverses are cross products.
Nothing pivots, so the split is chosen once a machine (best determinants at its neutral pose), and every pose whose
determinants are small is handed to a pivoted solve.

Arrays are (component, strut, pose) with poses last, in blocks that stay in cache; a block's work arrays are allocated
once and reused, so that memory does not grow with the number of poses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.machine.kinematics import LENGTH_TOLERANCE, Struts, solve_struts_at
from toolpath_stiff.machine.model import Machine, StrutLaw

BLOCK = 2048  # poses; the nine-row work arrays (150 kB each) then stay in a core's second-level cache
# Determinants of unit directions lie within 0 and 1. At 1e-3 the elimination loses three of sixteen digits.
SMALL_DETERMINANT = 1e-3
FOLLOWING_STEPS = 25  # a platform radius 1 mm off takes three
NEXT, LAST = [1, 2, 0], [2, 0, 1]


@dataclass(frozen=True)
class ClosedForm:
    """A machine prepared for the kernel: joints in the order of the split, strut law, scale.

    Attributes
    ----------
    order
        (6,) struts, triplet A first.
    frame, platform
        (3, 6) m, joints in that order; platform joints relative to the tip, platform frame.
    intercept, slope
        Strut law k(L) = intercept + slope L, N/m and N/m per m.
    table
        The law where it is a table, which `intercept` and `slope` do not describe; None otherwise.
    arm
        m, size of the arms, which makes the second determinant a number without unit.
    """

    order: tuple[int, ...]
    frame: FloatArray
    platform: FloatArray
    intercept: float
    slope: float
    table: StrutLaw | None
    arm: float


def prepare(machine: Machine, tool_length: float = np.nan) -> ClosedForm:
    """The kernel's form of a machine with a tool of that length (m; nan: the reference tool), made once a machine."""
    key = ("closed form", "reference" if np.isnan(tool_length) else float(tool_length))
    if key not in machine.derived:
        order, arm = _split(machine)
        machine.derived[key] = ClosedForm(
            order=order,
            frame=np.ascontiguousarray(machine.frame_joints[list(order)].T),
            platform=np.ascontiguousarray(machine.platform_joints_for(tool_length)[list(order)].T),
            intercept=machine.strut_law.intercept,
            slope=machine.strut_law.slope,
            table=machine.strut_law if machine.strut_law.shape else None,
            arm=arm,
        )
    found: ClosedForm = machine.derived[key]
    return found


def _split(machine: Machine) -> tuple[tuple[int, ...], float]:
    """Struts, triplet A first, by the best determinants at the neutral pose; m, the size of the arms."""
    if "split" in machine.derived:
        known: tuple[tuple[int, ...], float] = machine.derived["split"]
        return known
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
    machine.derived["split"] = (*best, *(i for i in range(6) if i not in best)), arm
    return _split(machine)


class _Work:
    """Work arrays of one block."""

    def __init__(self, size: int) -> None:
        self.arms = np.empty((3, 6, size))
        self.directions = np.empty((3, 6, size))
        self.moments = np.empty((3, 6, size))
        self.length = np.empty((6, size))
        self.inverse_length = np.empty((6, size))
        self.six = np.empty((6, size))
        self.w, self.t, self.n, self.s, self.q, self.nine = (np.empty((3, 3, size)) for _ in range(6))
        self.influence = np.empty((6, 3, size))


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
    compliance = np.empty((n, 3, 3))
    good = np.empty(n, dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for rows, work in _blocks(n):
            tip = np.ascontiguousarray(position[rows].T)
            turn = None if rotation is None else np.ascontiguousarray(np.moveaxis(rotation[rows], 0, -1))
            good[rows] = _tensor_block(kernel, tip, turn, work, compliance[rows])
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
        for rows, work in _blocks(n):
            turn = None if rotation is None else rotation[:, rows].reshape(3, 3, -1)
            first, second = _eliminate(kernel, position[:, rows], turn, work)
            for strut, values in zip(kernel.order, work.length, strict=True):
                lengths[strut, rows] = values
            good[rows] = _strut_compliances(kernel, work) & well_conditioned(kernel, first, second)
            np.abs(first * second, out=determinant[rows])
            for load, along in zip(loads, compliance, strict=True):
                force = _forces(work, load[:, rows])
                np.multiply(force, force, out=force)
                force *= work.six
                force.sum(axis=0, out=along[rows])
                good[rows] &= np.isfinite(along[rows])
    return compliance if direction.ndim == 3 else compliance[0], determinant, lengths, good


def strut_forces_columns(
    kernel: ClosedForm, position: FloatArray, direction: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, Struts, BoolArray]:
    """Strut forces (n, 6) N per N along one direction a pose, the struts, and where the forces may be trusted (n,).

    Arguments as of `compliance_along_columns`, with one direction.
    """
    n, order = position.shape[1], list(kernel.order)
    forces, good = np.empty((n, 6)), np.empty(n, dtype=bool)
    struts = Struts(np.empty((n, 6)), np.empty((n, 6, 3)), np.empty((n, 6, 3)))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for rows, work in _blocks(n):
            turn = None if rotation is None else rotation[:, rows].reshape(3, 3, -1)
            first, second = _eliminate(kernel, position[:, rows], turn, work)
            arms = kernel.platform[:, :, None] if turn is None else work.arms
            struts.lengths[rows, order] = work.length.T
            struts.directions[rows, order], struts.arms[rows, order] = work.directions.T, arms.T
            forces[rows, order] = _forces(work, direction[:, rows]).T
            good[rows] = well_conditioned(kernel, first, second) & np.isfinite(forces[rows]).all(axis=1)
    return forces, struts, good


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
        for (rows, first), (_, work) in zip(_blocks(n), _blocks(n), strict=True):
            tip, turn = tips[:, rows], turns[:, rows].reshape(3, 3, -1)
            _strut_lengths(control, tip, None if rotation is None else turn, work)
            wanted, left = work.length.copy(), np.full(tip.shape[1], np.inf)
            _eliminate(kernel, tip, None if rotation is None else turn, first)
            missing, before = wanted - first.length, np.array(kernel.arm)
            for _ in range(FOLLOWING_STEPS):
                shift, spin = _twist(first, missing)
                tip, turn = tip + shift, _spun(spin, turn)
                error = np.abs(missing).max(axis=0)
                left = error * error / before  # a step shortens what is missing as the one before it did
                if not (left > LENGTH_TOLERANCE).any():
                    break
                _strut_lengths(kernel, tip, turn, work)
                missing, before = wanted - work.length, np.maximum(error, LENGTH_TOLERANCE)
            tips[:, rows], turns[:, rows] = tip, turn.reshape(9, -1)
            good[rows] = left <= LENGTH_TOLERANCE
    return tips, turns, good


def _twist(work: _Work, missing: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shift (3, m) and turn (3, m) of the tip that lengthen the struts by (6, m), after `_eliminate`."""
    a, b = missing[:3], missing[3:]
    spin = (work.q * (b - (work.t * a[:, None]).sum(axis=0))[None]).sum(axis=1)
    rest = a - (work.moments[:, :3] * spin[:, None]).sum(axis=0)
    return (work.w * rest[None]).sum(axis=1), spin


def _spun(spin: FloatArray, turn: FloatArray) -> FloatArray:
    """Orientations (3, 3, m) turned further by small vectors (3, m), by Cayley's formula: a rotation to all digits."""
    half = 0.5 * spin
    scale = 2.0 / (1.0 + (half * half).sum(axis=0))
    across = _crossed(half, turn)
    return np.asarray(turn + scale * (across + _crossed(half, across)))


def _crossed(vector: FloatArray, columns: FloatArray) -> FloatArray:
    """Cross products of vectors (3, m) with each column of (3, 3, m)."""
    return np.asarray(vector[NEXT, None] * columns[LAST] - vector[LAST, None] * columns[NEXT])


def well_conditioned(kernel: ClosedForm, first: FloatArray, second: FloatArray) -> BoolArray:
    """Where neither of the determinants that the elimination divides by is small."""
    small = SMALL_DETERMINANT
    return np.asarray((np.abs(first) > small) & (np.abs(second) > small * kernel.arm**3))


def _blocks(n: int) -> Iterator[tuple[slice, _Work]]:
    """Rows of each block of n poses, and work arrays that it may overwrite."""
    work = _Work(min(BLOCK, n))
    for start in range(0, n, BLOCK):
        rows = slice(start, min(start + BLOCK, n))
        if rows.stop - start != work.length.shape[1]:
            work = _Work(rows.stop - start)
        yield rows, work


def _eliminate(
    kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None, work: _Work
) -> tuple[FloatArray, FloatArray]:
    """Struts and the two inverses of the elimination into `work`; returns the two determinants (m,).

    After it `work.w` [c, k] = (U_A^-1)[k, c], `work.t` = U_A^-1 U_B, `work.q` [d, j] = (S^-1)[j, d].
    """
    _strut_geometry(kernel, position, rotation, work)
    u, m = work.directions, work.moments
    first = _inverse_columns(u[:, :3], work.w, work.nine)
    _products(work.w.swapaxes(0, 1), u[:, 3:], work.t, work.nine)
    _products(m[:, :3], work.t, work.s, work.nine)
    np.subtract(m[:, 3:], work.s, out=work.s)  # S = M_B - M_A T
    second = _inverse_columns(work.s, work.q, work.nine)
    return first, second


def _tensor_block(
    kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None, work: _Work, out: FloatArray
) -> BoolArray:
    """One block: position (3, m), rotation (3, 3, m) or None; writes C to `out` (m, 3, 3)."""
    first, second = _eliminate(kernel, position, rotation, work)
    w, t, n, s, nine = work.w, work.t, work.n, work.s, work.nine
    _products(work.moments[:, :3], w.swapaxes(0, 1), n, nine)  # N = M_A U_A^-1
    _products(work.q.swapaxes(0, 1), n, s, nine)  # S^-1 N, in the room of S
    influence = work.influence
    np.negative(s, out=influence[3:])
    _products(t, s, n, nine)
    np.add(n, w.swapaxes(0, 1), out=influence[:3])  # U_A^-1 + T S^-1 N
    law_holds = _strut_compliances(kernel, work)
    weighted = np.multiply(influence, work.six[:, None], out=work.arms.reshape(6, 3, -1))
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        np.multiply(weighted[:, i], influence[:, j], out=work.inverse_length)
        entry = work.inverse_length.sum(axis=0)
        out[:, i, j] = entry
        if i != j:
            out[:, j, i] = entry
    return np.asarray(law_holds & well_conditioned(kernel, first, second) & np.isfinite(out[:, 2, 2]))


def _forces(work: _Work, load: FloatArray) -> FloatArray:
    """Strut forces (6, m) that balance forces (3, m) at the tip, after `_eliminate`; in `work.inverse_length`."""
    force, nine, moment = work.inverse_length, work.nine, work.s[0]
    a, b = force[:3], force[3:]
    np.multiply(work.w, load[:, None], out=nine)
    nine.sum(axis=0, out=a)  # U_A^-1 F
    np.multiply(work.moments[:, :3], a[None], out=nine)
    nine.sum(axis=1, out=moment)  # M_A U_A^-1 F
    np.multiply(work.q, moment[:, None], out=nine)
    nine.sum(axis=0, out=b)
    np.multiply(work.t, b[None], out=nine)
    a += nine.sum(axis=1, out=moment)
    np.negative(b, out=b)
    return force


def _strut_compliances(kernel: ClosedForm, work: _Work) -> BoolArray:
    """1 / k(L) into `work.six`; returns where every strut has a stiffness above zero.

    Beyond that the exact route says what is wrong.
    """
    if kernel.table is None:
        np.multiply(work.length, kernel.slope, out=work.six)
        work.six += kernel.intercept
    else:
        work.six[:] = kernel.table.stiffness(work.length)
    law_holds = work.six.min(axis=0) > 0.0
    np.divide(1.0, work.six, out=work.six)
    return np.asarray(law_holds)


def _strut_geometry(kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None, work: _Work) -> None:
    """Arms r, directions u, moments r x u and lengths of the block."""
    arms = _strut_lengths(kernel, position, rotation, work)
    u, m, six = work.directions, work.moments, work.six
    np.divide(1.0, work.length, out=work.inverse_length)
    u *= work.inverse_length
    for c in range(3):
        np.multiply(arms[NEXT[c]], u[LAST[c]], out=m[c])
        np.multiply(arms[LAST[c]], u[NEXT[c]], out=six)
        m[c] -= six


def _strut_lengths(kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None, work: _Work) -> FloatArray:
    """Lengths of the block, and the struts as vectors in `work.directions`; returns the arms."""
    arms, u, six = work.arms, work.directions, work.six
    if rotation is None:
        arms = kernel.platform[:, :, None]
        np.add(position[:, None], (kernel.platform - kernel.frame)[:, :, None], out=u)
    else:
        for c in range(3):
            np.multiply(kernel.platform[0][:, None], rotation[c, 0], out=arms[c])
            for d in (1, 2):
                np.multiply(kernel.platform[d][:, None], rotation[c, d], out=six)
                arms[c] += six
        np.add(arms, position[:, None], out=u)
        u -= kernel.frame[:, :, None]
    np.multiply(u[0], u[0], out=work.length)
    for c in (1, 2):
        np.multiply(u[c], u[c], out=six)
        work.length += six
    np.sqrt(work.length, out=work.length)
    return arms


def _inverse_columns(matrix: FloatArray, out: FloatArray, spare: FloatArray) -> FloatArray:
    """Inverse of 3 x 3 matrices (row, column, m) by cross products of the columns, transposed: out[c, k] = inv[k, c].

    Returns the determinants (m,).
    """
    for c in range(3):
        for k in range(3):
            np.multiply(matrix[NEXT[c], NEXT[k]], matrix[LAST[c], LAST[k]], out=out[c, k])
            np.multiply(matrix[LAST[c], NEXT[k]], matrix[NEXT[c], LAST[k]], out=spare[c, k])
    out -= spare
    determinant = (matrix[:, 0] * out[:, 0]).sum(axis=0)
    out /= determinant
    return np.asarray(determinant)


def _products(left: FloatArray, right: FloatArray, out: FloatArray, spare: FloatArray) -> None:
    """Matrix products of (3, 3, m) arrays, pose by pose."""
    np.multiply(left[:, 0, None], right[None, 0], out=out)
    for k in (1, 2):
        np.multiply(left[:, k, None], right[None, k], out=spare)
        out += spare
