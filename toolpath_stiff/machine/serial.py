"""Serial machines: one chain of joints carries the tool, another may carry the work.

Three- and five-axis mills (tables, heads, both), robots of six joints, on a rail or beside a rotary table. Inverse
kinematics in closed form where the joints allow it: a spherical wrist (`wrist`), or three linear axes and up to two
rotary ones (`rotary_axes`); else by bounded Newton steps (`newton`). Joints beyond those that a pose takes, a rail,
a table beside a robot, stay where they are.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.machine.bodies import Body, SpanningBeam
from toolpath_stiff.machine.chain import (
    STILL,
    ChainJoint,
    FixedFrame,
    Frame,
    chain_frames,
    columns_of,
    rows_of,
    turned_from_left,
)
from toolpath_stiff.machine.chain_search import follow
from toolpath_stiff.machine.elements import Element, Stance, joint_element
from toolpath_stiff.machine.joint_values import joint_margin, wound
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.machine.rotary_axes import RotaryAxes
from toolpath_stiff.machine.words import LETTERS, refuse_words
from toolpath_stiff.machine.wrist import CONFIGURATIONS, SINGULARITIES, SphericalWrist
from toolpath_stiff.rotations import rotation_matrices

# Smallest admissible measure of a singularity unless the file has one, assumed: the sine of three degrees.
LEAST = 0.05
GRAVITY = 9.80665  # m/s2, standard


@dataclass(frozen=True, kw_only=True)
class Serial(MachineTool):
    """A machine of joints in series.

    Attributes
    ----------
    tool_joints, work_joints
        From the base to the tool and to the work.
    order
        Numbers of these joints, the work's after the tool's, as results have them; (): so.
    tip
        The tip of the reference tool in the last frame of the tool's chain; z from tip to shank.
    work
        Work axes in the last frame of the work's chain.
    tool_bodies, work_bodies
        What gives way on either side.
    tool_masses, work_masses
        What its weight pulls at: kg, number of the frame as of a body, (3,) m in that frame.
    least
        Smallest admissible singularity measures, by name.
    only
        Number of the one configuration that is used; None: any.
    """

    kind: ClassVar[str] = "serial"
    beyond: ClassVar[str] = "no joint values reach the pose"

    tool_joints: tuple[ChainJoint, ...]
    work_joints: tuple[ChainJoint, ...] = ()
    order: tuple[int, ...] = ()
    tip: FixedFrame = STILL
    work: FixedFrame = STILL
    tool_bodies: tuple[Body | SpanningBeam, ...] = ()
    work_bodies: tuple[Body | SpanningBeam, ...] = ()
    tool_masses: tuple[tuple[float, int, FloatArray], ...] = ()
    work_masses: tuple[tuple[float, int, FloatArray], ...] = ()
    least: dict[str, float] = field(default_factory=dict)
    only: int | None = None

    @property
    def joints(self) -> tuple[ChainJoint, ...]:
        """All joints, in the order of results."""
        joints = (*self.tool_joints, *self.work_joints)
        return tuple(joints[i] for i in self.order) or joints

    @property
    def chain(self) -> IntArray:
        """(j,) number among `joints` of each joint of the tool's chain, then of the work's."""
        return np.argsort(self.order or np.arange(len(self.joints)))

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def joint_kinds(self) -> tuple[str, ...]:
        """Kind of each joint, "linear" or "rotary"."""
        return tuple("linear" if joint.linear else "rotary" for joint in self.joints)

    @property
    def joint_limits(self) -> FloatArray:
        """(j, 2) m or rad; inf: none, or a joint that stands."""
        stand = self.standing_joints
        return np.array([(-np.inf, np.inf) if j.name in stand else (j.low, j.high) for j in self.joints])

    @property
    def standing_joints(self) -> dict[str, float]:
        """Joints beyond the last six of a chain with the tool -> where they stand; a mill has none."""
        beyond = () if self.rotary_axes else (*self.tool_joints[:-6], *self.work_joints)
        return {joint.name: joint.stands for joint in beyond}

    @property
    def joint_speeds(self) -> FloatArray:
        """(j,) m/s or rad/s, largest speed of the joints; inf if not stated."""
        return np.array([joint.speed for joint in self.joints])

    @property
    def elements(self) -> tuple[Element, ...]:
        """Compliant elements, from the base to the tool, then to the work."""
        return tuple(body.element for body in (*self.tool_bodies, *self.work_bodies))

    @property
    def configurations(self) -> tuple[str, ...]:
        """Names of the ways to reach a pose."""
        if self.wrist is None:
            return ("",)
        return CONFIGURATIONS if self.only is None else (CONFIGURATIONS[self.only],)

    @property
    def wrist(self) -> SphericalWrist | None:
        """Closed form of its last six joints, if they have one."""
        return self.once("wrist", lambda: SphericalWrist.of(self.tool_joints[-6:], self.tip))

    @property
    def rotary_axes(self) -> RotaryAxes | None:
        """Rotary axes between work and tool, if all other joints are three linear ones."""
        return self.once("rotary axes", self._rotary_axes)

    def _rotary_axes(self) -> RotaryAxes | None:
        rotary = [not joint.linear for joint in self.joints]
        if sum(rotary) > 2 or len(rotary) - sum(rotary) != 3:
            return None
        tool, work = self.frames(np.zeros((len(rotary), 1)))
        base = work[-1].axes[..., 0].T
        count = len(self.tool_joints)
        # Loop from the work to the tool.
        z = [base @ direction[:, 0] for direction in _directions(tool, work)]
        loop = [i for i in (*reversed(range(count, len(z))), *range(count)) if rotary[self.chain[i]]]
        return RotaryAxes([int(self.chain[i]) for i in loop], tuple(z[i] for i in loop), base @ tool[-1].axes[..., 0])

    def motion_at_zero(self, name: str) -> FloatArray:
        """(3,) base axes: how an axis moves the tool against the work, or turns it, at joint values of 0."""
        number = int(np.flatnonzero(self.chain == self.joint_names.index(name))[0])
        return _directions(*self.frames(np.zeros((len(self.joints), 1))))[number][:, 0]

    def frames(self, values: FloatArray) -> tuple[list[Frame], list[Frame]]:
        """Frames of both chains at joint values (j, n): base, one a joint, then tip or work."""
        count, values = len(self.tool_joints), values[self.chain]
        work = chain_frames(self.work_joints, values[count:])
        return self.tool_frames(values[:count]), [*work, work[-1].moved(self.work)]

    def tool_frames(self, values: FloatArray) -> list[Frame]:
        """Frames of the tool's chain at its joint values."""
        tool = chain_frames(self.tool_joints, values)
        return [*tool, tool[-1].moved(self.tip)]

    def rotation_of(self, abc: FloatArray) -> FloatArray:
        """(n, 3, 3) tool axes in work axes for a program's words A, B, C (n, 3) rad.

        On a machine with three linear axes they are the values of the axes of these letters; else roll, pitch, yaw.
        Raises `InputError` for a word whose axis is missing.
        """
        if (axes := self.rotary_axes) is None:
            return rotation_matrices(abc)
        names = [self.joint_names[i] for i in axes.joints]
        refuse_words(self.name, abc, "".join(names))
        angles = abc[:, [LETTERS.index(name) for name in names]].T
        return np.broadcast_to(rows_of(axes.rotation(angles)), (len(abc), 3, 3))

    def forward(self, joints: ArrayLike, tool_length: ArrayLike = np.nan) -> tuple[FloatArray, FloatArray]:
        """Tip (n, 3) m and tool axes (n, 3, 3) in work axes at joint values (n, j)."""
        values = np.atleast_2d(np.asarray(joints, dtype=float))
        tool, work = (frames[-1] for frames in self.frames(values.T))
        axes = _product(work.axes.swapaxes(0, 1), tool.axes)
        position = _product(work.axes.swapaxes(0, 1), (tool.origin - work.origin)[:, None])[:, 0]
        position = position - axes[:, 2] * self.extension(tool_length)
        n = len(values)
        return np.broadcast_to(rows_of(position), (n, 3)), np.broadcast_to(rows_of(axes), (n, 3, 3))

    def solve(
        self,
        position: ArrayLike,
        rotation: ArrayLike | None = None,
        tool_length: ArrayLike = np.nan,
        configuration: int | None = None,
        start: ArrayLike | None = None,
    ) -> Stance:
        """Stance with the tip at (n, 3) m and tool axes (n, 3, 3), both in work axes.

        Parameters
        ----------
        position, rotation
            The pose; None: tool along z.
        tool_length
            m, scalar or (n,); nan: the reference tool.
        configuration
            Number of the configuration at all poses; None: at each the one farthest from the limits of the joints.
        start
            (j,) joint values before the first pose: rotary joints then wind on from pose to pose, and joints that no
            pose takes, such as a rail, stand there.
        """
        before = None if start is None else np.asarray(start, dtype=float)
        joints, chosen = self.joint_values(*self._target(position, rotation, tool_length), configuration, before)
        return self._stance(joints, chosen, self.extension(tool_length))

    def stances(
        self, position: ArrayLike, rotation: ArrayLike | None = None, tool_length: ArrayLike = np.nan
    ) -> Iterator[Stance]:
        """Stance in each configuration, without the loads of elements: enough for limits."""
        target, linear = self._target(position, rotation, tool_length), [joint.linear for joint in self.joints]
        for number, solution in self._solutions(*target, self.only, None):
            joints = wound(solution, self.joint_limits, linear, None).T
            yield Stance(joints, target[0].T, None, None, np.full(len(joints), number), ())

    def _target(
        self, position: ArrayLike, rotation: ArrayLike | None, tool_length: ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        """Tip (3, n) and axes (3, 3, n) of the reference tool in work axes."""
        tip = np.atleast_2d(np.asarray(position, dtype=float)).T
        axes = np.eye(3)[..., None] if rotation is None else columns_of(np.asarray(rotation, dtype=float))
        return tip + axes[:, 2] * self.extension(tool_length), axes

    def joint_values(
        self, tip: FloatArray, axes: FloatArray, configuration: int | None, start: FloatArray | None
    ) -> tuple[FloatArray, IntArray]:
        """(j, n) values for the reference tool's tip (3, n) and axes (3, 3, n) in work axes, (n,) configurations.

        Arguments as of `solve`.
        """
        limits, linear = self.joint_limits, [joint.linear for joint in self.joints]
        best, chosen, margin = np.empty(0), np.zeros(tip.shape[1], dtype=np.int64), np.empty(0)
        kept = configuration if self.only is None else self.only
        for number, solution in self._solutions(tip, axes, kept, start):
            values = wound(solution, limits, linear, start)
            if kept is not None or len(self.configurations) == 1:
                return values, np.full(tip.shape[1], number if self.only is None else 0)
            room = joint_margin(values, limits)
            if not len(best):
                best, margin = values, room
            better = room > margin
            best, margin = np.where(better, values, best), np.where(better, room, margin)
            chosen[better] = number
        return best, chosen

    def _solutions(
        self, tip: FloatArray, axes: FloatArray, configuration: int | None, start: FloatArray | None
    ) -> Iterator[tuple[int, FloatArray]]:
        """Number and (j, n) values of each configuration, or of one; nan where it does not reach."""
        if self.rotary_axes:
            yield 0, self._of_linear_axes(self.rotary_axes, tip, axes)
            return
        held = (np.array([joint.stands for joint in self.joints]) if start is None else start)[:, None]
        tool, work = self.frames(held)
        joints = np.repeat(held, tip.shape[1], axis=1)
        first = len(self.tool_joints) - 6
        moving, still = self.chain[first : first + 6], held[self.chain[:first]]
        if self.wrist is None:
            in_base = turned_from_left(work[-1].axes[..., 0], axes)
            target = turned_from_left(work[-1].axes[..., 0], tip[:, None])[:, 0] + work[-1].origin
            in_base = np.broadcast_to(in_base, (3, 3, tip.shape[1]))

            def frames(values: FloatArray) -> list[Frame]:
                return self.tool_frames(np.concatenate([np.repeat(still, values.shape[1], 1), values]))[first:]

            before = None if start is None else start[moving]
            joints[moving] = follow(self.tool_joints[first:], frames, target, in_base, before).T
            yield 0, joints
            return
        base = tool[first].placement.inverse().then(work[-1].placement)
        local = turned_from_left(base.axes, tip[:, None])[:, 0] + base.origin[:, None]
        local_axes = turned_from_left(base.axes, np.broadcast_to(axes, (3, 3, tip.shape[1])))
        for number, values in self.wrist.solutions(local_axes, local, configuration):
            joints[moving] = values
            yield number, joints.copy()

    def _of_linear_axes(self, rotary: RotaryAxes, tip: FloatArray, axes: FloatArray) -> FloatArray:
        """(j, n) values of three linear axes and the rotary ones: angles first, then the linear axes meet the tip."""
        values = np.zeros((len(self.joints), tip.shape[1]))
        angles, pointed = rotary.angles(axes)
        for i, angle in zip(rotary.joints, angles, strict=True):
            values[i] = angle
        tool, work = self.frames(values)
        along = dict(zip(self.chain.tolist(), _directions(tool, work), strict=True))
        linear = [i for i, joint in enumerate(self.joints) if joint.linear]
        a, b, c = (along[i] for i in linear)
        missing = _product(work[-1].axes, tip[:, None])[:, 0] + work[-1].origin - tool[-1].origin
        volume = (a * np.cross(b, c, axis=0)).sum(axis=0)
        for i, (second, third) in zip(linear, ((b, c), (c, a), (a, b)), strict=True):  # Cramer's rule
            values[i] = (missing * np.cross(second, third, axis=0)).sum(axis=0) / volume
        return np.where(pointed, values, np.nan)

    def standing(self, joints: FloatArray, tool_length: ArrayLike = np.nan) -> Stance:
        """Stance at joint values (n, j)."""
        return self._stance(joints.T, np.zeros(len(joints), dtype=np.int64), self.extension(tool_length))

    def joint_of(self, element: str) -> int:
        """Number of the joint that an element is."""
        names = [joint_element(name) for name in self.joint_names]
        return names.index(element) if element in names else super().joint_of(element)

    def with_longer_link(self, joint: int, by: float) -> Self:
        """Machine with the joint's origin moved further from that of the previous joint, in the latter's frame."""
        sides = {"tool_joints": self.tool_joints, "work_joints": self.work_joints}
        chosen = self.joints[joint]
        longer = replace(chosen, place=chosen.place.longer(by))
        return self.with_changes(
            **{key: tuple(longer if j is chosen else j for j in some) for key, some in sides.items()}
        )

    def _stance(self, joints: FloatArray, chosen: IntArray, extension: FloatArray) -> Stance:
        """Stance at joint values (j, n) with tools longer than the reference tool by `extension`."""
        tool, work = self.frames(joints)
        reference = tool[-1]
        tool[-1] = Frame(reference.axes, reference.origin - reference.axes[:, 2] * extension)
        n = joints.shape[1]
        turns = not np.array_equal(work[-1].axes, np.eye(3)[..., None])
        loads = [body.spring(tool) for body in self.tool_bodies] + [body.spring(work) for body in self.work_bodies]
        return Stance(
            joints=joints.T,
            position=np.broadcast_to(tool[-1].origin, (3, n)).T,
            rotation=np.broadcast_to(tool[-1].axes, (3, 3, n)).transpose(2, 0, 1),
            work_axes=np.broadcast_to(work[-1].axes, (3, 3, n)).transpose(2, 0, 1) if turns else None,
            configuration=chosen,
            loads=tuple(loads),
        )

    def weight_loads(self, stance: Stance) -> FloatArray:
        """(n, r) N and N m, loads of the elements under the masses they carry; gravity along -z of the base."""
        loads, springs = [], iter(stance.loads)
        sides = ((self.tool_bodies, self.tool_masses), (self.work_bodies, self.work_masses))
        for frames, (bodies, masses) in zip(self.frames(stance.joints.T), sides, strict=True):
            for body in bodies:
                wrench = np.zeros((len(stance), 6))
                for mass, frame, place in masses:
                    if frame >= body.carrier:
                        force = np.array([0.0, 0.0, -GRAVITY * mass])
                        wrench[:, :3] += force
                        wrench[:, 3:] += np.cross(frames[frame].point(place) - stance.position, force)
                loads.append(np.einsum("nri,ni->nr", next(springs).rows(stance.position), wrench))
        return np.concatenate(loads, axis=1)

    @property
    def singularity_names(self) -> tuple[str, ...]:
        """Names of the measures of `singularities`."""
        return SINGULARITIES if self.wrist else ()

    @property
    def singularity_margins(self) -> tuple[float, ...]:
        """Smallest admissible measures."""
        return tuple(self.least.get(name, LEAST) for name in self.singularity_names)

    def singularities(self, stance: Stance) -> FloatArray:
        """(n, s) distance from singularity: 1 far, 0 singular. A serial machine's compliance does not show it."""
        if self.wrist is None:
            return np.empty((len(stance), 0))
        first = len(self.tool_joints) - 6
        return self.wrist.singularities(stance.joints.T[self.chain[first : first + 6]]).T

    def lines(self, stance: Stance) -> list[tuple[str, FloatArray]]:
        """Lines of a picture: names and polylines (n, p, 3) m, base axes.

        From joint to joint where joints turn on the tool's side, else from body to body; to the tip, to the work.
        """
        tool, work = self.frames(stance.joints.T)
        tip = Frame(tool[-1].axes, stance.position.T)
        turning = any(not joint.linear for joint in self.tool_joints)
        stops = [(joint.name, frame.origin) for joint, frame in zip(self.tool_joints, tool[1:-1], strict=True)]
        if not turning:
            stops = [(body.element.name, body.spring(tool).place.T) for body in self.tool_bodies]
        sides = [[("base", tool[0].origin), *stops, ("tool", tip.origin)]]
        stops = [(body.element.name, body.spring(work).place.T) for body in self.work_bodies]
        sides.append([("base", work[0].origin), *stops, ("work", work[-1].origin)] if stops else [])
        drawn = []
        for side in sides:
            for (_, start), (name, end) in pairwise(side):
                points = [np.broadcast_to(point.reshape(3, -1), (3, len(stance))).T for point in (start, end)]
                drawn.append((name, np.stack(points, axis=1)))
        return drawn


def _directions(tool: list[Frame], work: list[Frame]) -> list[FloatArray]:
    """(3, n) base axes: direction along or about which each joint of the chains moves the tool against the work."""
    return [frame.axes[:, 2] for frame in tool[1:-1]] + [-frame.axes[:, 2] for frame in work[1:-1]]


def _product(left: FloatArray, right: FloatArray) -> FloatArray:
    """(i, k, n) product of (i, j, n) and (j, k, n)."""
    return np.asarray(sum(left[:, j, None] * right[None, j] for j in range(3)))
