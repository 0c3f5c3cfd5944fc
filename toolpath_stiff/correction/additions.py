"""What `tps update --add` names: an effect and, if the user says so, what it acts on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.candidates import Candidate, Component, candidates_of
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.contract import Effect, Parameter

AXES = {"X": 1, "Y": 2, "Z": 3}


@dataclass(frozen=True)
class Addition:
    """An effect to be added.

    Attributes
    ----------
    effect
        The effect.
    choice
        Values of discrete parameters that the user chose; what is not in it is searched.
    """

    effect: Effect
    choice: Mapping[str, Any]

    def candidates(self, data: Readings) -> list[Candidate]:
        """What may be fitted: one candidate a choice that is left open."""
        discrete = [p for p in self.effect.parameters if p.discrete]
        if not self.choice:
            return candidates_of(self.effect, data)
        values = {p.name: self.choice.get(p.name, "" if p.kind == "text" else 0) for p in discrete}
        real = tuple(Component.of(p) for p in self.effect.parameters if not p.discrete)
        return [Candidate(self.effect, tuple(values.items()), real)]


def parse_addition(text: str, data: Readings, effect_files: Sequence[str | Path] = ()) -> Addition:
    """`weak_strut`, `weak_strut:strut=3`, `gauge_scale:direction=Z,setup=riser`.

    Raises
    ------
    InputError
        There is no such effect, it has no such choice, or the data lack a column that it needs.
    """
    name, _, rest = text.partition(":")
    effect = find_effect(name.strip(), effect_files)
    lacking = data.cannot_test([effect]).get(effect.name)
    if lacking:
        raise InputError(
            f"these data cannot test {effect.name}: column {', '.join(lacking)} is missing",
            hint="measure with it, or add another effect",
        )
    if not any(not p.discrete for p in effect.parameters):
        raise InputError(f"effect {effect.name} has no parameter that could be fitted")
    choices = {p.name: p for p in effect.parameters if p.discrete}
    choice = {}
    for part in filter(None, (piece.strip() for piece in rest.split(","))):
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if key not in choices or not equals:
            known = ", ".join(f"{key}=..." for key in choices) or f"nothing after {effect.name}: it has no choices"
            raise InputError(f"--add {text}: {part!r}", expected=known)
        choice[key] = _chosen(choices[key], value, text, data)
    return Addition(effect, choice)


def _chosen(parameter: Parameter, value: str, text: str, data: Readings) -> Any:
    """The value of a choice. A direction may be called by its axis, a set-up must be one of the data's."""
    if parameter.kind == "text":
        setups = sorted(set(data.setup.tolist()) - {""})
        if parameter.name == "setup" and value not in setups:
            raise InputError(f"--add {text}: the data have no set-up {value!r}", expected=f"one of {', '.join(setups)}")
        return value
    low, high = (int(bound) for bound in parameter.bounds)
    if parameter.name == "direction" and value.upper() in AXES:
        return AXES[value.upper()]
    if not value.isdigit() or not low <= int(value) <= high:
        raise InputError(f"--add {text}: {parameter.name} = {value!r}", expected=parameter.expected)
    return int(value)
