"""Visits drawn blindly: what planning is compared with."""

import numpy as np

from toolpath_stiff.planning.plan import RivalPlan


def random_visits(plan: RivalPlan, n: int, seed: int) -> tuple[int, ...]:
    """As many visits to different places drawn from the same menu."""
    free = np.ones(len(plan.visits), dtype=bool)
    rng = np.random.default_rng(seed)
    drawn: list[int] = []
    while len(drawn) < n and free.any():
        visit = int(rng.choice(np.flatnonzero(free)))
        drawn.append(visit)
        free &= ~plan.visits.same_place(visit)
    return tuple(drawn)
