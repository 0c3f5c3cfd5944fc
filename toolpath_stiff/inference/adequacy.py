"""Share of the stiffness by which a model may still be off, and explanations in place of a strut law that moved."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import with_given_law
from toolpath_stiff.inference.hypotheses import Family
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.inference.nuisances import mean_left_by_nuisances
from toolpath_stiff.inference.prequential import votes
from toolpath_stiff.inference.rivals import ONE_BODY, SERIES, rivals_of_law
from toolpath_stiff.inference.unexcluded import rooms
from toolpath_stiff.inference.votes import Votes, outvoted

# Share of the stiffness that `adequate` may leave along a path; assumed: a third of what cutting forces are known to.
LEFT = 0.03
ONE_SIDED = 1.645  # normal quantile of 95 %


def may_leave(problem: Problem, noise: Noise, families: Sequence[Family], base: Fit) -> float:
    """Mean error (relative) at the readings' poses up to which a model that passes may still be off.

    What an effect may hide there beside the refitted law (95 %), of all the one that hides most, and what struts,
    joints and links that are not quite those of the model leave on average. Where the scatter is only guessed, at least
    what it does not account for of the error of the model as given: whether that is scatter, too, nobody knows.
    """
    hidden = max((room.left for room, _ in rooms(problem, families, base)), default=0.0)
    tip = problem.predictor.data.tip
    error = float(np.abs(np.expm1(-problem.residual(np.zeros(2), ())[tip])).mean()) if noise.guess else 0.0
    beyond = float(max(error**2 - (noise.floor_percent / 100.0) ** 2, 0.0) ** 0.5)
    return max(beyond, hidden + mean_left_by_nuisances(base, tip))


def moved_by_law(problem: Problem, fit: Fit) -> float:
    """Mean change (relative, 95 %) of the stiffness at the readings by the refitted strut law."""
    columns = fit.jacobian[problem.predictor.data.tip, :2]
    spread = np.sqrt(np.einsum("ni,ij,nj->n", columns, fit.covariance[:2, :2], columns))
    return float(np.mean(np.abs(columns @ fit.law) + ONE_SIDED * spread))


def is_small(problem: Problem, base: Fit, explanations: Sequence[Fit]) -> bool:
    """True if, were any of these true, the model alone would be off by no more (95 %) than an adequate one."""
    tip, most = problem.predictor.data.tip, moved_by_law(problem, base)
    for fit in explanations:
        deviates = np.sqrt(max(2.0 * (fit.log_posterior - base.log_posterior), 1e-12))
        change = float(np.abs(fit.residual - base.residual)[tip].mean())
        most = max(most, change * (1.0 + ONE_SIDED / deviates) + mean_left_by_nuisances(fit, tip))
    return most <= LEFT


def instead_of_law(problem: Problem, fit: Fit) -> tuple[dict[str, Fit], Votes]:
    """Explanations beside the file's strut law that hold as well as one with a law that had to move; all their votes.

    The closest first. None where the law has moved the stiffness by less than an adequate model may leave along a path,
    beyond chance.
    """
    if moved_by_law(problem, fit) <= LEFT:
        return {}, {}
    given = with_given_law(problem, fit)
    if not outvoted(votes(problem, fit, {fit.name: given})[fit.name]):
        return {}, {}
    series = SERIES if np.ptp(problem.predictor.data.force) == 0.0 else SERIES[:1]
    rivals = {rival.name: rival for rival in rivals_of_law(problem, given, (*series, *ONE_BODY)).values()}
    ballots = votes(problem, fit, rivals)
    return {name: rivals[name] for name in ballots if not outvoted(ballots[name])}, ballots


def hangs_on_load(problem: Problem, fit: Fit) -> float:
    """Mean share of the tip's compliance that may hang on the load: what a law has moved that contacts may stand for.

    Readings under several loads tell; under one load, contacts or play hold as well as another law.
    """
    tip = problem.predictor.data.tip
    if not fit.law_free or np.ptp(problem.predictor.data.force[tip]) > 0.0:
        return 0.0
    parts = {name for instead in instead_of_law(problem, fit)[0].values() for name in instead.names}
    moved = float(np.abs(fit.jacobian[tip, :2] @ fit.law).mean())
    return moved if (parts - {*fit.names}) & {*SERIES[1:]} else 0.0
