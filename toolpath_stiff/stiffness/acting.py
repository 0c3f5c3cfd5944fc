"""Which effects of a model act, what the others wait for, and how that is said: the same words in every result.

Measurements bring set-up, time and temperature reading by reading. A program does not: what it runs under are the
model's `Conditions`. An effect without a condition that it waits for adds nothing, which must not pass unnoticed.
"""

from __future__ import annotations

import difflib
import shlex
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.stiffness.effects.contract import SETUP
from toolpath_stiff.stiffness.model import ActiveEffect, StiffnessModel
from toolpath_stiff.units import mm_from_m

NO_SETUP = "none"  # what a user calls a set-up that none of the effects belongs to
TOOL = "tool_extension_mm"
# Condition -> what it is, how a program gets it.
WORDS = {
    "temperature_C": ("the temperature, which nobody gives", "--temperature"),
    "time_min": ("the time since an indicator was zeroed, which no program has", ""),
    "direction": ("the direction of a reading, which no program has", ""),
}


@dataclass(frozen=True)
class Idle:
    """An effect of the model that adds nothing here.

    Attributes
    ----------
    effect, reason
        Its name; what it waits for, or why it stands aside, as the end of a sentence.
    waiting
        Whether a condition is missing; else it is known, and the effect belongs to another set-up.
    """

    effect: str
    reason: str
    waiting: bool

    def __str__(self) -> str:
        return f"{self.effect} does not act: {self.reason}"


def idle_effects(model: StiffnessModel) -> list[Idle]:
    """The effects that add nothing to a program run under the model's conditions; instruments never do."""
    found = [_idle(active, model) for active in model.effects]
    return [one for one in found if one is not None]


def acting_effects(model: StiffnessModel) -> tuple[ActiveEffect, ...]:
    """The other effects: those that headers list."""
    return tuple(active for active in model.effects if _idle(active, model) is None)


def acting_names(model: StiffnessModel) -> list[str]:
    """Their names."""
    return [active.effect.name for active in acting_effects(model)]


def _idle(active: ActiveEffect, model: StiffnessModel) -> Idle | None:
    waits_for, own = active.effect.conditions(active.values), setup_of(active)
    missing = [name for name in waits_for if name not in model.conditions.known]
    if missing:
        return Idle(active.effect.name, "; ".join(_missing(name, own) for name in missing), True)
    if SETUP in waits_for and own and own != model.conditions.setup:
        here = f"this is {model.conditions.setup!r}" if model.conditions.setup else "that is not there"
        return Idle(active.effect.name, f"it belongs to set-up {own!r}, and {here}", False)
    return None


def _missing(name: str, own: str) -> str:
    if name == SETUP:
        belongs = f"it belongs to set-up {own!r}" if own else "it needs the set-up"
        option = f"--setup {shlex.quote(own) if own else 'NAME'}"
        return f"{belongs}, and nobody says which set-up this is ({option}, or --setup {NO_SETUP})"
    what, option = WORDS[name]
    return f"it needs {what}" + (f" ({option})" if option else "")


def setup_of(active: ActiveEffect) -> str:
    """The set-up that an effect belongs to, "" if it names none."""
    named = any(p.name == SETUP and p.kind == "text" for p in active.effect.parameters)
    return str(active.values[SETUP]) if named else ""


def condition_warnings(model: StiffnessModel, tool_given: bool = False) -> list[str]:
    """What of the model does not act on a program, for want of a condition or as an instrument; sentences for people.

    `tool_given`: whether the length of the tool is known; else it is the reference tool's.
    """
    names = ", ".join(active.effect.name for active in model.instruments)
    found = [f"instruments set aside, they act on readings and not on the machine: {names}"] if names else []
    found += [str(one) for one in idle_effects(model) if one.waiting]
    length = mm_from_m(model.machine.reference_tool_length)
    if not tool_given:
        found += [
            f"{active.effect.name} acts as with the reference tool ({length:g} mm): nobody gives the tool's length"
            for active in acting_effects(model)
            if TOOL in active.effect.needs
        ]
    given = model.given
    asked = model.conditions.setup and (given is None or given.setup != model.conditions.setup)
    if asked and not any(SETUP in active.effect.conditions(active.values) for active in model.effects):
        name = model.machine.name
        found.append(f"set-up {model.conditions.setup!r} changes nothing: no effect of machine {name} depends on it")
    return found


def conditions_stated(model: StiffnessModel) -> list[str]:
    """What the results assume of set-up and temperature, and which effects stand aside for it."""
    found = []
    if model.conditions.setup is not None:
        found.append(f"set-up: {model.conditions.setup or NO_SETUP}")
    if model.conditions.temperature is not None:
        found.append(f"temperature: {model.conditions.temperature:g} degrees C")
    return found + [str(one) for one in idle_effects(model) if not one.waiting]


def effects_stated(model: StiffnessModel) -> dict[str, Any]:
    """The entries of a result's JSON: what acts, what does not and why, under which set-up and temperature."""
    return {
        "effects": acting_names(model),
        "effects_idle": [{"effect": one.effect, "reason": one.reason} for one in idle_effects(model)],
        "setup": NO_SETUP if model.conditions.setup == "" else model.conditions.setup,
        "temperature_C": model.conditions.temperature,
    }


def machine_words(document: Mapping[str, Any]) -> str:
    """The machine of a result, what acts on it, the set-up: "nist with setup_compliance, set-up riser"."""
    effects = document.get("effects") or []
    parts = [f"{document.get('machine') or '-'}" + (f" with {', '.join(map(str, effects))}" if effects else "")]
    return ", ".join(parts + ([f"set-up {document['setup']}"] if document.get("setup") else []))


def idle_on_readings(model: StiffnessModel, missing: Collection[str], setups: Collection[str]) -> dict[str, str]:
    """Effects and instruments of the model that add nothing to readings -> a sentence for people.

    `missing`: columns that the readings lack; `setups`: names that occur in them.
    """
    found = {}
    for active in (*model.effects, *model.instruments):
        waits_for, own = active.effect.conditions(active.values), setup_of(active)
        lacking = ", ".join(name for name in waits_for if name in missing)
        if lacking or (SETUP in waits_for and own and own not in setups):
            why = f"column {lacking} is missing" if lacking else f"none is of set-up {own!r}"
            name = active.effect.name
            found[name] = f"{name} of the machine file does not act on these readings: {why}"
    return found


def known_setups(models: Iterable[StiffnessModel]) -> list[str]:
    """The set-ups that machine files list and effects name."""
    found: list[str] = []
    for model in models:
        found += (model.given or model.machine).setups
        found += [setup_of(active) for active in (*model.effects, *model.instruments)]
    return [name for name in dict.fromkeys(found) if name]


def check_setup(setup: str, said_by: str, *models: StiffnessModel) -> None:
    """Refuse a set-up that no machine file lists and no effect names; any will do if none is known.

    Raises `InputError`, which begins with `said_by`.
    """
    known = known_setups(models)
    effects = [active for model in models for active in model.effects]
    takes_any = any(SETUP in one.effect.needs and not setup_of(one) for one in effects)
    if setup in ("", NO_SETUP, *known) or takes_any or not known:
        return
    near = difflib.get_close_matches(setup, known, n=1)
    raise InputError(
        f"{said_by}: set-up {setup!r} is not known",
        expected=f"one of {', '.join(known)}, or {NO_SETUP}",
        hint=f"did you mean {near[0]}?" if near else "a machine file lists its set-ups as `names` of [setup]",
    )
