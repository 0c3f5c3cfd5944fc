"""Rotary deltas: three arms that turn about horizontal axes, each with a parallelogram of two rods to the effector.

Kinematics of rotarydeltakins(9): arms at 270, 30 and 150 degrees, level at 0 and down at 90 degrees. In an arm's
upright plane, with u and z from its hip to the effector's joint, y across, the rod's length s gives
u cos q - z sin q = (t^2 + u^2 + y^2 + z^2 - s^2) / 2t, of which the arm outwards is the solution.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine import parallel_file
from toolpath_stiff.machine.delta import OUTWARDS, ROD, RODS, UP, Level, level_fields, rod_joints
from toolpath_stiff.machine.elements import Element, Stance
from toolpath_stiff.machine.parallel import Carriage, Legs
from toolpath_stiff.machine.schema import Key, MachineToml, read_sections
from toolpath_stiff.units import m_from_mm, rad_from_deg

SCHEMA = {
    "": {**parallel_file.TOP, **RODS, "hip_radius_mm": parallel_file.LENGTH},
    "limits": {"arm_deg": Key(unit="deg", shape=(2,), low=-180.0, high=180.0)},
    "rod": ROD,
    "arm": {"length_mm": parallel_file.LENGTH, **parallel_file.GIVE},
    **parallel_file.SHARED,
}
ARMS = -OUTWARDS


@dataclass(frozen=True, kw_only=True)
class RotaryDelta(Level):
    """A rotary delta; the hips lie in the plane z = 0.

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
        """Kind of each arm's joint: "rotary"."""
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
        return knees + rod_joints(ARMS, 0.0, self.rod_spacing), stance.position[:, None] + self.effector_arms(
            np.zeros(1)
        )

    def lines(self, stance: Stance) -> list[tuple[str, FloatArray]]:
        """The arms, and the lines that other machines with rods have."""
        knees, hips = self._knees(stance.joints)[0], self.hip_radius * ARMS
        arms = [
            (f"arm {i + 1}", np.stack([np.broadcast_to(hips[i], knees[:, i].shape), knees[:, i]], 1)) for i in range(3)
        ]
        return [*arms, *super().lines(stance)]


def read(toml: MachineToml) -> RotaryDelta:
    """A rotary delta of a machine file. Raises `InputError`."""
    values = read_sections(toml, SCHEMA, parallel_file.OPTIONAL, stated=False)
    arm, fields = values["arm"], level_fields(toml, values)
    low, high = values["limits"]["arm_deg"].tolist()
    if not low < high:
        raise toml.fault("limits", "arm_deg", f": {high:g} is not above {low:g}", expected="min below max, in deg")
    length, aside = m_from_mm(arm["length_mm"]), 0.5 * fields["rod_spacing"]
    joints, give = np.array([[length, -aside, 0.0], [length, aside, 0.0]]), parallel_file.give_of(arm)
    return RotaryDelta(
        **fields,
        **parallel_file.lengths(values[""], "hip_radius"),
        joint_range=(rad_from_deg(low), rad_from_deg(high)),
        carriages=tuple(
            Carriage(Element(f"arm {i + 1}", "frame"), (2 * i, 2 * i + 1), np.eye(3), give, joints) for i in range(3)
        ),
        arm_length=length,
    )
