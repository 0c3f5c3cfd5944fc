r"""What the cutter has swept, piece by piece of the path, without a grid: heights left above any point x, y.

A piece is a straight line or an arc in the plane, with a slope. The surface that it leaves above a point is the lowest
height of the cutter's envelope while its axis passes: z0 + m s + p(d(s)) least over s, where p is the profile of the
cutter's end, d(s) the distance of the point from the axis. Level pieces have it at the nearest point of the path; a
flat end at the lower end of the part of the path within its radius; a ball of radius r at a distance
m sqrt((r^2 - d^2) / (1 + m^2)) down the slope from the nearest point (d the distance from the path): a tilted
cylinder. On an arc these lengths are taken along the circle through the point.
"""

from collections.abc import Mapping

import numpy as np

from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray
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


def sweeps_of(moves: Moves, cutters: Mapping[int, Cutter]) -> tuple[AnyArray, IntArray]:
    """The pieces of all cutting moves, and (moves + 1,) the first piece of each move.

    Raises `ProgramError` where the tool is not upright or not known.
    """
    length = move_lengths(moves)
    cuts = (moves.motion != RAPID) & (length > 0.0)
    _refuse(moves, cuts, cutters)
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
    move = np.repeat(np.arange(len(moves)), counts.astype(np.int64))
    share = (np.arange(len(move)) - first[move]) / counts[move]
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


def _refuse(moves: Moves, cuts: BoolArray, cutters: Mapping[int, Cutter]) -> None:
    tilted = cuts & ((moves.start[:, 3:5] != 0.0).any(axis=1) | (moves.end[:, 3:5] != 0.0).any(axis=1))
    unknown = cuts & ~np.isin(moves.tool, list(cutters))
    for rows, text, hint in (
        (tilted, "tilted tools are not supported with --cut yet", "leave --cut out"),
        (unknown, "tool {tool} cuts and its geometry is not known", "give it a [[tool]] in the file of --cut"),
    ):
        if rows.any():
            row = int(np.flatnonzero(rows)[0])
            raise ProgramError(text.format(tool=moves.tool[row]), hint=hint, line=int(moves.line[row]))


def foot(sweeps: AnyArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """(e,) place along the line or circle of a piece that is nearest to a point, the distance, and two more.

    These are the unit of the place, m, at the point, and for arcs its square, else 0.
    """
    dx, dy = x - sweeps["x"], y - sweeps["y"]
    along = dx * sweeps["cos"] + dy * sweeps["sin"]
    beside = np.abs(dx * sweeps["sin"] - dy * sweeps["cos"])
    unit, spoke = np.ones(len(x)), np.zeros(len(x))
    arc = np.flatnonzero(sweeps["turn"])
    if len(arc):
        half, turn = 0.5 * sweeps["extent"][arc], sweeps["turn"][arc]
        angle = turn * (np.arctan2(dy[arc], dx[arc]) - sweeps["heading"][arc])
        along[arc] = (angle - half + np.pi) % (2.0 * np.pi) - np.pi + half
        spoke[arc] = np.hypot(dx[arc], dy[arc])
        radius = sweeps["radius"][arc] + sweeps["growth"][arc] * np.clip(along[arc], 0.0, sweeps["extent"][arc])
        beside[arc] = np.abs(spoke[arc] - radius)
        spoke[arc] *= radius
        unit[arc] = np.sqrt(np.maximum(spoke[arc], 1e-18))
    return along, beside, unit, spoke


def heights_above(sweeps: AnyArray, x: FloatArray, y: FloatArray, slack: FloatArray) -> FloatArray:
    """(e,) m, lowest height of the cutter's envelope above the point of each row; inf: not passed.

    `slack`, m: the cutter is taken for so much smaller and higher.
    """
    along, beside, unit, spoke = foot(sweeps, x, y)
    place = np.clip(along, 0.0, sweeps["extent"])
    shortest = _distance(along, beside, spoke, place)
    reach = sweeps["reach"]
    sloped = np.flatnonzero((sweeps["slope"] != 0.0) & (shortest <= reach))
    if len(sloped):
        part, d, u = sweeps[sloped], beside[sloped], unit[sloped]
        down = _down_slope(part["slope"] / u, d, part["reach"], part["flat"])
        arc = part["turn"] != 0.0
        ratio = np.minimum(down[arc] / (2.0 * u[arc]), 1.0)
        down[arc] = 2.0 * u[arc] * np.arcsin(ratio)  # along the circle, whose chord this is
        place[sloped] = np.clip(along[sloped] - np.sign(part["slope"]) * down / u, 0.0, part["extent"])
    distance = np.minimum(_distance(along, beside, spoke, place), reach)
    height = sweeps["z"] + sweeps["slope"] * place + rise(sweeps, distance) + slack
    return np.where(shortest <= reach - slack, height, np.inf)


def nearest(sweeps: AnyArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(e,) place along each piece that is nearest to the point of its row; m, distance from there."""
    along, beside, _, spoke = foot(sweeps, x, y)
    place = np.clip(along, 0.0, sweeps["extent"])
    return place, _distance(along, beside, spoke, place)


def rise(sweeps: AnyArray, distance: FloatArray) -> FloatArray:
    """(e,) m, height of the cutter's end above its tip at a distance from the axis of up to its radius."""
    corner = sweeps["reach"] - sweeps["flat"]
    return np.asarray(corner - np.sqrt(np.maximum(corner**2 - np.maximum(distance - sweeps["flat"], 0.0) ** 2, 0.0)))


def _distance(along: FloatArray, beside: FloatArray, spoke: FloatArray, place: FloatArray) -> FloatArray:
    """Distance of a point from the axis at a place; `spoke` 0: a line."""
    across = np.where(spoke > 0.0, 4.0 * spoke * np.sin(0.5 * (place - along)) ** 2, (place - along) ** 2)
    return np.asarray(np.sqrt(beside**2 + across))


def _down_slope(slope: FloatArray, beside: FloatArray, reach: FloatArray, flat: FloatArray) -> FloatArray:
    """m, how far down the slope from the nearest point the envelope is lowest: p'(d) u / d = |slope|."""
    slope, corner = np.abs(slope), reach - flat
    down = np.sqrt(np.maximum(reach**2 - beside**2, 0.0) / np.where(flat == 0.0, 1.0 + 1.0 / slope**2, 1.0))
    bull = np.flatnonzero((flat > 0.0) & (corner > 0.0))
    if len(bull):
        d, a, r, m = beside[bull], flat[bull], corner[bull], slope[bull]
        low, high = np.arcsin(np.clip((d - a) / r, 0.0, 1.0)), np.full(len(bull), 0.5 * np.pi)
        for _ in range(24):
            angle = 0.5 * (low + high)
            radius = a + r * np.sin(angle)
            steep = np.tan(angle) * np.sqrt(np.maximum(radius**2 - d**2, 0.0)) > m * radius
            low, high = np.where(steep, low, angle), np.where(steep, angle, high)
        down[bull] = np.sqrt(np.maximum((a + r * np.sin(low)) ** 2 - d**2, 0.0))
    return np.asarray(down)
