"""Reach: distance of each pose from each limit of the machine, and the nearest limit."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray, product
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.kinematics import (
    Struts,
    joint_angles,
    neutral_axes,
    neutral_determinant,
    singularity_index,
    solve_struts,
)
from toolpath_stiff.machine.model import Hexapod, Limits, MachineTool, as_hexapod
from toolpath_stiff.poses import Pose
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import deg_from_rad, mm_from_m

# Quantities with limits: strut lengths, swing of frame and platform joints, tool tip, singularity index.
STRUT, FRAME, PLATFORM, SINGULARITY, JOINTS = "strut", "frame", "platform", "singularity", "joints"
AXES = ("x", "y", "z")
WIDEST, ROUNDS, DRAWN = 4.0, 9, 500  # m, rounds, draws in each, in the search for the middle of a workspace


@dataclass(frozen=True)
class Limit:
    """One limit: its name, the bound, True if it is a lower bound, the span in which margins are counted.

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


def machine_limits(machine: MachineTool) -> tuple[Limit, ...]:
    """Finite limits of a machine, in the order of `reach`'s columns."""
    return _finite_limits(machine)[0]


def _finite_limits(machine: MachineTool) -> tuple[tuple[Limit, ...], list[int]]:
    """Finite limits, and their numbers among all limits."""

    def finite() -> tuple[tuple[Limit, ...], list[int]]:
        everything = _all_limits(machine) if isinstance(machine, Hexapod) else _joint_limits(machine)
        rows = [i for i, limit in enumerate(everything) if np.isfinite(limit.bound)]
        return tuple(everything[i] for i in rows), rows

    return machine.once("limits", finite)


def _all_limits(machine: Hexapod) -> list[Limit]:
    limits = machine.limits
    low, high = limits.strut_length
    span = high - low if np.isfinite(high) else max(low, 1.0)
    bounds: list[Limit] = []
    for i in range(1, 7):
        bounds.append(Limit(f"strut{i} min length", STRUT, low, True, span, "mm"))
        bounds.append(Limit(f"strut{i} max length", STRUT, high, False, span, "mm"))
    for quantity, angle in ((FRAME, limits.frame_joint_angle), (PLATFORM, limits.platform_joint_angle)):
        bounds += [Limit(f"{quantity} joint{i} angle", quantity, angle, False, angle, "deg") for i in range(1, 7)]
    bounds += _workspace_limits(limits)
    return [*bounds, Limit("singularity", SINGULARITY, limits.singularity, True, 1.0 - limits.singularity, "")]


def _workspace_limits(limits: Limits) -> list[Limit]:
    sides = zip(AXES, *limits.workspace.tolist(), strict=True)
    return [limit for axis, low, high in sides for limit in _both_ends(f"workspace {axis}", axis, low, high, "mm")]


def _both_ends(name: str, quantity: str, low: float, high: float, unit: str) -> list[Limit]:
    span = high - low if np.isfinite(high - low) else 1.0
    return [
        Limit(f"{name} min", quantity, low, True, span, unit),
        Limit(f"{name} max", quantity, high, False, span, unit),
    ]


def _joint_limits(machine: MachineTool) -> list[Limit]:
    """Limits of a machine of any kind: joints, workspace, singularities, and existence of joint values."""
    bounds: list[Limit] = []
    for name, kind, (low, high) in zip(machine.joint_names, machine.joint_kinds, machine.joint_limits, strict=True):
        bounds += _both_ends(name, name, float(low), float(high), "mm" if kind == "linear" else "deg")
    bounds += _workspace_limits(machine.limits)
    measures = zip(machine.singularity_names, machine.singularity_margins, strict=True)
    bounds += [Limit(name, SINGULARITY, least, True, 1.0 - least, "") for name, least in measures]
    return [*bounds, Limit("reach", JOINTS, 0.0, True, 1.0, "")]


@dataclass(frozen=True)
class Reach:
    """Margins of n poses to the limits.

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
        """(n,) True where every limit is kept."""
        return np.asarray(self.margin >= 0.0)

    def describe(self, i: int) -> str:
        """Words on the limit that pose i meets or breaks, and by how much, in shop units."""
        if not self.limits:
            return "no limit"
        limit = self.limits[int(self.limit[i])]
        if limit.quantity == JOINTS:
            return "no joint values reach it" if self.margin[i] < 0.0 else "no limit"
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


def reach(
    machine: MachineTool, position: ArrayLike, struts: Struts | Stance, rotation: ArrayLike | None = None
) -> Reach:
    """Margin to every limit at n poses.

    Parameters
    ----------
    machine
        The machine.
    position
        (n, 3) m, tool tip, work axes.
    struts
        How it stands at these poses.
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
    limits, finite = _finite_limits(machine)
    if not limits:
        nothing = np.full(len(tip), np.inf)
        return Reach(nothing, np.zeros(len(tip), dtype=np.int64), nothing, ())
    bounded = _bounded(machine, tip, struts, rotation)
    margin, which, value = np.full(len(tip), np.inf), np.zeros(len(tip), dtype=np.int64), bounded[finite[0]].copy()
    margin[np.isnan(tip).any(axis=1)] = np.nan
    for number, (limit, column) in enumerate(zip(limits, finite, strict=True)):
        apart = limit.margin(bounded[column])
        nearer = apart < margin
        np.copyto(margin, apart, where=nearer)
        np.copyto(value, bounded[column], where=nearer)
        which[nearer] = number
    return Reach(margin, which, value, limits)


