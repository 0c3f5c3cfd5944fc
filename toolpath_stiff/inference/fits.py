"""The final fit, with the model itself: strut law and sizes of effects by generalised least squares on ln k.

The searches run on tables of added compliance; what is reported and written to machine files is refined here.
Everything is dimensionless or scaled: with constants in N/m the gradient would fall below any tolerance at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.candidates import Candidate, Component
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit, Problem
from toolpath_stiff.inference.minima import bounded_step
from toolpath_stiff.inference.noise import NormalEquations, Scatter, gauss_newton, scaled_inverse

STEPS = 8


TOLERANCE = 1e-3  # of a standard deviation


def refine(problem: Problem, found: Fit, law_free: bool = True) -> Fit:
    """Gauss-Newton with the model itself from the searches' result, within the bounds."""
    return fit_effects(problem, found.candidates, found.sizes, found.free, found.law, found.scatter, law_free)


def fit_effects(
    problem: Problem,
    candidates: Sequence[Candidate],
    sizes: Sequence[FloatArray],
    free: Sequence[int],
    law: FloatArray,
    scatter: Scatter | None = None,
    law_free: bool = True,
) -> Fit:
    """Fit the free sizes of the candidates and the strut law from a starting point.

    Parameters
    ----------
    problem
        Data and noise.
    candidates, sizes
        What to fit, and starting sizes, one array (p,) each.
    free
        Indices of the sizes to be fitted, counted over all candidates.
    law
        (2,) start of the strut law's logarithms.
    scatter
        Noise with wild readings; found at the starting point if not given.
    law_free
        Whether the strut law is refitted along.
    """
    search = _Search(problem, tuple(candidates), tuple(free), law_free)
    law = np.array(law, dtype=float) if law_free else np.zeros(2)
    flat = np.concatenate([np.asarray(s, dtype=float) for s in sizes]) if candidates else np.zeros(0)
    flat = search.bounded(flat)
    residual = search.residual(law, flat)
    if scatter is None:
        scatter = problem.scatter.with_wild(residual)
    Point = tuple[FloatArray, FloatArray, FloatArray]  # law, all sizes, residual

    def equations(at: Point) -> NormalEquations:
        return _normal_equations(search.jacobian(*at), at[2], at[0], scatter, law_free)

    def move(at: Point, here: NormalEquations) -> tuple[Point, FloatArray] | None:
        step = search.newton_step(at[1], here.information, here.gradient)
        law, flat, residual = search.step(*at, step, scatter)
        return None if residual is None else ((law, flat, residual), step)

    (law, flat, residual), _ = gauss_newton((law, flat, residual), equations, move, STEPS, TOLERANCE)
    last = equations((law, flat, residual))
    return Fit(
        tuple(candidates),
        tuple(search.split(flat)),
        tuple(free),
        law,
        residual,
        last.jacobian,
        scaled_inverse(last.information),
        scatter,
        law_free,
        _pulls_on_absent(replace(search, free=tuple(range(len(flat)))), law, flat, residual, scatter, tuple(free)),
    )


def _pulls_on_absent(
    search: _Search, law: FloatArray, flat: FloatArray, residual: FloatArray, scatter: Scatter, free: tuple[int, ...]
) -> dict[int, tuple[float, float]]:
    """See `Fit.absent`. `search` has all sizes free."""
    absent = [index for index in range(len(flat)) if index not in free]
    if not absent:
        return {}
    jacobian = search.jacobian(law, flat, residual)
    equations = _normal_equations(jacobian, residual, law, scatter, search.law_free)
    inverse = scaled_inverse(equations.information)
    step = inverse @ equations.gradient
    return {i: (float(flat[i] + step[2 + i]), float(np.sqrt(max(inverse[2 + i, 2 + i], 0.0)))) for i in absent}


def _normal_equations(
    jacobian: FloatArray, residual: FloatArray, law: FloatArray, scatter: Scatter, law_free: bool
) -> NormalEquations:
    weighted = scatter.precision.times(jacobian.T)
    information, gradient = weighted @ jacobian, weighted @ residual
    prior = 1.0 / LAW_PRIOR**2 if law_free else 1e12
    information[:2, :2] += prior * np.eye(2)
    gradient[:2] -= prior * law
    return NormalEquations(jacobian, information, gradient)


