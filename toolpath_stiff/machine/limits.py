"""Reach: how far each pose is from each limit of the machine, and which limit is nearest."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray, product
from toolpath_stiff.machine.kinematics import (
    Struts,
    joint_angles,
    neutral_axes,
    singularity_index,
    solve_struts_at,
)
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.units import deg_from_rad, mm_from_m

# What limits bound: strut lengths, swing of the joints at frame and platform, the tool tip, the singularity index.
STRUT, FRAME, PLATFORM, SINGULARITY = "strut", "frame", "platform", "singularity"
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Limit:
    """One bound: its name, the bound, whether it is a lower one, the span that margins are counted in.

    `span` is max - min where there are two bounds, else the distance of the bound from the value's natural
    end (0 for angles, 1 for the singularity index). `quantity` is what it bounds (`STRUT` and so on); the limits of
    one quantity on one side differ by the joint or strut alone.
    """

    name: str
    quantity: str
    bound: float
    lower: bool
    span: float
    unit: str

    def margin(self, value: FloatArray) -> FloatArray:
        """Distance of values from the bound as a share of the span: 0 at the bound, negative beyond."""
        return np.asarray((value - self.bound if self.lower else self.bound - value) / self.span)


def machine_limits(machine: Machine) -> tuple[Limit, ...]:
    """The finite limits of a machine, in the order of `reach`'s columns."""
    return tuple(limit for limit in _all_limits(machine) if np.isfinite(limit.bound))


def _all_limits(machine: Machine) -> list[Limit]:
    limits = machine.limits
    low, high = limits.strut_length
    span = high - low if np.isfinite(high) else max(low, 1.0)
    found: list[Limit] = []
    for i in range(6):
        found += [
            Limit(f"strut{i + 1} min length", STRUT, low, True, span, "mm"),
            Limit(f"strut{i + 1} max length", STRUT, high, False, span, "mm"),
        ]
    for quantity, angle in ((FRAME, limits.frame_joint_angle), (PLATFORM, limits.platform_joint_angle)):
        found += [Limit(f"{quantity} joint{i + 1} angle", quantity, angle, False, angle, "deg") for i in range(6)]
    lower, upper = limits.workspace
    for axis, lo, hi in zip(AXES, lower, upper, strict=True):
        both = hi - lo if np.isfinite(hi - lo) else 1.0
        found += [
            Limit(f"workspace {axis} min", axis, float(lo), True, float(both), "mm"),
            Limit(f"workspace {axis} max", axis, float(hi), False, float(both), "mm"),
        ]
    found.append(Limit("singularity", SINGULARITY, limits.singularity, True, 1.0 - limits.singularity, ""))
    return found


@dataclass(frozen=True)
class Reach:
    """How n poses stand to the limits.

    Attributes
    ----------
    margin
        (n,) smallest distance to a limit, as a share of that limit's span: 0 at the limit, negative beyond.
    limit
        (n,) index into `limits` of that limit.
    value
        (n,) the value that the limit bounds (SI).
    limits
        The machine's limits.
    """

    margin: FloatArray
    limit: IntArray
    value: FloatArray
    limits: tuple[Limit, ...]

    @property
    def reachable(self) -> BoolArray:
        """(n,) whether every limit is kept."""
        return np.asarray(self.margin >= 0.0)

    def describe(self, i: int) -> str:
        """Which limit pose i meets or breaks, and by how much, in words and shop units."""
        if not self.limits:
            return "no limit"
        limit = self.limits[int(self.limit[i])]
        value, bound = _shown(limit, float(self.value[i])), _shown(limit, limit.bound)
        if self.margin[i] >= 0.0:
            return f"{limit.name} at {value}, limit {bound}"
        beyond = _shown(limit, abs(float(self.value[i]) - limit.bound))
        return f"{limit.name} needs {value}, limit {bound}, {beyond} beyond"


def _shown(limit: Limit, value: float) -> str:
    if limit.unit == "mm":
        return f"{mm_from_m(value):.3f} mm"
    if limit.unit == "deg":
        return f"{deg_from_rad(value):.2f} deg"
    return f"{value:.4f}"


