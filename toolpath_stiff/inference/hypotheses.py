"""All candidates against the data: searched, grouped by effect, weighed against each other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.candidates import (
    LARGEST,
    LIKELY,
    SMALLEST,
    Candidate,
    Table,
    candidates_of,
    log_expected,
    log_usual,
    table_of,
)
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit, Problem
from toolpath_stiff.inference.gates import Forms, Structure, set_wild_aside
from toolpath_stiff.inference.minima import bounded_step
from toolpath_stiff.inference.tails import normal_below
from toolpath_stiff.stiffness.contract import Effect, Parameter

NOTHING = -1e9  # log evidence of what cannot be


@dataclass(frozen=True)
class Family:
    """One effect with everything that it may act on.

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
    tables: tuple[Table, ...]
    best: Fit | None
    log_evidence: float
    subsets: tuple[tuple[Fit, float], ...] = ()

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name


def score_family(problem: Problem, effect: Effect, base: Fit) -> Family | None:
    """Search one effect; None if it does nothing to these data."""
    tables, evidences = tables_of(problem, effect), []
    best: Fit | None = None
    subsets: tuple[tuple[Fit, float], ...] = ()
    for table in tables:
        scores = _scores(problem, table, base)
        for score, log_weight in scores:
            evidences.append(score.log_evidence + log_weight)
            if score.possible and (best is None or score.log_evidence > best.log_evidence):
                best = score
        if best is not None and best.tables[0] is table:
            subsets = tuple((score, log_weight) for score, log_weight in scores if score.possible)
    if not tables:
        return None
    total = float(np.logaddexp.reduce(evidences)) - np.log(len(tables)) if evidences else NOTHING
    return Family(effect, tuple(tables), best, total, subsets)


def _scores(problem: Problem, table: Table, base: Fit) -> list[tuple[Fit, float]]:
    """Fits of one candidate with the log prior weight of each subset of components."""
    if table.knots:
        return [(problem.score_single(table, base), 0.0)]
    subsets = list(table.candidate.subsets())
    weight, found, start = -float(np.log(len(subsets))), [], base
    for free in subsets:
        score = problem.score_subset([table], free, start)
        if score is not None:
            found.append((score, weight))
            # The next subset begins where this one has ended, with the readings that it takes for wild.
            start = score
    return found


def score_families(
    problem: Problem, effects: Iterable[Effect], base: Fit, progress: Callable[[str], None] | None = None
) -> list[Family]:
    """All effects that do something to these data, the most likely first."""
    found = []
    for effect in effects:
        if progress is not None:
            progress(effect.name)
        family = score_family(problem, effect, base)
        if family is not None:
            found.append(family)
    return sorted(found, key=lambda family: (-family.log_evidence, family.name))


def tables_of(problem: Problem, effect: Effect) -> list[Table]:
    """The tables of an effect, one a choice that does something to these data."""
    found = (table_of(candidate, problem.predictor) for candidate in candidates_of(effect, problem.predictor.data))
    return [table for table in found if table is not None]


def signatures(problem: Problem, tables: Iterable[Table]) -> list[list[FloatArray]]:
    """One-sided small-size signatures d ln k / d size of every candidate: subsets of columns (n, p), sizes >= 0."""
    found = []
    for table in tables:
        columns = -table.columns / problem.base_compliance[:, None]
        components = table.candidate.components
        if len(components) == 1:
            found.append([columns * sign for sign in components[0].signs])
        else:
            toward = np.array([c.signs[-1] for c in components])
            found.append([(columns * toward)[:, list(subset)] for subset in table.candidate.subsets()])
    return found


def probabilities(log_evidence: Mapping[str, float], prior: Mapping[str, float]) -> dict[str, float]:
    """Posterior of hypotheses from log evidences and prior weights (which need not sum to 1); none if all are out."""
    names = [name for name in log_evidence if prior.get(name, 0.0) > 0.0]
    logs = np.array([log_evidence[name] + np.log(prior[name]) for name in names])
    if not names or logs.max() <= 0.5 * NOTHING:
        return dict.fromkeys(log_evidence, 0.0)
    weights = np.exp(logs - logs.max())
    found = dict(zip(names, (weights / weights.sum()).tolist(), strict=True))
    return {name: found.get(name, 0.0) for name in log_evidence}


