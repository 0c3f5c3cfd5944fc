"""Structure in residuals: patterns, among many possible ones, that scatter alone would not produce.

Residuals r = ln(measured / modelled) scatter with the covariance S of `noise`: repeats, clamping, strut spread, joint
positions. Where they scatter more than that from place to place, for reasons unknown, the excess is taken as a variance
tau^2 of every mechanically distinct place, estimated by setting the generalised sum of squares to what scatter alone
would give (Paule and Mandel 1982, J. Res. NBS 87, 377-385), so that a pattern must stand out against what is there, not
only against the noise that is known. A pattern is a column x; its statistic is

    t = x' V^-1 r / sqrt(x' V^-1 x),       V = S + tau^2 Z Z',

x made free of the patterns already found. The largest |t| of all patterns is compared with the largest |t| in simulated
scatter, wild readings included (Westfall and Young 1993, Resampling-based multiple testing): that is `p_adjusted`. The
strongest pattern is then taken out and the rest is asked again, until nothing stands out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from toolpath_stiff.arrays import ArrayColumns, BoolArray, FloatArray, IntArray, TextArray
from toolpath_stiff.inference.covariances import Covariance, Groups, inverse_root
from toolpath_stiff.inference.noise import Noise

# tau: relative sd of the excess; 0, then 0.3 % to 100 % in steps of 30 %.
EXCESSES = np.concatenate([[0.0], np.geomspace(0.003, 1.0, 23)])
SIGNIFICANT = 0.05  # family-wise
FAR_OFF = 4.0  # standard deviations from which a single reading is named
MOST_PATTERNS = 8  # found one after the other
ALIKE = 0.9  # correlation from which two patterns cannot be told apart in these data
WILD = 3.0  # standard deviations to which a wild residual is clipped
FEWEST_REPEATED = 5  # readings beyond one a place from which the noise itself is checked
TIED = 1e-9  # relative difference of statistics that count as equal: of patterns that cannot be told apart
DEPENDENT = 1e-6  # share of a column's square left beside the patterns found: below it nothing is left


@dataclass(frozen=True, eq=False)
class Pattern:
    """A pattern that residuals may show.

    Attributes
    ----------
    name, variable, direction
        For files: "Z:height", "height", "Z" ("all" for all directions).
    kind
        "level": some rows against none; "slope": against a variable.
    values
        (n,) the column.
    rows
        (n,) bool, readings that it is about.
    place
        Words: "near the axis at the upper plane"; of a slope, the variable's title.
    given, unit
        (n,) the variable in its shop unit, of a slope.
    same
        Names of further patterns that are this one in these data, such as a set-up that is a plane.
    """

    name: str
    variable: str
    direction: str
    kind: str
    values: FloatArray
    rows: BoolArray
    place: str
    given: FloatArray | None = None
    unit: str = ""
    same: tuple[str, ...] = ()


@dataclass(frozen=True)
class FoundPattern:
    """Test result of one pattern.

    Attributes
    ----------
    pattern
        Which one.
    statistic
        t, positive: stiffer than modelled.
    p_adjusted
        Probability of such a largest |t| in scatter alone.
    coefficient
        Of the column, beside the patterns found before it.
    alike
        Other patterns that cannot be told from it in these data.
    """

    pattern: Pattern
    statistic: float
    p_adjusted: float
    coefficient: float
    alike: tuple[Pattern, ...]


class Scattering:
    """Scatter of n readings, covariance S plus an excess from place to place, and simulated sets of it.

    With an excess tau the inverse covariance is, for Z' S^-1 Z = U diag(g) U' (Woodbury 1950),

        V^-1 = S^-1 - W' diag(tau^2 / (1 + tau^2 g)) W,      W = U' Z' S^-1.

    Parameters
    ----------
    noise, covariance
        Of ln readings.
    clamp, place
        (n,) labels: readings clamped together; readings that are mechanically the same.
    draws, seed
        Simulated sets of readings.

    Attributes
    ----------
    of_places, taken
        W (p, n); of each excess of the grid, (grid, p) what it takes off.
    """

    def __init__(
        self,
        noise: Noise,
        covariance: Covariance,
        clamp: TextArray,
        place: IntArray,
        draws: int,
        seed: int,
    ) -> None:
        self.noise, self.covariance = noise, covariance
        self.places = Groups.by(place)
        solved = covariance.precision.times(np.equal.outer(np.arange(self.places.count), self.places.of).astype(float))
        weight, turn = np.linalg.eigh(self.places.sums(solved))
        self.of_places = turn.T @ solved
        self.taken = EXCESSES[:, None] ** 2 / (1.0 + EXCESSES[:, None] ** 2 * np.maximum(weight, 0.0))
        self.sd = np.sqrt(covariance.diagonal)
        # Includes wild readings, but not the uncertainty of the noise itself.
        self.square = covariance.diagonal + noise.repeat**2 * noise.outliers * (noise.outlier_width**2 - 1.0)
        rng = np.random.default_rng(seed)
        self._normal, self._of_place = self._draw(noise, Groups.by(clamp), draws, rng)

    def _draw(
        self, noise: Noise, clamps: Groups, draws: int, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Scatter of `draws` simulated sets of readings, and their scatter from place to place for an excess of 1."""
        n = len(clamps.of)
        common = rng.standard_normal((draws, len(self.covariance.shared))) @ self.covariance.shared
        clamped = rng.standard_normal((draws, clamps.count))[:, clamps.of]
        clamped = clamped * (noise.clamping if noise.clampings is None else noise.clampings)
        # Clampings beyond the first of their places: degrees of freedom behind an estimate of the clamping.
        first = np.unique(self.places.of, return_index=True)[1]
        again = clamps.count - len(np.unique(clamps.of[first]))
        if again and noise.name == "measured":
            clamped = clamped * np.sqrt(again / rng.chisquare(again, (draws, 1)))
        wild = np.where(rng.random((draws, n)) < noise.outliers, noise.outlier_width, 1.0)
        repeat_error = rng.standard_normal((draws, n)) * noise.repeat * wild
        if np.isfinite(noise.freedom) and noise.freedom > 0:
            # The noise is itself an estimate, so its true size is drawn too.
            repeat_error = repeat_error * np.sqrt(noise.freedom / rng.chisquare(noise.freedom, (draws, 1)))
        return common + clamped + repeat_error, rng.standard_normal((draws, self.places.count))[:, self.places.of]

    def draws(self, excess: float) -> FloatArray:
        """(draws, n) simulated residuals with a given excess."""
        return np.asarray(self._normal + excess * self._of_place)


