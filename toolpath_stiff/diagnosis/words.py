"""Sentences on a diagnosis."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.defaults import NORMAL_95
from toolpath_stiff.diagnosis.examination import NAMING, SHOWN, Diagnosis
from toolpath_stiff.hints import Asked, command_line, hint, options
from toolpath_stiff.inference.adequacy import LEFT, moved_by_law
from toolpath_stiff.inference.candidates import choice_text
from toolpath_stiff.inference.discrepancies import RANGE_LENGTH
from toolpath_stiff.inference.drawn import seen_readings
from toolpath_stiff.inference.errors import errors_text, raised_text, scatter_text
from toolpath_stiff.inference.evidence import LAW_PRIOR, Fit
from toolpath_stiff.inference.judgement import (
    ADEQUATE,
    FALSE_ALARM,
    HELD,
    NONE,
    OUTSIDE,
    POSITIVE,
    STANDS,
    Judgement,
)
from toolpath_stiff.inference.noise import REST
from toolpath_stiff.inference.nuisances import TAKEN_UP, findings, nuisance_words
from toolpath_stiff.inference.repeats import OUTLIERS
from toolpath_stiff.inference.size_priors import EXPECTED
from toolpath_stiff.inference.unexcluded import MATTERS, Unexcluded
from toolpath_stiff.inference.votes import CHANCE, SMALL, outvoted, vote_words
from toolpath_stiff.planning.plan import INDICATORS, reading_words, telling
from toolpath_stiff.portrait.portrait import LACKING
from toolpath_stiff.portrait.words import alike_text
from toolpath_stiff.stiffness.sizes import joined
from toolpath_stiff.units import mm_from_m

MOST_BESIDE = 3  # effects in a sentence on what is not excluded; a document has all


def verdict_text(diagnosis: Diagnosis) -> str:
    """The verdict in one or two sentences, the cause first; then possible faults of the data."""
    same = [alike_text(name, alike) for name, alike in diagnosis.alike.items()]
    return " ".join([_verdict_text(diagnosis), *same, *(f"{_capital(doubt)}." for doubt in doubts(diagnosis))])


def doubts(diagnosis: Diagnosis) -> list[str]:
    """Possible faults of the data rather than the machine: the stated noise, single rows."""
    noise = dict.fromkeys(judgement.doubt for judgement in diagnosis.judgements.values() if judgement.doubt)
    nuisances = [f"{nuisance_words(entry)}, more than is assumed of any" for entry in findings(diagnosis.nuisances)[:1]]
    return [*noise, *([] if diagnosis.main.question else nuisances), *(suspect.words for suspect in diagnosis.suspects)]


def _verdict_text(diagnosis: Diagnosis) -> str:
    main, judgements = diagnosis.main, diagnosis.judgements.values()
    if diagnosis.verdict == "adequate":
        names = [name for name in diagnosis.explanations if name != NONE]
        chance = f" Not ruled out either, but no more than chance would show: {joined(names)}." if names else ""
        return f"Nothing is missing that these data could show: what is left is scatter.{_hidden(diagnosis)}{chance}"
    if diagnosis.verdict in NAMING:
        best, drawn = diagnosis.explanations[0], diagnosis.unconfirmed
        only = "" if drawn is None else f"This describes the readings, and does not explain them yet: {drawn.reason}. "
        return f"{_capital(_cause(diagnosis, best))}. {only}{_errors(diagnosis, best)}.{_outvoted(diagnosis)}"
    if diagnosis.verdict == "ambiguous":
        if len({(judgement.verdict, judgement.explanations) for judgement in judgements}) == 1:
            return _rivals(diagnosis)
        parts = [
            f"{judgement.noise.name} noise ({100 * judgement.noise.typical:.2g} %): {judgement.verdict}"
            + (f" ({joined(judgement.explanations)})" if judgement.explanations else "")
            for judgement in judgements
        ]
        return f"The verdict depends on the noise, which these data do not tell. {'; '.join(parts)}."
    if main.question:
        return f"{main.question} {_errors(diagnosis)}."
    noisy = f"; or nothing is missing, and the readings scatter {main.noise_factor:.2g} times as much as stated"
    scatter = scatter_text(diagnosis.noise.floor_percent, _mean_errors(diagnosis)[1], diagnosis.noise.guess)
    text = (
        "Something is missing, and nothing in the catalogue accounts for it"
        f"{noisy if main.noise_factor > 1.0 else ''}. {_errors(diagnosis)}; {scatter}."
    )
    if main.form:
        text += f" What is left forms a pattern {main.form}."
    # Best of the catalogue, had nothing outside it been as likely.
    named = {name: chance for name, chance in main.probability.items() if name in diagnosis.fits and chance >= STANDS}
    if named:
        best, outside = max(named, key=lambda name: named[name]), _percent(main.probability.get(OUTSIDE, 0.0))
        text += f" Closest: {_cause(diagnosis, best)}, but {outside} remain for something else."
    return text


def _cause(diagnosis: Diagnosis, name: str) -> str:
    """An explanation in an engineer's words, followed by its effects and its probability."""
    chance = _percent(diagnosis.main.probability.get(name, 0.0))
    if name == NONE:
        return f"nothing is missing (probability {chance})"
    words = f"probability {chance}"
    if diagnosis.main.probability.get(name, 0.0) < SHOWN and name in diagnosis.main.votes:
        words = f"less likely than {100 * SHOWN:g} %, but predicts pose after pose as well"
    if name not in diagnosis.fits:  # a rival in fair form only
        titles = {family.name: family.effect.title for family in diagnosis.main.families}
        parts = joined([titles.get(part, part) for part in name.split(" + ")])
        return f"{parts} in a more general form than the catalogue has ({name}, {words})"
    fit = diagnosis.fits[name]
    unusual = f", more than is usual ({joined(sizes)}) " if (sizes := _unusual(fit)) else " "
    return f"{joined(fit.findings)}{unusual}({name}, {words})"


