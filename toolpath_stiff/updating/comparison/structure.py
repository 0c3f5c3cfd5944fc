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

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.updating.inference.noise import Noise

FloatArray = NDArray[np.float64]

# tau: relative sd of the excess; 0, then 0.3 % to 100 % in steps of 30 %.
EXCESSES = np.concatenate([[0.0], np.geomspace(0.003, 1.0, 23)])
SIGNIFICANT = 0.05  # family-wise
FAR_OFF = 4.0  # standard deviations, of a reading that is named
MOST_PATTERNS = 8  # found one after the other
ALIKE = 0.9  # correlation from which two patterns cannot be told apart in these data
WILD = 3.0  # standard deviations at which a reading is drawn in
FEWEST_REPEATED = 5  # readings beyond one a place from which the noise itself is checked
DEPENDENT = 1e-6  # of a column's square that is left after the patterns already found: less is nothing


@dataclass(frozen=True)
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
    same
        Names of further patterns that are this one in these data, such as a set-up that is a plane.
    """

    name: str
    variable: str
    direction: str
    kind: str
    values: FloatArray
    rows: NDArray[np.bool_]
    place: str
    same: tuple[str, ...] = ()


@dataclass(frozen=True)
class Found:
    """The answer about one pattern.

    Attributes
    ----------
    pattern
        Index of the pattern.
    statistic
        t, positive: stiffer than modelled.
    p_adjusted
        Probability of such a largest |t| in scatter alone.
    coefficient, standard_error
        Of the column, beside the patterns found before it.
    alike
        Other patterns that cannot be told from it in these data.
    """

    pattern: int
    statistic: float
    p_adjusted: float
    coefficient: float
    standard_error: float
    alike: tuple[int, ...]


@dataclass(frozen=True)
class Structure:
    """All answers.

    Attributes
    ----------
    found
        Patterns that stand out, one after the other.
    tests
        Every pattern on its own.
    excess, excess_left
        Relative sd from place to place beyond the noise, before and after taking the patterns out.
    probability
        Of residuals this large in scatter alone.
    """

    found: tuple[Found, ...]
    tests: tuple[Found, ...]
    excess: float
    excess_left: float
    probability: float


class Scattering:
    """The scatter of n readings, ready to be whitened and drawn.

    Parameters
    ----------
    noise, covariance
        Of ln readings; (n, n).
    clamp, place
        (n,) labels: readings clamped together; readings that are mechanically the same.
    draws, seed
        Simulated sets of readings.
    """

    def __init__(
        self,
        noise: Noise,
        covariance: FloatArray,
        clamp: NDArray[np.str_],
        place: NDArray[np.int64],
        draws: int,
        seed: int,
    ) -> None:
        same = (place[:, None] == place[None, :]).astype(float)
        lower = np.linalg.cholesky(covariance)
        inverse = np.linalg.inv(lower)
        spread, turn = np.linalg.eigh(inverse @ same @ inverse.T)
        self.turn = turn.T @ inverse
        self.weights = 1.0 / np.sqrt(1.0 + EXCESSES[:, None] ** 2 * np.maximum(spread, 0.0))  # (g, n)
        self.covariance = covariance
        self.sd = np.sqrt(np.diag(covariance))
        # Wild readings included; how well the noise itself is known is not.
        self.square = np.diag(covariance) + noise.repeat**2 * noise.outliers * (noise.outlier_width**2 - 1.0)
        self.repeated = len(place) - len(set(place.tolist()))
        rng = np.random.default_rng(seed)
        self._normal, self._of_place = self._draw(noise, clamp, place, draws, rng)

    def _draw(
        self, noise: Noise, clamp: NDArray[np.str_], place: NDArray[np.int64], draws: int, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Scatter of `draws` sets of readings, and the excess of each place for an excess of 1."""
        n = len(place)
        clamps = np.unique(clamp, return_inverse=True)[1].reshape(-1)
        same = clamps[:, None] == clamps[None, :]
        shared = self.covariance - np.diag(noise.repeat**2) - noise.clamping**2 * same
        values, vectors = np.linalg.eigh(shared)
        common = (rng.standard_normal((draws, n)) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
        clamped = rng.standard_normal((draws, int(clamps.max()) + 1))[:, clamps] * noise.clamping
        if (again := _clamped_again(clamps, place)) and noise.name == "measured":
            clamped = clamped * np.sqrt(again / rng.chisquare(again, (draws, 1)))
        wild = np.where(rng.random((draws, n)) < noise.outliers, noise.outlier_width, 1.0)
        own = rng.standard_normal((draws, n)) * noise.repeat * wild
        if np.isfinite(noise.freedom) and noise.freedom > 0:
            # The noise is itself an estimate: what it is for depends on the draw.
            own = own * np.sqrt(noise.freedom / rng.chisquare(noise.freedom, (draws, 1)))
        places = np.unique(place, return_inverse=True)[1].reshape(-1)
        return common + clamped + own, rng.standard_normal((draws, int(places.max()) + 1))[:, places]

    def draws(self, excess: float) -> FloatArray:
        """(draws, n) simulated residuals with that excess."""
        return np.asarray(self._normal + excess * self._of_place)

    def turned(self, rows: FloatArray) -> FloatArray:
        """Rows (m, n) in the basis in which noise is white and the excess diagonal."""
        return np.asarray(rows @ self.turn.T)


def _clamped_again(clamps: NDArray[np.int64], place: NDArray[np.int64]) -> int:
    """Clampings beyond the first of their places: degrees of freedom behind an estimate of the clamping."""
    first = {at: clamps[np.flatnonzero(place == at)[0]] for at in np.unique(place).tolist()}
    return len(set(clamps.tolist()) - set(first.values()))


class _Fit:
    """Patterns made free of those in `base`, for every excess of the grid."""

    def __init__(self, scattering: Scattering, columns: FloatArray, base: FloatArray) -> None:
        self.scattering = scattering
        turned, fixed = scattering.turned(columns), scattering.turned(base)
        self.bases, self.columns, self.sizes = [], [], []
        for weight in scattering.weights:
            q = _orthonormal((fixed * weight).T)
            x = (turned * weight).T
            whole = np.einsum("ij,ij->j", x, x)
            x = x - q @ (q.T @ x)
            left = np.einsum("ij,ij->j", x, x)
            size = np.sqrt(np.where(left > DEPENDENT * whole, left, np.inf))
            self.bases.append(q)
            self.columns.append(x / size)
            self.sizes.append(size)
        self._fitted = base.T @ np.linalg.pinv(fixed.T) @ scattering.turn  # (n, n) what the base takes of a residual
        scatter = scattering.turned(self.tamed(scattering.draws(0.0)))
        self._target = float(np.median(self._squares(scatter, 0)))
        self._within = float(np.median(self._squares(scatter, -1)))

    def tamed(self, residuals: FloatArray) -> FloatArray:
        """Rows (m, n) of residuals beside the base, wild ones drawn in (Huber 1981, Robust Statistics, psi)."""
        rest = residuals - residuals @ self._fitted.T
        scaled = np.abs(rest) / self.scattering.sd
        # 0.6745: the median of the size of a standard normal variable.
        bound = WILD * np.maximum(np.median(scaled, axis=1, keepdims=True) / 0.6745, 1.0) * self.scattering.sd
        return np.asarray(np.clip(rest, -bound, bound))

    def _squares(self, turned: FloatArray, grid: int) -> FloatArray:
        rows = turned * self.scattering.weights[grid]
        return np.asarray((rows**2).sum(axis=1) - ((rows @ self.bases[grid]) ** 2).sum(axis=1))

    def _excess(self, turned: FloatArray, target: FloatArray) -> NDArray[np.int64]:
        """(m,) index of the smallest excess that brings the sum of squares of rows (m, n) down to the target (m,)."""
        chosen = np.full(len(turned), len(EXCESSES) - 1)
        open_rows = np.arange(len(turned))
        for grid in range(len(EXCESSES)):
            good = self._squares(turned[open_rows], grid) <= target[open_rows]
            chosen[open_rows[good]] = grid
            open_rows = open_rows[~good]
            if len(open_rows) == 0:
                break
        return chosen

    def statistics(self, residuals: FloatArray) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
        """Of rows (m, n) of residuals: (m, patterns) t, (m,) index of the excess, (m,) factor on the noise."""
        turned = self.scattering.turned(self.tamed(residuals))
        inflation = np.ones(len(turned))
        if self.scattering.repeated >= FEWEST_REPEATED:
            inflation = np.maximum(self._squares(turned, -1) / self._within, 1.0)
        chosen = self._excess(turned, self._target * inflation)
        found = np.zeros((len(turned), self.columns[0].shape[1]))
        for grid in np.unique(chosen).tolist():
            rows = chosen == grid
            found[rows] = (turned[rows] * self.scattering.weights[grid]) @ self.columns[grid]
        factor = np.sqrt(inflation)
        return found / factor[:, None], chosen, factor


def _orthonormal(columns: FloatArray) -> FloatArray:
    """(n, r) orthonormal basis of columns (n, m) of any rank."""
    if columns.shape[1] == 0:
        return np.zeros((len(columns), 0))
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, singular > 1e-9 * max(float(singular[0]), 1e-300)])


