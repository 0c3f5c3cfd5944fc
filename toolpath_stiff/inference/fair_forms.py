"""Rivals in fair forms: other links with as much freedom to give as the named one.

The catalogue gives the table three axes of its own, and a spindle one across and one along: whoever compares the two as
they stand finds in favour of the freer one wherever X and Y differ. So each link stands against a name in the most
general constant form that its mechanics allow.
"""

import numpy as np

from toolpath_stiff.inference.candidates import Candidate, Component, table_of
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.least_squares import bounded_step
from toolpath_stiff.inference.rivals import part_of
from toolpath_stiff.stiffness.term_effect import TermEffect, size_parameter
from toolpath_stiff.stiffness.terms import Term

# Effect of the catalogue that represents the link -> the link, and its actions with directions.
FORMS = {
    "spindle_compliance": ("tool", (("give", "X"), ("give", "Y"), ("give", "axial"))),
    "platform_flexibility": ("platform", (("tilting", "X"), ("tilting", "Y"), ("give", "axial"))),
    "frame_compliance": ("frame", (("vertex", "radial"), ("vertex", "tangential"), ("vertex", "Z"))),
}


def _form(name: str, link: str, ways: tuple[tuple[str, str], ...]) -> Candidate:
    """Candidate for a link with constant give in several ways."""
    entries = [
        (
            Term(link, direction, "constant", "offset", action),
            size_parameter(action, f"way_{k}", f"{action} {direction}"),
        )
        for k, (action, direction) in enumerate(ways, 1)
    ]
    effect = TermEffect(f"{name} in general", entries)
    return Candidate(effect, (), tuple(Component.of(parameter) for parameter in effect.parameters))


CANDIDATES = {name: _form(name, *form) for name, form in FORMS.items()}


def fair_rivals(problem: Problem, fit: Fit, base: Fit) -> dict[str, Fit]:
    """Fits with one effect of an explanation replaced by another link's fair form, by names of representing effects."""
    rivals = {}
    for member in fit.candidates:
        others = [other for other in fit.candidates if other is not member]
        taken = {part_of(candidate.effect) for candidate in fit.candidates}
        for name, candidate in CANDIDATES.items():
            if part_of(candidate.effect) not in taken:
                rival = _beside(problem, candidate, others, base)
                if rival is not None:
                    rivals[" + ".join(sorted([name, *(other.name for other in others)]))] = rival
    return rivals


def _beside(problem: Problem, form: Candidate, others: list[Candidate], base: Fit) -> Fit | None:
    """Fit of a form beside other effects; None if it fits best when absent."""
    tables = [table for candidate in (form, *others) if (table := table_of(candidate, problem.predictor)) is not None]
    if len(tables) <= len(others):
        return None
    columns = -np.concatenate([table.columns for table in tables], axis=1) / problem.base_compliance[:, None]
    weighted = problem.sight.projected.times(columns.T)
    low, high = np.array([component.bounds for table in tables for component in table.candidate.components]).T
    sizes = bounded_step(weighted @ columns, weighted @ base.residual, low, high)
    own = len(form.components)
    free = tuple(int(k) for k in np.flatnonzero((sizes != 0.0) & columns.any(axis=0)))
    return problem.score_subset(tables, free, base) if any(k < own for k in free) else None