def _bounded(
    machine: MachineTool, tip: FloatArray, stance: Struts | Stance, rotation: ArrayLike | None
) -> list[FloatArray]:
    """(n,) values for each of the machine's limits, including infinite ones."""
    joints, tips = ([column for column in values.T for _ in range(2)] for values in (stance.joints, tip))
    if isinstance(stance, Struts):
        hexapod = as_hexapod(machine, "a pose of struts")
        angles = [column for values in joint_angles(hexapod, stance, rotation) for column in values.T]
        return [*joints, *angles, *tips, singularity_index(hexapod, stance)]
    beyond = np.where(np.isnan(stance.joints).any(axis=1), -np.inf, np.inf)  # where nan, no other limit is nearer
    return [*joints, *tips, *machine.singularities(stance).T, beyond]


def solved(
    machine: MachineTool, position: FloatArray, rotation: FloatArray | None = None, tool_length: ArrayLike = np.nan
) -> Struts | Stance:
    """Stance of a machine at n poses; arguments as for `MachineTool.solve`."""
    if isinstance(machine, Hexapod):
        return solve_struts(machine, position, rotation, tool_length)
    return machine.solve(np.atleast_2d(position), rotation, tool_length)


def stand(machine: MachineTool, pose: ArrayLike) -> tuple[FloatArray, Struts | Stance, Reach]:
    """Tip of a pose (6,), m and rad, the machine's stance there, and its margins to the limits."""
    values = np.asarray(pose, dtype=float)
    turn = rotation_matrices(values[None, 3:])
    stance = solved(machine, values[None, :3], turn)
    return values, stance, reach(machine, values[:3], stance, turn)


def upright_middle(machine: MachineTool) -> Pose:
    """Place farthest from all limits with the tool upright, by random draws in shrinking boxes around the best."""
    rng, best = np.random.default_rng(0), np.zeros(3)
    for half in WIDEST * 0.5 ** np.arange(ROUNDS):
        places = best + half * rng.uniform(-1.0, 1.0, (DRAWN, 3))
        places[0] = best
        best = places[int(np.argmax(reach(machine, places, machine.solve(places)).margin))]
    x, y, z = (best.round(2) + 0.0).tolist()  # to 10 mm
    return (x, y, z, 0.0, 0.0, 0.0)


def working_box(machine: MachineTool) -> FloatArray:
    """(2, 3) m, corners of the box where program zero may sit: the stated workspace, otherwise the reach from it."""
    stated, origin = machine.limits.workspace, np.array(machine.default_origin[:3])
    if isinstance(machine, Hexapod) or np.isfinite(stated).all():
        return stated
    ends = np.stack([reach_along(machine, origin, sign * np.eye(3), np.eye(3)) for sign in (-1.0, 1.0)])
    return np.where(np.isfinite(stated), stated, origin + ends * [[-1.0], [1.0]])


RAY_STEPS = ((0.05, 100), (1e-3, 50), (5e-5, 20))  # m, and number: each series continues from the step before the limit


def reach_along(machine: MachineTool, start: FloatArray, directions: FloatArray, turn: FloatArray) -> FloatArray:
    """(n,) m that the tool tip can move from a place (3,) along unit vectors (n, 3) before the first limit.

    `turn` (3, 3) is the orientation, which is kept. 0 where the place itself is out of reach.
    """
    length = np.zeros(len(directions))
    for step, count in RAY_STEPS:
        tried = length[:, None] + step * np.arange(count + 1)
        tips = (start + tried[:, :, None] * directions[:, None]).reshape(-1, 3)
        turns = np.broadcast_to(turn, (len(tips), 3, 3))
        good = reach(machine, tips, solved(machine, tips, turns), turns).reachable.reshape(tried.shape)
        length += step * np.where(good.all(axis=1), count, np.maximum(good.argmin(axis=1) - 1, 0))
    return length


# Above this a cosine does not determine its angle: rounding moves the arc cosine by more than 1e-15 rad.
NEARLY_ONE = 0.98


