"""How far each hidden effect shows beside the others, whose sizes any fit is free to change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.case import DrawnCase, clamp_of, rows_of
from toolpath_stiff.rig.effects import with_effect
from toolpath_stiff.rig.hidden import HiddenMachine, readings
from toolpath_stiff.rig.sizes import NuisanceCovariance, Scale

STEP = 0.05  # relative change of a parameter, for differences


def shows_beside(case: DrawnCase) -> list[float]:
    """Detectability of each hidden effect beside strut law, nuisances and the sizes of all other hidden effects.

    The whitened length of what taking the effect away changes, once the best that the others can do about it has been
    taken off: its square is the gain in twice the log likelihood that the true explanation is to be expected to have
    over the same without the effect. Where the others act is taken for known; a parameter at 0 stays there.
    """
    rows, effects = rows_of(case.rows), case.truth["effects"]
    known = Scale(case.nominal, rows, clamp_of(case.rows), case.nuisances).covariance

    def logs(present: Sequence[Mapping[str, Any]]) -> FloatArray:
        machine = HiddenMachine()
        for effect in present:
            machine = with_effect(machine, effect["effect"], effect["parameters"])
        return np.asarray(np.log(readings(case.nominal, machine, rows)))

    whole, found = logs(effects), []
    moved = [_moved(effect) for effect in effects]
    columns = [
        [logs([*effects[:k], other, *effects[k + 1 :]]) - whole for other in moved[k]] for k in range(len(effects))
    ]
    for k in range(len(effects)):
        change = whole - logs([*effects[:k], *effects[k + 1 :]])
        free = np.stack([one for i, own in enumerate(columns) if i != k for one in own], axis=1)
        free = free / np.maximum(np.sqrt(np.mean(free**2, axis=0)), 1e-12)  # as unknown as 100 %: free
        found.append(
            NuisanceCovariance(known.clamps, np.concatenate([known.spread, free], axis=1), case.nuisances).length(
                change
            )
        )
    return found


def _moved(effect: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The effect with one real parameter after the other changed a little."""
    parameters = effect["parameters"]
    return [
        {**effect, "parameters": {**parameters, name: (1.0 + STEP) * value}}
        for name, value in parameters.items()
        if isinstance(value, float) and value
    ]
