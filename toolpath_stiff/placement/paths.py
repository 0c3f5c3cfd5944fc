"""The path that is placed, sampled in the set-up frame; thinned for a search, and for drawing.

A placement (x, y, z, A, B, C; the numbers of `--origin`) turns and moves the samples rigidly, as `path`. Rapids
to a point of the machine (G53, G28, G30), and the first one, which comes from where the control stands, are anchored:
one of their ends, or some of its axes, stays where it is.

A page cannot hold every sample of a long program at sixty placements. Of a drawn path the ends of every cut and its
corners are kept first, then samples evenly along the path; the stiffness is evaluated at just these.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np

from toolpath_stiff.analysis.evaluation import evaluate
from toolpath_stiff.analysis.loads import Load, headline_rows, plunging_rows
from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray, product
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.moves import CUTTER_LOCATION, RAPID, Moves, ReadProgram
from toolpath_stiff.path import Samples, place, place_orientations, sample_moves
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import Pose, rad_from_deg

Read = Callable[[Pose], ReadProgram]  # the program as it is read where its zero sits there
SHIFT = np.array([0.011, 0.017, 0.023, 0.0, 0.0, 0.0])  # m; tells the axes of a point that follow the work from others
LEG_SAMPLES = 40  # of an anchored rapid, at most; 25 mm apart over a metre, and reach changes slowly

MOST_COMPARED = 6000  # samples of a long path that are compared with each other, evenly spread
CORNER = rad_from_deg(10.0)  # a sharper one is kept before samples along straight cuts are
SHARE_OF_CORNERS = 0.6  # at most, of the points drawn


@dataclass(frozen=True)
class Anchored:
    """q samples of rapids that do not wholly move with the work: (1 - u) start + u end. SI.

    Attributes
    ----------
    work, machine
        (2, q, 3) m, start and end in the set-up frame and in the machine's.
    follows
        (2, q, 3) axes of start and end that move with the work; the others stay at `machine`.
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

    def take(self, rows: IntArray | BoolArray) -> Anchored:
        """Some of the samples."""
        ends = {name: getattr(self, name)[:, rows] for name in ("work", "machine", "follows")}
        rest = {name: getattr(self, name)[rows] for name in ("u", "abc", "tool_length", "move", "line")}
        return Anchored(**ends, **rest)

    def placed(self, turn: FloatArray, zero: FloatArray) -> FloatArray:
        """(k, q, 3) m, positions at k placements: turns (k, 3, 3) and program zeros (k, 3)."""
        ends = []
        for work, machine, follows in zip(self.work, self.machine, self.follows, strict=True):
            moved = product(work, np.swapaxes(turn, 1, 2)) + zero[:, None]
            ends.append(np.where(follows, moved, machine))
        return np.asarray(ends[0] + self.u[:, None] * (ends[1] - ends[0]))


@dataclass(frozen=True)
class WorkPath:
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

    def take(self, rows: IntArray | BoolArray) -> WorkPath:
        """Some of the samples; the anchored rapids stay."""
        kept = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "anchored"}
        return WorkPath(**kept, anchored=self.anchored)

    def alone(self, rows: BoolArray) -> WorkPath:
        """Some of the samples as a path of their own, which the headline figures are about."""
        some = self.take(rows)
        nothing = np.zeros(len(self.anchored), dtype=bool)
        return replace(some, headline=np.ones(len(some), dtype=bool), anchored=self.anchored.take(nothing))


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
    return WorkPath(
        samples.position,
        samples.tangent,
        samples.abc,
        samples.weight,
        samples.line,
        samples.tool_length,
        headline,
        samples.cutting,
        _anchored(program, np.array(present or program.origin), read),
    )


