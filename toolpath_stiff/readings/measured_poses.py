"""Poses of readings, held against what the machine can be: beyond a limit is doubtful, singular is impossible."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputErrors, MeasurementError
from toolpath_stiff.machine.kinematics import singularity_index, solve_struts
from toolpath_stiff.machine.limits import reach
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import mm_from_m

SINGULAR = 1e-6  # singularity index: the tip would be a million times softer than at the neutral pose
# Of the machine file under `limits`; the last word of each stands in its limits' names.
SECTIONS = ("strut_length", "joint_angle", "workspace", "singularity")


def pose_warnings(
    machine: Hexapod,
    position: FloatArray,
    angles: FloatArray,
    tool_extension: FloatArray,
    places: Sequence[tuple[str, int]],
) -> tuple[str, ...]:
    """Warnings about measured poses beyond limits.

    Parameters
    ----------
    machine
        The machine that was measured.
    position, angles, tool_extension
        (n, 3) m, (n, 3) rad, (n,) m.
    places
        File and line of each.

    Raises
    ------
    InputErrors
        Singular and impossible poses, all of them.
    """
    rotation = rotation_matrices(angles)
    struts = solve_struts(machine, position, rotation, tool_extension + machine.reference_tool_length)
    index, poses = singularity_index(machine, struts), [*map(_shown, position, angles)]
    stiffness = machine.strut_law.stiffness(struts.lengths)
    errors = []
    for i in range(len(position)):
        if not index[i] >= SINGULAR:
            mistake = f"pose {poses[i]} is singular: the struts cannot hold the platform"
        elif stiffness[i].min() <= 0.0:
            mistake = (
                f"pose {poses[i]} is impossible: strut {int(np.argmin(stiffness[i])) + 1} would have no stiffness left"
            )
        else:
            continue
        errors.append(MeasurementError(mistake, hint="check the pose's unit", file=places[i][0], line=places[i][1]))
    if errors:
        raise InputErrors(errors)
    stand = reach(machine, position, struts, rotation)
    beyond: dict[str, list[int]] = {}
    for row in np.flatnonzero(~stand.reachable).tolist():
        beyond.setdefault(stand.limits[int(stand.limit[row])].name, []).append(row)
    warnings = []
    for name, rows in beyond.items():
        origin = next((machine.origins.get(f"limits.{s}") for s in SECTIONS if s.rpartition("_")[2] in name), None)
        warnings.append(
            f"measured beyond a limit of the machine file ({name}, {origin or 'origin not stated'}): {poses[rows[0]]}, "
            f"first of {len({poses[i] for i in rows})} poses. {stand.describe(rows[0])}"
        )
    return tuple(warnings)


def _shown(position: FloatArray, angles: FloatArray) -> str:
    mm = ", ".join(f"{mm_from_m(value):g}" for value in position)
    degrees = np.degrees(angles)
    return f"({mm}) mm" + (f" at ({', '.join(f'{d:.4g}' for d in degrees)}) deg" if degrees.any() else "")
