"""Cycles of a loop of raw records: where the drive turns, the last closed cycle, a secant free of drift.

A test rig goes up and down several times. The first way is that of a strut that was never loaded (a virgin curve), and
seating, creep and a warm sensor carry the deflection away slowly; neither is stiffness. So with three turns or more
(high, low, high) the secant is taken from second differences of the turns, in which a steady drift cancels, as in a
weighing A B A (OIML R 111-1:2004, C.4), and width and linearity are those of the last closed cycle.
"""

from itertools import pairwise

import numpy as np

from toolpath_stiff.arrays import FloatArray

NEAR_TURN = 0.1  # of the range: how near to an extreme a cycle must come to turn there


def turns_of(drive: FloatArray) -> list[int]:
    """Records at which the drive turns, high and low alternately; the first of equal ones."""
    high, low, near = float(drive.max()), float(drive.min()), NEAR_TURN * float(np.ptp(drive))
    turns: list[int] = []
    last = 0.0
    for i in np.flatnonzero((drive >= high - near) | (drive <= low + near)):
        side = 1.0 if drive[i] >= high - near else -1.0
        if side != last:
            turns.append(int(i))
        elif side * drive[i] > side * drive[turns[-1]]:
            turns[-1] = int(i)
        last = side
    return turns


def closed_cycle(turns: list[int]) -> slice:
    """The records of the last closed cycle; there is one from three turns on."""
    return slice(turns[-3], turns[-1] + 1)


def closed_cycles(turns: list[int]) -> slice:
    """The records of all closed cycles from the first turn on."""
    return slice(turns[0], turns[-1 - (len(turns) + 1) % 2] + 1)


def ends_without_drift(
    drive: FloatArray, force: FloatArray, deflection: FloatArray, turns: list[int], same: float
) -> tuple[float, float]:
    """Force (N) and deflection (m) between the extremes of three turns or more, a steady drift taken out.

    Parameters
    ----------
    drive, force, deflection
        (m,) the records in their order.
    turns
        As `turns_of` finds them.
    same
        Records whose drive is this close to that of their turn are averaged.
    """
    bounds = [0, *((start + end) // 2 + 1 for start, end in pairwise(turns)), len(drive)]
    means = []
    for turn, start, stop in zip(turns, bounds[:-1], bounds[1:], strict=True):
        rows = start + np.flatnonzero(np.abs(drive[start:stop] - drive[turn]) <= same)
        means.append((force[rows].mean(), deflection[rows].mean()))
    second = np.diff(np.array(means), 2, axis=0)
    signs = np.where(drive[turns[1:-1]] < drive[turns[0:-2]], 1.0, -1.0)
    force_between, deflection_between = (0.5 * (signs[:, None] * second).mean(axis=0)).tolist()
    return force_between, deflection_between
