"""Kinematics of a six-strut platform: strut lengths of poses, and poses of strut lengths.

Inverse, batched, the paper's equations 6 to 11: P_i = R P_i + q (eqs. 6, 8, 9), S_i = P_i - B_i (eq. 10), L_i = |S_i|
(eq. 11), with q the tool tip: the programmed position is the tip, and the platform joints are given relative to it.

Forward, by Newton's method: a six-strut platform has up to 40 assembly modes (Merlet, Parallel Robots, 2006, chapter
4); Newton's method finds the one that the start lies in, normally the machine's neutral pose. Each step solves
J dx = dL, strut elongation per twist of the tip.

Each joint against the symmetry of the others: where a slip of the keyboard would have put one that stands apart.

Hexapods are built with struts that go over into each other by thirds of a turn about a vertical axis, or by a vertical
mirror plane. Both are looked for among all ways of pairing the struts: of each body, frame and platform, all six joints
or all but one must follow, and both bodies must pair the struts alike. So at least ten of the twelve joints speak for
a symmetry before it is held against another, and a machine that is meant to be without one shows none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, permutations

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import PoseError
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices
from toolpath_stiff.units import mm_from_m

LENGTH_TOLERANCE = 1e-12  # m, a few units in the last place of a strut's length
MOST_STEPS = 50

# Farthest step of Newton's method: beyond some tenths of a radian its linear model of a rotation is worthless.
LARGEST_TURN = 0.3  # rad
LARGEST_SHIFT = 0.5  # m
Pairing = tuple[int, ...]  # strut i goes over into strut pairing[i]
FOLLOWS = 0.01  # of the body's size: joints this close to where the symmetry puts them follow it (tolerances, recovery)
SAME = 1e-5  # m: fits that differ by less are as good
APART = 0.03  # of it: a joint this far off stands apart
THIRD = np.array([[-0.5, -np.sqrt(0.75)], [np.sqrt(0.75), -0.5]])


@dataclass(frozen=True)
class Struts:
    """The struts at n poses.

    Attributes
    ----------
    lengths
        (n, 6) m.
    directions
        (n, 6, 3) unit vectors u_i from frame joint to platform joint, base axes.
    arms
        (n, 6, 3) m, r_i from tool tip to platform joint, base axes.
    """

    lengths: FloatArray
    directions: FloatArray
    arms: FloatArray

    @cached_property
    def jacobian(self) -> FloatArray:
        """(n, 6, 6) rows [u_i, r_i x u_i]: strut elongation rates per twist of the tip."""
        r, u = self.arms, self.directions
        found = np.empty((*u.shape[:-1], 6))
        found[..., :3] = u
        # On a few poses `np.cross` takes several times as long; the digits are the same.
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            found[..., 3 + i] = r[..., j] * u[..., k] - r[..., k] * u[..., j]
        return found


def solve_struts(
    machine: Machine,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    tool_length: ArrayLike = np.nan,
) -> Struts:
    """Lengths, directions and arms of the six struts.

    Parameters
    ----------
    machine
        The machine.
    position
        (n, 3) or (3,) m, tool tip in the base frame.
    rotation
        (n, 3, 3) or (3, 3) orientation of the platform; None: vertical spindle, no yaw.
    tool_length
        m, scalar or (n,); nan: the machine's reference tool.

    Returns
    -------
    Struts of n poses (n = 1 for a single position).

    Examples
    --------
    On the machine's axis the struts have two lengths, three struts each:

    >>> from toolpath_stiff.machine import load_machine
    >>> struts = solve_struts(load_machine("nist"), [0.0, 0.0, 0.8])
    >>> struts.lengths.round(4)
    array([[2.8847, 2.8699, 2.8847, 2.8699, 2.8847, 2.8699]])
    >>> struts.jacobian.shape
    (1, 6, 6)
    """
    tip = np.atleast_2d(np.asarray(position, dtype=float))
    joints = platform_joints(machine, tool_length)
    if rotation is None:
        arms = np.broadcast_to(joints, (len(tip), 6, 3))
    else:
        arms = np.asarray(joints @ np.swapaxes(np.asarray(rotation, dtype=float), -1, -2))
        arms = np.broadcast_to(arms, (len(tip), 6, 3))
    struts = tip[:, None, :] + arms - machine.frame_joints
    lengths = np.sqrt(np.einsum("nij,nij->ni", struts, struts))
    return Struts(lengths=lengths, directions=struts / lengths[..., None], arms=arms)


def platform_joints(machine: Machine, tool_length: ArrayLike = np.nan) -> FloatArray:
    """(6, 3), or (n, 6, 3) for n tool lengths: platform joints relative to the tip, platform frame, m."""
    length = np.asarray(tool_length, dtype=float)
    if length.ndim == 0:
        return machine.platform_joints_for(float(length))
    extension = np.where(np.isnan(length), 0.0, length - machine.reference_tool_length)
    shift = np.zeros((len(length), 1, 3))
    shift[:, 0, 2] = extension
    return machine.platform_joints + shift


def solve_struts_at(machine: Machine, pose: ArrayLike) -> Struts:
    """Struts at poses (n, 6) or (6,): x, y, z in m, roll, pitch, yaw in rad."""
    values = np.atleast_2d(np.asarray(pose, dtype=float))
    return solve_struts(machine, values[:, :3], rotation_matrices(values[:, 3:]))


def neutral_axes(machine: Machine) -> tuple[FloatArray, FloatArray]:
    """Neutral axes of the frame joints (base axes) and of the platform joints (platform axes), (6, 3) each.

    They lie along the struts at the machine's neutral pose.
    """
    neutral = machine.limits.neutral_pose
    directions = solve_struts_at(machine, neutral).directions[0]
    return directions, directions @ rotation_matrices(neutral[3:])


def joint_angles(machine: Machine, struts: Struts, rotation: ArrayLike | None = None) -> tuple[FloatArray, FloatArray]:
    """Swing of the frame joints and of the platform joints from their neutral axes.

    Returns
    -------
    frame, platform
        (n, 6) rad each.
    """
    frame_axes, platform_axes = neutral_axes(machine)
    frame = _angle(struts.directions, frame_axes)
    if rotation is None:
        return frame, _angle(struts.directions, platform_axes)
    turned = platform_axes @ np.swapaxes(np.asarray(rotation, dtype=float), -1, -2)
    return frame, _angle(struts.directions, turned)


def _angle(first: FloatArray, second: FloatArray) -> FloatArray:
    """Angle between unit vectors (..., 3), exact near 0 where arccos is not (Kahan's formula)."""
    apart = np.linalg.norm(first - second, axis=-1)
    together = np.linalg.norm(first + second, axis=-1)
    return np.asarray(2.0 * np.arctan2(apart, together))


def singularity_index(machine: Machine, struts: Struts) -> FloatArray:
    """|det J| relative to its value at the neutral pose, (n,): 1 there, 0 where the machine is singular.

    The determinant of the six strut screws does not depend on the point that moments are taken about, so
    neither tool length nor the choice of units enters the ratio.
    """
    neutral = solve_struts_at(machine, machine.limits.neutral_pose)
    with np.errstate(divide="ignore", invalid="ignore"):  # singular at the neutral pose too: nan is out of reach
        return np.asarray(np.abs(np.linalg.det(struts.jacobian)) / np.abs(np.linalg.det(neutral.jacobian[0])))


def forward_kinematics(
    machine: Machine, lengths: ArrayLike, start: ArrayLike | None = None, tool_length: ArrayLike = np.nan
) -> FloatArray:
    """Poses at which the struts have the given lengths.

    Parameters
    ----------
    machine
        The machine.
    lengths
        (n, 6) or (6,) m.
    start
        (6,) or (n, 6) pose to start from, m and rad; the machine's neutral pose unless given.
    tool_length
        m, scalar or (n,); nan: the reference tool.

    Returns
    -------
    (n, 6) x, y, z in m, roll, pitch, yaw in rad.

    Raises
    ------
    InputError
        Not six finite lengths above 0 in each row, or lengths that no pose near the start has; the message names the
        row.

    Examples
    --------
    >>> from toolpath_stiff.machine import load_machine
    >>> machine = load_machine("nist")
    >>> lengths = solve_struts(machine, [0.1, -0.05, 0.8]).lengths
    >>> forward_kinematics(machine, lengths).round(9)[0, :3]
    array([ 0.1 , -0.05,  0.8 ])
    """
    wanted = np.atleast_2d(np.asarray(lengths, dtype=float))
    _check_lengths(wanted)
    first = np.asarray(machine.limits.neutral_pose if start is None else start, dtype=float)
    poses = np.broadcast_to(first, (len(wanted), 6))
    position, rotation = poses[:, :3].copy(), rotation_matrices(poses[:, 3:])
    error = np.full(len(wanted), np.inf)
    for _ in range(MOST_STEPS):
        struts = solve_struts(machine, position, rotation, tool_length)
        missing = wanted - struts.lengths
        error = np.abs(missing).max(axis=1)
        # The last digits differ from step to step; one more step after reaching them changes nothing.
        if (error < LENGTH_TOLERANCE).all() or not np.isfinite(error).all():
            break
        twist = _newton_step(struts.jacobian, missing)
        position = position + twist[:, :3]
        rotation = _turn(twist[:, 3:]) @ rotation
    failed = np.flatnonzero(~(error < 1e3 * LENGTH_TOLERANCE))
    if len(failed):
        row = int(failed[0])
        shown = ", ".join(f"{mm_from_m(v):.3f}" for v in wanted[row])
        raise PoseError(
            f"row {row + 1}: no pose near the start has struts of {shown} mm",
            hint="check the lengths, or give a start nearer to the pose",
        )
    return np.concatenate([position, roll_pitch_yaw(rotation)], axis=1)


def _check_lengths(lengths: FloatArray) -> None:
    """One bad row must not be blamed on another: rows are solved together."""
    if lengths.ndim != 2 or lengths.shape[1] != 6:
        raise PoseError(f"strut lengths of shape {lengths.shape}", expected="(n, 6) or (6,)")
    bad = np.flatnonzero(~(np.isfinite(lengths) & (lengths > 0.0)).all(axis=1))
    if len(bad):
        row = int(bad[0])
        shown = ", ".join(f"{mm_from_m(v):.3f}" for v in lengths[row])
        raise PoseError(f"row {row + 1}: strut lengths {shown} mm", expected="six finite lengths above 0")


def _newton_step(jacobian: FloatArray, missing: FloatArray) -> FloatArray:
    """Twists (n, 6), shortened where they are too large to be trusted; near singular poses the smallest ones."""
    try:
        twist = np.asarray(np.linalg.solve(jacobian, missing[..., None])[..., 0])
    except np.linalg.LinAlgError:
        twist = np.full(missing.shape, np.inf)
    rows = np.flatnonzero(~(_excess(twist) <= 1.0))
    if len(rows):
        twist[rows] = np.einsum("nij,nj->ni", np.linalg.pinv(jacobian[rows]), missing[rows])
    return np.asarray(twist / np.maximum(1.0, _excess(twist))[:, None])


def _excess(twist: FloatArray) -> FloatArray:
    """(n,) size of twists (n, 6) over the largest one that is trusted."""
    shift, turn = np.linalg.norm(twist[:, :3], axis=1), np.linalg.norm(twist[:, 3:], axis=1)
    return np.asarray(np.maximum(shift / LARGEST_SHIFT, turn / LARGEST_TURN))


def _turn(vector: FloatArray) -> FloatArray:
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3), Rodrigues' formula."""
    angle = np.linalg.norm(vector, axis=1)[:, None, None]
    x, y, z = vector.T
    zero = np.zeros_like(x)
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    safe = np.where(angle > 1e-8, angle, 1.0)
    first = np.where(angle > 1e-8, np.sin(safe) / safe, 1.0)
    second = np.where(angle > 1e-8, (1.0 - np.cos(safe)) / safe**2, 0.5)
    return np.asarray(np.eye(3) + first * skew + second * (skew @ skew))


