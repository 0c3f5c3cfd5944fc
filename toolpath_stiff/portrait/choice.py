"""Choice of the terms of the dictionary that describe what is missing: few, by likelihood, tested at left-out points.

Terms are added one by one. A term joins where its gain is more than the best of the whole dictionary would reach by
chance (simulated from the noise model: look-elsewhere) and where the error at left-out points falls. What is added one
by one depends on where it began, and two or three terms that share one cause are easily begun with the wrong one: where
one term is not enough, the search begins anew at the other links that promise most, and the best description is taken.

Which link and which variable it is follows from all of these descriptions: of each, every term that may be the leading
one, and all that could stand in its place.
"""

from collections.abc import Callable, Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.left_out import held_out
from toolpath_stiff.portrait.dictionary import crossed
from toolpath_stiff.portrait.selection import Description, Selection
from toolpath_stiff.stiffness.terms import Term

MOST_TERMS, POINTS_EACH = 3, 6  # and points for each term but the first
LEADS = 0.01  # probability by chance below which the first term is accepted
BETTER = 0.98  # factor by which a further term must lower the rms at left-out points
BEGINNINGS = 3  # further links at which the search begins
# Flattening of likelihoods: the true shape is not among the dictionary's, so a slightly better fit
# is not so much more likely. For a large effect the error of shape counts, which grows with the gain; assumed.
ROUGH, SHAPE = 2.5, 0.0015
HELD = 0.90  # probability that a set of links or variables adds up to
FAINT = 0.02  # share below which a description, or a term as the leading one of it, is left out of the sums
Leading = tuple[Term, float, bool]  # possible leading term; probability; True if tried in the chosen description


def summed(leading: Sequence[Leading], of: Callable[[Term], str]) -> list[tuple[str, float]]:
    """Name -> probability summed over the terms, the likeliest first."""
    sums: dict[str, float] = {}
    for term, weight, _ in leading:
        sums[of(term)] = sums.get(of(term), 0.0) + weight
    return sorted(sums.items(), key=lambda item: (-item[1], item[0]))


def fewest(summed: Sequence[tuple[str, float]]) -> tuple[tuple[str, float], ...]:
    """Shortest list of names that together hold `HELD` of the probability."""
    count = 1 + int(np.searchsorted(np.cumsum([share for _, share in summed]), HELD - 1e-9))
    return tuple(summed[:count])


def choose(selection: Selection) -> tuple[Description | None, list[Leading], float]:
    """One to three terms (None: nothing beyond chance), candidates for leading term, probability that chance does it.

    The leading term is the first one. What else may be is told with posterior probabilities, the likeliest first.
    """
    start = selection.start
    if not selection.dictionary.terms:
        return None, [], 1.0
    chance, threshold = selection.chance(start, float(selection.scores(start).max(initial=0.0)))
    begun = selection.grown(start)
    if chance > LEADS or begun is None:
        return None, [], chance
    descriptions = [_completed(selection, begun, threshold)]
    if len(descriptions[0].terms) > 1:
        others = _other_beginnings(selection, start, descriptions[0].terms[0])
        descriptions += [_completed(selection, other, threshold) for other in others]
    # Less the gain that chance would bring with further terms.
    descriptions.sort(key=lambda whole: -(whole.posterior - 0.5 * threshold * (len(whole.terms) - 1)))
    descriptions = [_leading_first(selection, description) for description in _different(descriptions)]
    return descriptions[0], weigh(selection, descriptions, threshold), chance


