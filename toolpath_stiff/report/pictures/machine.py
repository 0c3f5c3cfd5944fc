"""Pictures of a machine: as the paper's Figure 2, and from two sides with doubtful joints marked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from toolpath_stiff.analysis.machine_check import MachineCheck
from toolpath_stiff.api.machines import Machine
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.kinematics import Struts, solve_struts_at
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.report.colours import BLUE
from toolpath_stiff.report.pictures.style import Look, new_figure, panel
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness.truss import HUB, TIP, platform_bars, platform_nodes
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m, pose_in_mm

STRUT, PLATFORM, TOOL, FRAME = BLUE, "#5b6675", "#c2410c", "#9aa4b1"
BELOW = -0.1  # of the picture's height: the views' empty rims lie beyond it
TOP = 0.84  # of the picture's height, below the headings
FULL = 0.96  # of its half that a view fills
LABEL = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.0}


def machine_picture(of: Machine, *, pose_mm_deg: Sequence[float] | None = None) -> Figure:
    """A machine at one pose with its struts there, and its platform."""
    machine = of.model.machine
    pose, struts, _ = of.standing(pose_mm_deg)
    joints = pose[:3] + struts.arms[0]
    nodes = pose[:3] + platform_nodes(machine.platform_joints) @ rotation_matrices(pose[3:]).T
    figure = new_figure(14.0, 7.2, machine.title, _where(pose))
    whole = figure.add_axes((0.0, BELOW, 0.5, 1.0), projection="3d")
    _draw_whole(whole, machine, mm_from_m(joints), mm_from_m(nodes), struts)
    _draw_platform(figure.add_axes((0.5, BELOW, 0.5, 1.0), projection="3d"), machine, mm_from_m(nodes))
    figure.draw_without_rendering()
    for axes in figure.axes:
        _fill(axes, figure.bbox.height)
    return figure


def _fill(axes: Any, height: float) -> None:
    """Zoom a view, as drawn once, so that its axes and labels fill its half of the picture."""
    room, drawn = (
        axes.get_window_extent(),
        Bbox.union([axis.get_tightbbox() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]),
    )
    x, y = 0.5 * (room.x0 + room.x1), 0.5 * (room.y0 + room.y1)
    across = max(x - drawn.x0, drawn.x1 - x) / (0.5 * room.width)
    up = max((y - drawn.y0) / y, (drawn.y1 - y) / (TOP * height - y))
    spans = [high - low for low, high in (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())]
    axes.set_box_aspect(spans, zoom=FULL / max(across, up))


def _where(pose: FloatArray) -> str:
    """The pose (6,) in m and rad in words."""
    x, y, z, a, b, c = pose_in_mm(pose.tolist())
    return f"tool tip at X{x:g} Y{y:g} Z{z:g} mm, roll {a:g}, pitch {b:g}, yaw {c:g} degrees   ·   lengths in mm"


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
    axes.set_box_aspect(1.1 * span)
    axes.patch.set_visible(False)
    axes.tick_params(labelsize=7.5, colors="#6b7280")
    axes.locator_params(nbins=5)
    axes.view_init(elev=18, azim=-62)


def machine_views(check: MachineCheck) -> Figure:
    """The machine at its neutral pose, from above and from the side; joints that stray have a ring."""
    machine, marked = check.model.machine, [(stray.body, stray.joint) for stray in check.symmetry.strays]
    pose = np.array(machine.limits.neutral_pose)
    joints = mm_from_m(pose[:3] + solve_struts_at(machine, pose).arms[0])
    frame, tip = mm_from_m(machine.frame_joints), mm_from_m(pose[:3])
    ring = "   ·   ring: does not follow the symmetry of the other joints" if marked else ""
    figure = new_figure(14.0, 7.4, machine.title, _where(pose) + ring)
    for k, (first, second, title) in enumerate(((0, 1, "from above"), (0, 2, "from the side, along Y"))):
        axes = panel(figure, 0.84 + 6.86 * k, 0.67, 5.88, 5.5)
        _draw_view(axes, frame, joints, tip, [first, second])
        for body, i in marked:
            place = (frame if body == "frame" else joints)[i]
            axes.plot(place[first], place[second], "o", ms=18, mfc="none", mec=TOOL, mew=2.0)
        axes.set_title(title, color="#374151")
        axes.set_xlabel(f"{'XYZ'[first]} mm")
        axes.set_ylabel(f"{'XYZ'[second]} mm")
    return figure


def _draw_view(axes: Axes, frame: FloatArray, joints: FloatArray, tip: FloatArray, seen: list[int]) -> None:
    for body, colour in ((frame, FRAME), (joints, PLATFORM)):
        beside = body[:, :2] - body[:, :2].mean(axis=0)
        order = np.argsort(np.arctan2(beside[:, 1], beside[:, 0]), kind="stable")
        axes.plot(*body[[*order, order[0]]][:, seen].T, color=colour, lw=1.6)
        axes.plot(*body[:, seen].T, "o", color=colour, ms=6)
    for i, (start, end) in enumerate(zip(frame[:, seen], joints[:, seen], strict=True)):
        axes.plot(*np.array([start, end]).T, color=STRUT, lw=1.8)
        # Struts of a vertex, and those behind each other, have their numbers at different places.
        place = start + (0.25 + 0.1 * i) * (end - start)
        style: Look = {"color": STRUT, "ha": "center", "va": "center", "bbox": LABEL}
        axes.text(place[0], place[1], f"{i + 1}", fontsize=10, weight="bold", **style)
    axes.plot(*tip[seen], "o", color=TOOL, ms=8)
    axes.annotate("tool tip", tuple(tip[seen]), xytext=(8, -4), textcoords="offset points", fontsize=9, color=TOOL)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    axes.grid(True, color="#e5e7eb", lw=0.6)


PICTURES = {"machine.png": machine_picture}