@dataclass(frozen=True)
class Stray:
    """A joint that does not follow the symmetry of the others.

    Attributes
    ----------
    body
        "frame" or "platform".
    joint
        From 0.
    given, expected
        (3,) m, where the file and where the symmetry puts it.
    instead_of
        Another joint that may as well be the wrong one (the partner, with a mirror plane alone); else None.
    """

    body: str
    joint: int
    given: FloatArray
    expected: FloatArray
    instead_of: int | None = None

    @property
    def distance(self) -> float:
        """M between the two."""
        return float(np.linalg.norm(self.given - self.expected))

    @property
    def slip(self) -> str:
        """The slip that would explain it, in words; "" if none does."""
        near = 0.05 * self.distance
        wrong = [i for i in range(3) if abs(self.given[i] - self.expected[i]) > near]
        if wrong and all(abs(self.given[i] + self.expected[i]) <= near for i in wrong):
            return f"the sign of {' and '.join('xyz'[i] for i in wrong)} looks flipped"
        if len(wrong) == 2 and np.abs(self.given[wrong] - self.expected[wrong[::-1]]).max() <= near:
            return f"{'xyz'[wrong[0]]} and {'xyz'[wrong[1]]} look exchanged"
        return ""


@dataclass(frozen=True)
class Symmetry:
    """The symmetry that most joints follow.

    Attributes
    ----------
    kind
        "three-fold" or "mirror"; "" if there is none.
    strays
        The joints that do not follow, at most one a body.
    residual
        m, largest distance of the others from where it puts them.
    """

    kind: str
    strays: tuple[Stray, ...] = ()
    residual: float = 0.0


