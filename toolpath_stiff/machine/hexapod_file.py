"""Reader of machine files of six-strut machines, as `Hexapod`.

Each section names the origin of its figures ("published", "recovered", "assumed", "fitted").
"""

from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.common_sections import common_fields
from toolpath_stiff.machine.kinematics import solve_struts_at
from toolpath_stiff.machine.model import Hexapod, Limits, StrutLaw
from toolpath_stiff.machine.schema import OPTIONAL_SECTIONS, SECTIONS, MachineToml, Sections, read_sections
from toolpath_stiff.poses import pose_in_si
from toolpath_stiff.units import m_from_mm, mm_from_m, n_per_m_from_n_per_um, rad_from_deg

CLOSEST_LENGTHS = 1e-6  # m, of a strut law: nobody measures closer, and the slope between them stays finite
# Smallest singular value of the six strut screws (arms in units of the platform's size) that is not singular.
SINGULAR = 1e-6


def read(toml: MachineToml) -> Hexapod:
    """Machine from a file. Raises `InputError`."""
    values = read_sections(toml, SECTIONS, OPTIONAL_SECTIONS)
    law = _strut_law(toml, values["strut_law"], values["limits.strut_length"])
    machine = Hexapod(
        frame_joints=_joints(toml, "frame_joints", values["frame_joints"]),
        platform_joints=_joints(toml, "platform_joints", values["platform_joints"]),
        reference_tool_length=m_from_mm(values["reference_tool"]["length_mm"]),
        strut_law=law,
        platform_bar_stiffness=values.get("platform", {}).get("bar_stiffness_N_per_m", np.inf),
        as_built=_as_built(values["as_built"]) if "as_built" in values else None,
        limits=_limits(toml, values),
        **common_fields(toml, values, law.parameters),
    )
    _check_law(toml, machine)
    _check_neutral_pose(toml, machine)
    return machine


def _check_law(toml: MachineToml, machine: Hexapod) -> None:
    """Refuse a law under which struts lose all stiffness within their travel."""
    for key, length in zip(("min_mm", "max_mm"), machine.limits.strut_length, strict=True):
        intercept, slope = machine.strut_law.line_at(length)
        if np.isfinite(length) and intercept + slope * length <= 0.0:
            mistake = f" = {mm_from_m(length):g}: the strut law leaves no stiffness there"
            expected = f"a travel on this side of {mm_from_m(-intercept / slope):.1f} mm, where the law vanishes"
            raise toml.fault("limits.strut_length", key, mistake, expected)


def _check_neutral_pose(toml: MachineToml, machine: Hexapod) -> None:
    """Refuse a machine that is singular at its neutral pose, from which margins are counted."""
    struts = solve_struts_at(machine, machine.limits.neutral_pose)
    directions, arms = struts.directions[0], struts.arms[0] - struts.arms[0].mean(axis=0)
    size = max(float(np.linalg.norm(arms, axis=1).mean()), 1e-9)
    screws = np.concatenate([directions, np.cross(arms, directions) / size], axis=1)
    if not np.isfinite(screws).all() or np.linalg.svd(screws)[1][-1] < SINGULAR:
        hint = "check the joints as well: similar hexagons without a twist are singular everywhere"
        mistake, expected = ": the machine is singular there", "a pose in the middle of the workspace"
        raise toml.fault("limits.joint_angle", "neutral_pose_mm_deg", mistake, expected, hint)


def _joints(toml: MachineToml, section: str, values: Document) -> FloatArray:
    """(6, 3) m from either form of the section."""
    cartesian, cylindrical = (values.get(key) for key in ("mm", "cylindrical_mm_deg"))
    if (cartesian is None) == (cylindrical is None):
        mistake = " is missing" if cartesian is None else " and cylindrical_mm_deg are both given"
        expected = "one of mm (6 rows x, y, z) and cylindrical_mm_deg (6 rows radius, angle, height)"
        raise toml.fault(section, "mm", mistake, expected)
    if cylindrical is not None:
        radius, angle = cylindrical[:, 0], rad_from_deg(cylindrical[:, 1])
        cartesian = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), cylindrical[:, 2]])
    return m_from_mm(np.asarray(cartesian))


