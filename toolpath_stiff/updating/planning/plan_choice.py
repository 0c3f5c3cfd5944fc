"""Which visits: the bound on taking one rival for another, the minutes that each costs, one after another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.updating.planning.plan_menu import Costs, Menu, Visits
from toolpath_stiff.updating.planning.plan_rivals import Shares

FloatArray = NDArray[np.float64]


def log_confusion(gaps: dict[tuple[str, str], FloatArray], weights: dict[str, float]) -> FloatArray:
    """Logarithm of the bound on the chance of taking one rival for another, of any shape that the gaps have."""
    each = [0.5 * np.log(weights[i] * weights[j]) - gap**2 / 4.0 for (i, j), gap in gaps.items()]
    return np.asarray(np.logaddexp.reduce(each, axis=0))


def choose(
    visits: Visits,
    usable: NDArray[np.bool_],
    shares: dict[tuple[str, str], Shares],
    weights: dict[str, float],
    n: int,
    costs: Costs,
    menu: Menu,
) -> tuple[int, ...]:
    """Up to `n` usable visits, one after another, each the one that lowers the bound most per minute."""
    chosen: list[int] = []
    free = usable.copy()
    now = float(log_confusion({pair: np.zeros(()) for pair in shares}, weights))
    for _ in range(min(n, int(usable.sum()))):
        after = log_confusion({pair: share.gaps_with(chosen) for pair, share in shares.items()}, weights)
        gain = np.where(free, (now - after) / further_minutes(visits, chosen, costs, menu), -np.inf)
        best = int(np.argmax(gain))
        if not np.isfinite(gain[best]):
            break
        chosen.append(best)
        now = float(after[best])
        free &= ~same_place(visits, best)
    return tuple(chosen)


def same_place(visits: Visits, visit: int) -> NDArray[np.bool_]:
    """(v,) visits to the same pose with the same tool in the same set-up: other readings there are no new pose."""
    return np.asarray(
        (visits.pose == visits.pose[visit]).all(axis=1)
        & (visits.extension == visits.extension[visit])
        & (visits.setup == visits.setup[visit])
    )


def further_minutes(visits: Visits, chosen: Sequence[int], costs: Costs, menu: Menu) -> FloatArray:
    """(v,) minutes that each visit adds to those chosen; visits of one set-up and tool are made together."""
    setups = {menu.setups[0], *visits.setup[list(chosen)].tolist()}
    equipped = {(menu.setups[0], menu.tool_extensions[0])}
    equipped |= {(str(visits.setup[v]), float(visits.extension[v])) for v in chosen}
    minutes = costs.pose + costs.reading * visits.counts + visits.wait / 60.0
    minutes = minutes + costs.setup * ~np.isin(visits.setup, list(setups))
    tools: dict[str, set[float]] = {}
    for setup, tool in equipped:
        tools.setdefault(setup, set()).add(tool)
    # In a new set-up the tool that is in the spindle stays there.
    known = np.array(
        [
            float(tool) in tools.get(str(setup), {menu.tool_extensions[0]})
            for setup, tool in zip(visits.setup, visits.extension, strict=True)
        ]
    )
    return np.asarray(minutes + costs.tool * ~known)


def plan_minutes(visits: Visits, chosen: Sequence[int], costs: Costs, menu: Menu) -> float:
    """Minutes of work for the chosen visits."""
    return sum(float(further_minutes(visits, chosen[:k], costs, menu)[visit]) for k, visit in enumerate(chosen))


def in_order(visits: Visits, chosen: Sequence[int], menu: Menu, seed: int) -> tuple[int, ...]:
    """Set-up by set-up, tool by tool, at random within: a drift over the day looks like no pose."""
    order = list(np.random.default_rng([seed, 1]).permutation(len(chosen)))
    setups, tools = list(menu.setups), list(menu.tool_extensions)
    order.sort(key=lambda k: (setups.index(visits.setup[chosen[k]]), tools.index(visits.extension[chosen[k]])))
    return tuple(chosen[k] for k in order)