def find_symmetry(machine: Machine) -> Symmetry:
    """The symmetry that the most joints follow, the one that fits them best; see the module."""
    bodies = {"frame": machine.frame_joints, "platform": machine.platform_joints}
    found: list[tuple[tuple[int, int, int, int], Symmetry]] = []
    for kind, pairing, fit in _candidates():
        strays: list[Stray] = []
        worst, doubt = 0.0, 0
        for body, joints in bodies.items():
            body_fit = _follow(body, joints, pairing, fit)
            if body_fit is None:
                break
            stray, distance = body_fit
            worst = max(worst, distance)
            if stray is not None:
                strays.append(stray)
                doubt += stray.instead_of is not None
        else:
            # Where two joints could be exchanged as well, the struts of equal length are the ones that were meant.
            rank = (len(strays), doubt, round(worst / SAME), round(_spread(machine, strays) / SAME))
            found.append((rank, Symmetry(kind, tuple(strays), worst)))
    if not found:
        return Symmetry("")
    rank, best = min(found, key=lambda item: item[0])
    rivals = [other for same, other in found if same == rank]
    return replace(best, strays=tuple(_with_rival(stray, rivals) for stray in best.strays))


def _with_rival(stray: Stray, rivals: list[Symmetry]) -> Stray:
    """The same, with the joint that may as well be the wrong one (struts that share a point can be numbered anew)."""
    others = [o.joint for rival in rivals for o in rival.strays if o.body == stray.body and o.joint != stray.joint]
    return replace(stray, instead_of=others[0]) if others and stray.instead_of is None else stray


