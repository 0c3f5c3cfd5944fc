"""Indicators beside the tip in a plan: across which links rivals differ, and visits that read there.

Such a visit reads the tip along X, Y, Z as others do, and at each of these loads the second indicator as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.arrays import IntArray
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.planning.visits import AXES, Visits
from toolpath_stiff.readings.loops import LoopColumns
from toolpath_stiff.readings.measurements import Measurements, with_offsets

if TYPE_CHECKING:
    from toolpath_stiff.planning.forecasts import Rival


PLACES = 40  # with an indicator: a link shows at any pose where it is loaded


MOST_LOOPS = 4  # one strut or vertex stands for all where an effect is of all


def loops_between(rivals: Sequence[Rival]) -> tuple[str, ...]:
    """Loops that hold a link at which the rivals differ, the likelier rivals' first."""
    common = set.intersection(*(set(rival.names) for rival in rivals))
    loops: dict[str, None] = {}
    for rival in rivals:
        for active in rival.effects:
            if active.effect.name not in common:
                number = max(int(active.values.get("strut", active.values.get("vertex", 1))), 1)
                loops |= dict.fromkeys(_loops_of(active.effect.link, number))
    return tuple(loops)[:MOST_LOOPS]


def _loops_of(link: str, number: int) -> tuple[str, ...]:
    return {
        "tool": ("spindle",),
        "table": ("table",),
        "joints": (f"joint {number}",),
        "struts": (f"strut {number}",),
        "frame": (f"frame {number} vertical", f"frame {number} radial"),
    }.get(link, ())


def with_indicators(machine: Machine, visits: Visits, loops: Sequence[str], noise: float) -> Visits:
    """The same visits, and some of them with an indicator across each loop.

    Parameters
    ----------
    machine, visits
        The machine; visits without indicators.
    loops
        Names of loops.
    noise
        Relative sd of a reading of the tip. Loops are given offsets by which theirs is no larger, so that all readings
        of a plan scatter alike.
    """
    if not loops:
        return visits
    plain = _beside_which(visits)
    plain = plain[np.unique(np.linspace(0, len(plain) - 1, min(PLACES, len(plain))).astype(int))]
    rows = np.array([visits.rows(int(visit)) for visit in plain])
    count, tip = len(loops) * len(plain), visits.readings.select(rows.ravel())
    across = len(visits.readings) + np.arange(count * len(AXES)).reshape(count, len(AXES))
    members = np.concatenate([np.tile(rows, (len(loops), 1)), across], axis=1)
    owner = np.concatenate([np.arange(len(visits)), np.tile(plain, len(loops))])
    of_visits = {name: getattr(visits, name)[owner] for name in ("pose", "extension", "wait", "setup", "label")}
    readings = [visits.readings, *(replace(tip, loop=np.full(len(tip), loop)) for loop in loops)]
    return replace(
        visits,
        **of_visits,
        readings=with_offsets(_stacked(readings), machine, noise),
        names=np.concatenate([visits.names, np.tile(visits.names[rows.ravel()], len(loops))]),
        rounds=np.concatenate([visits.rounds, np.tile(visits.rounds[rows.ravel()], len(loops))]),
        members=np.concatenate([visits.members, members.ravel()]),
        starts=np.concatenate([visits.starts, len(visits.members) + members.shape[1] * np.arange(count)]),
        loop=np.concatenate([np.full(len(visits), ""), np.repeat(loops, len(plain))]),
    )


def _beside_which(visits: Visits) -> IntArray:
    """(k,) visits that read X, Y, Z once each, under their largest load: what an indicator is set beside."""
    names = np.split(visits.names[visits.members], visits.starts[1:])
    loads = np.maximum.reduceat(visits.readings.force[visits.members], visits.starts)
    plain = np.array([sorted(read) == list(AXES) for read in names])
    return np.flatnonzero(plain & (loads == loads[plain].max(initial=0.0)))


def _stacked(parts: Sequence[Measurements]) -> Measurements:
    """Planned readings one after the other; with the loops that they are of."""
    first = parts[0]
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name, value in vars(first).items()
        if isinstance(value, np.ndarray)
    }
    count = len(columns["loop"])
    beside = LoopColumns.of(columns["loop"].tolist(), np.full(count, np.nan))
    missing = tuple(name for name in first.missing if name != "loop")
    return replace(first, **columns, missing=missing, beside=beside)
