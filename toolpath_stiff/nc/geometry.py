"""Geometry of moves: arcs from their words, tool axes, strokes of drilling cycles; lengths and points along all moves.

Arcs of G2 and G3 have LinuxCNC's tolerances. Canned drilling cycles are expanded to their moves as LinuxCNC does
(manual, "Canned cycles"; interp_cycles.cc). Words are in mm and degrees, `Moves` in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.nc.moves import Arc, Moves
from toolpath_stiff.nc.tables import LARGEST_MM
from toolpath_stiff.units import MM_PER_INCH

Point2 = tuple[float, float]
Vector = tuple[float, float, float]

# Of LinuxCNC's rs274 2.9, by bisection (the tests hold both sides of each): start and end radius may differ by a
# thousandth of the larger one, or by 2 sqrt(2) hundredths of a millimetre (thousandths of an inch in inch programs) if
# that is more, and never by more than a hundred times that. It leaves room for ends that are rounded to 0.01 mm.
RELATIVE_TOLERANCE = 1e-3
MM_TOLERANCE = 2.0 * math.sqrt(2.0) * 1e-2
INCH_TOLERANCE = 2.0 * math.sqrt(2.0) * 1e-3 * MM_PER_INCH
MOST_TOLERANCES = 100.0
RADIUS_FORMAT_TOLERANCE = 1.27e-3  # mm; a half chord may exceed R by this much, in inch programs too
SMALLEST_RADIUS = 1.27e-3  # mm; an arc of less is one of radius 0

PLANES = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}  # first, second axis, normal: right-handed
CENTER_WORDS = ("I", "J", "K")
CENTER_LETTERS = "IJKR"  # words that an arc alone has

FEEDS_OUT = ("G89", "G84", "G74")
PECK_CLEARANCE_MM = 0.254  # G73, G83: how far above the last depth the rapid ends (0.010 in; LinuxCNC's default)
LEAST_SWEEP = 1e-10  # rad; an arc of less is a whole turn
CORNER_ANGLE = 1e-6  # rad; a corner of less is none
SAME_HEIGHT_MM = 1e-9  # a peck that ends at the bottom but for rounding is the last one
MOST_STROKES = 100_000  # of one block; beyond, the depth of a peck or the number of repeats is a slip


def normal_of(plane: str) -> Vector:
    """Unit normal of a plane, in program axes.

    Examples
    --------
    >>> normal_of("G18")
    (0.0, 1.0, 0.0)
    """
    normal = PLANES[plane][2]
    return (float(normal == 0), float(normal == 1), float(normal == 2))


class ArcError(Exception):
    """What is wrong with an arc: found, expected."""

    def __init__(self, problem: str, expected: str) -> None:
        super().__init__(problem)
        self.found, self.expected = problem, expected


def center_from_radius(start: Point2, end: Point2, radius: float, clockwise: bool) -> Point2:
    """Centre of an arc given by R; a negative radius takes the longer way. Raises `ArcError`.

    Examples
    --------
    >>> center_from_radius((0.0, 0.0), (20.0, 0.0), 10.0, clockwise=False)
    (10.0, 0.0)
    """
    if start == end:
        raise ArcError("an arc with R that ends where it starts", "another end point, or I, J, K for a full circle")
    if radius == 0.0:
        raise ArcError("an arc of radius 0", "R other than 0")
    chord = math.dist(start, end)
    half, size = chord / 2.0, abs(radius)
    if half - size > RADIUS_FORMAT_TOLERANCE:
        raise ArcError(
            f"an arc whose radius {size:g} mm cannot reach its end {chord:.4f} mm away",
            f"a radius of at least {half:.4f} mm",
        )
    height = math.sqrt(max(size * size - half * half, 0.0))
    # The centre lies left of the chord for a short counter-clockwise arc.
    side = 1.0 if (radius > 0.0) != clockwise else -1.0
    along = ((end[0] - start[0]) / chord, (end[1] - start[1]) / chord)
    middle = ((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0)
    return (middle[0] - side * height * along[1], middle[1] + side * height * along[0])


def check_radii(start: Point2, end: Point2, center: Point2, inch: bool = False) -> None:
    """Raise `ArcError` if start and end do not lie on one circle about the centre within LinuxCNC's tolerance.

    `inch`: it is an inch program, whose ends may be rounded to thousandths; the points are in mm all the same.

    Examples
    --------
    >>> check_radii((10.0, 0.0), (0.0, 10.001), (0.0, 0.0))
    >>> check_radii((10.0, 0.0), (10.0, 0.0), (10.0, 0.0))
    Traceback (most recent call last):
        ...
    toolpath_stiff.nc.geometry.ArcError: an arc of radius 0
    """
    first, last = math.dist(start, center), math.dist(end, center)
    if first < SMALLEST_RADIUS or last < SMALLEST_RADIUS:
        raise ArcError("an arc of radius 0", "a centre apart from the start and the end point")
    difference, least = abs(first - last), INCH_TOLERANCE if inch else MM_TOLERANCE
    allowed = min(max(least, RELATIVE_TOLERANCE * max(first, last)), MOST_TOLERANCES * least)
    if difference > allowed:
        raise ArcError(
            f"an arc whose end lies {difference:.4f} mm off its circle (radius {first:.4f} mm at the start, "
            f"{last:.4f} mm at the end)",
            f"radii that agree within {allowed:.4f} mm",
        )


def check_bulge(radius: float, sweep: float) -> None:
    """Raise `ArcError` if an arc leaves its start further than coordinates may be apart: its ends do not bound it.

    Examples
    --------
    >>> check_bulge(1e9, 1e-7)
    """
    away = 2.0 * radius * math.sin(min(abs(sweep), math.pi) / 2.0)
    if away > LARGEST_MM:
        raise ArcError(
            f"an arc of radius {radius:g} mm that goes {away:g} mm away from its start", f"at most {LARGEST_MM:g} mm"
        )


def arc_sweep(start: Point2, end: Point2, center: Point2, clockwise: bool, turns: int) -> float:
    """Signed angle in rad (counter-clockwise positive); start = end is a full circle; P words add whole turns.

    Examples
    --------
    >>> math.degrees(arc_sweep((10.0, 0.0), (0.0, 10.0), (0.0, 0.0), clockwise=False, turns=1))
    90.0
    >>> math.degrees(arc_sweep((10.0, 0.0), (0.0, 10.0), (0.0, 0.0), clockwise=True, turns=1))
    -270.0
    """
    first = math.atan2(start[1] - center[1], start[0] - center[0])
    last = math.atan2(end[1] - center[1], end[0] - center[0])
    sweep = turn_between(first, last, clockwise)
    return sweep + math.copysign(math.tau * (turns - 1), sweep)


def turn_between(first: float, last: float, clockwise: bool) -> float:
    """Signed turn in rad from one polar angle to another, above 0 and up to a whole one in size."""
    sweep = (first - last if clockwise else last - first) % math.tau
    # The modulus of a tiny negative difference is almost a whole turn, and must be one.
    if sweep < LEAST_SWEEP:
        sweep = math.tau
    return -sweep if clockwise else sweep


def arc_sweeps(start: FloatArray, end: FloatArray, center: FloatArray, clockwise: BoolArray) -> FloatArray:
    """(n,) `arc_sweep` of n arcs (n, 2) of one turn, digit for digit.

    Examples
    --------
    >>> start, end, center = np.array([[10.0, 0.0]]), np.array([[0.0, 10.0]]), np.zeros((1, 2))
    >>> np.degrees(arc_sweeps(start, end, center, np.array([True])))
    array([-270.])
    """
    # `math`, as numpy's own arc tangent differs in the last digit between processors.
    first, last = (
        map(math.atan2, (point - center)[:, 1].tolist(), (point - center)[:, 0].tolist()) for point in (start, end)
    )
    return np.array(list(map(turn_between, first, last, clockwise.tolist())), dtype=float)


def radii_clearly_agree(start: FloatArray, end: FloatArray, center: FloatArray, inch: bool) -> BoolArray:
    """(n,) whether arcs (n, 2) are so far within `check_radii` and `check_bulge` that rounding does not matter."""
    first, last = (np.sqrt(((point - center) ** 2).sum(axis=1)) for point in (start, end))
    least = INCH_TOLERANCE if inch else MM_TOLERANCE
    small = np.maximum(first, last) < LARGEST_MM / 2.0  # wherever it goes, `check_bulge` allows it
    return np.asarray((np.minimum(first, last) > 2.0 * SMALLEST_RADIUS) & (np.abs(first - last) < 0.5 * least) & small)


def corner(
    begin: Sequence[float], vertex: Sequence[float], end: Sequence[float], normal: Vector, size: float, rounded: bool
) -> tuple[Vector, Vector, Vector, float] | None:
    """Where the corner at `vertex` between two straight moves is cut off or rounded; None where they go straight on.

    Returns the end of the first move, the beginning of the second, the centre and the signed sweep in rad about
    `normal` (a unit vector). Raises `ArcError` unless both moves lie in the plane of `normal` and are long enough.

    Examples
    --------
    >>> first, last, center, sweep = corner((0, 0, 0), (9, 0, 0), (9, 9, 0), (0.0, 0.0, 1.0), 2.0, rounded=True)
    >>> first, center
    ((7.0, 0.0, 0.0), (7.0, 2.0, 0.0))
    """
    here, z = np.asarray(vertex, dtype=float), np.array(normal)
    before, after = here - begin, np.asarray(end, dtype=float) - here
    lengths = float(np.linalg.norm(before)), float(np.linalg.norm(after))
    if min(lengths) == 0.0 or max(abs(before @ z), abs(after @ z)) > SAME_HEIGHT_MM:
        raise ArcError("a corner between moves that do not lie in the plane, or have no length", "two moves in it")
    u, v = before / lengths[0], after / lengths[1]
    turn = math.atan2(float(np.cross(u, v) @ z), float(u @ v))
    if abs(turn) < CORNER_ANGLE:
        return None
    if math.pi - abs(turn) < CORNER_ANGLE:
        raise ArcError("a corner of a path that goes straight back", "another direction")
    along = size * math.tan(abs(turn) / 2.0) if rounded else size
    if along > min(lengths):
        raise ArcError(
            f"a corner that takes {along:.4f} mm of moves of {lengths[0]:.4f} and {lengths[1]:.4f} mm", "a smaller one"
        )
    left = math.copysign(size, turn) * np.cross(z, u)
    first = here - along * u
    return _vector(first), _vector(here + along * v), _vector(first + left), turn


def _vector(values: FloatArray) -> Vector:
    x, y, z = values.tolist()
    return (x, y, z)


def roll_pitch_of_axis(i: float, j: float, k: float) -> tuple[float, float]:
    """Roll and pitch in degrees that turn the spindle's z onto a tool axis, at a yaw of 0.

    With R = Rz(c) Ry(b) Rx(a) and c = 0 the tool axis, from the tip to the spindle, is R z = (sin b cos a, -sin a,
    cos b cos a) (the convention of `rotations`). Roll is in [-90, 90]; where it is +-90, pitch is 0.

    Parameters
    ----------
    i, j, k
        The tool axis from tip to spindle, of any length above 0.

    Examples
    --------
    >>> roll, pitch = roll_pitch_of_axis(0.0, 0.5, math.sqrt(0.75))
    >>> round(roll, 9), pitch
    (-30.0, 0.0)
    """
    across = math.hypot(i, k)
    pitch = math.degrees(math.atan2(i, k)) if across else 0.0
    return math.degrees(math.atan2(-j, across)), pitch


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
    chord = np.linalg.norm(moves.end[:, :3] - moves.start[:, :3], axis=1)
    arc = moves.arc_sweep != 0.0
    if arc.any():
        frame = arc_frame(moves, np.flatnonzero(arc))
        radius = 0.5 * (frame.radius_start + frame.radius_end)
        sweep = moves.arc_sweep[arc]
        chord[arc] = np.sqrt((radius * sweep) ** 2 + frame.climb**2 + (frame.radius_end - frame.radius_start) ** 2)
    return np.asarray(chord)


class ArcFrame:
    """Plane, radii and climb of some arcs: position(u) = c + r(u) (cos e1 + sin e2) + (lift + u climb) n."""

    def __init__(self, center: FloatArray, normal: FloatArray, start: FloatArray, end: FloatArray) -> None:
        from_center, to_end = start - center, end - center
        self.normal, self.center = normal, center
        lift = np.einsum("ni,ni->n", from_center, normal)
        self.climb = np.einsum("ni,ni->n", to_end, normal) - lift
        in_plane = from_center - lift[:, None] * normal
        self.radius_start = np.linalg.norm(in_plane, axis=1)
        end_in_plane = to_end - (lift + self.climb)[:, None] * normal
        self.radius_end = np.linalg.norm(end_in_plane, axis=1)
        self.e1 = in_plane / self.radius_start[:, None]
        self.e2 = np.cross(normal, self.e1)
        self.lift = lift


def arc_frame(moves: Moves, rows: IntArray) -> ArcFrame:
    """The frames of the arcs in `rows` of moves."""
    return ArcFrame(moves.arc_center[rows], moves.arc_normal[rows], moves.start[rows, :3], moves.end[rows, :3])


def frame_of(arc: Arc, start: Sequence[float], end: Sequence[float]) -> ArcFrame:
    """The frame of one arc in mm."""
    return ArcFrame(*(np.array([point[:3]], dtype=float) for point in (arc.center, arc.normal, start, end)))


def point_on_arc(arc: Arc, start: Sequence[float], end: Sequence[float], share: float) -> Vector:
    """The point at a share of an arc's sweep, as it is sampled; mm."""
    frame, row = frame_of(arc, start, end), np.zeros(1, dtype=np.int64)
    return _vector(_along_arcs(frame, np.array([arc.sweep]), row, np.array([share]))[0][0])