def _spread(machine: Machine, strays: list[Stray]) -> float:
    """m, standard deviation of the strut lengths at the neutral pose with the strays where they are expected."""
    bodies = {"frame": machine.frame_joints.copy(), "platform": machine.platform_joints.copy()}
    for stray in strays:
        bodies[stray.body][stray.joint] = stray.expected
    corrected = machine.with_changes(frame_joints=bodies["frame"], platform_joints=bodies["platform"])
    return float(solve_struts_at(corrected, machine.limits.neutral_pose).lengths.std())


Fit = Callable[[FloatArray, list[tuple[int, int]]], Callable[[FloatArray], FloatArray]]


def _candidates() -> Iterator[tuple[str, Pairing, Fit]]:
    """Kinds of symmetry with every way of pairing six struts: two cycles of three, three pairs."""
    for first in combinations(range(1, 6), 2):
        rest = [i for i in range(1, 6) if i not in first]
        for one in permutations(first):
            for other in permutations(rest[1:]):
                yield "three-fold", _pairing((0, *one), (rest[0], *other)), _turn_of
    for a in range(1, 6):
        left = [i for i in range(1, 6) if i != a]
        for b in left[1:]:
            c, d = (i for i in left[1:] if i != b)
            yield "mirror", _pairing((0, a), (left[0], b), (c, d)), _mirror


