"""A diagnosis in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.defaults import NORMAL_95
from toolpath_stiff.hints import Asked, both_names, command_line, hint, options
from toolpath_stiff.inference.candidates import choice_text
from toolpath_stiff.inference.confounding import CONFOUNDED
from toolpath_stiff.inference.drawn import Drawn, seen_readings
from toolpath_stiff.inference.errors import errors_text, raised_text, scatter_text
from toolpath_stiff.inference.evidence import LAW_PRIOR
from toolpath_stiff.inference.judgement import ADEQUATE, FALSE_ALARM, HELD, NONE, OUTSIDE, POSITIVE, STANDS, Judgement
from toolpath_stiff.inference.repeats import OUTLIERS
from toolpath_stiff.inference.size_priors import EXPECTED
from toolpath_stiff.inference.unexcluded import MATTERS, Unexcluded
from toolpath_stiff.planning.plan import INDICATORS
from toolpath_stiff.portrait.words import alike_text
from toolpath_stiff.stiffness.contract import joined
from toolpath_stiff.units import mm_from_m

if TYPE_CHECKING:
    from toolpath_stiff.diagnosis.result import Diagnosis

SHOWN = 0.005  # probability below which a hypothesis is ruled out, and printed as "< 0.5 %"


MOST_BESIDE = 3  # effects in a sentence on what is not excluded; a document has all


def verdict_text(diagnosis: Diagnosis) -> str:
    """The verdict in one or two sentences, the cause first; then what may be wrong with the data."""
    same = [] if diagnosis.alike is None else [alike_text(diagnosis.explanations[0], diagnosis.alike)]
    return " ".join([_verdict_text(diagnosis), *same, *(f"{_capital(one)}." for one in doubts(diagnosis))])


def beside_text(unexcluded: Sequence[Unexcluded]) -> str:
    """What is neither shown nor excluded beside what is said, and where an indicator would tell; or nothing."""
    if not unexcluded:
        return ""
    told, more = unexcluded[:MOST_BESIDE], len(unexcluded) - MOST_BESIDE
    effects = [f"{one.effect.name} ({up_to(one)}, {100.0 * one.rms:.2g} % of the tip's stiffness)" for one in told]
    effects += [f"{more} more"] if more > 0 else []
    places = dict.fromkeys(indicator_for(one).split(":")[0] for one in told if indicator_for(one))
    tells = f"; an indicator {' or '.join(places)} would tell" if places else ""
    return f"{joined(effects)}: the readings neither show nor exclude {'it' if len(unexcluded) == 1 else 'them'}{tells}"


def up_to(one: Unexcluded) -> str:
    """The size up to which an effect is not excluded, with its unit and what it acts on; a stiffness goes down."""
    chosen = [choice_text(key, value) for key, value in one.candidate.choice if value not in ("", 0)]
    way = "down to" if np.isinf(one.parameter.neutral) else "up to"
    size = f"{way} {float(f'{one.value / one.parameter.si:.2g}'):g} {one.parameter.unit}"
    return ", ".join([size, *chosen])


def indicator_for(one: Unexcluded) -> str:
    """Where an indicator reads the effect's link; "" where none does."""
    place = INDICATORS[one.effect.link]
    return "" if place.startswith("none: ") else place


def would_tell(one: Unexcluded) -> str:
    """Where an indicator would show an effect, or what else to measure."""
    place = indicator_for(one)
    return f"an indicator {place}" if place else INDICATORS[one.effect.link].removeprefix("none: ")


def doubts(diagnosis: Diagnosis) -> list[str]:
    """What may be wrong with the data instead of the machine: the stated noise, single rows."""
    noise = dict.fromkeys(judgement.doubt for judgement in diagnosis.judgements.values() if judgement.doubt)
    return [*noise, *(one["words"] for one in diagnosis.suspects)]


