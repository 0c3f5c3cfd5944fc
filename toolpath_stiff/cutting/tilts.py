"""Tools not parallel to Z: their directions, and the frames in which they are upright."""

from itertools import pairwise

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.nc.moves import Moves
from toolpath_stiff.path.sampling import Orient
from toolpath_stiff.rotations import rotation_matrices

TURNING = -1  # the tilt's number for moves that turn the tool
DIGITS = 9  # of a unit vector: tools that differ by less count as parallel
SHARES = (0.0, 0.13, 0.26, 0.37, 0.5, 0.61, 0.74, 0.87, 1.0)  # of a move, at which the tool must be parallel
WHOLE = 2.0 * np.pi  # rad of a rotary axis, from which on the tool may be parallel at the shares but not between them


def tilts_of(moves: Moves, orient: Orient) -> tuple[IntArray, FloatArray, FloatArray]:
    """(n,) number of each move's tilt, (t, 3, 3) axes of their frames as columns, (n,) rad by which the tool turns.

    The first frame is upright. `orient` gives roll, pitch, yaw of the tool of programmed angles.
    """
    if not (moves.start[:, 3:].any() or moves.end[:, 3:].any()):
        return np.zeros(len(moves), dtype=np.int64), np.eye(3)[None], np.zeros(len(moves))
    every = np.arange(len(moves))
    along = [axes_along(moves, every, np.full(len(moves), share), orient) for share in SHARES]
    programmed = np.abs(moves.end[:, 3:] - moves.start[:, 3:]).sum(axis=1)
    chords = [np.linalg.norm(second - first, axis=1) for first, second in pairwise(along)]
    swing = np.where(
        programmed < WHOLE, sum(2.0 * np.arcsin(0.5 * np.minimum(chord, 2.0)) for chord in chords), programmed
    )
    still = np.logical_and.reduce([np.abs(axis - along[0]).max(axis=1) < 10.0**-DIGITS for axis in along[1:]])
    axes = np.round(np.concatenate([[[0.0, 0.0, 1.0]], along[0][still]]), DIGITS)
    axes, number = np.unique(axes, axis=0, return_inverse=True)
    order = np.argsort(np.arange(len(axes)) != number[0], kind="stable")
    tilt = np.full(len(moves), TURNING)
    tilt[still] = np.argsort(order)[number[1:]]
    return tilt, upright_frames(axes[order]), np.where(still, 0.0, swing)


def axes_along(moves: Moves, move: IntArray, share: FloatArray, orient: Orient) -> FloatArray:
    """(n, 3) unit vectors of the tool axis at shares (n,) of moves (n,)."""
    first, last = moves.start[move, 3:], moves.end[move, 3:]
    return rotation_matrices(orient(first + share[:, None] * (last - first)))[:, :, 2]


def upright_frames(axes: FloatArray) -> FloatArray:
    """(n, 3, 3) axes as columns of frames in which tools along `axes` (n, 3) are upright."""
    x, y, z = axes.T
    return rotation_matrices(np.stack([-np.arcsin(np.clip(y, -1.0, 1.0)), np.arctan2(x, z), 0.0 * x], axis=1))
