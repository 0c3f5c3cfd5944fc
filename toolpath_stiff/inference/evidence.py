"""Evidence for candidates: bounded fits under the noise model, and their marginal likelihoods.

Residuals of ln k are multivariate normal with the covariance of `noise`; a wild reading has its own scatter widened, at
the price of its rarity. The strut law's two logarithms are refitted along with every candidate (prior sd
`LAW_PRIOR`), so that they can neither hide nor fake an effect. Sizes carry a prior that is flat in the logarithm of
the change that they make to the stiffness; the marginal likelihood follows by quadrature over the size of an effect of
one parameter, by Laplace's approximation otherwise (MacKay, Information Theory, Inference and Learning Algorithms,
chapters 27 and 28). An effect of several parameters is tried with each subset of them: one component at zero is normal.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from toolpath_stiff.arrays import FloatArray, TextArray
from toolpath_stiff.inference.candidates import Candidate, CandidateTable, Component
from toolpath_stiff.inference.covariances import Precision
from toolpath_stiff.inference.least_squares import NormalEquations, gauss_newton, scaled_inverse
from toolpath_stiff.inference.noise import Noise, Scatter, covariance
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.size_priors import Sight, SizePrior, log_comparable
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.contract import Effect

LAW_PRIOR = 0.2  # sd of the strut law's logarithms; assumed: a catalogue's stiffness is right within 20 %


def law_prior(unknowns: int, law_free: bool = True) -> FloatArray:
    """(q, q) information of the strut law's prior on q unknowns, the first two of which are the law's.

    Of a law that is not fitted, that it does not change.
    """
    prior = np.zeros((unknowns, unknowns))
    prior[:2, :2] = np.eye(2) * (LAW_PRIOR**-2 if law_free else 1e12)
    return prior


MOST_ROUNDS = 3  # searches for wild readings
TABLE_STEPS, TABLE_TOLERANCE = 12, 1e-4  # steps of a fit on tables; its tolerance in standard deviations
BEYOND = 0.05  # share of a bound by which a search may overshoot it


def relative_errors(residual: FloatArray, linear: bool) -> FloatArray:
    """(n,) (modelled - measured) / measured from residuals, which are logarithms unless `linear`."""
    return np.asarray(-residual if linear else np.expm1(-residual))


@dataclass(frozen=True)
class Fit:
    """Strut law and effects fitted to n readings: by a search on tables, or with the model itself (`fits`).

    Attributes
    ----------
    candidates, sizes
        Effects with what they act on, none for the base model; their sizes, one array (p,) each, from the neutral
        value.
    free
        Indices of the free sizes, counted over all candidates; the others are neutral.
    law
        (2,) logarithms of the factors on the strut law's stiffnesses; kept at 0 if `law_free` is false.
    residual
        (n,) ln measured - ln modelled.
    jacobian
        (n, 2 + free) of ln modelled to law and free sizes.
    covariance
        (2 + free, 2 + free) of law and free sizes.
    scatter
        The noise with the readings that this fit takes for wild.
    law_free
        Whether the strut law was fitted along.
    absent
        Index of a size that is not free -> (where the data would pull it, sd of that), were all sizes free.
    tables
        Of a search: the candidates' tables.
    log_evidence
        Of a search: how likely it makes the data, integrated over sizes and law under their priors; else nan.
    possible
        Whether the sizes lie within their bounds; if not, only `log_evidence` means anything.
    linear
        Whether residuals are relative errors themselves, not logarithms: of pulls, whose components pass zero.
    """

    candidates: tuple[Candidate, ...]
    sizes: tuple[FloatArray, ...]
    free: tuple[int, ...]
    law: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    covariance: FloatArray
    scatter: Scatter
    law_free: bool = True
    absent: dict[int, tuple[float, float]] = field(default_factory=dict)
    tables: tuple[CandidateTable, ...] = ()
    log_evidence: float = np.nan
    possible: bool = True
    linear: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(c.name for c in self.candidates)

    @property
    def name(self) -> str:
        """Name of the effect, or "a + b" for several."""
        return " + ".join(sorted(self.names))

    @property
    def effects(self) -> tuple[ActiveEffect, ...]:
        """The effects with their values."""
        return tuple(c.active(s) for c, s in zip(self.candidates, self.sizes, strict=True))

    @property
    def parts(self) -> list[tuple[Component, float]]:
        """Every real parameter with its size, in the order in which sizes are counted."""
        components = [component for candidate in self.candidates for component in candidate.components]
        return list(zip(components, [float(size) for sizes in self.sizes for size in sizes], strict=True))

    @property
    def findings(self) -> tuple[str, ...]:
        """Each effect with its size as a clause in an engineer's words."""
        clauses = []
        for candidate, sizes in zip(self.candidates, self.sizes, strict=True):
            parts = zip(candidate.components, sizes.tolist(), strict=True)
            values = {c.parameter.name: c.value(size) / c.parameter.si for c, size in parts}
            clauses.append(candidate.effect.finding({**dict(candidate.choice), **values}))
        return tuple(clauses)

    @property
    def errors(self) -> FloatArray:
        """(n,) |modelled - measured| / measured."""
        return np.abs(relative_errors(self.residual, self.linear))

    @property
    def projected(self) -> Precision:
        """Inverse covariance of the fit's residuals, under the scatter that it found."""
        return self.scatter.precision.beside(self.jacobian.T, law_prior(self.jacobian.shape[1]))

    @property
    def log_likelihood(self) -> float:
        """Log likelihood of the residuals, including the price of wild readings."""
        return float(self.scatter.log_likelihood(self.residual))

    @property
    def log_posterior(self) -> float:
        """Log likelihood plus the law's log prior, which the fit maximises; -inf if the model has no stiffness."""
        penalty = 0.5 * float(self.law @ self.law) / LAW_PRIOR**2 if self.law_free else 0.0
        posterior = self.log_likelihood - penalty
        return posterior if np.isfinite(posterior) else -np.inf

    def deviation(self, index: int) -> float:
        """Standard deviation of a size (counted over all candidates); 0 if it is not free."""
        if index not in self.free:
            return 0.0
        row = 2 + self.free.index(index)
        return float(np.sqrt(max(self.covariance[row, row], 0.0)))

    def at_upper_bound(self) -> list[str]:
        """Parameters whose size has run into its bound, with which a fit is no explanation."""
        reaches = ((component, size, component.reach(float(np.sign(size)))) for component, size in self.parts if size)
        return [c.parameter.name for c, size, reach in reaches if np.isfinite(reach) and abs(size) >= 0.999 * reach]


