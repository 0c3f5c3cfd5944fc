"""Many placements of one path at once: mean, range, smallest stiffness, and margins to the limits.

The path is sampled once, in the set-up frame; a placement turns and moves the samples rigidly. Limits come from strut
lengths and determinants that the closed form computes on its way; so does the stiffness of linear struts on a rigid
platform under a load that the geometry alone directs. Effects add to the strut forces of the closed form; a load whose
direction asks the compliance, and what is near singular, goes to `analysis.poses.evaluate`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from toolpath_stiff.analysis.evaluation import (
    WorkPoses,
    corners,
    evaluate,
    kept_configurations,
    poses_taken,
    stiffness_within,
    tried_rows,
)
from toolpath_stiff.analysis.loads import Load, geometric_directions
from toolpath_stiff.arrays import ArrayColumns, BoolArray, FloatArray, IntArray, product
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import Extremes, reach
from toolpath_stiff.machine.model import NO_END, Hexapod, as_hexapod
from toolpath_stiff.placement.keep_out import KeepOut
from toolpath_stiff.placement.paths import WorkPath
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_about_z, rotation_matrices
from toolpath_stiff.stiffness import closed_form, core
from toolpath_stiff.stiffness.model import StiffnessModel

POSES_AT_A_TIME = 30_000  # fits the processor's cache
UNREACHABLE = -9.0  # margin where no joint values reach a pose: finite, as a search takes differences of it
COMPLIANCE_DECIDES = ("softest", "normal")  # loads directed by the compliance, the second at plunges


@dataclass(frozen=True)
class PlacementFigures(ArrayColumns):
    """Figures of k placements. SI; stiffnesses are nan if a cut is out of reach.

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

    @property
    def objectives(self) -> FloatArray:
        """(k, 3) N/m, objectives to maximise: mean, minus range, weakest."""
        return np.stack([self.mean, -self.spread, self.lowest], axis=1)


@dataclass(frozen=True)
class PlacedRows(ArrayColumns):
    """Values of each sample (k, n) at k placements. SI.

    `stiffness`, nan but at headline samples; `law` m, how far the struts are inside the lengths of their law; `margin`;
    `clearance` m, inf without keep-outs.
    """

    stiffness: FloatArray
    law: FloatArray
    margin: FloatArray
    clearance: FloatArray

    def combined(self, formula: Callable[..., FloatArray], other: PlacedRows) -> PlacedRows:
        """Columns that a formula makes from these and the corresponding ones of `other`."""
        with np.errstate(invalid="ignore"):
            return PlacedRows(*(formula(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)))


