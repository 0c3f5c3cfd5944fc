"""The final fit, with the model itself: strut law and sizes of effects by generalised least squares on ln k.

The searches run on tables of added compliance; what is reported and written to machine files is refined here.
Everything is dimensionless or scaled: with constants in N/m the gradient would fall below any tolerance at once.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.candidates import Candidate, Component
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit, Problem, normal_equations
from toolpath_stiff.inference.least_squares import NormalEquations, bounded_step, gauss_newton, scaled_inverse
from toolpath_stiff.inference.noise import Scatter

STEPS = 8
TOLERANCE = 1e-3  # of a standard deviation
LAW_STEP = 1e-4  # of the law's logarithms, for differences
HALVINGS = 10  # halvings of a step that makes the fit worse


class _Model:
    """The model as a function of the strut law's logarithms and all sizes, in one array x (2 + p,).

    `low`, `high` (2 + p,): bounds of x. A law that is not fitted is held by its prior, and not moved.
    """

    def __init__(self, problem: Problem, candidates: tuple[Candidate, ...], law_free: bool) -> None:
        self.problem, self.candidates, self.law_free = problem, candidates, law_free
        self.components = [component for candidate in candidates for component in candidate.components]
        bounds = [(-np.inf, np.inf)] * 2 + [component.bounds for component in self.components]
        self.low, self.high = np.array(bounds, dtype=float).T

    def sizes(self, x: FloatArray) -> tuple[FloatArray, ...]:
        """Sizes of each candidate."""
        ends = 2 + np.cumsum([0, *(len(candidate.components) for candidate in self.candidates)])
        return tuple(x[start:end].copy() for start, end in pairwise(ends))

    def residual(self, x: FloatArray) -> FloatArray:
        """(n,) ln measured - ln modelled."""
        effects = [c.active(sizes) for c, sizes in zip(self.candidates, self.sizes(x), strict=True)]
        return self.problem.residual(x[:2], effects)

    def equations(
        self, x: FloatArray, residual: FloatArray, unknowns: Sequence[int], scatter: Scatter
    ) -> NormalEquations:
        """Normal equations of the `unknowns` among x, the first two of which are always the law's."""
        columns = self.problem.law_columns(residual, x[:2], [candidate.effect for candidate in self.candidates])
        for i in unknowns[len(columns) :]:
            moved, step = x.copy(), LAW_STEP
            if i > 1:
                component = self.components[i - 2]
                step = 1e-4 * max(abs(x[i]), 1e-2 * max(component.typical()[0], 1e-30))
                # Step towards zero if a step outwards would leave the bounds.
                step = -step if x[i] > 0.0 and x[i] + step > component.bounds[1] else step
            moved[i] += step
            columns.append((residual - self.residual(moved)) / step)
        jacobian = np.nan_to_num(np.stack(columns, axis=1))
        return normal_equations(jacobian, residual, x[:2], scatter.precision, self.law_free)

    def newton_step(self, x: FloatArray, unknowns: Sequence[int], equations: NormalEquations) -> FloatArray:
        """Step of the unknowns to the minimum of the quadratic model within the bounds.

        Cutting off a step that leaves them leads uphill where sizes trade off against each other.
        """
        low, high = (limit[unknowns] - x[unknowns] for limit in (self.low, self.high))
        return bounded_step(equations.information, equations.gradient, low, high)

    def moved(
        self, x: FloatArray, residual: FloatArray, unknowns: Sequence[int], step: FloatArray, scatter: Scatter
    ) -> tuple[FloatArray, FloatArray] | None:
        """Unknowns and residual after the step, halved until the fit is no worse; None if no step helps."""

        def misfit(x: FloatArray, residual: FloatArray) -> float:
            return float(scatter.precision.squares(residual) + (x[:2] @ x[:2]) / LAW_PRIOR**2)

        before, first = misfit(x, residual), 0 if self.law_free else 2
        for _ in range(HALVINGS):
            further = x.copy()
            further[unknowns[first:]] += step[first:]
            further = np.clip(further, self.low, self.high)
            left = self.residual(further)
            if np.isfinite(left).all() and misfit(further, left) <= before + 1e-9:
                return further, left
            step = 0.5 * step
        return None


def refine(problem: Problem, fit: Fit, law_free: bool = True) -> Fit:
    """Fit refined by Gauss-Newton with the model itself, within the bounds, from the searches' result."""
    return fit_effects(problem, fit.candidates, fit.sizes, fit.free, fit.law, fit.scatter, law_free)


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
    model, unknowns = _Model(problem, tuple(candidates), law_free), [0, 1, *(2 + index for index in free)]
    x = np.clip(np.concatenate([law if law_free else np.zeros(2), *sizes]).astype(float), model.low, model.high)
    residual = model.residual(x)
    noise = problem.scatter.with_wild(residual) if scatter is None else scatter
    Point = tuple[FloatArray, FloatArray]  # x, residual

    def move(point: Point, here: NormalEquations) -> tuple[Point, FloatArray] | None:
        step = model.newton_step(point[0], unknowns, here)
        moved = model.moved(*point, unknowns, step, noise)
        return None if moved is None else (moved, step)

    start = x, residual
    (x, residual), _ = gauss_newton(start, lambda at: model.equations(*at, unknowns, noise), move, STEPS, TOLERANCE)
    last, absent = model.equations(x, residual, unknowns, noise), {}
    if len(unknowns) < len(x):  # where the data would pull the other sizes if all were free
        every = model.equations(x, residual, range(len(x)), noise)
        inverse = scaled_inverse(every.information)
        pulled, sd = x + inverse @ every.gradient, np.sqrt(np.maximum(np.diag(inverse), 0.0))
        absent = {i - 2: (float(pulled[i]), float(sd[i])) for i in range(len(x)) if i not in unknowns}
    return Fit(
        tuple(model.candidates), model.sizes(x), tuple(free), x[:2].copy(), residual, last.jacobian,
        scaled_inverse(last.information), noise, law_free, absent, linear=problem.linear,
    )  # fmt: skip


