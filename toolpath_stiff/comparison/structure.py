"""Structure in residuals: which of many possible patterns are more than scatter would make of nothing.

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

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray, TextArray
from toolpath_stiff.inference.covariances import Covariance, Groups
from toolpath_stiff.inference.noise import Noise

if TYPE_CHECKING:
    from scipy.sparse import csr_array


# tau: relative sd of the excess; 0, then 0.3 % to 100 % in steps of 30 %.
EXCESSES = np.concatenate([[0.0], np.geomspace(0.003, 1.0, 23)])
SIGNIFICANT = 0.05  # family-wise
FAR_OFF = 4.0  # standard deviations, of a reading that is named
MOST_PATTERNS = 8  # found one after the other
ALIKE = 0.9  # correlation from which two patterns cannot be told apart in these data
WILD = 3.0  # standard deviations at which a reading is drawn in
FEWEST_REPEATED = 5  # readings beyond one a place from which the noise itself is checked
WIDE = 60  # readings of a clamping or a place from which it counts as something that all readings share
TIED = 1e-9  # share by which statistics differ that are one and the same: of patterns that cannot be told apart
DEPENDENT = 1e-6  # of a column's square that is left after the patterns already found: less is nothing


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
    """The answer about one pattern.

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
    """The scatter of n readings, ready to be whitened and drawn.

    Readings hang together by clampings and by places in small blocks. In each, a basis is found in which the noise is
    white and the excess of the places diagonal; the few nuisances that all readings share enter as columns, U, along
    whose principal axes Q whitening shrinks what comes in: 1 - Q (1 - (1 + s^2)^-1/2) Q' for U = Q s P' (Woodbury).

    Parameters
    ----------
    noise, covariance
        Of ln readings.
    clamp, place
        (n,) labels: readings clamped together; readings that are mechanically the same.
    draws, seed
        Simulated sets of readings.
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
        clamps, wide_clamps = _narrow(covariance.groups)
        narrow, wide_places = _narrow(self.places)
        self.turn, spread = _turn_blocks(covariance, clamps, narrow)
        self.weights = 1.0 / np.sqrt(1.0 + EXCESSES[:, None] ** 2 * np.maximum(spread, 0.0))  # (g, n)
        self._shared = self.turned(
            np.concatenate([covariance.shared, np.sqrt(covariance.groups.spread(covariance.common)) * wide_clamps])
        )
        self._wide_places = self.turned(wide_places)
        self.axes = cache(self._axes)
        self.sd = np.sqrt(covariance.diagonal)
        # Wild readings included; how well the noise itself is known is not.
        self.square = covariance.diagonal + noise.repeat**2 * noise.outliers * (noise.outlier_width**2 - 1.0)
        rng = np.random.default_rng(seed)
        self._normal, self._of_place = self._draw(noise, Groups.by(clamp), draws, rng)

    def _draw(
        self, noise: Noise, clamps: Groups, draws: int, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Scatter of `draws` sets of readings, and the excess of each place for an excess of 1."""
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
            # The noise is itself an estimate: what it is for depends on the draw.
            repeat_error = repeat_error * np.sqrt(noise.freedom / rng.chisquare(noise.freedom, (draws, 1)))
        return common + clamped + repeat_error, rng.standard_normal((draws, self.places.count))[:, self.places.of]

    def draws(self, excess: float) -> FloatArray:
        """(draws, n) simulated residuals with that excess."""
        return np.asarray(self._normal + excess * self._of_place)

    def turned(self, rows: FloatArray) -> FloatArray:
        """Rows (m, n) in the basis in which the noise is white, but for what all share, and the excess diagonal."""
        return np.asarray((self.turn @ rows.T).T)

    def _axes(self, grid: int) -> tuple[FloatArray, FloatArray]:
        """Principal axes (n, q) of what all share at an excess of the grid, and how much of each is to be taken off."""
        shared = np.concatenate([self._shared, EXCESSES[grid] * self._wide_places]) * self.weights[grid]
        axes, size, _ = np.linalg.svd(shared.T, full_matrices=False)
        return axes, 1.0 - 1.0 / np.sqrt(1.0 + size**2)

    def shrunk(self, columns: FloatArray, grid: int) -> FloatArray:
        """Columns (n, m), turned and weighted, white also in what all readings share."""
        axes, share = self.axes(grid)
        return np.asarray(columns - axes @ (share[:, None] * (axes.T @ columns)))


