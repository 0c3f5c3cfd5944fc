"""Moves of the tool on the part, from those of the machine that a program was posted for. SI.

Where rotary axes turn, a straight move of the axes is a curve on the part: it is divided. `kinematics` has the chain of
axes.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray, numbered
from toolpath_stiff.nc.courses import arc_frame, move_lengths, points_along
from toolpath_stiff.nc.kinematics import HEAD, LETTERS, PostedKinematics, line_point, roll_pitch, tool_poses, turned
from toolpath_stiff.nc.moves import FEED, RAPID, Moves
from toolpath_stiff.nc.place import Place
from toolpath_stiff.units import deg_from_rad, mm_from_m, rad_from_deg

AXIS_STEP = rad_from_deg(1.0)  # largest turn of the rotary axes in one piece
SAME_PLACE = 1e-12  # m and rad: rounding, not motion
MOST_PIECES = 5_000_000
HALF_TURN = math.pi * (1.0 + 1e-9)


def recover_moves(
    moves: Moves,
    kinematics: PostedKinematics,
    tool_lengths: Mapping[int, float],
    name: str = "program",
    tip_held: BoolArray | bool = False,
) -> tuple[Moves, IntArray]:
    """Moves of the tool on the part, from those of the machine that the program was posted for.

    Parameters
    ----------
    moves
        As programmed: X Y Z A B C of the posted machine, relative to G54's zero.
    kinematics
        Its tables' points relative to G54's zero, too.
    tool_lengths
        Tool number -> m, for moves without a length of their own (G43).
    name
        The program's name, for messages.
    tip_held
        (n,) or one, whether tool centre point control is on, as in `tool_poses`.

    Returns
    -------
    Moves of tip, roll and pitch (yaw 0), in part coordinates: those of G54 with all rotary axes at 0. A move is divided
    where rotary axes turn, so that straight pieces (arcs under tool centre point control: arcs) stay within
    `kinematics.tolerance` of the true curve and no piece turns by more than a degree; each keeps its move's line, and
    their times add up to the move's. Arcs with standing rotary axes are turned as a whole. What moves neither tip nor
    tool axis has no row; its time is added to the dwell before it. `from_machine` is False throughout. Of each row the
    move that it is a part of.

    Raises
    ------
    InputError
        A letter that the kinematics does not have turns; a head's tool has no length; too many pieces.
    """
    if not len(moves):
        return moves, np.zeros(0, dtype=np.int64)
    _check_letters(moves, kinematics, name)
    moves = _shorter_way(moves, kinematics)
    held = np.broadcast_to(np.asarray(tip_held) | kinematics.tcp, (len(moves),))
    length = _lengths_at_heads(moves, kinematics, held, tool_lengths, name)
    count = _pieces(moves, kinematics, held, length)
    if count.sum() > MOST_PIECES:
        within, hint = mm_from_m(kinematics.tolerance), "give a larger kinematics.tolerance_mm in the controller file"
        problem = f"dividing moves with turning axes within {within:g} mm gives {float(count.sum()):.0f} pieces"
        raise Place(name, int(moves.line[np.argmax(count)])).fail(problem, f"at most {MOST_PIECES}", hint)
    move, step = numbered(count + 1)
    share, last = step / count[move], step == count[move]
    angles = moves.start[move, 3:] + share[:, None] * (moves.end[move, 3:] - moves.start[move, 3:])
    angles[last] = moves.end[:, 3:]
    tip, axis = tool_poses(kinematics, points_along(moves, move, share)[0], angles, length[move], held[move])
    pose = np.zeros((len(move), 6))
    pose[:, :3], pose[:, 3:5] = _without_rounding(tip), _without_rounding(roll_pitch(axis))
    start, end = np.flatnonzero(~last), np.flatnonzero(step > 0)
    pieces = _on_the_part(moves, kinematics, held, length, move[start], share[start])
    pieces = replace(pieces, start=pose[start], end=pose[end])
    return _with_times(pieces, moves, move[start], count, last[end])


def turns_far(moves: Moves, kinematics: PostedKinematics) -> list[tuple[int, str, float]]:
    """Cutting moves in which an axis without roll-over turns more than half a turn: line, letter, degrees."""
    turns = []
    for rotary in kinematics.axes:
        turn = np.abs(moves.end[:, 3 + rotary.column] - moves.start[:, 3 + rotary.column])
        far = np.flatnonzero((turn > HALF_TURN) & (moves.motion != RAPID) & (not rotary.rollover))
        turns += [(int(moves.line[i]), rotary.letter, deg_from_rad(float(turn[i]))) for i in far]
    return sorted(turns)


def _check_letters(moves: Moves, kinematics: PostedKinematics, name: str) -> None:
    letters = [axis.letter for axis in kinematics.axes]
    for column, letter in enumerate(LETTERS):
        used = (moves.start[:, 3 + column] != 0.0) | (moves.end[:, 3 + column] != 0.0)
        if letter not in letters and used.any():
            problem = f"{letter} turns, and the kinematics that it was posted for has {' and '.join(letters)} alone"
            place = Place(name, int(moves.line[np.argmax(used)]))
            raise place.fail(problem, f"no {letter} words", "see [kinematics] of the controller file")


def _shorter_way(moves: Moves, kinematics: PostedKinematics) -> Moves:
    """Moves in which axes with roll-over take the shorter way to their angle; their later positions are equivalent."""
    end = moves.end.copy()
    for column in (3 + axis.column for axis in kinematics.axes if axis.rollover):
        turn = end[:, column] - moves.start[:, column]
        far = np.abs(turn) > math.pi
        end[far, column] -= (2.0 * math.pi * np.round(turn / (2.0 * math.pi)))[far]
    return replace(moves, end=end)


def _turning(moves: Moves) -> FloatArray:
    """(n, 3) rad, travel of each rotary axis in each move."""
    return np.asarray(np.abs(moves.end[:, 3:] - moves.start[:, 3:]))


def _lengths_at_heads(
    moves: Moves, kinematics: PostedKinematics, held: BoolArray, tool_lengths: Mapping[int, float], name: str
) -> FloatArray:
    """(n,) m, gauge line to tip: G43's, else the tool table's. Raises `InputError` if unknown at a tilted head."""
    length = moves.tool_length.copy()
    for tool in np.unique(moves.tool[np.isnan(length)]):
        length[np.isnan(length) & (moves.tool == tool)] = tool_lengths.get(int(tool), math.nan)
    heads = [3 + axis.column for axis in kinematics.axes if axis.turns == HEAD]
    if kinematics.tcp or not heads:
        return length
    tilted = (moves.start[:, heads] != 0.0).any(axis=1) | (moves.end[:, heads] != 0.0).any(axis=1)
    missing = tilted & ~held & np.isnan(length)
    if missing.any():
        first = int(np.argmax(missing))
        problem = f"the head is tilted, and the length of tool {moves.tool[first]} is not known"
        hint = "add it to the tool table (--tools FILE, or [[tools]] of the controller file)"
        expected = "the tool's length from the gauge line to the tip"
        raise Place(name, int(moves.line[first])).fail(problem, expected, hint)
    return length


def _pieces(moves: Moves, kinematics: PostedKinematics, held: BoolArray, length: FloatArray) -> IntArray:
    """(n,) number of pieces into which each move is divided.

    A curve with |q''| <= a (per share of the move) is within a / (8 m^2) of m equal chords. A turn at the rate w about
    a line at the distance r adds 2 w |q'| + w^2 r to the bound of |q''|, and w r to that of |q'|.
    """
    turning = _turning(moves)
    used = [axis.column for axis in kinematics.axes]
    count = np.ceil(turning[:, used].sum(axis=1) / AXIS_STEP - 1e-9)
    if not kinematics.tcp:
        bent = ~held & (turning[:, used] > 0.0).any(axis=1)
        bend = np.where(bent, _bend(moves, kinematics, length), 0.0)
        count = np.maximum(count, np.ceil(np.sqrt(bend / (8.0 * kinematics.tolerance)) - 1e-9))
    return np.asarray(np.maximum(count, 1.0), dtype=np.int64)


def _bend(moves: Moves, kinematics: PostedKinematics, length: FloatArray) -> FloatArray:
    """(n,) m, an upper bound of the tip's |q''| over a move that runs from 0 to 1."""
    turning = _turning(moves)
    linear, bend = _linear_bounds(moves)
    ends = [np.array(pose[:, :3]) for pose in (moves.start, moves.end)]
    rides = [np.zeros_like(point) for point in ends]  # displacement of the tip from X, by the heads so far
    speed, ride_speed = linear, np.zeros(len(moves))
    for rotary in kinematics.from_tool_to_work:
        rate = turning[:, rotary.column]
        head = rotary.turns == HEAD
        points = rides if head else ends
        reach, there = np.zeros(len(moves)), []
        for point, pose in zip(points, (moves.start, moves.end), strict=True):
            center = line_point(rotary, np.zeros_like(point) if head else pose[:, :3], length)
            turns = (rate != 0.0) | (pose[:, 3 + rotary.column] != 0.0)
            # With the head upright the tool length may be unknown.
            out = np.where(turns[:, None], point - center, 0.0)
            reach = np.maximum(reach, np.linalg.norm(np.cross(rotary.direction, out), axis=1))  # from the line
            there.append(np.where(turns[:, None], center + turned(out, rotary, pose[:, 3 + rotary.column]), point))
        # No point of the move is farther than half of it from one of its ends.
        reach = reach + (ride_speed if head else speed) / 2.0
        bend = bend + 2.0 * rate * (ride_speed if head else speed) + rate**2 * reach
        if head:
            rides, ride_speed = there, ride_speed + rate * reach
            ends = [pose[:, :3] + ride for pose, ride in zip((moves.start, moves.end), rides, strict=True)]
            speed = linear + ride_speed
        else:
            ends, speed = there, speed + rate * reach
    return bend


