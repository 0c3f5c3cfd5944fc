"""A machine's figures, as text and as rows of a table."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.limits import Reach
from toolpath_stiff.machine.model import Hexapod, MachineTool, StrutLaw
from toolpath_stiff.poses import pose_in_mm
from toolpath_stiff.report.machine_elements import Row, element_rows
from toolpath_stiff.report.pages import markup, part, render
from toolpath_stiff.report.scene import machine_scene, reach_boundary
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.units import deg_from_rad, mm_from_m, mm_per_min_from_m_per_s, n_per_um_from_n_per_m


class MachineFigure(NamedTuple):
    """A figure in the shop's units, its origin, and a remark."""

    quantity: str
    value: str
    unit: str
    origin: str
    remark: str


def _law_figures(law: StrutLaw) -> tuple[str, str]:
    if law.constant:
        return f"{n_per_um_from_n_per_m(law.stiffness_1):g}", "N/um at every length"
    first, *rest = [
        f"{n_per_um_from_n_per_m(stiffness):g} N/um at {mm_from_m(length):g}" for length, stiffness in law.points
    ]
    return ", ".join([f"{first} mm", *rest]), "mm, linear between" if law.shape else "mm, linear"


def machine_figures(machine: MachineTool) -> list[MachineFigure]:
    """All figures of a machine."""
    rows = _hexapod_rows(machine) if isinstance(machine, Hexapod) else element_rows(machine)
    limits = machine.limits
    low, high = mm_from_m(limits.workspace)
    if isinstance(machine, Hexapod) or np.isfinite(limits.workspace).all():
        rows += [
            ("limits.workspace", "workspace from", _numbers(low), "mm"),
            ("limits.workspace", "workspace to", _numbers(high), "mm"),
        ]
    if isinstance(machine, Hexapod):
        rows.append(("limits.singularity", "singularity index at least", f"{limits.singularity:g}", ""))
    rows += [
        ("setup", "default origin (program zero)", _numbers(pose_in_mm(machine.default_origin)), "mm, deg"),
        ("setup", "rapid feed", f"{mm_per_min_from_m_per_s(machine.rapid_feed):g}", "mm/min"),
    ]
    origins, remarks = machine.origins, machine.remarks
    return [
        MachineFigure(quantity, value, unit, origins.get(section, "assumed"), remarks.get(section, ""))
        for section, quantity, value, unit in rows
    ]


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(f"{round(float(v), 3) + 0.0:g}" if abs(v) < 1e5 else f"{v:g}" for v in values)


def _hexapod_rows(machine: Hexapod) -> list[Row]:
    limits = machine.limits

    def joints(section: str, unit: str) -> list[Row]:
        name = section.removesuffix("s").replace("_", " ")
        rows = enumerate(mm_from_m(getattr(machine, section)), 1)
        return [(section, f"{name} {i}", _numbers(joint), unit) for i, joint in rows]

    frame_angle, platform_angle = (
        f"{deg_from_rad(angle):g}" for angle in (limits.frame_joint_angle, limits.platform_joint_angle)
    )
    return [
        *joints("frame_joints", "mm"),
        *joints("platform_joints", "mm from the tool tip"),
        ("reference_tool", "reference tool length", f"{mm_from_m(machine.reference_tool_length):g}", "mm"),
        ("strut_law", "strut stiffness", *_law_figures(machine.strut_law)),
        ("platform", "platform bar stiffness", f"{machine.platform_bar_stiffness:g}", "N/m"),
        ("limits.strut_length", "strut length", _numbers(map(mm_from_m, limits.strut_length)), "mm"),
        ("limits.joint_angle", "frame joint angle up to", frame_angle, "deg"),
        ("limits.joint_angle", "platform joint angle up to", platform_angle, "deg"),
        ("limits.joint_angle", "neutral pose of the joints", _numbers(pose_in_mm(limits.neutral_pose)), "mm, deg"),
    ]


def page(machine: MachineTool, pose: FloatArray, stand: Reach) -> str:
    """Page with the machine at a pose (6,), m and rad, that can be turned, its reach and its figures."""
    at = pose_in_mm(pose.tolist())
    where = "drawn at X{:g} Y{:g} Z{:g} mm, A{:g} B{:g} C{:g} deg".format(*at)
    data = {"scene": {**machine_scene(machine, pose[None]), "reach": reach_boundary(machine)}, "pose": at}
    figures = ShownTable(("figure", "value", "unit", "origin", "remark"), machine_figures(machine))
    return "".join(
        render(
            "machine.html",
            styles=["viewer.css", "sections.css", "map.css"],
            scripts=["stage.js", "viewer.js", "solids.js", "machine.js", "show.js"],
            data=data,
            title=machine.title,
            about=machine.source,
            status=f"{where}: {stand.describe(0)}",
            figures=markup("<section>{}</section>", part(figures)),
        )
    )


def text(machine: MachineTool, stand: Reach) -> str:
    """Figures with their origin, remarks, and the margins of the drawn pose to the limits."""
    rows = machine_figures(machine)
    width = max(len(row[0]) for row in rows)
    lines = [f"{machine.title}\n{machine.source}\n"]
    lines += [
        f"  {quantity:<{width}}  {value} {unit}".rstrip() + f"  [{origin}]" for quantity, value, unit, origin, _ in rows
    ]
    remarks = {row[4] for row in rows if row[4]}
    remarked = "".join(f"\n  {name}: {remark}" for name, remark in machine.remarks.items() if remark in remarks)
    return "\n".join([*lines, f"{remarked}\n\n  at the pose drawn: {stand.describe(0)}"])
