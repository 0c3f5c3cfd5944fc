"""Noise from repeats: repeat noise, clamping, and the share of wild readings.

By restricted maximum likelihood of the differences between repeats (Patterson and Thompson 1971), in which what the
machine does cancels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.defaults import CLAMPING
from toolpath_stiff.inference.covariances import Groups
from toolpath_stiff.readings.measurements import Readings

# Share of wild readings if repeats do not tell, and how much wider they scatter; assumed. If repeats tell, their
# share is expected about the assumed one (sd of its logarithm), within the ends.
OUTLIERS, OUTLIER_WIDTH = 0.02, 4.0
OUTLIER_SPREAD, OUTLIER_ENDS = 1.5, (0.005, 0.20)
# Grid over which scatter and share are weighed: factors on the first estimate of the scatter, shares.
FACTORS, SHARES = np.geomspace(0.3, 3.3, 61), np.geomspace(*OUTLIER_ENDS, 16)
# Degrees of freedom that a difference is worth for the scatter if it may be wild: from 300 simulations each of 6 to
# 71 differences, 2 % of the readings wild, give (0.74 to 0.62).
WORTH = 0.63
FEWEST_CONTRASTS = 6  # differences between repeats from which a noise is estimated
MOST_TRIMS = 8
MOST_APART = 600  # clampings along axes: of more only those of a clamping as a whole are looked at
LARGEST_RATIO, ZOOMS = 5.0, 6  # of clamping to repeat noise; ever finer grids on which it is looked for
# Standard deviations at which larger deviations are capped: the wildest tells nothing about the others.
FARTHEST = 1.5 * OUTLIER_WIDTH
ALIKE = ("position", "angles", "direction", "force", "tool_extension", "setup", "loop")  # columns of repeats
# Normal deviate, of 0.01 %, at which scatters that are the same would be told apart by axis or by set-up: were their
# logarithms normal, which those of a few differences are not; of 60 small sound campaigns 0.1 % told one apart.
DIFFERENT = 3.719
WILD = 3.0  # standard deviations beyond which a difference between repeats is set aside


def repeat_groups(data: Readings, apart: Sequence[str] = ()) -> IntArray:
    """(n,) number of each reading's group: same pose, direction, load, tool, set-up and loop.

    `apart`: those of `ALIKE` in which the readings of a group may differ.
    """
    columns = []
    for values in (getattr(data, name) for name in ALIKE if name not in apart):
        numbers = values if values.dtype.kind == "f" else np.unique(values, return_inverse=True)[1] * 1.0
        columns.append(np.round(numbers.reshape(len(data), -1), 6))
    return np.unique(np.concatenate(columns, axis=1), axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)


def copied(data: Readings) -> bool:
    """True if every repeat is the same number as the reading it repeats, which tells nothing about scatter."""
    groups = repeat_groups(data)
    _, first = np.unique(groups, return_index=True)
    again = np.bincount(groups)[groups] > 1
    return bool(again.any() and (data.stiffness == data.stiffness[first][groups])[again].all())


@dataclass(frozen=True)
class Repeats:
    """Noise estimated from repeats.

    Attributes
    ----------
    repeat, clamping
        Relative standard deviations.
    differences
        Differences between repeats: degrees of freedom if no reading were wild.
    clamps
        Whether clamping was estimated.
    wild
        Share of wild readings.
    apart
        Whether each axis of a clamping scatters for itself, as where gauge and indicator are set anew along each.
    """

    repeat: float
    clamping: float
    differences: int
    clamps: bool
    wild: float
    apart: bool = False

    @property
    def total(self) -> float:
        """Relative sd of a reading, including clamping if readings were clamped anew."""
        return float(np.hypot(self.repeat, self.clamping)) if self.clamps else self.repeat

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the scatter: fewer than the differences, as any of them may be wild."""
        return WORTH * self.differences