class Evaluator:
    """Evaluator of placements of one path, which counts the poses computed."""

    def __init__(
        self, model: StiffnessModel, path: WorkPath, load: Load, force: float, keepouts: tuple[KeepOut, ...] = ()
    ) -> None:
        self.model, self.path, self.load, self.force, self.keepouts = model, path, load, force, keepouts
        self.poses, self.known = 0, dict[bytes, PlacementFigures]()
        self.direct = core.is_closed_form(model) and load.kind not in COMPLIANCE_DECIDES
        # A sample at rest has no direction; none is a headline sample, so any direction will do.
        still = ~np.asarray(path.tangent.any(axis=1))
        tangent = np.where(still[:, None], np.array([0.0, 0.0, 1.0]), path.tangent)
        self.position, self.tangent = (np.ascontiguousarray(values.T) for values in (path.position, tangent))
        self.turned = np.ascontiguousarray(np.moveaxis(rotation_matrices(path.abc), 0, -1)) if path.abc.any() else None
        # Poses of each tool; at corners with the samples that share the pose under other loads.
        corner = corners(path.position, path.abc, path.tool_length)
        first, self.of_one_tool = ~np.append(False, corner[:-1]), list[tuple[float, tuple[IntArray | slice, ...]]]()
        for tool, some in core.rows_of_tools(path.tool_length):
            rows = np.arange(len(path))[some]
            poses = rows[first[rows]]
            self.of_one_tool.append((tool, (poses, poses + corner[poses]) if len(poses) < len(rows) else (some,)))
        self.head, self.rest = _columns(path.headline), _columns(~path.headline)
        self.cuts, self.rapids = _columns(path.cutting), _columns(~path.cutting)

    def figures(self, placements: FloatArray) -> PlacementFigures:
        """Figures of placements (k, 6) m and rad; those of a long path are cached, as a search repeats them."""
        group = max(1, POSES_AT_A_TIME // max(len(self.path), 1))
        parts = [placements[i : i + group] for i in range(0, max(len(placements), 1), group)]
        if group > 1 or not len(placements):
            return PlacementFigures.joined([self.summary(self.rows(part)) for part in parts])
        for part in parts:
            if (key := part.tobytes()) in self.known:
                self.poses += len(self.path)
            else:
                self.known[key] = self.summary(self.rows(part))
        return PlacementFigures.joined([self.known[part.tobytes()] for part in parts])

    def rows(self, placements: FloatArray) -> PlacedRows:
        """Rows of placements (k, 6) m and rad, all in memory at once."""
        k, n = len(placements), len(self.path)
        self.poses += k * n
        turn = rotation_matrices(placements[:, 3:6])
        position = _turned(turn, self.position) + placements[:, :3].T[:, :, None]
        motion, rotation = _turned(turn, self.tangent), self._orientations(placements, turn)
        clearance = np.broadcast_to(np.inf, (k, n))
        for box in self.keepouts:
            clearance = np.minimum(clearance, box.clearances(np.moveaxis(position, 0, -1)))
        if not isinstance(self.model.machine, Hexapod):
            stiffness, margin = self._of_elements(position, motion, rotation)
            return PlacedRows(stiffness, np.full((k, n), NO_END), margin, clearance)
        along, margin, law = np.empty((3, k, n))
        for tool, loaded in self.of_one_tool:
            some = None if rotation is None else rotation[:, :, loaded[0]].reshape(9, -1)
            tip, towards = (
                position[:, :, loaded[0]].reshape(3, -1),
                [motion[:, :, rows].reshape(3, -1) for rows in loaded[: None if self.direct else 1]],
            )
            compliances, margins, laws = self._kernel_rows(tool, tip, towards, some)
            for rows, compliance in zip(loaded, compliances, strict=False):  # only the first unless direct
                along[:, rows] = compliance.reshape(k, -1)
            for rows in loaded:
                margin[:, rows], law[:, rows] = margins.reshape(k, -1), laws.reshape(k, -1)
        if self.direct:
            with np.errstate(divide="ignore"):
                stiffness = np.divide(1.0, along)
            stiffness[:, self.rest] = np.nan
        else:
            stiffness = np.full((k, n), np.nan)
            stiffness[:, self.head] = self._with_effects(position, motion, rotation, margin)
        return PlacedRows(stiffness, law, margin, clearance)

    def summary(self, rows: PlacedRows) -> PlacementFigures:
        """Figures of placements from the rows of their samples."""
        path, k = self.path, len(rows.margin)
        margin = rows.margin[:, self.cuts].min(axis=1, initial=np.inf)
        rapid = rows.margin[:, self.rapids].min(axis=1, initial=np.inf)
        within = margin >= 0.0
        values, weight = rows.stiffness[:, self.head], path.weight[self.head]
        length = max(float(weight.sum()), 1e-300)
        low = values.min(axis=1, initial=np.inf)
        high = values.max(axis=1, initial=-np.inf)
        outside = (rows.law[:, self.cuts] < 0.0).mean(axis=1) if path.cutting.any() else np.zeros(k)
        with np.errstate(divide="ignore", invalid="ignore"):
            compliance = (weight / values).sum(axis=1) / length
        return PlacementFigures(
            mean=np.where(within, (values * weight).sum(axis=1) / length, np.nan),
            spread=np.where(within, high - low, np.nan),
            lowest=np.where(within, low, np.nan),
            compliance=np.where(within, compliance, np.nan),
            margin=margin,
            rapid_margin=rapid,
            clearance=rows.clearance.min(axis=1, initial=np.inf) if self.keepouts else np.full(k, np.inf),
            extrapolated=outside,
        )

    def deciding_rows(self, placement: FloatArray, stretches: int) -> IntArray:
        """Samples that decide at a placement (6,), ascending: the extremes in each of `stretches` stretches."""
        path, placed = self.path, self.rows(placement[None])
        head, cuts, everything = np.flatnonzero(path.headline), np.flatnonzero(path.cutting), np.arange(len(path))
        counts = [(head, placed.stiffness), (head, -placed.stiffness), (everything, placed.margin), (cuts, placed.law)]
        if self.keepouts:
            counts.append((everything, placed.clearance))
        parts = [(part, values[0]) for rows, values in counts for part in np.array_split(rows, stretches) if len(part)]
        return np.unique([part[int(np.argmin(values[part]))] for part, values in parts])

    def _orientations(self, placements: FloatArray, turn: FloatArray) -> FloatArray | None:
        """(9, k, n) rows of R' = Q R Rz(-C), the rule of `path`, with the tool's turn; None if all are vertical."""
        k, n = len(placements), len(self.path)
        back = placements[:, 5] - placements[:, 6:].sum(axis=1)
        if self.turned is None:
            if not placements[:, 3:5].any() and placements.shape[1] == 6:
                return None
            turned = product(turn, rotation_about_z(-back))
            return np.repeat(turned.reshape(k, 9).T[:, :, None], n, axis=2)
        rotation = np.empty((3, 3, k, n))
        first, second, rotation[:, 2] = (_turned(turn, self.turned[:, column]) for column in range(3))
        cosine, sine = np.cos(back)[:, None], np.sin(back)[:, None]
        rotation[:, 0] = cosine * first - sine * second
        rotation[:, 1] = sine * first + cosine * second
        return rotation.reshape(9, k, n)

    def _of_elements(
        self, position: FloatArray, motion: FloatArray, rotation: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """(k, n) N/m at headline samples, if all cuts are in reach, and (k, n) margins; for a machine of elements."""
        machine, (k, n) = self.model.machine, position.shape[1:]
        stiffness, margin = np.full((k, n), np.nan), np.empty((k, n))

        def placed(rows: IntArray, samples: IntArray) -> tuple[WorkPoses, FloatArray]:
            tip, towards, turns = (
                None if columns is None else columns[:, rows][:, :, samples].reshape(len(columns), -1)
                for columns in (position, motion, rotation)
            )
            assert tip is not None and towards is not None
            return (tip.T, _matrices(turns), towards.T), np.tile(self.path.tool_length[samples], len(rows))

        chosen = np.zeros(k, dtype=np.int64)
        if len(machine.configurations) > 1:
            (tip, turns, _), tools = placed(np.arange(k), tried_rows(n))
            chosen = kept_configurations(machine, tip, turns, tools, k)
        for configuration in np.unique(chosen).tolist():
            rows = np.flatnonzero(chosen == configuration)
            in_work, tools = placed(rows, np.arange(n))
            stance = machine.solve(*in_work[:2], tools, configuration)
            margin[rows] = np.maximum(reach(machine, in_work[0], stance).margin, UNREACHABLE).reshape(-1, n)
            possible = margin[rows][:, self.cuts].min(axis=1, initial=np.inf) >= 0.0
            wanted = np.flatnonzero(np.logical_and.outer(possible, self.path.headline).ravel())
            if len(wanted):
                some, values = poses_taken(in_work, wanted), np.full(len(rows) * n, np.nan)
                values[wanted] = stiffness_within(self.model, stance.take(wanted), some, self.load, self.force)[0]
                stiffness[rows] = values.reshape(-1, n)
        return stiffness, margin

    def _kernel_rows(
        self, tool: float, tip: FloatArray, motions: list[FloatArray], rotation: FloatArray | None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Compliance along the load of each motion, margin and law at n poses with one tool; (3, n), (3, n), (9, n)."""
        machine, turns = as_hexapod(self.model.machine, "the closed form"), _matrices(rotation)
        directions = motions
        if self.direct and self.load.kind != "tangential":
            directions = [geometric_directions(self.load, tip.T, turns, motion.T)[0].T for motion in motions]
        kernel = closed_form.prepare(machine, tool)
        along, determinant, lengths, good = closed_form.compliance_along_columns(
            kernel, tip, np.stack(directions), rotation
        )
        extremes = Extremes(machine, tip, lengths, determinant, rotation, tool)
        margin, law = extremes.margin, machine.strut_law.room_of(extremes.shortest, extremes.longest)
        doubtful = np.flatnonzero(~good & ~(margin < 0.0))  # ill-conditioned for the closed form: pivot
        if len(doubtful):
            there, leaning = tip[:, doubtful].T, None if turns is None else turns[doubtful]
            margin[doubtful] = reach(machine, there, solve_struts(machine, there, leaning, tool), leaning).margin
            for compliance, motion in zip(along, motions, strict=True) if self.direct else ():
                compliance[doubtful] = 1.0 / self._evaluated(there, motion[:, doubtful].T, leaning, tool)
        return along, margin, law

    def _with_effects(
        self, position: FloatArray, motion: FloatArray, rotation: FloatArray | None, margin: FloatArray
    ) -> FloatArray:
        """(k, h) N/m at the headline samples if all cuts are in reach, by the closed form where possible."""
        head = np.flatnonzero(self.path.headline)
        stiffness = np.full((len(margin), len(head)), np.nan)
        possible = np.flatnonzero((margin[:, self.cuts] >= 0.0).all(axis=1))
        if not len(possible):
            return stiffness

        def some(columns: FloatArray) -> FloatArray:
            """Columns of the headline samples, at the feasible placements."""
            return columns[:, possible][:, :, head].reshape(len(columns), -1)

        tip, towards = some(position).T, some(motion).T
        turn = None if rotation is None else some(rotation)
        turns, tools = _matrices(turn), np.tile(self.path.tool_length[head], len(possible))
        direction, known = geometric_directions(self.load, tip, turns, towards)
        values = np.full(len(tip), np.nan)
        for tool, rows in core.rows_of_tools(tools) if self.load.kind not in COMPLIANCE_DECIDES else []:
            there, along = (np.ascontiguousarray(columns[rows].T) for columns in (tip, direction))
            leaning = None if turn is None else np.ascontiguousarray(turn[:, rows])
            values[rows] = 1.0 / core.compliance_with_effects(self.model, there, along, leaning, tool, self.force)
        left = np.flatnonzero(~(known & (values > 0.0) & (values < np.inf)))
        if len(left):
            leaning = None if turns is None else turns[left]
            values[left] = self._evaluated(tip[left], towards[left], leaning, tools[left])
        stiffness[possible] = values.reshape(len(possible), -1)
        return stiffness

    def _evaluated(
        self, tip: FloatArray, motion: FloatArray, rotation: FloatArray | None, tool: FloatArray | float
    ) -> FloatArray:
        abc = np.zeros((len(tip), 3)) if rotation is None else roll_pitch_yaw(rotation)
        return evaluate(self.model, tip, abc, motion, tool, self.load, self.force).stiffness


def _matrices(rotation: FloatArray | None) -> FloatArray | None:
    """(n, 3, 3) matrices from columns (9, n)."""
    return None if rotation is None else rotation.T.reshape(-1, 3, 3)


def _turned(turn: FloatArray, columns: FloatArray) -> FloatArray:
    """(3, k, n) columns (3, n) turned by k rotations (k, 3, 3)."""
    k = len(turn)
    return product(turn.swapaxes(0, 1).reshape(3 * k, 3), columns).reshape(3, k, -1)


def _columns(those: BoolArray) -> IntArray | slice:
    """Columns marked true; a slice, which copies nothing, if they are contiguous."""
    columns = np.flatnonzero(those)
    if len(columns) and columns[-1] - columns[0] + 1 == len(columns):
        return slice(int(columns[0]), int(columns[-1]) + 1)
    return columns
