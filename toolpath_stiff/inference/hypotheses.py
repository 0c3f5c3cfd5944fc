"""All candidates against the data: searched, grouped by effect, weighed against each other."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.candidates import CandidateTable, candidates_of, table_of
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.gates import Forms, FormStatistics, set_wild_aside
from toolpath_stiff.stiffness.contract import Effect

NOTHING = -1e9  # log evidence of an impossible hypothesis


@dataclass(frozen=True)
class Family:
    """One effect with all its choices.

    Attributes
    ----------
    effect
        The effect.
    tables
        One a choice that does something to these data.
    best
        The best fit whose sizes lie within their bounds; None if every fit ends at nothing.
    log_evidence
        Averaged over choices and subsets of components: a choice of six costs ln 6.
    subsets
        Fits of the choice of `best` with each subset of components that is possible, and their log prior weights.
    """

    effect: Effect
    tables: tuple[CandidateTable, ...]
    best: Fit | None
    log_evidence: float
    subsets: tuple[tuple[Fit, float], ...] = ()

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name


def score_family(problem: Problem, effect: Effect, base: Fit) -> Family | None:
    """Search of one effect; None if it has no effect on these data."""
    tables, evidences = tables_of(problem, effect), []
    best: Fit | None = None
    subsets: tuple[tuple[Fit, float], ...] = ()
    for table in tables:
        fits = _fits_of_subsets(problem, table, base)
        evidences += [fit.log_evidence + log_weight for fit, log_weight in fits]
        possible = [(fit, log_weight) for fit, log_weight in fits if fit.possible]
        likeliest = max((fit for fit, _ in possible), key=lambda fit: fit.log_evidence, default=None)
        if likeliest is not None and (best is None or likeliest.log_evidence > best.log_evidence):
            best, subsets = likeliest, tuple(possible)
    if not tables:
        return None
    total = float(np.logaddexp.reduce(evidences)) - np.log(len(tables)) if evidences else NOTHING
    return Family(effect, tuple(tables), best, total, subsets)


def _fits_of_subsets(problem: Problem, table: CandidateTable, base: Fit) -> list[tuple[Fit, float]]:
    """Fits of one candidate, with the log prior weight of each subset of components."""
    subsets, fits = list(table.candidate.subsets()), []
    start, sizes = base, None
    for free in subsets:
        fit = problem.score_subset([table], free, start, sizes)
        if fit is not None:
            fits.append((fit, -float(np.log(len(subsets)))))
            # The next subset starts from this one's result and its wild readings.
            start, sizes = fit, fit.sizes[0]
    return fits


def score_families(problem: Problem, effects: Iterable[Effect], base: Fit) -> list[Family]:
    """All effects that change these data, the most likely first."""
    families = filter(None, (score_family(problem, effect, base) for effect in effects))
    return sorted(families, key=lambda family: (-family.log_evidence, family.name))


def tables_of(problem: Problem, effect: Effect) -> list[CandidateTable]:
    """Tables of an effect, one for each choice that changes these data."""
    tables = (table_of(candidate, problem.predictor) for candidate in candidates_of(effect, problem.predictor.data))
    return list(filter(None, tables))


def signatures(problem: Problem, tables: Iterable[CandidateTable]) -> list[list[FloatArray]]:
    """One-sided small-size signatures d ln k / d size of every candidate: subsets of columns (n, p), sizes >= 0."""
    signs = []
    for table in tables:
        columns, components = -table.columns / problem.base_compliance[:, None], table.candidate.components
        if len(components) == 1:
            signs.append([columns * sign for sign in components[0].signs])
        else:
            toward = columns * np.array([c.signs[-1] for c in components])
            signs.append([toward[:, list(subset)] for subset in table.candidate.subsets()])
    return signs


def probabilities(log_evidence: Mapping[str, float], prior: Mapping[str, float]) -> dict[str, float]:
    """Posterior probabilities from log evidences and prior weights (need not sum to 1); empty if all are excluded."""
    names = [name for name in log_evidence if prior.get(name, 0.0) > 0.0]
    logs = np.array([log_evidence[name] + np.log(prior[name]) for name in names])
    if not names or logs.max() <= 0.5 * NOTHING:
        return dict.fromkeys(log_evidence, 0.0)
    weights = np.exp(logs - logs.max())
    posterior = dict(zip(names, (weights / weights.sum()).tolist(), strict=True))
    return {name: posterior.get(name, 0.0) for name in log_evidence}


TAILS = (0.025, 0.975)  # of a 95 % interval
POINTS = 2000  # points that represent a normal distribution


def averaged_interval(family: Family, j: int) -> FloatArray | None:
    """(2,) 95 % interval of the size of component `j`, over the subsets of components of the best choice.

    Normal within the bounds where a subset holds the component, 0 where it does not. None where the effect has no
    subsets.
    """
    from scipy.special import ndtri

    if family.best is None or len(family.subsets) < 2:
        return None
    logs = np.array([fit.log_evidence + weight for fit, weight in family.subsets])
    deviates = ndtri((np.arange(POINTS) + 0.5) / POINTS)
    spread = [fit.sizes[0][j] + fit.deviation(j) * deviates for fit, _ in family.subsets]
    sizes = np.clip(np.concatenate(spread), *family.best.candidates[0].components[j].bounds)
    order, weights = np.argsort(sizes, kind="stable"), np.repeat(np.exp(logs - logs.max()), POINTS)
    below = np.cumsum(weights[order])
    return np.asarray(sizes[order][np.searchsorted(below, np.array(TAILS) * below[-1])])


AMPLITUDES = np.geomspace(0.003, 0.3, 9)  # rms of a discrepancy of ln k; as wide as the effects' own prior
FORMS = 5  # forms of discrepancy that are weighed: the most conspicuous


def discrepancy_evidence(problem: Problem, score: Fit, forms: Forms) -> tuple[float, str]:
    """Log evidence of a fit plus a discrepancy of unknown form and amplitude, and the likeliest form.

    The gain over the fit alone is, for one form K and amplitude t, with P the projected inverse covariance and z = P r,

        -1/2 ln |1 + t^2 L^T P L| + 1/2 z^T L t^2 (1 + t^2 L^T P L)^-1 L^T z,      K = L L^T,

    averaged over amplitudes and forms.
    """
    if not forms.names:
        return score.log_evidence, ""
    projected = problem.projected(score.jacobian)
    _, taken = set_wild_aside(projected.times(score.residual[None]), projected, problem.scatter)
    structure = FormStatistics(forms, projected)
    loads = structure.loads(score.residual[None] - taken)
    order = np.argsort(structure.surprises(loads)[0])[::-1][:FORMS].tolist()
    gains = []
    for index in order:
        values, turn = np.linalg.eigh(structure.inner(index))
        turned = (turn.T @ loads[0, forms.slices[index]]) ** 2
        squared, widths = AMPLITUDES[:, None] ** 2, 1.0 + AMPLITUDES[:, None] ** 2 * np.maximum(values, 0.0)
        each = 0.5 * (squared * turned / widths).sum(axis=1) - 0.5 * np.log(widths).sum(axis=1)
        gains.append(float(np.logaddexp.reduce(each)) - np.log(len(AMPLITUDES)))
    gain = float(np.logaddexp.reduce(gains)) - np.log(len(forms.names))
    return score.log_evidence + gain, forms.names[order[int(np.argmax(gains))]]
