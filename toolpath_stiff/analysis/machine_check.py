"""Whether a machine file is plausible: its struts, its neutral pose, each joint against the symmetry of the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.poses import PoseReport, evaluate_poses
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.machine.symmetry import Symmetry, describe_stray, find_symmetry
from toolpath_stiff.machine.writer import TEMPLATE_REMARK
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import Pose, deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

FloatArray = NDArray[np.float64]

# N/um of a strut: screws, bearings and joints in series. Below, it is no machine's; above, no screw's.
STRUT_SOFTEST, STRUT_STIFFEST = 1.0, 1000.0
# N/um at the tool: "usually less than 1" for articulated robots, "very often greater than 50" for machining centres
# (Pan, Zhang, Zhu, Wang 2006, J. Mater. Process. Technol. 173, 301).
ROBOT, MACHINING_CENTRE, BEYOND = 1.0, 50.0, 1000.0
LOAD = 1000.0  # N, for the deflection in words


@dataclass(frozen=True)
class MachineCheck:
    """What was found.

    Attributes
    ----------
    wrong
        What cannot be right, in words.
    doubtful
        What may be meant but should be looked at.
    neutral, origin
        Stiffness and reach at the neutral pose and at the default origin.
    symmetry
        Of the joints.
    """

    wrong: tuple[str, ...]
    doubtful: tuple[str, ...]
    neutral: PoseReport
    origin: PoseReport
    symmetry: Symmetry

    @property
    def good(self) -> bool:
        """Whether nothing is wrong."""
        return not self.wrong


def check_machine(model: StiffnessModel) -> MachineCheck:
    """Check the machine of a model.

    Raises
    ------
    InputError, EffectFault
        Its effects give no stiffness at the neutral pose or the default origin.
    """
    machine = model.given or model.machine
    neutral, origin = (_at(model, pose) for pose in (machine.limits.neutral_pose, machine.default_origin))
    symmetry = find_symmetry(machine)
    wrong = [*_struts(machine)]
    for name, report in (("neutral pose", neutral), ("default origin", origin)):
        if not report.reach.reachable[0]:
            wrong.append(f"the {name} is out of reach: {report.reach.describe(0)}")
    doubtful = [describe_stray(stray, symmetry.kind) for stray in symmetry.strays]
    if neutral.reach.reachable[0]:
        doubtful += _stiffness(neutral)
    if neutral.extrapolated[0]:
        lengths = ", ".join(f"{mm_from_m(float(v)):.0f}" for v in neutral.strut_lengths[0])
        doubtful.append(f"at the neutral pose the struts ({lengths} mm) lie outside the lengths of [strut_law]")
    same = [section for section, remark in machine.remarks.items() if remark == TEMPLATE_REMARK]
    if same:
        doubtful.append(f"still the template's: {', '.join(f'[{section}]' for section in same)}")
    return MachineCheck(tuple(wrong), tuple(doubtful), neutral, origin, symmetry)


def _at(model: StiffnessModel, pose: Pose) -> PoseReport:
    values = np.array([pose])
    return evaluate_poses(model, values[:, :3], values[:, 3:])


def _struts(machine: Machine) -> Iterator[str]:
    """Stiffnesses of a strut that no strut has, at the lengths that the file gives and at the ends of the travel."""
    law = machine.strut_law
    given = [(law.length_1, law.stiffness_1), (law.length_2, law.stiffness_2)]
    ends = [length for length in machine.limits.strut_length if np.isfinite(length)]
    found = [*_implausible("[strut_law]", given)]
    if not found:
        found += _implausible(
            "the strut law at an end of the travel", [(x, float(law.stiffness(np.array(x)))) for x in ends]
        )
    yield from found


def _implausible(where: str, struts: list[tuple[float, float]]) -> Iterator[str]:
    for length, stiffness in struts:
        value = stiffness / 1e6
        if STRUT_SOFTEST <= value <= STRUT_STIFFEST:
            continue
        per, other = ("N/mm", value / 1e3) if value > STRUT_STIFFEST else ("kN/um", value * 1e3)
        meant = f"; if it is in {per}, it is {other:g} N/um" if STRUT_SOFTEST <= other <= STRUT_STIFFEST else ""
        yield (
            f"{where}: a strut of {mm_from_m(length):g} mm with {value:g} N/um; "
            f"expected {STRUT_SOFTEST:g} to {STRUT_STIFFEST:g} N/um{meant}"
        )


def _stiffness(report: PoseReport) -> list[str]:
    softest = float(report.softest_stiffness[0]) / 1e6
    if ROBOT <= softest <= BEYOND:
        return []
    beside = "less than a robot arm has" if softest < ROBOT else "more than any machine tool has"
    return [f"at the neutral pose the softest direction has {softest:.3g} N/um at the tool, {beside}"]


def neutral_words(machine: Machine, report: PoseReport) -> str:
    """Stiffness at the neutral pose as one would say it."""
    x, y, z, *angles = (float(v) for v in machine.limits.neutral_pose)
    pose = " ".join(f"{axis}{mm_from_m(v) + 0.0:g}" for axis, v in zip("XYZ", (x, y, z), strict=True))
    turned = [f"{axis}{deg_from_rad(v) + 0.0:g}" for axis, v in zip("ABC", angles, strict=True) if v]
    kx, ky, kz = (n_per_mm_from_n_per_m(float(v)) for v in report.along_axes[0])
    moved = ", ".join(f"{1e3 * LOAD / k:.3g} um along {axis}" for axis, k in zip("XYZ", (kx, ky, kz), strict=True))
    softest = float(report.softest_stiffness[0]) / 1e6
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
        f"{LOAD:g} N move the tool by {moved}; softest direction {softest:.3g} N/um, {words}"
    )


def symmetry_words(symmetry: Symmetry) -> str:
    """What holds for the joints that follow."""
    if not symmetry.kind:
        return "the joints follow neither a three-fold symmetry nor a mirror plane: nothing to hold one against"
    count = 12 - len(symmetry.strays)
    return f"{count} of 12 joints follow a {symmetry.kind} symmetry within {mm_from_m(symmetry.residual):.2g} mm"
