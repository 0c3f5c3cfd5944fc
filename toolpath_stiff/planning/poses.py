"""Poses that a plan may ask for: reachable, in round figures."""

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import reach
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.planning.menu import Menu
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import RAD_PER_DEG

MARGIN = 0.02  # share of each limit's span that planned poses keep clear of it; assumed
ROUND, ROUND_ANGLE = 5e-3, 0.5 * RAD_PER_DEG  # planned poses are round figures, which a person keys in
UPRIGHT_SHARE = 0.25  # share of the poses with a vertical spindle
STEEP_SHARE = 0.5  # share of the others with the largest tilt


def draw_poses(machine: Hexapod, menu: Menu, count: int, rng: Generator) -> FloatArray:
    """(m, 6) round, reachable poses with the reference tool, m <= count; a quarter of them with a vertical spindle."""
    levels = np.array(menu.heights or axis_levels(machine))
    drawn: list[FloatArray] = []
    for batch in range(8):
        m = count
        radius, azimuth = menu.radius * np.sqrt(rng.random(m)), rng.uniform(0.0, 2.0 * np.pi, m)
        # The largest tilts mostly tell the most.
        tilt, about = menu.max_tilt * np.sqrt(rng.uniform(0.16, 1.0, m)), rng.uniform(0.0, 2.0 * np.pi, m)
        tilt[rng.random(m) < STEEP_SHARE] = menu.max_tilt
        tilt[rng.random(m) < UPRIGHT_SHARE] = 0.0
        position = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), rng.choice(levels, m)], axis=1)
        # Toward zero: rounding never tilts further than allowed.
        angles = np.stack([tilt * np.cos(about), tilt * np.sin(about), np.zeros(m)], axis=1)
        angles = np.trunc(angles / ROUND_ANGLE + 1e-9 * np.sign(angles)) * ROUND_ANGLE
        position[:, :2] = np.trunc(position[:, :2] / ROUND) * ROUND
        poses = np.concatenate([position, angles], axis=1) + 0.0
        if batch == 0:
            poses[: len(levels)] = np.stack([np.array([0.0, 0.0, z, 0.0, 0.0, 0.0]) for z in levels])[:m]
        drawn += list(poses[reachable(machine, poses, 0.0)])
        if len(drawn) >= count:
            break
    return np.array(drawn[:count]).reshape(-1, 6)


def axis_levels(machine: Hexapod, count: int = 5) -> tuple[float, ...]:
    """Heights in m, from the lowest to the highest that the tip reaches on the axis, a tenth of the way from each end.

    The machine's axis is its base frame's Z.
    """
    low, high = machine.limits.workspace[:, 2]
    if not np.isfinite(high - low):
        middle, size = machine.limits.neutral_pose[2], float(np.ptp(machine.frame_joints[:, 2]))
        size = max(size, 0.2 * float(np.abs(machine.frame_joints[:, :2]).max()))
        low, high = middle - size, middle + size
    tries = np.linspace(low, high, 200)
    poses = np.zeros((len(tries), 6))
    poses[:, 2] = tries
    good = tries[reachable(machine, poses, 0.0)]
    if not len(good):
        raise InputError(
            f"machine {machine.name} reaches no pose on its axis with a vertical spindle",
            hint="give the heights of the plan",
        )
    ends = good[0] + 0.1 * np.ptp(good), good[-1] - 0.1 * np.ptp(good)
    return tuple((np.round(np.linspace(*ends, count) / (2.0 * ROUND)) * 2.0 * ROUND).tolist())


def reachable(machine: Hexapod, pose: FloatArray, tool_extension: float, margin: float = MARGIN) -> BoolArray:
    """(n,) whether the machine takes poses (n, 6) with such a tool, clear of its limits and of a strut law at zero."""
    rotation = rotation_matrices(pose[:, 3:])
    struts = solve_struts(machine, pose[:, :3], rotation, machine.reference_tool_length + tool_extension)
    stiff = (machine.strut_law.stiffness(struts.lengths) > 0.0).all(axis=1)
    return np.asarray(stiff & (reach(machine, pose[:, :3], struts, rotation).margin >= margin))


def images(pose: FloatArray) -> FloatArray:
    """(3, 6) a vertical pose (6,) and its images turned by 120 and 240 degrees about the machine's axis."""
    turned = np.repeat(pose[None], 3, axis=0)
    for k, angle in enumerate((0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0)):
        c, s = np.cos(angle), np.sin(angle)
        turned[k, :2] = c * pose[0] - s * pose[1], s * pose[0] + c * pose[1]
    return turned
