"""Effects from outside the package held against the contract: what they declare, and what they return.

Declarations are checked when an effect is loaded, each mistake with the line of the file that makes it. What its
methods return is checked before it enters a result; each fault is one `EffectFault` with file and line of the effect's
code and the pose. The packaged effects are held against the contract by the tests and go through unchecked.
"""

from __future__ import annotations

import ast
import difflib
import inspect
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.errors import EffectError, EffectFault, InputError
from toolpath_stiff.hints import command_line
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.stiffness.contract import LINKS, Effect, LoadPath, Parameter
from toolpath_stiff.units import mm_from_m

# What each hook returns for n poses: shape beyond n, and in words.
SHAPES: dict[str, tuple[tuple[int, ...], str]] = {
    "strut_compliance": ((6,), "(n, 6) m/N"),
    "load_compliance": ((12, 12), "(n, 12, 12), symmetric"),
    "parallel_stiffness": ((6, 6), "(n, 6, 6), symmetric"),
}


HOOKS = (*SHAPES, "geometry", "reading")


ASYMMETRY = 1e-9  # of the largest entry at the pose


LARGEST = 1e18  # SI: a metre cube of diamond has 1e12 N/m; what is far beyond overflows in sums of squares


APART = 1e-6  # of the tip's compliance: how far a result may be from symmetric


# Condition of the struts' screws, arms in units of their size, beyond which a pose with an impossible compliance counts
# as singular: rounding may have left nothing right but its largest eigenvalue.
NEARLY_SINGULAR = 1e7


TRIED = 2000  # poses that are tried one by one for the one that fails


TEXTS = ("name", "title", "link", "equation", "source")


NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)  # of an effect or a parameter; a bare key of a machine file


BARE_KEY = re.compile(r"[A-Za-z0-9_-]+", re.ASCII)


KINDS = ("real", "integer", "text")


LONGEST_SHOWN = 200  # characters of a value in a message


def is_foreign(effect: Effect) -> bool:
    """Whether the effect comes from a user's file or another package."""
    return not type(effect).__module__.startswith("toolpath_stiff.stiffness.effects.")


def added(effect: Effect, hook: str, path: LoadPath, values: Mapping[str, Any]) -> FloatArray | None:
    """What one of `SHAPES` adds at n poses; None adds nothing. Raises `EffectFault`."""
    method: Callable[..., Any] = getattr(effect, hook)
    if not is_foreign(effect):
        own: FloatArray | None = method(path, values)
        return own
    _protect(path)
    raw = _called(effect, hook, path, lambda one: method(one, values))
    if raw is None:
        return None
    shape, words = SHAPES[hook]
    found = _array(effect, hook, raw, (len(path), *shape), words)
    _refuse_not_finite(effect, hook, found, path)
    if len(shape) == 2 and len(path):
        apart = np.abs(found - np.swapaxes(found, 1, 2)).max(axis=(1, 2))
        bad = apart > ASYMMETRY * np.abs(found).max(axis=(1, 2))
        if bad.any():
            i, j, k = (int(v) for v in np.unravel_index(_largest_gap(found, bad), found.shape))
            raise _fault(
                effect, hook, f"is not symmetric{at_pose(path, i)}: entry ({j}, {k}) is {found[i, j, k]:g}, "
                f"entry ({k}, {j}) is {found[i, k, j]:g}", words,
            )  # fmt: skip
    return found


def changed_geometry(effect: Effect, machine: Machine, values: Mapping[str, Any]) -> Machine:
    """The machine with the effect's geometry. Raises `EffectFault`."""
    if not is_foreign(effect):
        return effect.geometry(machine, values)
    found = _called(effect, "geometry", None, lambda _: effect.geometry(machine, values))
    if not isinstance(found, Machine):
        raise _fault(effect, "geometry", f"returns {_kind(found)}", "a Machine (machine.with_changes(...))")
    for name in ("frame_joints", "platform_joints"):
        joints = getattr(found, name)
        if not isinstance(joints, np.ndarray) or joints.shape != (6, 3) or not np.isfinite(joints).all():
            raise _fault(effect, "geometry", f"gives {name} that are {_kind(joints)}", "(6, 3) finite numbers, m")
    if not np.isfinite(found.reference_tool_length):
        raise _fault(effect, "geometry", "gives reference_tool_length that is not finite", "m")
    return found


