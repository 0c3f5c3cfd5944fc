"""A machine as text and pictures (as the paper's Figure 2 and from two sides), poses of it, effects it can carry."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.kinematics import Struts
from toolpath_stiff.machine.model import Hexapod, StrutLaw
from toolpath_stiff.report.figure import BLUE, house_style, new_figure, picture
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness.truss import HUB, TIP, platform_bars, platform_nodes
from toolpath_stiff.units import (
    deg_from_rad,
    mm_from_m,
    mm_per_min_from_m_per_s,
    n_per_mm_from_n_per_m,
    n_per_um_from_n_per_m,
    pose_in_mm,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from toolpath_stiff.machine.limits import Reach


STRUT, PLATFORM, TOOL, FRAME = BLUE, "#5b6675", "#c2410c", "#9aa4b1"
TOP = 0.84  # of the picture's height, below the headings
BELOW = -0.1  # of the picture's height: the views' empty rims lie beyond it
ZOOMS = np.arange(1.5, 0.5, -0.05)  # of a view, the largest at which its axes and labels stay in its half
USUAL_ZOOM = 0.8  # of the packaged machines, within 0.05


@picture
def machine_picture(machine: Hexapod, pose: FloatArray, struts: Struts) -> Figure:
    """PNG of the machine at one pose (6,) m and rad, with its struts there."""
    joints = pose[:3] + struts.arms[0]
    nodes = pose[:3] + platform_nodes(machine.platform_joints) @ rotation_matrices(pose[3:]).T
    with house_style():
        figure = new_figure(14.0, 7.2)
        whole = figure.add_axes((0.0, BELOW, 0.5, 1.0), projection="3d")
        _draw_whole(whole, machine, mm_from_m(joints), mm_from_m(nodes), struts)
        detail = figure.add_axes((0.5, BELOW, 0.5, 1.0), projection="3d")
        _draw_platform(detail, machine, mm_from_m(nodes))
        _fit(figure, (whole, detail))
        heading(figure, machine, pose)
        return figure


def heading(figure: Figure, machine: Hexapod, pose: FloatArray) -> None:
    """Name of the machine, and the pose (6,) in m and rad, above everything."""
    x, y, z, a, b, c = pose_in_mm(pose.tolist())
    where = f"tool tip at X{x:g} Y{y:g} Z{z:g} mm, roll {a:g}, pitch {b:g}, yaw {c:g} degrees   ·   lengths in mm"
    figure.text(0.02, 0.95, machine.title, fontsize=15, weight="bold")
    figure.text(0.02, 0.91, where, fontsize=11, color="#4b5563")


def _draw_whole(axes: Any, machine: Hexapod, joints: FloatArray, nodes: FloatArray, struts: Struts) -> None:
    """Frame joints joined by the frame, struts with number, length and stiffness, platform, tool."""
    frame = mm_from_m(machine.frame_joints)
    order = np.argsort(np.arctan2(frame[:, 1], frame[:, 0]), kind="stable")
    ring = frame[[*order, order[0]]]
    axes.plot(*ring.T, color=FRAME, lw=2.0)
    axes.scatter(*frame.T, color=FRAME, s=26, depthshade=False)
    stiffness = n_per_mm_from_n_per_m(machine.strut_law.stiffness(struts.lengths[0]))
    for i in range(6):
        axes.plot(*np.array([frame[i], joints[i]]).T, color=STRUT, lw=2.2)
        # The two struts of a vertex run close together: their labels sit at different heights.
        place = frame[i] + (0.3 if i % 2 else 0.55) * (joints[i] - frame[i])
        label = f"{i + 1}: {mm_from_m(struts.lengths[0, i]):.0f} mm, {stiffness[i] / 1e3:.1f} kN/mm"
        axes.text(*place, label, fontsize=8, color="#1f2937", ha="center", va="center", bbox=LABEL)
    _truss(axes, machine, nodes, lw=1.2)
    axes.scatter(*nodes[TIP], color=TOOL, s=30, depthshade=False)
    axes.set_title("whole machine: struts with length and stiffness", fontsize=10, color="#374151", y=0.85 - BELOW)
    _finish(axes, np.vstack([frame, nodes]))


def _fit(figure: Figure, views: Sequence[Any]) -> None:
    """Zoom each view so that it fills its half of the picture with nothing beyond it.

    One drawing shows how far figures and names reach beyond the box, which changes little with the zoom; the second
    shows that what was foreseen fits.
    """
    for axes in views:
        _box(axes, USUAL_ZOOM)
    figure.draw_without_rendering()
    reach = [_reach(axes) for axes in views]
    left = [[zoom for zoom in ZOOMS if _fits(figure, axes, _box(axes, zoom) + beyond)] or [ZOOMS[-1]]
            for axes, beyond in zip(views, reach, strict=True)]  # fmt: skip
    while True:
        for axes, zooms in zip(views, left, strict=True):
            _box(axes, zooms[0])
        figure.draw_without_rendering()
        too_large = [
            zooms for axes, zooms in zip(views, left, strict=True)
            if len(zooms) > 1 and not _fits(figure, axes, _box(axes, zooms[0]) + _reach(axes))
        ]  # fmt: skip
        if not too_large:
            return
        for zooms in too_large:
            zooms.pop(0)


def _box(axes: Any, zoom: float | None = None) -> FloatArray:
    """(2, 2) pixels of the lower left and upper right corner of a view's box, zoomed if asked."""
    limits = axes.get_xlim(), axes.get_ylim(), axes.get_zlim()
    if zoom is not None:
        axes.set_box_aspect([high - low for low, high in limits], zoom=float(zoom))
    seen = np.array(list(product(*limits, (1.0,)))) @ axes.get_proj().T  # homogeneous
    points = axes.transData.transform(seen[:, :2] / seen[:, 3:])
    return np.array([points.min(axis=0), points.max(axis=0)])