def find_structure(
    residual: FloatArray,
    patterns: list[Pattern],
    scattering: Scattering,
    fixed: FloatArray | None = None,
    most: int = MOST_PATTERNS,
) -> Structure:
    """Which patterns residuals (n,) show beyond scatter.

    Parameters
    ----------
    residual
        ln(measured / modelled).
    patterns
        What is looked for.
    scattering
        The scatter.
    fixed
        (m, n) columns that are free anyway, such as those of the strut law.
    most
        So many patterns are taken out one after the other.
    """
    n = len(residual)
    columns = np.array([one.values for one in patterns])
    base = np.zeros((0, n)) if fixed is None else fixed
    found: list[Found] = []
    tests: tuple[Found, ...] = ()
    excess = left = 0.0
    for step in range(most + 1):
        fit = _Fit(scattering, columns, base)
        statistic, grid, factor = fit.statistics(residual[None])
        t, at = statistic[0], int(grid[0])
        left = float(EXCESSES[at])
        drawn = np.abs(fit.statistics(scattering.draws(left))[0]).max(axis=1)
        p = (1.0 + (drawn[:, None] >= np.abs(t)[None, :] - 1e-12).sum(axis=0)) / (1.0 + len(drawn))
        answers = _answers(fit, at, float(factor[0]), t, p)
        if step == 0:
            excess = left
            tests = tuple(one for one in answers if one.standard_error > 0.0)
        best = int(np.argmax(np.abs(t)))
        if p[best] >= SIGNIFICANT or step == most:
            break
        found.append(answers[best])
        base = np.concatenate([base, columns[[best]]])
    square = scattering.turned(residual[None])[0] ** 2
    simulated = (scattering.turned(scattering.draws(0.0)) ** 2).sum(axis=1)
    probability = (1.0 + float((simulated >= square.sum()).sum())) / (1.0 + len(simulated))
    return Structure(tuple(found), tests, excess, left, probability)


def far_off(
    residual: FloatArray, scattering: Scattering, structure: Structure, patterns: list[Pattern]
) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
    """(n,) residuals with the patterns found taken out, rows far from nought, the furthest first, and (n,) in sd."""
    columns = np.array([patterns[f.pattern].values for f in structure.found]).reshape(-1, len(residual)).T
    rest = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0] if columns.size else residual
    ratio = rest / np.sqrt(np.diag(scattering.covariance) + structure.excess_left**2)
    order = np.argsort(-np.abs(ratio), kind="stable")
    return rest, order[np.abs(ratio[order]) > FAR_OFF], ratio


def _answers(fit: _Fit, at: int, factor: float, t: FloatArray, p: FloatArray) -> list[Found]:
    """One answer a pattern, at an excess of the grid and a factor on the noise."""
    x, sizes = fit.columns[at], fit.sizes[at] / factor
    alike = np.abs(x.T @ x) > ALIKE
    np.fill_diagonal(alike, val=False)
    return [
        Found(
            i,
            float(t[i]),
            float(p[i]),
            float(t[i] / sizes[i]),
            float(1.0 / sizes[i]),
            tuple(np.flatnonzero(alike[i]).tolist()),
        )
        for i in range(len(t))
    ]
