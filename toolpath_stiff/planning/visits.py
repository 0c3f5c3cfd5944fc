"""What could be measured next: visits to poses, all reachable, and what each costs.

A visit is one pose with one tool in one set-up, clamped once: the indicator is zeroed and readings are taken along
some directions under one load or two. Visits are what costs time; further directions and loads at the same visit are
cheap.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import reach
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.readings.measurements import Measurements
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import RAD_PER_DEG

T = TypeVar("T")


AXES = ("X", "Y", "Z")


DIAGONALS = ("XY", "XZ", "YZ")


VECTORS: dict[str, tuple[float, float, float]] = {
    "X": (1.0, 0.0, 0.0),
    "Y": (0.0, 1.0, 0.0),
    "Z": (0.0, 0.0, 1.0),
    "XY": (0.5**0.5, 0.5**0.5, 0.0),
    "XZ": (0.5**0.5, 0.0, 0.5**0.5),
    "YZ": (0.0, 0.5**0.5, 0.5**0.5),
}


MINUTE = 60.0


READING_EVERY = 1.0 * MINUTE  # s between readings after zeroing; assumed


MOST_PLACES = 400  # places with their tool, set-up and waiting; more would cost time and change little


MARGIN = 0.02  # share of each limit's span that planned poses keep clear of it; assumed


ROUND, ROUND_ANGLE = 5e-3, 0.5 * RAD_PER_DEG  # planned poses are round figures, which a person keys in


UPRIGHT_SHARE = 0.25  # share of the poses with a vertical spindle


STEEP_SHARE = 0.5  # share of the others with the largest tilt


LOADS = (1e-3, 1e6)  # N, that a plan may ask for


SETUP_ELSEWHERE = "table"  # the work on the bare table, where the data know only one set-up, with a name


@dataclass(frozen=True)
class Menu:
    """What a plan may vary. Defaults are assumed; each is an option of `tps plan`.

    Attributes
    ----------
    heights
        m, of the tool tip; empty: five levels of the machine's reach on its axis.
    radius
        m, farthest from the machine's axis.
    max_tilt
        rad, of the spindle.
    loads
        N.
    tool_extensions
        m, longer than the reference tool; the first is in the spindle now.
    setups
        Names of set-ups; the first is on the table now.
    waits
        s between zeroing and the first reading; more than one lets a drift show.
    oblique
        Whether readings along the diagonals XY, XZ, YZ may be planned.
    rounds
        How often a reading may be taken in one clamping.
    measured
        Poses (m, 6) in m and rad that have been measured before, and may be again in another way.
    labels
        Names of these poses.
    floors
        Set-up -> m, below which the tool tip shall not go in it: a riser has a height that no column tells.
    timed
        Whether readings carry a time.
    usual_load
        N, where the load does not matter.
    indicators
        Whether a second indicator may be set across a link.
    """

    heights: tuple[float, ...] = ()
    radius: float = 0.3
    max_tilt: float = 25.0 * RAD_PER_DEG
    loads: tuple[float, ...] = (500.0, 1000.0, 4000.0)
    tool_extensions: tuple[float, ...] = (0.0, 0.15)
    setups: tuple[str, ...] = ("",)
    waits: tuple[float, ...] = (0.0, 10.0 * MINUTE)
    oblique: bool = True
    rounds: int = 2
    measured: FloatArray = field(default_factory=lambda: np.zeros((0, 6)))
    labels: tuple[str, ...] = ()
    floors: Mapping[str, float] = field(default_factory=dict)
    timed: bool = True
    usual_load: float = defaults.FORCE
    indicators: bool = False

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise InputError(f"{self.rounds} rounds of readings in a plan", expected="1 or more")
        for name in ("loads", "tool_extensions", "setups", "waits"):
            if not getattr(self, name):
                raise InputError(f"a plan without {name.replace('_', ' ')}", expected="at least one")
        if not LOADS[0] <= min(self.loads) <= max(self.loads) <= LOADS[1]:
            raise InputError(
                f"a plan with loads of {', '.join(f'{load:g}' for load in self.loads)} N",
                expected=f"{LOADS[0]:g} to {LOADS[1]:g} N",
            )
        if min(self.waits) < 0.0 or self.radius < 0.0 or self.max_tilt < 0.0:
            raise InputError("a plan with a negative waiting time, radius or tilt", expected="0 or more")

    @classmethod
    def of(cls, data: Measurements) -> Menu:
        """The menu after some measurements: also their poses, set-ups, tools and loads."""
        poses = np.concatenate([data.position, data.angles], axis=1)
        _, first = np.unique(np.round(poses, 6), axis=0, return_index=True)
        first = np.sort(first)
        setups = _by_last_use(map(str, data.setup))
        if len(setups) == 1 and setups[0]:
            setups = (*setups, SETUP_ELSEWHERE if setups[0] != SETUP_ELSEWHERE else "riser")
        tools = _by_last_use(map(float, np.round(data.tool_extension, 6)))
        counted = np.unique(data.force, return_counts=True)
        return cls(
            loads=tuple(sorted({*cls.loads, *data.force.tolist()})) if "force_N" not in data.missing else cls.loads,
            tool_extensions=tuple(dict.fromkeys((*tools, *cls.tool_extensions))),
            setups=setups,
            measured=poses[first],
            labels=tuple(data.point[first].tolist()),
            floors={name: _lowest(data, name) for name in setups},
            timed="time_min" not in data.missing,
            usual_load=float(counted[0][np.argmax(counted[1])]),
        )


def _by_last_use(values: Iterable[T]) -> tuple[T, ...]:
    """Distinct values, the one of the last reading first."""
    return tuple(dict.fromkeys(reversed(list(values))))


def _lowest(data: Measurements, setup: str) -> float:
    """Lowest tool tip measured in a set-up; in one that was never used, the lowest of all."""
    own = data.setup == setup
    return float(data.position[own if own.any() else slice(None), 2].min())


@dataclass(frozen=True)
class Costs:
    """Minutes of work; assumed, and the user's to change.

    Attributes
    ----------
    reading
        One more direction or load at a visit.
    pose
        Moving to another pose, clamping gauge and indicator, zeroing.
    tool
        Another tool.
    setup
        Another set-up: a riser on or off.
    indicator
        A second indicator across a link of the load path.
    """

    reading: float = 1.0
    pose: float = 15.0
    tool: float = 10.0
    setup: float = 45.0
    indicator: float = 10.0

    def __post_init__(self) -> None:
        if (
            not min(self.reading, self.pose, self.tool, self.setup, self.indicator) >= 0.0
            or self.pose + self.reading <= 0.0
        ):
            raise InputError("costs of a plan", expected="minutes, 0 or more, and a pose that costs something")


@dataclass(frozen=True)
class Visits:
    """v possible visits with their readings.

    Attributes
    ----------
    pose
        (v, 6) m and rad.
    extension, wait
        (v,) m; s.
    setup, label
        (v,) name of the set-up; of the point, if it was measured before.
    readings
        The m readings that the visits are made of, stiffness empty.
    names, rounds
        (m,) direction of each reading, a key of `VECTORS`; which reading it is of its kind in the clamping.
    members
        Indices into `readings`, visit after visit.
    starts
        (v,) where each visit's members begin.
    loop
        (v,) what a second indicator is set across, "" where there is none; None: nowhere.
    """

    pose: FloatArray
    extension: FloatArray
    wait: FloatArray
    setup: NDArray[np.str_]
    label: NDArray[np.str_]
    readings: Measurements
    names: NDArray[np.str_]
    rounds: IntArray
    members: IntArray
    starts: IntArray
    loop: NDArray[np.str_] | None = None

    def __len__(self) -> int:
        return len(self.pose)

    @property
    def counts(self) -> IntArray:
        """(v,) readings a visit."""
        return np.diff(np.append(self.starts, len(self.members)))

    def rows(self, visit: int) -> IntArray:
        """Indices of a visit's readings, in measuring order."""
        own = self.members[self.starts[visit] : self.starts[visit] + self.counts[visit]]
        return own[np.argsort(np.nan_to_num(self.readings.time[own]), kind="stable")]

    def across(self, visit: int) -> str:
        """What a second indicator is set across at a visit; "" where there is none."""
        return "" if self.loop is None else str(self.loop[visit])

    def tilt(self, visit: int) -> float:
        """Angle of the spindle from the vertical, rad."""
        return float(np.arccos(np.clip(np.cos(self.pose[visit, 3]) * np.cos(self.pose[visit, 4]), -1.0, 1.0)))