def _completed(selection: Selection, begun: Description, threshold: float) -> Description:
    """Description with further terms, as long as each gains more than chance, at left-out points too."""
    points, description = selection.problem.predictor.data.point, begun
    while len(description.terms) < min(MOST_TERMS, len(np.unique(points)) // POINTS_EACH):
        more = selection.grown(description) if selection.scores(description).max() > threshold else None
        if more is None or 2.0 * (more.posterior - description.posterior) <= threshold:
            break
        # Choose the first term again beside the others: it was chosen without them.
        again = selection.grown(selection.without(more, 0))
        more = again if again is not None and again.posterior > more.posterior else more
        if held_out(more.fit, points).rms > BETTER * held_out(description.fit, points).rms:
            break
        description = more
    return description


def _other_beginnings(selection: Selection, start: Description, first: Term) -> list[Description]:
    """Single terms of links other than that of `first` that promise most together with a further term."""
    terms = list(selection.finalists(start))
    posterior = selection.together(start, terms).posterior
    seen: set[tuple[str, str]] = set()
    outlook: list[tuple[float, Description]] = []
    for term in (terms[i] for i in np.argsort(-posterior, kind="stable").tolist()):
        kinds = {("link", term.link), ("variable", term.variable)}
        if term.link == first.link or kinds <= seen:
            continue
        seen |= kinds
        begun = selection.extended(start, term)
        outlook.append((begun.posterior + 0.5 * float(selection.scores(begun).max(initial=0.0)), begun))
    links: dict[str, Description] = {}
    for _, begun in sorted(outlook, key=lambda prospect: -prospect[0]):
        links.setdefault(begun.terms[0].link, begun)
    return [selection.settled(start, begun) for begun in list(links.values())[:BEGINNINGS]]


def _different(descriptions: Sequence[Description]) -> list[Description]:
    """The first of each group of descriptions that differ in constants only."""
    kept: dict[frozenset[tuple[object, ...]], Description] = {}
    for description in descriptions:
        kinds = frozenset((t.link, t.where, t.direction, t.variable, t.column, t.shape) for t in description.terms)
        kept.setdefault(kinds, description)
    return list(kept.values())


def _costs(selection: Selection, description: Description) -> FloatArray:
    """(p,) loss of log posterior when each term is left out."""
    left = [selection.without(description, k).posterior for k in range(len(description.terms))]
    return description.posterior - np.array(left)


def _leading_first(selection: Selection, description: Description) -> Description:
    """Description with its terms in order of the loss that their absence would cause."""
    if len(description.terms) < 2:
        return description
    order = np.argsort(-_costs(selection, description), kind="stable").tolist()
    return selection.refitted(description, [description.terms[k] for k in order])


def weigh(selection: Selection, descriptions: Sequence[Description], threshold: float) -> list[Leading]:
    """Candidates for the leading term, over all descriptions, the chosen one first; with posterior probabilities."""
    costs = [_costs(selection, description) for description in descriptions]
    # Divisor of log likelihoods, which are less to be trusted where shapes are rough.
    fit, free = descriptions[0].fit, len(selection.compliance) - 2 - len(descriptions[0].terms)
    left = float(fit.scatter.precision.squares(fit.residual)) / max(free, 1)
    flat = ROUGH * max(left, 1.0) + SHAPE * max(float(costs[0].max()), 0.0)
    worths = np.array([whole.posterior / flat - 0.5 * threshold * len(whole.terms) for whole in descriptions])
    leading: list[tuple[Term, float, bool]] = []
    for number, (description, cost) in enumerate(zip(descriptions, costs, strict=True)):
        leads = np.exp((cost - cost.max()) / flat)
        leads /= leads.sum()
        for k in np.flatnonzero(leads >= FAINT).tolist():
            chosen = (number, k) == (0, 0)
            if np.exp(worths[number] - worths.max()) * leads[k] < FAINT and not chosen:
                continue
            terms, logs = _in_place(selection, description, k, flat)
            logs = logs - 0.5 * threshold * (len(description.terms) - 1) + np.log(leads[k])
            leading += [(term, log, chosen) for term, log in zip(terms, logs.tolist(), strict=True)]
    weights = np.exp(np.array([log for _, log, _ in leading]) - max(log for _, log, _ in leading))
    weights /= weights.sum()
    order = np.argsort(-weights, kind="stable").tolist()
    return [(leading[i][0], float(weights[i]), leading[i][2]) for i in order]


def _in_place(selection: Selection, description: Description, k: int, flat: float) -> tuple[list[Term], FloatArray]:
    """Terms in place of the k-th one, beside the others, with their flattened log posterior."""
    others = selection.scattered(selection.without(description, k), description)
    priors = selection.finalists(others) | crossed(description.terms[k], selection.ground)
    sizes = selection.together(others, list(priors))
    logs = (sizes.posterior + description.fit.scatter.log_price) / flat + np.array(list(priors.values()))
    return list(priors), np.where(np.abs(sizes.size[:, -1]) > 0.0, logs, -np.inf)
