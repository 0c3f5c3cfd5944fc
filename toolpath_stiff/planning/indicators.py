"""Indicators beside the tip in a plan: across which links rivals differ, and visits that read there.

Such a visit reads the tip along X, Y, Z as others do, and at each of these loads the second indicator as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.machine.model import Machine
from toolpath_stiff.planning.visits import Visits
from toolpath_stiff.readings.loops import LoopColumns
from toolpath_stiff.readings.measurements import Measurements, with_offsets

if TYPE_CHECKING:
    from toolpath_stiff.planning.rivals import Rival


PLACES = 40  # with an indicator: a link shows at any pose where it is loaded


MOST_LOOPS = 4  # one strut or vertex stands for all where an effect is of all


AXES = ("X", "Y", "Z")


def loops_between(rivals: Sequence[Rival]) -> tuple[str, ...]:
    """Loops that hold a link at which the rivals differ, the likelier rivals' first."""
    common = set.intersection(*(set(rival.names) for rival in rivals))
    found: dict[str, None] = {}
    for rival in rivals:
        for active in rival.effects:
            if active.effect.name not in common:
                number = max(int(active.values.get("strut", active.values.get("vertex", 1))), 1)
                found |= dict.fromkeys(_loops_of(active.effect.link, number))
    return tuple(found)[:MOST_LOOPS]


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
    plain = _plain(visits)
    plain = plain[np.unique(np.linspace(0, len(plain) - 1, min(PLACES, len(plain))).astype(int))]
    rows = [visits.rows(int(visit)) for visit in plain]
    taken = np.concatenate(rows)
    readings, names, rounds = [visits.readings], [visits.names], [visits.rounds]
    members = [visits.members]
    starts, owner, loop_of = [visits.starts], list(range(len(visits))), [""] * len(visits)
    at, first = len(visits.members), len(visits.readings)
    for loop in loops:
        readings.append(_read_across(visits.readings.select(taken), loop))
        names.append(visits.names[taken])
        rounds.append(visits.rounds[taken])
        for visit, own in zip(plain.tolist(), rows, strict=True):
            members.append(np.concatenate([own, np.arange(first, first + len(own))]))
            starts.append(np.array([at]))
            owner.append(visit)
            loop_of.append(loop)
            at, first = at + 2 * len(own), first + len(own)
    which = np.array(owner)
    return replace(
        visits,
        pose=visits.pose[which],
        extension=visits.extension[which],
        wait=visits.wait[which],
        setup=visits.setup[which],
        label=visits.label[which],
        readings=with_offsets(_stacked(readings), machine, noise),
        names=np.concatenate(names),
        rounds=np.concatenate(rounds),
        members=np.concatenate(members),
        starts=np.concatenate(starts),
        loop=np.array(loop_of),
    )


def _plain(visits: Visits) -> NDArray[np.int64]:
    """(k,) visits that read X, Y, Z once each, under their largest load: what an indicator is set beside."""
    found = []
    for visit in range(len(visits)):
        own = visits.members[visits.starts[visit] : visits.starts[visit] + visits.counts[visit]]
        if len(own) == len(AXES) and set(visits.names[own].tolist()) == set(AXES):
            found.append((visit, float(visits.readings.force[own].max())))
    largest = max((load for _, load in found), default=0.0)
    return np.array([visit for visit, load in found if load == largest], dtype=np.int64)


def _read_across(readings: Measurements, loop: str) -> Measurements:
    """The same loads, read across a loop."""
    return replace(readings, loop=np.full(len(readings), loop))


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
