"""Campaigns: poses, loads, tools and set-ups measured, and their order.

A `Table` maps column names of measurement files to arrays or lists of one length, in shop units.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.rig.kinematics import reachable
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.units import m_from_mm, rad_from_deg

Table = dict[str, Any]

LAYOUTS = ("paper", "tilted", "campaign")
POSE = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
DEFAULT_SETUP = "table"

# Clinton, Zhang, Wavering (1997), Table 1: x, y in mm, measured at both heights; published.
PAPER_POINTS = ((0, 0), (-150, 0), (-300, 0), (-130, 75), (-260, 150), (-75, 130), (-150, 260))
PAPER_HEIGHTS = ((1268.225, "riser"), (353.225, "table"))  # the upper plane stood on a riser (Figure 6)

# The tilted campaign; every figure is a choice (assumed), with the machine's limits respected.
TILTED_POSES = 24
TILTED_LOADS = (500.0, 4000.0)  # N
TILTED_REPEATS = 2
TILTED_HEIGHTS = (400.0, 600.0, 800.0, 1000.0, 1200.0)  # mm
TILTED_RADIUS = 300.0  # mm
LONG_TOOL = 150.0  # mm longer, at four poses
RISER_EVERY = 3  # each third pose is taken on a riser


def campaign(layout: str, nominal: Nominal, plan: Table | None, rng: Generator) -> Table:
    """Campaign of a layout. Raises `InputError`."""
    if layout not in LAYOUTS:
        raise InputError(f"layout {layout!r}", expected=", ".join(LAYOUTS))
    if (layout == "campaign") != (plan is not None):
        raise InputError("layout campaign and a file of poses go together", expected="both, or neither")
    if plan is not None:
        return dict(plan)
    return paper_campaign() if layout == "paper" else tilted_campaign(nominal, rng)


def _table(rows: Sequence[Sequence[Any]], *columns: str) -> Table:
    """Table of rows that begin with a pose."""
    named = zip((*POSE, *columns), zip(*rows, strict=True), strict=True)
    return {name: list(values) if name in ("direction", "setup") else np.array(values) for name, values in named}


def paper_campaign() -> Table:
    """The paper's 14 points along X, Y, Z: 42 rows in the order of its Table 1."""
    poses = [(x, y, z, setup) for z, setup in PAPER_HEIGHTS for x, y in PAPER_POINTS]
    rows = [
        (x, y, z, 0, 0, 0, axis, setup, number) for number, (x, y, z, setup) in enumerate(poses, 1) for axis in AXES
    ]
    return _table(rows, "direction", "setup", "point")


def tilted_campaign(nominal: Nominal, rng: Generator) -> Table:
    """24 tilted poses, X, Y, Z, two loads, two repeats: 288 rows; poses in random order, each repeat clamped anew."""
    poses = _tilted_poses(nominal, rng)
    visits = [(pose, repeat) for repeat in range(1, TILTED_REPEATS + 1) for pose in rng.permutation(TILTED_POSES)]
    rows = []
    for clamp, (pose, repeat) in enumerate(visits, 1):
        jobs = [(axis, load) for axis in AXES for load in TILTED_LOADS]
        setup = "riser" if pose % RISER_EVERY == 0 else DEFAULT_SETUP
        warm = round(20.0 + 1.5 * np.sin(np.pi * clamp / len(visits)), 1)  # a shop that warms up over the day
        minutes = 0.0
        for job in rng.permutation(len(jobs)):
            # A reading takes half a minute to a minute and a half after the indicator was zeroed.
            minutes = round(minutes + float(rng.uniform(0.5, 1.5)), 1)
            placed = (setup, clamp, repeat, int(pose) + 1, minutes, _extension(int(pose)), warm)
            rows.append((*poses[pose], *jobs[job], *placed))
    columns = "direction force_N setup clamp repeat point time_min tool_extension_mm temperature_C"
    return _table(rows, *columns.split())


def _extension(pose: int) -> float:
    """Extra length, mm, of the tool at a pose: poses 0, 7, 14, 21, two of them on the riser."""
    return LONG_TOOL if pose % 6 == pose // 6 else 0.0


def _tilted_poses(nominal: Nominal, rng: Generator) -> FloatArray:
    """(24, 6) mm and degrees, all reachable, drawn until each height has its share; tilts of 5 to 25 degrees."""
    poses: list[FloatArray] = []
    for _ in range(20_000):
        pose = len(poses)
        if pose == TILTED_POSES:
            return np.array(poses)
        radius, azimuth = TILTED_RADIUS * np.sqrt(rng.random()), rng.uniform(0.0, 2.0 * np.pi)
        tilt, about = rng.uniform(5.0, 25.0), rng.uniform(0.0, 2.0 * np.pi)
        height = TILTED_HEIGHTS[pose % len(TILTED_HEIGHTS)]
        across, tilted = ((r * np.cos(angle), r * np.sin(angle)) for r, angle in ((radius, azimuth), (tilt, about)))
        trial = np.round([*across, height, *tilted, rng.uniform(-10.0, 10.0)], 1)
        extension = np.array([m_from_mm(_extension(pose))])
        if reachable(nominal, m_from_mm(trial[None, :3]), rad_from_deg(trial[None, 3:]), extension)[0]:
            poses.append(trial)
    raise InputError(
        f"machine {nominal.name}: too few reachable tilted poses within {TILTED_RADIUS:g} mm of the axis",
        hint="use layout campaign with poses of your own for this machine",
    )
