"""Figures of one loop of raw records: stiffness, play, friction, linearity, slopes of its two sides.

With the jog y, the force F and the displacement D read by the indicator, the deflection is y - D, and the paper's
equation 12 is its secant between the extremes:

    k = (F(+0.2 mm) - F(-0.2 mm)) / (0.4 mm - (D(+0.2 mm) - D(-0.2 mm)))

A strut measured alone on a bench is not jogged: the force is set and its own stretch D read, so that k is the slope of
the force over D between the extremes of the force.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.errors import InputError, InputErrors, MeasurementError
from toolpath_stiff.readings.raw_cycles import closed_cycle, closed_cycles, ends_without_drift, turns_of
from toolpath_stiff.readings.raw_records import SAME_JOG, Loop
from toolpath_stiff.readings.raw_sides import play_of, sides_of
from toolpath_stiff.readings.rows import SOFTEST, STIFFEST
from toolpath_stiff.units import n_per_mm_from_n_per_m, um_from_m

CLOSED = 3  # turns of the drive, from which the records hold a closed cycle


@dataclass(frozen=True)
class LoopFigures:
    """What a loop says. SI; nan where it has too few records.

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
    closure
        m, deflection at the end less that at the beginning.
    tension, compression
        N/m, slopes of the two sides of a strut on a bench; beyond the lost motion where there is any.
    beyond
        N/m, what the secant of a strut on a bench would be without lost motion (`raw_sides.play_of`). nan
        without a closed cycle that reaches both sides.
    plays
        Whether the record shows lost motion.
    """

    loop: Loop
    stiffness: float
    force: float
    deflection: float = math.nan
    lost_motion: float = math.nan
    loop_width: float = math.nan
    linearity: float = math.nan
    closure: float = math.nan
    tension: float = math.nan
    compression: float = math.nan
    beyond: float = math.nan
    plays: bool = False

    @property
    def side(self) -> float:
        """1 of tension, -1 of compression, as recorded or stated; 0 of both or unknown."""
        if len(self.loop.force):
            return self.loop.side
        return 0.0 if math.isnan(self.force) else math.copysign(1.0, self.force)


def reduce_loop(loop: Loop) -> LoopFigures:
    """Stiffness by the paper's equation 12, and what the loop says about play, friction and linearity.

    Raises
    ------
    InputError
        The loop does not reach both sides, or gives no stiffness that could be.
    """
    drive, turns = loop.drive, turns_of(loop.drive)
    force, deflection = _between_extremes(loop, turns)
    cycle = loop.part(closed_cycle(turns)) if len(turns) >= CLOSED else loop
    start, end = turns_of(cycle.drive)[:2]
    way = slice(start, end + 1)  # from extreme to extreme
    width = _loop_width(cycle, way)
    play, shown = _play(loop, turns)
    sides = (math.nan, math.nan) if loop.jog is not None else _sides(loop, turns, width, gap=shown)
    if shown:
        # Lost motion adds the same to the compliance of both sides: their difference is kept, and together they give
        # the deflection without it at the extremes.
        high, low = float(drive.max()), float(drive.min())
        apart = 1.0 / sides[0] - 1.0 / sides[1]
        pushed = (deflection - play - apart * high) / (high - low)
        pulled = pushed + apart
        sides = (1.0 / pulled, 1.0 / pushed) if min(pulled, pushed) > 0.0 else (math.nan, math.nan)
    main_force, main = cycle.force[way], cycle.deflection[way]
    secant = main[0] + (main[-1] - main[0]) * (main_force - main_force[0]) / (main_force[-1] - main_force[0])
    return LoopFigures(
        loop,
        stiffness=force / deflection,
        force=loop.side * force if loop.side else force / 2.0,
        deflection=deflection,
        lost_motion=_lost_motion(cycle),
        loop_width=width,
        linearity=float(np.abs(main - secant).max() / deflection),
        closure=float(loop.deflection[-1] - loop.deflection[0]),
        tension=sides[0],
        compression=sides[1],
        beyond=force / (deflection - play),
        plays=shown,
    )


def _between_extremes(loop: Loop, turns: list[int]) -> tuple[float, float]:
    """Force (N) and deflection (m) between the extremes. Raises `InputError` where they give no stiffness."""
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
        force, deflection = ends_without_drift(drive, loop.force, loop.deflection, turns, loop.same)
    else:
        at_high, at_low = drive >= high - loop.same, drive <= low + loop.same
        force, deflection = (float(of[at_high].mean() - of[at_low].mean()) for of in (loop.force, loop.deflection))
    stiffness = n_per_mm_from_n_per_m(force / deflection) if deflection else math.inf
    if SOFTEST <= stiffness <= STIFFEST:
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


def _lost_motion(loop: Loop) -> float:
    """Straight lines through the outer half of each side, both passes; their distance at zero force."""
    drive, at_zero = loop.drive, []
    high, low = float(drive.max()), float(drive.min())
    if not low < 0.0 < high or loop.side:
        return math.nan
    for outer in (drive >= 0.5 * high - SAME_JOG, drive <= 0.5 * low + SAME_JOG):
        force, deflection = loop.force[outer], loop.deflection[outer]
        if np.ptp(drive[outer]) < loop.same or np.ptp(force) == 0.0:
            return math.nan
        centred = force - force.mean()
        slope = (centred @ deflection) / (centred @ centred)
        at_zero.append(float(deflection.mean() - slope * force.mean()))
    return at_zero[0] - at_zero[1]


def _sides(loop: Loop, turns: list[int], width: float, gap: bool) -> tuple[float, float]:
    """Slopes of the two sides in N/m; nan where they cannot be told from the width of a loop that does not close."""
    if len(turns) >= CLOSED:
        cycles = loop.part(closed_cycles(turns))
        return sides_of(cycles.force, cycles.deflection, drift=True, gap=gap)
    sides = sides_of(loop.force, loop.deflection)
    farthest = min(float(loop.force.max()), -float(loop.force.min()))
    return (math.nan, math.nan) if abs(1.0 / sides[0] - 1.0 / sides[1]) * farthest < width else sides


def _play(loop: Loop, turns: list[int]) -> tuple[float, bool]:
    """The lost motion of a strut on a bench, of all its closed cycles, as `play_of`."""
    if loop.jog is not None or len(turns) < CLOSED or loop.side:
        return math.nan, False
    records = closed_cycles(turns)
    cycles = loop.part(records)
    way = np.searchsorted(np.array(turns), np.arange(records.start, records.stop), side="right") % 2
    return play_of(cycles.force, cycles.deflection, np.where(way == 1, 1.0, -1.0))


def _loop_width(loop: Loop, main: slice) -> float:
    """The way from extreme to extreme against the way there and the way back, at the forces of the latter."""
    order = np.argsort(loop.force[main], kind="stable")
    force, deflection = loop.force[main][order], loop.deflection[main][order]
    other = np.r_[0 : main.start, main.stop : len(loop.force)].astype(int)
    other = other[(loop.force[other] >= force[0]) & (loop.force[other] <= force[-1])]
    if not len(other):
        return math.nan
    return float(np.abs(loop.deflection[other] - np.interp(loop.force[other], force, deflection)).max())


def in_tension(loop: Loop) -> Loop:
    """A loop of a bench with tension positive; its displacement counts the way that makes a stiffness positive."""
    if loop.jog is not None or not len(loop.force):
        return loop
    force = -loop.force
    way = 1.0 if float((force - force.mean()) @ (loop.displacement - loop.displacement.mean())) > 0.0 else -1.0
    return replace(loop, force=force, displacement=way * loop.displacement)


def reduce_loops(loops: Iterable[Loop]) -> list[LoopFigures]:
    """Figures of every loop. Raises `InputErrors` that name all loops that give none."""
    figures, errors = [], []
    for loop in loops:
        try:
            figures.append(reduce_loop(loop))
        except InputError as error:
            errors.append(error)
    if errors:
        raise InputErrors(errors)
    return figures