def _anchored(program: ReadProgram, present: FloatArray, read: Read | None) -> Anchored:
    """The anchored rapids of a program, sampled.

    Where there are ends in machine coordinates the program is read for two other zeros: there no such move is without
    length by chance, and the axes of a point that moved with the zero follow the work.
    """
    at, moves = present, program.moves
    follows = np.repeat(~moves.from_machine.T[..., None], 3, axis=2)
    if moves.from_machine.any() and read is not None:
        at, further = present + SHIFT, present + 2.0 * SHIFT
        moves, again = (_read_at(read, zero) for zero in (at, further))
        follows = np.repeat(~moves.from_machine.T[..., None], 3, axis=2)
        if len(again) == len(moves):
            moved = _tips(place(again, further)) - _tips(place(moves, at))
            follows = np.asarray(np.abs(moved - SHIFT[:3]) < np.abs(moved))
    ends, machine = np.stack([moves.start, moves.end]), _tips(place(moves, at))
    rows = np.flatnonzero(_bound(moves))
    legs = [_leg(int(i), ends[:, i], machine[:, i], follows[:, i], moves) for i in rows]
    if len(rows) and rows[0] == 0 and program.dialect != CUTTER_LOCATION:
        standing = _tips(place(moves.take(slice(0, 1)), present))[:, 0]
        legs += _approach(ends[:, 0], standing, follows[:, 0], moves)
    if not legs:
        legs = [_leg(0, np.zeros((2, 6)), np.zeros((2, 3)), np.ones((2, 3), dtype=bool), moves, count=0)]
    columns = [f.name for f in fields(Anchored)]
    axis = {name: 1 if name in ("work", "machine", "follows") else 0 for name in columns}
    return Anchored(**{n: np.concatenate([getattr(leg, n) for leg in legs], axis=axis[n]) for n in columns})


def _bound(moves: Moves) -> BoolArray:
    """(n,) moves that do not wholly follow the work: an end in machine coordinates, and the first rapid."""
    bound = np.asarray(moves.from_machine.any(axis=1))
    if len(moves) and moves.motion[0] == RAPID:
        bound[0] = True
    return bound


def _read_at(read: Read, zero: FloatArray) -> Moves:
    x, y, z, a, b, c = (float(v) for v in zero)
    return read((x, y, z, a, b, c)).moves


def _tips(moves: Moves) -> FloatArray:
    """(2, n, 3) m, start and end of every move."""
    return np.stack([moves.start[:, :3], moves.end[:, :3]])


def _leg(
    move: int, ends: FloatArray, machine: FloatArray, follows: BoolArray, moves: Moves, count: int | None = None
) -> Anchored:
    """One straight rapid from `ends` (2, 6), some axes of which stay at `machine` (2, 3), sampled."""
    if count is None:
        length = float(np.linalg.norm(machine[1] - machine[0]))
        count = int(np.clip(np.ceil(length / 5e-3), 2, LEG_SAMPLES))
    u = np.linspace(0.0, 1.0, count)

    def repeated(values: AnyArray) -> AnyArray:
        return np.repeat(values[:, None], count, axis=1)

    return Anchored(
        work=repeated(ends[:, :3]),
        machine=repeated(machine),
        follows=repeated(follows),
        u=u,
        abc=ends[0, 3:] + u[:, None] * (ends[1, 3:] - ends[0, 3:]),
        tool_length=np.full(count, moves.tool_length[move] if len(moves) else np.nan),
        move=np.full(count, move, dtype=np.int64),
        line=np.full(count, moves.line[move] if len(moves) else 0, dtype=np.int64),
    )


def _approach(ends: FloatArray, machine: FloatArray, follows: BoolArray, moves: Moves) -> list[Anchored]:
    """The first rapid once more, from where the control stands now: straight, and X and Y before Z.

    Its start does not move with the work when an offset is keyed in, or when the program is rewritten.
    """
    standing, corner = np.zeros(3, dtype=bool), np.array([True, True, False]) & follows[1]
    start, end = (ends[0], machine[0], standing), (ends[1], machine[1], follows[1])
    between = (np.concatenate([ends[1, :2], ends[0, 2:]]), np.concatenate([machine[1, :2], machine[0, 2:]]), corner)
    legs = []
    for one, other in ((start, end), (start, between), (between, end)):
        work, at, moving = (np.stack(pair) for pair in zip(one, other, strict=True))
        legs.append(_leg(0, work, at, moving, moves))
    return legs


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
    some = whole.take(rows)
    columns = {
        f.name: np.concatenate([getattr(few, f.name), getattr(some, f.name)])
        for f in fields(few)
        if f.name not in ("anchored", "weight")
    }
    return WorkPath(**columns, weight=np.concatenate([few.weight, np.zeros(len(rows))]), anchored=few.anchored)


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


