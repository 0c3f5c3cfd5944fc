"""Many placements of one path at once: mean, range, smallest stiffness, and how far from the limits.

The path is sampled once, in the set-up frame; a placement (x, y, z, A, B, C; the numbers of `--origin`) turns and moves
the samples rigidly, as `path.turns`. Vertical spindles on a machine of linear struts and a rigid platform take the
compiled loops, where numba is there; everything else goes through `analysis.evaluate`, which is slower and the same.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.evaluate import evaluate
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.kinematics import neutral_axes, solve_struts_at
from toolpath_stiff.machine.limits import machine_limits
from toolpath_stiff.nc.moves import RAPID, Program
from toolpath_stiff.path import place_orientations, sample_moves
from toolpath_stiff.path.rotations import rotation_matrices
from toolpath_stiff.stiffness import closed_form, compiled, core
from toolpath_stiff.stiffness.model import StiffnessModel

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

POSES_AT_A_TIME = 200_000


@dataclass(frozen=True)
class WorkPath:
    """Cutting samples of a program in the set-up frame. SI.

    Attributes
    ----------
    position, tangent, abc
        (m, 3) m, unit vectors (0: no motion), rad.
    weight
        (m,) m, length that each sample stands for.
    line
        (m,) of the program.
    tool_length
        (m,) m; nan: the reference tool.
    """

    position: FloatArray
    tangent: FloatArray
    abc: FloatArray
    weight: FloatArray
    line: IntArray
    tool_length: FloatArray

    def __len__(self) -> int:
        return len(self.line)

    def take(self, rows: IntArray) -> WorkPath:
        """Some of the samples."""
        return WorkPath(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


@dataclass(frozen=True)
class Keepout:
    """A box (m, machine coordinates) that the tool tip's path must stay out of."""

    name: str
    low: tuple[float, float, float]
    high: tuple[float, float, float]


@dataclass(frozen=True)
class PlacementFigures:
    """Figures of k placements. SI; nan where a placement is infeasible.

    `compliance` is the mean (by length) of 1/stiffness, m/N: times a force, the mean deflection. `margin` is the
    smallest margin of any sample to any limit or keep-out, negative where infeasible.
    """

    mean: FloatArray
    spread: FloatArray
    lowest: FloatArray
    compliance: FloatArray
    margin: FloatArray


def work_path(program: Program, step: float) -> WorkPath:
    """Sample the cutting moves of a program.

    Raises
    ------
    InputError
        A cutting move has an end in machine coordinates (G53): it does not move with the work.
    """
    moves = program.moves
    fixed = (moves.motion != RAPID) & moves.from_machine.any(axis=1)
    if fixed.any():
        raise InputError(
            "a cutting move from or to machine coordinates (G53, G28) does not move with the work",
            hint="end it in work coordinates before placing the program",
            file=program.name,
            line=int(moves.line[np.argmax(fixed)]),
        )
    samples = sample_moves(moves, step)
    rows = np.flatnonzero(samples.cutting)
    s = samples.take(rows)
    return WorkPath(s.position, s.tangent, s.abc, s.weight, s.line, s.tool_length)


def telling_path(path: WorkPath, count: int) -> WorkPath:
    """A path of `count` samples that stands for the whole: spread over position and direction, extremes first.

    Farthest-point sampling: each next sample is the one least like those chosen, position counted in units of the
    path's size. Each chosen sample takes over the weights of those that are most like it.
    """
    if len(path) <= count:
        return path
    size = max(float(np.ptp(path.position, axis=0).max()), 1e-9)
    features = np.concatenate([path.position / size, 0.5 * path.tangent, path.abc], axis=1)
    chosen = [int(np.argmax(np.linalg.norm(features - features.mean(axis=0), axis=1)))]
    distance, nearest = np.full(len(path), np.inf), np.zeros(len(path), dtype=np.int64)
    for i in range(count):
        step = features - features[chosen[-1]]
        apart = np.einsum("ij,ij->i", step, step)
        closer = apart < distance
        distance[closer], nearest[closer] = apart[closer], i
        if i + 1 < count:
            chosen.append(int(np.argmax(distance)))
    few = path.take(np.array(chosen))
    weight = np.bincount(nearest, weights=path.weight, minlength=count).astype(float)
    return replace(few, weight=weight)


