"""How far visits would set rivals apart, which visits to choose for that, and what is to be expected of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.defaults import CLAMPING
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.judgement import NAMED
from toolpath_stiff.planning.rivals import Forecast
from toolpath_stiff.planning.visits import Costs, Menu, Visits
from toolpath_stiff.units import min_from_s

MOST_REPEATS = 64


@dataclass(frozen=True)
class ReadingNoise:
    """Scatter of ln readings: of each, of each clamping (relative sd), and of the machine as a factor (m, k)."""

    repeat: float
    clamping: float
    machine: FloatArray

    def shared_out(self, repeats: float) -> ReadingNoise:
        """The noise of the mean of so many re-clamped readings; the machine stays as it is."""
        return ReadingNoise(self.repeat / np.sqrt(repeats), self.clamping / np.sqrt(repeats), self.machine)


def repeat_and_clamping(relative: float | tuple[float, float]) -> tuple[float, float]:
    """Relative sd of a reading and of a clamping, from these or from that of a reading in total.

    Raises
    ------
    InputError
        A noise that cannot be.
    """
    if isinstance(relative, tuple):
        repeat, clamping = relative
    else:
        clamping = float(min(CLAMPING, relative / np.sqrt(2.0)))
        repeat = float(np.sqrt(max(relative**2 - clamping**2, 0.0)))
    if not (0.0 < repeat <= 1.0 and 0.0 <= clamping <= 1.0):
        raise InputError(f"a noise of {relative!r}", expected="more than 0 and at most 1 (100 %)")
    return repeat, clamping


@dataclass(frozen=True)
class GapShares:
    """What each of v visits adds to the gap of a pair: a (v,), h (v, q), M (v, q, q)."""

    a: FloatArray
    h: FloatArray
    M: FloatArray

    def gap(self, chosen: Sequence[int] | IntArray = (), repeats: float = 1.0) -> float:
        """Gap in standard deviations after the chosen visits, each clamped and read so often."""
        index = np.asarray(chosen, dtype=np.int64)
        squared = _squared_gap(self.a[index].sum(), self.h[index].sum(axis=0), self.M[index].sum(axis=0), repeats)
        return float(np.sqrt(max(float(squared), 0.0)))

    def gaps_with(self, chosen: Sequence[int] | IntArray) -> FloatArray:
        """(v,) gaps after the chosen visits and one more, for each that it could be."""
        index = np.asarray(chosen, dtype=np.int64)
        squared = _squared_gap(
            self.a + self.a[index].sum(), self.h + self.h[index].sum(axis=0), self.M + self.M[index].sum(axis=0), 1.0
        )
        return np.asarray(np.sqrt(np.maximum(squared, 0.0)))


def _squared_gap(a: FloatArray, h: FloatArray, M: FloatArray, repeats: float) -> FloatArray:
    if h.shape[-1] == 0:
        return np.asarray(repeats * a)
    inner = np.eye(h.shape[-1]) + repeats * M
    solved = np.linalg.solve(inner, h[..., None])[..., 0]
    return np.asarray(repeats * a - repeats**2 * (h * solved).sum(axis=-1))


def _summed_products(columns: FloatArray, counts: IntArray) -> FloatArray:
    """(v, q, q) sums over each visit's rows of the products of columns (n, q); all visits with so many rows at once."""
    starts, q = np.cumsum(counts) - counts, columns.shape[1]
    products = np.empty((len(counts), q, q))
    for count in np.unique(counts).tolist():
        alike = np.flatnonzero(counts == count)
        rows = columns[starts[alike, None] + np.arange(count)]
        products[alike] = np.swapaxes(rows, 1, 2) @ rows
    return products


def pair_shares(visits: Visits, first: Forecast, second: Forecast, noise: ReadingNoise) -> GapShares:
    """What every visit adds to the gap of two rivals."""
    difference = first.mean - second.mean
    F = np.concatenate([first.factor, second.factor, np.sqrt(2.0) * noise.machine], axis=1)
    columns = np.concatenate([difference[:, None], F], axis=1)[visits.members]
    starts, counts = visits.starts, visits.counts
    products = _summed_products(columns, counts)
    sums = np.add.reduceat(columns, starts, axis=0)
    # Inverse of 2 (r^2 1 + c^2 11^T) by Sherman and Morrison.
    common = noise.clamping**2 / (noise.repeat**2 + counts * noise.clamping**2)
    form = (products - common[:, None, None] * sums[:, :, None] * sums[:, None, :]) / (2.0 * noise.repeat**2)
    return GapShares(form[:, 0, 0], form[:, 1:, 0], form[:, 1:, 1:])


@dataclass(frozen=True)
class Expectation:
    """What is to be expected of readings.

    Attributes
    ----------
    truth
        Mean probability of the truth.
    settled
        How often the verdict is settled: one rival has the probability from which a diagnosis names it (`NAMED`).
    settled_if
        The same for each rival in turn, were it the truth; `settled` is their mean by the rivals' weights.
    """

    truth: float
    settled: float
    settled_if: tuple[float, ...] = ()


SETTLED = 0.95  # probability of one rival at which visits are enough: on the safe side of a diagnosis's `NAMED`


DRAWS = 400  # simulated results a rival