SHARE = 0.95


HALVINGS = 60  # of the bracket about a quantile


def averaged_interval(family: Family, j: int) -> FloatArray | None:
    """(2,) 95 % interval of the size of component `j`, over the subsets of components of the best choice.

    Normal within the bounds where a subset holds the component, 0 where it does not. None where the effect has no
    subsets.
    """
    if family.best is None or len(family.subsets) < 2:
        return None
    logs = np.array([score.log_evidence + weight for score, weight in family.subsets])
    shares = np.exp(logs - logs.max())
    shares /= shares.sum()
    low, high = family.best.candidates[0].components[j].bounds
    parts, absent = [], 0.0
    for (score, _), share in zip(family.subsets, shares, strict=True):
        if j in score.free:
            at = 2 + score.free.index(j)
            sd = float(np.sqrt(max(score.covariance[at, at], 1e-300)))
            parts.append((float(share), float(score.sizes[0][j]), sd))
        else:
            absent += float(share)
    if not parts:
        return np.zeros(2)
    far = max(abs(size) + 8.0 * sd for _, size, sd in parts)
    bracket = (max(low, -far), min(high, far))
    tail = 0.5 * (1.0 - SHARE)
    return np.array([_quantile(parts, absent, bracket, share) for share in (tail, 1.0 - tail)])


def _quantile(
    parts: list[tuple[float, float, float]], absent: float, bracket: tuple[float, float], share: float
) -> float:
    """Size up to which the mixture of cut-off normals (share, mean, sd) and of zero holds `share`."""

    def below(size: float) -> float:
        total = absent if size >= 0.0 else 0.0
        for part, mean, sd in parts:
            first, last, here = ((x - mean) / sd for x in (*bracket, size))
            start = normal_below(first)
            total += part * (normal_below(here) - start) / max(normal_below(last) - start, 1e-300)
        return total

    low, high = bracket
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if below(middle) < share else (low, middle)
    return 0.0 if abs(high) <= 1e-12 * (bracket[1] - bracket[0]) else high


AMPLITUDES = np.geomspace(0.003, 0.3, 9)  # rms of a discrepancy of ln k; as wide as the effects' own prior


FORMS = 5  # forms of discrepancy that are weighed, those that stick out most


def discrepancy_evidence(problem: Problem, score: Fit, forms: Forms) -> tuple[float, str]:
    """Log evidence of a fit plus a discrepancy of unknown form and amplitude, and the likeliest form.

    The gain over the fit alone is, for one form K and amplitude t, with P the projected inverse covariance and z = P r,

        -1/2 ln |1 + t^2 L^T P L| + 1/2 z^T L t^2 (1 + t^2 L^T P L)^-1 L^T z,      K = L L^T,

    averaged over amplitudes and forms.
    """
    projected = problem.projected(score.jacobian)
    taken = set_wild_aside(projected.times(score.residual[None]), projected, problem.scatter).taken
    structure = Structure(forms, projected)
    loads = structure.loads(score.residual[None], taken)
    gains = []
    order = np.argsort(structure.surprises(loads)[0])[::-1][:FORMS] if forms.names else np.zeros(0, dtype=int)
    for index in order.tolist():
        own, turn = np.linalg.eigh(structure.inner(index))
        own = np.maximum(own, 0.0)
        turned = (turn.T @ loads[0, forms.slices[index]]) ** 2
        squared = AMPLITUDES[:, None] ** 2
        each = -0.5 * np.log1p(squared * own).sum(axis=1) + 0.5 * (squared * turned / (1.0 + squared * own)).sum(axis=1)
        gains.append(float(np.logaddexp.reduce(each)) - np.log(len(AMPLITUDES)))
    if not gains:
        return score.log_evidence, ""
    likeliest = forms.names[int(order[int(np.argmax(gains))])]
    return score.log_evidence + float(np.logaddexp.reduce(gains)) - np.log(len(forms.names)), likeliest


CONFOUNDED = 0.95  # canonical correlation above which two effects cannot be told apart by these data


POWER_80 = 0.8416  # normal quantile of 80 % power


TIED = 1e-9  # share by which changes differ that are one and the same: of a factor and of its inverse