def from_repeats(data: Readings) -> Repeats | None:
    """Noise from repeats; None if there are too few.

    What differs between repeats beside chance, the time since zeroing and the order, is projected out first, so that
    a drift is not taken for noise; where too few differences would be left, it counts as noise, on the safe side.
    Differences beyond `WILD` standard deviations are set aside as wild for a first estimate; scatter and share of wild
    readings are then weighed together over all differences.
    """
    return _from_repeats(data, drifts=True) or _from_repeats(data, drifts=False)


def _from_repeats(data: Readings, *, drifts: bool) -> Repeats | None:
    groups = repeat_groups(data)
    every, result = np.bincount(groups)[groups] > 1, None
    kept = every
    for _ in range(MOST_TRIMS):
        some = data.select(kept)
        if not kept.any() or _Contrasts(some, groups[kept], Groups.by(some.clamp), drifts).count < FEWEST_CONTRASTS:
            break
        contrasts, result = _likeliest(some, groups[kept], drifts)
        wild = contrasts.deviations(result.repeat, result.clamping) > WILD
        if not wild.any():
            break
        left = np.delete(np.flatnonzero(kept), np.flatnonzero(wild))
        kept = np.isin(np.arange(len(data)), left) & (np.bincount(groups[left], minlength=groups.max() + 1)[groups] > 1)
    if result is None:
        return None
    some = data.select(every)
    contrasts = _Contrasts(some, groups[every], clampings_of(some, result.apart), drifts)
    deviations = contrasts.deviations(result.repeat, result.clamping)
    factor, share = _mixture(deviations, np.bincount(groups)[groups[every]])
    return replace(result, repeat=factor * result.repeat, wild=share)


def clampings_of(data: Readings, apart: bool) -> Groups:
    """Readings that a clamping moves alike: all of it, or of each axis by itself."""
    clamps = Groups.by(data.clamp)
    return Groups.by(3 * clamps.of + np.abs(data.direction).argmax(axis=1)) if apart else clamps


def _likeliest(data: Readings, groups: IntArray, drifts: bool) -> tuple[_Contrasts, Repeats]:
    """Contrasts and the scatter that makes them likeliest: of clampings as a whole, or of each axis for itself."""
    ways = []
    for apart in (False, True):
        clamps = clampings_of(data, apart)
        if not apart or clamps.count <= MOST_APART:
            contrasts = _Contrasts(data, groups, clamps, drifts)
            if not apart or contrasts.tells:
                repeat, clamping, likelihood = _maximum_likelihood(contrasts)
                clamping = clamping if contrasts.tells else min(CLAMPING, repeat)
                found = Repeats(repeat, clamping, contrasts.count, contrasts.tells, OUTLIERS, apart)
                ways.append((likelihood, contrasts, found))
    return max(ways, key=lambda way: way[0])[1:]


def scatter_apart(data: Readings, every: Repeats) -> tuple[float | FloatArray, float | FloatArray, str]:
    """Repeat noise and clamping, (n,) if repeats scatter differently along axes or between set-ups; and words.

    Beyond chance: the logarithms of their scatters differ by more than their degrees of freedom allow (chi-squared,
    `DIFFERENT`). Readings of one clamping along different axes share no more scatter than the quietest axis has.
    """
    main = np.abs(data.direction).argmax(axis=1)
    for kind, labels in (("along", np.array([*"XYZ"])[main]), ("in set-up", data.setup)):
        names, which = np.unique(labels, return_inverse=True)
        parts = [from_repeats(data.select(which == k)) for k in range(len(names))] if len(names) > 1 else []
        known = [part for part in parts if part is not None]
        if len(known) < max(len(parts), 2):
            continue
        logs, weights = np.log([part.total for part in known]), 2.0 * np.array([part.freedom for part in known])
        squares, freedom = weights @ (logs - np.average(logs, weights=weights)) ** 2, len(known) - 1
        # Quantile of chi-squared by its cube root (Wilson and Hilferty 1931, PNAS 17, 684).
        third = 2.0 / (9.0 * freedom)
        if squares < freedom * (1.0 - third + DIFFERENT * np.sqrt(third)) ** 3:
            continue
        total = np.exp(logs)
        clamping = np.array([part.clamping for part in known])
        if kind == "along" and not every.apart:
            clamping = np.full(len(known), min(every.clamping, float(total.min()) / np.sqrt(2.0)))
        repeat = np.array([np.sqrt(p.total**2 - c**2 * p.clamps) for p, c in zip(known, clamping, strict=True)])
        each = ", ".join(f"{100 * t:.2g} % {kind} {name}" for t, name in zip(total, names, strict=True))
        return repeat[which], clamping[which] if np.ptp(clamping) > 0.0 else float(clamping[0]), f"; {each}"
    return every.repeat, every.clamping, ""


