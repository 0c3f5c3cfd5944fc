"""The votes themselves: log predictive densities of left-out poses, of an explanation and its rivals (`votes`)."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.covariances import Groups, Precision
from toolpath_stiff.inference.evidence import Fit, Problem, law_prior
from toolpath_stiff.inference.fits import prior_of
from toolpath_stiff.inference.noise import REST_COLUMNS
from toolpath_stiff.inference.size_priors import EXPECTED
from toolpath_stiff.inference.votes import CERTAIN, Votes


def votes(problem: Problem, fit: Fit, rivals: Mapping[str, Fit]) -> dict[str, FloatArray]:
    """Votes for an explanation against each rival, the closest rival first.

    Readings that either of the two takes for wild scatter widely for both.
    """
    scatter, points = problem.scatter, Groups.by(problem.predictor.data.point)
    # Other poses would tell how much the rest gives, at no price: as a free part that any explanation has beside it.
    given = replace(scatter.covariance, shared=scatter.covariance.shared[:-REST_COLUMNS])
    mine: dict[tuple[int, ...], tuple[Precision, FloatArray]] = {}
    against = {}
    for name, rival in rivals.items():
        wild = tuple(sorted({*fit.scatter.wild, *rival.scatter.wild}))
        if wild not in mine:
            rows = np.array(wild, dtype=np.int64)
            precision = given.widened(rows, scatter.widening[rows]).precision
            mine[wild] = precision, _log_predictive(fit, precision, points)
        precision, density = mine[wild]
        # Rounded: which of two rivals that do the same is the closer would be the processor's.
        against[name] = np.round(density - _log_predictive(rival, precision, points), CERTAIN) + 0.0
    return closest(against)


def _log_predictive(fit: Fit, precision: Precision, points: Groups) -> FloatArray:
    """(points,) log density of each point's readings given all others, up to a constant of the data."""
    prior = law_prior(fit.jacobian.shape[1])
    prior[:2, :2] = prior_of(fit.law_free) * np.eye(2)
    sizes = np.arange(2, len(prior))
    # A size is expected to change the stiffness by no more than any effect does.
    prior[sizes, sizes] = np.mean(fit.jacobian[:, 2:] ** 2, axis=0) / EXPECTED[1] ** 2
    projected = precision.beside(fit.jacobian.T, prior)
    pull, density = projected.times(fit.residual), np.zeros(points.count)
    for which, out in points.by_size():
        block = projected.block(out)
        squares = (pull[out] * np.linalg.solve(block, pull[out][..., None])[..., 0]).sum(axis=-1)
        density[which] = 0.5 * (np.linalg.slogdet(block)[1] - squares)
    return density


def closest(*ballots: Votes) -> dict[str, FloatArray]:
    """Votes against each rival in its strongest form, the closest rival first."""
    names = {name for votes_for in ballots for name in votes_for}
    strongest = {
        name: min((votes_for[name] for votes_for in ballots if name in votes_for), key=np.sum) for name in sorted(names)
    }
    return dict(sorted(strongest.items(), key=lambda item: (round(float(item[1].sum()), CERTAIN - 1), item[0])))
