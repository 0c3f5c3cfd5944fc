"""The menu of a plan: what may vary, and the cost of each change."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.units import RAD_PER_DEG

MINUTE = 60.0
LOADS = (1e-3, 1e6)  # N, that a plan may ask for
TABLE, RISER = "table", "riser"  # set-ups where the data know none, or only one
# Minutes of work; assumed, and the user's to change: one more direction or load at a visit; moving to another pose,
# clamping gauge and indicator, zeroing; another tool; a riser on or off; a second indicator across a link.
COSTS = {"reading": 1.0, "pose": 15.0, "tool": 10.0, "setup": 45.0, "indicator": 10.0}


@dataclass(frozen=True)
class Menu:
    """The menu of a plan: what may vary, and its cost. Defaults are assumed; each is an option of `tps plan`.

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
        Minutes of work, keys as of `COSTS`.
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
    costs: Mapping[str, float] = field(default_factory=lambda: COSTS)

    def __post_init__(self) -> None:
        if not LOADS[0] <= min(self.loads, default=0.0) <= max(self.loads) <= LOADS[1]:
            loads = ", ".join(f"{load:g}" for load in self.loads)
            raise InputError(f"a plan with loads of {loads or 'no'} N", expected=f"{LOADS[0]:g} to {LOADS[1]:g} N")
        if not self.costs["pose"] + self.costs["reading"] > 0.0:
            raise InputError("costs of a plan", expected="a pose that costs something")

    def with_options(self, **options: Any) -> Self:
        """The menu with the given options. Stated heights drop the floors: whoever states them knows each set-up's."""
        given: Any = {
            name: tuple(v) if isinstance(v, list) else v for name, v in options.items() if v not in (None, (), [])
        }
        return replace(self, **given | ({"floors": {}} if "heights" in given else {}))

    @classmethod
    def of(cls, data: Readings | None) -> Self:
        """The menu after some measurements, with their poses, set-ups, tools and loads; before any, with a riser."""
        if data is None:
            return cls(setups=(TABLE, RISER))
        poses = np.concatenate([data.position, data.angles], axis=1)
        first = np.sort(np.unique(np.round(poses, 6), axis=0, return_index=True)[1])
        # The set-up used last is taken to be on the machine now.
        setups = list(dict.fromkeys(data.setup[::-1].tolist()))
        if len(setups) == 1 and setups[0]:
            setups.append(TABLE if setups[0] != TABLE else RISER)
        measured = {name: data.position[data.setup == name, 2] for name in setups}
        loads, counts = np.unique(data.force, return_counts=True)
        return cls(
            loads=tuple(sorted({*cls.loads, *loads.tolist()})) if "force_N" not in data.missing else cls.loads,
            tool_extensions=tuple(
                dict.fromkeys([*np.round(data.tool_extension[::-1], 6).tolist(), *cls.tool_extensions])
            ),
            setups=tuple(setups),
            measured=poses[first],
            labels=tuple(data.point[first].tolist()),
            # A set-up never used takes the lowest height of all.
            floors={n: float((z if len(z) else data.position[:, 2]).min()) for n, z in measured.items()},
            timed="time_min" not in data.missing,
            usual_load=float(loads[np.argmax(counts)]),
        )
