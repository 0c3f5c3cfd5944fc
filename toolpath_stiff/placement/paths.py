"""The path that is placed, sampled in the set-up frame, and thinned for a search.

A placement (x, y, z, A, B, C; the numbers of `--origin`) turns and moves the samples rigidly, as `path`. Rapids
to a point of the machine (G53, G28, G30), and the first one, which comes from where the control stands, are anchored:
one of their ends, or some of its axes, stays where it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.analysis.loads import Load, headline_rows
from toolpath_stiff.arrays import AnyArray, ArrayColumns, BoolArray, FloatArray, IntArray, product
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.moves import CUTTER_LOCATION, RAPID, Moves, ReadProgram
from toolpath_stiff.path.placing import place, place_orientations
from toolpath_stiff.path.sampling import Samples, sample_moves
from toolpath_stiff.poses import Pose
from toolpath_stiff.rotations import rotation_matrices

Read = Callable[[Pose], ReadProgram]  # the program as it is read where its zero sits there
SHIFT = np.array([0.011, 0.017, 0.023, 0.0, 0.0, 0.0])  # m; tells the axes of a point that follow the work from others
LEG_SAMPLES = 40  # of an anchored rapid, at most; 25 mm apart over a metre, and reach changes slowly

COLUMNS = ("position", "tangent", "abc", "weight", "line", "tool_length", "cutting")  # as sampled
MOST_COMPARED = 6000  # samples of a long path that are compared with each other, evenly spread


@dataclass(frozen=True)
class Anchored(ArrayColumns):
    """q samples of rapids that do not wholly move with the work: (1 - u) start + u end. SI.

    Attributes
    ----------
    work, machine
        (q, 2, 3) m, start and end in the set-up frame and in the machine's.
    follows
        (q, 2, 3) axes of start and end that move with the work; the others stay at `machine`.
    u
        (q,) place along the line, 0 to 1.
    abc
        (q, 3) rad, as programmed.
    tool_length
        (q,) m.
    move, line
        (q,) row of the move and its line in the program.
    """

    work: FloatArray
    machine: FloatArray
    follows: BoolArray
    u: FloatArray
    abc: FloatArray
    tool_length: FloatArray
    move: IntArray
    line: IntArray

    def __len__(self) -> int:
        return len(self.u)

    def placed(self, turn: FloatArray, zero: FloatArray) -> FloatArray:
        """(k, q, 3) m, positions at k placements: turns (k, 3, 3) and program zeros (k, 3)."""
        start, end = (
            np.where(follows, product(work, np.swapaxes(turn, 1, 2)) + zero[:, None], machine)
            for work, machine, follows in zip(
                *(np.swapaxes(ends, 0, 1) for ends in (self.work, self.machine, self.follows)), strict=True
            )
        )
        return np.asarray(start + self.u[:, None] * (end - start))


@dataclass(frozen=True)
class WorkPath(ArrayColumns):
    """Samples of a program in the set-up frame. SI.

    Attributes
    ----------
    position, tangent, abc
        (m, 3) m, unit vectors (0: no motion), rad.
    weight
        (m,) m, length that each sample stands for; 0 for rapids.
    line
        (m,) of the program.
    tool_length
        (m,) m; nan: the reference tool.
    headline
        (m,) samples that mean, range and weakest place are about (`analysis.loads`).
    cutting
        (m,) samples of cuts; the others are rapids that move with the work, held to the limits alone.
    anchored
        Rapids that do not wholly move with the work.
    """

    position: FloatArray
    tangent: FloatArray
    abc: FloatArray
    weight: FloatArray
    line: IntArray
    tool_length: FloatArray
    headline: BoolArray
    cutting: BoolArray
    anchored: Anchored

    def __len__(self) -> int:
        return len(self.line)

    def alone(self, rows: BoolArray) -> WorkPath:
        """Some of the samples as a path of their own, which the headline figures are about."""
        some = self.take(rows)
        return replace(some, headline=np.ones(len(some), dtype=bool), anchored=self.anchored.take(slice(0)))


def work_path(
    program: ReadProgram, step: float, load: Load | None = None, present: Pose | None = None, read: Read | None = None
) -> WorkPath:
    """Sample a program in the set-up frame.

    Parameters
    ----------
    program
        As read where its zero sits now.
    step
        Distance of the samples, m.
    load
        Says which samples the headline figures are about; tangential unless given.
    present
        Where program zero sits now, m and rad; unless given, where the program was read for.
    read
        Reads the program for another zero; without it the ends in machine coordinates stay put in all axes.

    Raises
    ------
    InputError
        A cutting move has an end in machine coordinates (G53): it does not move with the work.
    """
    moves = program.moves
    fixed = (moves.motion != RAPID) & moves.from_machine.any(axis=1)
    if fixed.any():
        raise ProgramError(
            "a cutting move from or to machine coordinates (G53, G28) does not move with the work",
            hint="end it in work coordinates before placing the program",
            file=program.name,
            line=int(moves.line[np.argmax(fixed)]),
        )
    samples = sample_moves(moves, step)
    samples = samples.take(~_bound(moves)[samples.move])
    counted = samples.cutting & (samples.weight > 0.0)
    headline = headline_rows(load or Load(), samples.tangent, samples.abc, counted)
    columns = {name: getattr(samples, name) for name in COLUMNS}
    anchored = _anchored(program, np.array(present or program.origin), read)
    return WorkPath(**columns, headline=headline, anchored=anchored)


def _anchored(program: ReadProgram, present: FloatArray, read: Read | None) -> Anchored:
    """The anchored rapids of a program, sampled.

    Where there are ends in machine coordinates the program is read for two other zeros: there no such move is without
    length by chance, and the axes of a point that moved with the zero follow the work.
    """
    zero, moves = present, program.moves
    follows = np.repeat(~moves.from_machine.T[..., None], 3, axis=2)
    if moves.from_machine.any() and read is not None:
        zero, further = present + SHIFT, present + 2.0 * SHIFT
        moves, again = (read((x, y, z, a, b, c)).moves for x, y, z, a, b, c in (zero.tolist(), further.tolist()))
        follows = np.repeat(~moves.from_machine.T[..., None], 3, axis=2)
        if len(again) == len(moves):
            moved = _tips(place(again, further)) - _tips(place(moves, zero))
            follows = np.asarray(np.abs(moved - SHIFT[:3]) < np.abs(moved))
    rows = np.flatnonzero(_bound(moves))
    of_moves: list[AnyArray] = [np.stack([moves.start, moves.end]), _tips(place(moves, zero)), follows]
    legs = [np.swapaxes(ends[:, rows], 0, 1) for ends in of_moves]
    if len(rows) and rows[0] == 0 and program.dialect != CUTTER_LOCATION:
        rows = np.append(rows, [0, 0, 0])
        standing = _tips(place(moves.take(slice(0, 1)), present))[:, 0]
        approach = _approach(legs[0][0], standing, legs[2][0])
        legs = [np.concatenate(pair) for pair in zip(legs, approach, strict=True)]
    ends, machine, moved_with = legs
    lengths = np.linalg.norm(machine[:, 1] - machine[:, 0], axis=1)
    counts = np.clip(np.ceil(lengths / 5e-3), 2, LEG_SAMPLES).astype(np.int64)
    leg = np.repeat(np.arange(len(rows)), counts)
    u = np.concatenate([np.zeros(0), *(np.linspace(0.0, 1.0, count) for count in counts)])
    ends, move = ends[leg], rows[leg]
    abc = ends[:, 0, 3:] + u[:, None] * (ends[:, 1, 3:] - ends[:, 0, 3:])
    return Anchored(
        ends[:, :, :3], machine[leg], moved_with[leg], u, abc, moves.tool_length[move], move, moves.line[move]
    )


def _bound(moves: Moves) -> BoolArray:
    """(n,) moves that do not wholly follow the work: an end in machine coordinates, and the first rapid."""
    bound = np.asarray(moves.from_machine.any(axis=1))
    if len(moves) and moves.motion[0] == RAPID:
        bound[0] = True
    return bound


def _tips(moves: Moves) -> FloatArray:
    """(2, n, 3) m, start and end of every move."""
    return np.stack([moves.start[:, :3], moves.end[:, :3]])


def _approach(ends: FloatArray, machine: FloatArray, follows: BoolArray) -> list[AnyArray]:
    """(3, 2, .) the first rapid once more, from where the control stands now: straight, and X and Y before Z.

    Its start does not move with the work when an offset is keyed in, or when the program is rewritten.
    """
    between = [np.append(pair[1, :2], pair[0, 2:]) for pair in (ends, machine)]
    places = (
        np.stack([ends[0], between[0], ends[1]]),
        np.stack([machine[0], between[1], machine[1]]),
        np.stack([np.zeros(3, dtype=bool), np.array([True, True, False]) & follows[1], follows[1]]),
    )
    return [place[[[0, 2], [0, 1], [1, 2]]] for place in places]


def representative_path(path: WorkPath, count: int) -> WorkPath:
    """A path of `count` headline samples that stands for the whole, and of the outermost samples of all cuts.

    A quarter as many of the other cuts, of the rapids and of the anchored ones stay for the limits.
    """
    if len(path) <= count:
        return path
    rows, weight = _spread(path, np.flatnonzero(path.headline), count)
    beside = [path.cutting & ~path.headline, ~path.cutting]
    others = [_spread(path, np.flatnonzero(those), count // 4)[0] for those in beside]
    others += [_outermost(path.position, np.flatnonzero(those)) for those in (path.headline, *beside)]
    further = np.setdiff1d(np.concatenate(others), rows)
    few = path.take(np.concatenate([rows, further]))
    q = len(path.anchored)
    anchored = path.anchored.take(np.linspace(0, q - 1, min(q, count // 4)).astype(np.int64))
    return replace(few, weight=np.concatenate([weight, np.zeros(len(further))]), anchored=anchored)


def _outermost(position: FloatArray, rows: IntArray) -> IntArray:
    """Those of the rows that lie furthest in one of 26 directions: along the axes and halfway between them."""
    if not len(rows):
        return rows
    directions = np.array([d for d in np.ndindex(3, 3, 3) if d != (1, 1, 1)]) - 1.0
    return np.asarray(rows[np.unique(product(position[rows], directions.T).argmax(axis=0))])


def with_rows(few: WorkPath, whole: WorkPath, rows: IntArray) -> WorkPath:
    """A path that stands for the whole, with some samples of the whole added, which stand for no length."""
    return WorkPath.joined([few, replace(whole.take(rows), weight=np.zeros(len(rows)))])


def _spread(path: WorkPath, rows: IntArray, count: int) -> tuple[IntArray, FloatArray]:
    """At most `count` of the rows, spread over position and direction, and the weights that they take over.

    Farthest-point sampling: each next sample is the one least like those chosen, position counted in units of the
    path's size. Each chosen sample takes over the weights of those that are most like it.
    """
    if len(rows) <= count:
        return rows, path.weight[rows]
    if len(rows) > MOST_COMPARED:  # those between stand at their neighbours
        number = np.arange(len(rows)) * MOST_COMPARED // len(rows)
        first = np.flatnonzero(np.diff(number, prepend=-1))
        carried = np.bincount(number, weights=path.weight[rows]).astype(float)
        rows = rows[(first + np.append(first[1:], len(number)) - 1) // 2]
    else:
        carried = path.weight[rows]
    position = path.position[rows]
    size = max(float(np.ptp(position, axis=0).max()), 1e-9)
    features = np.concatenate([position / size, 0.5 * path.tangent[rows], path.abc[rows]], axis=1)
    chosen = [int(np.argmax(np.linalg.norm(features - features.mean(axis=0), axis=1)))]
    distance, nearest = np.full(len(rows), np.inf), np.zeros(len(rows), dtype=np.int64)
    for i in range(count):
        step = features - features[chosen[-1]]
        apart = (step * step).sum(axis=1)
        closer = apart < distance
        distance[closer], nearest[closer] = apart[closer], i
        if i + 1 < count:
            chosen.append(int(np.argmax(distance)))
    weight = np.bincount(nearest, weights=carried, minlength=count).astype(float)
    return rows[np.array(chosen)], weight


def placed_path(path: WorkPath | Samples, placement: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Positions, tangents and orientations of a path's samples at one placement (6,), anchored rapids left out."""
    if not placement[3:].any():
        return path.position + placement[:3], path.tangent, path.abc
    turn = rotation_matrices(placement[3:])
    position = path.position @ turn.T + placement[:3]
    return position, path.tangent @ turn.T, place_orientations(path.abc, placement)
