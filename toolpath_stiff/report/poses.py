"""Text on the stiffness at a pose."""

from toolpath_stiff.analysis.evaluation import joint_columns
from toolpath_stiff.analysis.poses import POSE_COLUMNS, PoseStiffness
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.report.words import machine_text
from toolpath_stiff.stiffness.model import condition_warnings, effects_stated
from toolpath_stiff.units import mm_from_m, nm_from_m


def text(poses: PoseStiffness) -> str:
    """Text on a single pose: stiffnesses, joints, the nearest limit."""
    model, values = poses.model, {name: column[0] for name, column in poses.columns.items()}
    x, y, z, a, b, c = (values[name] for name in POSE_COLUMNS)
    named = machine_text({"machine": model.machine.title, **effects_stated(model)})
    lines = [f"{named}\ntool tip X{x:g} Y{y:g} Z{z:g} mm, A{a:g} B{b:g} C{c:g} deg\n"]
    for axis in "xyz":
        lines.append(f"  stiffness along {axis.upper()}   {values[f'k{axis}_N_per_mm']:10.0f} N/mm")
    for which in ("softest", "stiffest"):
        dx, dy, dz = (values[f"{which}_d{axis}"] + 0.0 for axis in "xyz")
        lines.append(
            f"  {which:<10} direction{values[f'{which}_N_per_mm']:10.0f} N/mm along ({dx:.3f}, {dy:.3f}, {dz:.3f})"
        )
    for axis, row in zip("XYZ", nm_from_m(poses.tip_compliance[0]), strict=True):
        figures = "".join(f"{value:10.3f}" for value in row)
        lines.append(f"  motion along {axis}    {figures} nm/N by a load along X, Y, Z")
    if isinstance(model.machine, Hexapod):
        lines.append(f"  struts 1 to 6        {'  '.join(f'{v:.3f}' for v in mm_from_m(poses.joints[0]))} mm")
    else:
        joints = zip(model.machine.joint_names, joint_columns(model.machine, poses.joints).items(), strict=True)
        words = [f"{name} {column[0]:.3f} {unit.rpartition('_')[2]}" for name, (unit, column) in joints]
        lines.append(f"  joints               {', '.join(words)}")
    lines.append(f"  nearest limit        {poses.reach.describe(0)} (margin {values['margin']:.3f} of its span)")
    if values["extrapolated"]:
        lines.append("  the strut law is extrapolated at this pose")
    for warning in condition_warnings(model):
        lines.append(f"  warning              {warning}")
    return "\n".join(lines)
