"""The shape of a loop of raw records: kinks with their force and two slopes, tension against compression, work lost.

Looked at is the way from extreme to extreme, deflection y over force F from F_0 on, and of a closed cycle the way back
as well, with a constant a of its own. Three shapes are tried beside the
straight line, each with two compliances c and c':

    sticking      y = a + c d + (c' - c) max(d - 2 F_b, 0), d = |F - F_0|: joints stick after the load has turned,
                  until friction breaks away, at twice the breakaway force F_b on the way back (Masing 1926,
                  Proceedings of the 2nd International Congress of Applied Mechanics, 332)
    kink          y = a + c F + (c' - c) sign(F) max(|F| - F_b, 0): contacts that close (stiffer beyond) or slip
    sides         y = a + c max(F, 0) + c' min(F, 0): tension against compression, as a strut that has lost its preload

One of them stands where it fits better than the straight line by an F test (Seber and Lee 2003, Linear Regression
Analysis, 4.2), its probability multiplied by the number of shapes and forces tried (Bonferroni).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray

MOST = 200  # records of that way that are looked at singly; of more, runs are averaged: a logger's thousands


FEWEST = 7  # records on the way from extreme to extreme from which a shape is looked for


A_SIDE = 3  # records on each side of a kink


POSITIONS = 4  # of a kink tried between two records


RESOLUTION = 0.05e-6  # m, rms that no line is believed to fit better than; assumed: half a step of 0.1 um


SURE = 0.01  # probability below which chance alone is ruled out


NEARER, FARTHER = 0.15, 0.5  # of an extreme, between which lost motion is read; assumed


APART = 0.01  # of the deflection: lost motion that is told of; assumed, as much as a bench's two sides differ


TELLING = 1.15  # ratio of two slopes from which they are told of


@dataclass(frozen=True)
class Shape:
    """What stands out of a straight line. SI; nan where nothing does.

    Attributes
    ----------
    kind
        "sticking", "kink", "sides", or "" where a straight line will do.
    force
        N, the breakaway force, or where the kink is; nan of sides.
    first, second
        N/m: below and above that force; under tension (positive force) and compression.
    lost
        J, the work that the loop takes and does not give back: the area that its records enclose.
    """

    kind: str = ""
    force: float = np.nan
    first: float = np.nan
    second: float = np.nan
    lost: float = np.nan

    def __str__(self) -> str:
        """A sentence with N and N/mm; "" where a straight line will do."""
        first, second = (f"{1e-3 * slope:,.0f} N/mm" for slope in (self.first, self.second))
        if self.kind == "sticking":
            return (
                f"sticks after the load has turned and breaks away at {self.force:.3g} N: "
                f"{first} before, {second} after"
            )
        if self.kind == "kink":
            what = "closes" if self.first < self.second else "slips"
            return f"{what} at {self.force:.3g} N: {first} below, {second} above"
        if self.kind == "sides":
            side = "softer" if self.first < self.second else "stiffer"
            return f"{side} in tension than in compression: {first} against {second}"
        return ""


def shape_of(force: FloatArray, deflection: FloatArray, ways: Sequence[slice], width: float = 0.0) -> Shape:
    """The shape of a loop.

    Parameters
    ----------
    force, deflection
        (m,) N and m, the records in their order; tension is positive.
    ways
        The way from extreme to extreme; of a closed cycle the way back as well, which tells friction, where both ways
        curve apart, from two sides or a kink, where they go together.
    width
        m, of the loop. Of one way alone, sides that differ by less are not told of.
    """
    lost = _work_lost(force, deflection)
    f, y, which = _averaged(force, deflection, ways)
    if len(f) < FEWEST or f.max() <= 0.0 or f.min() >= 0.0:
        return Shape(lost=lost)
    constants = [(which == i).astype(float) for i in range(len(ways))]
    tried = [("sides", np.nan, np.maximum(f, 0.0), np.minimum(f, 0.0)), *_sticking(f, which), *_kinks(f)]
    of_sides: Shape | None = None
    straight = _left([f], y, constants)[0]
    best, chance, squares = Shape(lost=lost), SURE, {"": straight}
    least: dict[str, float] = {}
    for kind, position, first_column, second_column in tried:
        left, found_slopes = _left([first_column, second_column], y, constants)
        first, second = found_slopes[-2:]
        slopes = (abs(1.0 / first), abs(1.0 / second)) if first * second > 0.0 else (0.0, 0.0)
        if left >= least.get(kind, np.inf) or not max(slopes) >= TELLING * min(slopes) > 0.0:
            continue  # of one kind, what leaves more is the likelier chance
        apart = abs(first - second) * min(float(f.max()), -float(f.min()))
        if kind == "sides" and len(ways) == 1 and apart < width:
            continue
        least[kind] = left
        # A kink's force is fitted, too: one more figure than its two slopes.
        more = 1 if kind == "sides" else 2
        probability = _chance(straight, left, more, len(f) - len(ways) - 1 - more) * len(tried)
        if probability < chance:
            best, chance, squares[kind] = Shape(kind, position, slopes[0], slopes[1], lost), probability, left
            of_sides = best if kind == "sides" else of_sides
    # On one way alone, sticking that breaks away near zero force looks like two sides, which has no force to fit.
    if of_sides is not None and best is not of_sides:
        gain = _chance(squares["sides"], squares[best.kind], 1, len(f) - len(ways) - 3) * len(tried)
        best = best if gain < SURE else of_sides
    return best


def sides_of(force: FloatArray, deflection: FloatArray, drift: bool = False, gap: bool = False) -> tuple[float, float]:
    """Stiffness in N/m under tension (positive force) and under compression; nan without `A_SIDE` records of both.

    Slopes of two straight lines that meet at zero force, by least squares over all records; with `drift`, of closed
    cycles, beside a deflection that goes on steadily from record to record; with `gap`, of those beyond it, beside a
    jump at zero force.
    """
    if min(len(np.unique(force[force > 0.0])), len(np.unique(force[force < 0.0]))) < A_SIDE:
        return np.nan, np.nan
    order = np.arange(len(force), dtype=float)
    if gap:  # nobody knows to which side of it a record within belongs
        beyond = (force >= NEARER * force.max()) | (force <= NEARER * force.min())
        force, deflection, order = force[beyond], deflection[beyond], order[beyond]
    others = [np.ones_like(force)] + [order] * drift + [np.sign(force)] * gap
    pulled, pushed = _left([np.maximum(force, 0.0), np.minimum(force, 0.0)], deflection, others)[1][-2:]
    return (1.0 / float(pulled), 1.0 / float(pushed)) if min(pulled, pushed) > 0.0 else (np.nan, np.nan)


class Play(NamedTuple):
    """Lost motion of closed cycles in m, nan without records of both sides, and whether it is more than chance."""

    size: float
    shown: bool


def play_of(force: FloatArray, deflection: FloatArray, way: FloatArray) -> Play:
    """How far the straight lines of the two sides stand apart at zero force, read just beyond a gap that has closed.

    The lines lie between `NEARER` and `FARTHER` of each extreme: closer in a gap may still be open, farther out joints
    that stick after the turn make both sides stiffer, which looks like a gap. Friction moves the two ways apart by an
    even function of the force (Masing 1926): a constant and a square are fitted beside the lines, and a steady drift.
    Shown is what an F test at 1 % finds and what is `APART` of the deflection, as less does not blur a stiffness.

    Parameters
    ----------
    force, deflection, way
        (m,) N, tension positive; m; 1 and -1 on successive ways from extreme to extreme.
    """
    high, low = float(force.max()), float(force.min())
    share = np.where(force > 0.0, force / high, force / low) if low < 0.0 < high else np.zeros_like(force)
    inside = (share >= NEARER) & (share <= FARTHER)
    f, y = force[inside], deflection[inside]
    if min(len(np.unique(f[f > 0.0])), len(np.unique(f[f < 0.0]))) < A_SIDE:
        return Play(np.nan, False)
    lines = [np.maximum(f, 0.0), np.minimum(f, 0.0)]
    friction = way[inside, None] * np.stack([np.ones_like(f), f**2], axis=1)
    others = [np.ones_like(f), np.flatnonzero(inside).astype(float), *friction.T]
    before = _left(lines, y, others)[0]
    after, coefficients = _left([np.sign(f), *lines], y, others)
    size = 2.0 * float(coefficients[-3])
    telling = size >= APART * float(np.ptp(deflection))
    return Play(size, telling and _chance(before, after, 1, len(f) - len(others) - 3) < SURE)


def _averaged(
    force: FloatArray, deflection: FloatArray, ways: Sequence[slice]
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Force, deflection and number of its way, at most `MOST` values of all ways, means of runs."""
    most = MOST // len(ways)
    runs: list[list[FloatArray]] = []
    for way in ways:
        both = [force[way], deflection[way]]
        if len(both[0]) > most:
            both = [np.array([run.mean() for run in np.array_split(values, most)]) for values in both]
        runs.append(both)
    which = np.repeat(np.arange(len(ways)), [len(f) for f, _ in runs])
    return np.concatenate([f for f, _ in runs]), np.concatenate([y for _, y in runs]), which


