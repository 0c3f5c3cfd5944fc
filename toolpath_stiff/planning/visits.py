"""Visits that could be made next: reachable poses in round figures, and the cost of each.

A visit is one pose with one tool in one set-up, clamped once: the indicator is zeroed and readings are taken along
some directions under one load or two. Visits are what costs time; further directions and loads at the same visit are
cheap.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray, TextArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.limits import reach, solved, working_box
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.planning.menu import MINUTE, Menu
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import RAD_PER_DEG, min_from_s

AXES = ("X", "Y", "Z")
DIAGONALS = ("XY", "XZ", "YZ")
READING_EVERY = 1.0 * MINUTE  # s between readings after zeroing; assumed
MOST_PLACES = 400  # places with their tool, set-up and waiting; more would cost time and change little
MARGIN = 0.02  # share of each limit's span that planned poses keep clear of it; assumed
ROUND, ROUND_ANGLE = 5e-3, 0.5 * RAD_PER_DEG  # planned poses are round figures, which a person keys in
UPRIGHT_SHARE = 0.25  # share of the poses with a vertical spindle
STEEP_SHARE = 0.5  # share of the others with the largest tilt


@dataclass(frozen=True)
class Visits:
    """v possible visits with their readings.

    Attributes
    ----------
    menu
        What they are chosen from.
    pose
        (v, 6) m and rad.
    extension, wait
        (v,) m; s.
    setup, label
        (v,) name of the set-up; of the point, if it was measured before.
    loop
        (v,) what a second indicator is set across, "" where there is none.
    readings
        The m readings that the visits are made of, stiffness empty.
    names, rounds
        (m,) direction of each reading, of `AXES` or `DIAGONALS`; which reading it is of its kind.
    members
        Indices into `readings`, visit after visit.
    starts
        (v,) where each visit's members begin.
    """

    menu: Menu
    pose: FloatArray
    extension: FloatArray
    wait: FloatArray
    setup: TextArray
    label: TextArray
    loop: TextArray
    readings: Readings
    names: TextArray
    rounds: IntArray
    members: IntArray
    starts: IntArray

    def __len__(self) -> int:
        return len(self.pose)

    @property
    def counts(self) -> IntArray:
        """(v,) number of readings in each visit."""
        return np.diff(np.append(self.starts, len(self.members)))

    def rows(self, visit: int) -> IntArray:
        """Indices of a visit's readings, in measuring order."""
        rows = self.members[self.starts[visit] : self.starts[visit] + self.counts[visit]]
        return rows[np.argsort(np.nan_to_num(self.readings.time[rows]), kind="stable")]

    def tilt(self, visit: int) -> float:
        """Angle of the spindle from the vertical, rad."""
        return float(tilts(self.pose[visit]))

    def same_place(self, visit: int) -> BoolArray:
        """(v,) True for visits to the same pose with the same tool and set-up: other readings there are no new pose."""
        there = (self.pose == self.pose[visit]).all(axis=1)
        return np.asarray(
            there & (self.extension == self.extension[visit]) & (self.setup == self.setup[visit]), dtype=bool
        )

    def kind(self, visit: int) -> str:
        """The most expensive change that the visit makes."""
        if self.setup[visit] != self.menu.setups[0]:
            return "another set-up"
        if self.loop[visit]:
            return "an indicator"
        if self.wait[visit] > self.menu.waits[0]:
            return "waiting"
        if self.extension[visit] != self.menu.tool_extensions[0]:
            return "another tool"
        return "tilted" if self.tilt(visit) > 1e-6 else "vertical"

    def further_minutes(self, chosen: Sequence[int]) -> FloatArray:
        """(v,) minutes that each visit would add to those chosen; visits of one set-up and tool are made together."""
        costs, tool, rows = self.menu.costs, self.menu.tool_extensions[0], list(chosen)
        setups = [self.menu.setups[0], *self.setup[rows].tolist()]
        equipped = set(zip(setups, [tool, *self.extension[rows].tolist()], strict=True))
        known = [  # a new set-up needs no tool change for the tool in the spindle
            there in equipped or (there[0] not in setups and there[1] == tool)
            for there in zip(self.setup.tolist(), self.extension.tolist(), strict=True)
        ]
        minutes = costs["pose"] + costs["reading"] * self.counts + min_from_s(self.wait)
        minutes = minutes + costs["indicator"] * (self.loop != "") + costs["setup"] * ~np.isin(self.setup, setups)
        return np.asarray(minutes + costs["tool"] * ~np.array(known))

    def minutes(self, chosen: Sequence[int]) -> float:
        """Minutes of work for the chosen visits."""
        return sum(float(self.further_minutes(chosen[:k])[visit]) for k, visit in enumerate(chosen))