@dataclass(frozen=True)
class DrawnPath:
    """m samples of a path in the set-up frame, and their stiffness at k placements. SI.

    Attributes
    ----------
    position, axis
        (m, 3) m, tool tip; (m, 3) unit vectors from the tip up the tool.
    s
        (m,) m along the path, rapids included.
    cut
        (m,) number of the cut: samples of different cuts have a rapid between them.
    plunge
        (m,) plunges along the tool axis, where they stand beside the headline figures.
    stiffness
        (k, m) N/m along the load; nan out of reach.
    samples
        How many samples the whole path has.
    """

    position: FloatArray
    axis: FloatArray
    s: FloatArray
    cut: IntArray
    plunge: BoolArray
    stiffness: FloatArray
    samples: int


def drawn_path(
    model: StiffnessModel,
    program: ReadProgram,
    placements: FloatArray,
    load: Load,
    *,
    force: float,
    step: float,
    points: int,
) -> DrawnPath:
    """At most `points` samples of the cutting path, evaluated at placements (k, 6) m and rad.

    `program` is in the set-up frame, as read; `step` is the distance in m of the samples that are chosen from.
    """
    samples = sample_moves(program.moves, step)
    counted = samples.cutting & (samples.weight > 0.0)
    rows = np.flatnonzero(counted if counted.any() else samples.cutting)
    cut = np.unique(np.cumsum(~samples.cutting)[rows], return_inverse=True)[1]
    chosen = thinned_rows(samples.take(rows), cut, points)
    few = samples.take(rows[chosen])
    placed = zip(*(placed_path(few, placement) for placement in placements), strict=True)
    position, tangent, abc = (np.concatenate(parts) for parts in placed)
    tools = np.tile(few.tool_length, len(placements))
    stiffness = evaluate(model, position, abc, tangent, tools, load, force).stiffness
    counting = few.weight > 0.0
    beside = plunging_rows(load, few.tangent, few.abc, counting)
    beside &= ~headline_rows(load, few.tangent, few.abc, counting)
    axis = rotation_matrices(few.abc)[:, :, 2]
    return DrawnPath(few.position, axis, few.s, cut[chosen], beside, stiffness.reshape(len(placements), -1), len(rows))


def thinned_rows(samples: Samples, cut: IntArray, points: int) -> IntArray:
    """Rising rows of at most `points` samples: ends of cuts, then corners, then evenly along the path.

    Of more cuts than there is room for, some are left out whole.
    """
    n = len(samples)
    if n <= points:
        return np.arange(n)
    first = np.flatnonzero(np.diff(cut, prepend=-1))
    last = np.append(first[1:] - 1, n - 1)
    cuts = _evenly(np.arange(len(first)), points // 2)
    kept = np.unique(np.concatenate([first[cuts], last[cuts]]))
    if len(cuts) < len(first):
        return kept
    cosine = np.einsum("ij,ij->i", samples.tangent[1:], samples.tangent[:-1])
    corners = np.flatnonzero((np.diff(cut) == 0) & (np.diff(samples.move) != 0) & (cosine < np.cos(CORNER)))
    corners = _evenly(corners, max(0, int(SHARE_OF_CORNERS * points) - len(kept)) // 2)
    kept = np.unique(np.concatenate([kept, corners, corners + 1]))  # both of a corner's samples: the tangent jumps
    others = np.setdiff1d(np.arange(n), kept)
    return np.sort(np.concatenate([kept, _evenly(others, points - len(kept))]))


def _evenly(rows: IntArray, count: int) -> IntArray:
    """`count` of the rows, evenly spread; all if there are no more."""
    if len(rows) <= count:
        return rows
    return rows[np.linspace(0, len(rows) - 1, max(count, 0)).astype(np.int64)]
