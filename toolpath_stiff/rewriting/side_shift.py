"""Moves shifted sideways, as a compensation asks for: where they meet, arcs that stay arcs, ramps. mm, degrees.

A shift is to the left of the feed, in the plane across the set-up's z axis; heights stay as they are. The plan view is
in complex numbers x + i y. Neighbours that are both shifted meet where their shifted courses intersect; a move without
a shift of its own (a lead-in, a link) carries the shift of its neighbour down to nothing; rapids, plunges, moves of the
rotary axes and arcs that stand on edge are never shifted, so that the shift ramps within its own move beside them.
"""

import cmath
import itertools
import math
from collections.abc import Collection, Mapping

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.nc.courses import move_lengths
from toolpath_stiff.nc.moves import ARC, FEED, Arc, Moves
from toolpath_stiff.units import deg_from_rad, mm_from_m

# A row of `Moves` -> shares of the move, ascending from 0 to 1, and the shift there to the left of the feed in mm.
Shifts = Mapping[int, tuple[FloatArray, FloatArray]]
Stretch = tuple[list[float], list[float], Arc | None]  # start and end (6) in the set-up frame, a part of a shifted move
Course = list[Stretch]

TOLERANCE = 5e-4  # mm, of a shift that varies along a move: straight pieces and arcs of constant radius stay within it
SHORTEST = 0.2  # mm, the shortest piece into which a move is cut
RAMP = 1.0  # mm, over which a shift comes and goes
LARGEST_MITRE = 3.0  # of the shift: neighbours that would meet further out ramp instead
STEEPEST = 5.0  # lengths of a shift over which it may come and go at least
SHALLOW = 0.1  # of singular values: neighbours within some 11 degrees of one line meet at the mean of their shifts
LARGEST_PIECE = math.pi / 8.0  # of an arc whose shift varies: circles through three points are within 0.3 um of that
NOTHING = 1e-6  # mm
STRAIGHT = 1e5  # mm: an arc of more is straight


def movable_rows(moves: Moves) -> BoolArray:
    """(n,) moves that may be shifted: feeds and flat arcs of linear axes, upright, no plunges or machine numbers."""
    plan = np.linalg.norm(moves.end[:, :2] - moves.start[:, :2], axis=1)
    plan = np.where(moves.arc_sweep != 0.0, move_lengths(moves), plan)
    steep = np.abs(moves.end[:, 2] - moves.start[:, 2]) * math.tan(defaults.PLUNGE_ANGLE) >= plan
    flat = (moves.arc_sweep == 0.0) | (np.abs(moves.arc_normal[:, 2]) > 1.0 - 1e-9)
    still = (moves.start[:, 3:] == moves.end[:, 3:]).all(axis=1) & ~moves.start[:, 3:5].any(axis=1)
    feeds = np.isin(moves.motion, (FEED, ARC)) & ~moves.from_machine.any(axis=1)
    return np.asarray(feeds & flat & still & ~steep)


