"""Many placements of one path at once: mean, range, smallest stiffness, and how far from the limits.

The path is sampled once, in the set-up frame; a placement turns and moves the samples rigidly. Limits come from strut
lengths and determinants that the closed form computes on its way; so does the stiffness of linear struts on a rigid
platform under a load that the geometry alone directs. Everything else asks `analysis.poses.evaluate` for the stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from toolpath_stiff.analysis.loads import Load, load_directions
from toolpath_stiff.analysis.poses import evaluate
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.machine.kinematics import neutral_axes, solve_struts, solve_struts_at
from toolpath_stiff.machine.limits import (
    AXES,
    FRAME,
    PLATFORM,
    SINGULARITY,
    STRUT,
    Limit,
    distinct_limits,
    reach,
    smallest_margin,
)
from toolpath_stiff.placement.paths import WorkPath
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_about_z, rotation_matrices
from toolpath_stiff.stiffness import closed_form, compiled, core
from toolpath_stiff.stiffness.model import StiffnessModel

POSES_AT_A_TIME = 30_000  # fits the processor's cache
# Evaluations of the whole path in a search, about: says whether numba's half a second is earned back.
EVALUATIONS = 300


@dataclass(frozen=True)
class Keepout:
    """A box (m, machine coordinates) that the tool tip's path must stay out of, rapids included."""

    name: str
    low: tuple[float, float, float]
    high: tuple[float, float, float]


@dataclass(frozen=True)
class PlacementFigures:
    """Figures of k placements. SI; the stiffnesses are nan where a cut is out of reach.

    Attributes
    ----------
    mean, spread, lowest
        (k,) N/m, of the headline samples; the mean by length.
    compliance
        (k,) m/N, mean (by length) of 1/stiffness: times a force, the mean deflection.
    margin, rapid_margin
        (k,) smallest margin of a cut, of a rapid, to any limit, as a share of the limit's span.
    clearance
        (k,) m, smallest distance to a keep-out, negative inside; inf without keep-outs.
    extrapolated
        (k,) share of the cutting samples at which a strut is outside the lengths that its law was given for.
    """

    mean: FloatArray
    spread: FloatArray
    lowest: FloatArray
    compliance: FloatArray
    margin: FloatArray
    rapid_margin: FloatArray
    clearance: FloatArray
    extrapolated: FloatArray

    def __len__(self) -> int:
        return len(self.mean)

    def take(self, rows: IntArray | BoolArray | slice) -> PlacementFigures:
        """Some of the placements."""
        return PlacementFigures(*(getattr(self, f.name)[rows] for f in fields(self)))

    @staticmethod
    def joined(parts: list[PlacementFigures]) -> PlacementFigures:
        """One after the other."""
        return PlacementFigures(
            *(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(PlacementFigures))
        )

    @property
    def objectives(self) -> FloatArray:
        """(k, 3) N/m, all to be raised: mean, minus range, weakest."""
        return np.stack([self.mean, -self.spread, self.lowest], axis=1)


@dataclass(frozen=True)
class PlacedRows:
    """What k placements do at each sample: rigid samples first (m), then the anchored rapids (q). SI.

    `stiffness` (k, m), nan but at headline samples; `law` (k, m) m, how far the struts are inside the lengths of their
    law; `margin` (k, m + q); `clearance` (k, m + q) m, inf without keep-outs.
    """

    stiffness: FloatArray
    law: FloatArray
    margin: FloatArray
    clearance: FloatArray


