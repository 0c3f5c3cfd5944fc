"""What the cutter sweeps, piece by piece of the path: straight lines and arcs in the plane, with a slope."""

from collections.abc import Mapping

import numpy as np

from toolpath_stiff.arrays import AnyArray, BoolArray, IntArray, numbered
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.courses import arc_frame, move_lengths, points_along
from toolpath_stiff.nc.moves import RAPID, Moves

SAGITTA = 5e-7  # m, of chords in place of an arc that is not level in the plane
STRAIGHT, ARC_TURN, NARROW_TURN = 4.0, 0.5 * np.pi, np.pi / 60.0  # longest pieces: radii of the cutter; rad


# A piece of the cutting path; SI. Pieces stand in the order of time.
FIELDS = (
    "before",  # path from the program's start to where the piece begins, rapids included
    "after",  # ... and to where it ends
    "x",  # start of a line, or centre of an arc ...
    "y",
    "z",  # ... at the height of its start
    "turn",  # 0: line; 1, -1: arc counter-clockwise, clockwise
    "heading",  # direction of a line, or where on its circle an arc begins
    "cos",  # of the heading
    "sin",
    "extent",  # length in the plane, m, or turn, rad
    "slope",  # climb per unit of it
    "radius",  # of an arc at its start
    "growth",  # of the radius per rad
    "reach",  # radius of the cutter
    "flat",  # radius of the flat part of its end
)
PIECE = np.dtype([(name, np.float64) for name in FIELDS])


def sweeps_of(moves: Moves, cutters: Mapping[int, Cutter], chosen: BoolArray) -> tuple[AnyArray, IntArray]:
    """The pieces of those chosen (n,) of the moves that cut, and (n + 1,) the first piece of each move.

    Raises `ProgramError` where the tool of one is not known.
    """
    length = move_lengths(moves)
    cuts = chosen & (moves.motion != RAPID) & (length > 0.0)
    unknown = np.flatnonzero(cuts & ~np.isin(moves.tool, list(cutters)))
    if len(unknown):
        mistake = f"tool {moves.tool[unknown[0]]} cuts and its geometry is not known"
        hint = "give it a [[tool]] in the file of --cut"
        raise ProgramError(mistake, hint=hint, line=int(moves.line[unknown[0]]))
    radius, flat = np.zeros(len(moves)), np.zeros(len(moves))
    for tool in np.unique(moves.tool[cuts]).tolist():
        radius[cuts & (moves.tool == tool)] = cutters[tool].radius
        flat[cuts & (moves.tool == tool)] = cutters[tool].radius - cutters[tool].corner_radius
    plane = cuts & (moves.arc_sweep != 0.0) & (np.abs(moves.arc_normal[:, 2]) > 1.0 - 1e-9)
    bent = cuts & (moves.arc_sweep != 0.0) & ~plane
    counts = np.where(cuts, np.maximum(np.ceil(length / (STRAIGHT * np.where(cuts, radius, 1.0)) - 1e-9), 1.0), 0.0)
    arcs = np.flatnonzero(cuts & (moves.arc_sweep != 0.0))
    if len(arcs):
        frame, sweep = arc_frame(moves, arcs), np.abs(moves.arc_sweep[arcs])
        turn = np.where(frame.radius_start < radius[arcs], NARROW_TURN, ARC_TURN)
        turn = np.where(bent[arcs], np.sqrt(8.0 * SAGITTA / frame.radius_start), turn)
        counts[arcs] = np.ceil(sweep / turn - 1e-9)
    first = np.append(0, np.cumsum(counts.astype(np.int64)))
    move, number = numbered(counts.astype(np.int64))
    share = number / counts[move]
    start, end = points_along(moves, move, share)[0], points_along(moves, move, share + 1.0 / counts[move])[0]
    along = end - start
    level = np.hypot(along[:, 0], along[:, 1])
    plunge = level < 1e-9
    pieces = np.zeros(len(move), dtype=PIECE)
    pieces["reach"], pieces["flat"] = radius[move], flat[move]
    pieces["before"] = (np.cumsum(length) - length)[move] + share * length[move]
    pieces["after"] = pieces["before"] + length[move] / counts[move]
    pieces["x"], pieces["y"] = start[:, 0], start[:, 1]
    pieces["z"] = np.where(plunge, np.minimum(start, end)[:, 2], start[:, 2])
    pieces["heading"] = np.arctan2(along[:, 1], along[:, 0])
    pieces["extent"] = np.where(plunge, 0.0, level)
    pieces["slope"] = np.where(plunge, 0.0, along[:, 2] / np.where(plunge, 1.0, level))
    rows = np.flatnonzero(plane[move])
    if len(rows):
        of = move[rows]
        frame, sweep, part = arc_frame(moves, of), moves.arc_sweep[of], np.abs(moves.arc_sweep[of]) / counts[of]
        spoke = start[rows] - frame.center
        pieces["x"][rows], pieces["y"][rows] = frame.center[:, 0], frame.center[:, 1]
        pieces["turn"][rows] = np.sign(sweep * moves.arc_normal[of, 2])
        pieces["heading"][rows] = np.arctan2(spoke[:, 1], spoke[:, 0])
        pieces["extent"][rows], pieces["slope"][rows] = part, along[rows, 2] / part
        pieces["radius"][rows] = np.hypot(spoke[:, 0], spoke[:, 1])
        pieces["growth"][rows] = (frame.radius_end - frame.radius_start) / np.abs(sweep)
    pieces["cos"], pieces["sin"] = np.cos(pieces["heading"]), np.sin(pieces["heading"])
    return pieces, first