@dataclass(frozen=True)
class Confounding:
    """Largest canonical correlation of any two effects' signatures.

    Attributes
    ----------
    names
        Effects, ordered so that those of one set stand together.
    matrix
        (m, m) from 0 to 1.
    sets
        Sets of two and more effects, linked by correlations above `CONFOUNDED`.
    """

    names: tuple[str, ...]
    matrix: FloatArray
    sets: tuple[tuple[str, ...], ...]


def confounding(problem: Problem, families: Sequence[Family]) -> Confounding:
    """The confounding of effects on these data; for an effect with choices, that of its worst choice."""
    names = sorted(family.name for family in families)
    bases: dict[str, list[FloatArray]] = {}
    for family in families:
        bases[family.name] = []
        for table in family.tables:
            columns = problem.sight.projected.white((table.columns / problem.base_compliance[:, None]).T).T
            lengths = np.linalg.norm(columns, axis=0)
            if lengths.max() > 0.0:
                kept = columns[:, lengths > 1e-9 * lengths.max()] / lengths[lengths > 1e-9 * lengths.max()]
                bases[family.name].append(np.linalg.qr(kept)[0])
    matrix = np.eye(len(names))
    for i, first in enumerate(names):
        for j, second in enumerate(names[:i]):
            matrix[i, j] = matrix[j, i] = max(
                (float(np.linalg.norm(a.T @ b, 2)) for a in bases[first] for b in bases[second]), default=0.0
            )
    matrix = np.clip(matrix, 0.0, 1.0)
    sets = _linked(matrix > CONFOUNDED)
    # Sets first, each as a block; then the rest, every one next to what it resembles most.
    order = [i for group in sorted(sets, key=lambda group: (-len(group), group)) for i in group]
    return Confounding(
        tuple(names[i] for i in order),
        matrix[np.ix_(order, order)],
        tuple(tuple(names[i] for i in group) for group in sets if len(group) > 1),
    )


def _linked(close: NDArray[np.bool_]) -> list[list[int]]:
    """Connected components of a symmetric relation."""
    left, groups = set(range(len(close))), []
    while left:
        group, edge = set(), {min(left)}
        while edge:
            group |= edge
            edge = {j for i in edge for j in np.flatnonzero(close[i]).tolist()} - group
        groups.append(sorted(group))
        left -= group
    return groups


@dataclass(frozen=True)
class Detectable:
    """Smallest size of one parameter that these data would have shown.

    Attributes
    ----------
    effect, parameter
        Which.
    value
        SI value of the parameter at that size; nan if no size shows.
    rms
        Rms change of ln stiffness that it makes; the largest possible one if no size shows.
    seen
        Whether any size within the bounds would have been seen.
    """

    effect: str
    parameter: Parameter
    value: float
    rms: float
    seen: bool


def detectable_sizes(problem: Problem, families: Sequence[Family], gain_threshold: float) -> list[Detectable]:
    """Per parameter, the size seen with 80 % power at the threshold that the best of all candidates must pass.

    Of an effect with choices the choice that is hardest to see counts. Only the parameter itself differs from neutral.
    """
    wanted = np.sqrt(gain_threshold) + POWER_80
    found = []
    for family in sorted(families, key=lambda family: family.name):
        for j, component in enumerate(family.tables[0].candidate.components):
            worst: Detectable | None = None
            for table in family.tables:
                for sign in component.signs:
                    if table.knots and sign not in table.knots:
                        continue
                    one = _smallest(problem, table, j, sign, float(wanted))
                    # Hardest to see: not at all, else by the largest change; of two alike the first.
                    if worst is None or _harder(one, worst):
                        worst = one
            if worst is not None:
                found.append(worst)
    return found


def _harder(one: Detectable, other: Detectable) -> bool:
    return one.rms > (1.0 + TIED) * other.rms if one.seen == other.seen else not one.seen


def _smallest(problem: Problem, table: Table, j: int, sign: float, wanted: float) -> Detectable:
    component = table.candidate.components[j]
    prior = problem.prior(table, j)
    sizes = np.zeros((len(prior.log_sizes[sign]), len(table.candidate.components)))
    sizes[:, j] = sign * np.exp(prior.log_sizes[sign])
    change = problem.sight.change(table.delta(sizes))
    lengths = np.maximum.accumulate(problem.sight.length(change))
    rms = np.sqrt(np.mean(change**2, axis=1))
    name, parameter = table.candidate.name, component.parameter
    if lengths[-1] < wanted:
        return Detectable(name, parameter, float("nan"), float(rms[-1]), seen=False)
    log_size = float(np.interp(wanted, lengths, prior.log_sizes[sign]))
    at = float(np.interp(log_size, prior.log_sizes[sign], rms))
    return Detectable(name, parameter, component.value(sign * float(np.exp(log_size))), at, seen=True)