@dataclass(frozen=True)
class _Search:
    """The model as a function of law and all sizes in one flat array."""

    problem: Problem
    candidates: tuple[Candidate, ...]
    free: tuple[int, ...]
    law_free: bool

    def split(self, flat: FloatArray) -> list[FloatArray]:
        counts = np.cumsum([len(c.components) for c in self.candidates])[:-1]
        return [np.array(part) for part in np.split(flat, counts)] if self.candidates else []

    def residual(self, law: FloatArray, flat: FloatArray) -> FloatArray:
        effects = [c.active(s) for c, s in zip(self.candidates, self.split(flat), strict=True)]
        return np.asarray(self.problem.observed - self.problem.predictor.log_stiffness(law, effects))

    def limits(self) -> tuple[FloatArray, FloatArray]:
        """Smallest and largest of all sizes."""
        bounds = [component.bounds for c in self.candidates for component in c.components]
        low, high = np.array(bounds, dtype=float).reshape(-1, 2).T
        return low, high

    def bounded(self, flat: FloatArray) -> FloatArray:
        return np.asarray(np.clip(flat, *self.limits()))

    def newton_step(self, flat: FloatArray, information: FloatArray, gradient: FloatArray) -> FloatArray:
        """Step (2 + free,) of law and free sizes to the least quadratic model within the bounds.

        By bounded-variable least squares where the plain step would leave them: cutting that off leads uphill where
        sizes trade off against each other.
        """
        step = np.asarray(scaled_inverse(information) @ gradient)
        low, high = (limit[list(self.free)] - flat[list(self.free)] for limit in self.limits())
        if ((step[2:] >= low) & (step[2:] <= high)).all():
            return step
        free_law = np.full(2, np.inf)
        return bounded_step(information, gradient, np.concatenate([-free_law, low]), np.concatenate([free_law, high]))

    def jacobian(self, law: FloatArray, flat: FloatArray, residual: FloatArray) -> FloatArray:
        columns = self._law_columns(law, flat, residual)
        components = [component for c in self.candidates for component in c.components]
        for index in self.free:
            size = flat[index]
            step = 1e-4 * max(abs(size), 1e-2 * max(components[index].typical()[0], 1e-30))
            # Towards zero where a step outwards would leave the bounds.
            step = -step if size > 0.0 and size + step > components[index].bounds[1] else step
            moved = flat.copy()
            moved[index] += step
            columns.append((residual - self.residual(law, moved)) / step)
        return np.nan_to_num(np.stack(columns, axis=1))

    def _law_columns(self, law: FloatArray, flat: FloatArray, residual: FloatArray) -> list[FloatArray]:
        """Two (n,) d ln k / d law: in closed form where the struts carry what equilibrium says."""
        predictor = self.problem.predictor
        if np.isfinite(residual).all() and predictor.struts_carry_all(c.effect for c in self.candidates):
            return list(predictor.law_columns(self.problem.observed - residual, law).T)
        columns = []
        for j in range(2):
            moved = law.copy()
            moved[j] += 1e-4
            columns.append((residual - self.residual(moved, flat)) / 1e-4)
        return columns

    def step(
        self, law: FloatArray, flat: FloatArray, residual: FloatArray, step: FloatArray, scatter: Scatter
    ) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """The step, halved until the fit gets no worse; None for the residual where nothing helps."""

        def misfit(at: FloatArray, logs: FloatArray) -> float:
            return float(scatter.precision.squares(at) + (logs @ logs) / LAW_PRIOR**2)

        before = misfit(residual, law)
        for _ in range(10):
            new_law = law + step[:2] if self.law_free else law
            moved = flat.copy()
            moved[list(self.free)] += step[2:]
            moved = self.bounded(moved)
            new = self.residual(new_law, moved)
            if np.isfinite(new).all() and misfit(new, new_law) <= before + 1e-9:
                return new_law, moved, new
            step = 0.5 * step
        return law, flat, None


# Shares of the largest usual size to start from: at zero itself some effects have no slope to follow, and from far
# away others (a platform's bars) have only a slope outwards.
STARTS = (0.03, 0.5)


ROUNDS = 5  # searches for wild readings


def base_fit(problem: Problem, law_free: bool) -> Fit:
    """The model without any further effect."""
    return _settled(problem, fit_effects(problem, (), (), (), np.zeros(2), problem.scatter, law_free))


def add_effect(problem: Problem, before: Fit, candidates: Sequence[Candidate], law_free: bool) -> Fit:
    """The likeliest fit with one of the candidates on top of an earlier fit.

    Parameters
    ----------
    problem
        Data and noise.
    before
        The fit so far; its effects are fitted along, from where they are.
    candidates
        One effect, one candidate a choice.
    law_free
        Whether the strut law is fitted along.
    """
    tried = [fit for candidate in candidates for fit in _from_starts(problem, before, candidate, law_free)]
    best, settled = max(tried, key=lambda one: one[0].log_posterior)
    return _without_zeros(best if settled else _settled(problem, best))