def _verdict_text(diagnosis: Diagnosis) -> str:
    if diagnosis.verdict == "adequate":
        hidden = _hidden(diagnosis) + _not_excluded(diagnosis)
        return f"Nothing is missing that these data could show: what is left is scatter.{hidden}"
    if diagnosis.verdict == "identified":
        best = diagnosis.explanations[0]
        return f"{_capital(_cause(diagnosis, best))}. Mean error: {_errors(diagnosis, best)}."
    if diagnosis.verdict == "described":
        best, drawn = diagnosis.explanations[0], unconfirmed(diagnosis)
        assert drawn is not None
        return (
            f"{_capital(_cause(diagnosis, best))}. This describes the readings, and does not explain them yet: "
            f"{drawn.reason}. Mean error: {_errors(diagnosis, best)}."
        )
    if diagnosis.verdict == "ambiguous":
        if _noise_decides(diagnosis):
            parts = [
                f"{j.noise.name} noise ({100 * j.noise.typical:.2g} %): {j.verdict}"
                + (f" ({joined(list(j.explanations))})" if j.explanations else "")
                for j in diagnosis.judgements.values()
            ]
            return "The verdict depends on the noise, which these data do not tell. " + "; ".join(parts) + "."
        return _rivals(diagnosis)
    if diagnosis.main.question:
        return f"{diagnosis.main.question} Mean error: {_errors(diagnosis)}."
    form = diagnosis.main.form
    return (
        f"Something is missing, and nothing in the catalogue accounts for it{_or_noise(diagnosis)}. Mean error: "
        f"{_errors(diagnosis)}; {_scatter(diagnosis)}."
        + (f" What is left forms a pattern {form}." if form else "")
        + _closest(diagnosis)
    )


def unconfirmed(diagnosis: Diagnosis) -> Drawn | None:
    """How an answer that is only `described` stands, under the noise model that confirms it least."""
    found = [judgement.drawn for judgement in diagnosis.judgements.values() if judgement.verdict == "described"]
    return next((drawn for drawn in found if drawn is not None), None)


def _or_noise(diagnosis: Diagnosis) -> str:
    """The other reading of unexplained data: that nothing is missing, and they scatter more than stated."""
    factor = diagnosis.main.noise_factor
    if factor <= 1.0:
        return ""
    return f"; or nothing is missing, and the readings scatter {factor:.2g} times as much as stated"


def _closest(diagnosis: Diagnosis) -> str:
    """Of unexplained data: what of the catalogue would explain them, were nothing outside it as likely."""
    named = {name: chance for name, chance in diagnosis.main.probability.items() if name in diagnosis.fits}
    best = max(named, key=lambda name: named[name], default="")
    if not best or named[best] < STANDS:
        return ""
    outside = diagnosis.main.probability.get(OUTSIDE, 0.0)
    return f" Closest: {_cause(diagnosis, best)}, but {_percent(outside)} remain for something else."


def _noise_decides(diagnosis: Diagnosis) -> bool:
    """Whether the guesses of the noise lead to different answers."""
    return len({(j.verdict, j.explanations) for j in diagnosis.judgements.values()}) > 1


def _cause(diagnosis: Diagnosis, name: str) -> str:
    """An explanation as an engineer says it, its effects and its probability after it."""
    chance = diagnosis.main.probability.get(name, 0.0)
    if name == NONE:
        return f"nothing is missing (probability {_percent(chance)})"
    fit = diagnosis.fits.get(name)
    said = f"{joined(fit.findings)} " if fit is not None else ""
    return f"{said}({name}, probability {_percent(chance)})"


def _percent(chance: float) -> str:
    return "more than 99 %" if chance > 0.99 else f"{100.0 * chance:.2g} %"


def _rivals(diagnosis: Diagnosis) -> str:
    """Explanations that stand beside each other."""
    causes = [_cause(diagnosis, name) for name in diagnosis.explanations]
    chances = [diagnosis.main.probability.get(name, 0.0) for name in diagnosis.explanations]
    if len(causes) < 2:
        return f"{_capital(causes[0])} is likeliest, but something else is not ruled out."
    if chances[0] < POSITIVE * chances[1]:
        return f"These explain the data about equally well: either {', or '.join(causes)}."
    return f"Most likely {causes[0]}; not ruled out: {'; '.join(causes[1:])}."


def _not_excluded(diagnosis: Diagnosis) -> str:
    """Of an adequate model: effects that may be there all the same."""
    names = [name for name in diagnosis.explanations if name != NONE]
    return f" Not ruled out either, but no more than chance would show: {joined(names)}." if names else ""


def _hidden(diagnosis: Diagnosis) -> str:
    """Of an adequate model whose noise is a guess: what such a noise would hide."""
    if not diagnosis.noise.guess:
        return ""
    shown = [one.rms for one in diagnosis.detectable if one.seen]
    law = NORMAL_95 * np.sqrt(np.diag(diagnosis.base.covariance)[: len(diagnosis.machine.strut_law.parameters)].max())
    change = f"a missing effect that changes the stiffness by less than {100.0 * min(shown):.2g} % (rms) and "
    return (
        f" But how far these readings scatter is only guessed: {100.0 * diagnosis.noise.typical:.2g} % a reading would "
        f"hide {change if shown else 'every effect and '}struts that are off by up to {100.0 * law:.2g} %."
    )


