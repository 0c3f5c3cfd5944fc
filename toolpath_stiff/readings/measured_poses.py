"""Poses of readings checked against the machine: beyond a limit is doubtful, singular is impossible."""

from collections.abc import Iterator, Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputErrors, MeasurementError
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.kinematics import Struts, singularity_index
from toolpath_stiff.machine.limits import reach, solved
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import mm_from_m

SINGULAR = 1e-6  # singularity index: the tip would be a million times softer than at the neutral pose
# Limits of the machine file; the last word of each is part of its limits' names.
SECTIONS = ("strut_length", "joint_angle", "workspace", "singularity")


def pose_warnings(
    machine: MachineTool,
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
    rotation, poses = rotation_matrices(angles), [*map(_shown, position, angles)]
    stance = solved(machine, position, rotation, tool_extension + machine.reference_tool_length)
    stand, errors = reach(machine, position, stance, rotation), []
    for i, reason in enumerate(_impossible(machine, stance)):
        if reason:
            mistake, (file, line) = f"pose {poses[i]} is {reason}", places[i]
            errors.append(MeasurementError(mistake, hint="check the pose's unit", file=file, line=line))
    if errors:
        raise InputErrors(errors)
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


def _impossible(machine: MachineTool, stance: Struts | Stance) -> Iterator[str]:
    """For each pose the reason why the machine cannot be there at all, or ""."""
    if not isinstance(machine, Hexapod) or not isinstance(stance, Struts):
        for row in stance.joints:
            yield "impossible: no joint values reach it" if np.isnan(row).any() else ""
        return
    stiffness = machine.strut_law.stiffness(stance.lengths)
    for index, of_struts in zip(singularity_index(machine, stance), stiffness, strict=True):
        softest = int(np.argmin(of_struts))
        if not index >= SINGULAR:
            yield "singular: the struts cannot hold the platform"
        elif of_struts[softest] <= 0.0:
            yield f"impossible: strut {softest + 1} would have no stiffness left"
        else:
            yield ""


def _shown(position: FloatArray, angles: FloatArray) -> str:
    mm = ", ".join(f"{mm_from_m(value):g}" for value in position)
    degrees = np.degrees(angles)
    return f"({mm}) mm" + (f" at ({', '.join(f'{d:.4g}' for d in degrees)}) deg" if degrees.any() else "")
