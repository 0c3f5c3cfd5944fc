"""Courses of moves: lengths, frames of arcs, points and tangents along them. SI units unless mm are stated."""

import math
from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray, norms
from toolpath_stiff.nc.moves import Arc, Moves
from toolpath_stiff.units import deg_from_rad, mm_from_m

Extents = dict[str, list[float]]  # axis -> its lowest and highest value, mm or degrees


def move_lengths(moves: Moves) -> FloatArray:
    r"""(n,) m, length of the tip's path in each move.

    An arc's is sqrt((r sweep)^2 + climb^2); where start and end radius differ (a control's tolerance, or a spiral)
    r is their mean, which is exact to second order in the difference.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> moves = parse_program("G21 G90 F600\nG1 X30 Y40\nG2 X50 Y40 I10 J0\nM30\n").moves
    >>> (move_lengths(moves) * 1e3).round(3).tolist()  # mm
    [50.0, 31.416]
    """
    chord = norms(moves.end[:, :3] - moves.start[:, :3])
    arc = moves.arc_sweep != 0.0
    if arc.any():
        frame = arc_frame(moves, np.flatnonzero(arc))
        radius = 0.5 * (frame.radius_start + frame.radius_end)
        sweep = moves.arc_sweep[arc]
        chord[arc] = np.sqrt((radius * sweep) ** 2 + frame.climb**2 + (frame.radius_end - frame.radius_start) ** 2)
    return np.asarray(chord)


def length_of_move(start: Sequence[float], end: Sequence[float], arc: Arc | None) -> float:
    """Length of a move in mm, of arcs as in `move_lengths`, so that G93's F is one over the move's time."""
    if arc is None:
        return math.dist(start[:3], end[:3])
    climb = sum((e - s) * n for s, e, n in zip(start, end, arc.normal, strict=False))
    first = math.dist(start[:3], arc.center)
    last = math.sqrt(max(math.dist(end[:3], arc.center) ** 2 - climb**2, 0.0))
    return math.hypot(arc.sweep * (first + last) / 2.0, climb, last - first)


class ArcFrame:
    """Plane, radii and climb of some arcs: position(u) = c + r(u) (cos e1 + sin e2) + (lift + u climb) n."""

    def __init__(self, center: FloatArray, normal: FloatArray, start: FloatArray, end: FloatArray) -> None:
        from_center, to_end = start - center, end - center
        self.normal, self.center = normal, center
        lift = np.einsum("ni,ni->n", from_center, normal)
        self.climb = np.einsum("ni,ni->n", to_end, normal) - lift
        in_plane = from_center - lift[:, None] * normal
        self.radius_start = norms(in_plane)
        self.radius_end = norms(to_end - (lift + self.climb)[:, None] * normal)
        self.e1 = in_plane / self.radius_start[:, None]
        self.e2 = np.cross(normal, self.e1)
        self.lift = lift


def arc_frame(moves: Moves, rows: IntArray) -> ArcFrame:
    """Frames of the arcs in `rows` of moves."""
    return ArcFrame(moves.arc_center[rows], moves.arc_normal[rows], moves.start[rows, :3], moves.end[rows, :3])


def frame_of(arc: Arc, start: Sequence[float], end: Sequence[float]) -> ArcFrame:
    """Frame of a single arc in mm."""
    return ArcFrame(*(np.array([point[:3]], dtype=float) for point in (arc.center, arc.normal, start, end)))


def point_on_arc(arc: Arc, start: Sequence[float], end: Sequence[float], share: float) -> tuple[float, float, float]:
    """Point at a share of an arc's sweep, as it is sampled; mm."""
    frame, row = frame_of(arc, start, end), np.zeros(1, dtype=np.int64)
    x, y, z = _along_arcs(frame, np.array([arc.sweep]), row, np.array([share]))[0][0].tolist()
    return (x, y, z)


def points_along(moves: Moves, move: IntArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions (n, 3) and unit tangents (n, 3) at shares u of moves; ends are met exactly."""
    start, end = moves.start[:, :3], moves.end[:, :3]
    chord = end - start
    length = norms(chord)
    tangent = (chord / np.where(length > 0.0, length, 1.0)[:, None]).take(move, axis=0)
    position = start.take(move, axis=0)  # in a program of short moves most samples are ends
    last = np.flatnonzero(u == 1.0)
    position[last] = end[move[last]]
    inner = np.flatnonzero((u != 0.0) & (u != 1.0))
    position[inner] += u[inner, None] * chord[move[inner]]
    arcs = np.flatnonzero(moves.arc_sweep != 0.0)
    if len(arcs):
        frame = arc_frame(moves, arcs)
        which = np.full(len(moves), -1)
        which[arcs] = np.arange(len(arcs))
        rows = np.flatnonzero(moves.arc_sweep[move] != 0.0)
        along, tangent[rows] = _along_arcs(frame, moves.arc_sweep[arcs], which[move[rows]], u[rows])
        between = (u[rows] != 0.0) & (u[rows] != 1.0)
        position[rows[between]] = along[between]
    return position, tangent


def _along_arcs(frame: ArcFrame, sweep: FloatArray, arc: IntArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    angle = (u * sweep[arc])[:, None]
    growth = (frame.radius_end - frame.radius_start)[arc][:, None]
    radius = frame.radius_start[arc][:, None] + u[:, None] * growth
    e1, e2, normal = frame.e1[arc], frame.e2[arc], frame.normal[arc]
    outward = np.cos(angle) * e1 + np.sin(angle) * e2
    around = -np.sin(angle) * e1 + np.cos(angle) * e2
    position = frame.center[arc] + radius * outward + (frame.lift[arc] + u * frame.climb[arc])[:, None] * normal
    velocity = radius * sweep[arc][:, None] * around + growth * outward + frame.climb[arc][:, None] * normal
    return position, velocity / norms(velocity)[:, None]


def extents(moves: Moves) -> Extents:
    """Smallest and largest x, y, z (mm) and a, b, c (degrees) on the way, the bulges of arcs included."""
    if not len(moves):
        return {}
    ends = np.stack([moves.start, moves.end])
    low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    bulges = _arc_extremes(moves.take(moves.arc_sweep != 0.0))
    if len(bulges):
        low[:3], high[:3] = np.minimum(low[:3], bulges.min(axis=0)), np.maximum(high[:3], bulges.max(axis=0))
    scale = np.array([mm_from_m(1.0)] * 3 + [deg_from_rad(1.0)] * 3)
    return {name: [float(lo), float(hi)] for name, lo, hi in zip("xyzabc", low * scale, high * scale, strict=True)}


def _arc_extremes(arcs: Moves) -> FloatArray:
    """(m, 3) m, points of arcs at which a coordinate has an extreme; climb and radius change in step with the angle."""
    row = np.arange(len(arcs))
    frame, sweep = arc_frame(arcs, row), np.abs(arcs.arc_sweep)
    points = [np.empty((0, 3))]
    for axis in range(3):
        turning = np.arctan2(frame.e2[:, axis] * np.sign(arcs.arc_sweep), frame.e1[:, axis])
        for opposite in (0.0, np.pi):
            angle = np.mod(turning + opposite, 2.0 * np.pi)
            last_turn = angle + 2.0 * np.pi * np.floor(np.maximum(sweep - angle, 0.0) / (2.0 * np.pi))
            for turned in (angle, last_turn):
                inside = turned < sweep
                points.append(points_along(arcs, row[inside], (turned / sweep)[inside])[0])
    return np.concatenate(points)