def _unusual(fit: Fit) -> list[str]:
    """Usual sizes of the parameters whose fitted values lie outside them."""
    beyond = [component.parameter for component, size in fit.parts if abs(size) > component.typical()[1]]
    return [f"{p.name.replace('_', ' ')} {p.typical[0]:g} to {p.typical[1]:g} {p.unit}".rstrip() for p in beyond]


def _outvoted(diagnosis: Diagnosis) -> str:
    """Sentence (with a leading space) on the closest rival that the named effect has outvoted; "" without votes."""
    rival, differences = next(iter(diagnosis.main.votes.items()), ("", np.zeros(0)))
    return f" Of all rivals of another part {vote_words(rival, differences)} (log probability)." if rival else ""


def _percent(chance: float) -> str:
    return "more than 99 %" if chance > 0.99 else f"{100.0 * chance:.2g} %"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _rivals(diagnosis: Diagnosis) -> str:
    """Words on the explanations that stand beside each other."""
    causes = [f"{_cause(diagnosis, entry[0])}{_alike(entry)}" for entry in diagnosis.entries]
    if len(diagnosis.explanations) < 2:
        return f"{_capital(causes[0])} is likeliest, but something else is not ruled out."
    if diagnosis.explanations[0] not in (NONE, diagnosis.best):
        return f"What is likeliest lowers no error at points that are left out: {'; '.join(causes)}."
    if diagnosis.explanations[0] == NONE and diagnosis.main.votes:
        moved = float(np.mean(np.abs(diagnosis.base.jacobian @ diagnosis.base.law)))
        causes[0] = (
            f"the strut law is off and moves the stiffness by {100.0 * moved:.2g} %{_alike(diagnosis.entries[0])}"
        )
        return f"Readings of the tip do not tell which of these it is: either {', or '.join(causes)}."
    if diagnosis.explanations[0] == NONE and diagnosis.main.base_gate.probability > FALSE_ALARM:
        looks = f"What the model leaves looks like scatter.{_most_left(diagnosis)} With what struts, joints and links"
        return f"{looks} leave that may be more than {100 * LEFT:g} %: either {', or '.join(causes)}."
    if len(causes) == 1:
        return f"{_capital(causes[0])}."
    first, second = (diagnosis.main.probability.get(name, 0.0) for name in diagnosis.explanations[:2])
    if first < POSITIVE * second:
        return f"These explain the data about equally well: either {', or '.join(causes)}."
    return f"Most likely {causes[0]}; not ruled out: {'; '.join(causes[1:])}."


