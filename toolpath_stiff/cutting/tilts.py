"""Tools not parallel to Z: their directions, and the frames in which they are upright."""

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.nc.moves import Moves
from toolpath_stiff.path.sampling import Orient
from toolpath_stiff.rotations import rotation_matrices

TURNING = -1  # the tilt's number for moves that turn the tool
DIGITS = 9  # of a unit vector: tools that differ by less count as parallel
SHARES = (0.0, 0.13, 0.26, 0.37, 0.5, 0.61, 0.74, 0.87, 1.0)  # of a move, at which the tool must be parallel


def tilts_of(moves: Moves, orient: Orient) -> tuple[IntArray, FloatArray]:
    """(n,) number of each move's tilt, `TURNING` of some; (t, 3, 3) axes of their frames as columns.

    The first frame is upright. `orient` gives roll, pitch, yaw of the tool of programmed angles.
    """
    if not (moves.start[:, 3:].any() or moves.end[:, 3:].any()):
        return np.zeros(len(moves), dtype=np.int64), np.eye(3)[None]
    first, last = moves.start[:, 3:], moves.end[:, 3:]
    along = [rotation_matrices(orient(first + share * (last - first)))[:, :, 2] for share in SHARES]
    still = np.logical_and.reduce([np.abs(axis - along[0]).max(axis=1) < 10.0**-DIGITS for axis in along[1:]])
    axes = np.round(np.concatenate([[[0.0, 0.0, 1.0]], along[0][still]]), DIGITS)
    axes, number = np.unique(axes, axis=0, return_inverse=True)
    order = np.argsort(np.arange(len(axes)) != number[0], kind="stable")
    tilt = np.full(len(moves), TURNING)
    tilt[still] = np.argsort(order)[number[1:]]
    x, y, z = axes[order].T
    return tilt, rotation_matrices(np.stack([-np.arcsin(np.clip(y, -1.0, 1.0)), np.arctan2(x, z), 0.0 * x], axis=1))
