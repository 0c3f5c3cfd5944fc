"""Bounds of a search, rules that a placement must keep, goals to maximise."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.placement.evaluator import PlacementFigures
from toolpath_stiff.placement.keep_out import KeepOut


@dataclass(frozen=True)
class Bounds:
    """Bounds of the search. SI.

    `low`, `high` (6,): x, y, z in m, A, B, C in rad, equal where fixed; (7,) with the tool's turn about its axis, rad.
    `heights`: the only z allowed, or empty.
    """

    low: FloatArray
    high: FloatArray
    heights: tuple[float, ...] = ()

    @cached_property
    def free(self) -> IntArray:
        """Columns of a placement that vary."""
        return np.flatnonzero(self.high > self.low)

    @cached_property
    def round(self) -> BoolArray:
        """(6,) or (7,) angles that may go all the way round, and so have no bounds."""
        angle = np.arange(len(self.low)) >= 5
        return np.asarray(angle & (self.high - self.low >= 2.0 * np.pi - 1e-9))

    def placements(self, unit: FloatArray) -> FloatArray:
        """Placements (k, 6) from points (k, free) of the unit cube; full-circle angles wrap round."""
        placements = np.repeat(self.low[None], len(unit), axis=0)
        free = self.free
        inside = np.where(self.round[free], np.mod(unit, 1.0), np.clip(unit, 0.0, 1.0))
        placements[:, free] = self.low[free] + inside * (self.high - self.low)[free]
        if self.heights:
            heights = np.array(self.heights)
            nearest = np.abs(placements[:, 2, None] - heights).argmin(axis=1)
            placements[:, 2] = heights[nearest]
        return placements

    def unit(self, placements: FloatArray) -> FloatArray:
        """Points (k, free) of the unit cube for placements (k, 6)."""
        free = self.free
        return np.asarray((placements[:, free] - self.low[free]) / (self.high - self.low)[free])

    def apart(self, placements: FloatArray, count: int, distance: float = 0.1) -> list[int]:
        """Rows of ranked placements: the first, and the best of the others that are not close to one chosen.

        `distance` in shares of the ranges.
        """
        unit, whole_turn = self.unit(placements), self.round[self.free]
        chosen: list[int] = []
        for i in range(len(unit)):
            away = np.abs(unit[chosen] - unit[i])
            away = np.where(whole_turn, np.minimum(away, 1.0 - away), away)
            if (away.max(axis=1, initial=0.0) > distance).all():
                chosen.append(i)
            if len(chosen) == count:
                break
        return chosen

    def holds(self, placement: FloatArray) -> bool:
        """True for a placement within the bounds; angles count modulo a whole turn."""
        apart = np.mod(placement[5:] - self.low[5:] + 1e-9, 2.0 * np.pi) - 1e-9
        inside = (placement >= self.low - 1e-9) & (placement <= self.high + 1e-9)
        inside[5:] = apart <= self.high[5:] - self.low[5:] + 1e-9
        on_a_height = not self.heights or bool(np.abs(np.array(self.heights) - placement[2]).min() < 1e-9)
        return bool(inside.all()) and on_a_height


@dataclass(frozen=True)
class SearchRules:
    """Rules and wishes of the user.

    Attributes
    ----------
    objective
        One of `defaults.OBJECTIVES`, for the recommendation.
    margin
        Smallest margin to any limit, as a share of its span.
    allow_extrapolation
        Whether struts may leave the lengths of their law at more samples than now.
    keepouts
        Boxes that the path must stay out of.
    seed
        Of the search; the same seed gives the same placements.
    points
        Maximum number of points on the front.
    extrapolated
        Largest share of samples outside the strut law; inf: any. The search finds out.
    """

    objective: str = defaults.OBJECTIVE
    margin: float = defaults.MARGIN
    allow_extrapolation: bool = False
    keepouts: tuple[KeepOut, ...] = ()
    seed: int = defaults.PLACEMENT_SEED
    points: int = defaults.FRONT_POINTS
    extrapolated: float = np.inf

    def violation(self, figures: PlacementFigures) -> FloatArray:
        """(k,) amount by which placements break the rules; 0 where they keep them."""
        shortfalls = [self.margin - figures.margin, self.margin - figures.rapid_margin, -figures.clearance]
        shortfalls.append(figures.extrapolated - self.extrapolated - 1e-12)
        return np.asarray(np.maximum(np.max(shortfalls, axis=0), 0.0))


@dataclass(frozen=True)
class Goal:
    """A figure to maximise: `weights` . (mean, -range, weakest), N/m, none of them below `floors`.

    `weights` None: the smallest surplus over the floors, which may be negative.
    """

    weights: tuple[float, float, float] | None
    floors: FloatArray

    def value(self, figures: PlacementFigures) -> FloatArray:
        """(k,) N/m, -inf where the figures do not exist."""
        if self.weights is None:
            value = (figures.objectives - self.floors).min(axis=1)
        else:
            value = (figures.objectives * np.array(self.weights)).sum(axis=1)
        return np.asarray(np.where(np.isnan(value), -np.inf, value))

    def worsening(self, figures: PlacementFigures) -> FloatArray:
        """(k,) N/m, the largest fall below a floor; 0 if there is none."""
        if self.weights is None:
            return np.zeros(len(figures))
        below = np.maximum((self.floors - figures.objectives).max(axis=1), 0.0)
        return np.asarray(np.where(np.isnan(below), np.inf, below))
