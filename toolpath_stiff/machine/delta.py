"""Linear deltas: three carriages on vertical rails, each with a parallelogram of two rods to the effector.

Kinematics of lineardeltakins(9): towers at 90, 210 and 330 degrees, z + sqrt(L^2 - (R cos f - x)^2 - (R sin f - y)^2).
The rods keep the effector level; a tool does not turn.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine import parallel_file
from toolpath_stiff.machine.elements import Element, Stance
from toolpath_stiff.machine.parallel import Carriage, Legs, Parallel
from toolpath_stiff.machine.schema import Key, MachineToml, Sections, read_sections
from toolpath_stiff.machine.words import refuse_words
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import m_from_mm, m_from_nm

UP = np.array([0.0, 0.0, 1.0])
OUTWARDS = np.array([[np.cos(angle), np.sin(angle), 0.0] for angle in np.deg2rad([90.0, 210.0, 330.0])])
RODS = {"effector_joint_radius_mm": parallel_file.LENGTH, "effector_joint_height_mm": parallel_file.HEIGHT,
        **dict.fromkeys(("rod_length_mm", "rod_spacing_mm"), parallel_file.LENGTH)}  # fmt: skip
ROD = {"compliance_nm_per_N": parallel_file.PER_ROD}
SCHEMA = {
    "": {**parallel_file.TOP, **RODS, "carriage_joint_radius_mm": parallel_file.LENGTH},
    "limits": {"carriage_mm": Key(unit="mm", shape=(2,))},
    "rod": ROD,
    "carriage": {
        "rail_radius_mm": parallel_file.LENGTH,
        "centre_height_mm": parallel_file.HEIGHT,
        **parallel_file.GIVE,
    },
    **parallel_file.SHARED,
}


@dataclass(frozen=True, kw_only=True)
class Delta(Parallel):
    """Three parallelograms that keep the effector level, moved by carriages.

    Attributes
    ----------
    tower_radius
        m, of the rods' joints on the carriages about the machine's axis.
    effector_joint_radius, effector_joint_height
        m, of the rods' joints about the effector's axis, and above the tip of the reference tool.
    rod_length, rod_spacing
        m; of the two rods of a parallelogram.
    rod_compliance
        m/N of one rod with its joints.
    """

    kind: ClassVar[str] = "delta"
    turns: ClassVar[int] = 0
    outwards: ClassVar[FloatArray] = OUTWARDS  # (3, 3), from the machine's axis to each tower

    tower_radius: float
    effector_joint_radius: float
    effector_joint_height: float
    rod_length: float
    rod_spacing: float
    rod_compliance: float

    def rotation_of(self, abc: FloatArray) -> FloatArray:
        """(n, 3, 3) of words A, B, C (n, 3), which must be 0."""
        refuse_words(self.name, abc, "")
        return rotation_matrices(abc)

    def legs_at(self, tip: FloatArray, axes: FloatArray, extension: FloatArray) -> Legs:
        """The six rods; nan where a joint would be too far away, or the tool is turned."""
        arms = self._effector_arms(extension)
        level = np.abs(axes - np.eye(3)).max(axis=(1, 2)) < 1e-9
        places = np.where(level[:, None, None], tip[:, None] + arms.reshape(-1, 3, 2, 3).mean(axis=2), np.nan)
        joints = self.joints_of(places)
        rods = self.feet(joints) - tip[:, None] - arms
        compliance = np.full((len(tip), 6), self.rod_compliance)
        return Legs(joints, rods / self.rod_length, arms, compliance, self.carriage_axes(joints))

    def joints_of(self, places: FloatArray) -> FloatArray:
        """(n, 3) heights of the carriages, whose rods reach places (n, 3, 3) m on the effector."""
        apart = ((self.tower_radius * self.outwards - places)[..., :2] ** 2).sum(axis=-1)
        return np.asarray(places[..., 2] + np.sqrt(self.rod_length**2 - apart))

    def feet(self, joints: FloatArray) -> FloatArray:
        """(n, 6, 3) m, the rods' joints on carriages at heights (n, 3) m."""
        height: FloatArray = np.repeat(joints, 2, axis=1)[..., None] * UP
        return rod_joints(self.outwards, self.tower_radius, self.rod_spacing) + height

    def carriage_axes(self, joints: FloatArray) -> FloatArray | None:
        """(n, 3, 3, 3) axes of the bodies that move the rods; None: they do not turn."""
        return None

    def _effector_arms(self, extension: FloatArray) -> FloatArray:
        """(n, 6, 3) m from the tip to the rods' joints, of tools (n,) m longer than the reference tool."""
        height = UP * (self.effector_joint_height + extension)[:, None, None]
        return rod_joints(self.outwards, self.effector_joint_radius, self.rod_spacing) + height

    def leg_ends(self, stance: Stance) -> tuple[FloatArray, FloatArray]:
        """(n, 6, 3) m each: the rods' joints on what moves them and on the effector."""
        return self.feet(stance.joints), stance.position[:, None] + self._effector_arms(np.zeros(1))


def rod_joints(outwards: FloatArray, radius: float, spacing: float) -> FloatArray:
    """(6, 3) m, joints of the rods on a circle, the two of a tower together."""
    sides = 0.5 * spacing * np.cross(UP, outwards)
    return np.stack([radius * outwards - sides, radius * outwards + sides], axis=1).reshape(6, 3)


def rod_fields(toml: MachineToml, values: Sections) -> dict[str, Any]:
    """Arguments of a delta of either drive that its own sections do not give."""
    lengths = {key.removesuffix("_mm"): m_from_mm(values[""][key]) for key in RODS}
    rod = {"legs": parallel_file.axial("rod", 6), "rod_compliance": m_from_nm(values["rod"]["compliance_nm_per_N"])}
    return {**parallel_file.shared_fields(toml, values), **lengths, **rod}


def read(toml: MachineToml) -> Delta:
    """A delta of a machine file. Raises `InputError`."""
    values = read_sections(toml, SCHEMA, parallel_file.OPTIONAL, stated=False)
    carriage, fields = values["carriage"], rod_fields(toml, values)
    radius = m_from_mm(values[""]["carriage_joint_radius_mm"])
    least = abs(radius - fields["effector_joint_radius"])
    if fields["rod_length"] <= least:
        mistake = f" = {values['']['rod_length_mm']:g}: the rods do not reach the effector"
        raise toml.fault("", "rod_length_mm", mistake, expected=f"more than {1e3 * least:g} mm")
    rods = rod_joints(OUTWARDS, radius, fields["rod_spacing"])
    carriages = []
    for i, outwards in enumerate(OUTWARDS):
        place = m_from_mm(carriage["rail_radius_mm"]) * outwards + m_from_mm(carriage["centre_height_mm"]) * UP
        axes, of_rods = np.column_stack([outwards, np.cross(UP, outwards), UP]), (2 * i, 2 * i + 1)
        element, joints = Element(f"carriage {i + 1}", "frame"), rods[list(of_rods)] - place
        carriages.append(Carriage(element, of_rods, axes, parallel_file.give_of(carriage), joints))
    ends = values["limits"]["carriage_mm"]
    return Delta(
        **fields,
        joint_range=parallel_file.span(toml, "limits", ("carriage_mm", "carriage_mm"), *ends),
        carriages=tuple(carriages),
        tower_radius=radius,
    )
