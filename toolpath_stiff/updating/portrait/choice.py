"""Which terms of the dictionary describe what is missing: few, chosen by likelihood, held to left-out points.

Terms are added one by one. A term joins where its gain is more than the best of the whole dictionary would reach by
chance (simulated from the noise model: look-elsewhere) and where the error at left-out points falls. What is added one
by one depends on where it began, and two or three terms that share one cause are easily begun with the wrong one: where
one term is not enough, the search begins anew at the other links that promise most, and the best description is taken.

Which link and which variable it is follows from all of these descriptions: of each, every term that may be the leading
one, and all that could stand in its place.

What else would look the same as an effect of the catalogue that is named as the answer.

A name of the catalogue is a part and a way in which it gives; where poses are few, a part that is in no catalogue may
give the same readings: without tilted poses a floor that rocks is a table that shifts. So each term of the dictionary
is put in the place of the named effect, the strut law refitted, and those that fit as well as it does are told.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.updating.inference.candidates import candidates_of
from toolpath_stiff.updating.inference.evidence import LAW_PRIOR, Fit, Problem
from toolpath_stiff.updating.inference.fits import HeldOut, held_out
from toolpath_stiff.updating.inference.noise import Noise
from toolpath_stiff.updating.portrait.dictionary import Entry, Ground, crossed
from toolpath_stiff.updating.portrait.selection import Description, Selection
from toolpath_stiff.updating.portrait.terms import CATALOGUE_LINKS, Term

MOST_TERMS, POINTS_EACH = 3, 6  # and points for each term but the first
LEADS = 0.01  # probability by chance below which the first term is taken for something
BETTER = 0.98  # share of the rms at left-out points to which a further term must bring it
BEGINNINGS = 3  # further links at which the search begins

# By how much likelihoods are flattened: the true shape is none of the dictionary's, so that what fits a little better
# is not that much likelier. Of a large effect the shape's error counts, which grows with the gain; assumed.
ROUGH, SHAPE = 2.5, 0.0015
FAINT = 0.02  # share below which a description, or a term as the leading one of it, is left out of the sums

# Odds beyond which what fits worse is not the same (strong evidence: Kass and Raftery 1995). A term that is one of many
# constants or places must fit better than the plainest ones by as much as its prior weight is smaller.
AS_WELL = float(np.log(20.0))
ITSELF = 0.99  # correlation from which a term of the same link is the named effect itself
MOST_TOLD, TOLD = 6, 0.03  # terms that are told, and the least share of one
HELD = 0.90  # share that the links and variables told add up to


@dataclass(frozen=True)
class Weighed:
    """Terms that may be the leading one, with their posterior probabilities, the likeliest first.

    Attributes
    ----------
    terms, weights
        N terms, (N,) probabilities.
    chosen
        (N,) whether in the place of the leading term of the description that was chosen.
    """

    terms: tuple[Term, ...]
    weights: FloatArray
    chosen: NDArray[np.bool_]

    def summed(self, of: Callable[[Term], str]) -> list[tuple[str, float]]:
        """Name -> probability summed over the terms, the likeliest first."""
        found: dict[str, float] = {}
        for term, weight in zip(self.terms, self.weights.tolist(), strict=True):
            found[of(term)] = found.get(of(term), 0.0) + weight
        return sorted(found.items(), key=lambda item: (-item[1], item[0]))


@dataclass(frozen=True)
class Chosen:
    """What was chosen.

    Attributes
    ----------
    description
        The terms, the leading one first.
    chance
        How often something as strong as the leading term comes up by chance.
    weighed
        What else may be the leading term.
    held
        Errors at left-out points.
    """

    description: Description
    chance: float
    weighed: Weighed
    held: HeldOut


def choose(selection: Selection) -> tuple[Chosen | None, float]:
    """One to three terms, none where nothing stands out from chance; and how often chance does as much."""
    start = selection.start
    if not len(selection.dictionary):
        return None, 1.0
    gains = selection.scores(start)
    chance, threshold = selection.chance(start, float(gains.max(initial=0.0)))
    begun = selection.grown(start)
    if chance > LEADS or begun is None:
        return None, chance
    found = [_completed(selection, begun, threshold)]
    if _searched(found[0]) > 1:
        others = _other_beginnings(selection, start, found[0].terms[0])
        found += [_completed(selection, other, threshold) for other in others]
    found = _different(sorted(found, key=lambda one: -_worth(one, threshold)))
    found = [_leading_first(selection, one) for one in found]
    return Chosen(found[0], chance, weigh(selection, found, threshold), _held(selection, found[0])), chance


# -- descriptions ------------------------------------------------------------------------------------------------------


def _completed(selection: Selection, begun: Description, threshold: float) -> Description:
    """With further terms as long as they join."""
    points = len(set(selection.problem.predictor.data.point.tolist()))
    found = _multiplied(selection, begun, 0, threshold)
    while len(found.terms) < min(MOST_TERMS, points // POINTS_EACH):
        more = _one_more(selection, found, threshold)
        if more is None:
            break
        found = more
    return found


def _one_more(selection: Selection, before: Description, threshold: float) -> Description | None:
    """With a further term, where it does more than chance and helps at left-out points."""
    if selection.scores(before).max() <= threshold:
        return None
    more = selection.grown(before)
    if more is None or 2.0 * (more.posterior - before.posterior) <= threshold:
        return None
    more = _swapped(selection, more)
    return more if _held(selection, more).rms <= BETTER * _held(selection, before).rms else None


def _multiplied(selection: Selection, description: Description, k: int, threshold: float) -> Description:
    """The k-th term times a shape of a second variable, under what is asked of a further term."""
    if description.terms[k].times is not None:
        return description
    before = selection.without(description, k)
    more = selection.multiplied(before, description, k)
    if more is None or 2.0 * (more.posterior - description.posterior) <= threshold:
        return description
    return more if _held(selection, more).rms <= BETTER * _held(selection, description).rms else description


def _swapped(selection: Selection, description: Description) -> Description:
    """The first term once more the best beside the others: it was chosen without them."""
    again = selection.grown(selection.without(description, 0))
    return again if again is not None and again.posterior > description.posterior else description


def _other_beginnings(selection: Selection, start: Description, first: Term) -> list[Description]:
    """Single terms of other links than that of `first` that promise most together with a further term."""
    entries = selection.finalists(selection.scores(start))
    posterior = selection.together(start, [entry.term for entry in entries]).posterior
    seen: set[tuple[str, str]] = set()
    outlook: list[tuple[float, Entry, Description]] = []
    for i in np.argsort(-posterior, kind="stable").tolist():
        entry = entries[i]
        kinds = {("link", entry.local.link), ("variable", entry.variable)}
        if entry.local.link == first.link or kinds <= seen:
            continue
        seen |= kinds
        begun = selection.extended(start, entry.term)
        gain = float(selection.scores(begun).max(initial=0.0))
        outlook.append((begun.posterior + 0.5 * gain, entry, begun))
    outlook.sort(key=lambda one: -one[0])
    links: dict[str, Description] = {}
    for _, entry, begun in outlook:
        links.setdefault(entry.local.link, begun)
    return [selection.settled(start, begun) for begun in list(links.values())[:BEGINNINGS]]


def _worth(description: Description, threshold: float) -> float:
    """Log posterior less what chance would gain by further terms and second variables."""
    return description.posterior - 0.5 * threshold * (_searched(description) - 1)


def _searched(description: Description) -> int:
    """How often the dictionary was searched for it: terms and second variables."""
    return len(description.terms) + sum(term.times is not None for term in description.terms)


def _different(descriptions: Sequence[Description]) -> list[Description]:
    """The first of those that differ by constants only."""
    found: dict[frozenset[tuple[object, ...]], Description] = {}
    for one in descriptions:
        kinds = frozenset((t.link, t.where, t.direction, t.variables, t.column, t.shape) for t in one.terms)
        found.setdefault(kinds, one)
    return list(found.values())


def _costs(selection: Selection, description: Description) -> FloatArray:
    """(p,) of log posterior that the absence of each term costs."""
    left = [selection.without(description, k).posterior for k in range(len(description.terms))]
    return description.posterior - np.array(left)


def _leading_first(selection: Selection, description: Description) -> Description:
    """Terms by what their absence would cost."""
    if len(description.terms) < 2:
        return description
    rows = np.argsort(-_costs(selection, description), kind="stable").tolist()
    return selection.described(
        [description.terms[k] for k in rows], description.columns[rows], description.scale[rows],
        description.fit.law, description.fit.scatter,
    )  # fmt: skip


def _held(selection: Selection, description: Description) -> HeldOut:
    return held_out(description.fit, selection.problem.predictor.data.point)


# -- what else it may be -----------------------------------------------------------------------------------------------


def temper(selection: Selection, description: Description, gain: float) -> float:
    """By how much less a likelihood is to be trusted where shapes are rough, for a gain in log likelihood."""
    squares = float(description.fit.scatter.precision.squares(description.fit.residual))
    left = squares / max(len(selection.compliance) - 2 - len(description.terms), 1)
    return ROUGH * max(left, 1.0) + SHAPE * max(gain, 0.0)


def weigh(selection: Selection, descriptions: Sequence[Description], threshold: float) -> Weighed:
    """Posterior probabilities of what may be the leading term, over descriptions, the chosen one first."""
    costs = [_costs(selection, one) for one in descriptions]
    flat = temper(selection, descriptions[0], float(costs[0].max()))
    terms: list[Term] = []
    logs: list[FloatArray] = []
    chosen: list[NDArray[np.bool_]] = []
    worths = np.array([one.posterior / flat - 0.5 * threshold * _searched(one) for one in descriptions])
    for number, (one, cost) in enumerate(zip(descriptions, costs, strict=True)):
        leads = np.exp((cost - cost.max()) / flat)
        leads /= leads.sum()
        for k in np.flatnonzero(leads >= FAINT).tolist():
            if np.exp(worths[number] - worths.max()) * leads[k] < FAINT and (number, k) != (0, 0):
                continue
            own, log = _in_place(selection, one, k, flat)
            terms += own
            logs.append(log - 0.5 * threshold * (_searched(one) - 1) + np.log(leads[k]))
            chosen.append(np.full(len(own), (number, k) == (0, 0)))
    every = np.concatenate(logs)
    weights = np.exp(every - every.max())
    order = np.argsort(-weights, kind="stable")
    return Weighed(
        tuple(terms[i] for i in order.tolist()), weights[order] / weights.sum(), np.concatenate(chosen)[order]
    )


def _in_place(selection: Selection, description: Description, k: int, flat: float) -> tuple[list[Term], FloatArray]:
    """Terms in the place of the k-th one, beside the others, with their flattened log posterior."""
    others = selection.scattered(selection.without(description, k), description)
    entries = selection.finalists(selection.scores(others)) + crossed(description.terms[k], selection.ground)
    entries = list({entry.term: entry for entry in entries}.values())
    found = selection.together(others, [entry.term for entry in entries])
    posterior = found.posterior + description.fit.scatter.log_price
    logs = posterior / flat + np.array([entry.log_prior for entry in entries])
    return [entry.term for entry in entries], np.where(np.abs(found.size[:, -1]) > 0.0, logs, -np.inf)


@dataclass(frozen=True)
class Alike:
    """Terms that fit as well as a named effect.

    Attributes
    ----------
    terms
        Term with its size and share, the best of each link, direction and variable, the likeliest first.
    links, variables
        Name -> share, the likeliest first, the fewest that hold 90 %.
    """

    terms: tuple[tuple[Term, float], ...]
    links: tuple[tuple[str, float], ...]
    variables: tuple[tuple[str, float], ...]


def looks_the_same(problem: Problem, base: Fit, named: Fit, noise: Noise, seed: int) -> Alike | None:
    """Terms of the dictionary that fit the readings as well as a named effect does; None where there are none.

    Parameters
    ----------
    problem, noise
        Readings, model and scatter; the noise model behind the scatter.
    base, named
        The model with its strut law refitted, without and with the named effect.
    seed
        Of the selection.
    """
    if len(named.candidates) != 1:  # no single term stands for two effects
        return None
    selection = Selection(problem, base, noise, seed)
    if not len(selection.dictionary):
        return None
    # Both under the scatter of the named fit, so that wild readings count alike.
    start = selection.start
    start = replace(start, fit=replace(start.fit, scatter=named.scatter))
    entries = selection.finalists(selection.scores(start))
    if not entries:
        return None
    terms = [entry.term for entry in entries]
    found = selection.together(start, terms)
    squares = float(start.fit.scatter.precision.squares(named.residual))
    reached = -0.5 * (squares + float(named.law @ named.law) / LAW_PRIOR**2) - _freedom(problem, named)
    prior = np.array([entry.log_prior for entry in entries])
    plainest = float(selection.dictionary.log_prior.max())
    same = (found.posterior + prior - plainest >= reached - AS_WELL) & (np.abs(found.size[:, -1]) > 0.0)
    change = np.exp(named.residual - problem.observed) - problem.predictor.strut_part(named.law) - problem.rest
    same &= ~_itself(selection.ground, terms, named, change)
    if not same.any():
        return None
    rows = np.flatnonzero(same)
    logs = found.posterior[rows] / ROUGH + prior[rows]
    weights = np.exp(logs - logs.max())
    order = np.argsort(-weights, kind="stable")
    sized = tuple(terms[i].sized(_size(selection, terms[i], float(found.size[i, -1]))) for i in rows[order].tolist())
    weighed = Weighed(sized, weights[order] / weights.sum(), np.ones(len(rows), dtype=bool))
    return Alike(
        _told(weighed),
        _fewest(weighed.summed(lambda term: term.link)),
        _fewest(weighed.summed(lambda term: term.variable)),
    )


def _freedom(problem: Problem, named: Fit) -> float:
    """Log likelihood that an effect gains by its further sizes (Schwarz 1978) and by a choice, which a term has not."""
    data = problem.predictor.data
    choices = len(candidates_of(named.candidates[0].effect, data))
    return 0.5 * (len(named.free) - 1) * float(np.log(len(data))) + float(np.log(max(choices, 1)))


def _size(selection: Selection, term: Term, scaled: float) -> float:
    """SI size of a term from its rms change of compliance."""
    return scaled / float(np.sqrt(np.mean((selection.ground.column(term) / selection.compliance) ** 2)))


def _itself(ground: Ground, terms: list[Term], named: Fit, change: FloatArray) -> NDArray[np.bool_]:
    """(G,) whether a term is what the named effect does, in its own link; `change` (n,) m/N is what it adds."""
    links = {candidate.effect.link for candidate in named.candidates}
    own = [CATALOGUE_LINKS.get(term.link, term.link) in links for term in terms]
    return np.array(
        [mine and _correlation(ground.column(t), change) > ITSELF for t, mine in zip(terms, own, strict=True)]
    )


def _correlation(first: FloatArray, second: FloatArray) -> float:
    norm = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / norm if norm > 0.0 else 0.0


def _told(weighed: Weighed) -> tuple[tuple[Term, float], ...]:
    """The best of each link, direction and variable, with the shares of all of them."""
    best: dict[tuple[str, str, str], Term] = {}
    shares: dict[tuple[str, str, str], float] = {}
    for term, weight in zip(weighed.terms, weighed.weights.tolist(), strict=True):
        kind = (term.link, term.direction, term.variable)
        best.setdefault(kind, term)
        shares[kind] = shares.get(kind, 0.0) + weight
    ranked = sorted(shares.items(), key=lambda item: -item[1])
    return tuple((best[kind], share) for kind, share in ranked[:MOST_TOLD] if share >= TOLD)


def _fewest(summed: list[tuple[str, float]]) -> tuple[tuple[str, float], ...]:
    """The fewest that hold `HELD`."""
    count = 1 + int(np.searchsorted(np.cumsum([share for _, share in summed]), HELD - 1e-9))
    return tuple(summed[:count])
