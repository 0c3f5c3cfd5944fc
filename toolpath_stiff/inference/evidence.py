"""How well candidates explain the data: bounded fits under the noise model, and their marginal likelihoods.

Residuals of ln k are multivariate normal with the covariance of `noise`; a wild reading has its own scatter widened, at
the price of its rarity. The strut law's two logarithms are refitted along with every candidate (prior sd
`LAW_PRIOR`), so that they can neither hide nor fake an effect. Sizes carry a prior that is flat in the logarithm of
the change that they make to the stiffness; the marginal likelihood follows by quadrature over the size of an effect of
one parameter, by Laplace's approximation otherwise (MacKay, Information Theory, Inference and Learning Algorithms,
chapters 27 and 28). An effect of several parameters is tried with each subset of them: one component at zero is normal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.candidates import Candidate, Table
from toolpath_stiff.inference.covariances import Precision
from toolpath_stiff.inference.noise import Noise, NormalEquations, Scatter, covariance, gauss_newton, scaled_inverse
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.size_priors import Sight, SizePrior, log_comparable
from toolpath_stiff.stiffness.active import ActiveEffect

LAW_PRIOR = 0.2  # sd of the strut law's logarithms; assumed: a catalogue's stiffness is right within 20 %


def law_prior(unknowns: int) -> FloatArray:
    """(q, q) information of the strut law's prior about q unknowns, of which the law's two are the first."""
    prior = np.zeros((unknowns, unknowns))
    prior[:2, :2] = np.eye(2) / LAW_PRIOR**2
    return prior


MOST_ROUNDS = 3  # searches for wild readings


TABLE_STEPS, TABLE_TOLERANCE = 12, 1e-4  # of a fit on tables; standard deviations


BEYOND = 0.05  # share of a bound by which a search may overshoot it


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
    interval
        Of a search: (2,) 95 % interval of the size of a single parameter from its profile; None otherwise.
    possible
        Whether the sizes lie within their bounds; if not, only `log_evidence` means anything.
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
    tables: tuple[Table, ...] = ()
    log_evidence: float = np.nan
    interval: FloatArray | None = None
    possible: bool = True

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(c.name for c in self.candidates)

    @property
    def effects(self) -> tuple[ActiveEffect, ...]:
        """The effects with their values."""
        return tuple(c.active(s) for c, s in zip(self.candidates, self.sizes, strict=True))

    @property
    def findings(self) -> tuple[str, ...]:
        """Each effect with its size as a clause in an engineer's words."""
        found = []
        for candidate, sizes in zip(self.candidates, self.sizes, strict=True):
            parts = zip(candidate.components, sizes, strict=True)
            values = {c.parameter.name: c.value(float(size)) / c.parameter.si for c, size in parts}
            found.append(candidate.effect.finding({**dict(candidate.choice), **values}))
        return tuple(found)

    @property
    def errors(self) -> FloatArray:
        """(n,) |modelled - measured| / measured."""
        return np.abs(np.expm1(-self.residual))

    @property
    def projected(self) -> Precision:
        """Inverse covariance of what the fit leaves, under the scatter that it found."""
        return self.scatter.precision.beside(self.jacobian.T, law_prior(self.jacobian.shape[1]))

    @property
    def log_likelihood(self) -> float:
        """Of the residuals, the price of wild readings included."""
        return float(self.scatter.log_likelihood(self.residual))

    @property
    def log_posterior(self) -> float:
        """Log likelihood with the law's prior: what the fit has made largest; -inf where the model has no answer."""
        penalty = 0.5 * float(self.law @ self.law) / LAW_PRIOR**2 if self.law_free else 0.0
        found = self.log_likelihood - penalty
        return found if np.isfinite(found) else -np.inf

    def deviation(self, index: int) -> float:
        """Standard deviation of a size (counted over all candidates); 0 if it is not free."""
        if index not in self.free:
            return 0.0
        at = 2 + self.free.index(index)
        return float(np.sqrt(max(self.covariance[at, at], 0.0)))

    def at_upper_bound(self) -> list[str]:
        """Parameters whose size has run into its bound: such a fit is no explanation."""
        found = []
        for candidate, sizes in zip(self.candidates, self.sizes, strict=True):
            for component, size in zip(candidate.components, sizes, strict=True):
                reach = component.reach(float(np.sign(size))) if size else np.inf
                if np.isfinite(reach) and abs(size) >= 0.999 * reach:
                    found.append(component.parameter.name)
        return found


