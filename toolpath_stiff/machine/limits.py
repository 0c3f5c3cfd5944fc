"""Reach: how far each pose is from each limit of the machine, and which limit is nearest."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.machine.kinematics import Struts, joint_angles, singularity_index
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


def distinct_limits(machine: Machine) -> tuple[Limit, ...]:
    """One of the finite limits for each quantity and side: the extreme strut or joint decides."""
    return tuple({(limit.quantity, limit.lower): limit for limit in machine_limits(machine)}.values())


def smallest_margin(limits: Iterable[Limit], extreme: Callable[[Limit], FloatArray]) -> FloatArray:
    """(n,) the margins of `reach` without the name of the limit, from `distinct_limits`; inf without any.

    `extreme` gives the values (n,) of a limit's quantity that come nearest to it.
    """
    margin: FloatArray = np.array(np.inf)
    for limit in limits:
        margin = np.minimum(margin, limit.margin(extreme(limit)))
    return margin


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
    >>> from toolpath_stiff.machine import load_machine, solve_struts
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
