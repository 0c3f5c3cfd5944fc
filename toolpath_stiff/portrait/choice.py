"""Which terms of the dictionary describe what is missing: few, chosen by likelihood, held to left-out points.

Terms are added one by one. A term joins where its gain is more than the best of the whole dictionary would reach by
chance (simulated from the noise model: look-elsewhere) and where the error at left-out points falls. What is added one
by one depends on where it began, and two or three terms that share one cause are easily begun with the wrong one: where
one term is not enough, the search begins anew at the other links that promise most, and the best description is taken.

Which link and which variable it is follows from all of these descriptions: of each, every term that may be the leading
one, and all that could stand in its place.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.left_out import HeldOut, held_out
from toolpath_stiff.portrait.dictionary import Entry, crossed
from toolpath_stiff.portrait.selection import Description, Selection
from toolpath_stiff.stiffness.terms import Term

MOST_TERMS, POINTS_EACH = 3, 6  # and points for each term but the first


LEADS = 0.01  # probability by chance below which the first term is taken for something


BETTER = 0.98  # share of the rms at left-out points to which a further term must bring it


BEGINNINGS = 3  # further links at which the search begins


# By how much likelihoods are flattened: the true shape is none of the dictionary's, so that what fits a little better
# is not that much likelier. Of a large effect the shape's error counts, which grows with the gain; assumed.
ROUGH, SHAPE = 2.5, 0.0015


HELD = 0.90  # probability that a set of links or variables adds up to


FAINT = 0.02  # share below which a description, or a term as the leading one of it, is left out of the sums


Leading = tuple[Term, float, bool]  # may be the leading term; its probability; whether it was tried in the chosen one


def summed(leading: Sequence[Leading], of: Callable[[Term], str]) -> list[tuple[str, float]]:
    """Name -> probability summed over the terms, the likeliest first."""
    sums: dict[str, float] = {}
    for term, weight, _ in leading:
        sums[of(term)] = sums.get(of(term), 0.0) + weight
    return sorted(sums.items(), key=lambda item: (-item[1], item[0]))


def fewest(summed: Sequence[tuple[str, float]]) -> tuple[tuple[str, float], ...]:
    """The fewest names that hold `HELD` of the probability."""
    count = 1 + int(np.searchsorted(np.cumsum([share for _, share in summed]), HELD - 1e-9))
    return tuple(summed[:count])


@dataclass(frozen=True)
class Chosen:
    """What was chosen.

    Attributes
    ----------
    description
        The terms, the leading one first.
    leading
        What else may be the leading term, with posterior probabilities, the likeliest first.
    held
        Errors at left-out points.
    """

    description: Description
    leading: list[Leading]
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
    descriptions = [_completed(selection, begun, threshold)]
    if _searched(descriptions[0]) > 1:
        others = _other_beginnings(selection, start, descriptions[0].terms[0])
        descriptions += [_completed(selection, other, threshold) for other in others]
    descriptions = _different(sorted(descriptions, key=lambda description: -_worth(description, threshold)))
    descriptions = [_leading_first(selection, description) for description in descriptions]
    leading = weigh(selection, descriptions, threshold)
    return Chosen(descriptions[0], leading, _held(selection, descriptions[0])), chance


def _completed(selection: Selection, begun: Description, threshold: float) -> Description:
    """With further terms as long as they join."""
    points = len(set(selection.problem.predictor.data.point.tolist()))
    description = _multiplied(selection, begun, 0, threshold)
    while len(description.terms) < min(MOST_TERMS, points // POINTS_EACH):
        more = _one_more(selection, description, threshold)
        if more is None:
            break
        description = more
    return description


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
    outlook.sort(key=lambda prospect: -prospect[0])
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
    kept: dict[frozenset[tuple[object, ...]], Description] = {}
    for description in descriptions:
        kinds = frozenset((t.link, t.where, t.direction, t.variables, t.column, t.shape) for t in description.terms)
        kept.setdefault(kinds, description)
    return list(kept.values())


def _costs(selection: Selection, description: Description) -> FloatArray:
    """(p,) of log posterior that the absence of each term costs."""
    left = [selection.without(description, k).posterior for k in range(len(description.terms))]
    return description.posterior - np.array(left)


def _leading_first(selection: Selection, description: Description) -> Description:
    """Terms by what their absence would cost."""
    if len(description.terms) < 2:
        return description
    return selection.only(description, np.argsort(-_costs(selection, description), kind="stable").tolist())


def _held(selection: Selection, description: Description) -> HeldOut:
    return held_out(description.fit, selection.problem.predictor.data.point)


def temper(selection: Selection, description: Description, gain: float) -> float:
    """By how much less a likelihood is to be trusted where shapes are rough, for a gain in log likelihood."""
    squares = float(description.fit.scatter.precision.squares(description.fit.residual))
    left = squares / max(len(selection.compliance) - 2 - len(description.terms), 1)
    return ROUGH * max(left, 1.0) + SHAPE * max(gain, 0.0)


def weigh(selection: Selection, descriptions: Sequence[Description], threshold: float) -> list[Leading]:
    """What may be the leading term, over descriptions, the chosen one first; with posterior probabilities."""
    costs = [_costs(selection, description) for description in descriptions]
    flat = temper(selection, descriptions[0], float(costs[0].max()))
    worths = np.array([whole.posterior / flat - 0.5 * threshold * _searched(whole) for whole in descriptions])
    leading: list[tuple[Term, float, bool]] = []
    for number, (description, cost) in enumerate(zip(descriptions, costs, strict=True)):
        leads = np.exp((cost - cost.max()) / flat)
        leads /= leads.sum()
        for k in np.flatnonzero(leads >= FAINT).tolist():
            chosen = (number, k) == (0, 0)
            if np.exp(worths[number] - worths.max()) * leads[k] < FAINT and not chosen:
                continue
            terms, logs = _in_place(selection, description, k, flat)
            logs = logs - 0.5 * threshold * (_searched(description) - 1) + np.log(leads[k])
            leading += [(term, log, chosen) for term, log in zip(terms, logs.tolist(), strict=True)]
    weights = np.exp(np.array([log for _, log, _ in leading]) - max(log for _, log, _ in leading))
    weights /= weights.sum()
    order = np.argsort(-weights, kind="stable").tolist()
    return [(leading[i][0], float(weights[i]), leading[i][2]) for i in order]


def _in_place(selection: Selection, description: Description, k: int, flat: float) -> tuple[list[Term], FloatArray]:
    """Terms in the place of the k-th one, beside the others, with their flattened log posterior."""
    others = selection.scattered(selection.without(description, k), description)
    entries = selection.finalists(selection.scores(others)) + crossed(description.terms[k], selection.ground)
    entries = list({entry.term: entry for entry in entries}.values())
    sizes = selection.together(others, [entry.term for entry in entries])
    posterior = sizes.posterior + description.fit.scatter.log_price
    logs = posterior / flat + np.array([entry.log_prior for entry in entries])
    return [entry.term for entry in entries], np.where(np.abs(sizes.size[:, -1]) > 0.0, logs, -np.inf)