# Shares of the largest usual size to start from: at zero itself some effects have no slope to follow, and from far
# away others (a platform's bars) have only a slope outwards. Instrument readings are nearly linear in their sizes.
STARTS = (0.03, 0.5)
ROUNDS = 5  # searches for wild readings
BEHIND = 30.0  # of log posterior: a start further behind cannot catch up by taking readings to be wild


def base_fit(problem: Problem, law_free: bool) -> Fit:
    """Fit of the model without any further effect."""
    return settled(problem, fit_effects(problem, (), (), (), np.zeros(2), problem.scatter, law_free))


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
    least = max(fit.log_posterior for fit in tried) - BEHIND
    likely = [settled(problem, fit) for fit in tried if fit.log_posterior >= least]
    return _without_zeros(max(likely, key=lambda fit: fit.log_posterior))


def _from_starts(problem: Problem, before: Fit, candidate: Candidate, law_free: bool) -> Iterator[Fit]:
    """Fits that a candidate reaches from its starting sizes."""
    together = (*before.candidates, candidate)
    free = tuple(range(sum(len(c.components) for c in together)))
    seen: list[FloatArray] = []
    for share in STARTS[: 1 if candidate.effect.is_instrument else None]:
        start = np.array([_start(component, share) for component in candidate.components])
        fit = fit_effects(problem, together, (*before.sizes, start), free, before.law, problem.scatter, law_free)
        x = np.concatenate([fit.law, *fit.sizes])
        last = normal_equations(fit.jacobian, fit.residual, fit.law, fit.scatter.precision, law_free)
        # Two starts usually end at the same point, from where one continuation is enough.
        if not any((np.abs(x - other) * last.scale < TOLERANCE).all() for other in seen):
            yield fit
        seen.append(x)


def _start(component: Component, share: float) -> float:
    usual, sign = component.typical()[1], component.signs[-1]
    reach = component.reach(sign)
    known = usual if 0.0 < usual < np.inf else reach
    return sign * min(share * (known if np.isfinite(known) else 1.0), reach)


def settled(problem: Problem, fit: Fit) -> Fit:
    """Fit continued until converged, with the readings that it finds to be wild taken as such."""
    for _ in range(ROUNDS):
        scatter = problem.scatter.with_wild(fit.residual, known=fit.scatter)
        again = fit_effects(problem, fit.candidates, fit.sizes, fit.free, fit.law, scatter, fit.law_free)
        if set(scatter.wild) == set(fit.scatter.wild) and again.log_posterior < fit.log_posterior + 1e-4:
            return again
        fit = again
    return fit


def _without_zeros(fit: Fit) -> Fit:
    """Fit whose sizes at zero no longer count as free."""
    sizes = np.concatenate([np.zeros(0), *fit.sizes])
    kept = [k for k, index in enumerate(fit.free) if sizes[index] != 0.0]
    if len(kept) == len(fit.free):
        return fit
    columns = [0, 1, *(2 + k for k in kept)]
    # Where the data would pull them if they could go below zero: the origin of upper limits.
    gradient = fit.scatter.precision.times(fit.jacobian.T) @ fit.residual
    gradient[:2] -= fit.law / LAW_PRIOR**2 if fit.law_free else 0.0
    step, sd = fit.covariance @ gradient, np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    information = scaled_inverse(fit.covariance)[np.ix_(columns, columns)]
    return replace(
        fit,
        free=tuple(fit.free[k] for k in kept),
        jacobian=fit.jacobian[:, columns],
        covariance=scaled_inverse(information),
        absent={fit.free[k]: (float(step[2 + k]), float(sd[2 + k])) for k in range(len(fit.free)) if k not in kept},
    )


def with_given_law(problem: Problem, fit: Fit) -> Fit:
    """Fit of the same effects beside the strut law of the machine file."""
    given = fit_effects(problem, fit.candidates, fit.sizes, fit.free, np.zeros(2), fit.scatter, law_free=False)
    return _without_zeros(settled(problem, given))


def baseline(problem: Problem) -> tuple[Fit, Fit]:
    """The first two models of every report: the machine file as it stands, and the same with its strut law refitted."""
    return base_fit(problem, law_free=False), base_fit(problem, law_free=True)