def _as_built(values: Document) -> FloatArray:
    """(42,) offsets of struts (ln) and joints (m)."""
    joints = np.concatenate([values["frame_joints_mm"], values["platform_joints_mm"]])
    return np.concatenate([np.log1p(0.01 * values["struts_percent"]), m_from_mm(joints).ravel()])


def _strut_law(toml: MachineToml, values: Document, travel: Document) -> StrutLaw:
    """Strut law: linear by two lengths, a table by more, constant by one stiffness without a length."""

    def fault(key: str, mistake: str, expected: str) -> InputError:
        return toml.fault("strut_law", key, mistake, expected)

    lengths, stiffnesses = values.get("length_mm"), n_per_m_from_n_per_um(values["stiffness_N_per_um"])
    if np.ndim(stiffnesses) == 0:
        if lengths is not None:
            mistake = f": {len(lengths)} lengths, but one stiffness"
            raise fault("length_mm", mistake, "a stiffness for each length, or no length_mm: constant")
        low, high = m_from_mm(travel["min_mm"]), m_from_mm(travel["max_mm"])
        return StrutLaw(low, float(stiffnesses), high, float(stiffnesses), constant=True)
    if lengths is None:
        raise fault("length_mm", " is missing", "a length for each stiffness, or a single stiffness: constant")
    if len(lengths) != len(stiffnesses):
        mistake = f": {len(stiffnesses)} stiffnesses, but {len(lengths)} lengths"
        raise fault("stiffness_N_per_um", mistake, f"{len(lengths)} numbers, one for each length")
    lengths = m_from_mm(lengths)
    steps = np.diff(lengths) if len(lengths) > 2 else np.abs(np.diff(lengths))
    if (steps < CLOSEST_LENGTHS).any():
        before, after = mm_from_m(lengths[int(np.argmin(steps)) :][:2]).tolist()
        expected = "lengths 0.001 mm apart or more, those of a table rising"
        raise fault("length_mm", f": {after:g} comes after {before:g}", expected)
    if len(lengths) > 2:
        return StrutLaw.table(lengths, stiffnesses)
    return StrutLaw(float(lengths[0]), float(stiffnesses[0]), float(lengths[1]), float(stiffnesses[1]))


def _limits(toml: MachineToml, values: Sections) -> Limits:
    low, high = (values["limits.strut_length"][key] for key in ("min_mm", "max_mm"))
    if not low < high:
        raise toml.fault("limits.strut_length", "max_mm", f" = {high:g}", expected=f"more than min_mm = {low:g}")
    # Joints without limits: the neutral pose serves only the singularity index.
    neutral = pose_in_si(values.get("setup", {}).get("default_origin_mm", np.zeros(3)))
    limits = Limits(strut_length=(m_from_mm(low), m_from_mm(high)), neutral_pose=neutral)
    if box := values.get("limits.workspace"):
        if not (box["min_mm"] < box["max_mm"]).all():
            expected = "max_mm > min_mm in x, y and z"
            raise toml.fault("limits.workspace", "max_mm", ": not above min_mm", expected)
        limits = replace(limits, workspace=m_from_mm(np.array([box["min_mm"], box["max_mm"]])))
    if angles := values.get("limits.joint_angle"):
        frame, platform = (rad_from_deg(angles[key]) for key in ("frame_max_deg", "platform_max_deg"))
        neutral = pose_in_si(angles["neutral_pose_mm_deg"])
        limits = replace(limits, frame_joint_angle=frame, platform_joint_angle=platform, neutral_pose=neutral)
    singularity = values.get("limits.singularity", {}).get("min_index", limits.singularity)
    return replace(limits, singularity=singularity)