class Evaluator:
    """Evaluates placements of one path and counts the poses that this took."""

    def __init__(
        self, model: StiffnessModel, path: WorkPath, load: Load, force: float, keepouts: tuple[Keepout, ...] = ()
    ) -> None:
        self.model, self.path, self.load, self.force, self.keepouts = model, path, load, force, keepouts
        self.poses = 0
        tools = np.unique(path.tool_length)
        vertical = not path.abc.any()
        self.fast = (
            core.is_closed_form(model)
            and compiled.available()
            and vertical
            and len(tools) == 1
            and load.kind == "tangential"
            and bool(path.tangent.any(axis=1).all())
        )
        if self.fast:
            self._prepare(float(tools[0]))

    def _prepare(self, tool_length: float) -> None:
        machine = self.model.machine
        self.kernel = closed_form.prepare(machine, tool_length)
        neutral = solve_struts_at(machine, machine.limits.neutral_pose)
        self.neutral_determinant = float(np.abs(np.linalg.det(neutral.jacobian[0])))
        self.axes = neutral_axes(machine)
        arms = machine.platform_joints_for(tool_length) - machine.frame_joints
        # A strut's component along a joint's neutral axis is linear in the tip's position.
        self.along = [(axes, np.einsum("ij,ij->i", arms, axes)) for axes in self.axes]

    def figures(self, placements: FloatArray) -> PlacementFigures:
        """Figures of placements (k, 6) m and rad."""
        path = self.path
        self.poses += len(placements) * len(path)
        parts = []
        group = max(1, POSES_AT_A_TIME // max(len(path), 1))
        for start in range(0, len(placements), group):
            some = placements[start : start + group]
            tilted = bool(some[:, 3:5].any())
            parts.append(self._fast(path, some) if self.fast and not tilted else self._plain(path, some))
        return PlacementFigures(
            *(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(PlacementFigures))
        )

    def _fast(self, path: WorkPath, placements: FloatArray) -> PlacementFigures:
        """Vertical spindle, linear struts: compiled, poses last."""
        k, m = len(placements), len(path)
        cos, sin = np.cos(placements[:, 5])[:, None], np.sin(placements[:, 5])[:, None]

        def turned(vectors: FloatArray) -> FloatArray:
            x, y, z = vectors.T
            return np.stack([cos * x - sin * y, sin * x + cos * y, np.broadcast_to(z, (k, m))])

        position = np.ascontiguousarray((turned(path.position) + placements[:, :3].T[:, :, None]).reshape(3, -1))
        direction = np.ascontiguousarray(turned(path.tangent).reshape(3, -1))
        along, determinant, lengths, good = compiled.compliance_along_columns(self.kernel, position, direction)
        margin = self._margins(position, lengths, determinant / self.neutral_determinant)
        found = self._summary(1.0 / along.reshape(k, m), margin.reshape(k, m), position.reshape(3, k, m), path)
        doubtful = np.flatnonzero(~good.reshape(k, m).all(axis=1) & (found.margin >= 0.0))
        if len(doubtful):  # within reach, but ill-conditioned for the closed form: the pivoted route decides
            pivoted = self._plain(path, placements[doubtful])
            for column in fields(PlacementFigures):
                getattr(found, column.name)[doubtful] = getattr(pivoted, column.name)
        return found

    def _margins(self, position: FloatArray, lengths: FloatArray, index: FloatArray) -> FloatArray:
        """(n,) smallest margin to any limit, as `machine.limits.reach` has it, for vertical poses with poses last."""
        machine = self.model.machine
        limits = machine.limits
        margin = np.full(lengths.shape[1], np.inf)
        spans = {limit.name: limit.span for limit in machine_limits(machine)}
        low, high = limits.strut_length
        np.minimum(margin, (lengths.min(axis=0) - low) / spans["strut1 min length"], out=margin)
        if np.isfinite(high):
            np.minimum(margin, (high - lengths.max(axis=0)) / spans["strut1 max length"], out=margin)
        for bound, (axes, offset) in zip(
            (limits.frame_joint_angle, limits.platform_joint_angle), self.along, strict=True
        ):
            if np.isfinite(bound):
                cosine = ((axes @ position + offset[:, None]) / lengths).min(axis=0)
                np.minimum(margin, (bound - np.arccos(np.clip(cosine, -1.0, 1.0))) / bound, out=margin)
        lower, upper = limits.workspace
        for axis, name in enumerate("xyz"):
            if np.isfinite(lower[axis]):
                np.minimum(margin, (position[axis] - lower[axis]) / spans[f"workspace {name} min"], out=margin)
            if np.isfinite(upper[axis]):
                np.minimum(margin, (upper[axis] - position[axis]) / spans[f"workspace {name} max"], out=margin)
        np.minimum(margin, (index - limits.singularity) / (1.0 - limits.singularity), out=margin)
        return margin

    def _plain(self, path: WorkPath, placements: FloatArray) -> PlacementFigures:
        """Any machine, load and tilt, one placement at a time."""
        parts = []
        for placement in placements:
            position, tangent, abc = placed_path(path, placement)
            found = evaluate(self.model, position, abc, tangent, path.tool_length, self.load, self.force)
            part = self._summary(
                found.stiffness[None], found.margin[None], np.ascontiguousarray(position.T)[:, None], path
            )
            parts.append(part)
        return PlacementFigures(
            *(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(PlacementFigures))
        )

    def _summary(
        self, stiffness: FloatArray, margin: FloatArray, position: FloatArray, path: WorkPath
    ) -> PlacementFigures:
        """Length-weighted mean, range and minimum per placement from (k, m) stiffnesses and margins."""
        worst = margin.min(axis=1)
        for box in self.keepouts:
            worst = np.minimum(worst, clearances(box, np.moveaxis(position, 0, -1)).min(axis=-1))
        counted = path.weight > 0.0
        values, weight = stiffness[:, counted], path.weight[counted]
        feasible = worst >= 0.0
        length = max(float(weight.sum()), 1e-300)
        mean = np.where(feasible, values @ weight / length, np.nan)
        compliance = np.where(feasible, (1.0 / values) @ weight / length, np.nan)
        low = np.where(feasible, values.min(axis=1, initial=np.inf), np.nan)
        high = np.where(feasible, values.max(axis=1, initial=-np.inf), np.nan)
        return PlacementFigures(mean, high - low, low, compliance, worst)


def placed_path(path: WorkPath, placement: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Positions, tangents and orientations of a path at one placement (6,)."""
    turn = rotation_matrices(placement[3:])
    if not placement[3:].any():
        return path.position + placement[:3], path.tangent, path.abc
    position = path.position @ turn.T + placement[:3]
    return position, path.tangent @ turn.T, place_orientations(path.abc, placement)


def clearances(box: Keepout, position: FloatArray) -> FloatArray:
    """(...,) m, how far points (..., 3) lie outside a box, negative inside: the depth below the nearest face."""
    outside = np.maximum(np.array(box.low) - position, position - np.array(box.high))
    return np.asarray(outside.max(axis=-1))
