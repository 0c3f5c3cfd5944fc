"""A machine by itself: stiffness at single poses and over planes of the workspace."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from toolpath_stiff.api.inputs import FARTHEST_MM, STRONGEST_N, positive, whole
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.defaults import FORCE
from toolpath_stiff.errors import InputError, InputErrors, UnreachableError
from toolpath_stiff.files import Content
from toolpath_stiff.hints import command_line
from toolpath_stiff.results import FolderResult, Progress, Result, counter
from toolpath_stiff.toml_reader import shortened
from toolpath_stiff.units import m_from_mm, rad_from_deg

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from toolpath_stiff.analysis.poses import PoseReport
    from toolpath_stiff.analysis.poses import StiffnessMap as StiffnessGrid
    from toolpath_stiff.arrays import FloatArray
    from toolpath_stiff.stiffness.model import StiffnessModel

FARTHEST = FARTHEST_MM  # mm and degrees of a pose
MOST_POINTS = 2001  # along a side of a map


class PoseStiffness(Result):
    """Stiffness at poses: along X, Y, Z, in the softest and the stiffest direction, with strut lengths and margins.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.pose("nist", [(0, 0, 800), (0, 0, 5000)])
    >>> found
    <PoseStiffness: 2 poses of nist, 1 within reach>
    >>> found.reachable.tolist(), found.warnings
    ([True, False], [])
    >>> found.out_of_reach(3)
    ['row 2: out of reach: frame joint2 angle needs 97.97 deg, limit 30.00 deg, 67.97 deg beyond']
    >>> found.to_frame()["kz_N_per_mm"].round().tolist()
    [123723.0, nan]
    >>> found.csv().splitlines()[0][:30]
    'x_mm,y_mm,z_mm,a_deg,b_deg,c_d'
    """

    command: ClassVar[str] = "pose"

    def __init__(self, model: StiffnessModel, poses: Any, found: PoseReport, *, single: bool) -> None:
        from toolpath_stiff.report.machine import pose_columns

        self.model, self.poses, self.found, self._single = model, poses, found, single
        self.columns = pose_columns(poses, found)

    @property
    def reachable(self) -> Any:
        """(n,) whether the machine can take the pose."""
        return self.found.reach.reachable

    @property
    def warnings(self) -> list[str]:
        """Effects that do not act here, for want of a set-up, a temperature or a tool."""
        from toolpath_stiff.stiffness.model import condition_warnings

        return condition_warnings(self.model)

    def out_of_reach(self, most: int) -> list[str]:
        """Which poses the machine cannot take and why: so many by name, how many more."""
        rows = (~self.reachable).nonzero()[0]
        said = [f"row {i + 1}: out of reach: {self.found.reach.describe(i)}" for i in rows[:most]]
        return said + ([f"{len(rows) - most} more rows are out of reach"] if len(rows) > most else [])

    def to_frame(self) -> pd.DataFrame:
        """One row a pose, the columns of `tps pose --csv`."""
        import pandas as pd

        return pd.DataFrame(self.columns)

    def to_dict(self) -> dict[str, Any]:
        """Of a single pose its figures; of several, a list of them under "poses", null where out of reach."""
        from toolpath_stiff.stiffness.model import effects_stated

        about = {"machine": self.model.machine.name, **effects_stated(self.model), "warnings": self.warnings}
        rows = [_plain(row) for row in self.to_frame().to_dict("records")]
        return {**about, **rows[0]} if self._single else {**about, "poses": rows}

    def csv(self) -> str:
        """The table as the command writes it."""
        from toolpath_stiff.report.machine import pose_csv

        return pose_csv(self.poses, self.found)

    def __str__(self) -> str:
        from toolpath_stiff.report.machine import pose_text

        if not self._single:
            return self.csv().rstrip("\n")
        return pose_text(self.model, {name: column[0] for name, column in self.columns.items()}, self.found)

    def _short(self) -> str:
        name = self.model.machine.name
        if not self._single:
            return f"{len(self.reachable)} poses of {name}, {int(self.reachable.sum())} within reach"
        soft, stiff = (f"{self.columns[f'{which}_N_per_mm'][0]:.0f}" for which in ("softest", "stiffest"))
        return f"{name}, {soft} N/mm along the softest direction, {stiff} along the stiffest"


def read_poses(file: str | Path) -> tuple[FloatArray, tuple[str, ...]]:
    r"""Poses (n, 6) in mm and degrees from a table (CSV, or FILE.xlsx[#SHEET]), and what is to be said of the reading.

    Columns x_mm, y_mm, z_mm and, if there, a_deg, b_deg, c_deg.

    Raises
    ------
    InputError, InputErrors
        A column is missing, there is no row; every cell that is no number within reason.

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
    import numpy as np

    from toolpath_stiff.report.machine import POSE_COLUMNS
    from toolpath_stiff.tables import Columns, read_table

    name = str(file)
    table = read_table(name, "poses", Columns(POSE_COLUMNS))
    missing = [column for column in POSE_COLUMNS[:3] if column not in table.heading]
    if missing:
        raise InputError(
            f"column {missing[0]} is missing (found {', '.join(table.heading)})",
            expected=", ".join(POSE_COLUMNS[:3]),
            file=name,
            line=table.heading_line,
        )
    if not table.rows:
        raise InputError("no poses", expected=f"rows below the heading ({','.join(POSE_COLUMNS)})", file=name)
    columns = [(i, table.heading.index(c), c) for i, c in enumerate(POSE_COLUMNS) if c in table.heading]
    poses, errors = np.zeros((len(table.rows), 6)), []
    for row, (line, cells) in enumerate(table.rows):
        for i, at, column in columns:
            text = cells[at] if at < len(cells) else ""
            try:
                poses[row, i] = _coordinate(text)
            except ValueError:
                expected = f"a number within +-{FARTHEST:g}"
                errors.append(InputError(f"row {row + 1}, {column}: {text!r}", expected=expected, file=name, line=line))
    if errors:
        raise InputErrors(errors)
    return poses, tuple(table.notes)


def _coordinate(text: str) -> float:
    """A finite number within reason. Raises `ValueError`."""
    value = float(text)
    if not abs(value) <= FARTHEST:
        raise ValueError(text)
    return value


def _plain(row: dict[Any, Any]) -> dict[str, Any]:
    """A row for JSON: None for nan, Python's own numbers."""
    plain = {name: value.item() if hasattr(value, "item") else value for name, value in row.items()}
    found = {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in plain.items()}
    return {**found, "extrapolated": bool(found["extrapolated"])}


def pose(
    machine: Machine | str | Path,
    pose_mm_deg: ArrayLike,
    *,
    force_N: float = FORCE,
) -> PoseStiffness:
    """Stiffness at a pose, or at many.

    Parameters
    ----------
    machine
        A machine, its name or its file.
    pose_mm_deg
        (3,) or (6,): X, Y, Z of the tool tip in mm, roll A, pitch B, yaw C in degrees, R = Rz(C) Ry(B) Rx(A); or
        (n, 3) or (n, 6) of these.
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
    >>> found = tps.pose("nist", (-300, 300, 300, -30, 0, 0))
    >>> round(found.to_dict()["kz_N_per_mm"])
    18919
    >>> tps.pose("nist", [(0, 0, 800), (0, 0, 5000)]).reachable.tolist()
    [True, False]
    """
    import numpy as np

    from toolpath_stiff.analysis.poses import evaluate_poses

    on = machine_from(machine)
    try:
        given = np.asarray(pose_mm_deg, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"a pose {shortened(pose_mm_deg)}", expected="numbers X Y Z or X Y Z A B C") from error
    if given.ndim not in (1, 2) or given.shape[-1] not in (3, 6):
        count = f"of {given.shape[0]} numbers" if given.ndim == 1 else f"of shape {given.shape}"
        raise InputError(f"a pose {count}", expected="X Y Z or X Y Z A B C")
    single = given.ndim == 1
    rows = np.atleast_2d(given)
    poses = np.concatenate([rows, np.zeros((len(rows), 6 - rows.shape[1]))], axis=1)
    if not np.abs(poses).max(initial=0.0) <= FARTHEST:
        raise InputError(f"a pose of {np.abs(poses).max():g} mm or degrees", expected=f"numbers within +-{FARTHEST:g}")
    model = on.running()
    force = positive("force", force_N, "N", STRONGEST_N)
    found = evaluate_poses(model, m_from_mm(poses[:, :3]), rad_from_deg(poses[:, 3:]), force=force)
    if single and not found.reach.reachable[0]:
        raise UnreachableError(
            f"the pose is out of reach on machine {on.name}: {found.reach.describe(0)}",
            hint=f"`{command_line('machine', 'show', on.asked)}` lists the limits",
        )
    return PoseStiffness(model, poses, found, single=single)


class StiffnessMap(FolderResult):
    """Stiffness over planes of the workspace.

    Attributes
    ----------
    grid
        The grid and the stiffness on it, arrays in SI.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.map_stiffness("nist", z_mm=(800, 1200), points=5)
    >>> [plane["z_mm"] for plane in found.to_dict()["slices"]]
    [800.0, 1200.0]
    >>> found.to_frame().columns.tolist(), len(found.to_frame())
    (['x_mm', 'y_mm', 'z_mm', 'stiffness_N_per_mm', 'reachable'], 50)
    >>> type(found.plot()).__name__
    'Figure'
    """

    command: ClassVar[str] = "map"
    shown_by: ClassVar[str] = "map"

    def __init__(self, machine: Machine, model: StiffnessModel, grid: StiffnessGrid) -> None:
        from toolpath_stiff.report.map import map_summary

        self.model, self.grid, self.inputs = model, grid, machine.inputs
        self._document = map_summary(model, grid)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the command."""
        return self._document

    def to_frame(self) -> pd.DataFrame:
        """One row a point of the grid: x_mm, y_mm, z_mm, stiffness_N_per_mm (nan out of reach), reachable."""
        import pandas as pd

        from toolpath_stiff.report.map import map_columns

        return pd.concat([pd.DataFrame(columns) for columns in map_columns(self.grid)], ignore_index=True)

    def plot(self) -> Figure:
        """Contours over each plane."""
        from toolpath_stiff.report.map import map_picture

        return map_picture.figure(self.model.machine, self.grid)

    def __str__(self) -> str:
        from toolpath_stiff.report.map import text

        return text(self._document)

    def _short(self) -> str:
        return f"{self.model.machine.name}, load {self.grid.load}, {self.grid.stiffness.size} points"

    def files(self, *, plots: bool = True) -> Mapping[str, Content | Callable[[], Content]]:
        """Name -> content of each file that `save` writes."""
        from toolpath_stiff.report.map import files

        return files(self.model, self.grid, self._document, plots=plots)


def map_stiffness(
    machine: Machine | str | Path,
    *,
    x_mm: tuple[float, float] = (-150.0, 150.0),
    y_mm: tuple[float, float] = (-150.0, 150.0),
    z_mm: float | Sequence[float] = 1200.0,
    load: str = "radial",
    tilt_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    points: int = 61,
    force_N: float = FORCE,
    progress: Progress | None = None,
) -> StiffnessMap:
    """Stiffness over one or several horizontal planes.

    Parameters
    ----------
    machine
        A machine, its name or its file.
    x_mm, y_mm
        (low, high) of the planes.
    z_mm
        Height, or heights.
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
    >>> found.to_dict()["slices"][0]["circle"]["maxima_deg"]
    [60.27, 180.27, 300.27]
    """
    from toolpath_stiff.analysis.loads import parse_load
    from toolpath_stiff.analysis.poses import map_stiffness as evaluate_grid

    on = machine_from(machine)
    heights = sorted([float(z_mm)] if isinstance(z_mm, int | float) else [float(z) for z in z_mm])
    if len(set(heights)) < len(heights):
        raise InputError(f"heights {heights}: one appears twice", expected="each height once")
    if not max(abs(v) for v in (*x_mm, *y_mm, *heights)) <= FARTHEST_MM:
        raise InputError("a map beyond 100 m", expected="mm")
    model = on.running()
    a, b, c = (rad_from_deg(float(v)) for v in tilt_deg)
    x, y = ((m_from_mm(float(low)), m_from_mm(float(high))) for low, high in (x_mm, y_mm))
    grid = evaluate_grid(
        model,
        x,
        y,
        [m_from_mm(z) for z in heights],
        parse_load(load),
        whole("points", points, 2, MOST_POINTS),
        (a, b, c),
        positive("force", force_N, "N", STRONGEST_N),
        counter(progress, "map: poses"),
    )
    return StiffnessMap(on, model, grid)