def _alike(entry: Sequence[str]) -> str:
    """Words on what else is in an entry: what is alike, and what may stand in place of a strut law that had to move."""
    own = [] if entry[0] == NONE else entry[0].split(" + ")
    further = [[part for part in name.split(" + ") if part not in own] for name in entry[1:]]
    instead = [more for name, more in zip(entry[1:], further, strict=True) if own and {*own} < {*name.split(" + ")}]
    alike = [name for name, more in zip(entry[1:], further, strict=True) if more not in instead]
    words = f" - or, alike at these poses, {joined(alike)}" if alike else ""
    if not instead:
        return words
    parts = ", ".join(part for more in instead for part in more)
    return f"{words}; the strut law had to move for it, or with the file's law one of these is there too: {parts}"


def _most_left(diagnosis: Diagnosis) -> str:
    """Sentence (with a leading space) on the largest change of stiffness that is not excluded; "" if there is none."""
    further = [hidden for hidden in diagnosis.unexcluded if hidden.effect.name not in TAKEN_UP]
    most = max(further, key=lambda hidden: round(hidden.left, 9), default=None)
    return "" if most is None else f" Up to {100.0 * most.left:.2g} % are not excluded ({most.effect.name})."


def _hidden(diagnosis: Diagnosis) -> str:
    """Effects an adequate model may still hide: beside the readings, between them, in the law under a guessed noise."""
    text, (given, refitted) = _most_left(diagnosis) + _unread(diagnosis), _mean_errors(diagnosis)
    if given > LACKING * refitted and moved_by_law(diagnosis.main.problem, diagnosis.main.base) > LEFT:
        text += (
            f" But the strut law may be off: the machine as given leaves {given:.2g} %, with its law refitted "
            f"{refitted:.2g} %, and so few readings do not tell that from chance."
        )
    if not diagnosis.noise.guess:
        return text
    law = NORMAL_95 * np.sqrt(np.diag(diagnosis.base.covariance)[: len(diagnosis.machine.strut_law.parameters)].max())
    return (
        f"{text} But how far these readings scatter is only guessed: {100.0 * diagnosis.noise.typical:.2g} % a reading "
        f"would hide struts that are off by up to {100.0 * law:.2g} %, too."
    )


def _unread(diagnosis: Diagnosis) -> str:
    """The widest stretch of a strut's travel that lies between two readings, if it is wide enough to hide a fault.

    A sentence with the space before it, else "".
    """
    lengths = np.sort(np.round(mm_from_m(diagnosis.predictor.strut_lengths()), 3), axis=0)
    row, strut = np.unravel_index(np.diff(lengths, axis=0).argmax(), (len(lengths) - 1, lengths.shape[1]))
    first, last = lengths[row : row + 2, strut].tolist()
    if last - first < mm_from_m(RANGE_LENGTH):
        return ""
    return f" No reading has strut {strut + 1} between {first:.0f} and {last:.0f} mm: a fault there does not show."


def _errors(diagnosis: Diagnosis, name: str = "") -> str:
    """Mean errors as given, with the strut law refitted, and with an explanation."""
    rest = [(f"with {name}", 100.0 * float(diagnosis.fits[name].errors.mean()))] if name else []
    return f"Mean error: {errors_text(*_mean_errors(diagnosis), rest)}"


def _mean_errors(diagnosis: Diagnosis) -> tuple[float, float]:
    """Mean errors of the machine file as given and with its strut law refitted, %."""
    return 100.0 * float(diagnosis.as_given.errors.mean()), 100.0 * float(diagnosis.base.errors.mean())


def why(diagnosis: Diagnosis) -> list[str]:
    """Reasons for the verdict, the most important first."""
    main, several = diagnosis.main, len(diagnosis.judgements) > 1
    reasons = [_base_text(judgement, several) for judgement in diagnosis.judgements.values()]
    if diagnosis.verdict == "identified" and main.drawn is not None:
        reasons.append(main.drawn.reason)
    if diagnosis.verdict == "ambiguous":
        reasons += _not_told_apart(diagnosis)
    if diagnosis.verdict == "unexplained" and not main.question:
        tested = [f"{name} (p = {gate.probability:.2g})" for name, gate in list(main.gates.items())[:4]]
        reasons += [f"the best of the catalogue leave more than noise would: {', '.join(tested)}"] if tested else []
        reasons += [main.doubt] if main.noise_factor > 1.0 else []
    raised = "" if main.question else raised_text(*_mean_errors(diagnosis))
    return [*reasons, *filter(None, [raised]), *diagnosis.remarks]


