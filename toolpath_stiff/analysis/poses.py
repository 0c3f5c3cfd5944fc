"""Stiffness at single poses: along the axes, in the softest and the stiffest direction; how far one can go."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.evaluation import refuse_no_number
from toolpath_stiff.analysis.loads import principal_directions
from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray
from toolpath_stiff.column_files import csv_rows
from toolpath_stiff.documents import without_nan
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import Reach, reach
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.results import Result, frame_of
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.model import StiffnessModel, condition_warnings, effects_stated
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

if TYPE_CHECKING:
    import pandas as pd

DECIMALS: dict[str, int | None] = {"extrapolated": None, "margin_limit": None}  # a whole number, a word
POSE_COLUMNS = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")


@dataclass(frozen=True, repr=False, eq=False)
class PoseStiffness(Result):
    """Stiffness at n poses: along X, Y, Z, in the softest and the stiffest direction, with strut lengths and margins.

    Arrays are in SI, nan where a pose is out of reach; `columns` has them in the shop's units.

    Attributes
    ----------
    model
        The machine with its effects.
    along_axes
        (n, 3) N/m along X, Y, Z of the machine.
    softest, stiffest
        (n, 3) unit vectors of the softest and the stiffest direction.
    softest_stiffness, stiffest_stiffness
        (n,) N/m along them.
    strut_lengths
        (n, 6) m.
    extrapolated
        (n,) a strut is outside the range that the strut law was given for.
    reach
        Margins and limits.
    pose_mm_deg
        (n, 6) as given: tool tip X, Y, Z; roll, pitch, yaw.
    single
        A pose was given, not a list of them.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.pose([(0, 0, 800), (0, 0, 5000)], "nist")
    >>> found
    <PoseStiffness: 2 poses of nist, 1 within reach>
    >>> found.reachable.tolist(), found.warnings
    ([True, False], [])
    >>> found.out_of_reach(3)
    ['row 2: out of reach: frame joint2 angle needs 97.97 deg, limit 30.00 deg, 67.97 deg beyond']
    >>> found.to_frame()["kz_N_per_mm"].round().tolist()
    [123723.0, nan]
    >>> round(found.columns["softest_N_per_mm"][0])
    54823
    >>> found.csv().splitlines()[0][:30]
    'x_mm,y_mm,z_mm,a_deg,b_deg,c_d'
    """

    command: ClassVar[str] = "pose"
    shown_by: ClassVar[str] = "poses"

    model: StiffnessModel
    along_axes: FloatArray
    softest: FloatArray
    softest_stiffness: FloatArray
    stiffest: FloatArray
    stiffest_stiffness: FloatArray
    strut_lengths: FloatArray
    extrapolated: BoolArray
    reach: Reach
    pose_mm_deg: FloatArray = field(default_factory=lambda: np.empty((0, 6)))
    single: bool = False

    @property
    def reachable(self) -> BoolArray:
        """(n,) whether the machine can take the pose."""
        return self.reach.reachable

    @property
    def warnings(self) -> list[str]:
        """Effects that do not act here, for want of a set-up, a temperature or a tool."""
        return condition_warnings(self.model)

    def out_of_reach(self, most: int) -> list[str]:
        """Which poses the machine cannot take and why: so many by name, how many more."""
        rows = (~self.reachable).nonzero()[0]
        reasons = [f"row {i + 1}: out of reach: {self.reach.describe(i)}" for i in rows[:most]]
        return reasons + ([f"{len(rows) - most} more rows are out of reach"] if len(rows) > most else [])

    @cached_property
    def columns(self) -> dict[str, AnyArray]:
        """Column of `tps pose --csv` -> values in the shop's units."""
        limits = np.array([limit.name for limit in self.reach.limits] or ["none"])
        columns: dict[str, AnyArray] = dict(zip(POSE_COLUMNS, self.pose_mm_deg.T, strict=True))
        columns |= {f"k{axis}_N_per_mm": n_per_mm_from_n_per_m(self.along_axes[:, i]) for i, axis in enumerate("xyz")}
        for which in ("softest", "stiffest"):
            columns[f"{which}_N_per_mm"] = n_per_mm_from_n_per_m(getattr(self, f"{which}_stiffness"))
            columns |= {f"{which}_d{axis}": getattr(self, which)[:, i] for i, axis in enumerate("xyz")}
        return {
            **columns,
            **{f"strut{i + 1}_mm": mm_from_m(self.strut_lengths[:, i]) for i in range(6)},
            "extrapolated": self.extrapolated.astype(int),
            "margin": self.reach.margin,
            "margin_limit": limits[self.reach.limit],
        }

    def to_frame(self) -> pd.DataFrame:
        """One row a pose, the columns of `tps pose --csv`."""
        return frame_of(self.columns)

    def to_dict(self) -> dict[str, Any]:
        """Of a single pose its figures; of several, a list of them under "poses", null where out of reach."""
        about = {"machine": self.model.machine.name, **effects_stated(self.model), "warnings": self.warnings}
        cells = zip(*(column.tolist() for column in self.columns.values()), strict=True)
        rows = [without_nan(dict(zip(self.columns, row, strict=True))) for row in cells]
        rows = [{**row, "extrapolated": bool(row["extrapolated"])} for row in rows]
        return {**about, **rows[0]} if self.single else {**about, "poses": rows}

    def csv(self) -> str:
        """The table as the command writes it."""
        decimals = {name: DECIMALS.get(name, 4 if name.endswith("N_per_mm") else 6) for name in self.columns}
        return ",".join(decimals) + "\n" + csv_rows(self.columns, decimals)

    def __str__(self) -> str:
        return super().__str__() if self.single else self.csv().rstrip("\n")

    def _short(self) -> str:
        name = self.model.machine.name
        if not self.single:
            return f"{len(self.reachable)} poses of {name}, {int(self.reachable.sum())} within reach"
        soft, stiff = (f"{self.columns[f'{which}_N_per_mm'][0]:.0f}" for which in ("softest", "stiffest"))
        return f"{name}, {soft} N/mm along the softest direction, {stiff} along the stiffest"


