"""Error of a fitted model at a pose, as stated by `[uncertainty.errors]` of a machine file."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray

# Correlation lengths of a model's form error; assumed: about half a workspace, half a tilting range.
RANGE_POSITION, RANGE_ANGLE = 0.25, np.radians(15.0)  # m, rad
GEOMETRY = 42  # six struts, three coordinates each of twelve joints
COMMON = 0.5  # share of the form error that is common to all poses; assumed
BLOCK = 4096  # poses whose distances to the measured ones are computed at a time
FEW = 0.5  # nearness below which a pose counts as away from the measured ones: 1.18 ranges


def coordinates(position: FloatArray, angles: FloatArray) -> FloatArray:
    """(n, 6) places (n, 3) m and angles (n, 3) rad in units of the correlation lengths."""
    return np.concatenate([position / RANGE_POSITION, angles / RANGE_ANGLE], axis=1)


def nearness(here: FloatArray, there: FloatArray) -> FloatArray:
    """(n, m) nearness of `coordinates` (n, 6) and (m, 6): 1 where equal, falling to 0 with distance."""
    # Differences rather than squares, which nearly cancel: equal poses give exactly 1.
    distance = sum((here[:, None, axis] - there[None, :, axis]) ** 2 for axis in range(here.shape[1]))
    return np.asarray(np.exp(-0.5 * distance))


def alike(place: FloatArray, direction: FloatArray) -> FloatArray:
    """(n, n) correlation of the form error at `coordinates` (n, 6) along unit vectors (n, 3)."""
    return np.asarray((direction @ direction.T) ** 2 * (COMMON + (1.0 - COMMON) * nearness(place, place)))


@dataclass(frozen=True)
class ErrorModel:
    """Errors of the logarithm of a model's stiffness: relative, normal, mutually independent.

    Attributes
    ----------
    loadings
        (p, k + 42) errors of p parameters, in the standard deviations that are stated of them, by k independent
        errors of scatter and by the struts' and joints' own, one standard deviation of each.
    struts, joints
        Standard deviations of struts from their law, relative, and of each coordinate of a joint, m.
    near, away
        Standard deviation of what the model lacks, relative: at measured poses, and away from all of them.
    places
        (m, 6) `coordinates` of the measured poses.
    learned
        (r, 42) A: of the struts' and joints' errors u, in these deviations, readings leave u - A^T A u.
    load, by_load
        Load of all readings, N, and the share of the tip's compliance that may hang on it; 0: none, or it is known how.
    """

    loadings: FloatArray
    struts: float
    joints: float
    near: float
    away: float
    places: FloatArray
    learned: FloatArray = field(default_factory=lambda: np.zeros((1, GEOMETRY)))
    load: float = np.inf
    by_load: float = 0.0

    def of_geometry(self, slopes: FloatArray) -> FloatArray:
        """(n, 42) errors by struts and joints, of (n, 42) slopes to them: those by what readings leave unknown."""
        errors = slopes * np.repeat([self.struts, self.joints], [6, GEOMETRY - 6])
        return np.asarray(errors - errors @ self.learned.T @ self.learned)

    @property
    def poses(self) -> tuple[FloatArray, FloatArray]:
        """(m, 3) m and (m, 3) rad of the measured poses."""
        return self.places[:, :3] * RANGE_POSITION, self.places[:, 3:] * RANGE_ANGLE

    def nearness(self, place: FloatArray) -> FloatArray:
        """(n,) nearness of `coordinates` (n, 6) to the nearest measured pose."""
        blocks = np.split(place, range(BLOCK, len(place), BLOCK))
        return np.concatenate([nearness(block, self.places).max(axis=1) for block in blocks])

    def form(self, near: FloatArray) -> FloatArray:
        """(n,) relative standard deviation of the form error, by `nearness` (n,)."""
        return np.asarray(np.sqrt(self.away**2 - (self.away**2 - self.near**2) * near))

    def of_load(self, force: float) -> float:
        """Relative standard deviation of the stiffness under another load (N) than the readings'.

        The share may be as soft at any load, contacts (Hertz: Johnson 1985, Contact Mechanics, 4.2) or play, that moves
        as far at any load: compliances as F^0, F^(-1/3) and F^(-1), each as likely as the others; assumed.
        """
        changes = (self.load / force) ** np.array([0.0, 1.0 / 3.0, 1.0]) - 1.0 if self.by_load else np.zeros(1)
        return self.by_load * float(np.sqrt(np.mean(changes**2)))

    def of(self, rows: IntArray | BoolArray | list[int]) -> ErrorModel:
        """Error model of some of the parameters."""
        return replace(self, loadings=self.loadings[rows])

    def beside(self, later: ErrorModel) -> ErrorModel:
        """Of the parameters of both; struts, joints and form as the later one has them."""
        (first, geometry), (second, later_geometry) = (
            np.hsplit(errors.loadings, [-GEOMETRY]) for errors in (self, later)
        )
        none = np.zeros((len(first), second.shape[1])), np.zeros((len(second), first.shape[1]))
        both = np.block([[first, none[0], geometry], [none[1], second, later_geometry]])
        hangs = max(self, later, key=lambda errors: errors.by_load)
        return replace(later, loadings=both, load=hangs.load, by_load=hangs.by_load)