def points_along(moves: Moves, move: IntArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions (n, 3) and unit tangents (n, 3) at shares u of moves; ends are met exactly."""
    start, end = moves.start[:, :3], moves.end[:, :3]
    chord = end - start
    length = np.linalg.norm(chord, axis=1)
    direction = chord / np.where(length > 0.0, length, 1.0)[:, None]
    tangent = direction.take(move, axis=0)
    position = start.take(move, axis=0)  # of most samples in a program of short moves: they are ends
    last = np.flatnonzero(u == 1.0)
    position[last] = end[move[last]]
    inner = np.flatnonzero((u != 0.0) & (u != 1.0))
    of = move[inner]
    position[inner] += u[inner, None] * chord[of]
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
    height = (frame.lift[arc] + u * frame.climb[arc])[:, None]
    position = frame.center[arc] + radius * outward + height * normal
    velocity = radius * sweep[arc][:, None] * around + growth * outward + frame.climb[arc][:, None] * normal
    return position, velocity / np.linalg.norm(velocity, axis=1, keepdims=True)


@dataclass(frozen=True)
class Drilling:
    """One hole along the plane's normal: heights in mm, `dwell` in s."""

    code: str
    bottom: float
    retract: float  # the R plane
    clear: float  # where the cycle ends: the R plane (G99) or where it began (G98)
    peck: float
    dwell: float
    first: float = 0.0  # of the pecks that get shallower (Haas' I, J, K): the first, its reduction, the least
    less: float = 0.0
    least: float = 0.0
    out_at_r: bool = False  # a tap feeds out to R, and from there at rapid (Fanuc, Haas); else to `clear`


@dataclass(frozen=True)
class Stroke:
    """One move along the normal: to which height, at feed or rapid, how long to wait there in s."""

    height: float
    feed: bool
    dwell: float = 0.0


def strokes(hole: Drilling) -> Iterator[Stroke]:
    """Moves of one hole, from the R plane.

    Examples
    --------
    >>> hole = Drilling("G83", bottom=-5.0, retract=2.0, clear=10.0, peck=4.0, dwell=0.0)
    >>> [(stroke.height, "feed" if stroke.feed else "rapid") for stroke in strokes(hole)]
    [(-2.0, 'feed'), (2.0, 'rapid'), (-1.746, 'rapid'), (-5.0, 'feed'), (10.0, 'rapid')]
    """
    if hole.code in ("G73", "G83"):
        yield from _pecks(hole)
    yield Stroke(hole.bottom, feed=True, dwell=0.0 if hole.code in ("G81", "G73", "G83", "G85") else hole.dwell)
    if hole.code == "G85" or hole.out_at_r:  # out to the R plane at feed, from there at rapid
        yield Stroke(hole.retract, feed=True)
    yield Stroke(hole.clear, feed=hole.code in FEEDS_OUT and not hole.out_at_r)


def _pecks(hole: Drilling) -> Iterator[Stroke]:
    """The pecks above the bottom. G73 breaks the chip at depth, G83 clears it at the R plane."""
    for depth in _depths(hole):
        yield Stroke(depth, feed=True)
        if hole.code == "G83":
            yield Stroke(hole.retract, feed=False)
        yield Stroke(depth + PECK_CLEARANCE_MM, feed=False)


def _depths(hole: Drilling) -> Iterator[float]:
    count, depth = 1, hole.retract - (hole.first or hole.peck)
    while depth > hole.bottom + SAME_HEIGHT_MM:
        yield depth
        if hole.first:
            depth -= max(hole.first - count * hole.less, hole.least)
        else:
            depth = hole.retract - (count + 1) * hole.peck
        count += 1
