"""The pictures of a machine: at a pose, and of one that was checked with its doubtful joints."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from toolpath_stiff.analysis.evaluation import joint_columns
from toolpath_stiff.analysis.machine_check import MachineCheck
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.kinematics import solve_struts_at
from toolpath_stiff.machine.limits import stand as stand_at
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.poses import pose_in_mm
from toolpath_stiff.report.colours import BLUE
from toolpath_stiff.report.pictures.style import Look, new_figure, panel
from toolpath_stiff.units import mm_from_m, n_per_um_from_n_per_m

STRUT, PLATFORM, TOOL, FRAME = BLUE, "#5b6675", "#c2410c", "#9aa4b1"
COLOURS = {"tool": TOOL, "platform": PLATFORM, "work": FRAME, "base": FRAME}  # of bodies by name, others as struts
LABEL = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.0}


def machine_at(_: object, *, machine: MachineTool, pose: FloatArray) -> Figure:
    """A machine at one pose (6,) in m and rad."""
    return _views(machine, pose) if isinstance(machine, Hexapod) else _views_of_elements(machine, pose)


def machine_checked(check: MachineCheck) -> Figure:
    """The machine at its neutral pose."""
    machine = check.model.machine
    return machine_at(check, machine=machine, pose=np.array(machine.limits.neutral_pose))


def _views(machine: Hexapod, pose: FloatArray) -> Figure:
    """From above, from the front and from the right, at a pose (6,) in m and rad; struts with length and stiffness."""
    struts = solve_struts_at(machine, pose)
    joints, frame, tip = mm_from_m(pose[:3] + struts.arms[0]), mm_from_m(machine.frame_joints), mm_from_m(pose[:3])
    where = "tool tip at X{:g} Y{:g} Z{:g} mm, roll {:g}, pitch {:g}, yaw {:g} degrees".format(
        *pose_in_mm(pose.tolist())
    )
    stiffness = n_per_um_from_n_per_m(machine.strut_law.stiffness(struts.lengths[0]))
    figure = new_figure(14.0, 7.4, machine.title, where.format(*pose_in_mm(pose.tolist())))
    for k, (first, second, title) in enumerate(((0, 1, "from above"), (0, 2, "from the front"))):
        axes = panel(figure, 0.84 + 6.86 * k, 0.67, 5.88, 5.2)
        _draw_view(axes, frame, joints, tip, [first, second])
        axes.set(title=title, xlabel=f"{'XYZ'[first]} mm", ylabel=f"{'XYZ'[second]} mm")
    figures = zip(mm_from_m(struts.lengths[0]), stiffness, strict=True)
    words = [f"{i}: {mm:.0f} mm, {k:.1f} N/um" for i, (mm, k) in enumerate(figures, 1)]
    figure.text(0.97, 0.9, f"struts {'; '.join(words[:3])}\n{'; '.join(words[3:])}", ha="right", size=9, color=PLATFORM)
    return figure


def _views_of_elements(machine: MachineTool, pose: FloatArray) -> Figure:
    """From above and from the front at a pose (6,): the bodies by name, the joints' values beside."""
    _, stance, stand = stand_at(machine, pose)
    assert isinstance(stance, Stance)
    where = "tool tip at X{:g} Y{:g} Z{:g} mm, A {:g}, B {:g}, C {:g} degrees".format(*pose_in_mm(pose.tolist()))
    beyond = "" if stand.reachable[0] else f": out of reach, {stand.describe(0)}"
    figure = new_figure(14.0, 7.4, machine.title, where + beyond)
    bodies = [(name, mm_from_m(points[0])) for name, points in machine.lines(stance)]
    for k, (first, second, title) in enumerate(((0, 1, "from above"), (0, 2, "from the front"))):
        axes = panel(figure, 0.84 + 6.86 * k, 0.67, 5.88, 5.2)
        for name, points in bodies:
            axes.plot(*points[:, [first, second]].T, "o-", color=COLOURS.get(name, STRUT), lw=1.8, ms=5)
            middle = points[:, [first, second]].mean(axis=0)
            axes.annotate(name, tuple(middle), fontsize=9, color=COLOURS.get(name, STRUT), bbox=LABEL)
        _finish(axes, mm_from_m(stance.position[0])[[first, second]])
        axes.set(title=title, xlabel=f"{'XYZ'[first]} mm", ylabel=f"{'XYZ'[second]} mm")
    columns = zip(machine.joint_names, joint_columns(machine, stance.joints).items(), strict=True)
    words = [f"{name} {values[0]:.1f} {column.rpartition('_')[2]}" for name, (column, values) in columns]
    figure.text(0.97, 0.9, "; ".join(words), ha="right", size=9, color=PLATFORM)
    return figure


def _finish(axes: Axes, tip: FloatArray) -> None:
    """The tool tip, and the look of the axes."""
    axes.plot(*tip, "o", color=TOOL, ms=8)
    axes.annotate("tool tip", tuple(tip), xytext=(8, -4), textcoords="offset points", fontsize=9, color=TOOL)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    axes.grid(True, color="#e5e7eb", lw=0.6)


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
    _finish(axes, tip[seen])


PICTURES = {"machine.png": machine_at}