def possible_visits(machine: MachineTool, menu: Menu, matters: Collection[str], rng: Generator) -> Visits:
    """All visits that a plan may choose from; load, set-up and time vary only if their columns matter.

    Each place is offered with every choice of directions, loads and rounds. X, Y, Z are always read: what the rivals do
    not think of shows there. Readings are taken round by round, the axes before the diagonals, in random order: a drift
    does not look like a direction.

    Raises
    ------
    InputError
        The machine reaches none of the menu's poses.
    """
    tools, setups = menu.tool_extensions, menu.setups if "setup" in matters else menu.setups[:1]
    waits = menu.waits if "time_min" in matters and menu.timed else menu.waits[:1]
    per_pose = len(tools) * len(setups) * len(waits)
    new = draw_poses(machine, menu, max(MOST_PLACES // per_pose - len(menu.measured), 40), rng)
    poses = np.concatenate([menu.measured, new])
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
    which, extension, setup, wait = (np.array(column) for column in zip(*places, strict=True))
    loads, every_round = menu.loads if "force_N" in matters else (menu.usual_load,), range(1, menu.rounds + 1)
    named = [AXES, AXES + DIAGONALS] if menu.oblique else [AXES]
    rounds, names, forces = (np.array(column) for column in zip(*product(every_round, named[-1], loads), strict=True))
    axes = np.isin(names, AXES)
    groups = [np.flatnonzero((rounds == last) & (axes == first)) for last, first in product(every_round, (True, False))]
    slots = np.empty((len(places), len(names)))
    for place in range(len(places)):
        slots[place, np.concatenate([rng.permutation(group) for group in groups])] = np.arange(1, len(names) + 1)
    under = [(load,) for load in loads] + ([(min(loads), max(loads))] if len(loads) > 1 else [])
    choices = [
        np.flatnonzero(np.isin(names, some) & np.isin(forces, load) & (rounds <= last))
        for some, load, last in product(named, under, every_round)
    ]
    time = wait[:, None] + slots * READING_EVERY
    visits = visits_of(menu, (poses[which], extension, setup), names, forces, time, rounds, choices)
    labels, owner = np.array([*menu.labels, *[""] * len(new)], dtype=str), np.repeat(range(len(places)), len(choices))
    return replace(visits, wait=wait[owner], label=labels[which][owner])


def visits_of(
    menu: Menu,
    places: tuple[FloatArray, FloatArray, TextArray],
    names: TextArray,
    force: FloatArray,
    time: FloatArray,
    rounds: IntArray | int = 1,
    choices: Sequence[IntArray] = (),
) -> Visits:
    """Visits to p places with k readings each, or with subsets of these.

    Parameters
    ----------
    menu
        What they are chosen from.
    places
        Poses (p, 6), tools' extensions and set-ups (p,).
    names, force, time
        (p, k) or (k,): directions, N, s.
    rounds
        (p, k) or (k,): which reading it is of its kind.
    choices
        Each place is a visit for every choice of its readings; without any, one with all of them.
    """
    pose, extension, setup = places
    p, k = len(pose), np.shape(names)[-1]
    choices = choices or [np.arange(k)]
    place, counts = np.repeat(np.arange(p), len(choices)), np.tile([len(choice) for choice in choices], p)
    names, force, time, rounds = (np.broadcast_to(array, (p, k)).ravel() for array in (names, force, time, rounds))
    pose_read = np.repeat(pose, k, axis=0)
    direction = np.stack([np.char.find(names, axis) >= 0 for axis in AXES], axis=1).astype(float)
    empty, nothing = np.full(p * k, ""), np.full(p * k, np.nan)
    missing = {"sd_N_per_mm", "clamp", "repeat", "point", "loop", "temperature_C"}
    missing |= (set() if menu.timed else {"time_min"}) | (set() if (setup != "").any() else {"setup"})
    readings = Readings(
        position=pose_read[:, :3],
        angles=pose_read[:, 3:],
        direction=direction * np.sqrt(1.0 / direction.sum(axis=1, keepdims=True)),
        stiffness=nothing,
        force=force.astype(float),
        sd=nothing,
        tool_extension=np.repeat(extension, k).astype(float),
        time=time if menu.timed else nothing,
        temperature=nothing,
        setup=np.repeat(setup, k),
        loop=empty,
        repeat=empty,
        point=empty,
        clamp=empty,
        file=empty,
        line=np.zeros(p * k, dtype=np.int64),
        extra={},
        missing=tuple(sorted(missing)),
    )
    return Visits(
        menu=menu,
        pose=pose[place],
        extension=extension[place],
        wait=np.zeros(len(place)),
        setup=setup[place],
        label=np.full(len(place), ""),
        loop=np.full(len(place), ""),
        readings=readings,
        names=names,
        rounds=rounds,
        members=(k * np.arange(p)[:, None] + np.concatenate(choices)).ravel(),
        starts=np.cumsum(counts) - counts,
    )


def draw_poses(machine: MachineTool, menu: Menu, count: int, rng: Generator) -> FloatArray:
    """(m, 6) round, reachable poses with the reference tool, m <= count; a quarter of them with a vertical spindle."""
    levels = np.array(menu.heights or axis_levels(machine))
    drawn: list[FloatArray] = []
    for batch in range(8):
        radius, azimuth = menu.radius * np.sqrt(rng.random(count)), rng.uniform(0.0, 2.0 * np.pi, count)
        # Large tilts usually tell the most.
        tilt, about = menu.max_tilt * np.sqrt(rng.uniform(0.16, 1.0, count)), rng.uniform(0.0, 2.0 * np.pi, count)
        tilt[rng.random(count) < STEEP_SHARE] = menu.max_tilt
        tilt[rng.random(count) < UPRIGHT_SHARE] = 0.0
        # Rounded toward zero, so that no tilt exceeds the limit.
        lean = np.stack([tilt * np.cos(about), tilt * np.sin(about)], axis=1)
        place = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth)], axis=1)
        poses = np.zeros((count, 6))
        poses[:, :2] = np.trunc(place / ROUND) * ROUND + middle_of(machine)
        poses[:, 2] = rng.choice(levels, count)
        poses[:, 3:5] = np.trunc(lean / ROUND_ANGLE + 1e-9 * np.sign(lean)) * ROUND_ANGLE + 0.0
        if batch == 0:
            poses[: len(levels)] = _upright(machine, levels)[:count]
        drawn += list(poses[reachable(machine, poses, 0.0)])
        if len(drawn) >= count:
            break
    return np.array(drawn[:count]).reshape(-1, 6)


