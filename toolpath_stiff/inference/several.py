"""Two effects at once: a search of all pairs of the catalogue.

The search is linear. With c the measured compliance, c_0 the model's and d_j what effect j adds per unit of its size,
c = c_0 + sum_j x_j d_j is exact for whatever gives way in series, however large: divided by c, the relative error of
c_0 is linear in the sizes. So columns and residual are projected beside strut law and nuisances once, and a pair
costs a few products of small matrices, all of them side by side: sizes within their bounds by coordinate
descent, Laplace's approximation of the evidence. The best few are then scored on their tables as single effects are.

Some hundred pairs are on offer: each pays for that with its share of the prior
(`inference.weigh`), and one of them has to leave no more than noise would, like every explanation.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.inference.candidates import CandidateTable, tabulate
from toolpath_stiff.inference.evidence import Fit, Problem, law_prior
from toolpath_stiff.inference.hypotheses import Family
from toolpath_stiff.inference.size_priors import FADES, VISIBLE

SCORED = 8  # sets of effects whose tables are scored
SWEEPS = 60  # of the coordinate descent
ROUNDS = 2  # searches, each without the readings that the best set before it takes to be wild
NEGLIGIBLE = 1e-3  # whitened length of a component below which it counts as absent
# Laplace's term for a size under a prior that is flat in its logarithm from 0.5 to 30 %: ln(ln(60) / sqrt(2 pi)).
PER_SIZE = float(np.log(np.log(60.0) / np.sqrt(2.0 * np.pi)))
LARGE = (0.05, 0.15)  # rms change of ln stiffness at which an effect is large
STRAIGHT = 0.999  # correlation of an effect's contributions at two sizes above which it counts as linear


@dataclass(frozen=True)
class TableSet:
    """A set of tables, one an effect, as the linear search ranks it.

    Attributes
    ----------
    tables, sizes
        Indices of the tables, and the sizes of their components, one array each.
    score
        Log evidence above that of no effect, about.
    """

    tables: tuple[int, ...]
    sizes: tuple[FloatArray, ...]
    score: float


def search_pairs(problem: Problem, families: Sequence[Family], base: Fit) -> list[Fit]:
    """Pairs of effects worth a closer look, the most likely first, each pair once."""
    search = LinearSearch(problem, families, base)
    owner = np.array(search.owner)
    pairs = np.stack(np.triu_indices(len(owner), 1), axis=1)
    search.search(pairs[owner[pairs[:, 0]] != owner[pairs[:, 1]]])
    return search.scored()


class LinearSearch:
    """Columns of all tables and the model's residual, prepared once.

    Attributes
    ----------
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

    def __init__(self, problem: Problem, families: Sequence[Family], base: Fit) -> None:
        self.problem, self.base = problem, base
        self.choices = {family.name: len(family.tables) for family in families}
        self.ranked: list[TableSet] = []
        pieces = [
            (table, columns, bounds)
            for family in families
            for table in family.tables
            for columns, bounds in _linear_pieces(table, problem.base_compliance)
        ]
        self.tables = tuple(table for table, _, _ in pieces)
        self.owner = tuple(table.candidate.name for table in self.tables)
        measured = np.exp(-problem.observed)
        shape = len(pieces), max((columns.shape[1] for _, columns, _ in pieces), default=1)
        self.low, self.high, self.columns = np.zeros(shape), np.zeros(shape), np.zeros((*shape, len(measured)))
        for k, (table, columns, bounds) in enumerate(pieces):
            count = columns.shape[1]
            # An instrument is a factor on the model's compliance: at the refitted law, as are the law's columns.
            refitted = problem.base_compliance * np.exp(-base.residual)
            whole = refitted if table.candidate.effect.is_instrument else measured
            self.columns[k, :count] = -columns.T / whole
            self.low[k, :count], self.high[k, :count] = bounds.T

    def search(self, sets: IntArray) -> None:
        """Rank sets of tables (k, m), one for each set of effects, into `ranked`."""
        self.ranked = []
        if not len(sets):
            return
        # Residual of the model with its law refitted, at the measured compliance.
        residual = np.expm1(self.base.residual)
        law = self.base.jacobian[:, :2] * np.exp(self.base.residual)[:, None]
        prior, flat = law_prior(2), self.columns.reshape(-1, self.columns.shape[-1])
        scatter = self.problem.scatter
        for _ in range(ROUNDS):
            solved = scatter.precision.beside(law.T, prior).times(flat)
            self.ranked = self._ranked(sets, solved @ flat.T, solved @ residual)
            left = residual.copy()
            for table, sizes in zip(self.ranked[0].tables, self.ranked[0].sizes, strict=True):
                left -= sizes @ self.columns[table, : len(sizes)]
            weighted = scatter.precision.times(law.T)
            left -= law @ np.linalg.solve(weighted @ law + prior, weighted @ left)
            again = self.problem.scatter.with_wild(left, scatter)
            if again is scatter:
                break
            scatter = again

    def _ranked(self, sets: IntArray, information: FloatArray, pull: FloatArray) -> list[TableSet]:
        """Best set of tables for each set of effects, the best first."""
        best: dict[tuple[str, ...], TableSet] = {}
        p = self.columns.shape[1]
        rows = (sets[:, :, None] * p + np.arange(p)).reshape(len(sets), -1)  # columns of each set
        sizes, scores = self._bounded(rows, information, pull)
        for k in np.argsort(-scores, kind="stable").tolist():
            tables = tuple(sets[k].tolist())
            names = tuple(sorted(self.owner[t] for t in tables))
            if names not in best:
                each = zip(tables, np.split(sizes[k], len(tables)), strict=True)
                cut = tuple(x[: self.tables[t].columns.shape[1]].copy() for t, x in each)
                best[names] = TableSet(tables, cut, float(scores[k]))
        return sorted(best.values(), key=lambda ranked: (-ranked.score, ranked.tables))

    def _bounded(self, rows: IntArray, information: FloatArray, pull: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sizes (k, q) of sets of columns (k, q) that gain most within their bounds, and scores (k,)."""
        scale = np.sqrt(np.maximum(np.diag(information), 0.0))
        visible = scale > 0.0
        scale = np.where(visible, scale, np.inf)
        matrix = (information / scale / scale[:, None])[rows[:, :, None], rows[:, None, :]]
        wanted = (pull / scale)[rows]
        with np.errstate(invalid="ignore"):
            low = np.where(visible, self.low.ravel() * scale, 0.0)[rows]
            high = np.where(visible, self.high.ravel() * scale, 0.0)[rows]
        sizes, rest, eye = np.zeros(rows.shape), wanted.copy(), np.eye(rows.shape[1])
        for _ in range(SWEEPS):
            for j in range(rows.shape[1]):
                move = np.clip(sizes[:, j] + rest[:, j], low[:, j], high[:, j]) - sizes[:, j]
                sizes[:, j] += move
                rest -= matrix[:, :, j] * move[:, None]
        present = np.abs(sizes) > NEGLIGIBLE
        gains = (sizes * (wanted + rest)).sum(axis=1)
        # Of two equal columns the readings tell only the sum: each is then known no better than its own size.
        known, extent = np.where(present[:, :, None] & present[:, None, :], matrix, eye), np.maximum(np.abs(sizes), 1.0)
        volume = np.linalg.slogdet(known + eye * (present / extent**2)[:, None])[1]
        price = np.where(present, np.log(extent) + PER_SIZE, 0.0).sum(axis=1)
        p = self.columns.shape[1]
        price += np.log(2.0) * (high > low).sum(axis=1)  # of subsets of components, then of choices
        price += np.log([self.choices[name] for name in self.owner])[rows[:, ::p] // p].sum(axis=1)
        strongest = np.abs(sizes).reshape(len(rows), -1, p).max(axis=2)  # too faint to be seen: none of its own
        price += 0.5 * ((np.maximum(VISIBLE - strongest, 0.0) / FADES) ** 2).sum(axis=1)
        # A set with an absent effect is a smaller set.
        whole = np.all(present.reshape(len(rows), -1, p).any(axis=2), axis=1)
        return sizes / scale[rows], np.where(whole, 0.5 * gains - 0.5 * volume - price, -np.inf)

    def scored(self) -> list[Fit]:
        """The best sets found, fitted on tables; the most likely first, after the price for the number on offer."""
        fits = []
        for ranked in self.ranked[:SCORED]:
            fit = self._likeliest_subset(*self._side_by_side(ranked)) if np.isfinite(ranked.score) else None
            if fit is not None:
                price = sum(np.log(self.choices[self.owner[t]]) for t in ranked.tables)
                fits.append(replace(fit, log_evidence=float(fit.log_evidence - price)))
        return sorted(fits, key=lambda fit: (-fit.log_evidence, fit.name))

    def _side_by_side(self, ranked: TableSet) -> tuple[list[CandidateTable], FloatArray]:
        """Tables that can be added up, with their sizes: an instrument's is made on top of the effects before it.

        Sizes are held to 0.9 of their bounds: at a bound the model may have no answer.
        """
        known: list[tuple[CandidateTable, FloatArray]] = []
        parts = [(self.tables[t], sizes) for t, sizes in zip(ranked.tables, ranked.sizes, strict=True)]
        for given, sizes in sorted(parts, key=lambda part: part[0].candidate.effect.is_instrument):
            table, bounds = given, np.array([component.bounds for component in given.candidate.components])
            if known and given.candidate.effect.is_instrument:
                beside = [other.candidate.active(held) for other, held in known]
                table = tabulate(given.candidate, self.problem.predictor, self.base.law, beside) or given
            known.append((table, np.clip(sizes, 0.9 * bounds[:, 0], 0.9 * bounds[:, 1])))
        return [table for table, _ in known], np.concatenate([sizes for _, sizes in known])

    def _likeliest_subset(self, tables: Sequence[CandidateTable], sizes: FloatArray) -> Fit | None:
        """Fit of the tables with the likeliest subset of components: from all, the faintest dropped one by one."""
        weight = -sum(float(np.log(len(list(table.candidate.subsets())))) for table in tables)
        owners = np.repeat(np.arange(len(tables)), [len(table.candidate.components) for table in tables]).tolist()
        columns = np.concatenate([table.columns for table in tables], axis=1)
        free = tuple(np.flatnonzero(sizes).tolist())
        best: Fit | None = None
        while True:
            fit = self.problem.score_subset(tables, free, self.base, sizes)
            if fit is not None and fit.possible:
                fit = replace(fit, log_evidence=fit.log_evidence + weight)
                if best is not None and fit.log_evidence <= best.log_evidence:
                    return best
                best = fit
            counts = Counter(owners[i] for i in free)
            droppable = [i for i in free if counts[owners[i]] > 1]
            if not droppable:
                return best
            if fit is not None:  # drop the component that would be missed least
                faint = {abs(fit.parts[i][1]) / max(fit.deviation(i), 1e-300): i for i in reversed(droppable)}
            else:
                changes = np.abs(columns * sizes / self.problem.base_compliance[:, None]).mean(axis=0)
                faint = {float(changes[i]): i for i in reversed(droppable)}
            free = tuple(i for i in free if i != faint[min(faint)])


def _linear_pieces(table: CandidateTable, compliance: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Columns (n, p) and bounds (p, 2) that linearise a table: at small sizes, and secants at large ones.

    Where what an effect adds is not in proportion to its size, the second differs from the first.
    """
    components = table.candidate.components
    yield table.columns, np.array([c.bounds for c in components])
    for sign, (logs, ratios) in table.knots.items():
        shares, before = ratios / compliance, table.columns[:, 0] / compliance
        rms = np.sqrt(np.mean((shares * np.exp(logs)[:, None]) ** 2, axis=1))
        reach = components[0].reach(sign)
        for wanted in LARGE:
            k = int(np.argmin(np.abs(np.log(rms / wanted))))
            if float(shares[k] @ before) < STRAIGHT * float(np.linalg.norm(shares[k]) * np.linalg.norm(before)):
                before = shares[k]
                yield ratios[k][:, None], np.array([[0.0, reach] if sign > 0.0 else [-reach, 0.0]])
