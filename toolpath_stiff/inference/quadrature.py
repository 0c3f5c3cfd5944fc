"""Marginal likelihood of an effect of one parameter: a scan over its size, refined about the peak, by quadrature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.candidates import CandidateTable
from toolpath_stiff.inference.covariances import Precision
from toolpath_stiff.inference.evidence import MOST_ROUNDS, Fit, Problem, law_prior, law_terms
from toolpath_stiff.inference.size_priors import likely_interval

GRID = 24  # sizes a sign


ZOOMS = 3


def score_single(problem: Problem, table: CandidateTable, start: Fit) -> Fit:
    """A candidate of one parameter: quadrature over its size."""
    sizes = np.sort(
        np.concatenate([s * np.geomspace(np.exp(k[0][0]), table.reach(s), GRID) for s, k in table.knots.items()])
    )
    prior = problem.prior(table, 0)
    scatter, law, delta = problem.scatter, start.law, table.delta(sizes[:, None])
    for last in range(MOST_ROUNDS, -1, -1):
        scan = _refined(problem, table, _scan(problem, delta, sizes, scatter.precision, law), scatter.precision)
        peak = int(np.argmax(scan.profile))
        residual, law = scan.residuals[peak], scan.laws[peak]
        again = problem.scatter.with_wild(residual, scatter)
        if not last or again is scatter:
            break
        scatter = again
    log_integral = prior.integrate(scan.sizes, scan.profile)
    interval = likely_interval(scan.sizes, scan.profile)
    best = np.array([scan.sizes[peak]])
    compliance = problem.compliance(law, table.delta(best))
    jacobian = np.concatenate([problem.law_jacobian(law, compliance), -table.slope(best) / compliance[:, None]], axis=1)
    information = scatter.precision.times(jacobian.T) @ jacobian + law_prior(3)
    return Fit(
        (table.candidate,), (best,), (0,), law, residual, jacobian,
        np.asarray(np.linalg.pinv(information), dtype=float), scatter,
        tables=(table,), log_evidence=log_integral + scatter.log_price, interval=interval,
    )  # fmt: skip


def _scan(
    problem: Problem, delta: FloatArray, sizes: FloatArray, precision: Precision, law: FloatArray, steps: int = 3
) -> _Scan:
    """At sizes (g,), which add compliances (g, n)."""
    laws, residuals, information = problem.fit_law(delta, precision, law, steps)
    return _Scan(sizes, -0.5 * precision.squares(residuals) + law_terms(laws, information), laws, residuals)


def _refined(problem: Problem, table: CandidateTable, scan: _Scan, precision: Precision) -> _Scan:
    """With more sizes about the peak: zooms, then five standard deviations to each side."""
    for _ in range(ZOOMS):
        peak = int(np.argmax(scan.profile))
        low, high = scan.sizes[max(peak - 1, 0)], scan.sizes[min(peak + 1, len(scan.sizes) - 1)]
        low, high = (max(low, 0.0), high) if scan.sizes[peak] > 0.0 else (low, min(high, 0.0))
        more = np.linspace(low, high, 8)[1:-1]
        more = more[(more != 0.0) & (more != scan.sizes[peak])]
        scan = scan.merged(_scan(problem, table.delta(more[:, None]), more, precision, scan.laws[peak], steps=2))
    peak = int(np.argmax(scan.profile))
    size, sd = float(scan.sizes[peak]), scan.width()
    more = size + sd * np.linspace(-4.5, 4.5, 14)
    more = more[(more * size > 0.0) & (np.abs(more) <= table.reach(float(np.sign(size))))]
    if not len(more):
        return scan
    return scan.merged(_scan(problem, table.delta(more[:, None]), more, precision, scan.laws[peak], steps=2))


@dataclass(frozen=True)
class _Scan:
    """Sizes (g,) in rising order, their log posterior with the law integrated out, laws (g, 2), residuals (g, n)."""

    sizes: FloatArray
    profile: FloatArray
    laws: FloatArray
    residuals: FloatArray

    def merged(self, other: _Scan) -> _Scan:
        """Both, in order, each size once."""
        sizes, first = np.unique(np.concatenate([self.sizes, other.sizes]), return_index=True)
        parts = ((getattr(self, name), getattr(other, name)) for name in ("profile", "laws", "residuals"))
        return _Scan(sizes, *(np.concatenate(pair)[first] for pair in parts))

    def width(self) -> float:
        """Standard deviation of the size from the curvature at the peak."""
        peak = int(np.argmax(self.profile))
        if not 0 < peak < len(self.sizes) - 1:
            return 0.1 * abs(float(self.sizes[peak]))
        x, y = self.sizes[peak - 1 : peak + 2], self.profile[peak - 1 : peak + 2]
        curvature = 2.0 * ((y[2] - y[1]) / (x[2] - x[1]) - (y[1] - y[0]) / (x[1] - x[0])) / (x[2] - x[0])
        return float(1.0 / np.sqrt(max(-curvature, 1e-2 / x[1] ** 2)))
