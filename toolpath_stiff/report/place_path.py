"""The path as drawn on the page of a search for placements.

A page cannot hold every sample of a long program at sixty placements. The ends of every cut and its corners are kept
first, then samples evenly along the path; the stiffness is evaluated at just these.
"""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.analysis.evaluation import evaluate
from toolpath_stiff.analysis.loads import headline_rows, plunging_rows
from toolpath_stiff.arrays import IntArray
from toolpath_stiff.documents import Document, number
from toolpath_stiff.path.sampling import Samples, sample_moves
from toolpath_stiff.placement.paths import placed_path
from toolpath_stiff.placement.result import Placement, PlacementRow
from toolpath_stiff.report.scene import machine_scene
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m, rad_from_deg

POINTS = (150, 800)  # of the path on the page, fewest and most
VALUES = 48_000  # points times placements that the page holds, some 300 kB
ENDS = (0.05, 0.95)  # quantiles of the points drawn at all placements, between which the colours run
CORNER = rad_from_deg(10.0)  # sharper corners are kept in preference to samples along straight cuts
SHARE_OF_CORNERS = 0.6  # largest share of corners among the points drawn


def drawn_path(placed: Placement, rows: Sequence[PlacementRow]) -> tuple[Document, str]:
    """Path in the program's axes with its stiffness at some placements, and words on what is left out."""
    best, samples = placed.best, sample_moves(placed.best.program.moves, placed.best.step)
    counted = samples.cutting & (samples.weight > 0.0)
    cuts = np.flatnonzero(counted if counted.any() else samples.cutting)
    cut = np.unique(np.cumsum(~samples.cutting)[cuts], return_inverse=True)[1]
    chosen = thinned_rows(samples.take(cuts), cut, int(np.clip(VALUES // len(rows), *POINTS)))
    few, cut = samples.take(cuts[chosen]), cut[chosen]
    placements = zip(*(placed_path(few, np.array(row.origin)) for row in rows), strict=True)
    position, tangent, abc = (np.concatenate(parts) for parts in placements)
    tools = np.tile(few.tool_length, len(rows))
    there = evaluate(best.model, position, abc, tangent, tools, best.load, best.force)
    stiffness = n_per_mm_from_n_per_m(there.stiffness.reshape(len(rows), -1))  # nan out of reach
    counting = few.weight > 0.0
    plunge = plunging_rows(best.load, few.tangent, few.abc, counting)
    plunge &= ~headline_rows(counting, plunge)
    about = np.isfinite(stiffness) & ~plunge
    about = about if about.any() else np.isfinite(stiffness)
    low, high = (float(end) for end in np.quantile(stiffness[about], ENDS))  # a few corners would take the contrast
    if high <= low * (1.0 + 1e-6):
        low, high = low * (1.0 - 1e-3), high * (1.0 + 1e-3)
    digits = max(0, 5 - int(np.log10(max(float(stiffness[about].max()), 1.0))))  # six digits
    rounded, axis = np.round(stiffness, digits), rotation_matrices(few.abc)[:, :, 2]
    values = (rounded if digits else np.nan_to_num(rounded).astype(np.int64)).tolist()
    for row, column in np.argwhere(np.isnan(stiffness)):
        values[row][column] = None
    data = {
        "machine": machine_scene(best.machine, np.concatenate([position, abc], axis=1)),
        "position": np.round(mm_from_m(few.position), 3).tolist(),
        "axis": np.round(axis, 5).tolist() if (axis[:, 2] < 1.0 - 1e-12).any() else None,
        "s": np.round(mm_from_m(few.s), 2).tolist(),
        "cut": cut.tolist(),
        "plunge": plunge.tolist() if plunge.any() else None,
        "stiffness": values,
        "scale": [low, high],
        "beyond": [bool(np.nanmin(stiffness) < low), bool(np.nanmax(stiffness) > high)],
    }
    colours = f" Colours span the middle {100.0 * (ENDS[1] - ENDS[0]):.0f} % of these points at all placements"
    colours += ", plunges left out." if plunge.any() else "."
    if len(few) == len(cuts):
        return data, f"All {number(len(few))} samples of the cutting path are drawn.{colours}"
    return data, (
        f"Drawn are {number(len(few))} of the {number(len(cuts))} samples of the cutting path, joined by straight "
        "lines, each with the stiffness that was evaluated there; the figures in the table are of all samples."
        f"{colours}"
    )


def thinned_rows(samples: Samples, cut: IntArray, points: int) -> IntArray:
    """Rows of at most `points` samples, ascending: ends of cuts, then corners, then evenly along the path.

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
    kept = np.unique(np.concatenate([kept, corners, corners + 1]))  # both samples of a corner, as the tangent jumps
    return np.sort(np.concatenate([kept, _evenly(np.setdiff1d(np.arange(n), kept), points - len(kept))]))


def _evenly(rows: IntArray, count: int) -> IntArray:
    """`count` of the rows, evenly spread; all if there are no more."""
    if len(rows) <= count:
        return rows
    return rows[np.linspace(0, len(rows) - 1, max(count, 0)).astype(np.int64)]
