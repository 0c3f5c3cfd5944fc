"""Moves to samples along the true path: lines, arcs, helices, spirals; all moves at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.moves import RAPID, Moves
from toolpath_stiff.path.samples import Samples
from toolpath_stiff.path.turns import place_orientations
from toolpath_stiff.units import mm_from_m, rad_from_deg

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

RAPID_FEED = 10.0 / 60.0  # m/s, assumed where no machine says otherwise
ANGULAR_STEP = rad_from_deg(1.0)  # largest turn of a rotary axis between two samples
MOST_SAMPLES = 20_000_000  # 144 bytes each, 3 GB; beyond that the step is a mistake


def move_lengths(moves: Moves) -> FloatArray:
    """(n,) m, length of the tip's path in each move.

    An arc's is sqrt((r sweep)^2 + climb^2); where start and end radius differ (a control's tolerance, or a spiral)
    r is their mean, which is exact to second order in the difference.
    """
    chord = np.linalg.norm(moves.end[:, :3] - moves.start[:, :3], axis=1)
    arc = moves.arc_sweep != 0.0
    if arc.any():
        frame = _arc_frame(moves, np.flatnonzero(arc))
        radius = 0.5 * (frame.radius_start + frame.radius_end)
        sweep = moves.arc_sweep[arc]
        chord[arc] = np.sqrt((radius * sweep) ** 2 + frame.climb**2 + (frame.radius_end - frame.radius_start) ** 2)
    return np.asarray(chord)


def move_durations(moves: Moves, rapid_feed: float = RAPID_FEED) -> FloatArray:
    """(n,) s, the time of each move without the dwell after it; rapids at `rapid_feed`, m/s."""
    turn = np.abs(moves.end[:, 3:] - moves.start[:, 3:]).max(axis=1, initial=0.0)
    return _durations(moves, move_lengths(moves), turn, rapid_feed)


class _ArcFrame:
    """Plane, radii and climb of some arcs: position(u) = c + r(u) (cos e1 + sin e2) + u climb n."""

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


def _arc_frame(moves: Moves, rows: IntArray) -> _ArcFrame:
    return _ArcFrame(moves.arc_center[rows], moves.arc_normal[rows], moves.start[rows, :3], moves.end[rows, :3])


def sample_moves(
    moves: Moves,
    step: float,
    rapid_feed: float = RAPID_FEED,
    origin: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
) -> Samples:
    """Sample moves along their true path, both ends of every move included.

    Parameters
    ----------
    moves
        In machine coordinates (`place`).
    step
        Largest distance of two samples along the tip's path, m. Rotary axes turn by at most `ANGULAR_STEP`.
    rapid_feed
        m/s of rapid moves, for the time.
    origin
        The placement that `moves` were placed with: it turns the orientations.

    Raises
    ------
    InputError
        The step gives more than `MOST_SAMPLES` samples.
    """
    length = move_lengths(moves)
    turn = np.abs(moves.end[:, 3:] - moves.start[:, 3:]).max(axis=1, initial=0.0)
    # A length that is a whole number of steps up to rounding must not gain a step.
    pieces = np.maximum(
        np.ceil(length * _fastest_part(moves) / step - 1e-9),
        np.ceil(turn / ANGULAR_STEP - 1e-9),
    )
    pieces = np.maximum(pieces, 1.0)
    total = float(pieces.sum()) + len(moves)
    if total > MOST_SAMPLES:
        raise InputError(
            f"a step of {mm_from_m(step):g} mm gives {total:.0f} samples",
            expected=f"at most {MOST_SAMPLES}",
            hint=f"use --step {mm_from_m(step) * total / MOST_SAMPLES * 1.1:.3g} or more",
        )
    counts = pieces.astype(np.int64) + 1
    move = np.repeat(np.arange(len(moves)), counts)
    first = np.cumsum(counts) - counts
    u = (np.arange(len(move)) - first[move]) / pieces[move]
    position, tangent = _along(moves, move, u)
    programmed = moves.start[move, 3:] + u[:, None] * (moves.end[move, 3:] - moves.start[move, 3:])
    is_end = np.arange(len(move)) == (first + counts - 1)[move]
    programmed[is_end] = moves.end[:, 3:]
    duration = _durations(moves, length, turn, rapid_feed)
    time_before = np.cumsum(duration + moves.dwell) - (duration + moves.dwell)
    length_before = np.cumsum(length) - length
    cutting = moves.motion != RAPID
    piece_length = np.where(cutting, length / pieces, 0.0)[move]
    at_end = (u == 0.0) | is_end
    return Samples(
        move=move,
        line=moves.line[move],
        motion=moves.motion[move],
        tool=moves.tool[move],
        tool_length=moves.tool_length[move],
        s=length_before[move] + u * length[move],
        t=time_before[move] + u * duration[move],
        position=position,
        abc=place_orientations(programmed, origin),
        tangent=tangent,
        weight=np.where(at_end, 0.5, 1.0) * piece_length,
        feed=moves.feed[move],
    )


def _fastest_part(moves: Moves) -> FloatArray:
    """(n,) greatest speed along a move over its mean speed: above 1 only where the radii of an arc differ."""
    ratio = np.ones(len(moves))
    arcs = np.flatnonzero(moves.arc_sweep != 0.0)
    if len(arcs):
        frame = _arc_frame(moves, arcs)
        radii = np.stack([frame.radius_start, frame.radius_end])
        # Equal radii differ by rounding only; they must not gain a step either.
        spiral = np.abs(radii[1] - radii[0]) > 1e-9 * radii.max(axis=0)
        ratio[arcs[spiral]] = (radii.max(axis=0) / radii.mean(axis=0))[spiral]
    return ratio


def _along(moves: Moves, move: IntArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions (n, 3) and unit tangents (n, 3) at shares u of moves; ends are met exactly."""
    start, end = moves.start[:, :3], moves.end[:, :3]
    chord = end - start
    length = np.linalg.norm(chord, axis=1)
    direction = chord / np.where(length > 0.0, length, 1.0)[:, None]
    position = start[move] + u[:, None] * chord[move]
    tangent = direction[move]
    arcs = np.flatnonzero(moves.arc_sweep != 0.0)
    if len(arcs):
        frame = _arc_frame(moves, arcs)
        which = np.full(len(moves), -1)
        which[arcs] = np.arange(len(arcs))
        rows = np.flatnonzero(moves.arc_sweep[move] != 0.0)
        position[rows], tangent[rows] = _along_arcs(frame, moves.arc_sweep[arcs], which[move[rows]], u[rows])
    position[u == 0.0] = start[move[u == 0.0]]
    position[u == 1.0] = end[move[u == 1.0]]
    return position, tangent


def _along_arcs(frame: _ArcFrame, sweep: FloatArray, arc: IntArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
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


def _durations(moves: Moves, length: FloatArray, turn: FloatArray, rapid_feed: float) -> FloatArray:
    """(n,) s. A move of the rotary axes alone takes its turn over its feed (rad/s); rapid ones take no time."""
    feed = np.where(moves.motion == RAPID, rapid_feed, moves.feed)
    distance = np.where(length > 0.0, length, np.where(moves.motion == RAPID, 0.0, turn))
    return np.asarray(distance / np.where(feed > 0.0, feed, 1.0))
