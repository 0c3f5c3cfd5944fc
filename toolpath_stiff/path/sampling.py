"""Moves to sampled poses: arc length, time, tangents, weights.

Samples follow the true path: lines, arcs, helices, spirals; all moves at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from toolpath_stiff import defaults
from toolpath_stiff.arrays import ArrayColumns, BoolArray, FloatArray, IntArray
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.courses import arc_frame, extents, move_lengths, points_along
from toolpath_stiff.nc.moves import HELD, RAPID, Moves, held_once
from toolpath_stiff.path.placing import place_orientations
from toolpath_stiff.rotations import along_tool_axis
from toolpath_stiff.units import mm_from_m, rad_from_deg

Orient = Callable[[FloatArray], FloatArray]  # programmed angles (n, 3) rad to roll, pitch, yaw on the machine
ANGULAR_STEP = rad_from_deg(1.0)  # largest turn of a rotary axis between two samples
BLOCK = 65_536  # samples at a time: the work arrays stay in the processor's cache
BORDER = np.cos(defaults.PLUNGE_ANGLE) - 1e-12  # of the cosine; beyond it a sample is a cut whatever rounding does
HALVINGS = 50  # to the last digit of a share of a move
ROUNDED = 1e-9  # rad, or of a cosine
MOST_SAMPLES = 20_000_000  # 144 bytes each, 3 GB; beyond that the step is a mistake


@dataclass(frozen=True, repr=False)
class Samples(ArrayColumns):
    r"""Columns over n samples along the true path, in machine coordinates.

    Every move has samples at both of its ends, so a corner appears twice: once as the end of a move, with
    that move's tangent, and once as the start of the next, with the next one's. This is the rule for the
    tangent at corners.

    Attributes
    ----------
    move
        (n,) row of the move in `Moves`.
    line, motion, tool
        (n,) as in `Moves`.
    tool_length
        (n,) m; nan: the machine's reference tool.
    spindle
        (n,) rad/s, as in `Moves`.
    s
        (n,) m, length of tip path from the program's start, rapids included.
    t
        (n,) s, time from the program's start, dwells included.
    position
        (n, 3) m, tool tip.
    abc
        (n, 3) rad, roll, pitch, yaw of the platform.
    tangent
        (n, 3) unit vector of the tip's motion; 0 where only rotary axes move.
    weight
        (n,) m, the length of cutting path that the sample stands for (trapezoidal rule within its move, apart for
        plunges and cuts where a sample stands between them); 0 for rapids and for moves of the rotary axes alone.
    feed
        (n,) m/s; nan for rapids.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> samples = sample_moves(parse_program("G21 G90 F600\nG0 Z5\nG1 Z0\nX40\nM30\n").moves, step=0.01)
    >>> samples
    <Samples: 9 samples, 50 mm of path>
    >>> int(samples.cutting.sum()), round(float(samples.weight.sum()), 6)  # m that cut
    (7, 0.045)
    """

    move: IntArray
    line: IntArray
    motion: IntArray
    tool: IntArray
    tool_length: FloatArray
    spindle: FloatArray
    s: FloatArray
    t: FloatArray
    position: FloatArray
    abc: FloatArray
    tangent: FloatArray
    weight: FloatArray
    feed: FloatArray

    def __len__(self) -> int:
        return len(self.line)

    def __repr__(self) -> str:
        length = f", {mm_from_m(float(self.s[-1])):g} mm of path" if len(self) else ""
        return f"<Samples: {len(self)} samples{length}>"

    @property
    def cutting(self) -> BoolArray:
        """(n,) samples that count in the statistics: not of a rapid."""
        return np.asarray(self.motion != 0)


def move_durations(moves: Moves, rapid_feed: float = defaults.RAPID_FEED) -> FloatArray:
    r"""(n,) s, the time of each move without the dwell after it; rapids at `rapid_feed`, m/s.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> moves = parse_program("G21 G90 F600\nG0 Z5\nG1 Z0\nX40\nM30\n").moves
    >>> move_durations(moves).round(3).tolist()  # s; the rapid at 10 m/min
    [0.03, 0.5, 4.0]
    """
    length, rapid = move_lengths(moves), moves.motion == RAPID
    feed = np.where(rapid, rapid_feed, moves.feed)
    # A move of the rotary axes alone takes its turn over its feed (rad/s); rapid ones take no time.
    distance = np.where(length > 0.0, length, np.where(rapid, 0.0, _turn(moves)))
    return np.asarray(distance / np.where(feed > 0.0, feed, 1.0))


def sample_moves(
    moves: Moves,
    step: float,
    rapid_feed: float = defaults.RAPID_FEED,
    origin: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    angles_of: Orient | None = None,
) -> Samples:
    r"""Sample moves along their true path, both ends of every move included.

    Where a plunge becomes a cut within a move, the cut has a sample at the border, so that its extremes do not depend
    on the step.

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
    angles_of
        Roll, pitch, yaw of the tool (n, 3) of programmed angles (n, 3); None: they are these.

    Raises
    ------
    InputError
        The step gives more than `MOST_SAMPLES` samples.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> from toolpath_stiff.path.placing import place
    >>> moves = parse_program("G21 G90 F600\nG2 X20 Y0 I10 J0\nM30\n").moves
    >>> samples = sample_moves(place(moves, (0.0, 0.0, 0.8, 0.0, 0.0, 0.0)), step=0.016)
    >>> (samples.position * 1e3).round(3).tolist()  # mm
    [[0.0, 0.0, 800.0], [10.0, 10.0, 800.0], [20.0, 0.0, 800.0]]
    >>> samples.t.round(3).tolist()  # s, 31.416 mm at 600 mm/min
    [0.0, 1.571, 3.142]
    """
    length = move_lengths(moves)
    pieces = _pieces(moves, length, step)

    def orient(programmed: FloatArray) -> FloatArray:
        return place_orientations(programmed if angles_of is None else angles_of(programmed), origin)

    border = _plunge_borders(moves, pieces, length, orient)
    counts = pieces.astype(np.int64) + 1 + np.bincount(border[0], minlength=len(moves))
    duration = move_durations(moves, rapid_feed)
    columns = {
        "length": length,
        "duration": duration,
        "length_before": np.cumsum(length) - length,
        "time_before": np.cumsum(duration + moves.dwell) - (duration + moves.dwell),
        "piece": np.where(moves.motion != RAPID, length / pieces, 0.0),
        "pieces": pieces,
    }
    ends = np.cumsum(counts)
    samples = _empty_samples(int(ends[-1]) if len(ends) else 0)
    for block in _blocks(counts):
        rows = slice(ends[block.start] - counts[block.start], ends[block.stop - 1])
        some = {name: column[block] for name, column in columns.items()}
        put = slice(*np.searchsorted(border[0], (block.start, block.stop)))
        extra = border[0][put] - block.start, border[1][put]
        _sample_block(moves.take(block), counts[block], some, extra, block.start, orient, samples.take(rows))
    return replace(samples, **{name: held_once(getattr(samples, name)) for name in (*HELD, "abc")})


def _blocks(counts: IntArray) -> Iterator[slice]:
    """Slices of moves with so many samples each: at least one move, and no more samples than a block holds."""
    last = np.cumsum(counts)
    first, before = 0, 0
    while first < len(counts):
        end = max(int(np.searchsorted(last, before + BLOCK, side="right")), first + 1)
        yield slice(first, end)
        first, before = end, int(last[end - 1])


def _plunge_borders(
    moves: Moves, pieces: FloatArray, length: FloatArray, orient: Orient
) -> tuple[IntArray, FloatArray]:
    """(k,) move and (k,) share of it where a plunge becomes a cut or a cut a plunge, in order along the path."""
    upright = along_tool_axis(moves.arc_normal, orient(moves.start[:, 3:]))
    turn = np.abs(moves.end[:, 3:] - moves.start[:, 3:]).sum(axis=1)
    # An arc across the axis keeps its angle to it.
    leaning = (moves.arc_sweep != 0.0) & (np.abs(upright) < 1.0 - ROUNDED)
    rows = np.flatnonzero((moves.motion != RAPID) & (length > 0.0) & (leaning | (turn > 0.0)))
    # Lines lean by no more than the axes turn.
    lean = np.arccos(np.minimum(np.abs(_along(moves, rows, np.zeros(len(rows)), orient)), 1.0))
    near = np.abs(lean - defaults.PLUNGE_ANGLE) <= turn[rows] + ROUNDED
    rows = rows[near | (moves.arc_sweep[rows] != 0.0)]
    # A plunge within a small arc may be narrower than the step.
    finer = np.maximum(np.ceil(np.abs(moves.arc_sweep[rows]) / ANGULAR_STEP / pieces[rows]), 1.0).astype(np.int64)
    counts = finer * pieces[rows].astype(np.int64)
    borders = [
        _borders_of_block(moves, rows[block], counts[block], finer[block], orient) for block in _blocks(counts + 1)
    ]
    return (
        np.concatenate([np.empty(0, dtype=np.int64), *(move for move, _ in borders)]),
        np.concatenate([np.empty(0), *(share for _, share in borders)]),
    )


def _borders_of_block(
    moves: Moves, rows: IntArray, counts: IntArray, finer: IntArray, orient: Orient
) -> tuple[IntArray, FloatArray]:
    """The same of some moves divided into `counts` pieces, of which `finer` lie between two samples."""
    moves, move = moves.take(rows), np.repeat(np.arange(len(rows)), counts + 1)
    index = np.arange(len(move)) - np.repeat(np.cumsum(counts + 1) - counts - 1, counts + 1)
    plunge = np.abs(_along(moves, move, index / counts[move], orient)) >= BORDER
    before = np.flatnonzero((plunge[1:] != plunge[:-1]) & (move[1:] == move[:-1]))
    move, cut = move[before], index[before + plunge[before]]
    inner, outer = index[before + ~plunge[before]] / counts[move], cut / counts[move]
    for _ in range(HALVINGS):
        middle = 0.5 * (inner + outer)
        plunges = np.abs(_along(moves, move, middle, orient)) >= BORDER
        inner, outer = np.where(plunges, middle, inner), np.where(plunges, outer, middle)
    new = (outer != cut / counts[move]) | (cut % finer[move] != 0)  # else it is a sample anyway
    return rows[move[new]], outer[new]


def _along(moves: Moves, move: IntArray, u: FloatArray, orient: Orient) -> FloatArray:
    """(n,) cosine of the angle between the motion of the tip and the tool axis at shares u of moves."""
    first = moves.start[move, 3:]
    abc = orient(first + u[:, None] * (moves.end[move, 3:] - first))
    return along_tool_axis(points_along(moves, move, u)[1], abc)


def _turn(moves: Moves) -> FloatArray:
    """(n,) rad, the largest turn of a rotary axis in each move."""
    return np.asarray(np.maximum.reduce([np.abs(moves.end[:, axis] - moves.start[:, axis]) for axis in (3, 4, 5)]))


def _pieces(moves: Moves, length: FloatArray, step: float) -> FloatArray:
    """(n,) whole numbers from 1, into how many pieces the samples divide each move. Raises `InputError`."""
    # A length that is a whole number of steps up to rounding must not gain a step.
    steps, turns = length * _fastest_part(moves) / step, _turn(moves) / ANGULAR_STEP
    pieces = np.maximum(np.maximum(np.ceil(steps - 1e-9), np.ceil(turns - 1e-9)), 1.0)
    total = float(pieces.sum()) + len(moves)
    if total > MOST_SAMPLES:
        raise ProgramError(
            f"a step of {mm_from_m(step):g} mm gives {total:.0f} samples",
            expected=f"at most {MOST_SAMPLES}",
            hint=f"use --step {mm_from_m(step) * total / MOST_SAMPLES * 1.1:.3g} or more",
        )
    return np.asarray(pieces)


def _empty_samples(n: int) -> Samples:
    columns: dict[str, NDArray[Any]] = {
        name: np.empty(n) for name in ("tool_length", "spindle", "s", "t", "weight", "feed")
    }
    columns |= {name: np.empty(n, dtype=np.int64) for name in ("move", "line", "motion", "tool")}
    return Samples(**columns, position=np.empty((n, 3)), abc=np.zeros((n, 3)), tangent=np.empty((n, 3)))


def _sample_block(
    moves: Moves,
    counts: IntArray,
    columns: dict[str, FloatArray],
    border: tuple[IntArray, FloatArray],
    first_move: int,
    orient: Orient,
    into: Samples,
) -> None:
    """Samples of some moves, into their rows. `columns` holds what is known of each move, `border` further shares."""
    even = counts - np.bincount(border[0], minlength=len(moves))
    move = np.repeat(np.arange(len(moves)), even)
    u = (np.arange(len(move)) - np.repeat(np.cumsum(even) - even, even)) / np.repeat(columns["pieces"], even)
    if len(border[0]):
        move, u = np.concatenate([move, border[0]]), np.concatenate([u, border[1]])
        order = np.lexsort((u, move))
        move, u = move[order], u[order]
    last = np.cumsum(counts) - 1
    into.position[:], into.tangent[:] = points_along(moves, move, u)
    first, turned = moves.start[:, 3:], moves.end[:, 3:] - moves.start[:, 3:]
    programmed = np.repeat(first, counts, axis=0)
    if turned.any():
        programmed += u[:, None] * np.repeat(turned, counts, axis=0)
        programmed[last] = moves.end[:, 3:]
    angles = orient(programmed)
    if angles.any():  # pages of zeros that nobody writes to take no memory
        into.abc[:] = angles
    into.move[:] = move + first_move
    for name in ("line", "motion", "feed", *HELD):
        getattr(into, name)[:] = np.repeat(getattr(moves, name), counts)
    into.s[:] = np.repeat(columns["length_before"], counts) + u * np.repeat(columns["length"], counts)
    into.t[:] = np.repeat(columns["time_before"], counts) + u * np.repeat(columns["duration"], counts)
    into.weight[:] = np.repeat(columns["piece"], counts) * np.where(u == 0.0, 0.5, 1.0)
    into.weight[last] *= 0.5
    if len(border[0]):
        before = np.maximum(np.diff(u, prepend=0.0), 0.0)  # 0 at the first sample of a move
        uneven = np.isin(move, border[0])
        # What lies between the border and a sample of a plunge is plunged, all of it.
        plunge = np.abs(along_tool_axis(into.tangent, angles)) >= BORDER
        share = 0.5 + 0.5 * np.diff(plunge.astype(float), prepend=float(plunge[0]))
        after = np.append((before * (1.0 - share))[1:], 0.0)
        into.weight[uneven] = ((before * share + after) * columns["length"][move])[uneven]


def _fastest_part(moves: Moves) -> FloatArray:
    """(n,) greatest speed along a move over its mean speed: above 1 only where the radii of an arc differ."""
    ratio, arcs = np.ones(len(moves)), np.flatnonzero(moves.arc_sweep != 0.0)
    frame = arc_frame(moves, arcs)
    radii = np.stack([frame.radius_start, frame.radius_end])
    # Equal radii differ by rounding only; they must not gain a step either.
    spiral = np.abs(radii[1] - radii[0]) > 1e-9 * radii.max(axis=0)
    ratio[arcs[spiral]] = (radii.max(axis=0) / radii.mean(axis=0))[spiral]
    return ratio


def move_figures(moves: Moves, rapid_feed: float = defaults.RAPID_FEED) -> dict[str, dict[str, Any]]:
    """Extents of the cuts in program coordinates of G54, lengths and times of moves; rapids at `rapid_feed`, m/s."""
    cutting = moves.motion != RAPID
    length, duration, ends = move_lengths(moves), move_durations(moves, rapid_feed), extents(moves.take(cutting))
    parts = (("cutting", cutting), ("rapid", ~cutting))
    lengths = {name: mm_from_m(float(length[rows].sum())) for name, rows in parts}
    times = {name: float(duration[rows].sum()) for name, rows in parts} | {"dwell": float(moves.dwell.sum())}
    return {
        "extents_mm": {axis: ends[axis] for axis in "xyz" if ends},
        "extents_deg": {axis: ends[axis] for axis in "abc" if ends},
        "lengths_mm": {**lengths, "total": sum(lengths.values())},
        "times_s": {**times, "total": sum(times.values())},
    }