def axis_levels(machine: MachineTool) -> tuple[float, ...]:
    """Five heights, m, from the lowest to the highest that the tip reaches on the machine's axis, its base frame's Z.

    They begin a tenth of the way from each end.
    """
    low, high = machine.limits.workspace[:, 2]
    if not isinstance(machine, Hexapod):
        low, high = working_box(machine)[:, 2]
    elif not np.isfinite(high - low):
        middle, size = machine.limits.neutral_pose[2], float(np.ptp(machine.frame_joints[:, 2]))
        size = max(size, 0.2 * float(np.abs(machine.frame_joints[:, :2]).max()))
        low, high = middle - size, middle + size
    tries = np.linspace(low, high, 200)
    good = tries[reachable(machine, _upright(machine, tries), 0.0)]
    if not len(good):
        raise InputError(
            f"machine {machine.name} reaches no pose on its axis with a vertical spindle",
            hint="give the heights of the plan",
        )
    ends = good[0] + 0.1 * np.ptp(good), good[-1] - 0.1 * np.ptp(good)
    return tuple((np.round(np.linspace(*ends, 5) / (2.0 * ROUND)) * 2.0 * ROUND).tolist())


def _upright(machine: MachineTool, levels: FloatArray) -> FloatArray:
    """(n, 6) vertical poses at given heights above one another."""
    poses = np.outer(levels, np.arange(6) == 2)
    poses[:, :2] += middle_of(machine)
    return poses


def reachable(machine: MachineTool, pose: FloatArray, tool_extension: float, margin: float = MARGIN) -> BoolArray:
    """(n,) True where the machine takes poses (n, 6) with such a tool, clear of its limits and of strut stiffness 0."""
    rotation = rotation_matrices(pose[:, 3:])
    stance = solved(machine, pose[:, :3], rotation, machine.reference_tool_length + tool_extension)
    good = reach(machine, pose[:, :3], stance, rotation).margin >= margin
    if isinstance(machine, Hexapod):
        good &= (machine.strut_law.stiffness(stance.joints) > 0.0).all(axis=1)
    return np.asarray(good)


def middle_of(machine: MachineTool) -> FloatArray:
    """(2,) m, X and Y about which poses are drawn: a hexapod's axis, otherwise the place of program zero."""
    return np.zeros(2) if isinstance(machine, Hexapod) else np.array(machine.default_origin[:2])


def tilts(pose: FloatArray) -> FloatArray:
    """(...) angle of the spindle from the vertical at poses (..., 6), rad."""
    return np.asarray(np.arccos(np.clip(np.cos(pose[..., 3]) * np.cos(pose[..., 4]), -1.0, 1.0)))