# Rms change of ln stiffness from which an effect matters; assumed: at 5 % of its stiffness the tip's deflection is off
# by less than the 10 % to which a cutting force is known.
MATTERS = 0.05


SIZES = 16  # a sign, between those that are tabulated


@dataclass(frozen=True)
class Unexcluded:
    """An effect that the readings neither show nor exclude beside an explanation.

    Attributes
    ----------
    effect, candidate, parameter
        Which; with the choice, and the parameter, that leaves it most room.
    value
        SI value of the parameter up to which the readings do not exclude it (95 %), its other parameters neutral.
    rms
        Rms change of the tip's ln stiffness that it makes there, on its own.
    left
        Rms of what strut law and explanation cannot take up of that.
    probability
        Of being there beside the explanation, at any size.
    """

    effect: Effect
    candidate: Candidate
    parameter: Parameter
    value: float
    rms: float
    left: float
    probability: float


@dataclass(frozen=True)
class _Room:
    """How far one size of a candidate may go beside an explanation; attributes as of `Unexcluded`.

    `mean` is that of the likelihood over the prior of the size, 1 where the readings say nothing.
    """

    table: Table
    component: int
    size: float
    rms: float
    left: float
    mean: float


def not_excluded(problem: Problem, families: Sequence[Family], fit: Fit, prior_odds: float) -> list[Unexcluded]:
    """Effects that may be there beside an explanation at a size that matters, the likeliest first.

    Parameters
    ----------
    problem, families
        Readings; all effects that do something to them.
    fit
        The explanation.
    prior_odds
        Of one certain further effect being there to none being there.
    """
    beside = _Beside(problem, fit)
    odds, widest = {}, {}
    for family in families:
        if family.name in fit.names:
            continue
        rooms = [
            beside.room(table, j)
            for table in family.tables
            for j in range(len(table.candidate.components))
            if table.columns[:, j].any()
        ]
        odds[family.name] = prior_odds * float(np.mean([room.mean for room in rooms]))
        widest[family.name] = max(rooms, key=lambda room: room.rms)
    whole = 1.0 + sum(odds.values())
    found = []
    for family in families:
        room = widest.get(family.name)
        if room is None or room.rms < MATTERS:
            continue
        candidate = room.table.candidate
        component = candidate.components[room.component]
        found.append(
            Unexcluded(family.effect, candidate, component.parameter, component.value(room.size), room.rms, room.left,
                       odds[family.name] / whole)
        )  # fmt: skip
    return sorted(found, key=lambda one: (-one.probability, one.effect.name))