@dataclass(frozen=True)
class Matters:
    """Which columns the rivals' answers hang on; only these are varied."""

    load: bool = False
    setup: bool = False
    time: bool = False


def possible_visits(machine: Machine, menu: Menu, matters: Matters, rng: Generator) -> Visits:
    """Every visit that a plan may choose from.

    Raises
    ------
    InputError
        The machine reaches none of the menu's poses.
    """
    tools, setups = menu.tool_extensions, menu.setups if matters.setup else menu.setups[:1]
    waits = menu.waits if matters.time and menu.timed else menu.waits[:1]
    per_pose = len(tools) * len(setups) * len(waits)
    new = draw_poses(machine, menu, max(MOST_PLACES // per_pose - len(menu.measured), 40), rng)
    poses = np.concatenate([menu.measured, new])
    labels = (*menu.labels, *[""] * len(new))
    places = [
        (pose, tool, setup, wait)
        for tool in tools
        for pose in np.flatnonzero(reachable(machine, poses, tool)).tolist()
        for setup, wait in product(setups, waits)
        if poses[pose, 2] >= menu.floors.get(setup, -np.inf) - ROUND
    ]
    if not places:
        raise InputError(
            f"machine {machine.name} reaches none of the poses that the plan may choose from",
            hint="allow other heights, less tilt or a smaller radius",
        )
    which = np.array([place[0] for place in places])
    loads = menu.loads if matters.load else (menu.usual_load,)
    directions = AXES + DIAGONALS if menu.oblique else AXES
    jobs = [Job(*job) for job in product(range(1, menu.rounds + 1), directions, loads)]
    readings = _readings(poses[which], places, jobs, menu.timed, rng)
    members, starts, owner = _variants(len(places), jobs, loads)
    return Visits(
        pose=poses[which][owner],
        extension=np.array([place[1] for place in places])[owner],
        wait=np.array([place[3] for place in places])[owner],
        setup=np.array([place[2] for place in places], dtype=str)[owner],
        label=np.array([labels[i] for i in which], dtype=str)[owner],
        readings=readings,
        names=np.tile([job.direction for job in jobs], len(places)),
        rounds=np.tile([job.round for job in jobs], len(places)),
        members=members,
        starts=starts,
    )


class Job(NamedTuple):
    """One reading at a visit: which round it belongs to, its direction (a key of `VECTORS`), its load in N."""

    round: int
    direction: str
    load: float


def _variants(places: int, jobs: Sequence[Job], loads: Sequence[float]) -> tuple[IntArray, IntArray, IntArray]:
    """Members, starts and place of the visits: each place with every choice of directions, loads and rounds.

    X, Y, Z are always read: what the rivals do not think of shows there.
    """
    load_choices: list[tuple[float, ...]] = [(load,) for load in loads]
    if len(loads) > 1:
        load_choices.append((min(loads), max(loads)))
    named = [AXES, VECTORS] if any(job.direction not in AXES for job in jobs) else [AXES]
    choices = [
        np.array([k for k, job in enumerate(jobs) if job.direction in names and job.load in some and job.round <= last])
        for names, some, last in product(named, load_choices, sorted({job.round for job in jobs}))
    ]
    members, starts, owner, at = [], [], [], 0
    for place, choice in product(range(places), choices):
        members.append(place * len(jobs) + choice)
        starts.append(at)
        owner.append(place)
        at += len(choice)
    return np.concatenate(members), np.array(starts), np.array(owner)


def _readings(
    poses: FloatArray, places: Sequence[tuple[int, float, str, float]], jobs: Sequence[Job], timed: bool, rng: Generator
) -> Measurements:
    """Every place with every job, in that order.

    Round by round, the axes before the diagonals, in random order: a drift does not look like a direction.
    """
    count = len(jobs)
    groups = [
        np.array([k for k, job in enumerate(jobs) if job.round == last and (job.direction in AXES) == axes], dtype=int)
        for last, axes in product(sorted({job.round for job in jobs}), (True, False))
    ]
    slots = np.empty((len(places), count))
    for place in range(len(places)):
        slots[place, np.concatenate([rng.permutation(group) for group in groups])] = np.arange(1, count + 1)
    waits = np.array([place[3] for place in places])
    return planned_readings(
        np.repeat(poses, count, axis=0),
        np.tile([job.direction for job in jobs], len(places)),
        np.tile([job.load for job in jobs], len(places)),
        np.repeat([place[1] for place in places], count),
        np.repeat(np.array([place[2] for place in places], dtype=str), count),
        (waits[:, None] + slots * READING_EVERY).ravel() if timed else np.full(len(places) * count, np.nan),
    )


def planned_readings(
    pose: FloatArray,
    names: NDArray[np.str_],
    force: FloatArray,
    extension: FloatArray,
    setup: NDArray[np.str_],
    time: FloatArray,
    loop: NDArray[np.str_] | None = None,
) -> Measurements:
    """Readings that have not been taken.

    Parameters
    ----------
    pose
        (m, 6) m and rad.
    names
        (m,) directions, keys of `VECTORS`.
    force, extension, setup, time
        (m,) N, m, names, s.
    loop
        (m,) names of loops; None: of the tip.
    """
    m = len(pose)
    empty, nothing = np.full(m, ""), np.full(m, np.nan)
    missing = {"sd_N_per_mm", "clamp", "repeat", "point", "loop", "temperature_C"}
    missing |= {"time_min"} if np.isnan(time).any() else set()
    missing |= set() if (setup != "").any() else {"setup"}
    return Measurements(
        position=pose[:, :3],
        angles=pose[:, 3:],
        direction=np.array([VECTORS[str(name)] for name in names]).reshape(m, 3),
        stiffness=nothing,
        force=force.astype(float),
        sd=nothing,
        tool_extension=extension.astype(float),
        time=time,
        temperature=nothing,
        setup=setup,
        loop=empty if loop is None else loop,
        repeat=empty,
        point=empty,
        clamp=empty,
        file=empty,
        line=np.zeros(m, dtype=np.int64),
        extra={},
        missing=tuple(sorted(missing)),
    )


def visits_in_full(
    pose: FloatArray,
    extension: FloatArray,
    setup: NDArray[np.str_],
    names: NDArray[np.str_],
    force: FloatArray,
    time: FloatArray,
) -> Visits:
    """Visits (v,) with k readings each, taken once: along `names` (v, k) under `force` (v, k), at `time` (k,)."""
    v, count = names.shape
    readings = planned_readings(
        np.repeat(pose, count, axis=0), names.ravel(), force.ravel(), np.repeat(extension, count),
        np.repeat(setup, count), np.tile(time, v),
    )  # fmt: skip
    members = np.arange(v * count)
    return Visits(
        pose, extension, np.zeros(v), setup, np.full(v, ""), readings, names.ravel(),
        np.ones(v * count, dtype=np.int64), members, members[::count].copy(),
    )  # fmt: skip


def draw_poses(machine: Machine, menu: Menu, count: int, rng: Generator) -> FloatArray:
    """(m, 6) round, reachable poses with the reference tool, m <= count; a quarter of them with a vertical spindle."""
    levels = np.array(menu.heights or axis_levels(machine))
    found: list[FloatArray] = []
    for batch in range(8):
        m = count
        radius, azimuth = menu.radius * np.sqrt(rng.random(m)), rng.uniform(0.0, 2.0 * np.pi, m)
        # The largest tilts mostly tell the most.
        tilt, about = menu.max_tilt * np.sqrt(rng.uniform(0.16, 1.0, m)), rng.uniform(0.0, 2.0 * np.pi, m)
        tilt[rng.random(m) < STEEP_SHARE] = menu.max_tilt
        tilt[rng.random(m) < UPRIGHT_SHARE] = 0.0
        position = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), rng.choice(levels, m)], axis=1)
        # Toward zero: rounding never tilts further than allowed.
        angles = np.stack([tilt * np.cos(about), tilt * np.sin(about), np.zeros(m)], axis=1)
        angles = np.trunc(angles / ROUND_ANGLE + 1e-9 * np.sign(angles)) * ROUND_ANGLE
        position[:, :2] = np.trunc(position[:, :2] / ROUND) * ROUND
        poses = np.concatenate([position, angles], axis=1) + 0.0
        if batch == 0:
            poses[: len(levels)] = np.stack([np.array([0.0, 0.0, z, 0.0, 0.0, 0.0]) for z in levels])[:m]
        found += list(poses[reachable(machine, poses, 0.0)])
        if len(found) >= count:
            break
    return np.array(found[:count]).reshape(-1, 6)


