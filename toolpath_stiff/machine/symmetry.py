"""Each joint against the symmetry of the others: where a slip of the keyboard would have put one that stands apart.

Hexapods are built with struts that go over into each other by thirds of a turn about a vertical axis, or by a vertical
mirror plane. Both are looked for among all ways of pairing the struts: of each body, frame and platform, all six joints
or all but one must follow, and both bodies must pair the struts alike. So at least ten of the twelve joints speak for
a symmetry before it is held against another, and a machine that is meant to be without one shows none.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.kinematics import solve_struts_at
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.units import mm_from_m

Pairing = tuple[int, ...]  # strut i goes over into strut pairing[i]
Onto = Callable[[FloatArray], FloatArray]  # where joints (k, 3) go over to
Fit = Callable[[FloatArray, FloatArray], Onto]  # what takes joints (k, 3) best to others

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


def find_symmetry(machine: Hexapod) -> Symmetry:
    """The symmetry that the most joints follow, the one that fits them best; see the module."""
    bodies = {"frame": machine.frame_joints, "platform": machine.platform_joints}
    ranked: list[tuple[tuple[int, int, int, int], Symmetry]] = []
    for kind, pairing, fit in _candidates():
        followed = [_follow(body, joints, pairing, fit) for body, joints in bodies.items()]
        strays = [stray for part in followed if part is not None for stray in part[0]]
        if None not in followed:
            worst = max(part[1] for part in followed if part is not None)
            doubt = sum(stray.instead_of is not None for stray in strays)
            # Where two joints could be exchanged as well, the struts of equal length are the ones that were meant.
            rank = (len(strays), doubt, round(worst / SAME), round(_spread(machine, strays) / SAME))
            ranked.append((rank, Symmetry(kind, tuple(strays), worst)))
    if not ranked:
        return Symmetry("")
    rank, best = min(ranked, key=lambda item: item[0])
    rivals = [stray for same, other in ranked if same == rank for stray in other.strays]

    def with_rival(stray: Stray) -> Stray:
        """The same, with the joint that may as well be the wrong one: struts that share a point can be renumbered."""
        others = [rival.joint for rival in rivals if rival.body == stray.body and rival.joint != stray.joint]
        return replace(stray, instead_of=others[0]) if others and stray.instead_of is None else stray

    return replace(best, strays=tuple(map(with_rival, best.strays)))


def _spread(machine: Hexapod, strays: list[Stray]) -> float:
    """m, standard deviation of the strut lengths at the neutral pose with the strays where they are expected."""
    bodies = {"frame": machine.frame_joints.copy(), "platform": machine.platform_joints.copy()}
    for stray in strays:
        bodies[stray.body][stray.joint] = stray.expected
    corrected = machine.with_changes(frame_joints=bodies["frame"], platform_joints=bodies["platform"])
    return float(solve_struts_at(corrected, machine.limits.neutral_pose).lengths.std())


def _candidates() -> Iterator[tuple[str, Pairing, Fit]]:
    """Kinds of symmetry with every way of pairing six struts: two cycles of three, three pairs."""
    for first in combinations(range(1, 6), 2):
        start, *rest = (i for i in range(1, 6) if i not in first)
        for second in permutations(first):
            for third in permutations(rest):
                yield "three-fold", _pairing((0, *second), (start, *third)), _turn_of
    for a in range(1, 6):
        start, *left = (i for i in range(1, 6) if i != a)
        for b in left:
            c, d = (i for i in left if i != b)
            yield "mirror", _pairing((0, a), (start, b), (c, d)), _mirror


def _pairing(*cycles: tuple[int, ...]) -> Pairing:
    onto = {i: cycle[(k + 1) % len(cycle)] for cycle in cycles for k, i in enumerate(cycle)}
    return tuple(onto[i] for i in range(6))


def _follow(body: str, joints: FloatArray, pairing: Pairing, fit: Fit) -> tuple[list[Stray], float] | None:
    """The joint that does not follow, if one does not, and the largest distance of the others; None if more do not."""

    def fitted(without: int | None) -> tuple[Onto, float]:
        """The fit without a joint, and m, the largest distance between a joint and the one that goes over into it."""
        first = [i for i in range(6) if without not in (i, pairing[i])]
        before, after = joints[first], joints[[pairing[i] for i in first]]
        onto = fit(before, after)
        return onto, float(np.linalg.norm(onto(before) - after, axis=1).max())

    size = float(np.sqrt(((joints - joints.mean(axis=0)) ** 2).sum(axis=1).mean()))
    everyone = fitted(None)[1]
    if everyone <= FOLLOWS * size:
        return [], everyone
    fits = [fitted(i) for i in range(6)]
    i = min(range(6), key=lambda i: fits[i][1])
    onto, distance = fits[i]
    if distance > FOLLOWS * size:
        return None
    partner = pairing[i] if pairing[pairing[i]] == i else None  # a pair does not say which of the two is wrong
    stray = Stray(body, i, joints[i], onto(joints[[pairing.index(i)]])[0], partner)
    return ([stray], distance) if stray.distance > APART * size else ([], stray.distance)


def _turn_of(before: FloatArray, after: FloatArray) -> Onto:
    """A third of a turn about the vertical axis that fits best: (1 - R) c = p' - R p."""
    shift = (after[:, :2] - before[:, :2] @ THIRD.T).mean(axis=0)
    centre = np.linalg.solve(np.eye(2) - THIRD, shift)
    return lambda points: np.column_stack([(points[:, :2] - centre) @ THIRD.T + centre, points[:, 2]])


def _mirror(before: FloatArray, after: FloatArray) -> Onto:
    """The vertical plane that fits best: its normal along the pairs' differences, through their middles."""
    apart = (after - before)[:, :2]
    normal = np.linalg.eigh(apart.T @ apart)[1][:, 1]
    offset = float((0.5 * (before + after)[:, :2] @ normal).mean())

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
    text += f" ({stray.slip})" if stray.slip else ""
    return text + ("" if stray.instead_of is None else f"; or joint {stray.instead_of + 1} is the wrong one of the two")