class SideShift:
    """The courses of moves shifted to the left by given amounts.

    Parameters
    ----------
    moves
        Of the untouched program.
    shifts
        Of the moves that have one; a move that may not be shifted takes none, one with a shift of 0 stays.
    fixed
        Rows of further moves that may not be shifted.

    Attributes
    ----------
    courses
        Row -> its stretches, of every move that is no longer where it was.
    refused
        Row -> why its shift was left out.
    error
        Largest distance of a course from its shift, mm.
    """

    def __init__(self, moves: Moves, shifts: Shifts, fixed: Collection[int] = ()) -> None:
        self._ends = [
            np.concatenate([mm_from_m(ends[:, :3]), deg_from_rad(ends[:, 3:])], axis=1)
            for ends in (moves.start, moves.end)
        ]
        self._start, self._end = (ends[:, 0] + 1j * ends[:, 1] for ends in self._ends)
        center = mm_from_m(moves.arc_center)
        self._center = center[:, 0] + 1j * center[:, 1]
        self._normal = np.where(moves.arc_normal[:, 2] < 0.0, -1.0, 1.0)
        self._sweep = moves.arc_sweep * self._normal  # counter-clockwise, seen from above
        self._length = mm_from_m(move_lengths(moves))
        self._movable = movable_rows(moves)
        self._movable[list(fixed)] = False
        same = np.logical_and.reduce([moves.start[1:, axis] == moves.end[:-1, axis] for axis in range(6)])
        same &= (moves.tool[1:] == moves.tool[:-1]) & self._movable[1:] & self._movable[:-1]
        # (n + 1,) whether a move meets the one before it so that both may be shifted there
        self._joined = np.concatenate([[False], same, [False]])
        self.refused = {row: "a plunge or another move that is not shifted" for row in shifts if not self._movable[row]}
        while True:
            self.error = 0.0
            self._shifts = {row: knots for row, knots in shifts.items() if row not in self.refused}
            self._joint = self._joints()
            self._ramp_neighbours()
            shifted = {row for row, (_, shift) in self._shifts.items() if shift.any()}
            moved = sorted(shifted | {row for joint, by in self._joint.items() if by for row in (joint - 1, joint)})
            self.courses = {row: self._course(row) for row in moved}
            turned = {row for row, course in self.courses.items() if self._turned(row, course)}
            if not turned:
                break
            near = {other for row in turned for other in (row - 1, row, row + 1) if other in self._shifts}
            self.refused |= dict.fromkeys(near or self._shifts, "it, or its neighbour, is shorter than the shift")

    def _left(self, row: int, point: complex) -> complex:
        """Unit vector to the left of the feed of a move at a point of its plan."""
        if self._sweep[row] == 0.0:
            along = self._end[row] - self._start[row]
            return complex(1j * along / abs(along))
        inward = math.copysign(1.0, self._sweep[row]) * (self._center[row] - point)
        return complex(inward / abs(inward))

    def _shift_at(self, row: int, point: complex, moved: complex) -> float:
        """Shift to the left of the feed, mm, of a point of a move that was displaced by `moved`."""
        if self._sweep[row] == 0.0:
            return float((moved * self._left(row, point).conjugate()).real)
        center = self._center[row]
        return math.copysign(1.0, self._sweep[row]) * float(abs(point - center) - abs(point + moved - center))

    def _joints(self) -> dict[int, complex]:
        """Row -> displacement of its start, where it meets the end of the row before."""
        joints = {}
        for joint in sorted({*self._shifts, *(row + 1 for row in self._shifts)}):
            if not self._joined[joint] or not all(map(self._carries, (joint - 1, joint))):
                continue
            point = complex(self._start[joint])
            wanted = [(row, float(self._shifts[row][1][end])) for row, end in ((joint - 1, -1), (joint, 0))
                      if row in self._shifts]  # fmt: skip
            most, moved = LARGEST_MITRE * max(abs(shift) for _, shift in wanted), 0j
            for _ in range(4):  # the circles of arcs: Newton's steps
                left = [self._left(row, point + moved) for row, _ in wanted]
                missing = [shift - self._shift_at(row, point, moved) for row, shift in wanted]
                step = np.linalg.lstsq(np.array([[n.real, n.imag] for n in left]), np.array(missing), rcond=SHALLOW)[0]
                moved += complex(*step)
            still = [row for row, _ in wanted if not self._shifts[row][1].any()]
            if abs(moved) < NOTHING or any(abs(self._shift_at(row, point, moved)) > TOLERANCE for row in still):
                moved = 0j  # a move that must stay is not displaced
            joints[joint] = moved * min(1.0, most / abs(moved)) if moved else 0j
        return joints

    def _ramp_neighbours(self) -> None:
        """Displace the joints of unshifted moves over which a neighbour's shift runs out."""
        for joint, moved in [*self._joint.items()]:
            for step in (-1, 1):
                joints, way = [], 0.0
                row = joint - 1 if step < 0 else joint
                while way < RAMP and self._movable[row] and row not in self._shifts:
                    way += float(self._length[row])
                    following = row if step < 0 else row + 1
                    if not self._joined[following] or not self._carries(row):
                        if way < STEEPEST * abs(moved):
                            self._joint[joint] = 0j
                        break
                    joints.append((following, way))
                    row += step
                for following, along in joints:
                    if along < way and not {following, following - 1} & self._shifts.keys():
                        self._joint[following] = self._joint.get(following, 0j) + moved * (1.0 - along / way)

    def _carries(self, row: int) -> bool:
        """True if a move can follow a neighbour's shift: it has one of its own, is straight, or is an open arc."""
        return row in self._shifts or not self._sweep[row] or abs(self._end[row] - self._start[row]) > RAMP

    def _course(self, row: int) -> Course:
        first, last = self._joint.get(row, 0j), self._joint.get(row + 1, 0j)
        start, end = complex(self._start[row] + first), complex(self._end[row] + last)
        knots = self._shifts.get(row)
        if knots is None:
            center = complex(self._center[row])
            if self._sweep[row] and first != last:  # turned and stretched as its chord is: an arc as before
                center = start + (center - self._start[row]) * (end - start) / (self._end[row] - self._start[row])
            elif self._sweep[row]:
                center += first
            return [self._stretch(row, (0.0, 1.0), start, end, center, float(self._sweep[row]))]
        shares, shift = self._with_ramps(row, *knots, (first, last))
        steady = float(np.ptp(shift)) <= TOLERANCE
        parts = 1 if steady else max(1, math.ceil(abs(self._sweep[row]) / LARGEST_PIECE))
        borders = np.linspace(0.0, 1.0, parts + 1)
        at_all = np.union1d(shares, borders)
        shift = np.interp(at_all, shares, shift)
        keep = self._pieces(at_all * self._length[row], shift, np.searchsorted(at_all, borders).tolist())
        shares, shift = at_all[keep], shift[keep]
        points = [start, *(self._point(row, u, e) for u, e in zip(shares[1:-1], shift[1:-1], strict=True)), end]
        course = []
        for part, (a, b) in enumerate(itertools.pairwise(points)):
            span = float(shares[part]), float(shares[part + 1])
            if self._sweep[row] == 0.0:
                center, sweep = 0j, 0.0
            elif steady:
                center = complex(self._center[row])
                old = complex(self._start[row]) - center, complex(self._end[row]) - center
                sweep = (
                    float(self._sweep[row]) + cmath.phase((b - center) / old[1]) - cmath.phase((a - center) / old[0])
                )
            else:
                middle = self._point(row, sum(span) / 2.0, float(shift[part] + shift[part + 1]) / 2.0)
                center, sweep = _arc_through(a, middle, b)
            course.append(self._stretch(row, span, a, b, center, sweep))
        return course

    def _with_ramps(
        self, row: int, shares: FloatArray, shift: FloatArray, moved: tuple[complex, complex]
    ) -> tuple[FloatArray, FloatArray]:
        """Knots of a move's shift, bent within `RAMP` of each end to the shift that its neighbour allows there."""
        length, ends = float(self._length[row]), (complex(self._start[row]), complex(self._end[row]))
        missing = [self._shift_at(row, p, d) - float(e) for p, d, e in zip(ends, moved, shift[[0, -1]], strict=True)]
        ramp = min(RAMP / length, 0.5)
        added = [u for u, off in zip((ramp, 1.0 - ramp), missing, strict=True) if abs(off) > TOLERANCE]
        all_shares = np.union1d(shares, added)
        shift = np.interp(all_shares, shares, shift)
        for off, along in zip(missing, (all_shares, 1.0 - all_shares), strict=True):
            shift = shift + off * np.maximum(0.0, 1.0 - along / ramp)
        return all_shares, shift

    def _pieces(self, along: FloatArray, shift: FloatArray, keep: list[int]) -> list[int]:
        """Rows of knots between which straight lines stay within `TOLERANCE`; those added are `SHORTEST` apart."""
        while True:
            off = np.abs(np.interp(along, along[keep], shift[keep]) - shift)
            near = np.abs(along[:, None] - along[keep]).min(axis=1) < SHORTEST
            worst = int(np.where(near, 0.0, off).argmax())
            if near[worst] or off[worst] <= TOLERANCE:
                self.error = max(self.error, float(off.max()))
                return keep
            keep = sorted([*keep, worst])

    def _point(self, row: int, share: float, shift: float) -> complex:
        start, sweep = complex(self._start[row]), float(self._sweep[row])
        point = start + share * (complex(self._end[row]) - start)
        if sweep:
            center = complex(self._center[row])
            growth = abs(self._end[row] - center) / abs(start - center) - 1.0
            point = center + (start - center) * (1.0 + share * growth) * cmath.rect(1.0, share * sweep)
        return complex(point + float(shift) * self._left(row, point))

    def _stretch(
        self, row: int, span: tuple[float, float], start: complex, end: complex, center: complex, sweep: float
    ) -> Stretch:
        whole = [ends[row] for ends in self._ends]
        first, last = ((whole[0] + u * (whole[1] - whole[0])).tolist() for u in span)
        normal = float(self._normal[row])
        arc = Arc((center.real, center.imag, first[2]), (0.0, 0.0, normal), sweep * normal) if sweep else None
        return [start.real, start.imag, *first[2:]], [end.real, end.imag, *last[2:]], arc

    def _turned(self, row: int, course: Course) -> bool:
        """True if a shift has reversed a move or part of it."""
        if self._sweep[row]:
            return any(
                arc is not None and arc.sweep * self._normal[row] * self._sweep[row] <= 0.0 for *_, arc in course
            )
        along = (self._end[row] - self._start[row]).conjugate()
        return any(((b[0] - a[0] + 1j * (b[1] - a[1])) * along).real <= 0.0 for a, b, _ in course)


def _arc_through(start: complex, middle: complex, end: complex) -> tuple[complex, float]:
    """Centre and sweep of the arc through three points; a sweep of 0 if they are practically in line."""
    a, b = middle - start, end - start
    cross = (a.conjugate() * b).imag
    if abs(cross) * STRAIGHT < abs(a) * abs(b) * abs(b - a):
        return 0j, 0.0
    to_center = 1j * (a * abs(b) ** 2 - b * abs(a) ** 2) / (2.0 * cross)
    center = start + to_center
    sweep = cmath.phase((middle - center) / (start - center)) + cmath.phase((end - center) / (middle - center))
    return center, sweep