Tried = tuple[str, float, FloatArray, FloatArray]


def _sticking(force: FloatArray, which: NDArray[np.int64]) -> list[Tried]:
    """Kinks on the ways back from an extreme: what lies before them, and after them."""
    starts = np.array([force[which == i][0] for i in range(which[-1] + 1)])
    ends = np.array([force[which == i][-1] for i in range(which[-1] + 1)])
    sign = np.sign(ends - starts)[which]
    way = np.abs(force - starts[which])
    steps = np.sort(way)
    forces = _between(np.unique(steps[A_SIDE - 1 : 1 - A_SIDE]))
    return [
        ("sticking", 0.5 * position, sign * np.minimum(way, position), sign * np.maximum(way - position, 0.0))
        for position in forces
    ]


def _kinks(force: FloatArray) -> list[Tried]:
    """Kinks alike on both sides of zero: what lies below them, and above them."""
    kinks: list[Tried] = []
    for position in _between(np.unique(np.abs(force))):
        below = np.clip(force, -position, position)
        if min((np.abs(force) < position).sum(), (np.abs(force) > position).sum()) >= A_SIDE:
            kinks.append(("kink", position, below, force - below))
    return kinks


def _between(steps: FloatArray) -> list[float]:
    """Forces between rising steps, `POSITIONS` in each gap: a kink seldom lies where a record was taken."""
    shares = (np.arange(POSITIONS) + 0.5) / POSITIONS
    return sorted({float(position) for position in (steps[:-1, None] + np.diff(steps)[:, None] * shares).ravel()})


def _left(columns: list[FloatArray], y: FloatArray, others: list[FloatArray]) -> tuple[float, FloatArray]:
    """Squares that least squares leave beside the others, and the coefficients, theirs first."""
    design = np.stack([*others, *columns], axis=1)
    scale = np.abs(design).max(axis=0)
    coefficients = np.linalg.lstsq(design / scale, y, rcond=None)[0] / scale
    return float(((y - design @ coefficients) ** 2).sum()), coefficients


def _chance(before: float, after: float, more: int, freedom: int) -> float:
    """Probability that so large a fall of the squares is chance."""
    from scipy.special import fdtrc

    if freedom < 1 or before <= after:
        return 1.0
    after = max(after, freedom * RESOLUTION**2)
    return float(fdtrc(more, freedom, max(before - after, 0.0) / more / (after / freedom)))


def _work_lost(force: FloatArray, deflection: FloatArray) -> float:
    """Area that the records enclose, the last joined to the first (Gauss's formula)."""
    if len(force) < 4:
        return float("nan")
    return float(abs(0.5 * (force * np.roll(deflection, -1) - np.roll(force, -1) * deflection).sum()))