def _errors(diagnosis: Diagnosis, name: str = "") -> str:
    """Mean errors as given, with the strut law refitted, with an explanation."""
    as_given, refitted = _as_given(diagnosis), _refitted(diagnosis)
    rest = [(f"with {name}", 100.0 * float(diagnosis.fits[name].errors.mean()))] if name else []
    return errors_text(as_given, refitted, rest)


def _scatter(diagnosis: Diagnosis) -> str:
    return scatter_text(diagnosis.noise.floor_percent, _refitted(diagnosis), diagnosis.noise.guess)


def _as_given(diagnosis: Diagnosis) -> float:
    return 100.0 * float(diagnosis.as_given.errors.mean())


def _refitted(diagnosis: Diagnosis) -> float:
    return 100.0 * float(diagnosis.base.errors.mean())


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def why(diagnosis: Diagnosis) -> list[str]:
    """The reasons, most important first."""
    main, several = diagnosis.main, len(diagnosis.judgements) > 1
    found = [_base_text(judgement, several) for judgement in diagnosis.judgements.values()]
    if diagnosis.verdict == "identified" and main.drawn is not None:
        found.append(main.drawn.reason)
    if diagnosis.verdict == "ambiguous":
        found += [*_confounded(diagnosis), *_drawn_from_these(diagnosis)]
    if diagnosis.verdict == "unexplained" and not main.question:
        tested = [f"{name} (p = {g.probability:.2g})" for name, g in list(main.gates.items())[:4]]
        if tested:
            found.append(f"the best of the catalogue leave more than noise would: {', '.join(tested)}")
        if main.noise_factor > 1.0:
            found.append(main.doubt)
    raised = "" if main.question else raised_text(_as_given(diagnosis), _refitted(diagnosis))
    return [*found, raised] if raised else found


