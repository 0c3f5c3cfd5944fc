"""Text of a check of a machine file."""

from toolpath_stiff import defaults
from toolpath_stiff.analysis.machine_check import BEYOND, MACHINING_CENTRE, ROBOT, MachineCheck
from toolpath_stiff.analysis.poses import PoseStiffness
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.poses import pose_in_mm
from toolpath_stiff.report.words import counted
from toolpath_stiff.stiffness.model import acting_names, condition_warnings
from toolpath_stiff.units import n_per_mm_from_n_per_m, n_per_um_from_n_per_m, um_from_m


def text(check: MachineCheck) -> str:
    """Text on what is wrong or doubtful in a machine file, which effects act, how stiff it is."""
    model, machine = check.model, check.model.machine
    verdict = "the file is good" if check.good else f"{counted(len(check.wrong), 'thing')} cannot be right"
    if check.good and check.doubtful:
        verdict = "the file can be used; look at what is doubtful"
    lines = [f"{check.file}: {machine.title}: {verdict}"]
    for word, texts in (("WRONG", check.wrong), ("doubtful", check.doubtful), ("warning", condition_warnings(model))):
        lines += [f"  {word}: {text}" for text in texts]
    effects = ", ".join([*acting_names(model), *(active.effect.name for active in model.instruments)]) or "none"
    lines.append(f"  effects: {effects}")
    if check.neutral.reach.reachable[0]:
        lines.append(f"  {neutral_words(machine, check.neutral)}")
    if check.origin.reach.reachable[0]:
        kx, ky, kz = n_per_mm_from_n_per_m(check.origin.along_axes[0])
        lines.append(
            f"  at the default origin: {kx:.0f}, {ky:.0f}, {kz:.0f} N/mm along X, Y, Z; "
            f"{check.origin.reach.describe(0)}"
        )
    return "\n".join(lines)


def neutral_words(machine: MachineTool, report: PoseStiffness) -> str:
    """Stiffness at the neutral pose, in words."""
    neutral = pose_in_mm(machine.limits.neutral_pose)
    pose = [f"{axis}{value + 0.0:g}" for axis, value in zip("XYZABC", neutral, strict=True)][
        : 6 if any(neutral[3:]) else 3
    ]
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
        f"at the neutral pose {' '.join(pose)}: {kx:.0f}, {ky:.0f}, {kz:.0f} N/mm along X, Y, Z; "
        f"{defaults.FORCE:g} N move the tool by {moved}; softest direction {softest:.3g} N/um, {words}"
    )
