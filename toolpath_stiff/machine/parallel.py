"""Machines whose tool is held by six rods, struts or constraint wrenches, whatever moves their far ends.

The platform's equilibrium gives the six forces, the rods' feet and carriages carry them on.
"""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.bodies import Body, SpanningBeam
from toolpath_stiff.machine.chain import Frame, columns_of
from toolpath_stiff.machine.elements import Element, LoadRows, Spring, Stance, body_under_rods, rod_forces
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.machine.newton import newton
from toolpath_stiff.rotations import rotation_matrices

LARGEST_STEPS = np.array([0.2, 0.2, 0.2, 0.3, 0.3, 0.3])  # m and rad, of Newton's method
STEP = 1e-7  # m and rad, for differences


@dataclass(frozen=True)
class Carriage:
    """A body that carries rods: its element, the numbers of its rods, its axes (3, 3), its compliance (6,).

    `to_joints` (k, 3) m are the rods' joints from its place.
    """

    element: Element
    rods: tuple[int, ...]
    axes: FloatArray
    compliance: FloatArray
    to_joints: FloatArray


@dataclass(frozen=True)
class Legs:
    """Six legs at n poses.

    Attributes
    ----------
    joints
        (n, j) m, nan where the pose is not reached.
    directions
        (n, 6, 3) unit vectors along the forces that they put on the platform.
    arms
        (n, 6, 3) m from the tip to a point of each line of force.
    compliance
        (n, 6) m/N.
    turns
        (n, c, 3, 3) axes of the bodies that carry legs, in base axes, of which their own are given; None: the base's.
    """

    joints: FloatArray
    directions: FloatArray
    arms: FloatArray
    compliance: FloatArray
    turns: FloatArray | None = None

    @cached_property
    def determinant(self) -> FloatArray:
        """(n,) |det W|, m^3."""
        wrenches = np.concatenate([self.directions, np.cross(self.arms, self.directions)], axis=-1)
        with np.errstate(invalid="ignore", divide="ignore"):  # out of reach
            return np.asarray(np.abs(np.linalg.det(wrenches)))


