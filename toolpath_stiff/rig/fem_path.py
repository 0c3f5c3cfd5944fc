"""Poses at which machines of finite elements are calibrated, and poses at which the truth states their stiffness."""

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.rig.campaigns import POSE
from toolpath_stiff.rig.closure import ClosureError
from toolpath_stiff.rig.fem_parts import mean_radius
from toolpath_stiff.rig.hidden import HiddenMachine, posed
from toolpath_stiff.rig.kinematics import reachable
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

REFERENCE_POSES = 24  # of the calibration
NEAR, BEYOND = 24, 12  # poses of a path amid those measured, and beyond them
MOST_DRAWS = 4000  # of poses, until so many can be reached


def pulled(position: FloatArray, angles: FloatArray) -> Rows:
    """Rows of 1000 N along X, Y and Z at each of n poses, with the reference tool on the table."""
    n = 3 * len(position)
    position, angles = np.repeat(position, 3, axis=0), np.repeat(angles, 3, axis=0)
    force, still = np.full(n, 1000.0), np.zeros(n)
    return Rows(position, angles, np.tile(np.eye(3), (n // 3, 1)), force, still, still, still, np.array(["table"] * n))


def reference_rows(nominal: Nominal) -> Rows:
    """Poses of the calibration: three heights, around the axis, upright and tilted; loads along X, Y, Z."""
    size, number = mean_radius(nominal.platform_joints), np.arange(REFERENCE_POSES)
    turn = 2.4 * number  # rad, the golden angle: shares no symmetry with the machine
    radius = size * np.sqrt((number + 0.5) / REFERENCE_POSES)
    height = nominal.neutral_pose[2] + 1.3 * size * (number % 3 - 1.0)
    tilt = np.radians(15.0) * (number % 2)
    angles = np.column_stack([tilt * np.cos(3.0 * turn), tilt * np.sin(3.0 * turn), 0.0 * turn])
    return pulled(np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height]), angles)


def path_truth(nominal: Nominal, machine: HiddenMachine, rows: Rows, rng: Generator) -> Document:
    """True stiffness along X, Y, Z at poses amid those of the rows, and beyond: columns in shop units.

    `measured_near` is false of a pose beyond: further from the middle of the measured ones, 1.2 to 1.8 times.
    """
    measured = np.unique(np.column_stack([rows.position, rows.angles]), axis=0)
    middle, poses = measured.mean(axis=0), list[FloatArray]()
    for _ in range(MOST_DRAWS):
        if len(poses) == NEAR + BEYOND:
            break
        some = measured[rng.integers(len(measured), size=2)] - middle
        amid, far = rng.uniform(0.3, 0.9) * some.mean(axis=0), rng.uniform(1.2, 1.8) * some[0]
        pose = (middle + (amid if len(poses) < NEAR else far)).round(6)
        if reachable(nominal, pose[None, :3], pose[None, 3:], np.zeros(1))[0] and _taken(nominal, machine, pose):
            poses.append(pose)
    drawn = np.array(poses).reshape(-1, len(POSE))
    true = machine.stiffness(nominal, pulled(drawn[:, :3], drawn[:, 3:])).reshape(-1, 3)
    columns = (mm_from_m(drawn[:, :3]), deg_from_rad(drawn[:, 3:]), n_per_mm_from_n_per_m(true).round(1))
    names = (*POSE, *(f"{axis}_N_per_mm" for axis in "xyz"))
    path = dict(zip(names, np.column_stack(columns).round(6).T.tolist(), strict=True))
    return {**path, "measured_near": [k < NEAR for k in range(len(drawn))]}


def _taken(nominal: Nominal, machine: HiddenMachine, pose: FloatArray) -> bool:
    """True if the true machine can take a pose (6,) that the nominal one reaches."""
    try:
        posed(nominal, machine, pulled(pose[None, :3], pose[None, 3:]))
    except ClosureError:
        return False
    return True
