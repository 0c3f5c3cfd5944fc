"""Each joint against the symmetry of the others: where a slip of the keyboard would have put one that stands apart.

Hexapods are built with struts that go over into each other by thirds of a turn about a vertical axis, or by a vertical
mirror plane. Both are looked for among all ways of pairing the struts: of each body, frame and platform, all six joints
or all but one must follow, and both bodies must pair the struts alike. So at least ten of the twelve joints speak for
a symmetry before it is held against another, and a machine that is meant to be without one shows none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.kinematics import solve_struts_at
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.units import mm_from_m

Pairing = tuple[int, ...]  # strut i goes over into strut pairing[i]


FOLLOWS = 0.01  # of the body's size: joints this close to where the symmetry puts them follow it (tolerances, recovery)


SAME = 1e-5  # m: fits that differ by less are as good


APART = 0.03  # of it: a joint this far off stands apart


THIRD = np.array([[-0.5, -np.sqrt(0.75)], [np.sqrt(0.75), -0.5]])


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