@dataclass(frozen=True)
class _Weighed(ArrayColumns):
    """Products of m rows of residuals under S: with themselves (m,), k columns (m, k) and p places (m, p)."""

    square: FloatArray
    columns: FloatArray
    places: FloatArray


class _Fit:
    """Patterns (count, n) orthogonalised against those in `base` (b, n), for every excess of the grid."""

    def __init__(self, scattering: Scattering, patterns: FloatArray, base: FloatArray) -> None:
        self.scattering, self.base, self.count = scattering, base, len(patterns)
        every = np.concatenate([patterns, base])
        self._solved = scattering.covariance.precision.times(every)
        self._places = every @ scattering.of_places.T
        self._products = every @ self._solved.T
        self.free = cache(self._free)
        # (n, b): maps residuals to their component along each row of the base.
        self._share = self._solved[self.count :].T @ np.linalg.pinv(self._products[self.count :, self.count :])
        scatter = self._weighed(self.tamed(scattering.draws(0.0)))
        self._target = float(np.median(self._squares(scatter, 0)))
        self._within = float(np.median(self._squares(scatter, -1)))

    def _free(self, grid: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Combinations (k, count) of all columns that give the patterns free of the base, of unit length, at an excess.

        Then the patterns' lengths before; their products (count, count); combinations (k, r) that are the base.
        """
        form = self._products - (self._places * self.scattering.taken[grid]) @ self._places.T
        root = inverse_root(form[self.count :, self.count :]) if len(self.base) else np.zeros((0, 0))
        of_base = np.concatenate([np.zeros((self.count, root.shape[1])), root])
        combined = np.eye(len(form), self.count) - of_base @ (root.T @ form[self.count :, : self.count])
        left, whole = np.diagonal(combined.T @ form @ combined), np.diagonal(form)[: self.count]
        size = np.sqrt(np.where(left > DEPENDENT * whole, left, np.inf))
        combined = combined / size
        return combined, size, combined.T @ form @ combined, of_base

    def tamed(self, residuals: FloatArray) -> FloatArray:
        """Rows (m, n) of residuals without the base, wild ones clipped (Huber 1981, Robust Statistics, psi)."""
        rest = residuals - (residuals @ self._share) @ self.base
        typical = np.median(np.abs(rest) / self.scattering.sd, axis=1, keepdims=True)
        # 0.6745: the median of the size of a standard normal variable.
        bound = WILD * np.maximum(typical / 0.6745, 1.0) * self.scattering.sd
        return np.asarray(np.clip(rest, -bound, bound))

    def _weighed(self, rows: FloatArray) -> _Weighed:
        squares = self.scattering.covariance.precision.squares(rows)
        return _Weighed(squares, rows @ self._solved.T, rows @ self.scattering.of_places.T)

    def _with_columns(self, rows: _Weighed, grid: int) -> FloatArray:
        """(m, k) products r' V^-1 x with each column x."""
        return np.asarray(rows.columns - (rows.places * self.scattering.taken[grid]) @ self._places.T)

    def _squares(self, rows: _Weighed, grid: int) -> FloatArray:
        """(m,) sums of squares r' V^-1 r, without the base."""
        whole = rows.square - rows.places**2 @ self.scattering.taken[grid]
        return np.asarray(whole - ((self._with_columns(rows, grid) @ self.free(grid)[3]) ** 2).sum(axis=1))

    def _excess(self, rows: _Weighed, target: FloatArray) -> IntArray:
        """(m,) index of the smallest excess at which a row's sum of squares falls to the target (m,)."""
        chosen, left = np.full(len(target), len(EXCESSES) - 1), np.arange(len(target))
        for grid in range(len(EXCESSES)):
            good = self._squares(rows.take(left), grid) <= target[left]
            chosen[left[good]] = grid
            left = left[~good]
            if not len(left):
                break
        return chosen

    def statistics(self, residuals: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
        """(m, patterns) t, (m,) index of the excess and (m,) factor on the noise, for residuals (m, n)."""
        rows = self._weighed(self.tamed(residuals))
        inflation = np.ones(len(residuals))
        if len(residuals.T) - self.scattering.places.count >= FEWEST_REPEATED:
            inflation = np.maximum(self._squares(rows, -1) / self._within, 1.0)
        chosen = self._excess(rows, self._target * inflation)
        t = np.zeros((len(residuals), self.count))
        for grid in np.unique(chosen).tolist():
            t[chosen == grid] = self._with_columns(rows.take(chosen == grid), grid) @ self.free(grid)[0]
        factor = np.sqrt(inflation)
        return t / factor[:, None], chosen, factor


@dataclass(frozen=True)
class FoundPatterns:
    """All test results under one noise model.

    Attributes
    ----------
    scattering
        What residuals were held against.
    patterns
        Patterns that stand out, one after the other.
    tests
        Every pattern on its own.
    excess, excess_left
        Relative sd from place to place beyond the noise, before and after taking the patterns out.
    probability
        Of residuals this large in scatter alone.
    """

    scattering: Scattering
    patterns: tuple[FoundPattern, ...]
    tests: tuple[FoundPattern, ...]
    excess: float
    excess_left: float
    probability: float

    def least_p(self, pattern: Pattern) -> float:
        """Smallest adjusted probability of a pattern, tested alone or beside others."""
        same = (test for test in (*self.tests, *self.patterns) if test.pattern is pattern)
        return min((test.p_adjusted for test in same), default=1.0)


def find_structure(residual: FloatArray, patterns: list[Pattern], scattering: Scattering) -> FoundPatterns:
    """Patterns that residuals (n,), ln(measured / modelled), show beyond scatter."""
    columns = np.array([pattern.values for pattern in patterns])
    base = np.zeros((0, len(residual)))
    detections: list[FoundPattern] = []
    tests: tuple[FoundPattern, ...] = ()
    excess = left = 0.0
    for step in range(MOST_PATTERNS + 1):
        fit = _Fit(scattering, columns, base)
        (t,), (grid,), (factor,) = fit.statistics(residual[None])
        left = float(EXCESSES[grid])
        drawn = np.abs(fit.statistics(scattering.draws(left))[0]).max(axis=1)
        p = (1.0 + (drawn[:, None] >= np.abs(t)[None, :] - 1e-12).sum(axis=0)) / (1.0 + len(drawn))
        _, sizes, products, _ = fit.free(int(grid))
        coefficients, alike = t * float(factor) / sizes, np.abs(products) > ALIKE
        np.fill_diagonal(alike, val=False)
        answers = [
            FoundPattern(pattern, float(t[i]), float(p[i]), float(coefficients[i]),
                         tuple(patterns[j] for j in np.flatnonzero(alike[i])))
            for i, pattern in enumerate(patterns)
        ]  # fmt: skip
        if step == 0:
            excess, tests = left, tuple(answers[i] for i in np.flatnonzero(np.isfinite(sizes)))
        best = int(np.argmax(np.abs(t) >= (1.0 - TIED) * np.abs(t).max()))
        if p[best] >= SIGNIFICANT or step == MOST_PATTERNS:
            break
        detections.append(answers[best])
        base = np.concatenate([base, columns[[best]]])
    simulated = scattering.covariance.precision.squares(scattering.draws(0.0))
    larger = float((simulated >= float(scattering.covariance.precision.squares(residual))).sum())
    probability = (1.0 + larger) / (1.0 + len(simulated))
    return FoundPatterns(scattering, tuple(detections), tests, excess, left, probability)


def shared_tests(structures: Sequence[FoundPatterns]) -> tuple[FoundPattern, ...]:
    """Test of every single pattern under the last noise model, with the largest probability under any of them."""
    by_noise = [{test.pattern: test.p_adjusted for test in structure.tests} for structure in structures]
    return tuple(
        replace(test, p_adjusted=max(of_noise.get(test.pattern, test.p_adjusted) for of_noise in by_noise))
        for test in structures[-1].tests
    )


def far_off(residual: FloatArray, structure: FoundPatterns) -> tuple[FloatArray, IntArray, FloatArray]:
    """(n,) residuals without the patterns found, rows far from zero, the furthest first, and (n,) residuals in sd."""
    columns = np.array([answer.pattern.values for answer in structure.patterns]).reshape(-1, len(residual)).T
    rest = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0] if columns.size else residual
    ratio = rest / np.sqrt(structure.scattering.covariance.diagonal + structure.excess_left**2)
    order = np.argsort(-np.abs(ratio), kind="stable")
    return rest, order[np.abs(ratio[order]) > FAR_OFF], ratio