class Evaluator:
    """Evaluates placements of one path and counts the poses that this took."""

    def __init__(
        self,
        model: StiffnessModel,
        path: WorkPath,
        load: Load,
        force: float,
        keepouts: tuple[Keepout, ...] = (),
        whole: int | None = None,
    ) -> None:
        """`whole`: samples of the whole path, where `path` is only some of it."""
        self.model, self.path, self.load, self.force, self.keepouts = model, path, load, force, keepouts
        self.poses = 0
        machine = model.machine
        self.compiled = EVALUATIONS * (whole or len(path)) > core.COMPILED_FROM and compiled.available()
        # These two ask the compliance for a direction, the second at plunges.
        self.direct = core.is_closed_form(model) and load.kind not in ("softest", "normal")
        # A still sample has no direction; none of them is a headline sample, so any direction does.
        still = ~np.asarray(path.tangent.any(axis=1))
        self.tangent = np.where(still[:, None], np.array([0.0, 0.0, 1.0]), path.tangent)
        self.abc = np.concatenate([path.abc, path.anchored.abc])
        self.turned = rotation_matrices(self.abc) if self.abc.any() else None
        self.tool_length = np.concatenate([path.tool_length, path.anchored.tool_length])
        self.kernels = [
            (rows, float(self.tool_length[rows[0]]), closed_form.prepare(machine, float(self.tool_length[rows[0]])))
            for rows in _groups(self.tool_length)
        ]
        self.limits = distinct_limits(machine)
        self.axes = neutral_axes(machine)
        neutral = solve_struts_at(machine, machine.limits.neutral_pose)
        self.neutral_determinant = float(np.abs(np.linalg.det(neutral.jacobian[0])))

    def figures(self, placements: FloatArray) -> PlacementFigures:
        """Figures of placements (k, 6) m and rad."""
        group = max(1, POSES_AT_A_TIME // max(len(self.abc), 1))
        return PlacementFigures.joined(
            [
                self.summary(self.rows(placements[start : start + group]))
                for start in range(0, max(len(placements), 1), group)
            ]
        )

    def rows(self, placements: FloatArray) -> PlacedRows:
        """What each sample does at placements (k, 6) m and rad; all in memory at once."""
        path, k = self.path, len(placements)
        m = len(path)
        self.poses += k * len(self.abc)
        turn = rotation_matrices(placements[:, 3:])
        position = np.concatenate(
            [
                path.position @ np.swapaxes(turn, 1, 2) + placements[:, None, :3],
                path.anchored.placed(turn, placements[:, :3]),
            ],
            axis=1,
        )
        tangent = self.tangent @ np.swapaxes(turn, 1, 2)
        rotation = self._orientations(placements, turn)
        along, margin, law = (np.full(position.shape[:2], np.nan) for _ in range(3))
        for rows, tool, kernel in self.kernels:
            some = None if rotation is None else rotation[:, rows].reshape(-1, 3, 3)
            tip = position[:, rows].reshape(-1, 3)
            motion = np.zeros((k, len(rows), 3))
            rigid = rows < m
            motion[:, rigid] = tangent[:, rows[rigid]]
            motion[:, ~rigid, 2] = 1.0
            found = self._kernel_rows(kernel, tool, tip, motion.reshape(-1, 3), some)
            for target, values in zip((along, margin, law), found, strict=True):
                target[:, rows] = values.reshape(k, -1)
        stiffness = np.full((k, m), np.nan)
        head = path.headline
        if self.direct:
            with np.errstate(divide="ignore"):
                stiffness[:, head] = 1.0 / along[:, :m][:, head]
        else:
            stiffness[:, head] = self._asked(position[:, :m][:, head], tangent[:, head], rotation, margin[:, :m])
        clearance = np.full(position.shape[:2], np.inf)
        for box in self.keepouts:
            np.minimum(clearance, clearances(box, position), out=clearance)
        return PlacedRows(stiffness, law[:, :m], margin, clearance)

    def summary(self, rows: PlacedRows) -> PlacementFigures:
        """Figures of placements from what each of their samples does."""
        path, m, k = self.path, len(self.path), len(rows.margin)
        cutting = np.concatenate([path.cutting, np.zeros(len(path.anchored), dtype=bool)])
        margin = rows.margin[:, cutting].min(axis=1, initial=np.inf)
        rapid = rows.margin[:, ~cutting].min(axis=1, initial=np.inf)
        within = margin >= 0.0
        values, weight = rows.stiffness[:, path.headline], path.weight[path.headline]
        length = max(float(weight.sum()), 1e-300)
        low = values.min(axis=1, initial=np.inf)
        high = values.max(axis=1, initial=-np.inf)
        outside = (rows.law[:, cutting[:m]] < 0.0).mean(axis=1) if path.cutting.any() else np.zeros(k)
        with np.errstate(divide="ignore", invalid="ignore"):
            compliance = (1.0 / values) @ weight / length
        return PlacementFigures(
            mean=np.where(within, values @ weight / length, np.nan),
            spread=np.where(within, high - low, np.nan),
            lowest=np.where(within, low, np.nan),
            compliance=np.where(within, compliance, np.nan),
            margin=margin,
            rapid_margin=rapid,
            clearance=rows.clearance.min(axis=1, initial=np.inf),
            extrapolated=outside,
        )

    def _orientations(self, placements: FloatArray, turn: FloatArray) -> FloatArray | None:
        """(k, m + q, 3, 3) R' = Q R Rz(-C), the rule of `path`; None: all vertical."""
        if self.turned is None and not placements[:, 3:5].any():
            return None
        own = np.broadcast_to(np.eye(3), (len(self.abc), 3, 3)) if self.turned is None else self.turned
        back = rotation_about_z(-placements[:, 5])
        return np.asarray(turn[:, None] @ own[None] @ back[:, None])

    def _kernel_rows(
        self,
        kernel: closed_form.ClosedForm,
        tool: float,
        tip: FloatArray,
        motion: FloatArray,
        rotation: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Compliance along the load, margin and law of n poses with one tool."""
        machine = self.model.machine
        direction = load_directions(self.load, np.empty((0, 3, 3)), tip, rotation, motion)[0] if self.direct else motion
        columns = np.ascontiguousarray(tip.T)
        if self.compiled:
            turns = None if rotation is None else np.ascontiguousarray(rotation.reshape(-1, 9).T)
            towards = np.ascontiguousarray(direction.T)
            along, determinant, lengths, good = compiled.compliance_along_columns(kernel, columns, towards, turns)
        else:
            along, determinant, by_pose, good = closed_form.compliance_along(kernel, tip, direction, rotation)
            lengths = np.ascontiguousarray(by_pose.T)
        margin = self._margins(columns, rotation, lengths, determinant / self.neutral_determinant, tool)
        law = machine.strut_law.room(lengths).min(axis=0)
        doubtful = np.flatnonzero(~good & ~(margin < 0.0))  # ill-conditioned for the closed form: pivot
        if len(doubtful):
            turns = None if rotation is None else rotation[doubtful]
            struts = solve_struts(machine, tip[doubtful], turns, tool)
            margin[doubtful] = reach(machine, tip[doubtful], struts, turns).margin
            if self.direct:
                along[doubtful] = 1.0 / self._evaluated(tip[doubtful], motion[doubtful], turns, tool)
        return along, margin, law

    def _margins(
        self, position: FloatArray, rotation: FloatArray | None, lengths: FloatArray, index: FloatArray, tool: float
    ) -> FloatArray:
        """(n,) smallest margin to any limit, as `machine.limits.reach` has it; poses last: (3, n), (6, n), (n,)."""

        def extreme(limit: Limit) -> FloatArray:
            if limit.quantity == STRUT:
                return np.asarray(lengths.min(axis=0) if limit.lower else lengths.max(axis=0))
            if limit.quantity in (FRAME, PLATFORM):
                along = self._along_axes(limit.quantity == PLATFORM, position, rotation, tool)
                return np.asarray(np.arccos(np.clip((along / lengths).min(axis=0), -1.0, 1.0)))
            return index if limit.quantity == SINGULARITY else position[AXES.index(limit.quantity)]

        return np.broadcast_to(smallest_margin(self.limits, extreme), index.shape).copy()

    def _along_axes(
        self, of_platform: bool, position: FloatArray, rotation: FloatArray | None, tool: float
    ) -> FloatArray:
        """(6, n) m, components of the struts R p + tip - b along the joints' neutral axes."""
        machine = self.model.machine
        arms, frame, axes = machine.platform_joints_for(tool), machine.frame_joints, self.axes[of_platform]
        if rotation is None:
            return np.asarray(axes @ position + np.einsum("id,id->i", arms - frame, axes)[:, None])
        turns = rotation.reshape(-1, 9).T
        if of_platform:  # the axes turn with the platform: (R a) . (R p + tip - b)
            local = np.einsum("ncd,cn->dn", rotation, position)
            fixed = np.einsum("ic,id->icd", frame, axes).reshape(6, 9) @ turns
            return np.asarray(axes @ local - fixed + np.einsum("id,id->i", axes, arms)[:, None])
        turned = np.einsum("ic,id->icd", axes, arms).reshape(6, 9) @ turns
        return np.asarray(axes @ position + turned - np.einsum("id,id->i", axes, frame)[:, None])

    def _asked(
        self, position: FloatArray, tangent: FloatArray, rotation: FloatArray | None, margin: FloatArray
    ) -> FloatArray:
        """(k, h) stiffness at the headline samples by `analysis.poses.evaluate`, where all cuts are within reach."""
        found = np.full(position.shape[:2], np.nan)
        possible = np.flatnonzero((margin[:, self.path.cutting] >= 0.0).all(axis=1))
        if len(possible):
            turns = None
            if rotation is not None:
                turns = rotation[possible][:, : len(self.path)][:, self.path.headline].reshape(-1, 3, 3)
            tools = np.tile(self.path.tool_length[self.path.headline], len(possible))
            tip, motion = (values[possible].reshape(-1, 3) for values in (position, tangent))
            found[possible] = self._evaluated(tip, motion, turns, tools).reshape(len(possible), -1)
        return found

    def _evaluated(
        self, tip: FloatArray, motion: FloatArray, rotation: FloatArray | None, tool: FloatArray | float
    ) -> FloatArray:
        abc = np.zeros((len(tip), 3)) if rotation is None else roll_pitch_yaw(rotation)
        return evaluate(self.model, tip, abc, motion, tool, self.load, self.force).stiffness


def _groups(tool_length: FloatArray) -> list[IntArray]:
    """Rows of each tool length; nan counts as one."""
    number = np.unique(tool_length, return_inverse=True)[1].ravel()
    return [np.flatnonzero(number == i) for i in range(number.max(initial=-1) + 1)]


def clearances(box: Keepout, position: FloatArray) -> FloatArray:
    """(...,) m, how far points (..., 3) lie outside a box, negative inside: the depth below the nearest face."""
    outside = np.maximum(np.array(box.low) - position, position - np.array(box.high))
    return np.asarray(outside.max(axis=-1))
