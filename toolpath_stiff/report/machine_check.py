"""A check of a machine file: words, and pictures of the machine from two sides."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.machine_check import BEYOND, MACHINING_CENTRE, ROBOT, MachineCheck
from toolpath_stiff.analysis.poses import PoseStiffness
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.kinematics import solve_struts_at
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.machine.symmetry import Symmetry
from toolpath_stiff.report.figure import house_style, new_figure, picture
from toolpath_stiff.report.machine import FRAME, LABEL, PLATFORM, STRUT, TOOL, heading
from toolpath_stiff.stiffness.model import acting_names, condition_warnings
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m, n_per_um_from_n_per_m, um_from_m

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def text(check: MachineCheck) -> str:
    """What is wrong or doubtful in a machine file, what acts, how stiff it is."""
    model, machine = check.model, check.model.machine
    verdict = "the file is good" if check.good else f"{len(check.wrong)} things cannot be right"
    if len(check.wrong) == 1:
        verdict = "one thing cannot be right"
    if check.good and check.doubtful:
        verdict = "the file can be used; look at what is doubtful"
    lines = [f"{check.file}: {machine.title}: {verdict}"]
    for word, texts in (("WRONG", check.wrong), ("doubtful", check.doubtful), ("warning", condition_warnings(model))):
        lines += [f"  {word}: {text}" for text in texts]
    effects = ", ".join([*acting_names(model), *(active.effect.name for active in model.instruments)]) or "none"
    lines += [f"  effects: {effects}", f"  {symmetry_words(check.symmetry)}"]
    if check.neutral.reach.reachable[0]:
        lines.append(f"  {neutral_words(machine, check.neutral)}")
    if check.origin.reach.reachable[0]:
        kx, ky, kz = n_per_mm_from_n_per_m(check.origin.along_axes[0])
        lines.append(
            f"  at the default origin: {kx:.0f}, {ky:.0f}, {kz:.0f} N/mm along X, Y, Z; "
            f"{check.origin.reach.describe(0)}"
        )
    return "\n".join(lines)


def neutral_words(machine: Hexapod, report: PoseStiffness) -> str:
    """Stiffness at the neutral pose as one would say it."""
    x, y, z, *angles = (float(v) for v in machine.limits.neutral_pose)
    pose = " ".join(f"{axis}{mm_from_m(v) + 0.0:g}" for axis, v in zip("XYZ", (x, y, z), strict=True))
    turned = [f"{axis}{deg_from_rad(v) + 0.0:g}" for axis, v in zip("ABC", angles, strict=True) if v]
    kx, ky, kz = (n_per_mm_from_n_per_m(float(v)) for v in report.along_axes[0])
    along = (um_from_m(defaults.FORCE / float(k)) for k in report.along_axes[0])
    moved = ", ".join(f"{moved:.3g} um along {axis}" for axis, moved in zip("XYZ", along, strict=True))
    softest = n_per_um_from_n_per_m(float(report.softest_stiffness[0]))
    if softest < ROBOT:
        words = "as soft as a robot arm"
    elif softest <= MACHINING_CENTRE:
        words = "between a robot arm (1 N/um) and a machining centre (50 N/um)"
    elif softest <= BEYOND:
        words = "as stiff as a machining centre (50 N/um) or stiffer"
    else:
        words = "stiffer than any machine tool"
    return (
        f"at the neutral pose {' '.join([pose, *turned])}: {kx:.0f}, {ky:.0f}, {kz:.0f} N/mm along X, Y, Z; "
        f"{defaults.FORCE:g} N move the tool by {moved}; softest direction {softest:.3g} N/um, {words}"
    )


def symmetry_words(symmetry: Symmetry) -> str:
    """What holds for the joints that follow."""
    if not symmetry.kind:
        return "the joints follow neither a three-fold symmetry nor a mirror plane: nothing to hold one against"
    count = 12 - len(symmetry.strays)
    return f"{count} of 12 joints follow a {symmetry.kind} symmetry within {mm_from_m(symmetry.residual):.2g} mm"


@picture
def machine_views(check: MachineCheck) -> Figure:
    """PNG of the machine at its neutral pose, from above and from the side; joints that stray have a ring."""
    machine, marked = check.model.machine, [(stray.body, stray.joint) for stray in check.symmetry.strays]
    pose = np.array(machine.limits.neutral_pose)
    struts = solve_struts_at(machine, pose)
    joints = mm_from_m(pose[:3] + struts.arms[0])
    frame, tip = mm_from_m(machine.frame_joints), mm_from_m(pose[:3])
    with house_style():
        figure = new_figure(14.0, 7.4)
        for k, (first, second, title) in enumerate(((0, 1, "from above"), (0, 2, "from the side, along Y"))):
            axes = figure.add_axes((0.06 + 0.49 * k, 0.09, 0.42, 0.74))
            _draw_view(axes, frame, joints, tip, [first, second])
            for body, i in marked:
                place = (frame if body == "frame" else joints)[i]
                axes.plot(place[first], place[second], "o", ms=18, mfc="none", mec=TOOL, mew=2.0)
            axes.set_title(title, fontsize=11, color="#374151")
            axes.set_xlabel(f"{'XYZ'[first]} mm")
            axes.set_ylabel(f"{'XYZ'[second]} mm")
        heading(figure, machine, pose)
        if marked:
            words = "ring: does not follow the symmetry of the other joints"
            figure.text(0.98, 0.91, words, fontsize=11, color=TOOL, ha="right")
        return figure


def _draw_view(axes: Any, frame: FloatArray, joints: FloatArray, tip: FloatArray, seen: list[int]) -> None:
    for body, colour in ((frame, FRAME), (joints, PLATFORM)):
        beside = body[:, :2] - body[:, :2].mean(axis=0)
        order = np.argsort(np.arctan2(beside[:, 1], beside[:, 0]), kind="stable")
        axes.plot(*body[[*order, order[0]]][:, seen].T, color=colour, lw=1.6)
        axes.plot(*body[:, seen].T, "o", color=colour, ms=6)
    for i, (start, end) in enumerate(zip(frame[:, seen], joints[:, seen], strict=True)):
        axes.plot(*np.array([start, end]).T, color=STRUT, lw=1.8)
        # Struts of a vertex, and those behind each other, have their numbers at different places.
        place = start + (0.25 + 0.1 * i) * (end - start)
        axes.text(*place, f"{i + 1}", fontsize=10, weight="bold", color=STRUT, ha="center", va="center", bbox=LABEL)
    axes.plot(*tip[seen], "o", color=TOOL, ms=8)
    axes.annotate("tool tip", tip[seen], xytext=(8, -4), textcoords="offset points", fontsize=9, color=TOOL)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    axes.grid(True, color="#e5e7eb", lw=0.6)
