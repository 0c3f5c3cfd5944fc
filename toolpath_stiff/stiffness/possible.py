"""Compliances that there can be: finite, symmetric, positive definite. Results of the exact route are held to it."""

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.errors import EffectError
from toolpath_stiff.hints import command_line
from toolpath_stiff.stiffness.contract import LoadPath, at_pose
from toolpath_stiff.stiffness.effect_source import file_of, is_foreign
from toolpath_stiff.stiffness.model import StiffnessModel

APART = 1e-6  # of the tip's compliance: how far a result may be from symmetric
# Condition of the struts' screws, arms in units of their size, beyond which a pose with an impossible compliance counts
# as singular: rounding may have left nothing right but its largest eigenvalue.
NEARLY_SINGULAR = 1e7


def possible(model: StiffnessModel, path: LoadPath, compliance: FloatArray) -> FloatArray:
    """The symmetric part of the tip's compliance (n, k, k) m/N, if there can be such a one; nan at a singular pose.

    Raises
    ------
    InputError
        It is not finite, not symmetric or not positive definite at a pose that is not singular; with effects and pose.
        A fit walks away from there.
    """
    rows = np.flatnonzero(~is_compliance(compliance))
    with np.errstate(over="ignore", invalid="ignore"):
        symmetric = np.asarray(0.5 * (compliance + np.swapaxes(compliance, 1, 2)))
    if len(rows):
        regular = rows[~_is_singular(path.take(rows))]
        if len(regular):
            raise _impossible(model, path, int(regular[0]), "the tip")
        symmetric[rows] = np.nan
    return symmetric


def _is_singular(path: LoadPath) -> BoolArray:
    screws = path.struts.jacobian.copy()
    with np.errstate(divide="ignore", invalid="ignore"):
        screws[:, :, 3:] /= np.linalg.norm(path.struts.arms, axis=-1).mean(axis=-1)[:, None, None]
    regular = np.flatnonzero(np.isfinite(screws).all(axis=(1, 2)))
    singular = np.ones(len(path), dtype=bool)
    singular[regular] = ~(np.linalg.cond(screws[regular]) < NEARLY_SINGULAR)
    return singular


def is_compliance(tensor: FloatArray) -> BoolArray:
    """(n,) whether tensors (n, k, k) are finite, symmetric and positive definite."""
    scale = np.abs(tensor).max(axis=(1, 2))
    good = (scale > 0.0) & (scale < np.inf)
    unit = tensor[good] / scale[good, None, None]  # sums of the largest numbers overflow
    turned = np.swapaxes(unit, 1, 2)
    even = np.abs(unit - turned).max(axis=(1, 2)) <= APART
    good[good] = even & (np.linalg.eigvalsh(0.5 * (unit + turned))[:, 0] > 0.0)
    return np.asarray(good)


def refuse_struts_without_stiffness(model: StiffnessModel, path: LoadPath, strut: FloatArray) -> None:
    """Raise `InputError` where the compliances (n, 6) m/N of struts with all effects are 0 or less, or infinite."""
    bad = (strut <= 0.0) | (strut == np.inf)
    if bad.any():
        row = int(np.argmax(bad.any(axis=1)))
        raise _impossible(model, path, row, f"strut {int(np.argmax(bad[row])) + 1}")


def _impossible(model: StiffnessModel, path: LoadPath, row: int, part: str) -> EffectError:
    """An error that names the effects from outside the package, else all effects, else the machine."""
    effects = [active.effect for active in model.effects]
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
