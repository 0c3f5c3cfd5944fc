"""Tools that do not stand along Z: the cuts of each direction of the tool in a frame in which it stands upright.

What the tools of other frames have taken is looked up in theirs, point by point (`Workpiece.standing`).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray, product
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.engagement import Engagement, engage
from toolpath_stiff.cutting.patches import Patches
from toolpath_stiff.cutting.stock import Stock
from toolpath_stiff.cutting.workpiece import Workpiece, stages_of
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.moves import RAPID, Moves
from toolpath_stiff.path.placing import place
from toolpath_stiff.path.sampling import Orient, Samples
from toolpath_stiff.results import Progress
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices

TURNING = -1  # the number of moves whose tool turns on the way
DIGITS = 9  # of a unit vector: tools that differ by less stand alike
SHARES = (0.0, 0.4, 1.0)  # of a move, where the tool must stand alike; a whole turn returns at its ends and its middle


def tilts_of(moves: Moves, orient: Orient) -> tuple[IntArray, FloatArray]:
    """(n,) number of each move's tilt, and (t, 3, 3) the axes of their frames as columns; the first is upright.

    `orient` gives roll, pitch, yaw of the tool of programmed angles.
    """
    if not (moves.start[:, 3:].any() or moves.end[:, 3:].any()):
        return np.zeros(len(moves), dtype=np.int64), np.eye(3)[None]
    turned = moves.end[:, 3:] - moves.start[:, 3:]
    along = [rotation_matrices(orient(moves.start[:, 3:] + share * turned))[:, :, 2] for share in SHARES]
    still = np.logical_and.reduce([np.abs(axis - along[0]).max(axis=1) < 10.0**-DIGITS for axis in along[1:]])
    axes = np.round(np.concatenate([[[0.0, 0.0, 1.0]], along[0][still]]), DIGITS)
    axes, number = np.unique(axes, axis=0, return_inverse=True)
    order = np.argsort(np.arange(len(axes)) != number[0], kind="stable")
    tilt = np.full(len(moves), TURNING)
    tilt[still] = np.argsort(order)[number[1:]]
    x, y, z = axes[order].T
    return tilt, rotation_matrices(np.stack([-np.arcsin(np.clip(y, -1.0, 1.0)), np.arctan2(x, z), 0.0 * x], axis=1))


def moves_seen(moves: Moves, turn: FloatArray) -> Moves:
    """Moves in the frame of a tilt (3, 3); rotary words as they are."""
    return moves if np.array_equal(turn, np.eye(3)) else place(moves, (0.0, 0.0, 0.0, *roll_pitch_yaw(turn.T)))


def samples_seen(samples: Samples, tilt: IntArray, turns: FloatArray) -> Samples:
    """Samples, each in the frame of its tilt (n,), where its tool is upright; as they are where it turns on the way."""
    if len(turns) == 1:
        return samples
    position, tangent, abc = samples.position.copy(), samples.tangent.copy(), samples.abc.copy()
    for number, turn in enumerate(turns):
        rows = tilt == number
        position[rows], tangent[rows] = product(position[rows], turn), product(tangent[rows], turn)
        abc[rows] = 0.0
    return replace(samples, position=position, tangent=tangent, abc=abc)


def engage_tilts(
    stock: Stock,
    moves: Moves,
    samples: Samples,
    cutters: Mapping[int, Cutter],
    tilts: IntArray,
    turns: FloatArray,
    progress: Progress | None = None,
) -> tuple[Engagement, list[Workpiece]]:
    """The engagement of samples in the frames of their tilts, and the work after the last cut as each tilt sees it.

    `moves` as read, with `tilts` and `turns` as of `tilts_of`. Raises `ProgramError`.
    """
    cuts = moves.motion != RAPID
    if cuts.any() and (tilts[cuts] == TURNING).all():
        mistake = "the tool turns on its way in every cut: no force is known there"
        raise ProgramError(mistake, hint="leave --cut out", line=int(moves.line[cuts][0]))
    if len(turns) == 1:
        engaged = engage(stages_of(stock, moves, cutters, tilts == 0), moves, samples, cutters, progress)
        return engaged, [engaged.work]
    seen, works = [moves_seen(moves, turn) for turn in turns], []
    for number, turn in enumerate(turns):
        body = stock.seen(turn) if number else stock
        works += list(stages_of(body, seen[number], cutters, tilts == number, staged=False))
    # A box is the same body in all frames; of an STL's heights the others see the box around them.
    tells = [bool(work.first[-1]) or (not number and stock.top.size > 1) for number, work in enumerate(works)]
    linked, parts, source = [], [], np.arange(len(samples))
    for number, work in enumerate(works):
        others = [other for other in np.flatnonzero(tells).tolist() if other != number]
        views = tuple((product(turns[other].T, turns[number]), works[other]) for other in others)
        linked.append(replace(work, others=views))
        chosen = tilts[samples.move] == number
        parts.append(engage(linked[-1:], seen[number], samples, cutters, progress, chosen))
        source[chosen] = parts[-1].source[chosen]
    patches = Patches.joined([part.patches for part in parts])
    patches = patches.take(np.argsort(patches.station, kind="stable"))
    removed, struck = (sum(getattr(part, name) for part in parts) for name in ("removed", "struck"))
    return Engagement(linked[0], patches, source, removed, struck > 0), linked
