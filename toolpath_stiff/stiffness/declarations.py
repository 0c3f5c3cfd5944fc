"""Declarations of an effect, checked against the contract when it is loaded; each mistake is given with its line."""

import difflib
import inspect
import math
import re
from collections.abc import Callable, Iterator
from typing import Any

from toolpath_stiff.errors import EffectError
from toolpath_stiff.stiffness.contract import HOOKS, LINKS, Effect, Parameter
from toolpath_stiff.stiffness.effect_source import line_of
from toolpath_stiff.toml_reader import is_number, is_text

TEXTS = ("name", "title", "link", "equation", "source")
NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)  # of an effect or a parameter; a bare key of a machine file
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+", re.ASCII)
KINDS = ("real", "integer", "text")


def _are_texts(value: object) -> bool:
    return isinstance(value, tuple | list) and all(isinstance(entry, str) for entry in value)


# Attribute, test of its value, expected value.
RULES: list[tuple[str, Callable[[Any], object], str]] = [
    *((attribute, is_text, "a text that is not empty") for attribute in TEXTS),
    ("name", NAME.fullmatch, "letters, digits and underscores, such as my_screw"),
    ("link", LINKS.__contains__, f"one of {', '.join(LINKS)}"),
    *((flag, (False, True).__contains__, "True or False") for flag in ("load_dependent", "unknown_to_control")),
    *((names, _are_texts, 'texts in brackets, such as ("time_min",)') for names in ("needs", "described_from")),
    ("parameters", lambda value: isinstance(value, tuple | list), "(Parameter(...), ...), with a comma"),
]


def check_declarations(effect: Effect, where: str) -> None:
    """Refuse an incomplete effect; `where` is its file.

    Raises
    ------
    InputError
        Something is missing, of the wrong kind, or contradicts itself; with the line of the declaration.
    """
    for attribute, mistake, expected in _faults(effect):
        kind = type(effect)
        line = line_of(kind, attribute)
        raise EffectError(f"effect {kind.__name__}: {mistake}", expected=expected, file=where, line=line)


def _faults(effect: Any) -> Iterator[tuple[str, str, str]]:
    """Attribute, mistake, expected value; only the first one is certain to be a fault."""
    for attribute, holds, expected in RULES:
        if not hasattr(effect, attribute):
            yield "", f"`{attribute}` is missing", ""
        if not holds(value := getattr(effect, attribute)):
            yield attribute, f"{attribute} = {value!r:.60}", expected
    names = []
    for parameter in effect.parameters:
        if not isinstance(parameter, Parameter):
            yield "parameters", f"parameters hold {parameter!r:.60}", "Parameter(...)"
        if wrong := wrong_in(parameter):
            yield "parameters", f"parameter {parameter.name}: {wrong[0]}", wrong[1]
        if parameter.name in names:
            yield "parameters", f"parameter {parameter.name} is declared twice", ""
        names.append(parameter.name)
    for name, value in vars(type(effect)).items():
        if inspect.isfunction(value) and name not in HOOKS and not name.startswith("_"):
            for near in difflib.get_close_matches(name, HOOKS, n=1, cutoff=0.8):
                yield name, f"method {name} is never called", near
    if not effect.hooks:
        yield "", "adds nothing", f"one of the methods {', '.join(HOOKS)}"
    if effect.is_instrument != (effect.hooks == ["reading"]):
        mistake = f"link = {effect.link!r} with {', '.join(effect.hooks)}"
        yield "link", mistake, '`reading` alone with link "instrument", or the others with another link'


def wrong_in(parameter: Parameter) -> tuple[str, str] | None:
    """Mistake in a parameter, and what was expected."""
    if not _are_texts((parameter.name, parameter.unit, parameter.source, parameter.meaning)):
        return "not of texts", "texts as name, unit, source and meaning"
    if not NAME.fullmatch(parameter.name):
        return f"name = {parameter.name!r}", "letters, digits and underscores"
    if parameter.kind not in KINDS:
        return f"kind = {parameter.kind!r}", f"one of {', '.join(KINDS)}"
    if not BARE_KEY.fullmatch(parameter.key):
        return f"unit = {parameter.unit!r} makes the key {parameter.key!r}", "a unit in plain letters, such as um, N/um"
    if not _are_numbers([parameter.si], 1) or not 0.0 < parameter.si < math.inf:
        return "si is no number above 0", f"the SI value of one {parameter.unit or 'unit'}, such as 1e-9"
    if parameter.kind == "text":
        return None
    counts = {"bounds": parameter.bounds, "typical": parameter.typical, "neutral": [parameter.neutral]}
    for name, pair in counts.items():
        if not _are_numbers(pair, 1 if name == "neutral" else 2):
            return f"{name} is not of numbers", "bounds and typical = (low, high), neutral a number"
    (low, high), typical = parameter.bounds, parameter.typical
    if not low < high or not low <= parameter.neutral <= high:
        return f"bounds {low:g} to {high:g}, neutral {parameter.neutral:g}", "low < high with the neutral between them"
    if not low <= typical[0] <= typical[1] <= high:
        return f"typical {typical[0]:g} to {typical[1]:g}", f"low <= high within the bounds {low:g} to {high:g}"
    return None


def _are_numbers(values: object, count: int) -> bool:
    """True for this count of numbers that a float can hold: Python's whole numbers may be larger."""
    if not isinstance(values, tuple | list) or len(values) != count or not all(map(is_number, values)):
        return False
    try:
        return not any(math.isnan(float(value)) for value in values)
    except OverflowError:
        return False