def _reach(axes: Any) -> FloatArray:
    """(2, 2) pixels by which a view's figures and what its axes are called reach beyond its box, as it is drawn."""
    box = _box(axes)
    boxes = [axis.get_tightbbox() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
    ends = np.concatenate([box, *(box_of_axis.get_points() for box_of_axis in boxes if box_of_axis is not None)])
    return np.array([ends.min(axis=0), ends.max(axis=0)]) - box


def _fits(figure: Figure, axes: Any, extent: FloatArray) -> bool:
    """Whether corners (2, 2) in pixels lie in the view's half of the picture, below the headings."""
    (left, below), (right, above) = extent
    room = axes.get_window_extent()
    return bool(room.x0 <= left and right <= room.x1 and below >= 0.0 and above <= TOP * figure.bbox.height)


LABEL = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.0}


def _draw_platform(axes: Any, machine: Hexapod, nodes: FloatArray) -> None:
    """The truss of the platform with its nodes named."""
    _truss(axes, machine, nodes, lw=2.0)
    names = [*(f"joint {i + 1}" for i in range(6)), "hub", "tool tip"]
    for node, name in zip(nodes, names, strict=True):
        axes.scatter(*node, color=TOOL if name == "tool tip" else PLATFORM, s=30, depthshade=False)
        axes.text(*node, f"  {name}", fontsize=8.5, color="#1f2937")
    axes.set_title("platform: 19 bars, hub and tool", fontsize=10, color="#374151", y=0.85 - BELOW)
    _finish(axes, nodes)


def _truss(axes: Any, machine: Hexapod, nodes: FloatArray, lw: float) -> None:
    for i, j in platform_bars(machine.platform_joints):
        tool = {i, j} == {HUB, TIP}
        axes.plot(*nodes[[i, j]].T, color=TOOL if tool else PLATFORM, lw=2 * lw if tool else lw)


def _finish(axes: Any, points: FloatArray) -> None:
    """Equal scales, quiet panes, axes named with their unit."""
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(high - low, 0.05 * (high - low).max())
    for axis, lo, width in zip("xyz", low, span, strict=True):
        getattr(axes, f"set_{axis}lim")(lo - 0.05 * width, lo + 1.05 * width)
        pad = 8.0 if axis == "z" else None  # clear of the figures
        getattr(axes, f"set_{axis}label")(f"{axis.upper()} mm", fontsize=9, color="#4b5563", labelpad=pad)
        getattr(axes, f"{axis}axis").pane.set_facecolor("#f8fafc")
    axes.patch.set_visible(False)
    axes.tick_params(labelsize=7.5, colors="#6b7280")
    axes.locator_params(nbins=5)
    axes.view_init(elev=18, azim=-62)