def _linear_bounds(moves: Moves) -> tuple[FloatArray, FloatArray]:
    """(n,) m, upper bounds of |X'| and |X''| of the linear axes over a move that runs from 0 to 1."""
    speed, bend = move_lengths(moves), np.zeros(len(moves))
    arcs = np.flatnonzero(moves.arc_sweep != 0.0)
    frame, sweep = arc_frame(moves, arcs), np.abs(moves.arc_sweep[arcs])
    radius = np.maximum(frame.radius_start, frame.radius_end)
    growth = np.abs(frame.radius_end - frame.radius_start)
    bend[arcs] = radius * sweep**2 + 2.0 * growth * sweep
    speed[arcs] = np.sqrt((radius * sweep) ** 2 + growth**2 + frame.climb**2)
    return speed, bend


def _without_rounding(points: FloatArray) -> FloatArray:
    """Points (n, k) in which a step below `SAME_PLACE` is removed: the point takes the value of the one before."""
    moved = np.ones(len(points), dtype=bool)
    moved[1:] = (np.abs(np.diff(points, axis=0)) > SAME_PLACE).any(axis=1)
    return points[np.maximum.accumulate(np.where(moved, np.arange(len(points)), 0))]


def _on_the_part(
    moves: Moves, kinematics: PostedKinematics, held: BoolArray, length: FloatArray, move: IntArray, share: FloatArray
) -> Moves:
    """Rows of the pieces, each from its share of its move; arcs that stay arcs; ends still those of the moves."""
    arc = moves.arc_sweep != 0.0
    turning = (_turning(moves) > 0.0).any(axis=1)
    stays = arc & (~turning | held)
    center, normal = moves.arc_center.copy(), moves.arc_normal.copy()
    # Turn the whole arc: its centre as a point of the linear axes, its normal as the vector to a second point.
    rows = np.flatnonzero(stays & ~held)
    abc = moves.start[rows, 3:]
    here, there = (tool_poses(kinematics, center[rows] + along, abc, length[rows])[0] for along in (0.0, normal[rows]))
    center[rows], normal[rows] = here, (there - here) / np.linalg.norm(there - here, axis=1)[:, None]
    rows, climb = np.flatnonzero(stays), np.zeros(len(moves))
    climb[rows] = arc_frame(moves, rows).climb
    risen = center[move] + (climb[move] * share)[:, None] * normal[move]  # centre in the plane of the piece's start
    pieces = np.bincount(move, minlength=len(moves))
    return replace(
        moves.take(move),
        motion=np.where(arc & ~stays, FEED, moves.motion)[move],
        arc_sweep=np.where(stays, moves.arc_sweep / pieces, 0.0)[move],
        arc_center=np.where(stays[move][:, None], risen, 0.0),
        arc_normal=np.where(stays[:, None], normal, 0.0)[move],
        from_machine=np.zeros((len(move), 2), dtype=bool),
    )


def _with_times(
    pieces: Moves, moves: Moves, move: IntArray, count: IntArray, last: BoolArray
) -> tuple[Moves, IntArray]:
    """Pieces that move the tip or the tool axis, and the move to which each belongs.

    Feeds and dwells keep the time of every move; a pause before the first one is none.
    """
    length, turn = move_lengths(moves), _turning(moves).max(axis=1)
    share = (np.where(length > 0.0, length, turn) / moves.feed / count)[move]  # s; nan: a rapid
    way = move_lengths(pieces)
    # Where the tip's travel on the part equals that of the axes (tool centre point control, or no turn): as programmed.
    same = (way > 0.0) & np.isclose(way * count[move], length[move], rtol=1e-9, atol=0.0)
    way = np.where(way > 0.0, way, _turning(pieces).max(axis=1))
    feed, kept = np.where(same, pieces.feed, way / share), way > 0.0
    waits = np.where(last, moves.dwell[move], 0.0) + np.where(kept, 0.0, np.nan_to_num(share))
    dwell = np.bincount(np.cumsum(kept), waits, int(kept.sum()) + 1).astype(float)
    return replace(replace(pieces, feed=feed).take(kept), dwell=dwell[1:]), move[kept]
