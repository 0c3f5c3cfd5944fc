"""A map of how far one visit would set the two likeliest rivals apart, over the workspace."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import prod
from pathlib import Path

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.planning.forecasts import forecast_all
from toolpath_stiff.planning.gaps import pair_shares
from toolpath_stiff.planning.plan import RivalPlan, matters
from toolpath_stiff.planning.visits import AXES, READING_EVERY, ROUND, reachable, visits_of

ACROSS = 11  # points of the grid a side
TILTS = 6  # directions of tilt
MOST_LEVELS = 8  # heights with a panel of their own; more are put together, neighbours with neighbours


@dataclass(frozen=True)
class GapMap:
    """Gap in standard deviations of one visit, reference tool, the best of the set-ups.

    Attributes
    ----------
    pair
        Names of the two rivals.
    x, y, levels
        (g,) m, (g,) m, (h,) m, the middle of each of `height_groups`.
    vertical, tilted
        (h, g, g) with y before x; with the spindle vertical, and tilted as far as planned in the best of six
        directions; nan where the machine does not reach.
    max_tilt
        rad.
    """

    pair: tuple[str, str]
    x: FloatArray
    y: FloatArray
    levels: FloatArray
    vertical: FloatArray
    tilted: FloatArray
    max_tilt: float


def top_pair(plan: RivalPlan) -> tuple[str, str]:
    """The two most probable rivals that can be told apart; if none can, the two most probable."""
    weights = {rival.name: rival.weight for rival in plan.rivals}
    return max(plan.pairs, key=lambda pair: (pair.separable, prod(weights[name] for name in pair.effects))).effects


def height_groups(z: FloatArray) -> list[FloatArray]:
    """Heights (n,) m in groups, rising: each height its own, or `MOST_LEVELS` groups of neighbours."""
    heights = np.unique(np.round(z, 4))
    return list(np.array_split(heights, min(len(heights), MOST_LEVELS)))


def group_of(z: FloatArray, groups: Sequence[FloatArray]) -> IntArray:
    """(n,) the group that holds each height."""
    lowest = np.array([group[0] for group in groups])
    return np.asarray(np.searchsorted(lowest, np.round(z, 4), side="right") - 1, dtype=np.int64)


def gap_map(machine: Hexapod, plan: RivalPlan, effect_files: Sequence[str | Path] = ()) -> GapMap:
    """Gaps of the plan's top pair over the menu's radius at the heights that the plan visits most."""
    pair, menu = top_pair(plan), plan.visits.menu
    rivals = [next(rival for rival in plan.rivals if rival.name == name) for name in pair]
    side = np.linspace(-menu.radius, menu.radius, ACROSS)
    levels = np.array([group[len(group) // 2] for group in height_groups(plan.visits.pose[list(plan.chosen), 2])])
    turns = np.linspace(0.0, 2.0 * np.pi, TILTS, endpoint=False)
    angles = menu.max_tilt * np.array([(0.0, 0.0), *zip(np.cos(turns), np.sin(turns), strict=True)])
    poses = np.array([[x, y, z, a, b, 0.0] for a, b in angles for z, y, x in product(levels, side, side)])
    good = np.flatnonzero(reachable(machine, poses, 0.0, margin=0.0))
    varied = matters(rivals)
    setups = menu.setups if "setup" in varied else menu.setups[:1]
    loads = sorted({min(menu.loads), max(menu.loads)}) if "force_N" in varied else [menu.usual_load]
    gaps = np.full((len(setups), len(poses)), np.nan)
    if len(good):
        # One visit to each pose in each set-up.
        names, forces = (np.array(column) for column in zip(*product(AXES, loads), strict=True))
        count = len(good) * len(setups)
        places = np.tile(poses[good], (len(setups), 1)), np.zeros(count), np.repeat(setups, len(good))
        visits = visits_of(
            menu, places, names, forces, max(menu.waits) + READING_EVERY * np.arange(1.0, len(names) + 1.0)
        )
        forecasts, answered, scatter = forecast_all(machine, rivals, visits.readings, effect_files)
        share = pair_shares(visits, forecasts[0], forecasts[1], replace(plan.scatter, machine=scatter))
        usable = np.logical_and.reduceat(answered, visits.starts)
        gaps[:, good] = np.where(usable, share.gaps_with(()), np.nan).reshape(len(setups), -1)
    for k, setup in enumerate(setups):
        gaps[k, poses[:, 2] < menu.floors.get(setup, -np.inf) - ROUND] = np.nan
    best = np.fmax.reduce(gaps, axis=0).reshape(len(angles), len(levels), ACROSS, ACROSS)
    return GapMap(pair, side, side, levels, best[0], np.fmax.reduce(best[1:], axis=0), menu.max_tilt)
