"""Demands of a path on the joints: where they would have to turn back, and where they are too slow."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.analysis.statistics import EvaluatedPath
from toolpath_stiff.arrays import IntArray
from toolpath_stiff.path.sampling import lines_named
from toolpath_stiff.units import deg_from_rad, mm_from_m

SHORTEST = 1e-9  # s between samples: less is rounding


def joint_warnings(path: EvaluatedPath, changes: IntArray | Sequence[int] = ()) -> list[str]:
    """Warnings on lines of cuts in which a joint turns back or is too slow; `changes`: samples before joints jump."""
    samples, machine, warnings = path.samples, path.machine, []
    rotary = np.array(machine.joint_kinds) == "rotary"
    if not rotary.any() and not np.isfinite(machine.joint_speeds).any():
        return []
    going = samples.cutting[1:] & samples.cutting[:-1]
    step = np.abs(np.diff(path.at.joints, axis=0))
    back = np.flatnonzero((step[:, rotary] > np.pi).any(axis=1) & going) + 1
    jumps = np.union1d(back, np.asarray(changes, dtype=np.int64))
    if len(jumps):
        warnings.append(
            f"{lines_named(samples.line[jumps])}: the joints cannot continue in this configuration; it has to "
            "change there, or a joint has to turn back"
        )
    duration = np.diff(samples.t)
    counted = np.setdiff1d(np.flatnonzero(going & (duration > SHORTEST)), jumps - 1)
    speed = step[counted] / duration[counted, None]
    share = np.nan_to_num(speed) / machine.joint_speeds
    if (share > 1.0).any():
        row, joint = np.unravel_index(int(share.argmax()), share.shape)
        unit, shop = ("deg/s", deg_from_rad) if rotary[joint] else ("mm/s", mm_from_m)
        needed, allowed = (shop(float(value)) for value in (speed[row, joint], machine.joint_speeds[joint]))
        line = samples.line[counted + 1]
        warnings.append(
            f"{lines_named(line[(share > 1.0).any(axis=1)])} need a joint to exceed its speed, most of all line "
            f"{line[row]}: {machine.joint_names[joint]} {needed:.3g} {unit} of {allowed:.3g}; reduce the feed there"
        )
    return warnings
