"""Joint values of chains without a closed form: Newton's method from many starts, followed from pose to pose."""

from collections.abc import Callable, Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.chain import ChainJoint, Frame
from toolpath_stiff.machine.joint_values import TURN, joint_margin, wound
from toolpath_stiff.machine.newton import newton

STARTS = 96  # over the joints' ranges; of a general six-joint arm, which has up to 16 solutions, few are missed
LARGEST_STEP = 0.5  # rad and m
MOST_SEARCHES = 8  # most poses from which a lost path is searched anew
SAME = 1e-6  # rad and m within which solutions count as one
Frames = Callable[[FloatArray], Sequence[Frame]]


def all_solutions(joints: Sequence[ChainJoint], frames: Frames, tip: FloatArray, axes: FloatArray) -> FloatArray:
    """(s, j) solutions for one tip (3,) with axes (3, 3), in base axes, those farthest from the limits first.

    `frames` gives base, joints and tip at joint values (j, n). Those within the limits if there are any.
    """
    from scipy.stats import qmc  # Halton, Numerische Mathematik 2 (1960)

    limits = np.array([(joint.low, joint.high) for joint in joints])
    ranges = np.clip(limits, -0.5 * TURN, 0.5 * TURN)
    starts = ranges[:, 0] + qmc.Halton(len(joints), scramble=False).random(STARTS) * (ranges[:, 1] - ranges[:, 0])
    poses = np.repeat(tip[:, None], STARTS, 1), np.repeat(axes[..., None], STARTS, 2)
    values = solve_from(joints, frames, *poses, starts)
    values = wound(values.T, limits, [joint.linear for joint in joints], None)
    margin = joint_margin(values, limits)
    solutions: list[FloatArray] = []
    for i in np.argsort(-margin, kind="stable"):
        apart = [np.abs(values[:, i] - other).max() for other in solutions]
        if np.isfinite(margin[i]) and (margin[i] >= 0.0 or not solutions) and min(apart, default=1.0) > SAME:
            solutions.append(values[:, i])
    return np.array(solutions).reshape(-1, len(joints))


def solve_from(
    joints: Sequence[ChainJoint], frames: Frames, tip: FloatArray, axes: FloatArray, start: FloatArray
) -> FloatArray:
    """(n, j) joint values near a start (n, j) for tips (3, n) with axes (3, 3, n) in base axes; nan if none."""

    def equations(values: FloatArray) -> tuple[FloatArray, FloatArray]:
        stand = frames(values.T)
        end = stand[-1]
        turned = 0.5 * np.cross(axes, end.axes, axis=0).sum(axis=1)  # sine of the angle from the target, times the axis
        columns = []
        for joint, frame in zip(joints, stand[1:-1], strict=True):
            z = np.broadcast_to(frame.axes[:, 2], tip.shape)
            columns.append([z, 0.0 * z] if joint.linear else [np.cross(z, end.origin - frame.origin, axis=0), z])
        slopes = np.array(columns).transpose(3, 1, 2, 0).reshape(tip.shape[1], 6, len(joints))
        return np.concatenate([end.origin - tip, turned]).T, slopes

    values = newton(equations, start, LARGEST_STEP)
    end = frames(values.T)[-1]
    # The sine also vanishes half a turn away.
    same = np.nan_to_num((axes * end.axes).sum(axis=(0, 1))) > 2.0
    return np.where(same[:, None], values, np.nan)


def follow(
    joints: Sequence[ChainJoint], frames: Frames, tip: FloatArray, axes: FloatArray, start: FloatArray | None
) -> FloatArray:
    """(n, j) joint values over poses, from a start (j,) or the best solution of the first pose with one."""
    n = tip.shape[1]
    values = np.full((n, len(joints)), np.nan)
    tried = np.zeros(n, dtype=bool)
    for _ in range(MOST_SEARCHES):
        lost = np.flatnonzero(np.isnan(values[:, 0]) & ~tried)
        if not len(lost):
            break
        best = all_solutions(joints, frames, tip[:, lost[0]], axes[..., lost[0]]) if start is None else start[None]
        seeds = best[:1]
        tried[lost[0]], start = True, None
        while len(seeds) and len(lost):
            starts = np.broadcast_to(seeds, (len(lost), len(joints)))
            values[lost] = solve_from(joints, frames, tip[:, lost], axes[..., lost], starts)
            solved = np.flatnonzero(np.isfinite(values[:, 0]))
            missing = np.flatnonzero(np.isnan(values[:, 0]))
            if not len(solved) or len(missing) in (0, len(lost)):
                break
            # If the step from one pose was too long, continue from the next pose that is solved.
            lost, seeds = missing, values[solved[np.searchsorted(solved, missing).clip(max=len(solved) - 1)]]
    return values