def _mixture(deviations: FloatArray, size: IntArray) -> tuple[float, float]:
    """Factor on the scatter, and share of wild readings, from deviations (n,) of repeats.

    A reading's deviation from the others of its group of `size` (n,) is wild with itself or with one of them; for pairs
    that is exact. Each group counts with its degrees of freedom. Factor and share are the posterior means of their
    logarithms; the factor's prior is flat in its logarithm.
    """
    squared, wide = np.minimum(deviations, FARTHEST)[:, None, None] ** 2, OUTLIER_WIDTH**2
    own_share = 1.0 - 1.0 / size[:, None, None]  # of the variance of a deviation
    total = np.zeros((len(size), len(FACTORS), len(SHARES)))
    for mine, chance in ((wide, SHARES), (1.0, 1.0 - SHARES)):
        for others, odds in ((wide, SHARES), (1.0, 1.0 - SHARES)):
            sd = FACTORS[:, None] * np.sqrt(own_share * mine + (1.0 - own_share) * others)
            total += chance * odds * np.exp(-0.5 * squared / sd**2) / sd
    logs = (np.log(np.maximum(total, 1e-300)) * own_share).sum(axis=0)
    logs = logs - 0.5 * (np.log(SHARES / OUTLIERS) / OUTLIER_SPREAD) ** 2
    weights = np.exp(logs - logs.max())
    of_factor, of_share = weights.sum(axis=1) / weights.sum(), weights.sum(axis=0) / weights.sum()
    return float(np.exp(of_factor @ np.log(FACTORS))), float(np.exp(of_share @ np.log(SHARES)))


class _Contrasts:
    """Differences between repeats: residuals M y of n ln readings y beside group means, time and order.

    M takes least squares' residuals. Their covariance is M (repeat^2 + clamping^2 Z Z^T) M, Z with a column of ones and
    noughts a clamping; all that a likelihood asks of it are the eigenvalues of Z^T M Z, as many as there are
    clampings, and the shares of M y along its eigenvectors.

    Attributes
    ----------
    left, redundancy
        (n,) M y; diagonal of M.
    reached, values
        (n, k) M Z E for eigenvectors E of Z^T M Z, and its eigenvalues (k,) that are not 0. None where every reading
        was clamped by itself, which cannot be told from repeat noise, or where all repeats are of one clamping.
    loads
        (k,) squared shares of M y along the eigenvectors.
    count
        Rank of M: degrees of freedom.
    alone
        Whether every reading was clamped by itself: the differences then hold clamping too.
    """

    def __init__(self, data: Readings, groups: IntArray, clamps: Groups, drifts: bool) -> None:
        means = Groups.by(groups)
        sizes = np.bincount(means.of)

        def centred(columns: FloatArray) -> FloatArray:
            return np.asarray(columns - (means.sums(columns.T) / sizes)[:, means.of].T)

        logs = np.log(data.stiffness)[:, None]
        moved = centred(_drifts(data, np.exp(logs - centred(logs))[:, 0])) * drifts
        axes, size, _ = np.linalg.svd(moved, full_matrices=False)
        fixed = axes[:, size > 1e-9 * max(float(size[0]), np.sqrt(sizes.max()))]

        def left(columns: FloatArray) -> FloatArray:
            rest = centred(columns)
            return np.asarray(rest - fixed @ (fixed.T @ rest))

        n, self.alone = len(groups), clamps.alone
        clamped = np.zeros((n, 0)) if clamps.alone else left((clamps.of[:, None] == np.arange(clamps.count)) * 1.0)
        values, vectors = np.linalg.eigh(clamped.T @ clamped)
        largest = np.bincount(clamps.of).max(initial=0)  # largest eigenvalue if nothing were projected out
        kept = values > largest * n * np.finfo(float).eps
        self.left, self.reached, self.values = left(logs)[:, 0], clamped @ vectors[:, kept], values[kept]
        self.redundancy = 1.0 - 1.0 / sizes[means.of] - (fixed**2).sum(axis=1)
        self.loads = (self.left @ self.reached) ** 2 / self.values
        self.count = int(n - means.count - fixed.shape[1])

    @property
    def tells(self) -> bool:
        """True if the differences tell clamping from repeat noise."""
        rank = len(self.values)
        spread = float(np.ptp(self.values)) if rank == self.count else float(self.values.max(initial=0.0))
        return spread > 1e-6 and rank >= 3

    def deviations(self, repeat: float, clamping: float) -> FloatArray:
        """(n,) deviation of each reading from the others, in standard deviations."""
        repeat = max(repeat, 1e-12)
        ratio, variance = (clamping / repeat) ** 2, repeat**2 + (clamping**2 if self.alone else 0.0)
        weights = ratio / (1.0 + ratio * self.values)
        pull = (self.left - self.reached @ (weights * (self.left @ self.reached))) / variance
        scale = np.sqrt(np.maximum(self.redundancy - self.reached**2 @ weights, 0.0) / variance)
        return np.asarray(np.abs(pull) / np.maximum(scale, 1e-12))


