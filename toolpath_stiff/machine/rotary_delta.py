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
from toolpath_stiff.machine.delta import OUTWARDS, ROD, RODS, UP, Delta, rod_fields, rod_joints
from toolpath_stiff.machine.elements import Element, Stance
from toolpath_stiff.machine.parallel import Carriage
from toolpath_stiff.machine.schema import Key, MachineToml, read_sections
from toolpath_stiff.units import m_from_mm, rad_from_deg

SCHEMA = {
    "": {**parallel_file.TOP, **RODS, "hip_radius_mm": parallel_file.LENGTH},
    "limits": {"arm_deg": Key(unit="deg", shape=(2,), low=-180.0, high=180.0)},
    "rod": ROD,
    "arm": {"length_mm": parallel_file.LENGTH, **parallel_file.GIVE},
    **parallel_file.SHARED,
}


@dataclass(frozen=True, kw_only=True)
class RotaryDelta(Delta):
    """A delta moved by arms; `tower_radius` is that of their axes, the hips, which stand in the plane z = 0.

    Attributes
    ----------
    arm_length
        m, from a hip to the rods' joints.
    """

    kind: ClassVar[str] = "rotary_delta"
    outwards: ClassVar[FloatArray] = -OUTWARDS

    arm_length: float

    @property
    def joint_kinds(self) -> tuple[str, ...]:
        """Kind of each arm's joint: "rotary"."""
        return ("rotary",) * 3

    def joints_of(self, places: FloatArray) -> FloatArray:
        """(n, 3) rad of the arms, whose rods reach places (n, 3, 3) m on the effector."""
        u, z, thigh = (places * self.outwards).sum(axis=-1) - self.tower_radius, places[..., 2], self.arm_length
        y = (places * np.cross(UP, self.outwards)).sum(axis=-1)
        share = (thigh**2 + u**2 + y**2 + z**2 - self.rod_length**2) / (2.0 * thigh * np.hypot(u, z))
        return np.asarray(-np.arctan2(z, u) - np.arccos(share))

    def carriage_axes(self, joints: FloatArray) -> FloatArray:
        """(n, 3, 3, 3) axes of the arms: along the arm, along its hip, square to both."""
        c, s = np.cos(joints)[..., None], np.sin(joints)[..., None]
        hips = np.broadcast_to(np.cross(UP, self.outwards), (len(joints), 3, 3))
        return np.stack([c * self.outwards - s * UP, hips, s * self.outwards + c * UP], axis=-1)

    def feet(self, joints: FloatArray) -> FloatArray:
        """(n, 6, 3) m, the rods' joints at the ends of the arms."""
        along = self.carriage_axes(joints)[..., 0]
        knees: FloatArray = np.repeat(self.arm_length * along, 2, axis=1)
        return knees + rod_joints(self.outwards, self.tower_radius, self.rod_spacing)

    def lines(self, stance: Stance) -> list[tuple[str, FloatArray]]:
        """The arms, and what other machines of rods have."""
        knees = self.feet(stance.joints).reshape(-1, 3, 2, 3).mean(axis=2)
        hips = np.broadcast_to(self.tower_radius * self.outwards, knees.shape)
        arms = [(f"arm {i + 1}", np.stack([hips[:, i], knees[:, i]], axis=1)) for i in range(3)]
        return [*arms, *super().lines(stance)]


def read(toml: MachineToml) -> RotaryDelta:
    """A rotary delta of a machine file. Raises `InputError`."""
    values = read_sections(toml, SCHEMA, parallel_file.OPTIONAL, stated=False)
    arm, fields = values["arm"], rod_fields(toml, values)
    low, high = values["limits"]["arm_deg"].tolist()
    if not low < high:
        raise toml.fault("limits", "arm_deg", f": {high:g} is not above {low:g}", expected="min below max, in deg")
    length, aside = m_from_mm(arm["length_mm"]), 0.5 * fields["rod_spacing"]
    joints, give = np.array([[length, -aside, 0.0], [length, aside, 0.0]]), parallel_file.give_of(arm)
    return RotaryDelta(
        **fields,
        tower_radius=m_from_mm(values[""]["hip_radius_mm"]),
        joint_range=(rad_from_deg(low), rad_from_deg(high)),
        carriages=tuple(
            Carriage(Element(f"arm {i + 1}", "frame"), (2 * i, 2 * i + 1), np.eye(3), give, joints) for i in range(3)
        ),
        arm_length=length,
    )