class _Beside:
    """An explanation whose law and sizes move along with a further effect, within their bounds."""

    def __init__(self, problem: Problem, fit: Fit) -> None:
        self.problem, self.fit = problem, fit
        self.tip = problem.predictor.data.tip
        self.compliance = np.exp(fit.residual - problem.observed)
        self.precision = fit.scatter.precision
        self.weighted = self.precision.times(fit.jacobian.T)
        prior = np.zeros(fit.jacobian.shape[1])
        prior[:2] = LAW_PRIOR**-2
        self.information = self.weighted @ fit.jacobian + np.diag(prior)
        self.pull = -prior * np.concatenate([fit.law, np.zeros(len(prior) - 2)])
        sizes = [(c, x) for one, own in zip(fit.candidates, fit.sizes, strict=True)
                 for c, x in zip(one.components, own, strict=True)]  # fmt: skip
        free = [sizes[i] for i in fit.free]
        self.low = np.array([-np.inf] * 2 + [min(c.bounds[0] - x, 0.0) for c, x in free])
        self.high = np.array([np.inf] * 2 + [max(c.bounds[1] - x, 0.0) for c, x in free])

    def room(self, table: Table, j: int) -> _Room:
        """How far component `j` of a table may go."""
        least, none = self._moved(self.fit.residual[None])
        sides = [self._side(table, j, sizes, least[0], float(none[0])) for sizes in self._sizes(table, j)]
        lowest = min(float(none[0]), *(float(side.squares.min()) for side in sides))
        widest = max((side.widest(lowest + LIKELY) for side in sides), key=lambda one: one[1])
        # Of the prior, as far as sizes are expected; whether the readings would show them does not matter here.
        weights = [side.weights(table.candidate.components[j].typical()) for side in sides]
        whole = sum(float(one.sum()) for one in weights)
        gains = [np.exp(0.5 * (float(none[0]) - side.squares)) for side in sides]
        mean = sum(float(w @ gain) for w, gain in zip(weights, gains, strict=True)) / whole
        return _Room(table, j, *widest, mean)

    def _sizes(self, table: Table, j: int) -> Iterator[FloatArray]:
        """Sizes (g,) of each sign, rising."""
        component = table.candidate.components[j]
        for sign in component.signs:
            if table.knots:
                if sign in table.knots:
                    logs = table.knots[sign][0]
                    yield sign * np.exp(np.linspace(logs[0], logs[-1], SIZES))
                continue
            scale = float(np.sqrt(np.mean((table.columns[self.tip, j] / self.compliance[self.tip]) ** 2)))
            ends = np.minimum(np.array([SMALLEST, LARGEST]) / max(scale, 1e-300), component.reach(sign))
            yield sign * np.geomspace(min(ends[0], 0.1 * ends[1]), ends[1], SIZES)

    def _side(self, table: Table, j: int, sizes: FloatArray, least: FloatArray, none: float) -> _Side:
        """What sizes of one sign do; `least` (2 + p,) and `none` are the moves and squares without the effect."""
        every = np.zeros((len(sizes), len(table.candidate.components)))
        every[:, j] = sizes
        whole = self.problem.base_compliance if table.candidate.effect.is_instrument else self.compliance
        change = np.log1p(np.maximum(table.delta(every) / whole, -0.9))
        moves, squares = self._moved(self.fit.residual + change)
        left = change - (moves - least) @ self.fit.jacobian.T
        return _Side(sizes, _rms(change[:, self.tip]), _rms(left[:, self.tip]), squares, none)

    def _moved(self, residuals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Moves (g, 2 + p) of law and sizes that fit residuals (g, n) best, and the squares (g,) that are left."""
        gradient = residuals @ self.weighted.T + self.pull
        moves = np.linalg.solve(self.information, gradient.T).T
        for k in np.flatnonzero(((moves < self.low) | (moves > self.high)).any(axis=1)).tolist():
            moves[k] = bounded_step(self.information, gradient[k], self.low, self.high)
        squares = self.precision.squares(residuals) - 2.0 * (gradient * moves).sum(axis=1)
        return moves, squares + ((moves @ self.information) * moves).sum(axis=1)


def _rms(rows: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(rows**2, axis=1)))


@dataclass(frozen=True)
class _Side:
    """Sizes (g,) of one sign, rms change of each, rms left of it, squares; `none`: the squares without the effect."""

    sizes: FloatArray
    rms: FloatArray
    left: FloatArray
    squares: FloatArray
    none: float

    def widest(self, most: float) -> tuple[float, float, float]:
        """Size, rms and what is left at the largest size whose squares are at most `most`; between two by a line."""
        sizes, rms, left, squares = (
            np.concatenate([[start], values])
            for start, values in ((0.0, self.sizes), (0.0, self.rms), (0.0, self.left), (self.none, self.squares))
        )
        last = int(np.flatnonzero(squares <= most).max(initial=0))
        if last + 1 == len(sizes):
            return float(sizes[-1]), float(rms[-1]), float(left[-1])
        share = (most - squares[last]) / (squares[last + 1] - squares[last])
        share = float(np.clip(share, 0.0, 1.0))
        at = [float(one[last] + share * (one[last + 1] - one[last])) for one in (sizes, rms, left)]
        return at[0], at[1], at[2]

    def weights(self, typical: tuple[float, float]) -> FloatArray:
        """(g,) prior weights of the sizes, not normalised."""
        return np.asarray(
            np.exp(log_expected(self.rms) + log_usual(self.sizes, typical))
            * np.abs(np.gradient(np.log(np.abs(self.sizes))))
        )
