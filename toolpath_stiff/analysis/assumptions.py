"""Assumptions of an analysis and values it recovered: the sentences of `summary.json`."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.analysis.statistics import EvaluatedPath
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.poses import pose_in_mm
from toolpath_stiff.stiffness.model import acting_effects, conditions_stated
from toolpath_stiff.units import deg_from_rad, mm_from_m, mm_per_min_from_m_per_s


def assumptions_of(analysis: EvaluatedPath, turned: str = "") -> list[str]:
    """Everything assumed or recovered rather than published or given; `turned`: how the tool was turned."""
    machine, model = analysis.machine, analysis.model
    sentences = list(analysis.program.assumptions)
    if words_turn_the_platform(analysis.program) and isinstance(machine, Hexapod):
        sentences.append(
            "A, B, C of the program are roll, pitch, yaw of the platform (see [kinematics] of controller files)"
        )
    if analysis.origin_source == "default":
        sentences.append(
            f"program zero (G54) sits at {pose_words(analysis.origin, 'g')} in machine coordinates, the machine's "
            f"default; --origin puts it elsewhere"
        )
    for quantity, origin in machine.origins.items():
        if origin != "published":
            remark = machine.remarks.get(quantity)
            sentences.append(f"machine {machine.name}: {quantity} {origin}" + (f": {remark}" if remark else ""))
    secant = "; the stiffness is the secant one at this load" if model.load_dependent else ""
    sentences += [
        f"rapid moves take {mm_per_min_from_m_per_s(machine.rapid_feed):g} mm/min (time only)",
        *conditions_stated(model),
        f"a force of {analysis.force:g} N for deflections{secant}: these are along the load, under an assumed force, "
        "not an error of the surface (--cut computes that)",
    ]
    if isinstance(machine, Hexapod):
        law = machine.strut_law
        low, high = sorted((mm_from_m(law.length_1), mm_from_m(law.length_2)))
        range_of_law = f"the strut law is extrapolated outside {low:.1f} to {high:.1f} mm of strut length"
        sentences.append("the stiffness of a strut is the same at every length" if law.constant else range_of_law)
    else:
        sentences += _of_elements(analysis, turned)
    if analysis.parameter_band is not None:
        whole = ", of struts, joints and what the model lacks, as `[uncertainty.errors]` of the machine file has them"
        beside = whole if analysis.parameter_band.form.any() else " alone"
        sentences.append(
            f"the band of the stiffness holds the uncertainty of the fitted parameters{beside}, propagated linearly: "
            f"{', '.join(analysis.parameter_band.names)}"
        )
    errors = machine.uncertainty.errors if machine.uncertainty is not None else None
    if errors is not None and (by_load := errors.of_load(analysis.force)):
        sentences.append(
            f"machine {machine.name} was read under {errors.load:g} N alone; what made it softer may hang on the load: "
            f"{100 * by_load:.2g} % (sd) of the stiffness under {analysis.force:g} N, in the band; read it there, too"
        )
    if not acting_effects(model) and isinstance(machine, Hexapod):
        sentences.append("platform, frame, joints, spindle, tool and table are rigid: the struts alone give way")
    return sentences


def _of_elements(analysis: EvaluatedPath, turned: str) -> list[str]:
    """Assumptions about a machine of elements on a path."""
    machine = analysis.machine
    names = ", ".join(dict.fromkeys(element.name for element in machine.elements))
    sentences = [f"what gives way is {names}; everything else is rigid"]
    if analysis.at.configuration:
        sentences.append(f"the configuration of the joints is kept over the program: {analysis.at.configuration}")
    for name, value in machine.standing_joints.items():
        linear = machine.joint_kinds[machine.joint_names.index(name)] == "linear"
        where = f"{mm_from_m(value):g} mm (stands_mm)" if linear else f"{deg_from_rad(value):g} deg (stands_deg)"
        sentences.append(f"{name} stands at {where}")
    if turned:
        sentences.append(turned)
    elif len(machine.joint_names) > 5:
        sentences.append("the tool's turn about its own axis is as programmed (C; 0 unless said) and not chosen")
    if np.isnan(machine.reference_tool_length) and not np.isnan(analysis.samples.tool_length).all():
        sentences.append("tools of the program are as long as the machine file's tool, which states no length")
    return sentences


def words_turn_the_platform(program: ReadProgram) -> bool:
    """True if rotary words were taken to be the platform's own angles."""
    return program.native and bool(program.moves.start[:, 3:].any() or program.moves.end[:, 3:].any())


def pose_words(pose: Sequence[float], digits: str) -> str:
    """A pose as a control shows it, with angles only if there are any."""
    words = [f"{axis}{value:{digits}}" for axis, value in zip("XYZABC", pose_in_mm(pose), strict=True)]
    return " ".join(words if any(pose[3:]) else words[:3])