@dataclass(frozen=True, kw_only=True)
class Parallel(MachineTool):
    """Base of machines with six legs.

    Attributes
    ----------
    joint_range
        (low, high) m of every joint.
    legs
        Elements of the six legs.
    carriages
        Bodies that carry legs.
    bodies
        Further bodies that give way: frame 0 is the base, 1 the tool's tip.
    least_index
        Smallest admissible singularity index: |det W| over that of the neutral pose.
    """

    beyond: ClassVar[str] = "no lengths of the legs reach the pose"
    turns: ClassVar[int] = 3  # number of the angles roll, pitch, yaw that the tool can take

    joint_range: tuple[float, float]
    legs: tuple[Element, ...]
    carriages: tuple[Carriage, ...] = ()
    bodies: tuple[Body | SpanningBeam, ...] = ()
    least_index: float = 0.0

    @abstractmethod
    def legs_at(self, tip: FloatArray, axes: FloatArray, extension: FloatArray) -> Legs:
        """Legs at tips (n, 3) m and tool axes (n, 3, 3), for tools (n,) m longer than the reference tool."""

    @abstractmethod
    def leg_ends(self, stance: Stance) -> tuple[FloatArray, FloatArray]:
        """(n, 6, 3) m each, base axes: beginnings and ends of the legs, for pictures."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the carriages that move, or of the struts that change length."""
        return tuple(part.element.name for part in self.carriages) or tuple(leg.name for leg in self.legs[:5])

    @property
    def joint_limits(self) -> FloatArray:
        """(j, 2) m, low and high."""
        return np.tile(self.joint_range, (len(self.joint_names), 1))

    @property
    def elements(self) -> tuple[Element, ...]:
        """Compliant elements: legs, carriages, other bodies."""
        others = [part.element for part in (*self.carriages, *self.bodies)]
        return (*self.legs, *others)

    def solve(
        self,
        position: ArrayLike,
        rotation: ArrayLike | None = None,
        tool_length: ArrayLike = np.nan,
        configuration: int | None = None,
        start: ArrayLike | None = None,
    ) -> Stance:
        """Stance with the tip at (n, 3) m and tool axes (n, 3, 3); None: along z.

        There is no choice: `configuration` and `start` are there as of other kinds.
        """
        tip = np.atleast_2d(np.asarray(position, dtype=float))
        axes = np.broadcast_to(np.eye(3) if rotation is None else np.asarray(rotation, dtype=float), (len(tip), 3, 3))
        legs = self._legs(tip, axes, tool_length)
        forces = rod_forces(legs.directions, legs.arms)
        loads: list[Spring | LoadRows] = [
            LoadRows(forces[:, i : i + 1], legs.compliance[:, i : i + 1]) for i in range(len(self.legs))
        ]
        for i, carriage in enumerate(self.carriages):
            rods, turn = list(carriage.rods), np.eye(3) if legs.turns is None else legs.turns[:, i]
            to_joints = carriage.to_joints @ np.swapaxes(turn, -1, -2)
            carried = body_under_rods(forces[:, rods], legs.directions[:, rods], to_joints, turn @ carriage.axes)
            loads.append(LoadRows(carried, carriage.compliance))
        frames = [Frame(np.eye(3)[..., None], np.zeros((3, 1))), Frame(columns_of(axes), tip.T)]
        return Stance(
            joints=legs.joints,
            position=tip,
            rotation=axes,
            work_axes=None,
            configuration=np.zeros(len(tip), dtype=np.int64),
            loads=(*loads, *(body.spring(frames) for body in self.bodies)),
        )

    def _legs(self, tip: FloatArray, axes: FloatArray, tool_length: ArrayLike) -> Legs:
        extension = np.broadcast_to(self.extension(tool_length), (len(tip),))
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.legs_at(tip, axes, extension)

    def forward(
        self, joints: ArrayLike, tool_length: ArrayLike = np.nan, start: ArrayLike | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Tip (n, 3) m and tool axes (n, 3, 3) for joints (n, j) m, near the neutral pose or a start.

        A start is x, y, z and the angles that the tool takes, m and rad. Raises `InputError` where no pose near it has
        such joints.
        """
        wanted, free = np.atleast_2d(np.asarray(joints, dtype=float)), 3 + self.turns

        def axes_of(pose: FloatArray) -> FloatArray:
            return rotation_matrices(np.column_stack([pose[:, 3:], np.zeros((len(pose), 6 - free))]))

        def joints_at(pose: FloatArray) -> FloatArray:
            return self._legs(pose[:, :3], axes_of(pose), tool_length).joints

        def equations(pose: FloatArray) -> tuple[FloatArray, FloatArray]:
            here = joints_at(pose)
            slopes = [(joints_at(pose + step) - here) / STEP for step in STEP * np.eye(free)]
            return here - wanted, np.stack(slopes, axis=-1)

        first = np.asarray(self.limits.neutral_pose if start is None else start, dtype=float)[..., :free]
        pose = newton(equations, np.broadcast_to(first, (len(wanted), free)), LARGEST_STEPS[:free])
        if missed := np.flatnonzero(np.isnan(pose).any(axis=1)).tolist():
            raise InputError(f"row {missed[0] + 1}: no pose near the start has such joints", hint="check the lengths")
        return pose[:, :3], axes_of(pose)

    @property
    def singularity_names(self) -> tuple[str, ...]:
        """Name of the one measure, of all legs together."""
        return ("legs",)

    @property
    def singularity_margins(self) -> tuple[float, ...]:
        """Smallest admissible index."""
        return (self.least_index,)

    def singularities(self, stance: Stance) -> FloatArray:
        """(n, 1) |det W| over that of the neutral pose."""

        def neutral() -> float:
            pose = np.array(self.limits.neutral_pose)
            return float(self._legs(pose[None, :3], rotation_matrices(pose[None, 3:]), np.nan).determinant[0])

        legs = self._legs(stance.position, stance.axes, np.nan)
        return legs.determinant[:, None] / self.once("neutral legs", neutral)

    def lines(self, stance: Stance) -> list[tuple[str, FloatArray]]:
        """Lines of a picture: names and polylines (n, p, 3) m, base axes."""
        begin, end = self.leg_ends(stance)
        legs = [
            (leg.name, np.stack([first, second], axis=1))
            for leg, first, second in zip(self.legs, np.swapaxes(begin, 0, 1), np.swapaxes(end, 0, 1), strict=False)
        ]
        outline = np.concatenate([end, end[:, :1]], axis=1)
        tool = np.stack([end.mean(axis=1), stance.position], axis=1)
        return [*legs, ("platform", outline), ("tool", tool)]