def reach(machine: Machine, position: ArrayLike, struts: Struts, rotation: ArrayLike | None = None) -> Reach:
    """Margin to every limit at n poses.

    Parameters
    ----------
    machine
        The machine.
    position
        (n, 3) m, tool tip.
    struts
        The struts at these poses.
    rotation
        (n, 3, 3); None: vertical.

    Examples
    --------
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.machine.kinematics import solve_struts
    >>> machine = load_machine("nist")
    >>> position = [[0.0, 0.0, 0.8], [0.0, 0.0, 3.0]]
    >>> found = reach(machine, position, solve_struts(machine, position))
    >>> found.reachable
    array([ True, False])
    >>> found.describe(1)
    'workspace z max needs 3000.000 mm, limit 1700.000 mm, 1300.000 mm beyond'
    """
    tip = np.atleast_2d(np.asarray(position, dtype=float))
    frame, platform = joint_angles(machine, struts, rotation)
    columns = np.concatenate(
        [
            np.repeat(struts.lengths, 2, axis=1),
            frame,
            platform,
            np.repeat(tip, 2, axis=1),
            singularity_index(machine, struts)[:, None],
        ],
        axis=1,
    )
    everything = _all_limits(machine)
    finite = [i for i, limit in enumerate(everything) if np.isfinite(limit.bound)]
    limits = tuple(everything[i] for i in finite)
    if not limits:
        nothing = np.full(len(tip), np.inf)
        return Reach(nothing, np.zeros(len(tip), dtype=np.int64), nothing, ())
    values = columns[:, finite]
    bound = np.array([limit.bound for limit in limits])
    sign = np.array([1.0 if limit.lower else -1.0 for limit in limits])
    span = np.array([limit.span for limit in limits])
    margins = sign * (values - bound) / span
    worst = np.argmin(margins, axis=1)
    rows = np.arange(len(tip))
    return Reach(margins[rows, worst], worst, values[rows, worst], limits)


# A cosine above this is no measure of an angle: rounding moves the arc cosine by more than 1e-15 rad.
NEARLY_ONE = 0.98


@dataclass(frozen=True)
class Gauge:
    """The limits of a machine prepared for poses whose strut lengths and determinants are known already.

    It gives what `reach` gives, for the extreme strut and the extreme joint alone: a kernel of the stiffness has both
    lengths and determinants, and reach by itself takes ten times as long.

    Attributes
    ----------
    machine
        The machine.
    limits
        All its finite limits, as `machine_limits`.
    distinct
        Of each quantity and side one limit, and the columns of `limits` that are of its kind.
    axes
        Neutral axes of the frame joints and of the platform joints, as `neutral_axes`.
    determinant
        |det J| at the neutral pose, m^3.
    """

    machine: Machine
    limits: tuple[Limit, ...]
    distinct: tuple[tuple[Limit, IntArray], ...]
    axes: tuple[FloatArray, FloatArray]
    determinant: float

    @cached_property
    def by_span(self) -> list[tuple[float, list[Limit]]]:
        """The distinct limits whose margins are counted in the same span."""
        return [
            (span, [limit for limit, _ in self.distinct if limit.span == span])
            for span in dict.fromkeys(limit.span for limit, _ in self.distinct)
        ]

    def reach(
        self,
        position: FloatArray,
        lengths: FloatArray,
        determinant: FloatArray,
        rotation: FloatArray | None,
        tool: float,
    ) -> tuple[Reach, BoolArray]:
        """How n poses with one tool stand to the limits.

        Parameters
        ----------
        position
            (3, n) m, tool tip; poses last, as in all of these.
        lengths
            (6, n) m.
        determinant
            (n,) |det J|, m^3.
        rotation
            (9, n) rows of the rotation matrices one after the other; None: vertical.
        tool
            m, length of the tool; nan: the reference tool.

        Returns
        -------
        reach, sure
            As of `reach`; (n,) false where an angle too small for its cosine decides, and `reach` must be asked.
        """
        n = position.shape[1]
        extremes = Extremes(self, position, lengths, determinant, rotation, tool)
        margin, value, which = np.full(n, np.inf), np.full(n, np.inf), np.zeros(n, dtype=np.int64)
        for number, (limit, _) in enumerate(self.distinct):
            found = extremes.of(limit)
            apart = limit.margin(found)
            nearer = apart < margin
            np.copyto(margin, apart, where=nearer)
            np.copyto(value, found, where=nearer)
            which[nearer] = number
        column, sure = np.zeros(n, dtype=np.int64), np.ones(n, dtype=bool)
        for number, (limit, columns) in enumerate(self.distinct):
            rows = np.flatnonzero(which == number)
            column[rows] = columns[0] if len(columns) == 1 else columns[extremes.strut(limit, rows)]
            if limit.quantity in (FRAME, PLATFORM):
                sure[rows] = value[rows] > np.arccos(NEARLY_ONE)
        return Reach(margin, column, value, self.limits), sure


