"""Alternatives to a named effect: what else would look the same as the answer from the catalogue.

A name of the catalogue is a part and a way in which it gives; where poses are few, a part that is in no catalogue may
give the same readings: without tilted poses a floor that rocks is a table that shifts. So each term of the dictionary
is put in the place of the named effect, the strut law refitted, and those that fit as well as it does are told.
"""

from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.inference.candidates import candidates_of
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit, Problem
from toolpath_stiff.inference.fits import fit_effects
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.portrait.choice import ROUGH, Leading, fewest, summed
from toolpath_stiff.portrait.selection import Selection
from toolpath_stiff.stiffness.term_effect import CATALOGUE_LINKS
from toolpath_stiff.stiffness.terms import Term

# Odds beyond which what fits worse is not the same (strong evidence: Kass and Raftery 1995). A term that is one of many
# constants or places must fit better than the plainest ones by as much as its prior weight is smaller.
AS_WELL = float(np.log(20.0))
ITSELF = 0.99  # correlation from which a term of the same link is the named effect itself
MOST_NAMED = 2  # named effects of which one is replaced; three would take as long as the diagnosis
MOST_TOLD, TOLD = 6, 0.03  # most terms reported, and the smallest share reported


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


def looks_the_same(problem: Problem, base: Fit, named: Fit, noise: Noise, seed: int) -> dict[str, Alike]:
    """Named effect -> terms of the dictionary that fit the readings as well in its place; only effects with such terms.

    Parameters
    ----------
    problem, noise
        Readings, model and scatter; the noise model behind the scatter.
    base, named
        The model with its strut law refitted, without and with the named effects. Of several one is replaced at a time,
        the others keeping their sizes.
    seed
        Of the selection.
    """
    count = len(named.candidates)
    if not 1 <= count <= MOST_NAMED:
        return {}
    bases = [base] if count == 1 else [_without(problem, named, k) for k in range(count)]
    first = Selection(problem, bases[0], noise, seed)
    selections = [first, *(first.beside(other) for other in bases[1:])]
    found = {named.names[k]: _in_place(selection, named, k) for k, selection in enumerate(selections)}
    return {name: alike for name, alike in found.items() if alike is not None}


def _without(problem: Problem, named: Fit, k: int) -> Fit:
    """The fit without effect k, the others at their sizes."""
    others = [(c, s) for i, (c, s) in enumerate(zip(named.candidates, named.sizes, strict=True)) if i != k]
    candidates, sizes = zip(*others, strict=True)
    return fit_effects(problem, candidates, sizes, (), named.law, named.scatter)


def _in_place(selection: Selection, named: Fit, k: int) -> Alike | None:
    """Terms that fit as well as effect k of a fit; None if there are none."""
    problem, candidate = selection.problem, named.candidates[k]
    if not selection.dictionary.terms:
        return None
    # Both under the scatter of the named fit, so that wild readings count alike.
    start = selection.start
    start = replace(start, fit=replace(start.fit, scatter=named.scatter))
    priors = selection.finalists(start)
    if not priors:
        return None
    terms, prior = list(priors), np.array(list(priors.values()))
    columns = np.array([selection.ground.column(term) for term in terms])
    sizes = selection.together(start, terms)
    squares = float(start.fit.scatter.precision.squares(named.residual))
    # Less the gain from its further sizes (Schwarz 1978) and from its choice of element, which a term does not have.
    data = problem.predictor.data
    choices, sizes_of_it = len(candidates_of(candidate.effect, data)), int(np.count_nonzero(named.sizes[k]))
    freedom = 0.5 * (sizes_of_it - 1) * float(np.log(len(data))) + float(np.log(max(choices, 1)))
    reached = -0.5 * (squares + float(named.law @ named.law) / LAW_PRIOR**2) - freedom
    plainest = float(selection.dictionary.log_prior.max())
    same = (sizes.posterior + prior - plainest >= reached - AS_WELL) & (np.abs(sizes.size[:, -1]) > 0.0)
    # A term counts as the named effect itself if it has the same signature in the same link.
    change = np.exp(named.residual - problem.observed) - problem.predictor.strut_part(named.law) - selection.rest
    alike = columns @ change > ITSELF * np.linalg.norm(columns, axis=1) * np.linalg.norm(change)
    link = candidate.effect.link
    same &= ~(alike & np.array([CATALOGUE_LINKS.get(term.link, term.link) == link for term in terms]))
    if not same.any():
        return None
    rows = np.flatnonzero(same)
    logs = sizes.posterior[rows] / ROUGH + prior[rows]
    weights = np.exp(logs - logs.max())
    order = np.argsort(-weights, kind="stable")
    shares = weights[order] / weights.sum()
    size = sizes.size[:, -1] / np.sqrt(np.mean((columns / selection.compliance) ** 2, axis=1))
    ranked = zip(rows[order].tolist(), shares.tolist(), strict=True)
    leading = [(terms[i].sized(float(size[i])), share, True) for i, share in ranked]
    links, variables = (fewest(summed(leading, of)) for of in (lambda term: term.link, lambda term: term.variable))
    return Alike(_told(leading), links, variables)


def _told(leading: list[Leading]) -> tuple[tuple[Term, float], ...]:
    """The best term of each link, direction and variable, with the summed share of all such terms."""

    def kind(term: Term) -> str:
        return f"{term.link} {term.direction} {term.variable}"

    best = {kind(term): term for term, *_ in reversed(leading)}
    return tuple((best[name], share) for name, share in summed(leading, kind)[:MOST_TOLD] if share >= TOLD)
