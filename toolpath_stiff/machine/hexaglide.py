"""Hexaglides: six struts of fixed length whose feet move on rails.

s = e . d +- sqrt((e . d)^2 - d . d + L^2) with d from a foot's place at 0 to its platform joint, e along the rail. A
strut's force moves its foot along the rail by the drive, across it by the guide.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine import parallel_file
from toolpath_stiff.machine.elements import Element, Stance, beam_axes
from toolpath_stiff.machine.parallel import Carriage, Legs, Parallel
from toolpath_stiff.machine.schema import Key, MachineToml, read_sections
from toolpath_stiff.units import m_from_mm, m_from_nm

DIRECTIONS = Key(shape=(6, 3), low=-1.0, high=1.0)
SCHEMA = {
    "": parallel_file.TOP,
    "feet": {
        "mm": Key(unit="mm", shape=(6, 3)),
        "rails": DIRECTIONS,
        "sides": Key(shape=(6,), low=-1.0, high=1.0),
        "min_mm": Key(unit="mm"),
        "max_mm": Key(unit="mm"),
        **parallel_file.GIVE,
    },
    "platform_joints": {"mm": Key(unit="mm", shape=(6, 3))},
    "strut": {"length_mm": parallel_file.LENGTH, "compliance_nm_per_N": parallel_file.PER_ROD},
    **parallel_file.SHARED,
}


@dataclass(frozen=True, kw_only=True)
class Hexaglide(Parallel):
    """A hexaglide.

    Attributes
    ----------
    feet, rails
        (6, 3) m and unit vectors, base axes: feet at a slide of 0, and the way they move.
    sides
        (6,) 1 or -1: feet ahead of the point of their rail that is nearest to the platform joint, or behind.
    platform_joints
        (6, 3) m, platform axes, from the tip of the reference tool.
    strut_length, strut_compliance
        m; m/N with both joints.
    """

    kind: ClassVar[str] = "hexaglide"

    feet: FloatArray
    rails: FloatArray
    sides: FloatArray
    platform_joints: FloatArray
    strut_length: float
    strut_compliance: float

    def legs_at(self, tip: FloatArray, axes: FloatArray, extension: FloatArray) -> Legs:
        """The six struts; nan where one is too short."""
        up = np.array([0.0, 0.0, 1.0])
        arms = (self.platform_joints + extension[:, None, None] * up) @ np.swapaxes(axes, 1, 2)
        apart = tip[:, None] + arms - self.feet
        along = (apart * self.rails).sum(axis=-1)
        slides = along + self.sides * np.sqrt(along**2 - (apart**2).sum(axis=-1) + self.strut_length**2)
        struts = apart - slides[..., None] * self.rails
        return Legs(slides, struts / self.strut_length, arms, np.full((len(tip), 6), self.strut_compliance))

    def leg_ends(self, stance: Stance) -> tuple[FloatArray, FloatArray]:
        """(n, 6, 3) m each: feet and platform joints."""
        begin = self.feet + stance.joints[..., None] * self.rails
        return begin, stance.position[:, None] + self.platform_joints @ np.swapaxes(stance.axes, 1, 2)


def read(toml: MachineToml) -> Hexaglide:
    """A hexaglide of a machine file. Raises `InputError`."""
    values = read_sections(toml, SCHEMA, parallel_file.OPTIONAL, stated=False)
    feet, strut = values["feet"], values["strut"]
    sizes = np.linalg.norm(feet["rails"], axis=1)
    if not (np.abs(sizes - 1.0) < 0.01).all():
        raise toml.fault("feet", "rails", f": a direction of length {sizes.min():.3g}", expected="6 unit vectors")
    if not (np.abs(feet["sides"]) == 1.0).all():
        raise toml.fault("feet", "sides", f" = {feet['sides'].tolist()}", expected="6 numbers, 1 or -1")
    rails = feet["rails"] / sizes[:, None]
    compliance = parallel_file.give_of(feet)
    carriages = []
    for i, rail in enumerate(rails):
        # x along the rail (the drive), z nearest to the machine's Z; of an upright rail to its X.
        axes = beam_axes(rail, np.eye(3)[0 if abs(rail[2]) > 0.9 else 2])
        carriages.append(Carriage(Element(f"foot {i + 1}", "frame"), (i,), axes, compliance, np.zeros((1, 3))))
    return Hexaglide(
        **parallel_file.shared_fields(toml, values),
        joint_range=parallel_file.span(toml, "feet", ("min_mm", "max_mm"), feet["min_mm"], feet["max_mm"]),
        legs=parallel_file.axial("strut", 6),
        carriages=tuple(carriages),
        feet=m_from_mm(feet["mm"]),
        rails=rails,
        sides=feet["sides"],
        platform_joints=m_from_mm(values["platform_joints"]["mm"]),
        strut_length=m_from_mm(strut["length_mm"]),
        strut_compliance=m_from_nm(strut["compliance_nm_per_N"]),
    )
