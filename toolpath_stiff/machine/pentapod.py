"""Pentapods: five telescopic struts on rings about the tool's axis; one of them keeps the head from turning about it.

Kinematics of pentakins(9): a strut lies in the plane of its base joint and the tool's axis; its ring has a radius
and a height above the tip. Struts carry no torque about the axis; the strut whose ring has no bearing bends under it: a
force at its base joint, along its hinge (assumed: spherical base joint, hinge on the head).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.elements import Element, Stance
from toolpath_stiff.machine.parallel import Legs, Parallel
from toolpath_stiff.machine.parallel_file import LENGTH, OPTIONAL, PER_ROD, SHARED, TOP, axial, shared_fields, span
from toolpath_stiff.machine.schema import Key, MachineToml, read_sections
from toolpath_stiff.machine.words import refuse_words
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import m_from_mm, m_from_nm

SCHEMA = {
    "": {
        **TOP,
        "base_mm": Key(unit="mm", shape=(5, 3)),
        "ring_radius_mm": Key(unit="mm", shape=(5,), low=0.0, open_low=True),
        "ring_height_mm": Key(unit="mm", shape=(5,)),
    },
    "strut": {
        "length_mm": LENGTH,
        "compliance_nm_per_N": PER_ROD,
        "slope_nm_per_N_per_m": Key(unit="nm/N per m", low=-1e6, high=1e6),
        "min_mm": LENGTH,
        "max_mm": LENGTH,
    },
    "torsion": {
        "strut": Key(low=1.0, high=5.0),
        "EI_MNm2": Key(unit="MN m2", low=0.0, high=1e6, open_low=True, infinite=True),
        "hinge_nrad_per_Nm": Key(unit="nrad/(N m)", low=0.0, high=1e9),
    },
    **SHARED,
}


@dataclass(frozen=True, kw_only=True)
class Pentapod(Parallel):
    """A pentapod.

    Attributes
    ----------
    base_joints
        (5, 3) m, base axes.
    ring_radius, ring_height
        (5,) m; heights above the tip of the reference tool.
    compliance, slope, length
        A strut's m/N at a length in m, and by how much it grows, 1/N.
    torsion_strut
        Number of the strut whose ring has no bearing, from 0.
    bending, hinge
        Its N m2, and the compliance of its hinge, rad/(N m).
    """

    kind: ClassVar[str] = "pentapod"
    turns: ClassVar[int] = 2

    base_joints: FloatArray
    ring_radius: FloatArray
    ring_height: FloatArray
    compliance: float
    slope: float
    length: float
    torsion_strut: int
    bending: float
    hinge: float

    def rotation_of(self, abc: FloatArray) -> FloatArray:
        """(n, 3, 3) Ry(B) Rx(A) for words A, B, C (n, 3) rad; C must be 0."""
        refuse_words(self.name, abc, "AB")
        return rotation_matrices(abc)

    def _rings(self, tip: FloatArray, axes: FloatArray, extension: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, 5, 3) m each, from the tip, base axes: base joints, and points where the struts meet their rings."""
        to_base = self.base_joints - tip[:, None]
        local = to_base @ axes
        outwards = local[..., :2] / np.linalg.norm(local[..., :2], axis=-1, keepdims=True)
        height = np.broadcast_to(self.ring_height + extension[:, None], local.shape[:2])
        ring = np.concatenate([self.ring_radius[:, None] * outwards, height[..., None]], axis=-1)
        return to_base, ring @ np.swapaxes(axes, 1, 2)

    def legs_at(self, tip: FloatArray, axes: FloatArray, extension: FloatArray) -> Legs:
        """Five struts, and the force that holds the head against turning."""
        to_base, rings = self._rings(tip, axes, extension)
        struts = rings - to_base
        lengths = np.linalg.norm(struts, axis=-1)
        held = self.torsion_strut
        hinge = np.cross(axes[..., 2], to_base[:, held])
        hinge = hinge / np.linalg.norm(hinge, axis=-1, keepdims=True)
        directions = np.concatenate([struts / lengths[..., None], hinge[:, None]], axis=1)
        arms = np.concatenate([rings, to_base[:, held : held + 1]], axis=1)
        turning = lengths[:, held] ** 3 / (3.0 * self.bending) + lengths[:, held] ** 2 * self.hinge
        axial = self.compliance + self.slope * (lengths - self.length)
        return Legs(lengths, directions, arms, np.concatenate([axial, turning[:, None]], axis=1))

    def leg_ends(self, stance: Stance) -> tuple[FloatArray, FloatArray]:
        """(n, 5, 3) m each: base joints, and points where the struts meet their rings."""
        to_base, rings = self._rings(stance.position, stance.axes, np.zeros(len(stance)))
        return stance.position[:, None] + to_base, stance.position[:, None] + rings


def read(toml: MachineToml) -> Pentapod:
    """A pentapod of a machine file. Raises `InputError`."""
    values = read_sections(toml, SCHEMA, OPTIONAL, stated=False)
    top, strut, torsion = values[""], values["strut"], values["torsion"]
    held = int(torsion["strut"])
    if held != torsion["strut"]:
        raise toml.fault("torsion", "strut", f" = {torsion['strut']:g}", expected="a whole number from 1 to 5")
    shortest, longest = span(toml, "strut", ("min_mm", "max_mm"), strut["min_mm"], strut["max_mm"])
    compliance, slope = m_from_nm(strut["compliance_nm_per_N"]), m_from_nm(strut["slope_nm_per_N_per_m"])
    length = m_from_mm(strut["length_mm"])
    if min(compliance + slope * (end - length) for end in (shortest, longest)) <= 0.0:
        mistake = f" = {strut['slope_nm_per_N_per_m']:g}: no compliance is left within the travel"
        expected = "a compliance above 0 from min_mm to max_mm"
        raise toml.fault("strut", "slope_nm_per_N_per_m", mistake, expected)
    return Pentapod(
        **shared_fields(toml, values),
        joint_range=(shortest, longest),
        legs=(*axial("strut", 5), Element(f"strut {held} bending", "struts", ("across",))),
        base_joints=m_from_mm(top["base_mm"]),
        ring_radius=m_from_mm(top["ring_radius_mm"]),
        ring_height=m_from_mm(top["ring_height_mm"]),
        compliance=compliance,
        slope=slope,
        length=length,
        torsion_strut=held - 1,
        bending=1e6 * torsion["EI_MNm2"],
        hinge=m_from_nm(torsion["hinge_nrad_per_Nm"]),
    )
