"""A diagnosis in sentences."""

from __future__ import annotations

from toolpath_stiff.hints import Asked, command_line, hint, options
from toolpath_stiff.updating.diagnosis.diagnose import Diagnosis
from toolpath_stiff.updating.inference.confounding import CONFOUNDED
from toolpath_stiff.updating.inference.verdict import FALSE_ALARM, NONE, Judgement


def verdict_text(diagnosis: Diagnosis) -> str:
    """The verdict in one or two sentences."""
    base = 100.0 * float(diagnosis.base.errors.mean())
    names = [name for name in diagnosis.plausible if name != NONE]
    if diagnosis.verdict == "adequate":
        tail = ""
        if names:
            tail = f" These data could hardly show: {_listed(names)}."
        return (
            f"Nothing is missing that these data could show: the model's mean error of {base:.3g} % is what "
            f"their scatter explains.{tail}"
        )
    if diagnosis.verdict == "identified":
        best = " + ".join(names) if " + ".join(names) in diagnosis.fits else diagnosis.best
        assert best is not None
        after = 100.0 * float(diagnosis.fits[best].errors.mean())
        held = 100.0 * diagnosis.held_out[best].mean_error
        return (
            f"{_listed(names)} {'is' if len(names) == 1 else 'are'} missing: with "
            f"{'it' if len(names) == 1 else 'them'} the mean error falls from {base:.3g} to {after:.3g} % "
            f"(held out: {held:.3g} %)."
        )
    if diagnosis.verdict == "ambiguous":
        if len({j.verdict for j in diagnosis.judgements.values()}) > 1:
            parts = [
                f"{j.noise.name} noise ({100 * j.noise.typical:.2g} %): {j.verdict}"
                + (f" ({_listed(list(j.plausible))})" if j.plausible else "")
                for j in diagnosis.judgements.values()
            ]
            return "The verdict hangs on the noise, which these data do not tell. " + "; ".join(parts) + "."
        return f"These explain the data about equally well: {_listed(_with_chances(diagnosis))}."
    form = diagnosis.main.form
    return (
        f"Something is missing, and nothing in the catalogue accounts for it: a mean error of {base:.3g} % against "
        f"{80.0 * diagnosis.noise.typical:.2g} % from noise."
        + (f" What is left forms a pattern {form}." if form else "")
    )


def _with_chances(diagnosis: Diagnosis) -> list[str]:
    """The explanations, each with its probability."""
    chance = diagnosis.main.probability
    return [f"{name} ({100.0 * chance.get(name, 0.0):.2g} %)" for name in diagnosis.explanations]


def why(diagnosis: Diagnosis) -> list[str]:
    """The reasons, most important first."""
    main, found = diagnosis.main, []
    if diagnosis.verdict == "adequate":
        found += [_base_text(judgement, len(diagnosis.judgements) > 1) for judgement in diagnosis.judgements.values()]
        return found
    for judgement in diagnosis.judgements.values():
        found.append(_base_text(judgement, len(diagnosis.judgements) > 1))
    if diagnosis.verdict == "ambiguous":
        found += _confounded(diagnosis)
    if diagnosis.verdict == "unexplained":
        tested = [f"{name} (p = {g.probability:.2g})" for name, g in list(main.gates.items())[:4]]
        if tested:
            found.append(f"even the best explanations leave what noise does not: {', '.join(tested)}")
    return found


def _base_text(judgement: Judgement, several: bool) -> str:
    """How the model alone fares under one noise model."""
    gate = judgement.base_gate
    under = f"under the {judgement.noise.name} noise " if several else ""
    if gate.probability > FALSE_ALARM:
        return (
            f"{under}the model alone passes: p = {gate.probability:.2g}; weighted squares {gate.squares:.4g}, as large "
            f"or larger in {100 * gate.squares_probability:.2g} % of simulated campaigns; no structure is left (p = "
            f"{gate.structure_probability:.2g}); the best of all effects gains no more than chance (p = "
            f"{gate.gain_probability:.2g})"
        )
    return (
        f"{under}the model alone fails: p = {gate.probability:.2g} (squares {gate.squares_probability:.2g}, structure "
        f"{gate.structure_probability:.2g}, gain of the best effect {gate.gain_probability:.2g}); what sticks out most "
        f"is a pattern {gate.worst}"
    )


def _confounded(diagnosis: Diagnosis) -> list[str]:
    """Why the plausible effects cannot be told apart."""
    names = list(diagnosis.confounding.names)
    found = []
    plausible = [name for name in diagnosis.plausible if name in names]
    for i, first in enumerate(plausible):
        for second in plausible[:i]:
            value = float(diagnosis.confounding.matrix[names.index(first), names.index(second)])
            if value > CONFOUNDED:
                found.append(
                    f"{second} and {first} have the same signature on these poses, loads and directions: correlation "
                    f"{value:.3f}"
                )
            elif value > 0.5:
                found.append(
                    f"{second} and {first} resemble each other here (correlation {value:.2f}): the effect is too small "
                    "for the rest to show"
                )
    if NONE in diagnosis.plausible:
        found.append("chance alone is not excluded either")
    return found


def next_steps(diagnosis: Diagnosis, asked: Asked) -> list[str]:
    """What to do next, as hints: commands run as they stand."""
    if diagnosis.verdict == "identified" and diagnosis.best is not None:
        names = [name for name in diagnosis.plausible if name != NONE]
        # The diagnosis weighs every effect with the strut law refitted: the update is to do the same.
        own = [*options(add=names), "--strut-law", "-o", asked.updated_machine]
        return [hint("add it" if len(names) == 1 else "add them", asked.command("update", *own))]
    if diagnosis.verdict == "ambiguous":
        found = [hint("measure what tells them apart", asked.command("plan"))]
        if len(diagnosis.judgements) > 1:
            found.insert(0, "repeat a few readings, re-clamped, or state --noise: the verdict hangs on the scatter")
        return found
    if diagnosis.verdict == "unexplained":
        file = asked.new_effect
        return [
            hint("look where the residuals lie", asked.command("compare")),
            hint("write the effect that you suspect as one file", command_line("effects", "new", file)),
            hint("and try it", asked.command("diagnose", effects=[file])),
        ]
    return ["use the model; `detectable` lists what could still be there unseen"]


def _listed(names: list[str]) -> str:
    if not names:
        return "nothing"
    if len(names) == 1:
        return names[0]
    return ", ".join(names[:-1]) + " and " + names[-1]