def axis_levels(machine: Machine, count: int = 5) -> tuple[float, ...]:
    """Heights in m, from the lowest to the highest that the tip reaches on the axis, a tenth of the way from each end.

    The machine's axis is its base frame's Z.
    """
    low, high = machine.limits.workspace[:, 2]
    if not np.isfinite(high - low):
        middle, size = machine.limits.neutral_pose[2], float(np.ptp(machine.frame_joints[:, 2]))
        size = max(size, 0.2 * float(np.abs(machine.frame_joints[:, :2]).max()))
        low, high = middle - size, middle + size
    tries = np.linspace(low, high, 200)
    poses = np.zeros((len(tries), 6))
    poses[:, 2] = tries
    good = tries[reachable(machine, poses, 0.0)]
    if not len(good):
        raise InputError(
            f"machine {machine.name} reaches no pose on its axis with a vertical spindle",
            hint="give the heights of the plan",
        )
    ends = good[0] + 0.1 * np.ptp(good), good[-1] - 0.1 * np.ptp(good)
    return tuple((np.round(np.linspace(*ends, count) / (2.0 * ROUND)) * 2.0 * ROUND).tolist())


def reachable(machine: Machine, pose: FloatArray, tool_extension: float, margin: float = MARGIN) -> NDArray[np.bool_]:
    """(n,) whether the machine takes poses (n, 6) with such a tool, clear of its limits and of a strut law at zero."""
    rotation = rotation_matrices(pose[:, 3:])
    struts = solve_struts(machine, pose[:, :3], rotation, machine.reference_tool_length + tool_extension)
    stiff = (machine.strut_law.stiffness(struts.lengths) > 0.0).all(axis=1)
    return np.asarray(stiff & (reach(machine, pose[:, :3], struts, rotation).margin >= margin))


def images(pose: FloatArray) -> FloatArray:
    """(3, 6) a vertical pose (6,) and its images turned by 120 and 240 degrees about the machine's axis."""
    turned = np.repeat(pose[None], 3, axis=0)
    for k, angle in enumerate((0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0)):
        c, s = np.cos(angle), np.sin(angle)
        turned[k, :2] = c * pose[0] - s * pose[1], s * pose[0] + c * pose[1]
    return turned


def with_options(menu: Menu, **changes: Any) -> Menu:
    """The menu with those options that are not None. Who names the heights knows how low a set-up may be used."""
    given: dict[str, Any] = {n: tuple(v) if isinstance(v, list) else v for n, v in changes.items() if v is not None}
    return replace(menu, **given | ({"floors": {}} if "heights" in given else {}))