@dataclass
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
    """

    predictor: Predictor
    scatter: Scatter
    observed: FloatArray = field(init=False)
    sight: Sight = field(init=False)
    rest: FloatArray = field(init=False)  # (n,) m/N of the machine file's own effects
    base_compliance: FloatArray = field(init=False)

    @classmethod
    def of(cls, predictor: Predictor, noise: Noise) -> Problem:
        """From the model's answers and a noise model."""
        return cls(predictor, Scatter.of(noise, covariance(noise, predictor)))

    def __post_init__(self) -> None:
        self.observed = np.log(self.predictor.data.stiffness)
        self.base_compliance = np.exp(-self.predictor.log_stiffness())
        self.rest = self.base_compliance - self.predictor.strut_part()
        self._priors: dict[tuple[int, int], tuple[Table, SizePrior]] = {}
        jacobian = self.law_jacobian(np.zeros(2), self.base_compliance)
        self.sight = Sight(self.base_compliance, self.projected(jacobian))

    def projected(self, jacobian: FloatArray) -> Precision:
        """P = A - A J (J^T A J + prior)^-1 J^T A: the inverse covariance of what a refit leaves.

        `jacobian` (n, 2 + p) of ln k to the strut law and p sizes.
        """
        return self.scatter.precision.beside(jacobian.T, law_prior(jacobian.shape[1]))

    def prior(self, table: Table, j: int) -> SizePrior:
        """Prior of a component's size, worked out once."""
        key = (id(table), j)
        if key not in self._priors:
            self._priors[key] = (table, SizePrior.of(table, j, self.sight))
        return self._priors[key][1]

    def compliance(self, law: FloatArray, delta: FloatArray) -> FloatArray:
        """(..., n) for laws (..., 2) and added compliances (..., n)."""
        return self._held(self.predictor.strut_part(law) + delta)

    def _held(self, compliance: FloatArray) -> FloatArray:
        """(..., n) with the machine file's own effects; above a tenth of the base model's."""
        return np.maximum(compliance + self.rest, 0.1 * self.base_compliance)

    def law_jacobian(self, law: FloatArray, compliance: FloatArray) -> FloatArray:
        """(..., n, 2) of ln k."""
        slopes = self.predictor.strut_part_and_slopes(law)[1]
        return np.asarray(np.swapaxes(-slopes / compliance[..., None, :], -1, -2))

    def fit_law(
        self, delta: FloatArray, precision: Precision, start: FloatArray, steps: int = 3
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Laws (g, 2), residuals (g, n), information matrices (g, 2, 2) for added compliances (g, n)."""
        law = np.asarray(start)[None]  # the same for all at first
        for _ in range(steps):
            part, slopes = self.predictor.strut_part_and_slopes(law)
            compliance = self._held(part + delta)
            rows = np.empty((len(compliance), 3, len(self.observed)))  # of the jacobian, then of the residual
            np.divide(-slopes, compliance[:, None], out=rows[:, :2])
            rows[:, 2] = self.observed + np.log(compliance)
            products = precision.products(rows)
            information = products[:, :2, :2] + np.eye(2) / LAW_PRIOR**2
            gradient = products[:, :2, 2] - law / LAW_PRIOR**2
            law = law + np.clip(np.linalg.solve(information, gradient[..., None])[..., 0], -0.5, 0.5)
        return law, self.observed + np.log(self.compliance(law, delta)), information

    def score_base(self) -> Fit:
        """The model without any further effect."""
        scatter, law = self.scatter, np.zeros(2)
        none = np.zeros((1, len(self.observed)))
        for _ in range(3):
            laws, residuals, information = self.fit_law(none, scatter.precision, law)
            law, residual = laws[0], residuals[0]
            scatter, wild = self.scatter.with_wild(residual), scatter.wild
            if scatter.wild == wild:
                break
        return Fit(
            (), (), (), law, residual, self.law_jacobian(law, self.compliance(law, none[0])),
            np.asarray(np.linalg.inv(information[0]), dtype=float), scatter,
            log_evidence=float(scatter.log_likelihood(residual)) + float(law_terms(law[None], information)[0]),
        )  # fmt: skip

    def score_subset(self, tables: Sequence[Table], free: tuple[int, ...], start: Fit) -> Fit | None:
        """Candidates with these components free (counted over all of them); None if one ends at zero or at its bound.

        Gauss-Newton, then Laplace's approximation.
        """
        owners = [(t, j) for t in tables for j in range(len(t.candidate.components))]
        chosen = [owners[i] for i in free]
        sizes = _starting_sizes(tables, start, chosen)
        law, scatter = start.law.copy(), start.scatter if start.tables else self.scatter
        for last in range(MOST_ROUNDS, -1, -1):
            converged = self._gauss_newton(tables, chosen, sizes, law, scatter.precision)
            if converged is None:
                return None
            law, residual, information, jacobian = converged
            again = self.scatter.with_wild(residual, scatter)
            if not last or again is scatter:
                break
            scatter = again
        covariance = np.asarray(scaled_inverse(information), dtype=float)
        deviations = np.sqrt(np.maximum(np.diag(covariance)[2:], 0.0))
        held = _pull_back(chosen, sizes) if len(tables) > 1 else []
        if held:  # the others once more beside them
            settled = self._gauss_newton(tables, [c for c in chosen if c not in held], sizes, law, scatter.precision)
            law, residual = (law, residual) if settled is None else settled[:2]
        own = [float(sizes[id(table)][j]) for table, j in chosen]
        possible = all(t.candidate.components[j].allows(size) for (t, j), size in zip(chosen, own, strict=True))
        if not possible and len(free) > 1:
            return None
        evidence = float(scatter.log_likelihood(residual)) - 0.5 * float(law @ law) / LAW_PRIOR**2
        evidence += -2.0 * np.log(LAW_PRIOR)
        return Fit(
            tuple(t.candidate for t in tables), tuple(sizes[id(t)] for t in tables), free, law, residual, jacobian,
            covariance, scatter, tables=tuple(tables),
            log_evidence=float(self._integrated(evidence, tables, chosen, own, deviations, information)),
            possible=possible,
        )  # fmt: skip

    def _integrated(
        self,
        evidence: float,
        tables: Sequence[Table],
        chosen: Sequence[tuple[Table, int]],
        own: Sequence[float],
        deviations: FloatArray,
        information: FloatArray,
    ) -> float:
        """The log posterior of law and sizes at its peak, `evidence`, integrated over them.

        `own` (p,) are the sizes, `deviations` (p,) their sd, `information` (2 + p, 2 + p).
        """
        if len(chosen) == 1:
            evidence -= 0.5 * np.linalg.slogdet(information[:2, :2])[1]
            # By quadrature, which holds for sizes next to nothing as well, with the profile as a parabola.
            table, j = chosen[0]
            return evidence + self.prior(table, j).log_mean_likelihood(own[0], float(deviations[0]))
        evidence -= 0.5 * np.linalg.slogdet(information)[1]
        evidence += 0.5 * len(chosen) * np.log(2.0 * np.pi)
        for table in tables:
            mine = [i for i, (owner, _) in enumerate(chosen) if owner is table]
            evidence += self._log_prior(
                table, [chosen[i][1] for i in mine], [own[i] for i in mine], deviations[mine].tolist()
            )
        return evidence

    def _log_prior(self, table: Table, components: list[int], sizes: list[float], sds: list[float]) -> float:
        """Log prior density of an effect's components: the strongest by itself, the others comparable to it."""
        if not components:
            return 0.0
        around = np.array([np.sign(size) * max(abs(size), sd) for size, sd in zip(sizes, sds, strict=True)])
        changes = np.array([self._rms_alone(table, j, size) for j, size in zip(components, around, strict=True)])
        first = int(np.argmax(changes))
        total = self.prior(table, components[first]).log_density_around(sizes[first], sds[first])
        for k, size in enumerate(around):
            if k != first:
                total += log_comparable(changes[k] / changes[first]) - np.log(abs(size))
        return total

    def _rms_alone(self, table: Table, j: int, size: float) -> float:
        """Rms change of ln stiffness by one component alone."""
        unit = np.zeros(len(table.candidate.components))
        unit[j] = size
        return float(np.sqrt(np.mean(self.sight.change(table.delta(unit)) ** 2)))

    def _gauss_newton(
        self,
        tables: Sequence[Table],
        chosen: Sequence[tuple[Table, int]],
        sizes: dict[int, FloatArray],
        law: FloatArray,
        precision: Precision,
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None:
        """Law, residual, information and jacobian after fitting the chosen sizes, in place; None where that fails."""
        prior = law_prior(2 + len(chosen))

        def added() -> FloatArray:
            return sum((t.delta(sizes[id(t)]) for t in tables), np.zeros(len(self.observed)))

        def equations(law: FloatArray) -> NormalEquations:
            part, by_law = self.predictor.strut_part_and_slopes(law)
            compliance = self._held(part + added())
            jacobian = np.empty((len(self.observed), 2 + len(chosen)))
            jacobian[:, :2] = (-by_law / compliance).T
            slopes = {id(t): t.slope(sizes[id(t)]) for t in tables}
            for i, (table, j) in enumerate(chosen):
                jacobian[:, 2 + i] = -slopes[id(table)][:, j] / compliance
            weighted = precision.times(jacobian.T)
            gradient = weighted @ (self.observed + np.log(compliance))
            gradient[:2] -= law / LAW_PRIOR**2
            return NormalEquations(jacobian, weighted @ jacobian + prior, gradient)

        def move(law: FloatArray, here: NormalEquations) -> tuple[FloatArray, FloatArray]:
            scale = here.scale
            step = np.linalg.solve(here.information / np.outer(scale, scale), here.gradient / scale) / scale
            if not np.isfinite(step).all():
                raise np.linalg.LinAlgError
            # A step may change no reading by more than half: beyond that the linearisation means nothing.
            step *= min(1.0, 0.5 / max(float(np.abs(here.jacobian @ step).max()), 1e-12))
            for i, (table, j) in enumerate(chosen):
                sizes[id(table)][j] += step[2 + i]
            return law + step[:2], step

        try:
            law, last = gauss_newton(law, equations, move, TABLE_STEPS, TABLE_TOLERANCE)
        except np.linalg.LinAlgError:
            return None
        return law, self.observed + np.log(self.compliance(law, added())), last.information, last.jacobian


def _starting_sizes(tables: Sequence[Table], start: Fit, chosen: Sequence[tuple[Table, int]]) -> dict[int, FloatArray]:
    """Id of a table -> its sizes where a fit begins: the chosen ones of an earlier fit of the same table, else 0."""
    sizes = {id(t): np.zeros(len(t.candidate.components)) for t in tables}
    known = {id(t): old for t, old in zip(start.tables, start.sizes, strict=True)} if start.free else {}
    for table, j in chosen:
        if id(table) in known:
            sizes[id(table)][j] = known[id(table)][j]
    return sizes


def _pull_back(chosen: Sequence[tuple[Table, int]], sizes: dict[int, FloatArray]) -> list[tuple[Table, int]]:
    """Those a little beyond their bounds, put onto them: tables of two effects describe neither exactly."""
    held = []
    for table, j in chosen:
        component, own = table.candidate.components[j], sizes[id(table)]
        if not component.allows(own[j]) and component.allows(own[j] / (1.0 + BEYOND)):
            own[j] = np.clip(own[j], *component.bounds)
            held.append((table, j))
    return held


def law_terms(laws: FloatArray, information: FloatArray) -> FloatArray:
    """(g,) log prior of the laws and Laplace's term for integrating them out."""
    penalty = -0.5 * (laws**2).sum(axis=-1) / LAW_PRIOR**2
    return np.asarray(penalty - 0.5 * np.linalg.slogdet(information)[1] - 2.0 * np.log(LAW_PRIOR))