def evaluate_poses(
    model: StiffnessModel,
    position: FloatArray,
    abc: FloatArray,
    tool_length: float = np.nan,
    force: float = defaults.FORCE,
) -> PoseStiffness:
    """Evaluate n poses: position (n, 3) m, abc (n, 3) rad; `tool_length` in m (nan: the reference tool)."""
    rotation = rotation_matrices(abc)
    struts = solve_struts(model.machine, position, rotation, tool_length)
    stand = reach(model.machine, position, struts, rotation)
    n, within = len(position), stand.reachable
    tip, turn = position[within], rotation[within]
    compliance = core.tip_compliance(model, tip, turn, tool_length, force)
    refuse_no_number(model.machine, tip, np.isnan(compliance[:, 0, 0]))

    def along(direction: FloatArray) -> FloatArray:
        if model.load_dependent:
            return core.compliance_along(model, direction, tip, turn, tool_length, force)
        return np.asarray(np.einsum("ni,nij,nj->n", direction, compliance, direction))

    soft, stiff = (principal_directions(compliance, which) for which in (True, False))
    axes = [along(np.broadcast_to(axis, (len(tip), 3))) for axis in np.eye(3)]

    def spread(values: FloatArray) -> FloatArray:
        full = np.full((n, *values.shape[1:]), np.nan)
        full[within] = values
        return full

    return PoseStiffness(
        model=model,
        along_axes=spread(1.0 / np.stack(axes, axis=1)),
        softest=spread(soft),
        softest_stiffness=spread(1.0 / along(soft)),
        stiffest=spread(stiff),
        stiffest_stiffness=spread(1.0 / along(stiff)),
        strut_lengths=struts.lengths,
        extrapolated=np.asarray(model.machine.strut_law.extrapolates(struts.lengths).any(axis=1)),
        reach=stand,
    )


RAY_STEP, RAY_END, RAY_EXACT = 0.05, 5.0, 1e-4  # m: marching out, at most so far, and how exact the end is


def reach_along(machine: Hexapod, start: FloatArray, directions: FloatArray, turn: FloatArray) -> FloatArray:
    """(n,) m that the tool tip can go from a place (3,) along unit vectors (n, 3) before the first limit.

    `turn` (3, 3) is the orientation, which is kept. 0 where the place itself is out of reach.
    """

    def inside(lengths: FloatArray) -> BoolArray:
        tips = start + lengths[:, None] * directions
        turns = np.broadcast_to(turn, (len(tips), 3, 3))
        return np.asarray(reach(machine, tips, solve_struts(machine, tips, turns), turns).reachable)

    steps = np.arange(0.0, RAY_END, RAY_STEP)
    good = np.stack([inside(np.full(len(directions), step)) for step in steps], axis=1)
    first = np.where(good.all(axis=1), len(steps), np.argmin(good, axis=1))
    low, high = np.maximum(first - 1, 0) * RAY_STEP, first * RAY_STEP
    for _ in range(int(np.ceil(np.log2(RAY_STEP / RAY_EXACT)))):
        middle = 0.5 * (low + high)
        within = inside(middle)
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return np.where(first > 0, low, 0.0)
