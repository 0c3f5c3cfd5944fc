"""Effects that readings neither show nor exclude beside an explanation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.candidates import LARGEST, SMALLEST, Candidate, Table
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit, Problem
from toolpath_stiff.inference.hypotheses import Family
from toolpath_stiff.inference.minima import bounded_step
from toolpath_stiff.inference.size_priors import LIKELY, log_expected, log_usual
from toolpath_stiff.stiffness.contract import Effect, Parameter

# Rms change of ln stiffness from which an effect matters; assumed: at 5 % of its stiffness the tip's deflection is off
# by less than the 10 % to which a cutting force is known.
MATTERS = 0.05


SIZES = 16  # a sign, between those that are tabulated


@dataclass(frozen=True)
class Unexcluded:
    """An effect that the readings neither show nor exclude beside an explanation.

    Attributes
    ----------
    effect, candidate, parameter
        Which; with the choice, and the parameter, that leaves it most room.
    value
        SI value of the parameter up to which the readings do not exclude it (95 %), its other parameters neutral.
    rms
        Rms change of the tip's ln stiffness that it makes there, on its own.
    left
        Rms of what strut law and explanation cannot take up of that.
    probability
        Of being there beside the explanation, at any size.
    """

    effect: Effect
    candidate: Candidate
    parameter: Parameter
    value: float
    rms: float
    left: float
    probability: float


@dataclass(frozen=True)
class _Room:
    """How far one size of a candidate may go beside an explanation; attributes as of `Unexcluded`.

    `mean` is that of the likelihood over the prior of the size, 1 where the readings say nothing.
    """

    table: Table
    component: int
    size: float
    rms: float
    left: float
    mean: float


def not_excluded(problem: Problem, families: Sequence[Family], fit: Fit, prior_odds: float) -> list[Unexcluded]:
    """Effects that may be there beside an explanation at a size that matters, the likeliest first.

    Parameters
    ----------
    problem, families
        Readings; all effects that do something to them.
    fit
        The explanation.
    prior_odds
        Of one certain further effect being there to none being there.
    """
    beside = _Beside(problem, fit)
    odds, widest = {}, {}
    for family in families:
        if family.name in fit.names:
            continue
        rooms = [
            beside.room(table, j)
            for table in family.tables
            for j in range(len(table.candidate.components))
            if table.columns[:, j].any()
        ]
        odds[family.name] = prior_odds * float(np.mean([room.mean for room in rooms]))
        widest[family.name] = max(rooms, key=lambda room: room.rms)
    whole = 1.0 + sum(odds.values())
    found = []
    for family in families:
        room = widest.get(family.name)
        if room is None or room.rms < MATTERS:
            continue
        candidate = room.table.candidate
        component = candidate.components[room.component]
        found.append(
            Unexcluded(family.effect, candidate, component.parameter, component.value(room.size), room.rms, room.left,
                       odds[family.name] / whole)
        )  # fmt: skip
    return sorted(found, key=lambda one: (-one.probability, one.effect.name))


class _Beside:
    """An explanation whose law and sizes move along with a further effect, within their bounds."""

    def __init__(self, problem: Problem, fit: Fit) -> None:
        self.problem, self.fit = problem, fit
        self.tip = problem.predictor.data.tip
        self.compliance = np.exp(fit.residual - problem.observed)
        self.precision = fit.scatter.precision
        self.weighted = self.precision.times(fit.jacobian.T)
        prior = np.zeros(fit.jacobian.shape[1])
        prior[:2] = LAW_PRIOR**-2
        self.information = self.weighted @ fit.jacobian + np.diag(prior)
        self.pull = -prior * np.concatenate([fit.law, np.zeros(len(prior) - 2)])
        sizes = [(c, x) for one, own in zip(fit.candidates, fit.sizes, strict=True)
                 for c, x in zip(one.components, own, strict=True)]  # fmt: skip
        free = [sizes[i] for i in fit.free]
        self.low = np.array([-np.inf] * 2 + [min(c.bounds[0] - x, 0.0) for c, x in free])
        self.high = np.array([np.inf] * 2 + [max(c.bounds[1] - x, 0.0) for c, x in free])

    def room(self, table: Table, j: int) -> _Room:
        """How far component `j` of a table may go."""
        least, none = self._moved(self.fit.residual[None])
        sides = [self._side(table, j, sizes, least[0], float(none[0])) for sizes in self._sizes(table, j)]
        lowest = min(float(none[0]), *(float(side.squares.min()) for side in sides))
        widest = max((side.widest(lowest + LIKELY) for side in sides), key=lambda one: one[1])
        # Of the prior, as far as sizes are expected; whether the readings would show them does not matter here.
        weights = [side.weights(table.candidate.components[j].typical()) for side in sides]
        whole = sum(float(one.sum()) for one in weights)
        gains = [np.exp(0.5 * (float(none[0]) - side.squares)) for side in sides]
        mean = sum(float(w @ gain) for w, gain in zip(weights, gains, strict=True)) / whole
        return _Room(table, j, *widest, mean)

    def _sizes(self, table: Table, j: int) -> Iterator[FloatArray]:
        """Sizes (g,) of each sign, rising."""
        component = table.candidate.components[j]
        for sign in component.signs:
            if table.knots:
                if sign in table.knots:
                    logs = table.knots[sign][0]
                    yield sign * np.exp(np.linspace(logs[0], logs[-1], SIZES))
                continue
            scale = float(np.sqrt(np.mean((table.columns[self.tip, j] / self.compliance[self.tip]) ** 2)))
            ends = np.minimum(np.array([SMALLEST, LARGEST]) / max(scale, 1e-300), component.reach(sign))
            yield sign * np.geomspace(min(ends[0], 0.1 * ends[1]), ends[1], SIZES)

    def _side(self, table: Table, j: int, sizes: FloatArray, least: FloatArray, none: float) -> _Side:
        """What sizes of one sign do; `least` (2 + p,) and `none` are the moves and squares without the effect."""
        every = np.zeros((len(sizes), len(table.candidate.components)))
        every[:, j] = sizes
        whole = self.problem.base_compliance if table.candidate.effect.is_instrument else self.compliance
        change = np.log1p(np.maximum(table.delta(every) / whole, -0.9))
        moves, squares = self._moved(self.fit.residual + change)
        left = change - (moves - least) @ self.fit.jacobian.T
        return _Side(sizes, _rms(change[:, self.tip]), _rms(left[:, self.tip]), squares, none)

    def _moved(self, residuals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Moves (g, 2 + p) of law and sizes that fit residuals (g, n) best, and the squares (g,) that are left."""
        gradient = residuals @ self.weighted.T + self.pull
        moves = np.linalg.solve(self.information, gradient.T).T
        for k in np.flatnonzero(((moves < self.low) | (moves > self.high)).any(axis=1)).tolist():
            moves[k] = bounded_step(self.information, gradient[k], self.low, self.high)
        squares = self.precision.squares(residuals) - 2.0 * (gradient * moves).sum(axis=1)
        return moves, squares + ((moves @ self.information) * moves).sum(axis=1)