@dataclass
class Extremes:
    """The values of n poses that come nearest to a limit, found once for each kind of limit; arguments of `Gauge`."""

    gauge: Gauge
    position: FloatArray
    lengths: FloatArray
    determinant: FloatArray
    rotation: FloatArray | None
    tool: float
    cosines: dict[str, FloatArray] = field(default_factory=dict)
    angles: dict[str, FloatArray] = field(default_factory=dict)

    @cached_property
    def shortest(self) -> FloatArray:
        """(n,) m, the shortest strut."""
        return np.asarray(self.lengths.min(axis=0))

    @cached_property
    def longest(self) -> FloatArray:
        """(n,) m, the longest strut."""
        return np.asarray(self.lengths.max(axis=0))

    @cached_property
    def margin(self) -> FloatArray:
        """(n,) smallest margin to any limit, inf without limits."""
        n = self.position.shape[1]
        margin, nearest, apart = np.full(n, np.inf), np.empty(n), np.empty(n)
        for span, limits in self.gauge.by_span:  # as `Limit.margin`, but divided once
            nearest.fill(np.inf)
            for limit in limits:
                value = self.of(limit)
                if limit.lower:
                    np.subtract(value, limit.bound, out=apart)
                else:
                    np.subtract(limit.bound, value, out=apart)
                np.minimum(nearest, apart, out=nearest)
            nearest /= span
            np.minimum(margin, nearest, out=margin)
        return margin

    def of(self, limit: Limit) -> FloatArray:
        """(n,) the extreme values of a limit's quantity."""
        if limit.quantity == STRUT:
            return self.shortest if limit.lower else self.longest
        if limit.quantity in (FRAME, PLATFORM):
            return self._angle(limit.quantity)
        if limit.quantity == SINGULARITY:
            return np.asarray(self.determinant / self.gauge.determinant)
        return np.asarray(self.position[AXES.index(limit.quantity)])

    def strut(self, limit: Limit, rows: IntArray) -> IntArray:
        """(k,) the strut or joint that has the extreme value, of some poses; the first of several."""
        values = self.lengths if limit.quantity == STRUT else self._cosine(limit.quantity)
        some = np.ascontiguousarray(values[:, rows].T)
        lowest = limit.lower or limit.quantity != STRUT  # the smallest cosine is the largest angle
        return np.asarray(some.argmin(axis=1) if lowest else some.argmax(axis=1))

    def _angle(self, quantity: str) -> FloatArray:
        """(n,) rad, the largest angle of the frame's or the platform's joints."""
        name = self._name(quantity)
        if name not in self.angles:
            smallest = self._cosine(quantity).min(axis=0)
            self.angles[name] = np.arccos(np.clip(smallest, -1.0, 1.0, out=smallest), out=smallest)
        return self.angles[name]

    def _name(self, quantity: str) -> str:
        """The joints whose angles are those of a quantity's."""
        axes = self.gauge.axes
        return FRAME if self.rotation is None and bool((axes[0] == axes[1]).all()) else quantity

    def _cosine(self, quantity: str) -> FloatArray:
        """(6, n) cosines of the angles of the frame's or the platform's joints."""
        name = self._name(quantity)
        if name not in self.cosines:
            along = self._along_axes(self.gauge.axes[name == PLATFORM], name == PLATFORM)
            self.cosines[name] = np.divide(along, self.lengths, out=along)
        return self.cosines[name]

    def _along_axes(self, axes: FloatArray, of_platform: bool) -> FloatArray:
        """(6, n) m, components of the struts R p + tip - b along the joints' neutral axes."""
        machine, position, turns = self.gauge.machine, self.position, self.rotation
        arms, frame = machine.platform_joints_for(self.tool), machine.frame_joints
        if turns is None:
            return np.asarray(product(axes, position) + ((arms - frame) * axes).sum(axis=1)[:, None])
        if of_platform:  # the axes turn with the platform: (R a) . (R p + tip - b)
            local = (turns.reshape(3, 3, -1) * position[:, None]).sum(axis=0)
            fixed = product((frame[:, :, None] * axes[:, None]).reshape(6, 9), turns)
            return np.asarray(product(axes, local) - fixed + (axes * arms).sum(axis=1)[:, None])
        turned = product((axes[:, :, None] * arms[:, None]).reshape(6, 9), turns)
        return np.asarray(product(axes, position) + turned - (axes * frame).sum(axis=1)[:, None])


def gauge_of(machine: Machine) -> Gauge:
    """The gauge of a machine, made once."""
    return machine.once("gauge", lambda: _gauge(machine))


def _gauge(machine: Machine) -> Gauge:
    limits = machine_limits(machine)
    kinds = [(limit.quantity, limit.lower) for limit in limits]
    distinct = tuple(
        (limits[kinds.index(kind)], np.flatnonzero([kind == other for other in kinds])) for kind in dict.fromkeys(kinds)
    )
    neutral = solve_struts_at(machine, machine.limits.neutral_pose)
    determinant = float(np.abs(np.linalg.det(neutral.jacobian[0])))
    return Gauge(machine, limits, distinct, neutral_axes(machine), determinant)
