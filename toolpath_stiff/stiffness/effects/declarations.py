"""What an effect declares, checked when it is loaded: each mistake with the line of the file that makes it."""

from __future__ import annotations

import ast
import difflib
import inspect
import math
import re
from pathlib import Path
from typing import Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.stiffness.effects.contract import LINKS, Effect, Parameter
from toolpath_stiff.stiffness.effects.guard import HOOKS

TEXTS = ("name", "title", "link", "equation", "source")
NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)  # of an effect or a parameter; a bare key of a machine file
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+", re.ASCII)
KINDS = ("real", "integer", "text")


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
        raise InputError(f"{effect!r} is not an effect", file=where)
    own = type(effect)

    def refuse(attribute: str, found: str, expected: str = "", index: int | None = None) -> InputError:
        line = line_of(own, attribute, index)
        return InputError(f"effect {own.__name__}: {found}", expected=expected, file=where, line=line)

    for attribute in (*TEXTS, "parameters"):
        if not hasattr(effect, attribute):
            raise refuse("", f"`{attribute}` is missing")
    for attribute in TEXTS:
        value = getattr(effect, attribute)
        if not isinstance(value, str) or not value.strip():
            raise refuse(attribute, f"{attribute} = {value!r}", "a text that is not empty")
    if not NAME.fullmatch(effect.name):
        raise refuse("name", f"name = {effect.name!r}", "letters, digits and underscores, such as my_screw")
    if effect.link not in LINKS:
        raise refuse("link", f"link = {effect.link!r}", f"one of {', '.join(LINKS)}")
    for attribute in ("load_dependent", "unknown_to_control"):
        if not isinstance(getattr(effect, attribute), bool):
            raise refuse(attribute, f"{attribute} = {getattr(effect, attribute)!r}", "True or False")
    if not isinstance(effect.needs, tuple | list) or not all(isinstance(name, str) for name in effect.needs):
        raise refuse("needs", f"needs = {effect.needs!r}", 'names of columns: ("time_min",)')
    if not isinstance(effect.parameters, tuple | list):
        raise refuse("parameters", f"parameters = {effect.parameters!r:.60}", "(Parameter(...), ...), with a comma")
    for i, parameter in enumerate(effect.parameters):
        if not isinstance(parameter, Parameter):
            raise refuse("parameters", f"parameters hold {parameter!r:.60}", "Parameter(...)", i)
        wrong = _wrong_in(parameter)
        if wrong:
            raise refuse("parameters", f"parameter {parameter.name}: {wrong[0]}", wrong[1], i)
        if parameter.name in [earlier.name for earlier in effect.parameters[:i]]:
            raise refuse("parameters", f"parameter {parameter.name} is declared twice", index=i)
    _check_hooks(effect, refuse)


def _wrong_in(parameter: Parameter) -> tuple[str, str] | None:
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
        return f"si = {parameter.si!r}", f"the SI value of one {parameter.unit or 'unit'} as a number, such as 1e-9"
    if parameter.kind == "text":
        return None
    for attribute in ("bounds", "typical"):
        pair = getattr(parameter, attribute)
        good = isinstance(pair, tuple | list) and len(pair) == 2 and all(map(_is_number, pair))
        if not good or any(math.isnan(value) for value in pair):
            return f"{attribute} = {pair!r}", "two numbers (low, high)"
    (low, high), typical = parameter.bounds, parameter.typical
    if not _is_number(parameter.neutral):
        return f"neutral = {parameter.neutral!r}", "a number, or inf"
    if not low < high or not low <= parameter.neutral <= high:
        found = f"bounds {tuple(parameter.bounds)}, neutral {parameter.neutral:g}"
        return found, "low < high with the neutral value between them"
    if not low <= typical[0] <= typical[1] <= high:
        return f"typical {tuple(typical)}, bounds {tuple(parameter.bounds)}", "low <= high within the bounds"
    return None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _check_hooks(effect: Effect, refuse: Any) -> None:
    """At least one hook of its own, as a method, and none with a slip in its name."""
    own = type(effect)
    for name, value in vars(own).items():
        if name.startswith("_") or name in HOOKS or not inspect.isfunction(value):
            continue
        near = difflib.get_close_matches(name, HOOKS, n=1, cutoff=0.8)
        if near:
            raise refuse(name, f"method {name} is never called", near[0])
    for hook in HOOKS:
        if not callable(getattr(effect, hook)):
            raise refuse(hook, f"{hook} = {getattr(effect, hook)!r:.60}", "a method")
    hooks = [hook for hook in HOOKS if getattr(own, hook) is not getattr(Effect, hook)]
    if not hooks:
        raise refuse("", "adds nothing", f"one of the methods {', '.join(HOOKS)}")
    if effect.is_instrument != (hooks == ["reading"]):
        found = f"link = {effect.link!r} with the method{'s' if len(hooks) > 1 else ''} {', '.join(hooks)}"
        raise refuse("link", found, '`reading` alone with link "instrument", or the others with another link')


def line_of(own: type, attribute: str, index: int | None = None) -> int | None:
    """Line of a class, of what it assigns or defines, or of an element of that."""
    tree = _parsed(inspect.getsourcefile(own)) if _has_source(own) else None
    for node in ast.walk(tree) if tree else ():
        if isinstance(node, ast.ClassDef) and node.name == own.__name__:
            return _line_within(node, attribute, index)
    return None


def _line_within(node: ast.ClassDef, attribute: str, index: int | None) -> int:
    for part in node.body:
        if isinstance(part, ast.FunctionDef) and part.name == attribute:
            return part.lineno
        targets = (
            part.targets if isinstance(part, ast.Assign) else [part.target] if isinstance(part, ast.AnnAssign) else []
        )
        if any(isinstance(target, ast.Name) and target.id == attribute for target in targets):
            value = getattr(part, "value", None)
            if index is not None and isinstance(value, ast.Tuple | ast.List) and index < len(value.elts):
                return value.elts[index].lineno
            return part.lineno
    return node.lineno


def _has_source(own: type) -> bool:
    try:
        return inspect.getsourcefile(own) is not None
    except TypeError:  # built in, or its module is gone
        return False


def _parsed(file: str | None) -> ast.Module | None:
    try:
        return ast.parse(Path(file or "").read_text("utf-8"))
    except (OSError, ValueError, SyntaxError):
        return None
