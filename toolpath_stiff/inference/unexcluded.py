"""Effects that the readings neither show nor exclude beside an explanation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.candidates import Candidate, CandidateTable
from toolpath_stiff.inference.evidence import Fit, Problem, law_prior
from toolpath_stiff.inference.hypotheses import Family
from toolpath_stiff.inference.least_squares import bounded_step
from toolpath_stiff.inference.size_priors import LIKELY, log_expected, log_usual
from toolpath_stiff.stiffness.contract import Effect, Parameter

# Rms change of ln stiffness from which an effect matters; assumed: at 5 % of its stiffness the tip's deflection is off
# by less than the 10 % to which a cutting force is known.
MATTERS = 0.05
SIZES = 20  # number of sizes for each sign, over the tabulated range


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
        Mean change of the tip's ln stiffness that stays once strut law and explanation have moved, of all choices.
    probability
        Of being there beside the explanation, at any size.
    """

    effect: Effect
    candidate: Candidate
    parameter: Parameter
    value: float
    rms: float
    left: float
    probability: float = np.nan

    @property
    def matters(self) -> bool:
        """True if it changes the stiffness enough that it should be known."""
        return self.rms >= MATTERS


def not_excluded(problem: Problem, families: Sequence[Family], fit: Fit, prior_odds: float) -> list[Unexcluded]:
    """Largest size of each further effect that may go unseen beside an explanation, the likeliest effect first.

    Parameters
    ----------
    problem, families
        Readings; all effects that do something to them.
    fit
        The explanation.
    prior_odds
        Of one certain further effect being there to none being there.
    """
    widest = rooms(problem, [family for family in families if family.name not in fit.names], fit)
    whole = 1.0 + prior_odds * sum(mean for _, mean in widest)
    hidden = [replace(room, probability=prior_odds * mean / whole) for room, mean in widest]
    return sorted(hidden, key=lambda room: (-room.probability, room.effect.name))


def rooms(problem: Problem, families: Sequence[Family], fit: Fit) -> list[tuple[Unexcluded, float]]:
    """Largest unseen size of each effect beside an explanation, and its mean likelihood over sizes and choices."""
    beside = _Beside(problem, fit)
    widest = []
    for family in families:
        seen = ((table, np.flatnonzero(table.columns.any(axis=0)).tolist()) for table in family.tables)
        each, means = zip(*(beside.room(table, j) for table, components in seen for j in components), strict=True)
        # Of equivalent choices the first, whatever the last digits: one set-up stiffer is the other one softer.
        widest_of = max(each, key=lambda room: round(room.rms, 9))
        room = replace(widest_of, left=max(room.left for room in each))
        widest.append((room, float(np.mean(means))))
    return widest


class _Beside:
    """An explanation whose law and sizes readjust, within their bounds, to a further effect."""

    def __init__(self, problem: Problem, fit: Fit) -> None:
        self.problem, self.fit = problem, fit
        self.tip = problem.predictor.data.tip
        self.compliance = np.exp(fit.residual - problem.observed)
        self.precision = fit.scatter.precision
        self.weighted = self.precision.times(fit.jacobian.T)
        prior = law_prior(fit.jacobian.shape[1])
        self.information = self.weighted @ fit.jacobian + prior
        free = [fit.parts[i] for i in fit.free]
        self.pull = -prior @ np.concatenate([fit.law, np.zeros(len(free))])
        self.low = np.array([-np.inf] * 2 + [min(component.bounds[0] - size, 0.0) for component, size in free])
        self.high = np.array([np.inf] * 2 + [max(component.bounds[1] - size, 0.0) for component, size in free])

    def room(self, table: CandidateTable, j: int) -> tuple[Unexcluded, float]:
        """Largest unseen size of component `j` of a table: of both signs, the one with the larger change.

        And the mean of the likelihood over the prior of the size, 1 where the readings say nothing.
        """
        component, candidate, sides = table.candidate.components[j], table.candidate, []
        none, gain, mass = float(self._fitted(self.fit.residual[None])[0][0]), 0.0, 0.0
        whole = self.problem.base_compliance if candidate.effect.is_instrument else self.compliance
        for sign, logs in self.problem.prior(table, j).log_sizes.items():
            sizes = sign * np.exp(np.linspace(logs[0], logs[-1], SIZES))
            every = sizes[:, None] * np.eye(len(candidate.components))[j]
            change = np.log1p(np.maximum(table.delta(every) / whole, -0.9))
            squares, stays = self._fitted(self.fit.residual + change)
            changes = np.sqrt(np.mean(change[:, self.tip] ** 2, axis=1))
            sides.append((sizes, changes, stays, squares))
            # The prior of expected sizes only: whether the readings would show them does not matter here.
            weights = np.exp(log_expected(changes) + log_usual(sizes, component.typical()))
            weights *= np.abs(np.gradient(np.log(np.abs(sizes))))
            gain, mass = gain + float(weights @ np.exp(0.5 * (none - squares))), mass + float(weights.sum())
        most = min(none, *(float(squares.min()) for *_, squares in sides)) + LIKELY
        size, rms, left = max((_widest(side, none, most) for side in sides), key=lambda figures: figures[1])
        room = Unexcluded(candidate.effect, candidate, component.parameter, component.value(size), rms, left)
        return room, gain / mass

    def _fitted(self, residuals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(g,) weighted squares left of residuals (g, n) once law and sizes have readjusted to them.

        And the mean change (g,) at the tip that stays then, beside the explanation as it is.
        """
        gradient = residuals @ self.weighted.T + self.pull
        moves = np.linalg.solve(self.information, gradient.T).T
        for k in np.flatnonzero(((moves < self.low) | (moves > self.high)).any(axis=1)).tolist():
            moves[k] = bounded_step(self.information, gradient[k], self.low, self.high)
        squares = self.precision.squares(residuals) - 2.0 * (gradient * moves).sum(axis=1)
        left = np.abs(residuals - self.fit.residual - moves @ self.fit.jacobian.T)[:, self.tip].mean(axis=1)
        return squares + ((moves @ self.information) * moves).sum(axis=1), left


def _widest(side: tuple[FloatArray, ...], none: float, most: float) -> tuple[float, float, float]:
    """Size, rms and mean change left at the largest size whose squares are at most `most`, interpolated linearly.

    `side`: the same and the squares of sizes (g,) of one sign; `none`: the squares at size 0.
    """
    figures = np.concatenate([[[0.0], [0.0], [0.0], [none]], np.array(side)], axis=1)
    squares = figures[-1]
    last = int(np.flatnonzero(squares <= most).max(initial=0))
    after = min(last + 1, len(squares) - 1)
    share = float(np.clip((most - squares[last]) / (squares[after] - squares[last]), 0.0, 1.0)) if after > last else 0.0
    size, rms, left = (figures[:-1, last] + share * (figures[:-1, after] - figures[:-1, last])).tolist()
    return size, rms, left