def _base_text(judgement: Judgement, several: bool) -> str:
    """How the model alone fares under one noise model."""
    gate = judgement.base_gate
    under = f"under the {judgement.noise.name} noise " if several else ""
    if gate.probability > FALSE_ALARM:
        return (
            f"{under}the model without a further effect explains the data: p = {gate.probability:.2g}; weighted "
            f"squares {gate.squares:.4g}, as large or larger in {100 * gate.squares_probability:.2g} % of simulated "
            f"campaigns; no structure is left (p = "
            f"{gate.structure_probability:.2g}); the best of all effects gains no more than chance (p = "
            f"{gate.gain_probability:.2g})"
        )
    return (
        f"{under}the model without a further effect does not explain the data: p = {gate.probability:.2g} (squares "
        f"{gate.squares_probability:.2g}, structure {gate.structure_probability:.2g}, gain of the best effect "
        f"{gate.gain_probability:.2g}); what stands out most "
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
            if not _rival_names(diagnosis, first, second):
                continue
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


def _drawn_from_these(diagnosis: Diagnosis) -> list[str]:
    """Of plausible effects: those whose form was read off some of these readings."""
    plausible = [f.effect for f in diagnosis.main.families if f.name in diagnosis.plausible]
    seen = {effect.name: int(seen_readings([effect], diagnosis.data).sum()) for effect in plausible}
    return [
        f"the form of {name} was read off {count} of these {len(diagnosis.data)} readings: its probability is too high"
        for name, count in seen.items()
        if count
    ]


def _rival_names(diagnosis: Diagnosis, first: str, second: str) -> bool:
    """Whether one explanation has the first effect without the second, and another the second without the first."""
    sets = [set(name.split(" + ")) for name in diagnosis.explanations]
    return any(first in s and second not in s for s in sets) and any(second in s and first not in s for s in sets)


def next_steps(diagnosis: Diagnosis, asked: Asked) -> list[str]:
    """What to do next, as hints: commands run as they stand."""
    noise = both_names("--noise")
    if diagnosis.verdict == "identified" and diagnosis.best is not None:
        names = diagnosis.explanations[0].split(" + ")
        fit = diagnosis.fits.get(diagnosis.explanations[0])
        bounded = fit.at_upper_bound() if fit is not None else []
        if bounded:  # an update would refuse it
            return [hint(f"{joined(bounded)} ends at its bound: measure more before adding it", asked.command("plan"))]
        own = [*options(add=names), "-o", asked.updated_machine]
        return [hint("add it" if len(names) == 1 else "add them", asked.command("update", *own))]
    if diagnosis.verdict == "described":
        names = diagnosis.explanations[0].split(" + ")
        own = [*options(add=names), "-o", asked.updated_machine]
        planned = diagnosis.next_measurements or not diagnosis.remarks
        return [
            hint("measure where it would show, or fail", asked.command("plan")) if planned else diagnosis.remarks[0],
            hint("add it all the same, as described", asked.command("update", *own)),
        ]
    if diagnosis.verdict == "ambiguous":
        planned = diagnosis.next_measurements or not diagnosis.remarks  # else the remark says why there is no plan
        found = [hint("measure what tells them apart", asked.command("plan")) if planned else diagnosis.remarks[0]]
        if len(diagnosis.judgements) > 1:
            found.insert(0, f"repeat a few readings, re-clamped, or state {noise}: the verdict depends on the scatter")
        return found
    if diagnosis.main.question:
        return [
            "check that machine file, poses and units are those of the readings: stiffness in N/mm, lengths in mm",
            hint("see which readings are how far off", asked.command("compare")),
        ]
    if diagnosis.verdict == "unexplained":
        found = [hint("look where the residuals lie", asked.command("compare"))]
        if diagnosis.portrait is not None and any(one.term.acts for one in diagnosis.portrait.terms):
            file = asked.new_effect("missing", ".toml")
            found.append(
                hint("write what it looks like as an effect to edit", asked.command("effects draft", "-o", file))
            )
        else:
            file = asked.new_effect()
            found.append(hint("write the effect that you suspect as one file", command_line("effects", "new", file)))
        return [*found, hint("and try it", asked.command("diagnose", effects=[file]))]
    use = "use the model; `detectable` lists what could still be there unseen"
    return [use] if not diagnosis.noise.guess else [f"repeat a few readings, re-clamped, or state {noise}", use]


def row_words(diagnosis: Diagnosis, name: str) -> str:
    """How a hypothesis stands: by its odds against the likeliest, unless a gate has settled it."""
    main = diagnosis.main
    probability = main.probability.get(name, 0.0)
    base_passes = main.base_gate.probability > FALSE_ALARM
    if base_passes:
        return "enough" if name == NONE else "no more than chance" if probability >= SHOWN else "not needed"
    gate = main.base_gate if name == NONE else main.gates.get(name)
    if probability < SHOWN and gate is not None and gate.probability <= (FALSE_ALARM if name == NONE else ADEQUATE):
        return "does not fit"
    said = words(probability, max(main.probability.values(), default=0.0))
    return "closest" if said == "best" and main.verdict == "unexplained" else said


def words(probability: float, best: float) -> str:
    """How a hypothesis stands against the likeliest one, by twice the logarithm of the odds (RadVel's wording)."""
    if probability < SHOWN:
        return "ruled out"
    if probability >= best:
        return "best"
    twice = 2.0 * float(np.log(best / probability))
    for limit, text in ((2.0, "nearly indistinguishable"), (4.0, "somewhat disfavoured")):
        if twice < limit:
            return text
    return "strongly disfavoured"


def assumptions(diagnosis: Diagnosis) -> list[str]:
    """What was assumed, in sentences."""
    noise = diagnosis.noise
    found = [
        f"noise: {noise.origin}",
        f"struts differ from each other by {100 * noise.strut_spread:g} % (sd), joints stand"
        f" {mm_from_m(noise.joint_error):g} mm (sd of each coordinate) from where the machine file has them: assumed",
        f"one reading in {1 / noise.outliers:.0f} scatters {noise.outlier_width:g} times as widely: "
        + ("assumed" if noise.outliers == OUTLIERS else "as the repeats have it"),
        f"the strut law's two stiffnesses are refitted along with everything, expected within {100 * LAW_PRIOR:g} % "
        "(sd) of the machine file: effective values, which absorb part of every other effect",
        f"sizes of effects: flat in the logarithm between {100 * EXPECTED[0]:g} and {100 * EXPECTED[1]:g} % change of "
        "stiffness, as far as these data could show them; typical sizes rank, bounds alone exclude: assumed",
        f"gates: {100 * FALSE_ALARM:g} % false alarms, explanations are dropped below {100 * ADEQUATE:g} %; "
        f"the plausible set holds {100 * HELD:g} %",
        f"a further effect matters from {100 * MATTERS:g} % of the tip's stiffness on",
    ]
    if "force_N" in diagnosis.data.missing:
        found.append(f"load of every reading: {defaults.FORCE:g} N, assumed because force_N is missing")
    return found