def _law_figures(law: StrutLaw) -> tuple[str, str]:
    """Value and unit of a strut law."""
    if law.constant:
        return f"{n_per_um_from_n_per_m(law.stiffness_1):g}", "N/um at every length"
    first, *rest = [
        f"{n_per_um_from_n_per_m(stiffness):g} N/um at {mm_from_m(length):g}" for length, stiffness in law.points
    ]
    return ", ".join([f"{first} mm", *rest]), "mm, linear between" if law.shape else "mm, linear"


def machine_figures(machine: Hexapod) -> list[tuple[str, str, str, str, str]]:
    """Quantity, value, unit, origin, remark of a machine's figures, in the shop's units."""
    limits = machine.limits

    def numbers(values: Iterable[float]) -> str:
        return ", ".join(f"{round(float(v), 3) + 0.0:g}" if abs(v) < 1e5 else f"{v:g}" for v in values)

    def joints(section: str, unit: str) -> list[tuple[str, str, str, str]]:
        name = section.removesuffix("s").replace("_", " ")
        rows = enumerate(mm_from_m(getattr(machine, section)), 1)
        return [(section, f"{name} {i}", numbers(joint), unit) for i, joint in rows]

    frame_angle, platform_angle = (
        f"{deg_from_rad(angle):g}" for angle in (limits.frame_joint_angle, limits.platform_joint_angle)
    )
    low, high = mm_from_m(limits.workspace)
    rows = [
        *joints("frame_joints", "mm"),
        *joints("platform_joints", "mm from the tool tip"),
        ("reference_tool", "reference tool length", f"{mm_from_m(machine.reference_tool_length):g}", "mm"),
        ("strut_law", "strut stiffness", *_law_figures(machine.strut_law)),
        ("platform", "platform bar stiffness", f"{machine.platform_bar_stiffness:g}", "N/m"),
        ("limits.strut_length", "strut length", numbers(map(mm_from_m, limits.strut_length)), "mm"),
        ("limits.joint_angle", "frame joint angle up to", frame_angle, "deg"),
        ("limits.joint_angle", "platform joint angle up to", platform_angle, "deg"),
        ("limits.joint_angle", "neutral pose of the joints", numbers(pose_in_mm(limits.neutral_pose)), "mm, deg"),
        ("limits.workspace", "workspace from", numbers(low), "mm"),
        ("limits.workspace", "workspace to", numbers(high), "mm"),
        ("limits.singularity", "singularity index at least", f"{limits.singularity:g}", ""),
        ("setup", "default origin (program zero)", numbers(pose_in_mm(machine.default_origin)), "mm, deg"),
        ("setup", "rapid feed", f"{mm_per_min_from_m_per_s(machine.rapid_feed):g}", "mm/min"),
    ]
    origins, remarks = machine.origins, machine.remarks
    return [
        (quantity, value, unit, origins.get(section, "assumed"), remarks.get(section, ""))
        for section, quantity, value, unit in rows
    ]


def figure_entries(machine: Hexapod) -> list[dict[str, str]]:
    """`machine_figures` for JSON."""
    names = ("quantity", "value", "unit", "origin", "remark")
    return [dict(zip(names, row, strict=True)) for row in machine_figures(machine)]


def text(machine: Hexapod, stand: Reach) -> str:
    """Figures with their origin, remarks, and how the pose that is drawn stands to the limits."""
    rows = machine_figures(machine)
    width = max(len(row[0]) for row in rows)
    lines = [f"{machine.title}\n{machine.source}\n"]
    lines += [
        f"  {quantity:<{width}}  {value} {unit}".rstrip() + f"  [{origin}]" for quantity, value, unit, origin, _ in rows
    ]
    remarks = {row[4] for row in rows if row[4]}
    remarked = "".join(f"\n  {name}: {remark}" for name, remark in machine.remarks.items() if remark in remarks)
    return "\n".join([*lines, f"{remarked}\n\n  at the pose drawn: {stand.describe(0)}"])
