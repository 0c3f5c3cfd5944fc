"""Figures of one loop of raw records: stiffness, lost motion, friction, linearity, slopes of its two sides.

With the jog y, the force F and the displacement D read by the indicator, the deflection is y - D, and the paper's
equation 12 is its secant between the extremes:

    k = (F(+0.2 mm) - F(-0.2 mm)) / (0.4 mm - (D(+0.2 mm) - D(-0.2 mm)))

A strut measured alone on a bench is not jogged: the force is set and its own stretch D read, so that k is the slope of
the force over D between the extremes of the force.

A test rig goes up and down several times. The first way is that of a strut that was never loaded (a virgin curve), and
seating, creep and a warm sensor carry the deflection away slowly; neither is stiffness. So with three turns or more
(high, low, high) the secant is taken from second differences of the turns, in which a steady drift cancels, as in a
weighing A B A (OIML R 111-1:2004, C.4), and width and linearity are those of the last closed cycle.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import MeasurementError
from toolpath_stiff.readings.raw_records import SAME_JOG, Loop
from toolpath_stiff.readings.rows import SOFTEST, STIFFEST
from toolpath_stiff.units import n_per_mm_from_n_per_m, um_from_m

NEAR_TURN = 0.1  # share of the range: distance from an extreme within which a cycle may turn
CLOSED = 3  # turns of the drive from which the records contain a closed cycle
A_SIDE = 3  # forces on each side of zero from which that side's slope is determined


@dataclass(frozen=True)
class LoopFigures:
    """Figures of a loop. SI; nan where it has too few records.

    Attributes
    ----------
    loop
        Its records; none of a strut whose stiffness was worked out elsewhere.
    stiffness
        N/m, the paper's equation 12.
    force
        N, half the difference of the forces at the extremes; on a bench, of one side alone, the whole, compression
        negative.
    deflection
        m, between the extremes. Errors of jog and indicator count in proportion to it.
    lost_motion
        m, distance at zero force between the straight lines through the records of the two sides.
    loop_width
        m, largest difference in deflection at one force between going and coming.
    linearity
        Largest departure of the deflection from the secant on the way from extreme to extreme, as a share of the
        deflection between them.
    tension, compression
        N/m, slopes of the two sides of a strut on a bench.
    """

    loop: Loop
    stiffness: float
    force: float
    deflection: float = math.nan
    lost_motion: float = math.nan
    loop_width: float = math.nan
    linearity: float = math.nan
    tension: float = math.nan
    compression: float = math.nan

    @property
    def side(self) -> float:
        """1 for tension, -1 for compression, as recorded or stated; 0 for both or unknown."""
        if len(self.loop.force):
            return self.loop.side
        return 0.0 if math.isnan(self.force) else math.copysign(1.0, self.force)


def reduce_loop(loop: Loop) -> LoopFigures:
    """Stiffness by the paper's equation 12, and figures of play, friction and linearity.

    Raises
    ------
    InputError
        The loop does not reach both sides, or gives no stiffness that could be.
    """
    turns = turns_of(loop.drive)
    force, deflection = _between_extremes(loop, turns)
    cycle = loop.part(slice(turns[-3], turns[-1] + 1)) if len(turns) >= CLOSED else loop
    start, end = turns_of(cycle.drive)[:2]
    way = slice(start, end + 1)  # from extreme to extreme
    width = _loop_width(cycle, way)
    tension, compression = (math.nan, math.nan) if loop.jog is not None else _sides(loop, turns, width)
    on_way, main = cycle.force[way], cycle.deflection[way]
    secant = main[0] + (main[-1] - main[0]) * (on_way - on_way[0]) / (on_way[-1] - on_way[0])
    return LoopFigures(
        loop,
        stiffness=force / deflection,
        force=loop.side * force if loop.side else force / 2.0,
        deflection=deflection,
        lost_motion=_lost_motion(cycle),
        loop_width=width,
        linearity=float(np.abs(main - secant).max() / deflection),
        tension=tension,
        compression=compression,
    )


def turns_of(drive: FloatArray) -> list[int]:
    """Records at which the drive turns, alternately high and low; of equal ones the first."""
    high, low, near = float(drive.max()), float(drive.min()), NEAR_TURN * float(np.ptp(drive))
    turns: list[int] = []
    last = 0.0
    for i in np.flatnonzero((drive >= high - near) | (drive <= low + near)).tolist():
        side = 1.0 if drive[i] >= high - near else -1.0
        if side != last:
            turns.append(i)
        elif side * drive[i] > side * drive[turns[-1]]:
            turns[-1] = i
        last = side
    return turns


def _between_extremes(loop: Loop, turns: list[int]) -> tuple[float, float]:
    """Force (N) and deflection (m) between the extremes. Raises `InputError` if they give no stiffness."""
    drive = loop.drive
    high, low = float(drive.max()), float(drive.min())
    if loop.jog is not None and not (low < -SAME_JOG and high > SAME_JOG):
        raise MeasurementError(
            f"{loop.title}: jogged from {um_from_m(low):g} to {um_from_m(high):g} um",
            expected="extremes on both sides of zero, as 0, +200, -200, 0 um",
            file=loop.file or None,
            line=loop.line,
        )
    if len(turns) >= CLOSED:
        force, deflection = _without_drift(loop, turns)
    else:
        at_high, at_low = drive >= high - loop.same, drive <= low + loop.same
        force, deflection = (float(of[at_high].mean() - of[at_low].mean()) for of in (loop.force, loop.deflection))
    if deflection and SOFTEST <= n_per_mm_from_n_per_m(force / deflection) <= STIFFEST:
        return force, deflection
    raise MeasurementError(
        f"{loop.title}: {force:g} N over a deflection of {um_from_m(deflection):g} um",
        expected=f"{SOFTEST:g} to {STIFFEST:g} N/mm",
        hint="force, jog and displacement count positive the same way, on a bench tension and stretch "
        "(--compression-positive says otherwise), in N and um: another unit is said by a mapping, "
        '--columns "force=force_N:kN, displacement=displacement_um:mm" (columns=)',
        file=loop.file or None,
        line=loop.line,
    )


def _without_drift(loop: Loop, turns: list[int]) -> tuple[float, float]:
    """Force (N) and deflection (m) between the extremes of three turns or more, less a steady drift."""
    drive = loop.drive
    bounds = [0, *((start + end) // 2 + 1 for start, end in pairwise(turns)), len(drive)]
    means = []
    for turn, (start, stop) in zip(turns, pairwise(bounds), strict=True):
        rows = start + np.flatnonzero(np.abs(drive[start:stop] - drive[turn]) <= loop.same)
        means.append((loop.force[rows].mean(), loop.deflection[rows].mean()))
    signs = np.where(drive[turns[1:-1]] < drive[turns[:-2]], 1.0, -1.0)
    force, deflection = (0.5 * (signs[:, None] * np.diff(np.array(means), 2, axis=0)).mean(axis=0)).tolist()
    return force, deflection


def _lost_motion(loop: Loop) -> float:
    """Distance at zero force between straight lines through the outer half of each side, both passes; m."""
    drive, at_zero = loop.drive, []
    high, low = float(drive.max()), float(drive.min())
    if not low < 0.0 < high or loop.side:
        return math.nan
    for outer in (drive >= 0.5 * high - SAME_JOG, drive <= 0.5 * low + SAME_JOG):
        force, deflection = loop.force[outer], loop.deflection[outer]
        if np.ptp(drive[outer]) < loop.same or np.ptp(force) == 0.0:
            return math.nan
        at_zero.append(float(np.polynomial.Polynomial.fit(force, deflection, 1)(0.0)))
    return at_zero[0] - at_zero[1]


def _sides(loop: Loop, turns: list[int], width: float) -> tuple[float, float]:
    """Stiffness in N/m under tension and under compression: slopes of two straight lines that meet at zero force.

    By least squares over all closed cycles, beside a deflection that goes on steadily from record to record. Of a loop
    that does not close nan where they cannot be told from its width, and without `A_SIDE` records of both.
    """
    closed = len(turns) >= CLOSED
    cycles = loop.part(slice(turns[0], turns[-1 - (len(turns) + 1) % 2] + 1)) if closed else loop
    force = cycles.force
    if min(len(np.unique(force[force > 0.0])), len(np.unique(force[force < 0.0]))) < A_SIDE:
        return math.nan, math.nan
    order = [np.arange(len(force), dtype=float)] if closed else []
    design = np.stack([np.ones_like(force), *order, np.maximum(force, 0.0), np.minimum(force, 0.0)], axis=1)
    scale = np.abs(design).max(axis=0)
    pulled, pushed = (np.linalg.lstsq(design / scale, cycles.deflection, rcond=None)[0] / scale).tolist()[-2:]
    farthest = min(float(force.max()), -float(force.min()))
    if min(pulled, pushed) <= 0.0 or (not closed and abs(pulled - pushed) * farthest < width):
        return math.nan, math.nan
    return 1.0 / pulled, 1.0 / pushed


def _loop_width(loop: Loop, main: slice) -> float:
    """Difference between the way from extreme to extreme and the way there and back, at the latter's forces; m."""
    order = np.argsort(loop.force[main], kind="stable")
    force, deflection = loop.force[main][order], loop.deflection[main][order]
    other = np.r_[0 : main.start, main.stop : len(loop.force)].astype(int)
    other = other[(loop.force[other] >= force[0]) & (loop.force[other] <= force[-1])]
    if not len(other):
        return math.nan
    return float(np.abs(loop.deflection[other] - np.interp(loop.force[other], force, deflection)).max())


def in_tension(loop: Loop) -> Loop:
    """Loop of a bench with tension positive; displacement is signed so that the stiffness is positive."""
    if loop.jog is not None:
        return loop
    force = -loop.force
    rises = float((force - force.mean()) @ (loop.displacement - loop.displacement.mean())) > 0.0
    return replace(loop, force=force, displacement=loop.displacement if rises else -loop.displacement)
