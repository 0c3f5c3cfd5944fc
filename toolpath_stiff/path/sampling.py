"""Moves to sampled poses: arc length, time, tangents, weights.

Samples follow the true path: lines, arcs, helices, spirals; all moves at once.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from toolpath_stiff import defaults
from toolpath_stiff.arrays import ArrayColumns, BoolArray, FloatArray, IntArray, numbered, portions
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.courses import arc_frame, extents, move_lengths, points_along
from toolpath_stiff.nc.moves import HELD, RAPID, Moves, held_once
from toolpath_stiff.path.placing import place, place_orientations
from toolpath_stiff.rotations import along_tool_axis
from toolpath_stiff.units import mm_from_m, rad_from_deg

Orient = Callable[[FloatArray], FloatArray]  # programmed angles (n, 3) rad to roll, pitch, yaw on the machine
ANGULAR_STEP = rad_from_deg(1.0)  # largest turn of a rotary axis between two samples
BLOCK = 65_536  # samples at a time: the work arrays stay in the processor's cache
BORDER = np.cos(defaults.PLUNGE_ANGLE) - 1e-12  # of the cosine; beyond it a sample is a cut whatever rounding does
HALVINGS = 50  # to the last digit of a share of a move
ROUNDED = 1e-9  # rad, or of a cosine
MOST_NAMED = 5  # lines in a warning
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


def move_durations(moves: Moves, length: FloatArray, rapid_feed: float = defaults.RAPID_FEED) -> FloatArray:
    r"""(n,) s, duration of each move of `length` (n,) m, without the dwell after it; rapids run at `rapid_feed`, m/s.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> moves = parse_program("G21 G90 F600\nG0 Z5\nG1 Z0\nX40\nM30\n").moves
    >>> move_durations(moves, move_lengths(moves)).round(3).tolist()  # s; the rapid at 10 m/min
    [0.03, 0.5, 4.0]
    """
    rapid = moves.motion == RAPID
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
        In the set-up frame.
    step
        Largest distance of two samples along the tip's path, m. Rotary axes turn by at most `ANGULAR_STEP`.
    rapid_feed
        m/s of rapid moves, for the time.
    origin
        (6,) x, y, z in m, A, B, C in rad: where program zero sits (`place`).
    angles_of
        Roll, pitch, yaw of the tool (n, 3) of programmed angles (n, 3); None: they are these.

    Raises
    ------
    InputError
        The step gives more than `MOST_SAMPLES` samples.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> moves = parse_program("G21 G90 F600\nG2 X20 Y0 I10 J0\nM30\n").moves
    >>> samples = sample_moves(moves, step=0.016, origin=(0.0, 0.0, 0.8, 0.0, 0.0, 0.0))
    >>> (samples.position * 1e3).round(3).tolist()  # mm
    [[0.0, 0.0, 800.0], [10.0, 10.0, 800.0], [20.0, 0.0, 800.0]]
    >>> samples.t.round(3).tolist()  # s, 31.416 mm at 600 mm/min
    [0.0, 1.571, 3.142]
    """

    def orient(programmed: FloatArray) -> FloatArray:
        return place_orientations(programmed if angles_of is None else angles_of(programmed), origin)

    # Placed block by block: a long program never stands in memory twice.
    blocks = list(portions(np.ones(len(moves), dtype=np.int64), BLOCK))
    length, pieces = np.empty((2, len(moves)))
    for block in blocks:
        some = place(moves.take(block), origin)
        length[block] = move_lengths(some)
        pieces[block] = _pieces(some, length[block], step)
    _check_count(pieces, step)
    found = [
        _plunge_borders(place(moves.take(block), origin), pieces[block], length[block], orient) for block in blocks
    ]
    border = (
        np.concatenate([np.empty(0, np.int64), *(b.start + move for b, (move, _) in zip(blocks, found, strict=True))]),
        np.concatenate([np.empty(0), *(share for _, share in found)]),
    )
    counts = pieces.astype(np.int64) + 1 + np.bincount(border[0], minlength=len(moves))
    ends = np.cumsum(counts)
    samples = _empty_samples(moves, int(ends[-1]) if len(ends) else 0)
    s = t = 0.0
    for block in portions(counts, BLOCK):
        some = place(moves.take(block), origin)
        duration = move_durations(some, length[block], rapid_feed)
        along, until = (np.cumsum(np.append(*sums))[1:] for sums in ((s, length[block]), (t, duration + some.dwell)))
        columns = {
            "length": length[block],
            "duration": duration,
            "length_before": along - length[block],
            "time_before": until - (duration + some.dwell),
            "piece": np.where(some.motion != RAPID, length[block] / pieces[block], 0.0),
            "pieces": pieces[block],
        }
        s, t = float(along[-1]), float(until[-1])
        put = slice(*np.searchsorted(border[0], (block.start, block.stop)))
        extra = border[0][put] - block.start, border[1][put]
        into = samples.take(slice(ends[block.start] - counts[block.start], ends[block.stop - 1]))
        _sample_block(some, counts[block], columns, extra, block.start, orient, into)
    return replace(samples, abc=held_once(samples.abc))