def read_off(effect: Effect, stiffness: FloatArray, path: LoadPath, values: Mapping[str, Any]) -> FloatArray:
    """What an instrument shows for a true stiffness (n,) N/m. Raises `EffectFault`."""
    if not is_foreign(effect):
        return effect.reading(stiffness, path, values)
    _protect(path)
    true = stiffness.copy()
    raw = _called(effect, "reading", None, lambda _: effect.reading(true, path, values))
    found = _array(effect, "reading", raw, stiffness.shape, "(n,) N/m")
    bad = np.isfinite(stiffness) & ~(np.isfinite(found) & (found > 0.0))
    if bad.any():
        i = int(np.argmax(bad))
        raise _fault(effect, "reading", f"shows {found[i]:g} N/m{at_pose(path, i)}", "a finite number above 0")
    return found


def possible(effects: Sequence[Effect], path: LoadPath, compliance: FloatArray) -> FloatArray:
    """The compliance of the tip, if there can be such a one; what every result of the exact route goes through.

    Parameters
    ----------
    effects
        What acts on the machine, for messages.
    path
        n poses.
    compliance
        (n, k, k) m/N.

    Returns
    -------
    (n, k, k) its symmetric part; nan at a singular pose.

    Raises
    ------
    InputError
        It is not finite, not symmetric or not positive definite at a pose that is not singular; with effects and pose.
        A fit walks away from there.
    """
    wrong = ~is_compliance(compliance)
    with np.errstate(over="ignore", invalid="ignore"):
        symmetric = compliance if compliance.shape[1] == 1 else 0.5 * (compliance + np.swapaxes(compliance, 1, 2))
    if not wrong.any():
        return np.asarray(symmetric)
    rows = np.flatnonzero(wrong)
    regular = ~_is_singular(path, rows)
    if regular.any():
        raise _impossible(effects, path, int(rows[regular][0]), "the tip")
    symmetric[rows] = np.nan
    return np.asarray(symmetric)


