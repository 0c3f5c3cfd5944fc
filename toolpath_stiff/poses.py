"""Poses in SI and in the shop's units, as six numbers."""

from collections.abc import Iterable

from toolpath_stiff.units import deg_from_rad, m_from_mm, mm_from_m, rad_from_deg

Pose = tuple[float, float, float, float, float, float]  # x, y, z in m, roll, pitch, yaw (or A, B, C) in rad
ShopPose = tuple[float, float, float, float, float, float]  # the same in mm and degrees


def pose_in_mm(pose: Iterable[float]) -> ShopPose:
    """A pose given in m and rad, converted to mm and degrees."""
    x, y, z, a, b, c = pose
    return (mm_from_m(x), mm_from_m(y), mm_from_m(z), deg_from_rad(a), deg_from_rad(b), deg_from_rad(c))


def pose_in_si(pose: Iterable[float]) -> Pose:
    """A pose given in mm and degrees (angles may be left out: upright), converted to m and rad."""
    x, y, z, a, b, c = [*map(float, pose), 0.0, 0.0, 0.0][:6]
    return (m_from_mm(x), m_from_mm(y), m_from_mm(z), rad_from_deg(a), rad_from_deg(b), rad_from_deg(c))
