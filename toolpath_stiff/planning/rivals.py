"""Rivals for a plan to tell apart: those a diagnosis leaves, those the user names, or those before any data."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.candidates import Candidate, Component
from toolpath_stiff.inference.errors import AS_GIVEN, LAW_REFITTED, error_figures
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit, Problem
from toolpath_stiff.inference.fits import baseline, fit_effects, refine
from toolpath_stiff.inference.hypotheses import score_family
from toolpath_stiff.inference.judgement import NONE, Judgement
from toolpath_stiff.planning.forecasts import Rival
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.contract import ELEMENT, Effect

LEAST_WEIGHT = 0.02  # probability below which an explanation is no rival
UNKNOWN_SIZE = 0.5  # relative sd of a size before any measurement; assumed


def rival_of_fit(name: str, fit: Fit, weight: float = 1.0) -> Rival:
    """A rival made from a fit to the data."""
    return Rival(name, fit.law, fit.candidates, fit.sizes, fit.covariance, fit.free, weight)


def rivals_of(judgement: Judgement) -> list[Rival]:
    """Explanations that a diagnosis leaves standing, with their probabilities, none below `LEAST_WEIGHT`.

    Those that votes leave open have none of their own or a small one. Where no two stand, the likely others beside it,
    at least the likeliest: what a plan would confirm the answer against.
    """
    likely = [name for name, weight in judgement.likely if weight >= LEAST_WEIGHT]
    names = judgement.explanations if len(judgement.explanations) > 1 else (*judgement.explanations, *likely)
    rivals = dict[str, Rival]()
    for k, name in enumerate(dict.fromkeys([*names, NONE, *(family.name for family in judgement.families)])):
        if k >= len(names) and len(rivals) >= 2:
            break
        if fit := _fit_of(judgement, name):
            rivals[name] = rival_of_fit(name, fit, max(judgement.probability.get(name, 0.0), LEAST_WEIGHT))
    return sorted(rivals.values(), key=lambda rival: (-rival.weight, rival.name))


def _fit_of(judgement: Judgement, name: str) -> Fit | None:
    """Final fit of a hypothesis; None if it cannot be made."""
    if name == NONE:
        return fit_effects(judgement.problem, (), (), (), judgement.base.law)
    if name in judgement.fits:
        return judgement.fits[name]
    best = next((family.best for family in judgement.families if family.name == name), None)
    return None if best is None else refine(judgement.problem, best)


def fitted_rivals(problem: Problem, names: Sequence[str], effects: Mapping[str, Effect]) -> list[Rival]:
    """Effects by name, or `none`, fitted to the data, with equal weights.

    Raises
    ------
    InputError
        An effect that does not exist, that the data lack a column for, or that the data leave at nothing.
    """
    _check(names, effects)
    base = problem.score_base()
    rivals = []
    lacking = problem.predictor.data.cannot_test(effects[name] for name in names if name != NONE)
    for name in names:
        if name == NONE:
            rivals.append(rival_of_fit(NONE, fit_effects(problem, (), (), (), base.law)))
            continue
        if name in lacking:
            raise InputError(
                f"the data cannot be fitted with {name}: column {lacking[name][0]} is missing",
                hint="plan without data: leave the files out",
            )
        family = score_family(problem, effects[name], base)
        if family is None or family.best is None:
            raise InputError(
                f"fitted to these data, the size of {name} is zero: it is no other explanation than {NONE}",
                hint="plan without data (leave the files out) for the size that it usually has",
            )
        rivals.append(rival_of_fit(name, refine(problem, family.best)))
    return rivals


def unfitted_rivals(names: Sequence[str], effects: Mapping[str, Effect], setup: str = "") -> list[Rival]:
    """Effects by name, or `none`, at their usual sizes, before any data; `setup` is for effects that act on a set-up.

    The size is the middle of the usual range on a logarithmic scale and known within `UNKNOWN_SIZE` of it; the strut
    law within `LAW_PRIOR`.

    Raises
    ------
    InputError
        An effect that does not exist.
    """
    _check(names, effects)
    rivals = []
    for name in names:
        if name == NONE:
            rivals.append(Rival(NONE, covariance=np.diag([LAW_PRIOR**2] * 2)))
            continue
        plain, _, element = name.partition(":")
        effect = effects[plain]
        components = tuple(Component.of(p) for p in effect.parameters if not p.discrete)
        sizes, choice = np.array([usual_size(component) for component in components]), dict[str, Any]()
        discrete = [parameter for parameter in effect.parameters if parameter.discrete]
        for parameter in discrete:
            if parameter.kind == "integer":  # 0 means all: with other choices beside it that is no effect at all
                choice[parameter.name] = max(int(parameter.bounds[0]), int(len(discrete) > 1))
            elif parameter.name == ELEMENT:
                choice[ELEMENT] = element
            else:
                choice[parameter.name] = setup if len(discrete) == 1 else ""
        covariance = np.diag([*[LAW_PRIOR**2] * 2, *(UNKNOWN_SIZE * sizes) ** 2])
        candidate = Candidate(effect, tuple(choice.items()), components)
        rivals.append(Rival(name, candidates=(candidate,), sizes=(sizes,), covariance=covariance))
    return rivals


def errors_so_far(problem: Problem, rivals: Sequence[Rival]) -> dict[str, float]:
    """Mean errors on the data so far, %: as given, strut law refitted, and with each rival that has an effect."""
    as_given, refitted = baseline(problem)
    residuals = {AS_GIVEN: as_given.residual, LAW_REFITTED: refitted.residual}
    for rival in rivals:
        if rival.effects:
            modelled = problem.predictor.log_stiffness(np.asarray(rival.law), rival.effects)
            residuals[f"with {rival.name}"] = problem.observed - modelled
    return {name: error_figures(residual)["mean_abs_error_percent"] for name, residual in residuals.items()}


def usual_size(component: Component) -> float:
    """Middle of the usual sizes on a logarithmic scale; a fifth of the largest if the usual range includes 0."""
    low, high = component.typical()
    sign = component.signs[-1]
    if not np.isfinite(high):
        high = component.reach(sign)
    if low <= 0.0:
        low = 0.04 * high
    return sign * float(np.sqrt(low * high))


def _check(names: Sequence[str], effects: Mapping[str, Effect]) -> None:
    if len(set(names)) != len(names) or len(names) < 2:
        raise InputError(f"--between {','.join(names)}", expected="two or more different effects, or none")
    for name in names:
        if name != NONE and name.partition(":")[0] not in effects:
            find_effect(name)  # its error lists the known effects
            raise InputError(f"--between {name}: it holds on hexapods only", expected=f"one of {', '.join(effects)}")


def rivals_on_elements(fits: Sequence[Fit], standing: Sequence[Fit], between: Sequence[str]) -> list[Rival]:
    """Explanations of pulls as rivals, the likeliest first: those named, otherwise those that stand and the next ones.

    Weights are as of equally likely explanations, none below `LEAST_WEIGHT`. Raises `InputError` for one that changes
    nothing there.
    """
    by_name = {rival_name(fit): fit for fit in fits}
    if missing := [name for name in between if name not in by_name]:
        mistake = f"--between {missing[0]}: fitted to these data its size is zero"
        raise InputError(mistake, expected=f"some of {', '.join(by_name)}")
    chosen = [by_name[name] for name in between] or [*standing, *(fit for fit in fits if fit not in standing)]
    chosen = chosen[: max(len(between) or len(standing), 2)]
    best = max(fit.log_posterior for fit in chosen)
    weights = [max(float(np.exp(fit.log_posterior - best)), LEAST_WEIGHT) for fit in chosen]
    return [rival_of_fit(rival_name(fit), fit, weight) for fit, weight in zip(chosen, weights, strict=True)]


def rival_name(fit: Fit) -> str:
    """Name of a rival as `--between` takes it: "joint_torsion:joint 3", "none"."""
    if not fit.candidates:
        return NONE
    element = dict(fit.candidates[-1].choice).get(ELEMENT)
    return f"{fit.names[-1]}:{element}" if element else fit.names[-1]
