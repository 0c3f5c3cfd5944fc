"""The path to be placed, sampled in the set-up frame, and thinned for a search.

A placement (x, y, z, A, B, C; the numbers of `--origin`) turns and moves the samples rigidly, as `path`. Rapids
to a point of the machine (G53, G28, G30), and the first one, which comes from where the control stands, do not move so
and are no part of it: they are looked at where the program is placed in the end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.analysis.loads import Load, headline_rows, plunging_rows
from toolpath_stiff.arrays import ArrayColumns, BoolArray, FloatArray, IntArray, product
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.nc.moves import RAPID, ReadProgram
from toolpath_stiff.path.placing import place_orientations
from toolpath_stiff.path.sampling import Samples, sample_moves
from toolpath_stiff.path.turning import turned_about_tool
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices

COLUMNS = ("position", "tangent", "abc", "weight", "line", "tool_length", "cutting")  # as sampled
MOST_COMPARED = 6000  # samples of a long path that are compared with each other, evenly spread


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
        (m,) samples of cuts; the others are rapids, held to the limits alone.
    """

    position: FloatArray
    tangent: FloatArray
    abc: FloatArray
    weight: FloatArray
    line: IntArray
    tool_length: FloatArray
    headline: BoolArray
    cutting: BoolArray

    def __len__(self) -> int:
        return len(self.line)

    def alone(self, rows: BoolArray) -> WorkPath:
        """Some of the samples as a separate path, which the headline figures are about."""
        some = self.take(rows)
        return replace(some, headline=np.ones(len(some), dtype=bool))


def work_path(
    program: ReadProgram, step: float, load: Load | None = None, machine: MachineTool | None = None
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
    machine
        What the program's words A, B, C mean; None: roll, pitch, yaw.

    Raises
    ------
    InputError
        A cutting move has an end in machine coordinates (G53): it does not move with the work.
    """
    moves, bound = program.moves, np.asarray(program.moves.from_machine.any(axis=1))
    fixed = (moves.motion != RAPID) & bound
    if fixed.any():
        raise ProgramError(
            "a cutting move from or to machine coordinates (G53, G28) does not move with the work",
            hint="end it in work coordinates before placing the program",
            file=program.name,
            line=int(moves.line[np.argmax(fixed)]),
        )
    bound[:1] |= moves.motion[:1] == RAPID
    words = machine.angles_of if machine is not None and program.native else None
    samples = sample_moves(moves, step, angles_of=words)
    samples = samples.take(~bound[samples.move])
    counted = samples.cutting & (samples.weight > 0.0)
    headline = headline_rows(counted, plunging_rows(load or Load(), samples.tangent, samples.abc, counted))
    return WorkPath(**{name: getattr(samples, name) for name in COLUMNS}, headline=headline)


def representative_path(path: WorkPath, count: int) -> WorkPath:
    """Path of `count` headline samples that represents the whole, with the outermost samples of all cuts.

    A quarter as many of the other cuts and of the rapids stay for the limits.
    """
    if len(path) <= count:
        return path
    rows, weight = _spread(path, np.flatnonzero(path.headline), count)
    beside = [path.cutting & ~path.headline, ~path.cutting]
    others = [_spread(path, np.flatnonzero(those), count // 4)[0] for those in beside]
    others += [_outermost(path.position, np.flatnonzero(those)) for those in (path.headline, *beside)]
    further = np.setdiff1d(np.concatenate(others), rows)
    few = path.take(np.concatenate([rows, further]))
    return replace(few, weight=np.concatenate([weight, np.zeros(len(further))]))


def _outermost(position: FloatArray, rows: IntArray) -> IntArray:
    """Rows that lie furthest in one of 26 directions: along the axes and halfway between them."""
    if not len(rows):
        return rows
    directions = np.array([d for d in np.ndindex(3, 3, 3) if d != (1, 1, 1)]) - 1.0
    return np.asarray(rows[np.unique(product(position[rows], directions.T).argmax(axis=0))])


def with_rows(few: WorkPath, whole: WorkPath, rows: IntArray) -> WorkPath:
    """A representative path with some samples of the whole added, which represent no length."""
    return WorkPath.joined([few, replace(whole.take(rows), weight=np.zeros(len(rows)))])


def _spread(path: WorkPath, rows: IntArray, count: int) -> tuple[IntArray, FloatArray]:
    """At most `count` of the rows, spread over position and direction, with the weights they take over.

    Farthest-point sampling: each next sample is the one least like those chosen, position counted in units of the
    path's size. Each chosen sample takes over the weights of those that are most like it.
    """
    if len(rows) <= count:
        return rows, path.weight[rows]
    if len(rows) > MOST_COMPARED:  # the samples between are represented by their neighbours
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
    """Positions, tangents and orientations of a path's samples at one placement (6,), or (7,) with the tool's turn."""
    turn = rotation_matrices(placement[3:6])
    abc = place_orientations(path.abc, placement[:6])
    for angle in placement[6:]:
        abc = roll_pitch_yaw(turned_about_tool(rotation_matrices(abc), np.full(len(path), angle)))
    return path.position @ turn.T + placement[:3], path.tangent @ turn.T, abc
