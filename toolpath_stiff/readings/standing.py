"""Stance of a machine at each pull: from its joints, from the pose of its tip, or from both, compared."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.errors import InputErrors, MeasurementError
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.joint_values import joint_margin
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices
from toolpath_stiff.units import deg_from_rad, m_from_mm, mm_from_m, rad_from_deg

ROLL_FIRST = 'angles turn about X, then Y, then Z of the base; where a, b, c begin with Z: --columns "a=c_deg, c=a_deg"'
ELSEWHERE = "are they in other axes than the base's? [work] of the machine file says where those stand"
SMALL_TURNS, SEVERAL = rad_from_deg(6.29), 3  # at least so many poses without a larger turn are hardly in degrees
# By which a pose and the joints beside it may differ: rounded; or of a robot that sags and is not calibrated (some mm:
# ISO 9283 counts its accuracy apart from its repeatability). Then the joints count, with a note.
SAME_PLACE, NEAR_PLACE, NEAR_TURN = m_from_mm(1.0), m_from_mm(10.0), rad_from_deg(3.0)
COMMON = 0.5  # share of the distance of poses and joints that remains if other axes are the reason


def standing(
    machine: MachineTool, pose: FloatArray, joints: FloatArray, places: Sequence[tuple[str, int]]
) -> tuple[Stance, list[str]]:
    """Stance at the joints (n, j) if given, else at the pose (n, 6), nan where not given; and the assumptions made.

    `places` are file and line of each. Raises `InputErrors` for rows that cannot be.
    """
    by_joints, errors, notes = np.asarray(~np.isnan(joints).any(axis=1)), list[MeasurementError](), list[str]()
    position, rotation, joints = pose[:, :3], rotation_matrices(np.nan_to_num(pose[:, 3:])), joints.copy()
    apart, turned = np.full((2, len(pose)), np.nan)

    def refuse(wrong: BoolArray, text: str, expected: str = "", hint: str = "") -> None:
        first, *more = np.flatnonzero(wrong).tolist()
        text += f" (and in {len(more)} more rows)" if more else ""
        file, line = places[first]
        errors.append(MeasurementError(text, expected=expected, hint=hint, file=file, line=line))

    if by_joints.any():
        tip, axes = machine.forward(joints[by_joints])
        if other := _other_axes(position[by_joints], tip):
            turn, origin = other
            position, rotation = position @ turn.T + origin, turn @ rotation
            place, angles = mm_from_m(origin).round(1) + 0.0, deg_from_rad(roll_pitch_yaw(turn[None])[0]).round(2) + 0.0
            keys = f"xyz_mm = {place.tolist()}, rpy_deg = {angles.tolist()}"
            notes.append(f"poses beside joints stand in other axes, {keys} in the machine's: the joints count")
            if np.abs(angles).max() > deg_from_rad(NEAR_TURN):
                hint = 'components in them are named by --columns "force_axes==work, sensor_axes==work" (columns=)'
                refuse(
                    by_joints,
                    "the pose stands in other axes than the joints",
                    f"in the machine file [work] {keys}",
                    hint,
                )
        apart[by_joints] = np.linalg.norm(tip - position[by_joints], axis=1)
        cosine = (np.einsum("nij,nij->n", axes, rotation[by_joints]) - 1.0) / 2.0
        turned[by_joints] = np.arccos(np.clip(cosine, -1.0, 1.0)) + 0.0 * pose[by_joints, 3]
    hint = "" if np.isnan(pose[:, 3]).all() else ROLL_FIRST
    for off, most, by in ((apart, NEAR_PLACE, "mm"), (turned, NEAR_TURN, "degrees")):
        if not errors and (wrong := off > most).any():
            shop = (mm_from_m if by == "mm" else deg_from_rad)(float(off[wrong].max()))
            refuse(wrong, f"pose and joints are {shop:.1f} {by} apart", hint=hint)
    if (apart > SAME_PLACE).any():
        notes.append(f"poses and joints are up to {mm_from_m(float(np.nanmax(apart))):.1f} mm apart: the joints count")
    if not by_joints.all():  # one configuration for all poses: of those that reach most, that farthest from limits
        alone = position[~by_joints], rotation[~by_joints]
        tried = [machine.solve(*alone, configuration=i).joints for i in range(len(machine.configurations))]
        room = [joint_margin(values.T, machine.joint_limits) for values in tried]
        kept = max(range(len(tried)), key=lambda i: (int((room[i] >= 0.0).sum()), float(room[i].min())))
        missed = np.isnan(tried[kept]).any(axis=1, keepdims=True)
        joints[~by_joints] = np.where(missed, machine.solve(*alone).joints, tried[kept])
        if machine.configurations[kept]:
            notes.append(f"poses without joint values: taken in the configuration {machine.configurations[kept]}")
    if (lost := np.asarray(np.isnan(joints).any(axis=1))).any():
        refuse(lost, "no joint values lead to the pose", hint=f"{hint}; {ELSEWHERE}" if hint else ELSEWHERE)
    notes += _beyond_limits(by_joints & (joint_margin(joints.T, machine.joint_limits) < 0.0), places)
    turning = joints[by_joints][:, [kind != "linear" for kind in machine.joint_kinds]]
    if len(np.unique(turning, axis=0)) >= SEVERAL and turning.any() and np.abs(turning).max() < SMALL_TURNS:
        small = f"no joint turns by more than {deg_from_rad(float(np.abs(turning).max())):.3g} deg"
        hint = 'columns in radians are named by --columns "joint_1=joint_1_deg:rad, ..." (columns=)'
        errors.append(MeasurementError(small, expected="degrees", hint=hint, file=places[0][0]))
    if errors:
        raise InputErrors(errors)
    return machine.standing(joints), notes


def _beyond_limits(beyond: BoolArray, places: Sequence[tuple[str, int]]) -> list[str]:
    if not beyond.any():
        return []
    file, line = places[int(np.argmax(beyond))]
    return [f"{file}:{line}: joints beyond their limits in the machine file (rows: {np.count_nonzero(beyond)})"]


def _other_axes(position: FloatArray, tip: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Axes (3, 3) and (3,) m in which poses (n, 3) m are the joints' tips (n, 3), by least squares; None: no such axes.

    Kabsch 1976, Acta Crystallographica A32, 922.
    """
    from scipy.spatial.transform import Rotation

    known = np.isfinite(position).all(axis=1)
    position, tip = position[known], tip[known]
    apart = np.linalg.norm(position - tip, axis=1)
    if len(np.unique(tip.round(6), axis=0)) <= SEVERAL or not apart.max() > SAME_PLACE:
        return None
    middle, other = tip.mean(axis=0), position.mean(axis=0)
    turned = Rotation.align_vectors(tip - middle, position - other)[0].as_matrix()
    origin = middle - turned @ other
    left = float(np.linalg.norm(position @ turned.T + origin - tip, axis=1).max())
    return (turned, origin) if left < min(NEAR_PLACE, COMMON * float(apart.max())) else None
