"""Volume swept by the cutter, piece by piece of the path: straight lines and arcs in the plane, with a slope.

Each in the frame of its tilt, in which the tool stands upright. Where the tool turns on its way, a piece is a chord
with the tool as it stands in its middle, along which the middle of the cutter's corner goes: a ball stays where it is.
"""

from collections.abc import Mapping

import numpy as np

from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray, numbered, product
from toolpath_stiff.cutting.cutters import Cutter, of_tools
from toolpath_stiff.cutting.tilts import TURNING, axes_along, tilts_of, upright_frames
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.courses import arc_frame, move_lengths, points_along
from toolpath_stiff.nc.moves import RAPID, Moves
from toolpath_stiff.path.sampling import Orient

SAGITTA = 5e-7  # m, of the chords that replace an arc that is not parallel to the plane
STRAIGHT, ARC_TURN, NARROW_TURN = 4.0, 0.5 * np.pi, np.pi / 60.0  # longest: radii of the cutter; rad, rad
ROUNDED = 1e-9  # share of a radius: rounding of arcs rotated in space
PIECE_TURN = np.radians(0.5)  # turn of a tool along a piece: a quarter of a degree is 4.4 um a mm above its corner


# A piece of the cutting path; SI. Pieces stand in the order of time.
FIELDS = (
    "before",  # path from the program's start to where the piece begins, rapids included
    "after",  # ... and to where it ends
    "x",  # start of a line, or centre of an arc ...
    "y",
    "z",  # ... at the height of its start
    "turn",  # 0: line; 1, -1: arc counter-clockwise, clockwise
    "heading",  # direction of a line, or angle on the circle at which an arc begins
    "cos",  # of the heading
    "sin",
    "extent",  # length in the plane, m, or turn, rad
    "slope",  # climb per unit of it
    "radius",  # of an arc at its start
    "growth",  # of the radius per rad
    "reach",  # radius of the cutter
    "flat",  # radius of the flat part of its end
    "swing_x",  # motion of the tool's axis per height above its corner and per path, 1/m
    "swing_y",
)
PIECE = np.dtype([*((name, np.float64) for name in FIELDS), ("tilt", np.int64)])


def sweeps_of(
    moves: Moves, cutters: Mapping[int, Cutter], orient: Orient
) -> tuple[AnyArray, IntArray, IntArray, FloatArray]:
    """The pieces of cutting moves, and (n + 1,) the first piece of each move.

    And (n,) the number of each move's tilt, `TURNING` of some; (t, 3, 3) the axes of the tilts' frames as columns, the
    first upright; `orient` gives roll, pitch, yaw of the tool of programmed angles. Raises `ProgramError` where the
    tool of a move is not known.
    """
    length, (tilts, turns, angle) = move_lengths(moves), tilts_of(moves, orient)
    cuts = (moves.motion != RAPID) & ((length > 0.0) | (tilts == TURNING))
    radius, flat = _ends_of(moves, cutters, cuts)
    upward = moves.arc_normal[:, 2] if len(turns) == 1 else (moves.arc_normal * turns[tilts, :, 2]).sum(axis=1)
    plane = cuts & (moves.arc_sweep != 0.0) & (np.abs(upward) > 1.0 - 1e-9) & (tilts != TURNING)
    counts = _counts(moves, length, radius, angle, cuts, cuts & (moves.arc_sweep != 0.0) & ~plane)
    first = np.append(0, np.cumsum(counts.astype(np.int64)))
    move, number = numbered(counts.astype(np.int64))
    share, part = number / counts[move], 1.0 / counts[move]
    start, end = points_along(moves, move, share)[0], points_along(moves, move, share + part)[0]
    tilt = tilts[move]
    turning = np.flatnonzero(tilt == TURNING)
    if len(turning):
        of, share, part = move[turning], share[turning], part[turning]
        axes = [axes_along(moves, of, share + half * part, orient) for half in (0.0, 0.5, 1.0)]
        start[turning] += (radius - flat)[of, None] * (axes[0] - axes[1])
        end[turning] += (radius - flat)[of, None] * (axes[2] - axes[1])
        tilt[turning] = len(turns) + np.arange(len(turning))
        turns = np.concatenate([turns, upright_frames(axes[1])])
    if len(turns) > 1:
        start, end = (product(ends[:, None], turns[tilt])[:, 0] for ends in (start, end))
    along = end - start
    level = np.hypot(along[:, 0], along[:, 1])
    plunge = level < 1e-9
    pieces = np.zeros(len(move), dtype=PIECE)
    pieces["tilt"] = tilt
    pieces["reach"], pieces["flat"] = radius[move], flat[move]
    pieces["before"] = (np.cumsum(length) - length)[move] + number / counts[move] * length[move]
    pieces["after"] = pieces["before"] + length[move] / counts[move]
    if len(turning):
        path = np.where(pieces["after"] > pieces["before"], pieces["after"] - pieces["before"], np.inf)[turning]
        swing = product((axes[2] - axes[0])[:, None], turns[tilt[turning]])[:, 0]
        pieces["swing_x"][turning], pieces["swing_y"][turning] = swing[:, :2].T / path
    pieces["x"], pieces["y"] = start[:, 0], start[:, 1]
    pieces["z"] = np.where(plunge, np.minimum(start, end)[:, 2], start[:, 2])
    pieces["heading"] = np.arctan2(along[:, 1], along[:, 0])
    pieces["extent"] = np.where(plunge, 0.0, level)
    pieces["slope"] = np.where(plunge, 0.0, along[:, 2] / np.where(plunge, 1.0, level))
    rows = np.flatnonzero(plane[move])
    if len(rows):
        of = move[rows]
        _enter_arcs(pieces, rows, moves.take(of), turns[tilts[of]], upward[of] / counts[of])
    pieces["cos"], pieces["sin"] = np.cos(pieces["heading"]), np.sin(pieces["heading"])
    return pieces, first, tilts, turns


