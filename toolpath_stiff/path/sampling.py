"""Moves to samples along the true path: lines, arcs, helices, spirals; all moves at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.curves import arc_frame, move_lengths, points_along
from toolpath_stiff.nc.moves import RAPID, Moves
from toolpath_stiff.path.samples import Samples
from toolpath_stiff.path.turns import place_orientations
from toolpath_stiff.units import mm_from_m, rad_from_deg

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

RAPID_FEED = 10.0 / 60.0  # m/s, assumed where no machine says otherwise
ANGULAR_STEP = rad_from_deg(1.0)  # largest turn of a rotary axis between two samples
BLOCK = 65_536  # samples at a time: the work arrays stay in the processor's cache
MOST_SAMPLES = 20_000_000  # 144 bytes each, 3 GB; beyond that the step is a mistake


def move_durations(moves: Moves, rapid_feed: float = RAPID_FEED) -> FloatArray:
    """(n,) s, the time of each move without the dwell after it; rapids at `rapid_feed`, m/s."""
    turn = np.abs(moves.end[:, 3:] - moves.start[:, 3:]).max(axis=1, initial=0.0)
    return _durations(moves, move_lengths(moves), turn, rapid_feed)


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
    duration = _durations(moves, length, turn, rapid_feed)
    cutting = moves.motion != RAPID
    columns = {
        "length": length,
        "duration": duration,
        "length_before": np.cumsum(length) - length,
        "time_before": np.cumsum(duration + moves.dwell) - (duration + moves.dwell),
        "piece": np.where(cutting, length / pieces, 0.0),
        "pieces": pieces,
    }
    samples = _empty_samples(int(counts.sum()))
    last = np.cumsum(counts)
    first_move, first_sample = 0, 0
    while first_move < len(moves):
        # At least one move, and no more samples than a block holds.
        end = max(int(np.searchsorted(last, first_sample + BLOCK, side="right")), first_move + 1)
        block = slice(first_move, end)
        rows = slice(first_sample, int(last[end - 1]))
        some = {name: column[block] for name, column in columns.items()}
        _sample_block(moves.take(block), counts[block], some, first_move, origin, samples.take(rows))
        first_move, first_sample = end, rows.stop
    return samples


def _empty_samples(n: int) -> Samples:
    return Samples(
        move=np.empty(n, dtype=np.int64),
        line=np.empty(n, dtype=np.int64),
        motion=np.empty(n, dtype=np.int64),
        tool=np.empty(n, dtype=np.int64),
        tool_length=np.empty(n),
        s=np.empty(n),
        t=np.empty(n),
        position=np.empty((n, 3)),
        abc=np.empty((n, 3)),
        tangent=np.empty((n, 3)),
        weight=np.empty(n),
        feed=np.empty(n),
    )


def _sample_block(
    moves: Moves,
    counts: IntArray,
    columns: dict[str, FloatArray],
    first_move: int,
    origin: ArrayLike,
    into: Samples,
) -> None:
    """Samples of some moves, into their rows. `columns` holds what is known of each move."""
    move = np.repeat(np.arange(len(moves)), counts)
    first = np.cumsum(counts) - counts
    u = (np.arange(len(move)) - first[move]) / columns["pieces"][move]
    into.position[:], into.tangent[:] = points_along(moves, move, u)
    programmed = moves.start[move, 3:] + u[:, None] * (moves.end[move, 3:] - moves.start[move, 3:])
    is_end = np.arange(len(move)) == (first + counts - 1)[move]
    programmed[is_end] = moves.end[:, 3:]
    into.abc[:] = place_orientations(programmed, origin)
    into.move[:] = move + first_move
    for name in ("line", "motion", "tool", "tool_length", "feed"):
        getattr(into, name)[:] = getattr(moves, name)[move]
    into.s[:] = columns["length_before"][move] + u * columns["length"][move]
    into.t[:] = columns["time_before"][move] + u * columns["duration"][move]
    into.weight[:] = np.where((u == 0.0) | is_end, 0.5, 1.0) * columns["piece"][move]


def _fastest_part(moves: Moves) -> FloatArray:
    """(n,) greatest speed along a move over its mean speed: above 1 only where the radii of an arc differ."""
    ratio = np.ones(len(moves))
    arcs = np.flatnonzero(moves.arc_sweep != 0.0)
    if len(arcs):
        frame = arc_frame(moves, arcs)
        radii = np.stack([frame.radius_start, frame.radius_end])
        # Equal radii differ by rounding only; they must not gain a step either.
        spiral = np.abs(radii[1] - radii[0]) > 1e-9 * radii.max(axis=0)
        ratio[arcs[spiral]] = (radii.max(axis=0) / radii.mean(axis=0))[spiral]
    return ratio


def _durations(moves: Moves, length: FloatArray, turn: FloatArray, rapid_feed: float) -> FloatArray:
    """(n,) s. A move of the rotary axes alone takes its turn over its feed (rad/s); rapid ones take no time."""
    feed = np.where(moves.motion == RAPID, rapid_feed, moves.feed)
    distance = np.where(length > 0.0, length, np.where(moves.motion == RAPID, 0.0, turn))
    return np.asarray(distance / np.where(feed > 0.0, feed, 1.0))
