"""Visits that could be made next: to poses, all reachable, and what each costs.

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
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.planning.menu import MINUTE, Menu
from toolpath_stiff.planning.poses import ROUND, draw_poses, reachable
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.units import min_from_s

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
READING_EVERY = 1.0 * MINUTE  # s between readings after zeroing; assumed
MOST_PLACES = 400  # places with their tool, set-up and waiting; more would cost time and change little


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
        (m,) direction of each reading, a key of `VECTORS`; which reading it is of its kind.
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
        """(v,) readings a visit."""
        return np.diff(np.append(self.starts, len(self.members)))

    def rows(self, visit: int) -> IntArray:
        """Indices of a visit's readings, in measuring order."""
        rows = self.members[self.starts[visit] : self.starts[visit] + self.counts[visit]]
        return rows[np.argsort(np.nan_to_num(self.readings.time[rows]), kind="stable")]

    def tilt(self, visit: int) -> float:
        """Angle of the spindle from the vertical, rad."""
        return float(np.arccos(np.clip(np.cos(self.pose[visit, 3]) * np.cos(self.pose[visit, 4]), -1.0, 1.0)))

    def same_place(self, visit: int) -> BoolArray:
        """(v,) visits to the same pose with the same tool in the same set-up: other readings there are no new pose."""
        there = (self.pose == self.pose[visit]).all(axis=1)
        return np.asarray(
            there & (self.extension == self.extension[visit]) & (self.setup == self.setup[visit]), dtype=bool
        )

    def kind(self, visit: int) -> str:
        """The dearest thing that the visit changes."""
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
        """(v,) minutes that each visit adds to those chosen; visits of one set-up and tool are made together."""
        costs, tool, rows = self.menu.costs, self.menu.tool_extensions[0], list(chosen)
        setups = [self.menu.setups[0], *self.setup[rows].tolist()]
        equipped = set(zip(setups, [tool, *self.extension[rows].tolist()], strict=True))
        known = [  # in a new set-up the tool that is in the spindle stays there
            there in equipped or (there[0] not in setups and there[1] == tool)
            for there in zip(self.setup.tolist(), self.extension.tolist(), strict=True)
        ]
        minutes = costs.pose + costs.reading * self.counts + min_from_s(self.wait)
        minutes = minutes + costs.indicator * (self.loop != "") + costs.setup * ~np.isin(self.setup, setups)
        return np.asarray(minutes + costs.tool * ~np.array(known))

    def minutes(self, chosen: Sequence[int]) -> float:
        """Minutes of work for the chosen visits."""
        return sum(float(self.further_minutes(chosen[:k])[visit]) for k, visit in enumerate(chosen))


def possible_visits(machine: Hexapod, menu: Menu, matters: Collection[str], rng: Generator) -> Visits:
    """Every visit that a plan may choose from; of load, set-up and time only those columns vary that matter.

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
    directions = AXES + DIAGONALS if menu.oblique else AXES
    rounds, names, forces = (np.array(column) for column in zip(*product(every_round, directions, loads), strict=True))
    axes = np.isin(names, AXES)
    groups = [np.flatnonzero((rounds == last) & (axes == first)) for last, first in product(every_round, (True, False))]
    slots = np.empty((len(places), len(names)))
    for place in range(len(places)):
        slots[place, np.concatenate([rng.permutation(group) for group in groups])] = np.arange(1, len(names) + 1)
    load_choices: list[tuple[float, ...]] = [(load,) for load in loads]
    load_choices += [(min(loads), max(loads))] if len(loads) > 1 else []
    named = [AXES, directions] if menu.oblique else [AXES]
    choices = [
        np.flatnonzero(np.isin(names, some) & np.isin(forces, under) & (rounds <= last))
        for some, under, last in product(named, load_choices, every_round)
    ]
    names, forces = np.broadcast_to(names, slots.shape), np.broadcast_to(forces, slots.shape)
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
    choices: Sequence[IntArray] | None = None,
) -> Visits:
    """Visits to p places with k readings each, or with some of these.

    Parameters
    ----------
    menu
        What they are chosen from.
    places
        Poses (p, 6), tools' extensions and set-ups (p,).
    names, force, time
        (p, k) directions, N, s (or (k,)).
    rounds
        (p, k) or (k,): which reading it is of its kind.
    choices
        Each place is a visit for every choice of its readings; None: one with all of them.
    """
    pose, extension, setup = places
    p, k = names.shape
    choices = choices or [np.arange(k)]
    place, counts = np.repeat(np.arange(p), len(choices)), np.tile([len(choice) for choice in choices], p)
    return Visits(
        menu=menu,
        pose=pose[place],
        extension=extension[place],
        wait=np.zeros(len(place)),
        setup=setup[place],
        label=np.full(len(place), ""),
        loop=np.full(len(place), ""),
        readings=planned_readings(
            np.repeat(pose, k, axis=0),
            names.ravel(),
            force.ravel(),
            np.repeat(extension, k),
            np.repeat(setup, k),
            np.broadcast_to(time, (p, k)).ravel() if menu.timed else np.full(p * k, np.nan),
        ),
        names=names.ravel(),
        rounds=np.broadcast_to(rounds, (p, k)).ravel(),
        members=(k * np.arange(p)[:, None] + np.concatenate(choices)).ravel(),
        starts=np.cumsum(counts) - counts,
    )


def planned_readings(
    pose: FloatArray,
    names: TextArray,
    force: FloatArray,
    extension: FloatArray,
    setup: TextArray,
    time: FloatArray,
    loop: TextArray | None = None,
) -> Readings:
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
    return Readings(
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
