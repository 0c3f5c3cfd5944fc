"""Stiffness at single poses: along the axes, in the softest and the stiffest direction."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.evaluation import Poses, compliance_along, joint_columns, taken, tip_compliances
from toolpath_stiff.analysis.loads import principal_directions
from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray
from toolpath_stiff.column_files import csv_rows
from toolpath_stiff.documents import Document, records, without_nan
from toolpath_stiff.machine.limits import Reach
from toolpath_stiff.results import DataFrame, Result, frame_of
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.model import StiffnessModel, condition_warnings, effects_stated
from toolpath_stiff.units import n_per_mm_from_n_per_m, nm_from_m

AS_IT_IS = ("extrapolated", "margin_limit")  # columns not converted: a whole number, a word
POSE_COLUMNS = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")


@dataclass(frozen=True, repr=False, eq=False)
class PoseStiffness(Result):
    """Stiffness at n poses: along X, Y, Z, in the softest and the stiffest direction, with joint values and margins.

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
    tip_compliance
        (n, 3, 3) m/N, column j the displacement of the tip for each newton of the load along axis j, all effects
        included.
    joints
        (n, j) m or rad, what the control moves: strut lengths of a hexapod.
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
    tip_compliance: FloatArray
    joints: FloatArray
    extrapolated: BoolArray
    reach: Reach
    pose_mm_deg: FloatArray = field(default_factory=lambda: np.empty((0, 6)))
    single: bool = False

    @property
    def reachable(self) -> BoolArray:
        """(n,) True where the machine can take the pose."""
        return self.reach.reachable

    @property
    def warnings(self) -> list[str]:
        """Effects that do not act here, for lack of a set-up, a temperature or a tool."""
        return condition_warnings(self.model)

    def out_of_reach(self, most: int) -> list[str]:
        """Reasons why poses are out of reach: at most `most` of them, then the number of the others."""
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
            **joint_columns(self.model.machine, self.joints),
            "extrapolated": self.extrapolated.astype(int),
            "margin": self.reach.margin,
            "margin_limit": limits[self.reach.limit],
        }

    def to_frame(self) -> DataFrame:
        """One row per pose, with the columns of `tps pose --csv`."""
        return frame_of(self.columns)

    def to_dict(self) -> Document:
        """Figures of a single pose; for several, a list of them under "poses", null where out of reach."""
        about = {"machine": self.model.machine.name, **effects_stated(self.model), "warnings": self.warnings}
        rows = [without_nan(row) for row in records(self.columns)]
        tensors = (nm_from_m(self.tip_compliance).round(6) + 0.0).tolist()  # without digits of rounding
        rows = [
            {**row, "extrapolated": bool(row["extrapolated"]), **without_nan({"tip_compliance_nm_per_N": tensor})}
            for row, tensor in zip(rows, tensors, strict=True)
        ]
        return {**about, **rows[0]} if self.single else {**about, "poses": rows}

    def csv(self) -> str:
        """The table as the command writes it."""
        places = ((name, 4 if name.endswith("N_per_mm") else 6) for name in self.columns)
        decimals = {name: None if name in AS_IT_IS else digits for name, digits in places}
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
    model: StiffnessModel, position: FloatArray, abc: FloatArray, force: float = defaults.FORCE
) -> PoseStiffness:
    """Evaluate n poses: position (n, 3) m, abc (n, 3) rad."""
    poses = (position, rotation_matrices(abc), np.nan)
    joints, extrapolated, stand, compliance = tip_compliances(model, poses, force)
    soft, stiff = (principal_directions(compliance, softest) for softest in (True, False))

    def along(direction: FloatArray) -> FloatArray:
        return np.asarray(1.0 / compliance_along(model, direction, compliance, poses, force))

    return PoseStiffness(
        model=model,
        along_axes=np.stack([along(np.broadcast_to(axis, position.shape)) for axis in np.eye(3)], axis=1),
        softest=soft,
        softest_stiffness=along(soft),
        stiffest=stiff,
        stiffest_stiffness=along(stiff),
        tip_compliance=_by_axes(model, compliance, poses, force),
        joints=joints,
        extrapolated=extrapolated,
        reach=stand,
    )


def _by_axes(model: StiffnessModel, compliance: FloatArray, poses: Poses, force: float) -> FloatArray:
    """(n, 3, 3) m/N, each column with the load along that axis; `compliance` as from `tip_compliances`."""
    by_axes, within = compliance.copy(), ~np.isnan(compliance[:, 0, 0])
    if model.load_dependent and within.any():
        some = taken(poses, within)
        for axis, load in enumerate(force * np.eye(3)):
            tensor = core.tip_compliance(model, *some, load=np.broadcast_to(load, some[0].shape))
            by_axes[within, :, axis] = tensor[:, :, axis]
    return by_axes
