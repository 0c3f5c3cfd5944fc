"""Machines in series: one chain of joints carries the tool, another one may carry the work.

Three- and five-axis mills (tables, heads, both), robots of six joints, on a rail or beside a rotary table. Inverse
kinematics in closed form where the joints allow it: a spherical wrist (`wrist`), or three linear axes and up to two
rotary ones (`rotary_axes`); else by bounded Newton steps (`newton`). Joints beyond those that a pose takes, a rail,
a table beside a robot, stay where they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.bodies import Body, SpanningBeam
from toolpath_stiff.machine.chain import STILL, ChainJoint, Frame, Placement, applied, chain_frames, columns_of, rows_of
from toolpath_stiff.machine.elements import Element, Stance
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.machine.rotary_axes import RotaryAxes
from toolpath_stiff.machine.winding import joint_margin, wound
from toolpath_stiff.machine.wrist import CONFIGURATIONS, SINGULARITIES, SphericalWrist
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import deg_from_rad

LETTERS = ("A", "B", "C")


@dataclass(frozen=True, kw_only=True)
class Serial(MachineTool):
    """A machine of joints in series.

    Attributes
    ----------
    tool_joints, work_joints
        From the base to the tool and to the work; their values in results in this order.
    tip
        The tip of the reference tool in the last frame of the tool's chain; z from tip to shank.
    work
        Work axes in the last frame of the work's chain.
    tool_bodies, work_bodies
        What gives way on either side.
    least
        Smallest admissible singularity measures, by name.
    """

    kind: ClassVar[str] = "serial"
    beyond: ClassVar[str] = "no joint values reach the pose"

    tool_joints: tuple[ChainJoint, ...]
    work_joints: tuple[ChainJoint, ...] = ()
    tip: Placement = STILL
    work: Placement = STILL
    tool_bodies: tuple[Body | SpanningBeam, ...] = ()
    work_bodies: tuple[Body | SpanningBeam, ...] = ()
    least: dict[str, float] = field(default_factory=dict)

    @property
    def joints(self) -> tuple[ChainJoint, ...]:
        """All joints."""
        return (*self.tool_joints, *self.work_joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def joint_kinds(self) -> tuple[str, ...]:
        """Of each joint "linear" or "rotary"."""
        return tuple("linear" if joint.linear else "rotary" for joint in self.joints)

    @property
    def joint_limits(self) -> FloatArray:
        """(j, 2) m or rad; inf: none."""
        return np.array([(joint.low, joint.high) for joint in self.joints])

    @property
    def elements(self) -> tuple[Element, ...]:
        """What gives way, from the base to the tool, then to the work."""
        return tuple(body.element for body in (*self.tool_bodies, *self.work_bodies))

    @property
    def configurations(self) -> tuple[str, ...]:
        """Names of the ways to reach a pose."""
        return CONFIGURATIONS if self.wrist else ("",)

    @property
    def wrist(self) -> SphericalWrist | None:
        """The closed form of its last six joints, if they have one."""
        return self.once("wrist", lambda: SphericalWrist.of(self.tool_joints[-6:], self.tip))

    @property
    def rotary_axes(self) -> RotaryAxes | None:
        """Its rotary axes between work and tool where all other joints are three linear ones."""
        return self.once("rotary axes", self._rotary_axes)

    def _rotary_axes(self) -> RotaryAxes | None:
        rotary = [joint for joint in self.joints if not joint.linear]
        if len(rotary) > 2 or len(self.joints) - len(rotary) != 3:
            return None
        still = np.zeros((len(self.joints), 1))
        tool, work = self._frames(still)
        base = work[-1].axes[..., 0].T
        of_work = [-(base @ f.axes[:, 2, 0]) for j, f in zip(self.work_joints, work[1:-1], strict=True) if not j.linear]
        of_tool = [base @ f.axes[:, 2, 0] for j, f in zip(self.tool_joints, tool[1:-1], strict=True) if not j.linear]
        return RotaryAxes((*reversed(of_work), *of_tool), base @ tool[-1].axes[..., 0])

    def _frames(self, values: FloatArray) -> tuple[list[Frame], list[Frame]]:
        """Frames of both chains at joint values (j, n): the base, one a joint, then the tip and the work."""
        count = len(self.tool_joints)
        tool, work = chain_frames(self.tool_joints, values[:count]), chain_frames(self.work_joints, values[count:])
        return [*tool, tool[-1].moved(self.tip)], [*work, work[-1].moved(self.work)]

    def rotation_of(self, abc: FloatArray) -> FloatArray:
        """(n, 3, 3) tool axes in work axes of a program's words A, B, C (n, 3) rad.

        On a machine of rotary axes they are the values of the axes of these letters; else roll, pitch, yaw.
        Raises `InputError` for a word whose axis is missing.
        """
        if (axes := self.rotary_axes) is None:
            return rotation_matrices(abc)
        rotary = [joint.name for joint in self.joints if not joint.linear]
        for i, letter in enumerate(LETTERS):
            turned = np.flatnonzero(abc[:, i]) if letter not in rotary else []
            if len(turned):
                mistake = f"{letter}{deg_from_rad(float(abc[turned[0], i])):g} on machine {self.name}, which has no axis {letter}"
                raise InputError(mistake, expected=f"words of its axes {', '.join(self.joint_names)}")
        order = [*reversed([j.name for j in self.work_joints if not j.linear]), *(j.name for j in self.tool_joints if not j.linear)]
        angles = [abc[:, LETTERS.index(name)] for name in order]
        return np.broadcast_to(rows_of(axes.rotation(angles)), (len(abc), 3, 3))

    def forward(self, joints: ArrayLike, tool_length: ArrayLike = np.nan) -> tuple[FloatArray, FloatArray]:
        """Tip (n, 3) m and tool axes (n, 3, 3) in work axes at joint values (n, j)."""
        values = np.atleast_2d(np.asarray(joints, dtype=float))
        tool, work = (frames[-1] for frames in self._frames(values.T))
        axes = np.einsum("jin,jkn->ikn", *np.broadcast_arrays(work.axes, tool.axes))
        position = (work.axes * (tool.origin - work.origin)[:, None]).sum(axis=0)
        position = position - axes[:, 2] * self.extension(tool_length)
        n = len(values)
        return np.broadcast_to(position.T, (n, 3)), np.broadcast_to(columns_to_rows(axes), (n, 3, 3))

    def solve(
        self,
        position: ArrayLike,
        rotation: ArrayLike | None = None,
        tool_length: ArrayLike = np.nan,
        configuration: int | None = None,
        start: ArrayLike | None = None,
    ) -> Stance:
        """How the machine stands with its tip at (n, 3) m and tool axes (n, 3, 3), both in work axes.

        Parameters
        ----------
        position, rotation
            The pose; None: tool along z.
        tool_length
            m, scalar or (n,); nan: the reference tool.
        configuration
            Number of the configuration at all poses; None: at each the one farthest from the limits of the joints.
        start
            (j,) joint values before the first pose: rotary joints then wind on from pose to pose.
        """
        tip = np.atleast_2d(np.asarray(position, dtype=float)).T
        axes = np.eye(3)[..., None] if rotation is None else columns_of(np.asarray(rotation, dtype=float))
        reference = tip + axes[:, 2] * self.extension(tool_length)
        held = self._held(start)
        before = None if start is None else np.asarray(start, dtype=float)
        low, high = self.joint_limits.T
        joints, chosen, margin = np.empty(0), np.zeros(tip.shape[1], dtype=np.int64), np.empty(0)
        for number, values in enumerate(self._solutions(reference, axes, held)):
            if configuration is not None and len(self.configurations) > 1 and number != configuration:
                continue
            values = wound(values, low, high, self.joint_kinds, before)
            room = joint_margin(values, low, high)
            if not len(joints):
                joints, margin, chosen = values, room, np.full(tip.shape[1], number)
                continue
            better = room > margin
            joints, margin, chosen = np.where(better, values, joints), np.where(better, room, margin), np.where(better, number, chosen)
        return self._stance(joints, chosen, tool_length)
