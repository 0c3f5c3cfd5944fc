"""The menu of a plan: what may vary, and what work costs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.units import RAD_PER_DEG

T = TypeVar("T")
MINUTE = 60.0
LOADS = (1e-3, 1e6)  # N, that a plan may ask for
SETUP_ELSEWHERE = "table"  # the work on the bare table, where the data know only one set-up, with a name


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
        if not self.pose + self.reading > 0.0:
            raise InputError("costs of a plan", expected="a pose that costs something")


@dataclass(frozen=True)
class Menu:
    """The menu of a plan: what may vary, and what it costs. Defaults are assumed; each is an option of `tps plan`.

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
    costs
        Minutes of work.
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
    costs: Costs = field(default_factory=Costs)

    def __post_init__(self) -> None:
        if not LOADS[0] <= min(self.loads, default=0.0) <= max(self.loads) <= LOADS[1]:
            loads = ", ".join(f"{load:g}" for load in self.loads)
            raise InputError(f"a plan with loads of {loads or 'no'} N", expected=f"{LOADS[0]:g} to {LOADS[1]:g} N")

    def with_options(self, **changes: Any) -> Menu:
        """The menu with those options that are given. Who names the heights knows how low a set-up may be used."""
        lists: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in changes.items()}
        given: dict[str, Any] = {name: value for name, value in lists.items() if value is not None and value != ()}
        return replace(self, **given | ({"floors": {}} if "heights" in given else {}))

    @classmethod
    def of(cls, data: Readings) -> Menu:
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


def _lowest(data: Readings, setup: str) -> float:
    """Lowest tool tip measured in a set-up; in one that was never used, the lowest of all."""
    there = data.setup == setup
    return float(data.position[there if there.any() else slice(None), 2].min())
