"""Votes of readings between explanations, pose after pose: a name needs more than a probability.

A probability holds the price of an explanation's parameters (Occam's factor). Of two explanations that predict the
readings equally well it prefers the one with fewer, and so names a part for its bookkeeping. So each pose is predicted
from those before it (Dawid 1984, Present position and potential developments: the prequential approach): sizes and law
as fitted, at a price of 1 each (Akaike 1973); what struts, joints, links and clampings have in common known from the
poses before, under the scatter that is assumed of them: an explanation that needs a joint five standard deviations off
pays for it. (Were each pose left out and predicted from all others, it would not.) The log densities add up to that of
all readings; their differences between two explanations are the votes, and independent but for the fits.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.covariances import Covariance, Groups
from toolpath_stiff.inference.discrepancies import discrepancy_forms
from toolpath_stiff.inference.error_model import SHARE
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit, Problem
from toolpath_stiff.inference.left_out import held_out
from toolpath_stiff.inference.rivals import lowers_error
from toolpath_stiff.inference.votes import CERTAIN, closest, outvoted

FORM, MOST_FEATURES = "smooth over the workspace, different by direction", 60  # the first hold nearly all


def votes(
    problem: Problem, fit: Fit, rivals: Mapping[str, Fit], inexact: FloatArray | None = None
) -> dict[str, FloatArray]:
    """Votes for an explanation against each rival, the closest rival first.

    Readings that either of the two takes for wild scatter widely for both. `inexact` (q, n): what may be off in both.
    """
    scatter, points = problem.scatter, Groups.by(problem.point)
    against = {}
    for name, rival in rivals.items():
        rows = np.array(sorted({*fit.scatter.wild, *rival.scatter.wild}), dtype=np.int64)
        covariance = scatter.covariance.widened(rows, scatter.widening[rows])
        if inexact is not None:
            covariance = replace(covariance, shared=np.concatenate([covariance.shared, inexact]))
        squares = _squares_by_point(np.stack([fit.residual, rival.residual]), covariance, points)
        gain = 0.5 * (squares[1] - squares[0]) + (_price(rival) - _price(fit)) / points.count
        # Rounded: otherwise the processor would decide which of two equal rivals is the closer.
        against[name] = np.round(gain, CERTAIN) + 0.0
    return closest(against)


def carried(problem: Problem, fits: Mapping[str, Fit], singles: Sequence[str], name: str) -> str:
    """Name of the part of an explanation that the readings support: one of its effects if more predicts no better.

    What a second effect adds may be no more than what constants along axes leave of the first, `SHARE` of its change.
    """
    whole, form = fits[name], discrepancy_forms(problem.predictor).get(FORM, np.zeros((len(problem.point), 0)))
    for single in singles:
        alone = fits[single]
        if {*alone.names} < {*whole.names}:
            instruments = [active for active in alone.effects if active.effect.is_instrument]
            change = problem.residual(alone.law, instruments) - alone.residual
            (differences,) = votes(problem, whole, {single: alone}, SHARE * change * form[:, :MOST_FEATURES].T).values()
            before, after = (held_out(fit, problem.point) for fit in (alone, whole))
            if not (outvoted(differences) and lowers_error(before, after)):
                return single
    return name


def _price(fit: Fit) -> float:
    """Number of fitted sizes and constants of the law (Akaike 1973), plus the law's distance from the machine file."""
    return len(fit.free) + (2.0 + 0.5 * float(fit.law @ fit.law) / LAW_PRIOR**2 if fit.law_free else 0.0)


def _squares_by_point(residuals: FloatArray, covariance: Covariance, points: Groups) -> FloatArray:
    """(k, points) weighted squares that each point adds to those of earlier points, for residuals (k, n).

    Of r^T V^-1 r = r^T C^-1 r - h^T (1 + S C^-1 S^T)^-1 h, h = S C^-1 r (`covariances`), each sum up to a point.
    """
    rows, count = np.concatenate([covariance.shared, residuals]), len(covariance.shared)
    solved = covariance.blocks.times(rows)
    products = np.cumsum([solved[:, out] @ rows[:, out].T for out in points.members()], axis=0)
    known, pull = np.eye(count) + products[:, :count, :count], products[:, :count, count:]
    predicted = (pull * np.linalg.solve(known, pull)).sum(axis=1)
    whole = np.diagonal(products[:, count:, count:], axis1=1, axis2=2) - predicted
    return np.asarray(np.diff(whole, axis=0, prepend=0.0).T)
