"""Pictures of a machine: at a pose, and when checked, with its doubtful joints."""

from typing import cast

import numpy as np
from matplotlib.figure import Figure

from toolpath_stiff.analysis.evaluation import joint_columns
from toolpath_stiff.analysis.machine_check import MachineCheck
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.limits import stand as stand_at
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.poses import pose_in_mm
from toolpath_stiff.report.colours import BLUE
from toolpath_stiff.report.pictures.style import new_figure, panel
from toolpath_stiff.units import mm_from_m

STRUT, PLATFORM, TOOL, FRAME = BLUE, "#5b6675", "#c2410c", "#9aa4b1"
COLOURS = {"tool": TOOL, "platform": PLATFORM, "work": FRAME, "base": FRAME}  # of bodies by name, others as struts
LABEL = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.0}


def machine_at(_: object, *, machine: MachineTool, pose: FloatArray) -> Figure:
    """A machine from above and from the front at a pose (6,) in m and rad: bodies by name, joints' values beside."""
    _, stance, stand = stand_at(machine, pose)
    where = "tool tip at X{:g} Y{:g} Z{:g} mm, A {:g}, B {:g}, C {:g} degrees".format(*pose_in_mm(pose.tolist()))
    beyond = "" if stand.reachable[0] else f": out of reach, {stand.describe(0)}"
    figure, tip = new_figure(14.0, 7.4, machine.title, where + beyond), mm_from_m(pose[:3])
    if isinstance(stance, Stance):
        tip, bodies = mm_from_m(stance.position[0]), [(name, points[0]) for name, points in machine.lines(stance)]
    else:
        bodies = _bodies_of_struts(cast("Hexapod", machine), pose[:3] + stance.arms[0])
    for k, (first, second, title) in enumerate(((0, 1, "from above"), (0, 2, "from the front"))):
        axes, seen = panel(figure, 0.84 + 6.86 * k, 0.67, 5.88, 5.2), [first, second]
        for n, (name, points) in enumerate(bodies):
            colour, shown = COLOURS.get(name, STRUT), mm_from_m(points)[:, seen]
            axes.plot(*shown.T, "o-", color=colour, lw=1.8, ms=5)
            share = 0.3 + 0.08 * (n % 6)  # names at different places, so that those behind each other stay legible
            if len(shown) == 2:
                place = (1.0 - share) * shown[0] + share * shown[1]
                axes.annotate(name, tuple(place), fontsize=9, color=colour, bbox=LABEL)
        axes.plot(*tip[seen], "o", color=TOOL, ms=8)
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.06)
        axes.set(title=title, xlabel=f"{'XYZ'[first]} mm", ylabel=f"{'XYZ'[second]} mm")
    columns = zip(machine.joint_names, joint_columns(machine, stance.joints).items(), strict=True)
    words = [f"{name} {values[0]:.1f} {column.rpartition('_')[2]}" for name, (column, values) in columns]
    figure.text(0.97, 0.9, "; ".join(words), ha="right", size=9, color=PLATFORM)
    return figure


def _bodies_of_struts(machine: Hexapod, joints: FloatArray) -> list[tuple[str, FloatArray]]:
    """Struts by number, with the platform's joints (6, 3) m, and the outlines of frame and platform."""
    bodies = [(f"{i}", np.stack(ends)) for i, ends in enumerate(zip(machine.frame_joints, joints, strict=True), 1)]
    for name, body in (("base", machine.frame_joints), ("platform", joints)):
        beside = body[:, :2] - body[:, :2].mean(axis=0)
        order = np.argsort(np.arctan2(beside[:, 1], beside[:, 0]), kind="stable")
        bodies.append((name, body[[*order, order[0]]]))
    return bodies


def machine_checked(check: MachineCheck) -> Figure:
    """The machine at its neutral pose."""
    machine = check.model.machine
    return machine_at(check, machine=machine, pose=np.array(machine.limits.neutral_pose))


PICTURES = {"machine.png": machine_at}