def _pairing(*cycles: tuple[int, ...]) -> Pairing:
    onto = {i: cycle[(k + 1) % len(cycle)] for cycle in cycles for k, i in enumerate(cycle)}
    return tuple(onto[i] for i in range(6))


def _follow(body: str, joints: FloatArray, pairing: Pairing, fit: Fit) -> tuple[Stray | None, float] | None:
    """The joint that does not follow, if one does not, and the largest distance of the others; None if more do not."""
    size = float(np.sqrt(((joints - joints.mean(axis=0)) ** 2).sum(axis=1).mean()))
    everyone = _distance(joints, pairing, fit, None)
    if everyone <= FOLLOWS * size:
        return None, everyone
    fits = {i: _distance(joints, pairing, fit, i) for i in range(6)}
    i, distance = min(fits.items(), key=lambda item: item[1])
    if distance > FOLLOWS * size:
        return None
    partner = pairing[i] if pairing[pairing[i]] == i else None  # a pair does not say which of the two is wrong
    onto = fit(joints, _links(pairing, i))
    source = pairing.index(i)
    stray = Stray(body, i, joints[i], onto(joints[[source]])[0], partner)
    return (stray, distance) if stray.distance > APART * size else (None, stray.distance)


def _links(pairing: Pairing, without: int | None) -> list[tuple[int, int]]:
    return [(i, pairing[i]) for i in range(6) if without not in (i, pairing[i])]


def _distance(joints: FloatArray, pairing: Pairing, fit: Fit, without: int | None) -> float:
    """m, the largest distance between a joint and the one that goes over into it."""
    links = _links(pairing, without)
    onto = fit(joints, links)
    first, second = (list(side) for side in zip(*links, strict=True))
    return float(np.linalg.norm(onto(joints[first]) - joints[second], axis=1).max())


def _turn_of(joints: FloatArray, links: list[tuple[int, int]]) -> Callable[[FloatArray], FloatArray]:
    """A third of a turn about the vertical axis that fits best: (1 - R) c = p' - R p."""
    first, second = (joints[list(side), :2] for side in zip(*links, strict=True))
    centre = np.linalg.solve(np.eye(2) - THIRD, (second - first @ THIRD.T).mean(axis=0))

    def onto(points: FloatArray) -> FloatArray:
        return np.column_stack([(points[:, :2] - centre) @ THIRD.T + centre, points[:, 2]])

    return onto


def _mirror(joints: FloatArray, links: list[tuple[int, int]]) -> Callable[[FloatArray], FloatArray]:
    """The vertical plane that fits best: its normal along the pairs' differences, through their middles."""
    first, second = (joints[list(side), :2] for side in zip(*links, strict=True))
    apart = second - first
    normal = np.linalg.eigh(apart.T @ apart)[1][:, 1]
    offset = float((0.5 * (first + second) @ normal).mean())

    def onto(points: FloatArray) -> FloatArray:
        flat = points[:, :2] - 2.0 * (points[:, :2] @ normal - offset)[:, None] * normal
        return np.column_stack([flat, points[:, 2]])

    return onto


def describe_stray(stray: Stray, kind: str) -> str:
    """One line for people, in mm."""

    def shown(point: FloatArray) -> str:
        return "(" + ", ".join(f"{round(float(mm_from_m(v)), 1) + 0.0:g}" for v in point) + ")"

    text = (
        f"{stray.body} joint {stray.joint + 1} stands at {shown(stray.given)} mm; the {kind} symmetry of the others "
        f"puts it at {shown(stray.expected)} mm, {mm_from_m(stray.distance):.1f} mm away"
    )
    if stray.slip:
        text += f" ({stray.slip})"
    if stray.instead_of is not None:
        text += f"; or joint {stray.instead_of + 1} is the wrong one of the two"
    return text
