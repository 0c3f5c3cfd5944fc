"""One effect more on top of an earlier fit: every choice tried, all sizes fitted together with the model itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.updating.inference.candidates import Candidate, Component
from toolpath_stiff.updating.inference.evidence import LAW_PRIOR, Problem, scaled_inverse
from toolpath_stiff.updating.inference.fit import Fit, fit_effects

FloatArray = NDArray[np.float64]

# Shares of the largest usual size to start from: at zero itself some effects have no slope to follow, and from far
# away others (a platform's bars) have only a slope outwards.
STARTS = (0.03, 0.5)
ROUNDS = 5  # searches for wild readings


def base_fit(problem: Problem, law_free: bool) -> Fit:
    """The model without any further effect."""
    return _settled(problem, (), (), (), np.zeros(2), law_free)


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
    fits = []
    for candidate in candidates:
        together = (*before.candidates, candidate)
        free = tuple(range(sum(len(c.components) for c in together)))
        for share in STARTS:
            start = np.array([_start(component, share) for component in candidate.components])
            fits.append(_settled(problem, together, (*before.sizes, start), free, before.law, law_free))
    return _without_zeros(max(fits, key=log_posterior))


def log_posterior(fit: Fit) -> float:
    """Log likelihood of a fit with the law's prior."""
    penalty = 0.5 * float(fit.law @ fit.law) / LAW_PRIOR**2 if fit.law_free else 0.0
    found = float(fit.scatter.log_likelihood(fit.residual)) - penalty
    return found if np.isfinite(found) else -np.inf


def _start(component: Component, share: float) -> float:
    usual, sign = component.typical()[1], component.signs[-1]
    reach = component.reach(sign)
    known = usual if np.isfinite(usual) and usual > 0.0 else reach
    return sign * min(share * (known if np.isfinite(known) else 1.0), reach)


def _settled(
    problem: Problem,
    candidates: Sequence[Candidate],
    sizes: Sequence[FloatArray],
    free: Sequence[int],
    law: FloatArray,
    law_free: bool,
) -> Fit:
    """The fit with the readings taken for wild that it finds wild itself, and continued where it was still moving."""
    fit = fit_effects(problem, candidates, sizes, free, law, problem.scatter, law_free)
    for _ in range(ROUNDS):
        scatter = problem.scatter.with_wild(fit.residual)
        again = fit_effects(problem, candidates, fit.sizes, free, fit.law, scatter, law_free)
        done = set(scatter.wild) == set(fit.scatter.wild) and log_posterior(again) < log_posterior(fit) + 1e-4
        fit = again
        if done:
            break
    return fit


def _without_zeros(fit: Fit) -> Fit:
    """The fit with sizes that have run into zero no longer counted as free."""
    flat = np.concatenate(fit.sizes)
    kept = [k for k, index in enumerate(fit.free) if flat[index] != 0.0]
    if len(kept) == len(fit.free):
        return fit
    columns = [0, 1, *(2 + k for k in kept)]
    # Where the data would pull them, could they go below zero: what an upper limit is counted from.
    gradient = fit.jacobian.T @ fit.scatter.inverse @ fit.residual
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