def _ends_of(moves: Moves, cutters: Mapping[int, Cutter], cuts: BoolArray) -> tuple[FloatArray, FloatArray]:
    """(n,) and (n,) m, radius of the cutter and of its flat end, for moves that cut (n,); raises `ProgramError`."""
    unknown = np.flatnonzero(cuts & ~np.isin(moves.tool, list(cutters)))
    if len(unknown):
        mistake = f"tool {moves.tool[unknown[0]]} cuts but its geometry is not known"
        hint = "give it a [[tool]] in the file of --cut"
        raise ProgramError(mistake, hint=hint, line=int(moves.line[unknown[0]]))
    radius, flat = (np.where(cuts, of_tools(cutters, moves.tool, name), 0.0) for name in ("radius", "flat"))
    return radius, flat


def _enter_arcs(pieces: AnyArray, rows: IntArray, arcs: Moves, turns: FloatArray, upward: FloatArray) -> None:
    """Turn lines in some rows into arcs (k,); (k, 3, 3) frames, (k,) side of the normal over number of pieces."""
    frame, sweep = arc_frame(arcs, np.arange(len(rows))), arcs.arc_sweep
    x, y = product(frame.center[:, None], turns)[:, 0, :2].T
    part, beside = np.abs(sweep * upward), (pieces["x"][rows] - x, pieces["y"][rows] - y)
    climb = pieces["slope"][rows] * pieces["extent"][rows]
    pieces["x"][rows], pieces["y"][rows] = x, y
    pieces["turn"][rows] = np.sign(sweep * upward)
    pieces["heading"][rows] = np.arctan2(beside[1], beside[0])
    pieces["extent"][rows], pieces["slope"][rows] = part, climb / part
    pieces["radius"][rows] = np.hypot(*beside)
    pieces["growth"][rows] = (frame.radius_end - frame.radius_start) / np.abs(sweep)


def _counts(
    moves: Moves, length: FloatArray, radius: FloatArray, angle: FloatArray, cuts: BoolArray, bent: BoolArray
) -> FloatArray:
    """(n,) number of pieces of each move; `bent` arcs become chords, `angle` is the turn of the tool."""
    counts = np.where(cuts, np.maximum(np.ceil(length / (STRAIGHT * np.where(cuts, radius, 1.0)) - 1e-9), 1.0), 0.0)
    arcs = np.flatnonzero(cuts & (moves.arc_sweep != 0.0))
    if len(arcs):
        frame, sweep = arc_frame(moves, arcs), np.abs(moves.arc_sweep[arcs])
        turn = np.where(frame.radius_start < (1.0 - ROUNDED) * radius[arcs], NARROW_TURN, ARC_TURN)
        turn = np.where(bent[arcs], np.sqrt(8.0 * SAGITTA / frame.radius_start), turn)
        counts[arcs] = np.ceil(sweep / turn - 1e-9)
    return np.where(cuts, np.maximum(counts, np.ceil(angle / PIECE_TURN - 1e-9)), 0.0)
