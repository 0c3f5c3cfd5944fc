"""Moves of the set-up frame, placed on the machine: rigid turns of the work.

One rule: points p' = o + Q p with Q = Rz(C) Ry(B) Rx(A); orientations R' = Q R Rz(-C). Path and tool axis turn with the
work, the vertical platform never yaws. With it the machine's 120-degree symmetry holds exactly.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray, product
from toolpath_stiff.nc.moves import Moves
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_about_z, rotation_matrices


def place(moves: Moves, origin: ArrayLike) -> Moves:
    r"""Moves in machine coordinates, positions only.

    `start`, `end`, arc centres and normals are turned; the rotary words stay as programmed, because a control
    interpolates them as such. `place_orientations` turns the sampled orientations.

    Parameters
    ----------
    moves
        In the set-up frame.
    origin
        (6,) x, y, z in m, A, B, C in rad: where program zero sits.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> moves = parse_program("G21 G90 F600\nG1 X40\nM30\n").moves
    >>> placed = place(moves, (0.1, 0.0, 0.8, 0.0, 0.0, np.pi / 2))
    >>> placed.end[:, :3].round(9).tolist()  # m
    [[0.1, 0.04, 0.8]]
    """
    zero = np.asarray(origin, dtype=float)
    turn = rotation_matrices(zero[3:])

    def turned(vectors: FloatArray) -> FloatArray:
        # Skipped where nothing turns: multiplying by the unit matrix would cost the last digit.
        return product(vectors, turn.T) if zero[3:].any() else vectors

    def placed(pose: FloatArray) -> FloatArray:
        return np.concatenate([turned(pose[:, :3]) + zero[:3], pose[:, 3:]], axis=1)

    placed_moves = replace(moves, start=placed(moves.start), end=placed(moves.end))
    if not moves.arc_sweep.any():  # a long program of straight moves need not hold its zeros twice
        return placed_moves
    arc = (moves.arc_sweep != 0.0)[:, None]
    center = np.where(arc, turned(moves.arc_center) + zero[:3], 0.0)
    return replace(placed_moves, arc_center=center, arc_normal=turned(moves.arc_normal))


def place_orientations(abc: FloatArray, origin: ArrayLike) -> FloatArray:
    """Roll, pitch, yaw (n, 3) rad on the machine of programmed angles (n, 3) rad; unturned ones stay as they are.

    Examples
    --------
    >>> tilted = place_orientations(np.radians([[10.0, 0.0, 0.0]]), (0.0, 0.0, 0.8, 0.0, 0.0, np.pi / 2))
    >>> np.degrees(tilted).round(6).tolist()
    [[0.0, 10.0, 0.0]]
    """
    angles = np.asarray(origin, dtype=float)[3:]
    if not angles.any() or not (angles[:2].any() or abc.any()):  # a vertical platform never yaws
        return abc
    turn, back = rotation_matrices(angles), rotation_about_z(-angles[2])
    return roll_pitch_yaw(product(product(turn, rotation_matrices(abc)), back))