@dataclass
class Extremes:
    """Values of n poses closest to a limit, found once for each kind of limit.

    It gives what `reach` gives of poses whose strut lengths and determinants are known already: a kernel of the
    stiffness has both, and reach by itself takes ten times as long.

    Attributes
    ----------
    machine
        The machine.
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
    """

    machine: Hexapod
    position: FloatArray
    lengths: FloatArray
    determinant: FloatArray
    rotation: FloatArray | None
    tool: float
    joints: dict[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)

    @cached_property
    def kinds(self) -> list[tuple[Limit, IntArray]]:
        """One limit for each quantity and side, and the columns of the machine's limits of that kind."""

        def kinds() -> list[tuple[Limit, IntArray]]:
            limits = machine_limits(self.machine)
            names = [(limit.quantity, limit.lower) for limit in limits]
            columns = {name: np.flatnonzero([name == other for other in names]) for name in names}
            return [(limits[where[0]], where) for where in columns.values()]

        return self.machine.once("kinds of limits", kinds)

    @cached_property
    def shortest(self) -> FloatArray:
        """(n,) m, the shortest strut."""
        return np.asarray(self.lengths.min(axis=0))

    @cached_property
    def longest(self) -> FloatArray:
        """(n,) m, the longest strut."""
        return np.asarray(self.lengths.max(axis=0))

    @cached_property
    def singularity(self) -> FloatArray:
        """(n,) singularity index."""
        return np.asarray(self.determinant / neutral_determinant(self.machine))

    @cached_property
    def margin(self) -> FloatArray:
        """(n,) smallest margin to any limit; inf without limits."""
        n = self.position.shape[1]
        margin, nearest, apart = np.full(n, np.inf), np.empty(n), np.empty(n)
        for span in dict.fromkeys(limit.span for limit, _ in self.kinds):  # as `Limit.margin`, but divided once
            nearest.fill(np.inf)
            for limit in (limit for limit, _ in self.kinds if limit.span == span):
                value = self.of(limit)
                np.subtract(value if limit.lower else limit.bound, limit.bound if limit.lower else value, out=apart)
                np.minimum(nearest, apart, out=nearest)
            nearest /= span
            np.minimum(margin, nearest, out=margin)
        return margin

    def reach(self) -> tuple[Reach, BoolArray]:
        """`Reach` of the poses; (n,) False where an angle too small for its cosine decides, and `reach` is needed."""
        n = self.position.shape[1]
        apart = [limit.margin(self.of(limit)) for limit, _ in self.kinds]
        margin = np.full(n, np.inf)
        for share in apart:
            np.minimum(margin, share, out=margin)
        nearest, column, sure = np.full(n, np.inf), np.zeros(n, dtype=np.int64), np.ones(n, dtype=bool)
        for (limit, columns), share in zip(self.kinds[::-1], apart[::-1], strict=True):  # the first of equal ones
            rows = np.flatnonzero(share == margin)
            if len(rows):
                nearest[rows] = self.of(limit)[rows]
                column[rows] = columns[0] if len(columns) == 1 else columns[self._strut(limit, rows)]
                sure[rows] = limit.quantity not in (FRAME, PLATFORM) or nearest[rows] > np.arccos(NEARLY_ONE)
        return Reach(margin, column, nearest, machine_limits(self.machine)), sure

    def of(self, limit: Limit) -> FloatArray:
        """(n,) extreme values of a limit's quantity."""
        if limit.quantity == STRUT:
            return self.shortest if limit.lower else self.longest
        if limit.quantity in (FRAME, PLATFORM):
            return self._joints(limit.quantity)[1]
        if limit.quantity == SINGULARITY:
            return self.singularity
        return np.asarray(self.position[AXES.index(limit.quantity)])

    def _strut(self, limit: Limit, rows: IntArray) -> IntArray:
        """(k,) strut or joint that has the extreme value, at some poses; the first of several."""
        values = self.lengths if limit.quantity == STRUT else self._joints(limit.quantity)[0]
        some = np.ascontiguousarray(values[:, rows].T)
        lowest = limit.lower or limit.quantity != STRUT  # the smallest cosine is the largest angle
        return np.asarray(some.argmin(axis=1) if lowest else some.argmax(axis=1))

    def _joints(self, quantity: str) -> tuple[FloatArray, FloatArray]:
        """(6, n) cosines of the angles of the frame or platform joints, and (n,) rad, the largest angle."""
        frame, platform = neutral_axes(self.machine)
        name = FRAME if self.rotation is None and bool((frame == platform).all()) else quantity
        if name not in self.joints:
            along = self._along_axes(platform if name == PLATFORM else frame, name == PLATFORM)
            cosines = np.divide(along, self.lengths, out=along)
            smallest = cosines.min(axis=0)
            self.joints[name] = cosines, np.arccos(np.clip(smallest, -1.0, 1.0, out=smallest), out=smallest)
        return self.joints[name]

    def _along_axes(self, axes: FloatArray, of_platform: bool) -> FloatArray:
        """(6, n) m, components of the struts R p + tip - b along the joints' neutral axes."""
        position, turns = self.position, self.rotation
        arms, frame = self.machine.platform_joints_for(self.tool), self.machine.frame_joints
        if turns is None:
            return np.asarray(product(axes, position) + ((arms - frame) * axes).sum(axis=1)[:, None])
        if of_platform:  # the axes turn with the platform: (R a) . (R p + tip - b)
            local = (turns.reshape(3, 3, -1) * position[:, None]).sum(axis=0)
            fixed = product((frame[:, :, None] * axes[:, None]).reshape(6, 9), turns)
            return np.asarray(product(axes, local) - fixed + (axes * arms).sum(axis=1)[:, None])
        turned = product((axes[:, :, None] * arms[:, None]).reshape(6, 9), turns)
        return np.asarray(product(axes, position) + turned - (axes * frame).sum(axis=1)[:, None])