def expected_outcome(
    forecasts: Sequence[Forecast],
    rows: IntArray,
    visit_of: IntArray,
    noise: ReadingNoise,
    seed: int,
) -> Expectation:
    """Simulate the readings under every rival in turn and judge them by Bayes' rule.

    All rivals scatter by the mean of their covariances here, as in the gap: that one rival is vaguer than another is
    a matter of its prior, and not counted on.

    Parameters
    ----------
    forecasts
        Of all readings; their weights add up to 1.
    rows, visit_of
        (k,) the readings taken, and the number of the visit each belongs to.
    noise
        Of these readings.
    seed
        Of the draws.
    """
    from scipy.linalg import solve_triangular

    rng = np.random.default_rng(seed)
    weights = np.array([forecast.weight for forecast in forecasts])
    same = visit_of[:, None] == visit_of[None, :]
    covariance = noise.repeat**2 * np.eye(len(rows)) + noise.clamping**2 * same
    for factor, weight in [(noise.machine, 1.0), *((f.factor, f.weight) for f in forecasts)]:
        covariance += weight * factor[rows] @ factor[rows].T
    means = np.stack([forecast.mean[rows] for forecast in forecasts], axis=1)
    whitened = solve_triangular(np.linalg.cholesky(covariance), means, lower=True).T
    standard = rng.standard_normal((DRAWS, len(rows)))
    truth, settled = 0.0, []
    for i, weight in enumerate(weights):
        # Of -|z + (m_i - m_j)|^2 / 2 for every j, z standard normal.
        apart = whitened[i] - whitened
        logs = np.log(weights) - 0.5 * (apart**2).sum(axis=1) - standard @ apart.T
        probability = np.exp(logs - logs.max(axis=1, keepdims=True))
        probability /= probability.sum(axis=1, keepdims=True)
        truth += weight * float(probability[:, i].mean())
        settled.append(float((probability.max(axis=1) >= NAMED).mean()))
    return Expectation(truth, float(weights @ settled), tuple(settled))


def expectation(
    visits: Visits,
    chosen: Sequence[int],
    forecasts: Sequence[Forecast],
    noise: ReadingNoise,
    seed: int,
    repeats: int = 1,
) -> Expectation:
    """What is to be expected of these visits, each made so often."""
    rows = [visits.rows(visit) for visit in chosen]
    visit_of = np.repeat(np.arange(len(chosen)), [len(own) for own in rows])
    return expected_outcome(forecasts, np.concatenate(rows), visit_of, noise.shared_out(repeats), seed)


def enough(
    visits: Visits, picked: Sequence[int], forecasts: Sequence[Forecast], noise: ReadingNoise, seed: int
) -> int | None:
    """How many of the picked visits, the first ones, should settle the question; None: not all of them."""
    for k in range(1, len(picked) + 1):
        if expectation(visits, picked[:k], forecasts, noise, seed).truth >= SETTLED:
            return k
    return None


def repeats_needed(
    visits: Visits, picked: Sequence[int], forecasts: Sequence[Forecast], noise: ReadingNoise, seed: int
) -> int | None:
    """How often each visit must be made, clamped anew, to settle the question; None: not `MOST_REPEATS` times."""

    def settles(repeats: int) -> bool:
        return expectation(visits, picked, forecasts, noise, seed, repeats).truth >= SETTLED

    if settles(1):
        return 1
    if not settles(MOST_REPEATS):
        return None
    low, high = 1, MOST_REPEATS
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if settles(middle) else (middle, high)
    return high


def log_confusion(gaps: dict[tuple[str, str], FloatArray], weights: dict[str, float]) -> FloatArray:
    """Logarithm of the bound on the chance of taking one rival for another, of any shape that the gaps have."""
    each = [0.5 * np.log(weights[i] * weights[j]) - gap**2 / 4.0 for (i, j), gap in gaps.items()]
    return np.asarray(np.logaddexp.reduce(each, axis=0))


def choose(
    visits: Visits,
    usable: NDArray[np.bool_],
    shares: dict[tuple[str, str], GapShares],
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
    minutes = costs.pose + costs.reading * visits.counts + min_from_s(visits.wait)
    if visits.loop is not None:
        minutes = minutes + costs.indicator * (visits.loop != "")
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


def kind_of(visits: Visits, visit: int, menu: Menu) -> str:
    """What the visit changes, the dearest thing first."""
    if visits.setup[visit] != menu.setups[0]:
        return "another set-up"
    if visits.across(visit):
        return "an indicator"
    if visits.wait[visit] > menu.waits[0]:
        return "waiting"
    if visits.extension[visit] != menu.tool_extensions[0]:
        return "another tool"
    return "tilted" if visits.tilt(visit) > 1e-6 else "vertical"


def why_of(visits: Visits, visit: int, shares: dict[tuple[str, str], GapShares], menu: Menu) -> str:
    """What the visit is for, a sentence."""
    pair = max(shares, key=lambda p: shares[p].gap([visit]))
    what = [f"tilted {np.degrees(visits.tilt(visit)):.3g} deg" if visits.tilt(visit) > 1e-6 else "vertical"]
    extension = visits.extension[visit]
    if extension:
        what.append(f"tool {1e3 * abs(extension):.4g} mm {'longer' if extension > 0 else 'shorter'}")
    if visits.setup[visit]:
        what.append(f"set-up {visits.setup[visit]}")
    loads = np.unique(visits.readings.force[visits.rows(visit)])
    what.append("at " + " and ".join(f"{load:g} N" for load in loads))
    if visits.wait[visit] > menu.waits[0]:
        what.append(f"{min_from_s(visits.wait[visit]):.3g} minutes after zeroing")
    if visits.rounds[visits.rows(visit)].max() > 1:
        what.append("each reading twice" if visits.rounds[visits.rows(visit)].max() == 2 else "readings repeated")
    if visits.across(visit):
        what.append(f"a second indicator: {visits.across(visit)}")
    gap = shares[pair].gap([visit])
    return f"{', '.join(what)}: {gap:.1f} sigma between {pair[0]} and {pair[1]}"
