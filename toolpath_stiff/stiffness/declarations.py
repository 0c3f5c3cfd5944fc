"""What an effect declares, held against the contract when it is loaded; each mistake with the line that makes it."""

from __future__ import annotations

import difflib
import inspect
import math
import re
import sys
from collections.abc import Callable
from typing import Any

from toolpath_stiff.errors import EffectError, InputError
from toolpath_stiff.stiffness.contract import HOOKS, LINKS, Effect, Parameter
from toolpath_stiff.stiffness.effect_source import line_of
from toolpath_stiff.toml_reader import is_text

TEXTS = ("name", "title", "link", "equation", "source")
NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)  # of an effect or a parameter; a bare key of a machine file
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+", re.ASCII)
KINDS = ("real", "integer", "text")
LONGEST_SHOWN = 200  # characters of a value in a message

Refuse = Callable[..., InputError]


def _is_flag(value: object) -> bool:
    return isinstance(value, bool)


def _are_texts(value: object) -> bool:
    return isinstance(value, tuple | list) and all(isinstance(entry, str) for entry in value)


# Attribute, whether a value will do, what is expected.
RULES: list[tuple[str, Callable[[Any], object], str]] = [
    *((attribute, is_text, "a text that is not empty") for attribute in TEXTS),
    ("name", NAME.fullmatch, "letters, digits and underscores, such as my_screw"),
    ("link", LINKS.__contains__, f"one of {', '.join(LINKS)}"),
    ("load_dependent", _is_flag, "True or False"),
    ("unknown_to_control", _is_flag, "True or False"),
    ("needs", _are_texts, 'names of columns: ("time_min",)'),
    ("described_from", _are_texts, "marks of readings, a tuple of texts"),
    ("parameters", lambda value: isinstance(value, tuple | list), "(Parameter(...), ...), with a comma"),
]


def check_declarations(effect: object, where: str) -> None:
    """Refuse what is not a complete effect.

    Parameters
    ----------
    effect
        An instance.
    where
        The file, or the name of the entry point, for messages.

    Raises
    ------
    InputError
        Something is missing, of the wrong kind, or contradicts itself; with the line of the declaration.
    """
    if not isinstance(effect, Effect):
        raise EffectError(f"{effect!r} is not an effect", file=where)
    kind = type(effect)

    def refuse(attribute: str, mistake: str, expected: str = "", index: int | None = None) -> InputError:
        line = line_of(kind, attribute, index)
        return EffectError(f"effect {kind.__name__}: {mistake}", expected=expected, file=where, line=line)

    for attribute in (*TEXTS, "parameters"):
        if not hasattr(effect, attribute):
            raise refuse("", f"`{attribute}` is missing")
    for attribute, holds, expected in RULES:
        value = getattr(effect, attribute)
        if not holds(value):
            raise refuse(attribute, f"{attribute} = {value!r:.60}", expected)
    for i, parameter in enumerate(effect.parameters):
        if not isinstance(parameter, Parameter):
            raise refuse("parameters", f"parameters hold {parameter!r:.60}", "Parameter(...)", i)
        if wrong := wrong_in(parameter):
            raise refuse("parameters", f"parameter {parameter.name}: {wrong[0]}", wrong[1], i)
        if parameter.name in [earlier.name for earlier in effect.parameters[:i]]:
            raise refuse("parameters", f"parameter {parameter.name} is declared twice", index=i)
    _check_hooks(effect, refuse)


def wrong_in(parameter: Parameter) -> tuple[str, str] | None:
    """What is wrong, and what was expected."""
    for attribute in ("name", "unit", "source", "meaning"):
        if not isinstance(getattr(parameter, attribute), str):
            return f"{attribute} = {getattr(parameter, attribute)!r}", "a text"
    if not NAME.fullmatch(parameter.name):
        return f"name = {parameter.name!r}", "letters, digits and underscores"
    if parameter.kind not in KINDS:
        return f"kind = {parameter.kind!r}", f"one of {', '.join(KINDS)}"
    if not BARE_KEY.fullmatch(parameter.key):
        return f"unit = {parameter.unit!r} makes the key {parameter.key!r}", "a unit in plain letters, such as um, N/um"
    if not _is_number(parameter.si) or not 0.0 < parameter.si < math.inf:
        expected = f"the SI value of one {parameter.unit or 'unit'} as a number, such as 1e-9"
        return f"si = {_shown(parameter.si)}", expected
    if parameter.kind == "text":
        return None
    for attribute in ("bounds", "typical"):
        pair = getattr(parameter, attribute)
        good = isinstance(pair, tuple | list) and len(pair) == 2 and all(map(_is_number, pair))
        if not good or any(math.isnan(value) for value in pair):
            return f"{attribute} = {_shown(pair)}", "two numbers (low, high)"
    (low, high), typical = parameter.bounds, parameter.typical
    if not _is_number(parameter.neutral):
        return f"neutral = {_shown(parameter.neutral)}", "a number, or inf"
    if not low < high or not low <= parameter.neutral <= high:
        mistake = f"bounds {tuple(parameter.bounds)}, neutral {parameter.neutral:g}"
        return mistake, "low < high with the neutral value between them"
    if not low <= typical[0] <= typical[1] <= high:
        return f"typical {tuple(typical)}, bounds {tuple(parameter.bounds)}", "low <= high within the bounds"
    return None


def _is_number(value: object) -> bool:
    """Whether it is a number that a float holds: Python's whole numbers may be larger."""
    if isinstance(value, int) and not isinstance(value, bool):
        return abs(value) <= sys.float_info.max
    return isinstance(value, float)


def _shown(value: object) -> str:
    """A value in a few words where it is endless; Python writes no whole number of more than 4,300 digits."""
    try:
        text = repr(value)
    except ValueError:
        return "a number of thousands of digits"
    return text if len(text) <= LONGEST_SHOWN else f"{text[:10]}... ({len(text)} characters)"


def _check_hooks(effect: Effect, refuse: Refuse) -> None:
    """At least one hook of its own, as a method, and none with a slip in its name."""
    kind = type(effect)
    for name, value in vars(kind).items():
        slip = not name.startswith("_") and name not in HOOKS and inspect.isfunction(value)
        if slip and (near := difflib.get_close_matches(name, HOOKS, n=1, cutoff=0.8)):
            raise refuse(name, f"method {name} is never called", near[0])
    for hook in HOOKS:
        if not callable(getattr(effect, hook)):
            raise refuse(hook, f"{hook} = {getattr(effect, hook)!r:.60}", "a method")
    hooks = effect.hooks
    if not hooks:
        raise refuse("", "adds nothing", f"one of the methods {', '.join(HOOKS)}")
    if effect.is_instrument != (hooks == ["reading"]):
        mistake = f"link = {effect.link!r} with the method{'s' if len(hooks) > 1 else ''} {', '.join(hooks)}"
        raise refuse("link", mistake, '`reading` alone with link "instrument", or the others with another link')