def _is_singular(path: LoadPath, rows: IntArray) -> BoolArray:
    arms = path.struts.arms[rows]
    size = np.linalg.norm(arms, axis=-1).mean(axis=-1)[:, None, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        screws = np.concatenate([path.struts.directions[rows], path.struts.jacobian[rows, :, 3:] / size], axis=-1)
    singular = ~np.isfinite(screws).all(axis=(1, 2))
    singular[~singular] = ~(np.linalg.cond(screws[~singular]) < NEARLY_SINGULAR)
    return np.asarray(singular)


def is_compliance(tensor: FloatArray) -> BoolArray:
    """(n,) whether tensors (n, k, k) are finite, symmetric and positive definite."""
    size = tensor.shape[1]
    with np.errstate(all="ignore"):
        if size == 1:
            return np.asarray((tensor[:, 0, 0] > 0.0) & (tensor[:, 0, 0] < np.inf))
        if size != 3:
            return _has_positive_eigenvalues(tensor)
        a, d, e, left_d, b, f, left_e, left_f, c = np.ascontiguousarray(tensor.reshape(-1, 9).T)
        minor = a * b - d * d
        apart = np.abs(d - left_d) + np.abs(e - left_e) + np.abs(f - left_f)
        trace = a + b + c
        # Sylvester: all leading minors above zero. Nothing that is not finite passes.
        determinant = minor * c - a * f * f - b * e * e + 2.0 * d * e * f
        good = (a > 0.0) & (minor > 0.0) & (determinant > 0.0) & (apart <= APART * trace) & (trace < np.inf)
        if not good.all():  # minors of tiny numbers vanish where the eigenvalues do not
            good[~good] = _has_positive_eigenvalues(tensor[~good])
    return np.asarray(good)


def _has_positive_eigenvalues(tensor: FloatArray) -> BoolArray:
    scale = np.abs(tensor).max(axis=(1, 2))
    good = (scale > 0.0) & (scale < np.inf)
    unit = tensor[good] / scale[good, None, None]  # sums of the largest numbers overflow
    turned = np.swapaxes(unit, 1, 2)
    even = np.abs(unit - turned).max(axis=(1, 2)) <= APART
    good[good] = even & (np.linalg.eigvalsh(0.5 * (unit + turned))[:, 0] > 0.0)
    return np.asarray(good)


def refuse_struts_without_stiffness(effects: Sequence[Effect], path: LoadPath, strut: FloatArray) -> None:
    """Raise `InputError` where the compliances (n, 6) m/N of struts, with all that effects add, are 0 or less."""
    if (strut <= 0.0).any():
        row = int(np.argmax((strut <= 0.0).any(axis=1)))
        raise _impossible(effects, path, row, f"strut {int(np.argmin(strut[row])) + 1}")


def _impossible(effects: Sequence[Effect], path: LoadPath, row: int, part: str) -> EffectError:
    """An error that names the effects from outside the package, else all effects, else the machine."""
    foreign = [effect for effect in effects if is_foreign(effect)]
    named = foreign or list(effects)
    those = f"effect{'s' if len(named) > 1 else ''} {', '.join(effect.name for effect in named)}"
    hint = "check the parameters of these effects" if named else "check the machine file: strut law, joints"
    if foreign:
        hint = f"`{command_line('effects', 'check', file_of(foreign[0]))}` tries an effect by itself"
    return EffectError(
        f"with {those if named else f'machine {path.machine.name}'} {part} has no positive stiffness"
        f"{at_pose(path, row)}",
        expected="a compliance that is finite, symmetric and positive definite",
        hint=hint,
    )


def line_in(error: BaseException, file: str) -> int | None:
    """The innermost line of `file` on the way to `error`."""
    trace, line = error.__traceback__, None
    while trace is not None:
        if Path(trace.tb_frame.f_code.co_filename).resolve() == Path(file).resolve():
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


def file_of(effect: Effect) -> str:
    """The file that defines it, as short as it can be written from here."""
    module = sys.modules.get(type(effect).__module__)
    file = Path(effect.file or getattr(module, "__file__", None) or type(effect).__module__)
    return str(file.relative_to(Path.cwd()) if file.is_relative_to(Path.cwd()) else file)


def _called(effect: Effect, hook: str, path: LoadPath | None, call: Callable[[Any], Any]) -> Any:
    try:
        with np.errstate(all="ignore"):  # what it divides by zero shows in the result
            return call(path)
    except (Exception, SystemExit) as error:  # whatever a user's code does
        line = line_in(error, file_of(effect)) or _line_of(effect, hook)
        hint = ""
        if isinstance(error, KeyError):
            hint = f"its parameters are {', '.join(p.name for p in effect.parameters) or 'none'}"
        elif "read-only" in str(error):
            hint = "copy an array before you change it: the core and other effects use the same one"
        where = "" if path is None else _where_it_fails(path, call)
        what = f"{type(error).__name__}: {error}".rstrip(": ")
        raise EffectFault(
            f"effect {effect.name}: {hook} ends in {what}{where}", hint=hint, file=file_of(effect), line=line
        ) from None


def _where_it_fails(path: LoadPath, call: Callable[[Any], Any]) -> str:
    if len(path) < 2:
        return at_pose(path, 0) if len(path) else " without poses"
    for i in range(min(len(path), TRIED)):
        try:
            with np.errstate(all="ignore"):
                call(path.take(np.array([i])))
        except (Exception, SystemExit):
            return at_pose(path, i)
    return f" for {len(path)} poses together, though not for each alone"


def _protect(path: LoadPath) -> None:
    """An effect that writes into what it is shown would falsify the others."""
    for owner in (path, path.struts):
        for field in fields(owner):
            array = getattr(owner, field.name)
            if isinstance(array, np.ndarray):
                array.flags.writeable = False


def _array(effect: Effect, hook: str, raw: Any, shape: tuple[int, ...], words: str) -> FloatArray:
    found = np.asarray(raw) if isinstance(raw, np.ndarray | np.generic | float | int | list | tuple) else None
    if found is None or found.dtype.kind not in "fiu":
        raise _fault(effect, hook, f"returns {_kind(raw)}", words)
    if found.shape != shape:
        poses = f"{shape[0]} pose{'s' if shape[0] != 1 else ''}"
        raise _fault(effect, hook, f"returns shape {found.shape} for {poses}", f"{shape}, that is {words}")
    return np.asarray(found, dtype=float)


def _refuse_not_finite(effect: Effect, hook: str, found: FloatArray, path: LoadPath) -> None:
    bad = ~(np.abs(found) <= LARGEST)
    if path.strut_forces is not None:  # nan at a singular pose, where nothing can be asked
        bad[~np.isfinite(path.strut_forces).all(axis=1)] = False
    if bad.any():
        first = np.unravel_index(int(np.argmax(bad)), found.shape)
        expected = f"numbers within +-{LARGEST:g}" if np.isfinite(found[first]) else "finite numbers"
        raise _fault(effect, hook, f"returns {found[first]:g}{at_pose(path, int(first[0]))}", expected)


def _largest_gap(found: FloatArray, bad: BoolArray) -> int:
    gap = np.abs(found - np.swapaxes(found, 1, 2))
    gap[~bad] = -1.0
    return int(np.argmax(gap))


def at_pose(path: LoadPath, i: int) -> str:
    """Pose i in words, as " at X0 Y0 Z800 mm" with the space before it."""
    x, y, z = (mm_from_m(float(v)) + 0.0 for v in path.position[i])
    return f" at X{x:g} Y{y:g} Z{z:g} mm"


def _kind(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} of {value.dtype}"
    return "nothing (None)" if value is None else f"{type(value).__name__} ({value!r:.40})"


def _fault(effect: Effect, hook: str, found: str, expected: str) -> EffectFault:
    return EffectFault(
        f"effect {effect.name}: {hook} {found}", expected=expected, file=file_of(effect), line=_line_of(effect, hook)
    )


def _line_of(effect: Effect, hook: str) -> int | None:
    """Line on which the hook is defined, if the effect's own file defines it."""
    code = getattr(inspect.unwrap(getattr(type(effect), hook)), "__code__", None)
    own = code is not None and Path(code.co_filename).resolve() == Path(file_of(effect)).resolve()
    return code.co_firstlineno if own and code is not None else None


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
    own = type(effect)

    def refuse(attribute: str, found: str, expected: str = "", index: int | None = None) -> InputError:
        line = line_of(own, attribute, index)
        return EffectError(f"effect {own.__name__}: {found}", expected=expected, file=where, line=line)

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
    marks = effect.described_from
    if not isinstance(marks, tuple | list) or not all(isinstance(one, str) for one in marks):
        raise refuse("described_from", f"described_from = {marks!r:.60}", "marks of readings, a tuple of texts")
    _check_parameters(effect, refuse)
    _check_hooks(effect, refuse)


def _check_parameters(effect: Effect, refuse: Callable[..., InputError]) -> None:
    """Refuse parameters that are of the wrong kind, wrong in themselves, or declared twice."""
    if not isinstance(effect.parameters, tuple | list):
        raise refuse("parameters", f"parameters = {effect.parameters!r:.60}", "(Parameter(...), ...), with a comma")
    for i, parameter in enumerate(effect.parameters):
        if not isinstance(parameter, Parameter):
            raise refuse("parameters", f"parameters hold {parameter!r:.60}", "Parameter(...)", i)
        wrong = wrong_in(parameter)
        if wrong:
            raise refuse("parameters", f"parameter {parameter.name}: {wrong[0]}", wrong[1], i)
        if parameter.name in [earlier.name for earlier in effect.parameters[:i]]:
            raise refuse("parameters", f"parameter {parameter.name} is declared twice", index=i)


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
        return (
            f"si = {_shown(parameter.si)}",
            f"the SI value of one {parameter.unit or 'unit'} as a number, such as 1e-9",
        )
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
        found = f"bounds {tuple(parameter.bounds)}, neutral {parameter.neutral:g}"
        return found, "low < high with the neutral value between them"
    if not low <= typical[0] <= typical[1] <= high:
        return f"typical {tuple(typical)}, bounds {tuple(parameter.bounds)}", "low <= high within the bounds"
    return None


def _is_number(value: object) -> bool:
    """Whether it is a number that a float holds: Python's whole numbers may be larger."""
    if isinstance(value, int) and not isinstance(value, bool):
        return abs(value) <= sys.float_info.max
    return isinstance(value, float)


def _shown(value: object) -> str:
    """What was found, in a few words where it is endless; Python writes no whole number of more than 4,300 digits."""
    try:
        text = repr(value)
    except ValueError:
        return "a number of thousands of digits"
    return text if len(text) <= LONGEST_SHOWN else f"{text[:10]}... ({len(text)} characters)"


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
