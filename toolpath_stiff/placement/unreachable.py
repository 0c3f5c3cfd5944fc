"""Rules that no placement keeps: anchored rapids are left out of the search, all else is an error."""

from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import UnreachableError
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import reach
from toolpath_stiff.path.placing import place_orientations
from toolpath_stiff.placement.evaluator import PlacementFigures
from toolpath_stiff.placement.paths import placed_path
from toolpath_stiff.placement.working import Search
from toolpath_stiff.poses import pose_in_mm
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import mm_from_m

SCOUTS_AT_A_TIME = 50  # until one keeps an anchored rapid within reach


def let_go(search: Search, scouts: FloatArray) -> PlacementFigures:
    """Drop anchored rapids that no placement keeps within reach where the cuts are.

    Returns the figures of the scouts on few samples.
    """
    few, anchored, margin = search.few, search.path.anchored, search.rules.margin
    groups = [(few.summary(rows), np.minimum(rows.margin - margin, rows.clearance)) for rows in few.groups(scouts)]
    figures, room = PlacementFigures.joined([part for part, _ in groups]), np.concatenate([part for _, part in groups])
    cuts = room[:, : len(few.path)][:, few.path.cutting].min(axis=1, initial=np.inf)
    possible = scouts[cuts >= 0.0] if (cuts >= 0.0).any() else scouts
    gone = []
    for move in np.unique(anchored.move):
        rapid = anchored.take(anchored.move == move)
        alone = search.evaluator(replace(few.path.take(slice(0)), anchored=rapid))
        parts = (
            alone.rows(possible[start : start + SCOUTS_AT_A_TIME])
            for start in range(0, len(possible), SCOUTS_AT_A_TIME)
        )
        if not any((np.minimum(rows.margin - margin, rows.clearance).min(axis=1) >= 0.0).any() for rows in parts):
            gone.append(move)
    if not gone:
        return figures
    left_out = np.isin(anchored.move, gone)
    search.left_out += tuple(dict.fromkeys(anchored.line[left_out].tolist()))
    search.sample(replace(search.path, anchored=anchored.take(~left_out)))
    return search.few.figures(scouts)


def infeasible(search: Search, placement: FloatArray) -> UnreachableError:
    """The error that names the rule, the line and by how much, at the least bad placement."""
    path, anchored, machine = search.path, search.path.anchored, search.model.machine
    turn = rotation_matrices(placement[None, 3:])
    position = np.concatenate([placed_path(path, placement)[0], anchored.placed(turn, placement[None, :3])[0]])
    rotation = rotation_matrices(place_orientations(np.concatenate([path.abc, anchored.abc]), placement))
    tools = np.concatenate([path.tool_length, anchored.tool_length])
    limits = reach(machine, position, solve_struts(machine, position, rotation, tools), rotation)
    figures, row = search.whole.figures(placement[None]), int(np.argmin(limits.margin))
    margin, least = float(min(figures.margin[0], figures.rapid_margin[0])), search.rules.margin
    hint = "widen the bounds, or cut the part in two set-ups"
    if margin < 0.0:
        fault = f"breaks a limit: {limits.describe(row)}"
    elif figures.clearance[0] < 0.0:
        depths = np.array([-box.clearances(position) for box in search.wanted.keepouts])
        deepest, row = divmod(int(depths.argmax()), len(position))
        depth = mm_from_m(float(depths[deepest, row]))
        fault = f"runs {depth:.1f} mm deep into the keep-out {search.wanted.keepouts[deepest].name}"
    elif margin < least:
        fault = f"has a margin of {100.0 * margin:.2f} % of the limit's span: {limits.describe(row)}"
        hint = f"widen the bounds, or ask for less than --margin {100.0 * least:g}"
    else:
        room = np.where(path.cutting, search.whole.rows(placement[None]).law[0], np.inf)
        row, hint = int(np.argmin(room)), "widen the bounds, or allow it with --allow-extrapolation"
        fault = f"takes a strut {mm_from_m(-float(room[row])):.3g} mm out of the lengths of its law"
    x, y, z, _, _, turned = pose_in_mm(placement.tolist())
    line = int(np.concatenate([path.line, anchored.line])[row])
    rapid = "" if row < len(path) and path.cutting[row] else "the rapid of "
    return UnreachableError(
        f"no placement is feasible: at the least bad one (X{x:.1f} Y{y:.1f} Z{z:.1f}, turned by {turned:.1f} degrees) "
        f"{rapid}line {line} {fault}",
        hint=hint,
    )
