"""Rotary deltas: three arms that turn about horizontal axes, each with a parallelogram of two rods to the effector.

Kinematics of rotarydeltakins(9): arms at 270, 30 and 150 degrees, level at 0 and down at 90 degrees. In an arm's
upright plane, with u and z from its hip to the effector's joint, y across, the rod's length s gives
u cos q - z sin q = (t^2 + u^2 + y^2 + z^2 - s^2) / 2t, of which the arm outwards is the solution.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.delta import OUTWARDS, UP, Level, rod_joints
from toolpath_stiff.machine.elements import Element, Stance
from toolpath_stiff.machine.parallel import Carriage, Legs
from toolpath_stiff.machine.parallel_file import (
    GIVE,
    HEIGHT,
    LENGTH,
    OPTIONAL,
    PER_ROD,
    SHARED,
    TOP,
    axial,
    give_of,
    shared_fields,
)
from toolpath_stiff.machine.schema import Key, MachineToml, read_sections
from toolpath_stiff.units import m_from_mm, m_from_nm, rad_from_deg

SCHEMA = {
    "": {
        **TOP,
        **dict.fromkeys(("hip_radius_mm", "effector_joint_radius_mm", "rod_length_mm", "rod_spacing_mm"), LENGTH),
        "effector_joint_height_mm": HEIGHT,
    },
    "limits": {"arm_deg": Key(unit="deg", shape=(2,), low=-180.0, high=180.0)},
    "rod": {"compliance_nm_per_N": PER_ROD},
    "arm": {"length_mm": LENGTH, **GIVE},
    **SHARED,
}
ARMS = -OUTWARDS


@dataclass(frozen=True, kw_only=True)
class RotaryDelta(Level):
    """A rotary delta; the hips stand in the plane z = 0.

    Attributes
    ----------
    hip_radius, arm_length
        m, of the arms' axes about the machine's axis; from there to the rods' joints.
    """

    kind: ClassVar[str] = "rotary_delta"
    outwards: ClassVar[FloatArray] = ARMS

    hip_radius: float
    arm_length: float

    @property
    def joint_kinds(self) -> tuple[str, ...]:
        """Of each arm "rotary"."""
        return ("rotary",) * 3

    def legs_at(self, tip: FloatArray, axes: FloatArray, extension: FloatArray) -> Legs:
        """The six rods; nan where an arm does not reach, or the tool is turned."""
        arms = self.effector_arms(extension)
        foot = tip[:, None] + arms.reshape(-1, 3, 2, 3).mean(axis=2)
        u, y = (foot * ARMS).sum(axis=-1) - self.hip_radius, (foot * np.cross(UP, ARMS)).sum(axis=-1)
        z, thigh = foot[..., 2], self.arm_length
        share = (thigh**2 + u**2 + y**2 + z**2 - self.rod_length**2) / (2.0 * thigh * np.hypot(u, z))
        angles = np.where(self.level(axes)[:, None], -np.arctan2(z, u) - np.arccos(share), np.nan)
        knees, turns = self._knees(angles)
        rods = np.repeat(knees - foot, 2, axis=1)
        compliance = np.full((len(tip), 6), self.rod_compliance)
        return Legs(angles, rods / self.rod_length, arms, compliance, turns)

    def _knees(self, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, 3, 3) m, ends of the arms; (n, 3, 3, 3) their axes: along the arm, along its hip, square to both."""
        c, s = np.cos(angles)[..., None], np.sin(angles)[..., None]
        along, across = c * ARMS - s * UP, s * ARMS + c * UP
        turns = np.stack([along, np.broadcast_to(np.cross(UP, ARMS), along.shape), across], axis=-1)
        return self.hip_radius * ARMS + self.arm_length * along, turns

    def leg_ends(self, stance: Stance) -> tuple[FloatArray, FloatArray]:
        """(n, 6, 3) m each: the rods' joints on the arms and on the effector."""
        knees = np.repeat(self._knees(stance.joints)[0], 2, axis=1)
        return knees + rod_joints(ARMS, 0.0, self.spacing), stance.position[:, None] + self.effector_arms(np.zeros(1))

    def lines(self, stance: Stance) -> list[tuple[str, FloatArray]]:
        """The arms, and what other machines of rods have."""
        knees, hips = self._knees(stance.joints)[0], self.hip_radius * ARMS
        arms = [
            (f"arm {i + 1}", np.stack([np.broadcast_to(hips[i], knees[:, i].shape), knees[:, i]], 1)) for i in range(3)
        ]
        return [*arms, *super().lines(stance)]


def read(toml: MachineToml) -> RotaryDelta:
    """A rotary delta of a machine file. Raises `InputError`."""
    values = read_sections(toml, SCHEMA, OPTIONAL, stated=False)
    top, arm = values[""], values["arm"]
    low, high = values["limits"]["arm_deg"]
    if not low < high:
        raise toml.fault("limits", "arm_deg", f": {high:g} is not above {low:g}", expected="min below max, in deg")
    spacing, length = m_from_mm(top["rod_spacing_mm"]), m_from_mm(arm["length_mm"])
    joints = np.array([[length, side * spacing, 0.0] for side in (-0.5, 0.5)])  # from the hip, in the arm's axes
    return RotaryDelta(
        **shared_fields(toml, values),
        joint_range=(rad_from_deg(float(low)), rad_from_deg(float(high))),
        legs=axial("rod", 6),
        carriages=tuple(
            Carriage(Element(f"arm {i + 1}", "frame"), (2 * i, 2 * i + 1), np.eye(3), give_of(arm), joints)
            for i in range(3)
        ),
        effector_radius=m_from_mm(top["effector_joint_radius_mm"]),
        joint_height=m_from_mm(top["effector_joint_height_mm"]),
        rod_length=m_from_mm(top["rod_length_mm"]),
        spacing=spacing,
        rod_compliance=m_from_nm(values["rod"]["compliance_nm_per_N"]),
        hip_radius=m_from_mm(top["hip_radius_mm"]),
        arm_length=length,
    )
