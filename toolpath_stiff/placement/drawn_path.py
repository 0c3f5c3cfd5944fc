"""The path as a page draws it.

A page cannot hold every sample of a long program at sixty placements. The ends of every cut and its corners are kept
first, then samples evenly along the path; the stiffness is evaluated at just these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolpath_stiff.analysis.evaluation import evaluate
from toolpath_stiff.analysis.loads import Load, headline_rows, plunging_rows
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.path import Samples, sample_moves
from toolpath_stiff.placement.paths import placed_path
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import rad_from_deg

CORNER = rad_from_deg(10.0)  # a sharper one is kept before samples along straight cuts are
SHARE_OF_CORNERS = 0.6  # at most, of the points drawn


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
