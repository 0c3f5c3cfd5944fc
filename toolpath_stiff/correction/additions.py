"""Effects that `tps update --add` names and, if the user states them, the elements they act on."""

from collections.abc import Callable, Sequence
from pathlib import Path

from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.candidates import Candidate, Component, candidates_of
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.readings.pulls import Pulls
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.contract import Effect, Parameter

AXES = {"X": "1", "Y": "2", "Z": "3"}


def parse_addition(
    text: str,
    data: Readings | Pulls,
    effect_files: Sequence[str | Path] = (),
    choices_of: Callable[[Effect], list[Candidate]] | None = None,
) -> list[Candidate]:
    """Candidates for a text such as `weak_strut`, `weak_strut:strut=3`, `gauge_scale:direction=Z,setup=riser`.

    One candidate of the choices that are named, or one for each choice where none is (`choices_of`).

    Raises
    ------
    InputError
        There is no such effect, it has no such choice, or the data lack a column that it needs.
    """
    name, _, rest = text.partition(":")
    effect = find_effect(name.strip(), effect_files)
    if lacking := data.cannot_test([effect]).get(effect.name):
        fault = f"these data cannot test {effect.name}: column {', '.join(lacking)} is missing"
        raise InputError(fault, hint="measure with it, or add another effect")
    choices = {p.name: p for p in effect.parameters if p.discrete}
    values: dict[str, str | int] = {name: "" if p.kind == "text" else 0 for name, p in choices.items()}
    for part in filter(None, map(str.strip, rest.split(","))):
        key, equals, value = map(str.strip, part.partition("="))
        if key not in choices or not equals:
            known = ", ".join(f"{key}=..." for key in choices) or f"nothing after {effect.name}: it has no choices"
            raise InputError(f"--add {text}: {part!r}", expected=known)
        values[key] = _chosen(choices[key], value, text, data)
    real = tuple(Component.of(p) for p in effect.parameters if not p.discrete)
    named = [Candidate(effect, tuple(values.items()), real)]
    candidates = named if rest.strip() else choices_of(effect) if choices_of else candidates_of(effect, data)
    if not candidates or not real:
        raise InputError(f"--add {text}: nothing of it could be fitted to these data")
    return candidates


def _chosen(parameter: Parameter, value: str, text: str, data: Readings | Pulls) -> str | int:
    """Value of a choice. A direction may be given by its axis; a set-up must be one of the data's."""
    if parameter.kind == "text":
        setups = sorted(set(data.setup.tolist()) - {""})
        if parameter.name == "setup" and value not in setups:
            raise InputError(f"--add {text}: the data have no set-up {value!r}", expected=f"one of {', '.join(setups)}")
        return value
    low, high = parameter.bounds
    number = AXES.get(value.upper(), value) if parameter.name == "direction" else value
    if not number.isdigit() or not low <= int(number) <= high:
        raise InputError(f"--add {text}: {parameter.name} = {value!r}", expected=parameter.expected)
    return int(number)