def _narrow(groups: Groups) -> tuple[IntArray, FloatArray]:
    """(n,) each reading's group, -1 in one of more than `WIDE` readings; (w, n) ones and noughts of those."""
    wide = np.flatnonzero(np.bincount(groups.of) > WIDE)
    return np.where(np.isin(groups.of, wide), -1, groups.of), (groups.of == wide[:, None]).astype(float)


def _turn_blocks(covariance: Covariance, clamp: IntArray, place: IntArray) -> tuple[csr_array, FloatArray]:
    """Turn (n, n) in which each reading's own scatter and its clamping's are white, and the variance of its place.

    The readings of a block have a clamping or a place in common with each other; -1 is none.
    """
    from scipy.sparse import csr_array

    spread, parts, clamping = np.zeros(len(clamp)), [], covariance.groups.spread(covariance.common)
    for rows in _connected(clamp, place).members():
        own_variance, of, place_of = covariance.own_variance[rows], clamp[rows], place[rows]
        same = (of[:, None] == of) & (of >= 0)
        inverse = np.linalg.inv(np.linalg.cholesky(np.diag(own_variance) + clamping[rows] * same))
        spread[rows], turn = np.linalg.eigh(inverse @ ((place_of[:, None] == place_of) & (place_of >= 0)) @ inverse.T)
        parts.append((turn.T @ inverse, np.repeat(rows, len(rows)), np.tile(rows, len(rows))))
    data, row, column = (np.concatenate([np.ravel(part[k]) for part in parts]) for k in range(3))
    return csr_array((data, (row, column)), shape=(len(clamp),) * 2), spread


