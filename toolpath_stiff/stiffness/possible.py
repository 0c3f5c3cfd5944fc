"""Compliances that there can be: finite, symmetric, positive definite. Results of the exact route are held to it."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.errors import EffectError
from toolpath_stiff.hints import command_line
from toolpath_stiff.stiffness.contract import Effect, LoadPath
from toolpath_stiff.stiffness.effect_source import file_of, is_foreign
from toolpath_stiff.units import mm_from_m

APART = 1e-6  # of the tip's compliance: how far a result may be from symmetric
# Condition of the struts' screws, arms in units of their size, beyond which a pose with an impossible compliance counts
# as singular: rounding may have left nothing right but its largest eigenvalue.
NEARLY_SINGULAR = 1e7


def possible(effects: Sequence[Effect], path: LoadPath, compliance: FloatArray) -> FloatArray:
    """The compliance of the tip, if there can be such a one.

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
    if wrong.any():
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
    names = ", ".join(effect.name for effect in foreign or effects)
    cause, hint = f"machine {path.machine.name}", "check the parameters of the effects, strut law and joints"
    if foreign:
        hint = f"`{command_line('effects', 'check', file_of(foreign[0]))}` tries an effect by itself"
    return EffectError(
        f"with {f'effect {names}' if names else cause} {part} has no positive stiffness{at_pose(path, row)}",
        expected="a compliance that is finite, symmetric and positive definite",
        hint=hint,
    )


def at_pose(path: LoadPath, i: int) -> str:
    """Pose i in words, as " at X0 Y0 Z800 mm" with the space before it."""
    x, y, z = (mm_from_m(float(v)) + 0.0 for v in path.position[i])
    return f" at X{x:g} Y{y:g} Z{z:g} mm"
