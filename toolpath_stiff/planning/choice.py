"""The choice of visits: those that set rivals apart most per minute of work."""

from collections.abc import Mapping, Sequence

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.planning.gaps import GapShares
from toolpath_stiff.planning.visits import Visits
from toolpath_stiff.units import min_from_s

Pair = tuple[str, str]  # names of two rivals


def choose(
    visits: Visits, usable: BoolArray, shares: Mapping[Pair, GapShares], weights: Mapping[str, float], n: int
) -> tuple[int, ...]:
    """Up to `n` usable visits, one after another, each the one that lowers the bound most per minute."""
    chosen: list[int] = []
    free = usable.copy()
    now = float(log_confusion({pair: np.zeros(()) for pair in shares}, weights))
    for _ in range(min(n, int(usable.sum()))):
        after = log_confusion({pair: share.gaps_with(chosen) for pair, share in shares.items()}, weights)
        gain = np.where(free, (now - after) / visits.further_minutes(chosen), -np.inf)
        best = int(np.argmax(gain))
        if not np.isfinite(gain[best]):
            break
        chosen.append(best)
        now = float(after[best])
        free &= ~visits.same_place(best)
    return tuple(chosen)


def log_confusion(gaps: Mapping[Pair, FloatArray], weights: Mapping[str, float]) -> FloatArray:
    """Logarithm of the bound on the chance of taking one rival for another, of any shape that the gaps have."""
    each = [0.5 * np.log(weights[i] * weights[j]) - gap**2 / 4.0 for (i, j), gap in gaps.items()]
    return np.asarray(np.logaddexp.reduce(each, axis=0))


def in_order(visits: Visits, chosen: Sequence[int], seed: int) -> tuple[int, ...]:
    """Set-up by set-up, tool by tool, at random within: a drift over the day looks like no pose."""
    order = list(np.random.default_rng([seed, 1]).permutation(len(chosen)))
    setups, tools = list(visits.menu.setups), list(visits.menu.tool_extensions)
    order.sort(key=lambda k: (setups.index(visits.setup[chosen[k]]), tools.index(visits.extension[chosen[k]])))
    return tuple(chosen[k] for k in order)


def why_of(visits: Visits, visit: int, shares: Mapping[Pair, GapShares]) -> str:
    """The purpose of a visit, a sentence."""
    pair, gap = max(((pair, share.gap([visit])) for pair, share in shares.items()), key=lambda entry: entry[1])
    tilt, extension, wait, rows = visits.tilt(visit), visits.extension[visit], visits.wait[visit], visits.rows(visit)
    parts = [f"tilted {np.degrees(tilt):.3g} deg" if tilt > 1e-6 else "vertical"]
    if extension:
        parts.append(f"tool {1e3 * abs(extension):.4g} mm {'longer' if extension > 0 else 'shorter'}")
    if visits.setup[visit]:
        parts.append(f"set-up {visits.setup[visit]}")
    parts.append("at " + " and ".join(f"{load:g} N" for load in np.unique(visits.readings.force[rows])))
    if wait > visits.menu.waits[0]:
        parts.append(f"{min_from_s(wait):.3g} minutes after zeroing")
    if visits.rounds[rows].max() > 1:
        parts.append("each reading twice" if visits.rounds[rows].max() == 2 else "readings repeated")
    if visits.loop[visit]:
        parts.append(f"a second indicator: {visits.loop[visit]}")
    return f"{', '.join(parts)}: {gap:.1f} sigma between {pair[0]} and {pair[1]}"
