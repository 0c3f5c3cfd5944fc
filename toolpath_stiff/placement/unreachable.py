"""Rules that no placement keeps: anchored rapids are left out of the search, all else is an error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import UnreachableError
from toolpath_stiff.hints import both_names
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import Reach, reach
from toolpath_stiff.path import place_orientations
from toolpath_stiff.placement.evaluator import Evaluator, PlacementFigures
from toolpath_stiff.placement.paths import WorkPath, placed_path
from toolpath_stiff.placement.working import Search
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import mm_from_m, pose_in_mm

SCOUTS_AT_A_TIME = 50  # until one keeps an anchored rapid within reach


@dataclass(frozen=True)
class LeftOutRapid:
    """A rapid that no placement keeps within reach: its line, and what it breaks."""

    line: int
    reason: str


def let_go(search: Search, scouts: FloatArray) -> tuple[PlacementFigures, tuple[LeftOutRapid, ...]]:
    """Drop anchored rapids that no placement keeps within reach where the cuts are.

    Returns the figures of the scouts on few samples, and the lines of these rapids and why.
    """
    few, anchored, margin = search.few, search.path.anchored, search.rules.margin
    groups = [(few.summary(rows), np.minimum(rows.margin - margin, rows.clearance)) for rows in few.groups(scouts)]
    figures, room = PlacementFigures.joined([part for part, _ in groups]), np.concatenate([part for _, part in groups])
    cuts = room[:, : len(few.path)][:, few.path.cutting].min(axis=1, initial=np.inf)
    possible = scouts[cuts >= 0.0] if (cuts >= 0.0).any() else scouts
    gone, left_out = [], []
    for move in np.unique(anchored.move):
        rapid = anchored.take(anchored.move == move)
        alone = search.evaluator(replace(few.path.take(slice(0)), anchored=rapid))
        best, most = _roomiest(search, alone, possible)
        if most < 0.0:
            left_out.append(LeftOutRapid(int(rapid.line[0]), _breaks(search, alone.path, best)))
            gone.append(move)
    if gone:
        search.sample(replace(search.path, anchored=anchored.take(~np.isin(anchored.move, gone))))
        figures = search.few.figures(scouts)
    return figures, tuple(left_out)


def _roomiest(search: Search, evaluator: Evaluator, placements: FloatArray) -> tuple[FloatArray, float]:
    """The first placement that keeps the rules at all samples, else the one that misses them least, and its room."""
    best, most = placements[0], -np.inf
    for start in range(0, len(placements), SCOUTS_AT_A_TIME):
        some = placements[start : start + SCOUTS_AT_A_TIME]
        rows = evaluator.rows(some)
        room = np.minimum(rows.margin - search.rules.margin, rows.clearance).min(axis=1)
        if room.max() > most:
            best, most = some[int(np.argmax(room))], float(room.max())
        if most >= 0.0:
            break
    return best, most


def _breaks(search: Search, rapid: WorkPath, placement: FloatArray) -> str:
    """The rule that the worst sample of an anchored rapid breaks at a placement, in words."""
    position, stand = _stand(search, rapid, placement)
    worst = int(np.argmin(stand.margin))
    if stand.margin[worst] < search.rules.margin:
        return stand.describe(worst)
    boxes = [box.name for box in search.wanted.keepouts if box.clearances(position).min() < 0.0]
    return f"it runs through the keep-out {boxes[0]}" if boxes else "it cannot be kept"


def _stand(search: Search, path: WorkPath, placement: FloatArray) -> tuple[FloatArray, Reach]:
    """(m + q, 3) m of a path at a placement, anchored rapids last, and how these stand to the limits."""
    anchored, machine = path.anchored, search.model.machine
    turn = rotation_matrices(placement[None, 3:])
    position = np.concatenate([placed_path(path, placement)[0], anchored.placed(turn, placement[None, :3])[0]])
    rotation = rotation_matrices(place_orientations(np.concatenate([path.abc, anchored.abc]), placement))
    tools = np.concatenate([path.tool_length, anchored.tool_length])
    return position, reach(machine, position, solve_struts(machine, position, rotation, tools), rotation)


def infeasible(search: Search, placement: FloatArray) -> UnreachableError:
    """The error that names the rule, the line and by how much, at the least bad placement."""
    path, least = search.path, search.rules.margin
    figures = search.whole.figures(placement[None])
    position, stand = _stand(search, path, placement)
    margin = float(min(figures.margin[0], figures.rapid_margin[0]))
    row, hint = int(np.argmin(stand.margin)), "widen the bounds, or cut the part in two set-ups"
    if margin < 0.0:
        fault = f"breaks a limit: {stand.describe(row)}"
    elif figures.clearance[0] < 0.0:
        depths = [box.clearances(position) for box in search.wanted.keepouts]
        deepest = int(np.argmin([depth.min() for depth in depths]))
        row, hint = int(np.argmin(depths[deepest])), "make the keep-out smaller or the bounds wider"
        depth = mm_from_m(-float(depths[deepest][row]))
        fault = f"runs {depth:.1f} mm deep into the keep-out {search.wanted.keepouts[deepest].name}"
    elif margin < least:
        fault = f"has a margin of {100.0 * margin:.2f} % of the limit's span: {stand.describe(row)}"
        hint = f"widen the bounds, or ask for less than {both_names('--margin', f'{100.0 * least:g}')}"
    else:
        room = np.where(path.cutting, search.whole.rows(placement[None]).law[0], np.inf)
        row, hint = int(np.argmin(room)), "widen the bounds, or allow it with --allow-extrapolation"
        fault = (
            f"takes a strut {mm_from_m(-float(room[row])):.3g} mm out of the lengths of its law, as "
            f"{100.0 * figures.extrapolated[0]:.3g} % of the cutting samples do; now "
            f"{100.0 * search.rules.extrapolated:.3g} %"
        )
    x, y, z, _, _, turn = pose_in_mm(placement.tolist())
    line = int(np.concatenate([path.line, path.anchored.line])[row])
    rapid = "" if row < len(path) and path.cutting[row] else "the rapid of "
    return UnreachableError(
        f"no placement is feasible: at the least bad one (X{x:.1f} Y{y:.1f} Z{z:.1f}, turned by {turn:.1f} degrees) "
        f"{rapid}line {line} {fault}",
        hint=hint,
    )