def _base_text(judgement: Judgement, several: bool) -> str:
    """Words on how well the model alone fits under one noise model."""
    gate = judgement.base_gate
    under = f"under the {judgement.noise.name} noise " if several else ""
    if gate.probability > FALSE_ALARM:
        return (
            f"{under}the model without a further effect explains the data: p = {gate.probability:.2g}; weighted "
            f"squares {gate.squares:.4g}, as large or larger in {100 * gate.squares_probability:.2g} % of simulated "
            f"campaigns; no structure is left (p = {gate.structure_probability:.2g}); the best of all effects gains no "
            f"more than chance (p = {gate.gain_probability:.2g})"
        )
    return (
        f"{under}the model without a further effect does not explain the data: p = {gate.probability:.2g} (squares "
        f"{gate.squares_probability:.2g}, structure {gate.structure_probability:.2g}, gain of the best effect "
        f"{gate.gain_probability:.2g}); what stands out most is a pattern {gate.worst}"
    )


def _not_told_apart(diagnosis: Diagnosis) -> list[str]:
    """Reasons why the plausible effects cannot be told apart."""
    rivals = [(name, votes) for name, votes in diagnosis.main.votes.items() if not outvoted(votes) and name != NONE]
    reasons = [f"{vote_words(*rival)} (log probability): not beyond chance" for rival in rivals[:MOST_BESIDE]]
    gate = diagnosis.main.gates.get(diagnosis.best or "")
    if gate is not None and gate.probability <= FALSE_ALARM:
        reasons.append(f"{diagnosis.best} leaves more than noise would (p = {gate.probability:.2g}): it may be none")
    effects = [family.effect for family in diagnosis.main.families if family.name in diagnosis.plausible]
    reasons += [f"{reading_words(telling(effect))} would tell {effect.name}" for effect in effects]
    if NONE in diagnosis.plausible:
        reasons.append("chance alone is not excluded either")
    for effect in effects:
        if count := int(seen_readings([effect], diagnosis.data).sum()):
            seen = f"was read off {count} of these {len(diagnosis.data)} readings: its probability is too high"
            reasons.append(f"the form of {effect.name} {seen}")
    return reasons


def next_steps(diagnosis: Diagnosis, request: Asked | None = None) -> list[str]:
    """Next steps as hints, with commands that run as they stand."""
    request = request or diagnosis.asked or Asked(diagnosis.names)
    repeat = "repeat a few readings, re-clamped, or state --noise"
    plan, verdict = request.command("plan"), diagnosis.verdict
    # Without a plan, the remark says why there is none.
    unplanned = diagnosis.remarks[0] if diagnosis.remarks and not diagnosis.next_measurements else ""
    if verdict in NAMING:
        names = diagnosis.explanations[0].split(" + ")
        update = request.command("update", *options(add=names), "-o", request.updated_machine)
        if verdict == "described":
            measure = unplanned or hint("measure where it would be confirmed or refuted", plan)
            return [measure, hint("add it all the same, as described", update)]
        if bounded := diagnosis.fits[diagnosis.explanations[0]].at_upper_bound():  # an update would refuse it
            return [hint(f"{joined(bounded)} ends at its bound: measure more before adding it", plan)]
        return [hint("add it" if len(names) == 1 else "add them", update)]
    if verdict == "ambiguous":
        depends = [f"{repeat}: the verdict depends on the scatter"] if len(diagnosis.judgements) > 1 else []
        return [*depends, unplanned or hint("measure what tells them apart", plan), *_until_then(diagnosis, request)]
    if diagnosis.main.question:
        return [
            "check that machine file, poses and units are those of the readings: stiffness in N/mm, lengths in mm",
            hint("see which readings are how far off", request.command("compare")),
        ]
    if verdict == "unexplained":
        file = request.new_effect()
        write = hint("write the effect that you suspect as one file", command_line("effects", "new", file))
        if diagnosis.portrait is not None and any(sized.term.acts for sized in diagnosis.portrait.terms):
            file = request.new_effect("missing", ".toml")
            write = hint("write what it looks like as an effect to edit", request.command("effects draft", "-o", file))
        look = hint("look where the residuals lie", request.command("compare"))
        return [look, write, hint("and try it", request.command("diagnose", effects=[file]))]
    use = "use the model; `bounds` lists what could still be there unseen"
    return [repeat, use] if diagnosis.noise.guess else [use]