def _drifts(data: Readings, stiffness: FloatArray) -> FloatArray:
    """(n, 1 or 4) systematic differences between repeats: order, and a drift since zeroing.

    `stiffness` (n,) is the mean of each reading's repeats: a reading's own would carry its noise into the regressor,
    which then takes that very noise away.
    """
    regressors = [np.linspace(-1.0, 1.0, len(data))]
    if "time_min" not in data.missing:
        # A drift adds rate * time to the deflection: to the logarithm, rate * time * k / F and its square.
        drift = data.time * stiffness / data.force
        drift = drift / max(float(np.abs(drift).max()), 1e-300)
        regressors += [drift, drift**2, data.time / max(float(data.time.max()), 1e-300)]
    return np.stack(regressors, axis=1)


def _maximum_likelihood(contrasts: _Contrasts) -> tuple[float, float, float]:
    """Repeat noise and clamping that make the contrasts most likely, and the logarithm of how likely.

    With the logarithm of clamping as penalty: the likelihood of a few clampings is often largest at none, however much
    there is, and what readings share would be taken for the machine's. It moves an estimate by a standard error at most
    (Chung, Rabe-Hesketh, Dorie, Gelman and Liu 2013, A nondegenerate penalized likelihood estimator for variance
    parameters in multilevel models, Psychometrika 78, 685).
    """
    loads, rest = contrasts.loads, max(float(contrasts.left @ contrasts.left) - float(contrasts.loads.sum()), 0.0)
    low, high = 0.0, LARGEST_RATIO if contrasts.tells else 0.0
    for _ in range(ZOOMS):
        ratios = np.linspace(low, high, 41)  # of clamping to repeat noise
        widths = 1.0 + ratios[:, None] ** 2 * contrasts.values
        repeat = np.sqrt((rest + (loads / widths).sum(axis=1)) / contrasts.count)
        volume = 0.5 * np.log(widths).sum(axis=1) - np.log(np.maximum(ratios, 1e-12))
        best = int(np.argmin((contrasts.count - 1) * np.log(np.maximum(repeat, 1e-12)) + volume))
        low, high = ratios[max(best - 1, 0)], ratios[min(best + 1, len(ratios) - 1)]
    likelihood = -contrasts.count * np.log(max(repeat[best], 1e-12)) - 0.5 * np.log(widths[best]).sum()
    return float(repeat[best]), float(ratios[best] * repeat[best]), float(likelihood)