def _from_starts(problem: Problem, before: Fit, candidate: Candidate, law_free: bool) -> Iterator[tuple[Fit, bool]]:
    """The fits that a candidate comes to from its starts, and whether each is settled already."""
    together = (*before.candidates, candidate)
    free = tuple(range(sum(len(c.components) for c in together)))
    seen: list[FloatArray] = []
    for share in STARTS:
        start = np.array([_start(component, share) for component in candidate.components])
        fit = fit_effects(problem, together, (*before.sizes, start), free, before.law, problem.scatter, law_free)
        place = np.concatenate([fit.law, *fit.sizes])
        last = _normal_equations(fit.jacobian, fit.residual, fit.law, fit.scatter, fit.law_free)
        # Two starts mostly end in one place, and go on from there alike.
        if not any((np.abs(place - other) < TOLERANCE * (1.0 / last.scale)).all() for other in seen):
            yield _nearly_settled(problem, fit)
        seen.append(place)


def _start(component: Component, share: float) -> float:
    usual, sign = component.typical()[1], component.signs[-1]
    reach = component.reach(sign)
    known = usual if np.isfinite(usual) and usual > 0.0 else reach
    return sign * min(share * (known if np.isfinite(known) else 1.0), reach)


def _nearly_settled(problem: Problem, fit: Fit) -> tuple[Fit, bool]:
    """As `_settled`, and True; or False, and the fit from which it has one step to go that would not show.

    That step moves a likelihood by less than 1e-6: only the likeliest of several fits needs to make it.
    """
    for _ in range(ROUNDS):
        scatter = problem.scatter.with_wild(fit.residual, known=fit.scatter)
        if scatter is fit.scatter and _gain_to_come(problem, fit) < TOLERANCE**2:
            return fit, False
        fit, done = _again(problem, fit)
        if done:
            break
    return fit, True


def _gain_to_come(problem: Problem, fit: Fit) -> float:
    """Twice what one more step adds to the log posterior; sizes that it pulls beyond their bounds stay there."""
    last = _normal_equations(fit.jacobian, fit.residual, fit.law, fit.scatter, fit.law_free)
    gradient = last.gradient
    search = _Search(problem, fit.candidates, fit.free, fit.law_free)
    flat = np.concatenate([fit.law, *fit.sizes])
    low, high = (
        np.concatenate([np.full(2, at), limit]) for at, limit in zip((-np.inf, np.inf), search.limits(), strict=True)
    )
    kept = ~((flat <= low) & (gradient <= 0.0) | (flat >= high) & (gradient >= 0.0))
    return float(gradient[kept] @ scaled_inverse(last.information[np.ix_(kept, kept)]) @ gradient[kept])


def _settled(problem: Problem, fit: Fit) -> Fit:
    """The fit with the readings taken for wild that it finds wild itself, and continued where it was still moving."""
    for _ in range(ROUNDS):
        fit, done = _again(problem, fit)
        if done:
            break
    return fit


def _again(problem: Problem, fit: Fit) -> tuple[Fit, bool]:
    """The fit continued with the readings that it finds wild, and whether that changes nothing any more."""
    scatter = problem.scatter.with_wild(fit.residual)
    again = fit_effects(problem, fit.candidates, fit.sizes, fit.free, fit.law, scatter, fit.law_free)
    done = set(scatter.wild) == set(fit.scatter.wild) and again.log_posterior < fit.log_posterior + 1e-4
    return again, done


def _without_zeros(fit: Fit) -> Fit:
    """The fit with sizes that have run into zero no longer counted as free."""
    flat = np.concatenate(fit.sizes)
    kept = [k for k, index in enumerate(fit.free) if flat[index] != 0.0]
    if len(kept) == len(fit.free):
        return fit
    columns = [0, 1, *(2 + k for k in kept)]
    # Where the data would pull them, could they go below zero: what an upper limit is counted from.
    gradient = fit.scatter.precision.times(fit.jacobian.T) @ fit.residual
    gradient[:2] -= fit.law / LAW_PRIOR**2 if fit.law_free else 0.0
    step, variance = fit.covariance @ gradient, np.diag(fit.covariance)
    absent = {
        index: (float(step[2 + k]), float(np.sqrt(max(variance[2 + k], 0.0))))
        for k, index in enumerate(fit.free)
        if k not in kept
    }
    information = scaled_inverse(fit.covariance)[np.ix_(columns, columns)]
    return replace(
        fit,
        free=tuple(fit.free[k] for k in kept),
        jacobian=fit.jacobian[:, columns],
        covariance=scaled_inverse(information),
        absent=absent,
    )


@dataclass(frozen=True)
class Baseline:
    """The first two models of every report.

    Attributes
    ----------
    as_given
        The machine file as it stands; nothing is fitted.
    refitted
        Its strut law's two stiffnesses refitted, without a further effect.
    """

    as_given: Fit
    refitted: Fit

    @classmethod
    def of(cls, problem: Problem) -> Baseline:
        """Of data and model under one noise."""
        return cls(base_fit(problem, law_free=False), base_fit(problem, law_free=True))