def _plunge_borders(
    moves: Moves, pieces: FloatArray, length: FloatArray, orient: Orient
) -> tuple[IntArray, FloatArray]:
    """(k,) moves, (k,) shares along them: borders between plunge and cut within a move, in order along the path."""
    turn = np.abs(moves.end[:, 3:] - moves.start[:, 3:]).sum(axis=1)
    arcs = np.flatnonzero(moves.arc_sweep != 0.0)
    chosen = turn > 0.0
    # An arc in a plane normal to the tool axis keeps its angle to the axis.
    upright = along_tool_axis(moves.arc_normal[arcs], orient(moves.start[arcs, 3:]))
    chosen[arcs] |= np.abs(upright) < 1.0 - ROUNDED
    rows = np.flatnonzero(chosen & (moves.motion != RAPID) & (length > 0.0))
    # On a line, the angle to the tool axis changes by no more than the rotary axes turn.
    lean = np.arccos(np.minimum(np.abs(_along(moves, rows, np.zeros(len(rows)), orient)), 1.0))
    near = np.abs(lean - defaults.PLUNGE_ANGLE) <= turn[rows] + ROUNDED
    rows = rows[near | (moves.arc_sweep[rows] != 0.0)]
    # A plunge within a small arc may be narrower than the step.
    finer = np.maximum(np.ceil(np.abs(moves.arc_sweep[rows]) / ANGULAR_STEP / pieces[rows]), 1.0).astype(np.int64)
    counts = finer * pieces[rows].astype(np.int64)
    borders = [
        _borders_of_block(moves, rows[block], counts[block], finer[block], orient)
        for block in portions(counts + 1, BLOCK)
    ]
    return (
        np.concatenate([np.empty(0, dtype=np.int64), *(move for move, _ in borders)]),
        np.concatenate([np.empty(0), *(share for _, share in borders)]),
    )


def _borders_of_block(
    moves: Moves, rows: IntArray, counts: IntArray, finer: IntArray, orient: Orient
) -> tuple[IntArray, FloatArray]:
    """`_plunge_borders` of some moves, each searched in `counts` pieces, `finer` of them between two samples."""
    moves, (move, index) = moves.take(rows), numbered(counts + 1)
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
    """(n,) cosine of the angle between the tip's motion and the tool axis, at shares u along moves."""
    first = moves.start[move, 3:]
    abc = orient(first + u[:, None] * (moves.end[move, 3:] - first))
    return along_tool_axis(points_along(moves, move, u)[1], abc)


def _turn(moves: Moves) -> FloatArray:
    """(n,) rad, the largest turn of any rotary axis in each move."""
    return np.asarray(np.maximum.reduce([np.abs(moves.end[:, axis] - moves.start[:, axis]) for axis in (3, 4, 5)]))


def _pieces(moves: Moves, length: FloatArray, step: float) -> FloatArray:
    """(n,) number of pieces (whole, at least 1) into which the samples divide each move."""
    # A length that is a whole number of steps up to rounding must not gain a step.
    steps, turns = length * _fastest_part(moves) / step, _turn(moves) / ANGULAR_STEP
    return np.asarray(np.maximum(np.maximum(np.ceil(steps - 1e-9), np.ceil(turns - 1e-9)), 1.0))


def _check_count(pieces: FloatArray, step: float) -> None:
    """Raise `InputError` where the step gives more than `MOST_SAMPLES` samples."""
    total = float(pieces.sum()) + len(pieces)
    if total > MOST_SAMPLES:
        raise ProgramError(
            f"a step of {mm_from_m(step):g} mm gives {total:.0f} samples",
            expected=f"at most {MOST_SAMPLES}",
            hint=f"use --step {mm_from_m(step) * total / MOST_SAMPLES * 1.1:.3g} or more",
        )


def _empty_samples(moves: Moves, n: int) -> Samples:
    """`Samples` allocated for n samples; columns with one value a move are filled in already."""
    held = {name: getattr(moves, name) for name in HELD}
    columns: dict[str, NDArray[Any]] = {name: np.empty(n) for name in ("s", "t", "weight", "feed")}
    columns |= {"move": np.empty(n, np.int32), "line": np.empty(n, np.int32), "motion": np.empty(n, np.int8)}
    for name, column in held.items():
        columns[name] = np.empty(n, column.dtype) if column.flags.writeable else np.broadcast_to(column[0], n)
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
    """Write the samples of some moves into their rows; `columns` has figures of each move, `border` further shares."""
    even = counts - np.bincount(border[0], minlength=len(moves))
    move, index = numbered(even)
    u = index / columns["pieces"][move]
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
        if getattr(into, name).flags.writeable:
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
    """(n,) ratio of greatest to mean speed along a move: above 1 only where the radii of an arc differ."""
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
    length, ends = move_lengths(moves), extents(moves.take(cutting))
    duration = move_durations(moves, length, rapid_feed)
    parts = (("cutting", cutting), ("rapid", ~cutting))
    lengths = {name: mm_from_m(float(length[rows].sum())) for name, rows in parts}
    times = {name: float(duration[rows].sum()) for name, rows in parts} | {"dwell": float(moves.dwell.sum())}
    return {
        "extents_mm": {axis: ends[axis] for axis in "xyz" if ends},
        "extents_deg": {axis: ends[axis] for axis in "abc" if ends},
        "lengths_mm": {**lengths, "total": sum(lengths.values())},
        "times_s": {**times, "total": sum(times.values())},
    }


def lines_named(lines: IntArray) -> str:
    """Line numbers in words; of many only the first."""
    each = np.unique(lines)
    more = f" and {len(each) - MOST_NAMED} more" if len(each) > MOST_NAMED else ""
    return f"lines {', '.join(map(str, each[:MOST_NAMED]))}{more}"
