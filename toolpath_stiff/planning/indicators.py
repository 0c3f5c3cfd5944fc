"""Indicators beside the tip in a plan: links at which rivals differ, and visits that measure across them.

Such a visit reads the tip along X, Y, Z as others do, and at each of these loads the second indicator as well.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.planning.forecasts import Rival
from toolpath_stiff.planning.visits import AXES, Visits
from toolpath_stiff.readings.loops import LoopColumns
from toolpath_stiff.readings.measurements import with_offsets

PLACES = 40  # with an indicator: a link shows at any pose where it is loaded
MOST_LOOPS = 4  # if an effect acts on all struts or vertices, one stands for all
LOOPS_OF = {
    "tool": ("spindle",),
    "table": ("table",),
    "joints": ("joint {}",),
    "struts": ("strut {}",),
    "frame": ("frame {} vertical", "frame {} radial"),
}  # link -> loops across it; of a strut, a joint or a vertex


def loops_between(rivals: Sequence[Rival]) -> tuple[str, ...]:
    """Loops around the links at which rivals differ, those of the more likely rivals first."""
    common = set.intersection(*(set(rival.names) for rival in rivals))
    loops: list[str] = []
    for active in (active for rival in rivals for active in rival.effects if active.effect.name not in common):
        number = max(int(active.values.get("strut", active.values.get("vertex", 1))), 1)
        loops += [loop.format(number) for loop in LOOPS_OF.get(active.effect.link, ())]
    return tuple(dict.fromkeys(loops))[:MOST_LOOPS]


def with_indicators(machine: Hexapod, visits: Visits, loops: Sequence[str], noise: float) -> Visits:
    """The visits, some of them repeated with an indicator across each loop.

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
    # An indicator is set beside visits that read X, Y, Z once each, under their largest load.
    taken, names = visits.readings, np.split(visits.names[visits.members], visits.starts[1:])
    loads = np.maximum.reduceat(taken.force[visits.members], visits.starts)
    plain = np.array([sorted(read) == list(AXES) for read in names])
    beside = np.flatnonzero(plain & (loads == loads[plain].max(initial=0.0)))
    beside = beside[np.unique(np.linspace(0, len(beside) - 1, min(PLACES, len(beside))).astype(int))]
    rows = np.array([visits.rows(int(visit)) for visit in beside])
    count = len(loops) * len(beside)
    across = len(taken) + np.arange(count * len(AXES)).reshape(count, len(AXES))
    members = np.concatenate([np.tile(rows, (len(loops), 1)), across], axis=1)
    owner = np.concatenate([np.arange(len(visits)), np.tile(beside, len(loops))])
    of_visits = {name: getattr(visits, name)[owner] for name in ("pose", "extension", "wait", "setup", "label")}
    source = np.concatenate([np.arange(len(taken)), np.tile(rows.ravel(), len(loops))])  # reading that each is of
    loop = np.concatenate([taken.loop, np.repeat(loops, rows.size)])
    readings = replace(
        taken.select(source),
        loop=loop,
        beside=LoopColumns.of(loop.tolist(), np.full(len(loop), np.nan)),
        missing=tuple(name for name in taken.missing if name != "loop"),
    )
    return replace(
        visits,
        **of_visits,
        readings=with_offsets(readings, machine, noise),
        names=visits.names[source],
        rounds=visits.rounds[source],
        members=np.concatenate([visits.members, members.ravel()]),
        starts=np.concatenate([visits.starts, len(visits.members) + members.shape[1] * np.arange(count)]),
        loop=np.concatenate([visits.loop, np.repeat(loops, len(beside))]),
    )
