"""Plausibility of a machine file: struts, neutral pose, joints."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from toolpath_stiff.analysis.poses import PoseStiffness, evaluate_poses
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.machine.writer import TEMPLATE_REMARK
from toolpath_stiff.results import DataFrame, Result, frame_of
from toolpath_stiff.stiffness.model import StiffnessModel, condition_warnings, effects_stated
from toolpath_stiff.units import mm_from_m, n_per_um_from_n_per_m

# N/um of a strut: screws, bearings and joints in series. Below, it is no machine tool; above, no screw.
STRUT_SOFTEST, STRUT_STIFFEST = 1.0, 1000.0
SOFTEST_ARM = 0.05  # N/um at the tool of a stretched arm; assumed
ODD_STRUT, MOST_ODD = 0.005, 2  # share of the usual length within which an odd strut has no other; most odd struts
# N/um at the tool: "usually less than 1" for articulated robots, "very often greater than 50" for machining centres
# (Pan, Zhang, Zhu, Wang 2006, J. Mater. Process. Technol. 173, 301).
ROBOT, MACHINING_CENTRE, BEYOND = 1.0, 50.0, 1000.0


@dataclass(frozen=True, repr=False, eq=False)
class MachineCheck(Result):
    """Result of a plausibility check of a machine file.

    Attributes
    ----------
    file, model
        The machine's name or file; the machine with its effects.
    wrong
        What cannot be right, in words.
    doubtful
        What may be meant but should be looked at.
    neutral, origin
        Stiffness and reach at the neutral pose and at the default origin.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.Machine.load("nist").check()
    >>> found.good, found.to_dict()["wrong"], found.warnings, len(found.to_frame())
    (True, [], [], 0)
    >>> found.file
    'nist'
    >>> type(found.plot()).__name__
    'Figure'
    """

    command: ClassVar[str] = "machine"
    shown_by: ClassVar[str] = "machine_check"

    file: str
    model: StiffnessModel
    wrong: list[str]
    doubtful: list[str]
    neutral: PoseStiffness
    origin: PoseStiffness

    @property
    def good(self) -> bool:
        """True if nothing is wrong."""
        return not self.wrong

    @property
    def warnings(self) -> list[str]:
        """Effects that do not act on a program as the file stands."""
        return condition_warnings(self.model)

    def to_dict(self) -> Document:
        """JSON document of the command."""
        return {
            "file": self.file,
            "machine": self.model.machine.name,
            "good": self.good,
            "wrong": self.wrong,
            "doubtful": self.doubtful,
            **effects_stated(self.model),
            "warnings": self.warnings,
        }

    def to_frame(self) -> DataFrame:
        """One row per finding: severity (wrong, doubtful, warning), text."""
        kinds = (("wrong", self.wrong), ("doubtful", self.doubtful), ("warning", self.warnings))
        rows = [(severity, text) for severity, texts in kinds for text in texts]
        return frame_of(rows, columns=["severity", "text"])

    def picture(self) -> bytes:
        """Drawing of the machine as PNG."""
        return self._picture()

    def _short(self) -> str:
        return f"{self.model.machine.name}, {len(self.wrong)} wrong, {len(self.doubtful)} doubtful"


def check_machine(model: StiffnessModel, file: str = "") -> MachineCheck:
    """Check the machine of a model.

    Raises
    ------
    InputError, EffectFault
        Its effects give no stiffness at the neutral pose or the default origin.
    """
    machine = model.given or model.machine
    neutral, origin = (
        evaluate_poses(model, np.array([pose[:3]]), np.array([pose[3:]]))
        for pose in (machine.limits.neutral_pose, machine.default_origin)
    )
    wrong = _struts(machine) if isinstance(machine, Hexapod) else []
    for name, report in (("neutral pose", neutral), ("default origin", origin)):
        if not report.reach.reachable[0]:
            wrong.append(f"the {name} is out of reach: {report.reach.describe(0)}")
    doubtful = _odd_struts(neutral.joints[0]) if isinstance(machine, Hexapod) else []
    if neutral.reach.reachable[0]:
        softest = n_per_um_from_n_per_m(float(neutral.softest_stiffness[0]))
        if not (ROBOT if isinstance(machine, Hexapod) else SOFTEST_ARM) <= softest <= BEYOND:
            beside = "less than a robot arm has" if softest < ROBOT else "more than any machine tool has"
            doubtful.append(f"at the neutral pose the softest direction has {softest:.3g} N/um at the tool, {beside}")
    if neutral.extrapolated[0]:
        lengths = ", ".join(f"{mm_from_m(float(v)):.0f}" for v in neutral.joints[0])
        doubtful.append(f"at the neutral pose the struts ({lengths} mm) lie outside the lengths of [strut_law]")
    same = [section for section, remark in machine.remarks.items() if remark == TEMPLATE_REMARK]
    if same:
        sections = ", ".join(f"[{section}]" for section in same)
        doubtful.append(f"the remark of {sections} still says {TEMPLATE_REMARK!r}: say where its figures are from")
    return MachineCheck(file, model, wrong, doubtful, neutral, origin)


def _struts(machine: Hexapod) -> list[str]:
    """Findings on implausible strut stiffnesses, at the lengths in the file or else at the ends of the travel."""
    law = machine.strut_law
    ends = [(x, float(law.stiffness(np.array(x)))) for x in machine.limits.strut_length if np.isfinite(x)]
    return _implausible("[strut_law]", law.points) or _implausible("the strut law at an end of the travel", ends)


def _implausible(where: str, struts: list[tuple[float, float]]) -> list[str]:
    values = [(mm_from_m(length), n_per_um_from_n_per_m(stiffness)) for length, stiffness in struts]
    return [
        f"{where}: a strut of {length:g} mm with {value:g} N/um; expected {STRUT_SOFTEST:g} to {STRUT_STIFFEST:g} "
        f"N/um; is it in {'N/mm' if value > STRUT_STIFFEST else 'kN/um'}?"
        for length, value in values
        if not STRUT_SOFTEST <= value <= STRUT_STIFFEST
    ]


def _odd_struts(lengths: FloatArray) -> list[str]:
    """Struts whose length (m) no other one is close to: machines have few lengths, shared by three or six struts."""
    apart = np.abs(lengths[:, None] - lengths) + np.diag(np.full(len(lengths), np.inf))
    usual = float(np.median(lengths))
    odd = np.flatnonzero(apart.min(axis=1) > ODD_STRUT * usual)
    return [
        f"strut {i + 1} is {mm_from_m(float(lengths[i])):.0f} mm long at the neutral pose, most are about "
        f"{mm_from_m(usual):.0f} mm: is a sign of one of its joints flipped, or are two numbers exchanged?"
        for i in (odd if len(odd) <= MOST_ODD else [])
    ]
