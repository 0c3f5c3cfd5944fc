"""Fits of terms of the dictionary beside a base fit, and the search for the best further term.

Every term's gain is first its score beside what is fitted already (Rao's score test, sizes on their allowed side); the
best are fitted with the compliances added up, c = c_struts(law) + rest + sum size c_j, exact for whatever gives way in
series.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.covariances import Precision, inverse_root
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit, Problem, law_prior
from toolpath_stiff.inference.gates import set_wild_aside, simulate
from toolpath_stiff.inference.least_squares import scaled_inverse
from toolpath_stiff.inference.noise import Noise, Scatter
from toolpath_stiff.portrait.columns import Ground, shapes_near
from toolpath_stiff.portrait.dictionary import crossed, dictionary_of
from toolpath_stiff.stiffness.terms import PARALLEL, Term

DRAWS = 200  # simulated campaigns
JOINS = 0.02  # probability by chance below which a further term is taken for something
TIE = 0.5  # of log likelihood: within it, the place with the larger prior is taken
FINALISTS = 40  # terms that are fitted in full: the best of all; and the best of every link and variable
STEPS, SETTLED = 5, 0.02  # Gauss-Newton; standard deviations
AT_SIZE = 3  # fits of a term not linear in its size, each linearised at the size of the last
FINER = (1.0, 0.4)  # shares of a grid's spacing, for constants about those of a term
ROUNDS = 2  # searches for wild readings


@dataclass(frozen=True)
class Sizes:
    """Fits of G sets of p terms each, beside the strut law.

    Attributes
    ----------
    law, size
        (G, 2), (G, p) in rms change of compliance.
    residual, gain
        (G, n); (G,) log posterior.
    """

    law: FloatArray
    size: FloatArray
    residual: FloatArray
    posterior: FloatArray


@dataclass(frozen=True)
class Description:
    """Terms fitted together.

    Attributes
    ----------
    terms
        With their sizes.
    columns, scale
        (p, n) change of compliance over the base model's for an rms change of 1; (p,) that of an SI unit of size.
    fit
        Law, residual and so on; its jacobian (n, 2 + p) and covariance are those of the law and the scaled sizes.
    posterior
        Log posterior with the price of wild readings.
    """

    terms: tuple[Term, ...]
    columns: FloatArray
    scale: FloatArray
    fit: Fit
    posterior: float


class Selection:
    """Search on one set of readings, beside a base fit.

    Parameters
    ----------
    problem, base
        Readings, model and scatter; the fit that leaves something.
    noise, seed
        Of the simulated campaigns.

    Attributes
    ----------
    compliance, rest
        (n,) m/N of the base fit; what of it the struts do not contribute.
    ground, dictionary
        What columns are made from; all terms.
    """

    def __init__(self, problem: Problem, base: Fit, noise: Noise, seed: int) -> None:
        self.problem, self.base, self.noise, self.seed = problem, base, noise, seed
        self.compliance = np.exp(base.residual - problem.observed)
        self.rest = self.compliance - problem.predictor.strut_part(base.law)
        self.ground = Ground(problem.predictor, self.compliance, base.law)
        self.dictionary = dictionary_of(self.ground)

    def beside(self, base: Fit) -> Self:
        """The same dictionary beside another fit to the same readings; to be called before any search."""
        other = copy(self)
        compliance = np.exp(base.residual - self.problem.observed)
        other.base, other.rest = base, compliance - self.problem.predictor.strut_part(base.law)
        return other

    @property
    def start(self) -> Description:
        """Description without terms: the base fit alone."""
        return self.described((), self.base.law, self.base.scatter)

    def fitted(
        self, columns: FloatArray, low: FloatArray, high: FloatArray, law: FloatArray, precision: Precision
    ) -> Sizes:
        """Gauss-Newton for G sets at once: columns (G, p, n), bounds (G, p) on their sizes."""
        sets, count, n = columns.shape
        laws, size = np.repeat(law[None], sets, axis=0), np.zeros((sets, count))
        prior = law_prior(2 + count)
        for _ in range(STEPS):
            residual, jacobian = self._linearised(laws, size, columns)
            flat = jacobian.reshape(-1, n)
            weighted = precision.times(flat).reshape(jacobian.shape)
            information = weighted @ np.swapaxes(jacobian, 1, 2) + prior
            gradient = (weighted @ residual[..., None])[..., 0]
            gradient[:, :2] -= laws / LAW_PRIOR**2
            step = _bounded_step(information, gradient, size, low, high)
            reach = np.abs(np.einsum("gp,gpn->gn", step, jacobian)).max(axis=1)
            done = float(np.sqrt(np.einsum("gp,gpq,gq->g", step, information, step).max()))
            step *= np.minimum(1.0, 0.5 / np.maximum(reach, 1e-12))[:, None]
            laws, size = laws + step[:, :2], np.clip(size + step[:, 2:], low, high)
            if done < SETTLED:
                break
        residual, _ = self._linearised(laws, size, columns)
        posterior = -0.5 * precision.squares(residual) - 0.5 * (laws**2).sum(axis=1) / LAW_PRIOR**2
        return Sizes(laws, size, residual, posterior)

    def _linearised(self, laws: FloatArray, size: FloatArray, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals (G, n) and jacobian (G, 2 + p, n) of ln stiffness."""
        part, slopes = self.problem.predictor.strut_part_and_slopes(laws)
        added = np.einsum("gp,gpn->gn", size, columns) * self.compliance
        compliance = np.maximum(part + self.rest + added, 0.1 * self.compliance)
        size_slopes = -columns * (self.compliance / compliance)[:, None]
        jacobian = np.concatenate([-slopes / compliance[:, None], size_slopes], axis=1)
        return self.problem.observed + np.log(compliance), jacobian

    def limits(self, terms: Sequence[Term], scale: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lower and upper limits (p,) of scaled sizes."""
        bounds = np.array([[bound * term.si for bound in term.bounds] for term in terms]).reshape(-1, 2)
        return bounds[:, 0] * scale, bounds[:, 1] * scale

    def described(self, terms: Sequence[Term], law: FloatArray, scatter: Scatter) -> Description:
        """Terms fitted together, with the readings that this fit takes to be wild."""
        columns, scale = self._scaled(terms)
        low, high = self.limits(terms, scale)
        for _ in range(ROUNDS):
            sizes = self.fitted(columns[None], low[None], high[None], law, scatter.precision)
            law, again = sizes.law[0], self.problem.scatter.with_wild(sizes.residual[0], scatter)
            if again is scatter:
                break
            scatter = again
        sizes = self.fitted(columns[None], low[None], high[None], law, scatter.precision)
        sized = tuple(t.sized(float(u / s)) for t, u, s in zip(terms, sizes.size[0], scale, strict=True))
        residual, jacobian = sizes.residual[0], self._linearised(sizes.law, sizes.size, columns[None])[1][0]
        for k, term in enumerate(sized):
            if term.action in PARALLEL:
                jacobian[2 + k] = -self.ground.slope(term) / scale[k] * np.exp(self.problem.observed - residual)
        information = scatter.precision.times(jacobian) @ jacobian.T + law_prior(len(jacobian))
        covariance = np.asarray(scaled_inverse(information))
        fit = replace(
            self.base, law=sizes.law[0], residual=residual, jacobian=jacobian.T, covariance=covariance, scatter=scatter
        )
        return Description(sized, columns, scale, fit, float(sizes.posterior[0]) + scatter.log_price)

    def refitted(self, before: Description, terms: Sequence[Term]) -> Description:
        """Description with other terms, fitted from where another description stands."""
        return self.described(terms, before.fit.law, before.fit.scatter)

    def without(self, before: Description, k: int) -> Description:
        """Description less one of its terms, refitted."""
        return self.refitted(before, before.terms[:k] + before.terms[k + 1 :])

    def scores(self, before: Description) -> FloatArray:
        """(N,) twice the gain in log likelihood of each term beside a description, linearised."""
        return np.asarray(self._gains(before.fit.residual[None], before)[0])

    def chance(self, before: Description, gain: float) -> tuple[float, float]:
        """Probability that the best of all terms gains as much by chance; gain that chance rarely reaches."""
        draws = simulate(self.noise, self.problem.scatter.covariance, self.seed, DRAWS)
        best = self._gains(draws, before).max(axis=-1)
        return float((1.0 + (best >= gain).sum()) / (1.0 + len(best))), float(np.quantile(best, 1.0 - JOINS))

    @cached_property
    def _squares(self) -> FloatArray:
        """(N,) information of each term by itself under the base fit's scatter."""
        return np.concatenate([self.base.scatter.precision.squares(block) for block in self.dictionary.columns()])

    def _gains(self, residuals: FloatArray, before: Description) -> FloatArray:
        """(s, N) twice the gain in log likelihood for residuals (s, n), 0 if the size would go to a side not allowed.

        Beside a description each term has the information A - A J (J^T A J + prior)^-1 J^T A leaves of it.
        """
        projected = before.fit.projected
        weights = set_wild_aside(projected.times(residuals), projected)[0]
        weighted = self.base.scatter.precision.times(before.fit.jacobian.T)
        across = weighted.T @ inverse_root(weighted @ before.fit.jacobian + law_prior(len(weighted)))
        parts = [(-weights @ block.T, ((block @ across) ** 2).sum(axis=1)) for block in self.dictionary.columns()]
        slope, taken = (np.concatenate(column, axis=-1) for column in zip(*parts, strict=True))
        alone, information = self._squares, self._squares - taken
        allowed = self.dictionary.signed | (slope > 0.0)
        seen = information > 1e-6 * alone
        return np.asarray(np.where(allowed & seen, slope**2 / np.where(seen, information, 1.0), 0.0))

    def finalists(self, before: Description) -> dict[Term, float]:
        """The best terms beside a description, and the best of every link and variable, with their log priors."""
        chosen, kinds, gains = dict[Term, float](), set[tuple[str, str]](), self.scores(before)
        order = np.argsort(-gains, kind="stable")
        for rank, i in enumerate(order[gains[order] > 0.0].tolist()):
            term = self.dictionary.terms[i]
            if rank < FINALISTS or (term.link, term.variable) not in kinds:
                chosen[term] = float(self.dictionary.log_prior[i])
                kinds.add((term.link, term.variable))
        return chosen

    def together(self, before: Description, terms: Sequence[Term]) -> Sizes:
        """Fits of each of some terms together with a description."""
        columns, scale = self._scaled(terms)

        def beside(shared: FloatArray, each: FloatArray) -> FloatArray:
            """(G, p + 1, ..): the shared part (p, ..) repeated for each term, followed by the term's own (G, ..)."""
            return np.concatenate([np.repeat(shared[None], len(terms), axis=0), each[:, None]], axis=1)

        limits = zip(self.limits(before.terms, before.scale), self.limits(terms, scale), strict=True)
        low, high = (beside(shared, each) for shared, each in limits)
        return self.fitted(beside(before.columns, columns), low, high, before.fit.law, before.fit.scatter.precision)

    def grown(self, before: Description) -> Description | None:
        """Description with the best further term, its constants refined; None if no term helps."""
        terms = list(self.finalists(before))
        if not terms:
            return None
        best = terms[int(np.argmax(self.together(before, terms).posterior))]
        grown = self.settled(before, self.extended(before, best))
        # Move the same variable and shape to the place where they fit best.
        places = crossed(grown.terms[-1], self.ground)
        if len(places) < 2:
            return grown
        sizes = self.together(self.scattered(before, grown), list(places))
        best = list(places)[int(np.argmax(sizes.posterior + np.array(list(places.values()))))]
        if best == grown.terms[-1]:
            return grown
        better = self.extended(before, best)
        return better if better.posterior > grown.posterior - TIE else grown

    def scattered(self, before: Description, grown: Description) -> Description:
        """Description under the scatter of another one."""
        return replace(before, fit=replace(before.fit, scatter=grown.fit.scatter))

    def extended(self, before: Description, term: Term) -> Description:
        """Description with one more term, all refitted."""
        grown = self.refitted(before, (*before.terms, term))
        for _ in range(AT_SIZE if any(sized.action in PARALLEL for sized in grown.terms) else 0):
            grown = self.refitted(grown, grown.terms)
        return grown

    def _scaled(self, terms: Sequence[Term]) -> tuple[FloatArray, FloatArray]:
        """(p, n) relative change of compliance, scaled to an rms of 1, and (p,) rms change for an SI unit of size."""
        columns = np.array([self.ground.column(term) for term in terms]).reshape(-1, len(self.compliance))
        columns = columns / self.compliance
        scale = np.maximum(np.sqrt((columns**2).mean(axis=1)), 1e-300)
        return columns / scale[:, None], scale

    def settled(self, before: Description, grown: Description) -> Description:
        """Description with finer constants for the shape of its last term."""
        for finer in FINER:
            near = shapes_near(grown.terms[-1], self.ground, finer)
            if not near:
                break
            sizes = self.together(self.scattered(before, grown), near)
            better = self.extended(before, near[int(np.argmax(sizes.posterior))])
            grown = better if better.posterior > grown.posterior else grown
        return grown


def _bounded_step(
    information: FloatArray, gradient: FloatArray, size: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """(G, 2 + p) Newton steps; sizes that would leave their bounds are held there and the rest solved again."""
    scale = np.sqrt(np.maximum(np.einsum("gii->gi", information), 1e-300))
    matrix = information / (scale[:, :, None] * scale[:, None, :]) + 1e-10 * np.eye(scale.shape[1])
    right = gradient / scale
    step = np.linalg.solve(matrix, right[..., None])[..., 0] / scale
    moved = size + step[:, 2:]
    goal, held, fixed = np.clip(moved, low, high), np.zeros(step.shape, dtype=bool), np.zeros(step.shape)
    held[:, 2:] = goal != moved
    if not held.any():
        return np.asarray(step)
    fixed[:, 2:] = np.where(held[:, 2:], goal - size, 0.0)
    left = right - np.einsum("gij,gj->gi", matrix, fixed * scale)
    free = ~held
    reduced = np.where(free[:, :, None] & free[:, None, :], matrix, 0.0)
    reduced += np.einsum("gi,ij->gij", held * 1.0, np.eye(step.shape[1]))
    again = np.linalg.solve(reduced, np.where(free, left, 0.0)[..., None])[..., 0] / scale
    return np.where(held, fixed, again)