def _until_then(diagnosis: Diagnosis, request: Asked) -> list[str]:
    """Hint on lowering the error before the explanations are told apart, if an effect of the machine lowers it.

    Not where an instrument's error is far likelier than the machine: `--auto` would write it, whoever rules it out.
    """
    of_instrument = {f.name for f in diagnosis.main.families if f.effect.is_instrument} & {*diagnosis.plausible}
    likely = {name: diagnosis.main.probability.get(name, 0.0) for name in diagnosis.explanations}
    of_machine = [chance for name, chance in likely.items() if of_instrument.isdisjoint(name.split(" + "))]
    certain = POSITIVE * max(of_machine, default=0.0) < max(likely.values())
    if certain or np.mean(diagnosis.as_given.errors - diagnosis.likeliest.errors) < LEFT:
        return []
    words = options(auto=True, believe="machine" if of_instrument else None)
    trusted = f" if {joined(sorted(of_instrument))} {'is' if len(of_instrument) == 1 else 'are'} ruled out"
    update = request.command("update", *words, "-o", request.updated_machine)
    return [hint(f"until then, lower the error with what they share{trusted if of_instrument else ''}", update)]


def assumptions(diagnosis: Diagnosis) -> list[str]:
    """Sentences on what was assumed."""
    noise = diagnosis.noise
    sentences = [
        f"noise: {noise.origin}",
        f"struts differ from each other by {100 * noise.strut_spread:g} % (sd), joints stand"
        f" {mm_from_m(noise.joint_error):g} mm (sd of each coordinate) from where the machine file has them: assumed",
        f"frame, table, platform and tool give a little more or less than in the model: {100 * REST:.1g} % (sd) of the "
        "tip's stiffness along each of their axes: assumed",
        f"one reading in {1 / noise.outliers:.0f} scatters {noise.outlier_width:g} times as widely: "
        + ("assumed" if noise.outliers == OUTLIERS else "as the repeats have it"),
        f"the strut law's two stiffnesses are refitted along with everything, expected within {100 * LAW_PRIOR:g} % "
        "(sd) of the machine file: effective values, which absorb part of every other effect",
        f"sizes of effects: flat in the logarithm between {100 * EXPECTED[0]:g} and {100 * EXPECTED[1]:g} % change of "
        "stiffness, as far as these data could show them; typical sizes rank, bounds alone exclude: assumed",
        f"gates: {100 * FALSE_ALARM:g} % false alarms, explanations are dropped below {100 * ADEQUATE:g} %; "
        f"the plausible set holds {100 * HELD:g} %",
        "a name has predicted pose after pose better than every rival of another part, "
        f"by {SMALL:g} of log probability and in {100 * (1 - CHANCE):g} % of bootstrap draws over the poses, "
        f"or by {SMALL:g} without the pose that says most; else it is one of several",
        f"a model is adequate where its refitted strut law moves the stiffness by up to {100 * LEFT:g} % (95 %), or "
        "nothing else explains the readings as well beside the file's law; and where no effect may hide more (95 %) "
        "beside what struts and joints leave on average: assumed",
        f"a further effect matters from {100 * MATTERS:g} % of the tip's stiffness on",
    ]
    if "force_N" in diagnosis.data.missing:
        sentences.append(f"load of every reading: {defaults.FORCE:g} N, assumed because force_N is missing")
    return sentences


def beside_text(unexcluded: Sequence[Unexcluded]) -> str:
    """Words on effects neither shown nor excluded, and where an indicator would tell; "" if there are none."""
    if not unexcluded:
        return ""
    named, more, effects = unexcluded[:MOST_BESIDE], len(unexcluded) - MOST_BESIDE, list[str]()
    for hidden in named:
        parameter, choice = hidden.parameter, hidden.candidate.choice
        chosen = [choice_text(key, value) for key, value in choice if value not in ("", 0)]
        way = "down to" if np.isinf(parameter.neutral) else "up to"  # a stiffness goes down
        up_to = f"{way} {float(f'{hidden.value / parameter.si:.2g}'):g} {parameter.unit}"
        share = f"{100.0 * hidden.rms:.2g} % of the tip's stiffness"
        effects.append(f"{hidden.effect.name} ({', '.join([up_to, *chosen, share])})")
    effects += [f"{more} more"] if more > 0 else []
    places = dict.fromkeys(INDICATORS[hidden.effect.link].split(":")[0] for hidden in named)
    tells = " or ".join(place for place in places if place != "none")
    words = f"{joined(effects)}: the readings neither show nor exclude {'it' if len(unexcluded) == 1 else 'them'}"
    return f"{words}; an indicator {tells} would tell" if tells else words