class Problem:
    """The data, the model as a function of strut law and added compliance, and the scatter.

    Attributes
    ----------
    predictor
        The model's answers.
    scatter
        Of ln readings, without wild ones.
    observed
        (n,) ln k as measured.
    base_compliance, rest
        (n,) m/N of the model as it stands, and of the machine file's own effects.
    sight
        What the data can see.
    """

    linear = False  # as of `Fit`

    def __init__(self, predictor: Predictor, scatter: Scatter) -> None:
        self.predictor, self.scatter = predictor, scatter
        self.observed = np.log(predictor.data.stiffness)
        self.base_compliance = np.exp(-predictor.log_stiffness())
        self.rest = self.base_compliance - predictor.strut_part()
        self.prior = cache(self._prior)
        self.sight = Sight(self.base_compliance, self.projected(predictor.law_columns(-np.log(self.base_compliance))))

    @classmethod
    def of(cls, predictor: Predictor, noise: Noise) -> Problem:
        """Problem made of a predictor and a noise model."""
        return cls(predictor, Scatter.of(noise, covariance(noise, predictor)))

    def projected(self, jacobian: FloatArray) -> Precision:
        """P = A - A J (J^T A J + prior)^-1 J^T A: the inverse covariance of residuals after a refit.

        `jacobian` (n, 2 + p) of ln k to the strut law and p sizes.
        """
        return self.scatter.precision.beside(jacobian.T, law_prior(jacobian.shape[1]))

    @property
    def point(self) -> TextArray:
        """(n,) label of each reading's point; the readings of a point are left out together."""
        return self.predictor.data.point

    def residual(self, law: FloatArray, effects: Sequence[ActiveEffect]) -> FloatArray:
        """(n,) ln measured - ln modelled."""
        return np.asarray(self.observed - self.predictor.log_stiffness(law, effects))

    def law_columns(self, residual: FloatArray, law: FloatArray, effects: Iterable[Effect]) -> list[FloatArray]:
        """(n,) d ln k / d each of the law's logarithms, if they follow from the strut forces; otherwise none."""
        if not (np.isfinite(residual).all() and self.predictor.struts_carry_all(effects)):
            return []
        return list(self.predictor.law_columns(self.observed - residual, law).T)

    def _prior(self, table: CandidateTable, j: int) -> SizePrior:
        """Prior of a component's size, computed once."""
        return SizePrior.of(table, j, self.sight)

    def compliance(self, law: FloatArray, delta: FloatArray) -> FloatArray:
        """(..., n) m/N for laws (..., 2) and added compliances (..., n)."""
        return self._held(self.predictor.strut_part(law) + delta)

    def _held(self, compliance: FloatArray) -> FloatArray:
        """(..., n) m/N with the machine file's own effects, kept above a tenth of the base model's."""
        return np.maximum(compliance + self.rest, 0.1 * self.base_compliance)

    def score_base(self) -> Fit:
        """Fit of the model without any further effect."""
        fit = self.score_subset((), ())
        assert fit is not None  # the law's prior keeps it from failing
        return fit

    def score_subset(
        self,
        tables: Sequence[CandidateTable],
        free: tuple[int, ...],
        start: Fit | None = None,
        sizes: FloatArray | None = None,
    ) -> Fit | None:
        """Fit of candidates with these components free (counted over all); None if one ends at zero or its bound.

        Gauss-Newton from the law of `start`, else the machine file's, then Laplace's approximation. `sizes`: where to
        begin, with the scatter of `start`; else at 0.
        """
        every = [(table, j) for table in tables for j in range(len(table.candidate.components))]
        x, unknowns, scatter = np.zeros(2 + len(every)), [0, 1, *(2 + i for i in free)], self.scatter
        if start is not None:
            x[:2] = start.law
        if start is not None and sizes is not None:
            x[unknowns[2:]], scatter = sizes[list(free)], start.scatter
        for last in range(MOST_ROUNDS, -1, -1):
            converged = self._gauss_newton(tables, x, unknowns, scatter.precision)
            if converged is None:
                return None
            x, residual, equations = converged
            again = self.scatter.with_wild(residual, scatter)
            if not last or again is scatter:
                break
            scatter = again
        components = [every[i][0].candidate.components[every[i][1]] for i in free]
        bounded = dict(zip(unknowns[2:], components, strict=True))
        # A parameter alone; or one only little beyond its bound, by tables of two effects, which are inexact.
        near = np.inf if len(every) == 1 else 1.0 + BEYOND if len(tables) > 1 else 1.0
        reach = {i: component.reach(float(np.sign(x[i]))) for i, component in bounded.items()}
        beyond = [i for i in bounded if 0.0 < reach[i] < abs(x[i]) <= near * reach[i]]
        if beyond:  # set to their bounds, the others fitted again beside them
            for i in beyond:
                x[i] = np.clip(x[i], *bounded[i].bounds)
            rest = [i for i in unknowns if i not in beyond]
            x, residual, _ = self._gauss_newton(tables, x, rest, scatter.precision) or (x, residual, equations)
        possible = all(component.allows(float(x[i])) for i, component in bounded.items())
        if not possible and len(free) > 1:
            return None
        parts = tuple(part for _, part in split(tables, x[2:].copy()))
        fit = Fit(
            tuple(table.candidate for table in tables), parts, free, x[:2].copy(), residual, equations.jacobian,
            np.asarray(scaled_inverse(equations.information), dtype=float), scatter, tables=tuple(tables),
            possible=possible,
        )  # fmt: skip
        chosen = [every[i] for i in free]
        return replace(fit, log_evidence=self._integrated(fit, chosen, equations.information))

    def _integrated(self, fit: Fit, chosen: Sequence[tuple[CandidateTable, int]], information: FloatArray) -> float:
        """Log evidence: posterior of law and free sizes (p,), integrated over them about its peak.

        `chosen`: table and component of each free size; `information` (2 + p, 2 + p).
        """
        sizes = np.array([fit.parts[i][1] for i in fit.free])
        deviations = np.array([fit.deviation(i) for i in fit.free])
        peak = fit.log_posterior - 2.0 * np.log(LAW_PRIOR)
        if len(chosen) == 1:
            # By quadrature, valid also for sizes near zero, with a parabolic profile.
            mean = self.prior(*chosen[0]).log_mean_likelihood(float(sizes[0]), float(deviations[0]))
            return float(peak - 0.5 * np.linalg.slogdet(information[:2, :2])[1] + mean)
        evidence = peak - 0.5 * float(np.linalg.slogdet(information)[1]) + 0.5 * len(chosen) * np.log(2.0 * np.pi)
        around = np.sign(sizes) * np.maximum(np.abs(sizes), deviations)
        for table in fit.tables:
            rows = [i for i, (owner, _) in enumerate(chosen) if owner is table]
            # The strongest component has its own prior; the others are comparable to it.
            units = {i: around[i] * np.eye(len(table.candidate.components))[chosen[i][1]] for i in rows}
            changes = {i: float(np.sqrt(np.mean(self.sight.change(table.delta(u)) ** 2))) for i, u in units.items()}
            first = max(rows, key=lambda i: changes[i], default=-1)
            for i in rows:
                if i == first:
                    evidence += self.prior(*chosen[i]).log_density_around(float(sizes[i]), float(deviations[i]))
                else:
                    evidence += log_comparable(changes[i] / changes[first]) - np.log(abs(around[i]))
        return float(evidence)

    def _gauss_newton(
        self, tables: Sequence[CandidateTable], start: FloatArray, unknowns: Sequence[int], precision: Precision
    ) -> tuple[FloatArray, FloatArray, NormalEquations] | None:
        """Law and all sizes (2 + p,) after fitting the `unknowns` among them, the residual, the last equations.

        None where that fails.
        """

        def compliance(x: FloatArray, part: FloatArray) -> FloatArray:
            return self._held(part + sum((table.delta(sizes) for table, sizes in split(tables, x[2:])), 0.0))

        def equations(x: FloatArray) -> NormalEquations:
            part, by_law = self.predictor.strut_part_and_slopes(x[:2])
            whole = compliance(x, part)
            slopes = [table.slope(sizes) for table, sizes in split(tables, x[2:])]
            jacobian = -np.concatenate([by_law.T, *slopes], axis=1)[:, unknowns] / whole[:, None]
            return normal_equations(jacobian, self.observed + np.log(whole), x[:2], precision)

        def move(x: FloatArray, here: NormalEquations) -> tuple[FloatArray, FloatArray]:
            scale = here.scale
            step = np.linalg.solve(here.information / np.outer(scale, scale), here.gradient / scale) / scale
            if not np.isfinite(step).all():
                raise np.linalg.LinAlgError
            # A step may change no reading by more than half: beyond that the linearisation means nothing.
            step *= min(1.0, 0.5 / max(float(np.abs(here.jacobian @ step).max()), 1e-12))
            further = x.copy()
            further[unknowns] += step
            return further, step

        try:
            x, last = gauss_newton(start, equations, move, TABLE_STEPS, TABLE_TOLERANCE)
        except np.linalg.LinAlgError:
            return None
        return x, self.observed + np.log(compliance(x, self.predictor.strut_part(x[:2]))), last


def split(tables: Sequence[CandidateTable], sizes: FloatArray) -> Iterator[tuple[CandidateTable, FloatArray]]:
    """Each table with its part of the sizes (p,)."""
    ends = np.cumsum([len(table.candidate.components) for table in tables])
    return zip(tables, np.split(sizes, ends)[:-1], strict=True)


def normal_equations(
    jacobian: FloatArray, residual: FloatArray, law: FloatArray, precision: Precision, law_free: bool = True
) -> NormalEquations:
    """Normal equations with the prior of the strut law, whose two logarithms are the first unknowns."""
    weighted, prior = precision.times(jacobian.T), law_prior(jacobian.shape[1], law_free)
    gradient = weighted @ residual
    gradient[:2] -= prior[0, 0] * law
    return NormalEquations(jacobian, weighted @ jacobian + prior, gradient)