def _rms(rows: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(rows**2, axis=1)))


@dataclass(frozen=True)
class _Side:
    """Sizes (g,) of one sign, rms change of each, rms left of it, squares; `none`: the squares without the effect."""

    sizes: FloatArray
    rms: FloatArray
    left: FloatArray
    squares: FloatArray
    none: float

    def widest(self, most: float) -> tuple[float, float, float]:
        """Size, rms and what is left at the largest size whose squares are at most `most`; between two by a line."""
        sizes, rms, left, squares = (
            np.concatenate([[start], values])
            for start, values in ((0.0, self.sizes), (0.0, self.rms), (0.0, self.left), (self.none, self.squares))
        )
        last = int(np.flatnonzero(squares <= most).max(initial=0))
        if last + 1 == len(sizes):
            return float(sizes[-1]), float(rms[-1]), float(left[-1])
        share = (most - squares[last]) / (squares[last + 1] - squares[last])
        share = float(np.clip(share, 0.0, 1.0))
        at = [float(one[last] + share * (one[last + 1] - one[last])) for one in (sizes, rms, left)]
        return at[0], at[1], at[2]

    def weights(self, typical: tuple[float, float]) -> FloatArray:
        """(g,) prior weights of the sizes, not normalised."""
        return np.asarray(
            np.exp(log_expected(self.rms) + log_usual(self.sizes, typical))
            * np.abs(np.gradient(np.log(np.abs(self.sizes))))
        )
