"""Effects that a machine can have, and trials of them, as text and for JSON."""

import math

from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.stiffness.catalogue import EffectCatalogue
from toolpath_stiff.stiffness.contract import Effect, Parameter
from toolpath_stiff.stiffness.trial import EffectCheck

WIDE = 1000  # columns: names of parameters are not cut
TRIAL_WORDS = {True: "good", False: "FAILS", None: "note"}


def trials_text(check: EffectCheck) -> str:
    """Results of the trial of each effect in a file, as text."""
    lines = []
    for row in check.to_dict()["effects"]:
        lines.append(f"{row['effect']}, on machine {check.machine}: {'good' if row['passed'] else 'FAILS'}")
        width = max(len(outcome["name"]) for outcome in row["checks"])
        for outcome in row["checks"]:
            lines.append(f"  {TRIAL_WORDS[outcome['passed']]:<5}  {outcome['name']:<{width}}  {outcome['found']}")
    return "\n".join(lines)


def describe_effect(effect: Effect) -> dict[str, object]:
    """Declarations of an effect, in its own units; "inf" stands for infinity, which JSON lacks."""
    of_parameter = ("name", "key", "unit", "bounds", "typical", "neutral", "kind", "meaning", "source")
    return {
        **{name: getattr(effect, name) for name in ("name", "title", "link", "equation", "source", "load_dependent")},
        "needs": list(effect.needs),
        "parameters": [{name: _plain(getattr(p, name)) for name in of_parameter} for p in effect.parameters],
    }


def _plain(value: object) -> object:
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def text(catalogue: EffectCatalogue) -> str:
    """One line per effect: link, name, title, parameters with their units."""
    rows = []
    for effect in catalogue.effects:
        parameters = ", ".join(f"{p.name} ({p.unit})" if p.unit else p.name for p in effect.parameters)
        rows.append((effect.link, effect.name, effect.title, parameters or "-"))
    return "\n".join(ShownTable(("link", "name", "title", "parameters"), rows).lines(least=0, width=WIDE))


def effect_details(effect: Effect) -> str:
    """The whole effect as text, with the lines for a machine file."""
    lines = [f"{effect.name}: {effect.title}"]
    lines += [f"  {name:<10} {getattr(effect, name)}" for name in ("link", "equation", "source")]
    if effect.load_dependent:
        lines.append("  load       depends on the size of the load (--force, force_N): the stiffness is the secant one")
    if effect.needs:
        lines.append(f"  needs      columns {', '.join(effect.needs)} in the measurements")
    for p in effect.parameters:
        lines += ["", f"  {p.key}", f"    meaning  {p.meaning or p.name}"]
        if p.discrete:
            lines += [f"    value    {p.expected}; chosen, not fitted", f"    source   {p.source}"]
            continue
        lines += [
            f"    bounds   {_range(p.bounds, p)}",
            f"    typical  {_range(p.typical, p)}",
            f"    source   {p.source}",
            f"    neutral  {p.neutral:g}",
        ]
    kind = "instrument" if effect.is_instrument else "effect"
    lines += ["", "In a machine file:", f"  [[{kind}]]", f'  name = "{effect.name}"']
    lines += [f'  {p.key} = ""' if p.kind == "text" else f"  {p.key} = {p.typical[0]:g}" for p in effect.parameters]
    return "\n".join(lines)


def _range(values: tuple[float, float], parameter: Parameter) -> str:
    return f"{values[0]:g} to {values[1]:g} {parameter.unit}".rstrip()
