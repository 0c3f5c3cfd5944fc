"""A machine without a program: stiffness at single poses and over planes of the workspace."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.analysis.grid import StiffnessMap
from toolpath_stiff.analysis.grid import map_stiffness as evaluate_grid
from toolpath_stiff.analysis.loads import parse_load
from toolpath_stiff.analysis.poses import POSE_COLUMNS, PoseStiffness, evaluate_poses
from toolpath_stiff.api.inputs import FARTHEST_MM, Force
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.defaults import FORCE
from toolpath_stiff.errors import InputError, InputErrors, UnreachableError
from toolpath_stiff.hints import command_line
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.options import Option, checked, finite_number, low_high, numbers
from toolpath_stiff.poses import pose_in_mm
from toolpath_stiff.results import Progress, counter
from toolpath_stiff.tables import Columns, read_table
from toolpath_stiff.toml_reader import shortened
from toolpath_stiff.units import m_from_mm, rad_from_deg

MOST_POINTS = 2001  # along a side of a map


def read_poses(file: str | Path) -> tuple[FloatArray, tuple[str, ...]]:
    r"""Poses (n, 6) in mm and degrees from a table (CSV, or FILE.xlsx[#SHEET]), and notes on the reading.

    Columns x_mm, y_mm, z_mm and, if there, a_deg, b_deg, c_deg.

    Raises
    ------
    InputError, InputErrors
        There is no row; every row that is no pose within reason.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "poses.csv")
    ...     _ = file.write_text("x_mm,y_mm,z_mm,a_deg\n0,0,800,0\n100,0,800,10\n")
    ...     poses, notes = tps.read_poses(file)
    >>> poses.shape, poses[1].tolist(), notes
    ((2, 6), [100.0, 0.0, 800.0, 10.0, 0.0, 0.0], ())
    """
    name = str(file)
    table = read_table(name, "poses", Columns(POSE_COLUMNS))
    expected = f"numbers within +-{FARTHEST_MM:g}: {', '.join(POSE_COLUMNS[:3])}, and angles or none"
    poses, errors = np.zeros((len(table.rows), len(POSE_COLUMNS))), []
    for pose, (line, cells) in zip(poses, table.rows, strict=True):
        row = {**dict.fromkeys(POSE_COLUMNS[3:], "0"), **dict(zip(table.heading, cells, strict=False))}
        try:
            pose[:] = [float(row[column]) for column in POSE_COLUMNS]
        except (KeyError, ValueError):
            pose[:] = np.nan
        if not (np.abs(pose) <= FARTHEST_MM).all():
            errors.append(InputError(f"pose {', '.join(cells)}", expected=expected, file=name, line=line))
    if errors:
        raise InputErrors(errors)
    if not len(poses):
        raise InputError("no poses", expected=f"rows below the heading ({','.join(POSE_COLUMNS)})", file=name)
    return poses, tuple(table.notes)


@checked
def pose(pose_mm_deg: ArrayLike, machine: Machine | str | Path = "nist", *, force_N: Force = FORCE) -> PoseStiffness:
    """Stiffness at a pose, or at many.

    Parameters
    ----------
    pose_mm_deg
        (3,) or (6,): X, Y, Z of the tool tip in mm, roll A, pitch B, yaw C in degrees, R = Rz(C) Ry(B) Rx(A); or
        (n, 3) or (n, 6) of these.
    machine
        A machine, its name or its file.
    force_N
        Size of the load, for effects that depend on it.

    Raises
    ------
    UnreachableError
        A single pose that the machine cannot take; of several, these have nan.
    InputError
        A pose of another shape or beyond reason.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.pose((-300, 300, 300, -30, 0, 0), "nist")
    >>> round(found.to_dict()["kz_N_per_mm"])
    18919
    >>> tps.pose([(0, 0, 800), (0, 0, 5000)], "nist").reachable.tolist()
    [True, False]
    """
    on = machine_from(machine)
    try:
        given = np.asarray(pose_mm_deg, dtype=float)
    except (TypeError, ValueError):
        given = np.zeros(0)
    shaped = given.ndim in (1, 2) and given.shape[-1] in (3, 6)
    if not shaped or not np.abs(given).max(initial=0.0) <= FARTHEST_MM:
        expected = f"X Y Z or X Y Z A B C, numbers within +-{FARTHEST_MM:g}"
        raise InputError(f"a pose {shortened(pose_mm_deg)}", expected=expected)
    single, rows = given.ndim == 1, np.atleast_2d(given)
    poses = np.concatenate([rows, np.zeros((len(rows), 6 - rows.shape[1]))], axis=1)
    stiffness = evaluate_poses(on.running(), m_from_mm(poses[:, :3]), rad_from_deg(poses[:, 3:]), force=force_N)
    stiffness = replace(stiffness, pose_mm_deg=poses, single=single)
    if single and not stiffness.reach.reachable[0]:
        mistake = f"the pose is out of reach on machine {on.name}: {stiffness.reach.describe(0)}"
        raise UnreachableError(mistake, hint=f"`{command_line('machine', 'show', on.asked)}` lists the limits")
    return stiffness


def _angles(text: str) -> tuple[float, ...]:
    """Angles from `A,B,C` in degrees."""
    angles = numbers(text)
    if len(angles) != 3 or max(map(abs, angles)) > 180.0:
        raise ValueError("A,B,C in degrees, within +-180")
    return angles


@checked
def map_stiffness(
    machine: Machine | str | Path,
    *,
    x_mm: Annotated[tuple[float, float] | None, Option("--x", "LO:HI", read=low_high)] = None,
    y_mm: Annotated[tuple[float, float] | None, Option("--y", "LO:HI", read=low_high)] = None,
    z_mm: Annotated[float | Sequence[float] | None, Option("--z", "MM", read=finite_number)] = None,
    load: Annotated[str, Option("--load", "DIRECTION")] = "radial",
    tilt_deg: Annotated[tuple[float, float, float], Option("--tilt", "A,B,C", read=_angles)] = (0.0, 0.0, 0.0),
    points: Annotated[int, Option("--points", at_least=2, at_most=MOST_POINTS)] = 61,
    force_N: Force = FORCE,
    progress: Progress | None = None,
) -> StiffnessMap:
    """Stiffness over one or several horizontal planes.

    Parameters
    ----------
    machine
        A machine, its name or its file.
    x_mm, y_mm
        Extent of the planes (low, high); unless given, 150 mm to either side of the default origin, for hexapods of the
        axis.
    z_mm
        Height, or heights; unless given, that of the default origin, for hexapods 1200 mm.
    load
        Direction of the load: radial, axial, softest, x, y, z or "DX,DY,DZ".
    tilt_deg
        Roll, pitch, yaw of the platform.
    points
        Grid points along the longer side.
    force_N
        Size of the load, for effects that depend on it.
    progress
        Called with what is being done, poses done, poses in all.

    Raises
    ------
    InputError
        The load needs a path, or a plane has no extent.
    UnreachableError
        Nothing of the planes can be reached.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.map_stiffness("nist", z_mm=1200, points=21)
    >>> found
    <StiffnessMap: nist, load radial, 441 points>
    >>> round(found.to_dict()["slices"][0]["softest"]["stiffness_N_per_mm"])
    55242
    """
    on = machine_from(machine)
    paper, stated = (0.0, 0.0, 1200.0), on.stated  # of its Figures 8 and 9
    middle = paper if isinstance(stated, Hexapod) else pose_in_mm(stated.default_origin)
    x_mm, y_mm = x_mm or (middle[0] - 150.0, middle[0] + 150.0), y_mm or (middle[1] - 150.0, middle[1] + 150.0)
    z_mm = middle[2] if z_mm is None else z_mm
    heights = sorted([float(z_mm)] if isinstance(z_mm, int | float) else [float(z) for z in z_mm])
    if len(set(heights)) < len(heights):
        raise InputError(f"heights {heights}: one appears twice", expected="each height once")
    if not max(abs(v) for v in (*x_mm, *y_mm, *heights)) <= FARTHEST_MM:
        raise InputError("a map beyond 100 m", expected="mm")
    a, b, c = (rad_from_deg(float(v)) for v in tilt_deg)
    x, y = ((m_from_mm(float(low)), m_from_mm(float(high))) for low, high in (x_mm, y_mm))
    levels, tell = [m_from_mm(z) for z in heights], counter(progress, "map: poses")
    grid = evaluate_grid(on.running(), x, y, levels, parse_load(load), points, (a, b, c), force_N, tell)
    return replace(grid, inputs=on.inputs)
