"""Two and three effects at once: all pairs of the catalogue searched, and triples that hold one of the best pairs.

The search is linear. With c the measured compliance, c_0 the model's and d_j what effect j adds per unit of its size,
c = c_0 + sum_j x_j d_j is exact for whatever gives way in series, however large: divided by c, the relative error of
c_0 is linear in the sizes. So columns and residual are projected beside strut law and nuisances once, and a pair, a
triple costs a few products of small matrices, all of them side by side: sizes within their bounds by coordinate
descent, Laplace's approximation of the evidence. The best few are then scored on their tables as single effects are.

Some hundred pairs and some five hundred triples are on offer: each pays for that with its share of the prior
(`inference.weigh`), and one of them has to leave no more than noise would, like every explanation.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.inference.candidates import Table, tabulate
from toolpath_stiff.inference.evidence import Fit, Problem, law_prior
from toolpath_stiff.inference.hypotheses import Family

SCORED = 8  # sets of effects whose tables are scored


SEEDS = 6  # pairs from which triples are grown


SWEEPS = 60  # of the coordinate descent


ROUNDS = 2  # searches, each without the readings that the best set of the one before takes for wild


NEGLIGIBLE = 1e-3  # whitened length of a component below which it counts as absent


# Laplace's term for a size under a prior that is flat in its logarithm from 0.5 to 30 %: ln(ln(60) / sqrt(2 pi)).
PER_SIZE = float(np.log(np.log(60.0) / np.sqrt(2.0 * np.pi)))


LARGE = (0.05, 0.15)  # rms change of ln stiffness at which an effect is large


STRAIGHT = 0.999  # correlation of what an effect adds at two sizes above which it grows in proportion


BLOCK = 4000  # sets that are searched side by side


@dataclass(frozen=True)
class Combination:
    """Two or three effects together."""

    names: tuple[str, ...]
    score: Fit
    log_evidence: float

    @property
    def name(self) -> str:
        """The effects: "a + b"."""
        return " + ".join(self.names)


@dataclass(frozen=True)
class Found:
    """Tables that go together in the linear search.

    Attributes
    ----------
    tables
        Their indices.
    sizes
        One array a table.
    score
        Approximate log evidence above that of no effect.
    """

    tables: tuple[int, ...]
    sizes: tuple[FloatArray, ...]
    score: float


def search_pairs(problem: Problem, families: Sequence[Family], base: Fit) -> tuple[list[Combination], LinearSearch]:
    """The pairs worth looking at, the most likely first, each pair of effects once; and the search, for triples."""
    search = LinearSearch.of(problem, families, base)
    pairs = np.array(
        [(i, j) for i, j in combinations(range(len(search.tables)), 2) if search.owner[i] != search.owner[j]],
        dtype=np.int64,
    ).reshape(-1, 2)
    found = search.best(pairs)
    return _scored(problem, search, base, found), search


def search_triples(problem: Problem, search: LinearSearch, base: Fit, only_better: bool = False) -> list[Combination]:
    """The triples worth looking at that hold one of the best pairs of the search.

    `only_better`: those that the linear search finds likelier than every pair; a pair explains the readings already.
    """
    least = search.ranked[0].score if only_better and search.ranked else -np.inf
    triples = {
        tuple(sorted((*pair.tables, k)))
        for pair in search.ranked[:SEEDS]
        for k in range(len(search.tables))
        if search.owner[k] not in {search.owner[i] for i in pair.tables}
    }
    found = search.best(np.array(sorted(triples), dtype=np.int64).reshape(-1, 3))
    return _scored(problem, search, base, [one for one in found if one.score > least])


@dataclass
class LinearSearch:
    """All tables' columns and the residual of the model, prepared once.

    Attributes
    ----------
    problem, base
        Data, and the model with its strut law refitted.
    tables, owner
        Tables of all effects, and the names of these; a table that bends with its size stands there several times.
    choices
        Name of an effect -> how many tables it has.
    low, high
        (tables, p) bounds of the sizes; both 0 where a table has fewer than p components.
    columns
        (tables, p, n) change of ln k per unit of size, at the measured compliance.
    ranked
        Of the last search, the best set of tables for each set of effects, the best first.
    """

    problem: Problem
    base: Fit
    tables: tuple[Table, ...]
    owner: tuple[str, ...]
    choices: dict[str, int]
    low: FloatArray
    high: FloatArray
    columns: FloatArray
    ranked: tuple[Found, ...] = ()

    @classmethod
    def of(cls, problem: Problem, families: Sequence[Family], base: Fit) -> LinearSearch:
        """Of all effects that do something to these data."""
        own = [
            (family.name, table, columns, bounds)
            for family in families
            for table in family.tables
            for columns, bounds in _linear_pieces(table, problem.base_compliance)
        ]
        most = max((columns.shape[1] for _, _, columns, _ in own), default=1)
        measured = np.exp(-problem.observed)
        low, high = np.zeros((len(own), most)), np.zeros((len(own), most))
        every = np.zeros((len(own), most, len(measured)))
        for k, (_, table, columns, bounds) in enumerate(own):
            count = columns.shape[1]
            # An instrument reads a factor on the whole compliance, which is the measured one.
            whole = problem.base_compliance if table.candidate.effect.is_instrument else measured
            every[k, :count] = -columns.T / whole
            low[k, :count], high[k, :count] = bounds.T
        return cls(
            problem, base, tuple(table for _, table, _, _ in own), tuple(name for name, _, _, _ in own),
            {family.name: len(family.tables) for family in families}, low, high, every,
        )  # fmt: skip

    def best(self, sets: IntArray) -> list[Found]:
        """The likeliest of sets of tables (k, m), one a set of effects, kept in `ranked`."""
        self.ranked = ()
        if not len(sets):
            return []
        # Of the model with its law refitted, at the measured compliance.
        residual = np.expm1(self.base.residual)
        law = self.base.jacobian[:, :2] * np.exp(self.base.residual)[:, None]
        prior, flat = law_prior(2), self.columns.reshape(-1, self.columns.shape[-1])
        scatter = self.problem.scatter
        for _ in range(ROUNDS):
            solved = scatter.precision.beside(law.T, prior).times(flat)
            self.ranked = tuple(self._ranked(sets, solved @ flat.T, solved @ residual))
            left = residual.copy()
            for table, sizes in zip(self.ranked[0].tables, self.ranked[0].sizes, strict=True):
                left -= sizes @ self.columns[table, : len(sizes)]
            weighted = scatter.precision.times(law.T)
            left -= law @ np.linalg.solve(weighted @ law + prior, weighted @ left)
            again = self.problem.scatter.with_wild(left, scatter)
            if again is scatter:
                break
            scatter = again
        return list(self.ranked)

    def _ranked(self, sets: IntArray, information: FloatArray, pull: FloatArray) -> list[Found]:
        """The best set of tables for each set of effects, the best first."""
        best: dict[tuple[str, ...], Found] = {}
        p = self.columns.shape[1]
        for start in range(0, len(sets), BLOCK):
            part = sets[start : start + BLOCK]
            at = (part[:, :, None] * p + np.arange(p)).reshape(len(part), -1)  # columns of each set
            sizes, scores = self._bounded(at, information, pull)
            for k in np.argsort(-scores, kind="stable").tolist():
                names = tuple(sorted(self.owner[t] for t in part[k]))
                if names in best and best[names].score >= scores[k]:
                    continue
                own = np.split(sizes[k], part.shape[1])
                counts = [self.tables[t].columns.shape[1] for t in part[k]]
                cut = tuple(x[:count].copy() for x, count in zip(own, counts, strict=True))
                best[names] = Found(tuple(part[k].tolist()), cut, float(scores[k]))
        return sorted(best.values(), key=lambda one: (-one.score, one.tables))

    def _bounded(self, at: IntArray, information: FloatArray, pull: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sizes (k, q) within their bounds that gain most, and scores (k,), of sets of columns (k, q)."""
        scale = np.sqrt(np.maximum(np.diag(information), 0.0))
        visible = scale > 0.0
        scale = np.where(visible, scale, np.inf)
        matrix = (information / scale / scale[:, None])[at[:, :, None], at[:, None, :]]
        wanted = (pull / scale)[at]
        with np.errstate(invalid="ignore"):
            low = np.where(visible, self.low.ravel() * scale, 0.0)[at]
            high = np.where(visible, self.high.ravel() * scale, 0.0)[at]
        sizes, rest = np.zeros(at.shape), wanted.copy()
        for _ in range(SWEEPS):
            for j in range(at.shape[1]):
                move = np.clip(sizes[:, j] + rest[:, j], low[:, j], high[:, j]) - sizes[:, j]
                sizes[:, j] += move
                rest -= matrix[:, :, j] * move[:, None]
        present = np.abs(sizes) > NEGLIGIBLE
        gains = (sizes * (wanted + rest)).sum(axis=1)
        both = present[:, :, None] & present[:, None, :]
        eye = np.eye(at.shape[1])
        volume = np.linalg.slogdet(np.where(both, matrix, eye) + 1e-9 * eye)[1]
        price = np.where(present, np.log(np.maximum(np.abs(sizes), 1.0)) + PER_SIZE, 0.0).sum(axis=1)
        subsets = np.log(2.0) * (high > low).sum(axis=1)
        # A set with an absent effect is a smaller set.
        parts = np.all(present.reshape(len(at), -1, self.columns.shape[1]).any(axis=2), axis=1)
        scores = 0.5 * gains - 0.5 * volume - price - subsets - self._choices(at)
        return sizes / scale[at], np.where(parts, scores, -np.inf)

    def _choices(self, at: IntArray) -> FloatArray:
        """(k,) log of the number of choices of the effects in each set."""
        logs = np.log([self.choices[name] for name in self.owner])
        p = self.columns.shape[1]
        return np.asarray(logs[at[:, ::p] // p].sum(axis=1))


def _linear_pieces(table: Table, compliance: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Columns (n, p) and bounds (p, 2) that stand for a table: small sizes, and what it adds per size at large ones.

    Where what an effect adds is not in proportion to its size, the second differs from the first.
    """
    components = table.candidate.components
    yield table.columns, np.array([c.bounds for c in components])
    for sign, (logs, ratios) in table.knots.items():
        rms = np.sqrt(np.mean((ratios * np.exp(logs)[:, None] / compliance) ** 2, axis=1))
        before = table.columns[:, 0]
        for wanted in LARGE:
            column = ratios[int(np.argmin(np.abs(np.log(rms / wanted))))]
            scale = np.linalg.norm(column / compliance)
            alike = float(column / compliance @ (before / compliance))
            if alike < STRAIGHT * scale * float(np.linalg.norm(before / compliance)):
                before = column
                bounds = [0.0, components[0].reach(sign)] if sign > 0.0 else [-components[0].reach(sign), 0.0]
                yield column[:, None], np.array([bounds])


def _scored(problem: Problem, search: LinearSearch, base: Fit, found: Sequence[Found]) -> list[Combination]:
    """The first of what the search found, fitted on tables; the most likely first."""
    scored = []
    for one in found[:SCORED]:
        if not np.isfinite(one.score):
            continue
        tables, sizes = _side_by_side(problem, [search.tables[t] for t in one.tables], one.sizes, base)
        fit = _likeliest_subset(problem, tables, sizes, base)
        if fit is None:
            continue
        names = tuple(search.owner[t] for t in one.tables)
        order = np.argsort(names, kind="stable")
        evidence = fit.log_evidence - sum(np.log(search.choices[name]) for name in names)
        scored.append(Combination(tuple(names[k] for k in order), fit, float(evidence)))
    return sorted(scored, key=lambda one: (-one.log_evidence, one.names))


def _side_by_side(
    problem: Problem, tables: Sequence[Table], sizes: Sequence[FloatArray], base: Fit
) -> tuple[list[Table], list[FloatArray]]:
    """Tables that may be added up, mechanical effects first: an instrument's acts on what the others have added."""
    order = sorted(range(len(tables)), key=lambda k: tables[k].candidate.effect.is_instrument)
    chosen = [tables[k] for k in order]
    known = [sizes[k] for k in order]
    for k, table in enumerate(chosen):
        if k and table.candidate.effect.is_instrument:
            beside = [one.candidate.active(_within(one, x)) for one, x in zip(chosen[:k], known[:k], strict=True)]
            chosen[k] = tabulate(table.candidate, problem.predictor, base.law, beside) or table
    return chosen, known


def _within(table: Table, sizes: FloatArray) -> FloatArray:
    """Sizes held to 0.9 of their bounds: at a bound the model may have no answer."""
    bounds = np.array([c.bounds for c in table.candidate.components])
    return np.clip(sizes, 0.9 * bounds[:, 0], 0.9 * bounds[:, 1])


def _likeliest_subset(problem: Problem, tables: Sequence[Table], sizes: Sequence[FloatArray], base: Fit) -> Fit | None:
    """The tables with those of their components that make the data most likely: from all, the faintest dropped."""
    ends = np.cumsum([0, *(len(x) for x in sizes)])
    start = [_within(table, x) for table, x in zip(tables, sizes, strict=True)]
    flat = np.concatenate(start)
    free = tuple(int(i) for i in np.flatnonzero(flat))
    weight = -sum(float(np.log(len(list(table.candidate.subsets())))) for table in tables)
    best: Fit | None = None

    def droppable(free: Iterable[int]) -> list[int]:
        owners = [int(np.searchsorted(ends, i, side="right")) for i in free]
        return [i for i, owner in zip(free, owners, strict=True) if owners.count(owner) > 1]

    while True:
        begin = [np.where(np.isin(np.arange(a, b), free), flat[a:b], 0.0) for a, b in pairwise(ends.tolist())]
        found = problem.score_subset(tables, free, replace(base, tables=tuple(tables), sizes=tuple(begin), free=free))
        good = found is not None and found.possible
        if found is not None and good:
            found = replace(found, log_evidence=found.log_evidence + weight)
            if best is not None and found.log_evidence <= best.log_evidence:
                return best
            best = found
        open_ones = droppable(free)
        if not open_ones:
            return best
        free = tuple(i for i in free if i != _faintest(found, free, open_ones, flat, problem, tables, ends))


def _faintest(
    found: Fit | None,
    free: tuple[int, ...],
    open_ones: Sequence[int],
    flat: FloatArray,
    problem: Problem,
    tables: Sequence[Table],
    ends: IntArray,
) -> int:
    """The component that would be missed least."""
    if found is not None:
        sizes = np.concatenate(found.sizes)
        return min(open_ones, key=lambda i: abs(float(sizes[i])) / max(found.deviation(i), 1e-300))

    def change(i: int) -> float:
        owner = int(np.searchsorted(ends, i, side="right")) - 1
        return float(np.abs(tables[owner].columns[:, i - ends[owner]] * flat[i] / problem.base_compliance).mean())

    return min(open_ones, key=change)