def _connected(clamp: IntArray, place: IntArray) -> Groups:
    """Readings (n,) that hang together by their clampings and places; -1 is none."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n, clamps = len(clamp), int(clamp.max()) + 1
    columns = np.concatenate([n + clamp, n + clamps + place])
    held = np.concatenate([clamp, place]) >= 0
    links = (np.ones(held.sum()), (np.tile(np.arange(n), 2)[held], columns[held]))
    size = n + clamps + int(place.max()) + 1
    return Groups.by(connected_components(coo_array(links, shape=(size, size)), directed=False)[1][:n])


class _Fit:
    """Patterns made free of those in `base`, for every excess of the grid.

    Rows of residuals stay as they are turned; what they are multiplied with is whitened twice instead.
    """

    def __init__(self, scattering: Scattering, columns: FloatArray, base: FloatArray) -> None:
        self.scattering, self.base = scattering, base
        self._turned, self._fixed = scattering.turned(columns).T, scattering.turned(base).T
        self.of_base, self.columns = cache(self._of_base), cache(self._columns)
        white = scattering.shrunk(self._fixed * scattering.weights[0][:, None], 0)
        # (n, b) from turned residuals to their share in each row of the base.
        self._taken = scattering.shrunk(np.asarray(np.linalg.pinv(white).T), 0) * scattering.weights[0][:, None]
        scatter = scattering.turned(self.tamed(scattering.draws(0.0)))
        self._target = float(np.median(self._squares(scatter, 0)))
        self._within = float(np.median(self._squares(scatter, -1)))

    def _of_base(self, grid: int) -> tuple[FloatArray, FloatArray]:
        """Orthonormal basis (n, b) of the white base; (n, q) what removes it and what all share from a square."""
        axes, share = self.scattering.axes(grid)
        weight = self.scattering.weights[grid][:, None]
        left, singular, _ = np.linalg.svd(self.scattering.shrunk(self._fixed * weight, grid), full_matrices=False)
        basis = left[:, singular > 1e-9 * max(float(singular.max(initial=0.0)), 1e-300)]
        both = [axes * np.sqrt(1.0 - (1.0 - share) ** 2), self.scattering.shrunk(basis, grid)]
        return basis, np.concatenate(both, axis=1) * weight

    def _columns(self, grid: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Patterns (n, patterns) white and of length 1; their lengths before; what gives turned residuals' share."""
        weight, (basis, _) = self.scattering.weights[grid][:, None], self.of_base(grid)
        x = self.scattering.shrunk(self._turned * weight, grid)
        whole = np.einsum("ij,ij->j", x, x)
        x = x - basis @ (basis.T @ x)
        left = np.einsum("ij,ij->j", x, x)
        size = np.sqrt(np.where(left > DEPENDENT * whole, left, np.inf))
        x = x / size
        return x, size, self.scattering.shrunk(x, grid) * weight

    def tamed(self, residuals: FloatArray) -> FloatArray:
        """Rows (m, n) of residuals beside the base, wild ones drawn in (Huber 1981, Robust Statistics, psi)."""
        rest = residuals - (self.scattering.turned(residuals) @ self._taken) @ self.base
        typical = np.median(np.abs(rest) / self.scattering.sd, axis=1, keepdims=True)
        # 0.6745: the median of the size of a standard normal variable.
        bound = WILD * np.maximum(typical / 0.6745, 1.0) * self.scattering.sd
        return np.asarray(np.clip(rest, -bound, bound))

    def _squares(self, turned: FloatArray, grid: int) -> FloatArray:
        whole = ((turned * self.scattering.weights[grid]) ** 2).sum(axis=1)
        return np.asarray(whole - ((turned @ self.of_base(grid)[1]) ** 2).sum(axis=1))

    def _excess(self, turned: FloatArray, target: FloatArray) -> IntArray:
        """(m,) index of the smallest excess that brings the sum of squares of rows (m, n) down to the target (m,)."""
        chosen, left = np.full(len(turned), len(EXCESSES) - 1), np.arange(len(turned))
        for grid in range(len(EXCESSES)):
            good = self._squares(turned[left], grid) <= target[left]
            chosen[left[good]] = grid
            left = left[~good]
            if not len(left):
                break
        return chosen

    def statistics(self, residuals: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
        """Of rows (m, n) of residuals: (m, patterns) t, (m,) index of the excess, (m,) factor on the noise."""
        turned = self.scattering.turned(self.tamed(residuals))
        inflation = np.ones(len(turned))
        if len(residuals.T) - self.scattering.places.count >= FEWEST_REPEATED:
            inflation = np.maximum(self._squares(turned, -1) / self._within, 1.0)
        chosen = self._excess(turned, self._target * inflation)
        t = np.zeros((len(turned), self._turned.shape[1]))
        for grid in np.unique(chosen).tolist():
            rows = chosen == grid
            t[rows] = turned[rows] @ self.columns(grid)[2]
        factor = np.sqrt(inflation)
        return t / factor[:, None], chosen, factor


@dataclass(frozen=True)
class FoundPatterns:
    """All answers under one noise model.

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
        """Smallest adjusted probability that a pattern got, tested alone or beside others."""
        same = (test for test in (*self.tests, *self.patterns) if test.pattern is pattern)
        return min((test.p_adjusted for test in same), default=1.0)


def find_structure(residual: FloatArray, patterns: list[Pattern], scattering: Scattering) -> FoundPatterns:
    """Which of the patterns residuals (n,), ln(measured / modelled), show beyond scatter."""
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
        x, sizes, _ = fit.columns(int(grid))
        coefficients, alike = t * float(factor) / sizes, np.abs(x.T @ x) > ALIKE
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
    """Every pattern on its own under the last noise model, with the largest probability of any."""
    by_noise = [{test.pattern: test.p_adjusted for test in structure.tests} for structure in structures]
    return tuple(
        replace(test, p_adjusted=max(of_noise.get(test.pattern, test.p_adjusted) for of_noise in by_noise))
        for test in structures[-1].tests
    )


def far_off(residual: FloatArray, structure: FoundPatterns) -> tuple[FloatArray, IntArray, FloatArray]:
    """(n,) residuals with the patterns found taken out, rows far from nought, the furthest first, and (n,) in sd."""
    columns = np.array([answer.pattern.values for answer in structure.patterns]).reshape(-1, len(residual)).T
    rest = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0] if columns.size else residual
    ratio = rest / np.sqrt(structure.scattering.covariance.diagonal + structure.excess_left**2)
    order = np.argsort(-np.abs(ratio), kind="stable")
    return rest, order[np.abs(ratio[order]) > FAR_OFF], ratio
