"""Which effect a machine of elements lacks, by pulls: displacements as vectors or along a dial, or stiffnesses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from toolpath_stiff.arrays import AnyArray, FloatArray
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.documents import Document
from toolpath_stiff.inference.element_fits import (
    PullProblem,
    chi_square,
    explanations,
    label_of,
    question,
    share_left,
    verdict_of,
)
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.left_out import held_out
from toolpath_stiff.readings.pulls import Pulls, read_pulls
from toolpath_stiff.results import FolderResult, frame_of
from toolpath_stiff.stiffness.contract import ELEMENT
from toolpath_stiff.stiffness.model import StiffnessModel, effects_stated
from toolpath_stiff.units import um_from_m

if TYPE_CHECKING:
    import pandas as pd

NRAD = 1e9  # nrad/(N m) of rad/(N m)
SHOWN = 12  # explanations in the document


@dataclass(frozen=True, repr=False, eq=False)
class ElementDiagnosis(FolderResult):
    """Verdict on what a machine of elements lacks, with its errors and its joints fitted alone.

    Attributes
    ----------
    problem
        Machine, pulls, prediction, and how readings scatter.
    verdict, plausible
        As of a hexapod: "adequate", "identified", "ambiguous", "unexplained"; the explanations that it leaves.
    ranked
        All explanations, each fitted alone, the likeliest first.
    """

    command: ClassVar[str] = "diagnose"
    shown_by: ClassVar[str] = "diagnose_elements"

    problem: PullProblem
    verdict: str
    plausible: list[Fit]
    ranked: list[Fit]
    inputs: tuple[str, ...] = ()

    @property
    def pulls(self) -> Pulls:
        """The readings."""
        return self.problem.pulls

    @property
    def labels(self) -> list[str]:
        """Of the plausible explanations, effect and element: "joint_torsion, joint 3"."""
        return [label_of(fit) for fit in self.plausible]

    @property
    def error_as_given(self) -> float:
        """Root mean square of measured less modelled, in per cent of that of what was measured."""
        return self.problem.error_percent(self.problem.observed)

    @cached_property
    def joints(self) -> Fit | None:
        """The torsions of all joints that turn fitted in place of the file's; None without such joints."""
        return self.problem.joints_fitted if self.problem.torsions else None

    @cached_property
    def left_out(self) -> FloatArray:
        """(m,) residuals at each pose of joints fitted to all others, of the size of each pull's displacement."""
        return self.problem.observed if self.joints is None else held_out(self.joints, self.problem.point).residual

    @property
    def torsions(self) -> Mapping[str, float]:
        """Joint -> rad/(N m) fitted."""
        return {} if self.joints is None else fitted_torsions(self.problem, self.joints)

    def to_dict(self) -> Document:
        """The content of diagnose.json."""
        problem = self.problem
        error = problem.error_percent(self.left_out) if self.joints else None
        return {
            "machine": problem.machine.name,
            **effects_stated(problem.model),
            "readings": len(self.pulls),
            "poses": int(self.pulls.pose.max()) + 1,
            "noise": problem.noise.origin,
            "outlying_rows": self.wild,
            "verdict": self.verdict,
            "question": question(problem),
            "plausible": self.labels,
            "findings": [finding for fit in self.plausible for finding in fit.findings],
            "chi_square_as_given": chi_square(problem.none),
            "error_as_given_percent": self.error_as_given,
            "explanations": [
                {
                    "effect": fit.names[-1],
                    "element": dict(fit.candidates[-1].choice).get(ELEMENT),
                    "chi_square": chi_square(fit),
                    "finding": fit.findings[-1],
                }
                for fit in self.ranked[:SHOWN]
            ],
            "joints_fitted_nrad_per_Nm": {name: NRAD * value for name, value in self.torsions.items()},
            "chi_square_of_joints_fitted": None if self.joints is None else chi_square(self.joints),
            "error_of_joints_fitted_at_left_out_poses_percent": error,
        }

    @property
    def wild(self) -> list[str]:
        """Readings that the likeliest explanation takes for wild: "FILE:LINE x"."""
        fit = (self.plausible or [self.problem.none])[0]
        pulls = self.pulls
        return [f"{pulls.file[i]}:{pulls.line[i]} {pulls.component[i]}" for i in sorted(fit.scatter.wild)]

    def to_frame(self) -> pd.DataFrame:
        """One row a reading, as in `residuals.csv`."""
        return frame_of(self.columns())

    def columns(self) -> dict[str, AnyArray]:
        """Column of `residuals.csv` -> values."""
        return residual_columns(self.problem, {"joints_fitted_left_out_um": self.left_out})

    def _short(self) -> str:
        return f"{self.problem.machine.name}, {self.verdict}, error as given {self.error_as_given:.1f} %"


def residual_columns(problem: PullProblem, further: Mapping[str, FloatArray]) -> dict[str, AnyArray]:
    """Columns of `residuals.csv`; `further`: what other fits say, as residuals (m,)."""
    pulls = problem.pulls
    return {
        "file": pulls.file, "line": pulls.line, "component": pulls.component, "pose": pulls.pose + 1,
        "measured_um": um_from_m(pulls.value), "modelled_um": um_from_m(problem.predicted),
        **{name: um_from_m(pulls.value - residual * pulls.size) for name, residual in further.items()},
        "sd_um": um_from_m(problem.noise.repeat * pulls.size),
    }  # fmt: skip


def fitted_torsions(problem: PullProblem, joints: Fit) -> dict[str, float]:
    """Joint -> rad/(N m) of joints fitted in place of the file's."""
    stated = problem.torsions.items()
    return {name: was + float(size[0]) for (name, (_, was)), size in zip(stated, joints.sizes, strict=True)}


def pull_problem(
    model: StiffnessModel,
    files: Sequence[str],
    mapping: Mapped = None,
    noise: float | None = None,
    spread: float = 0.0,
    effect_files: Sequence[str] = (),
) -> tuple[PullProblem, bool]:
    """Pulls with their scatter, and whether somebody states it: the rows, else a share of each pull's size.

    `noise` is the standard deviation of a displacement relative to the size of its pull's, `spread` that of the
    elements' compliances, relative. Where nobody states it, it is what all candidates together leave.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read, a row is no pull, or the machine cannot stand there.
    """
    problem = PullProblem(model, read_pulls(files, model.machine, mapping), effect_files)
    pulls = problem.pulls
    stated = ~np.isnan(pulls.sd)
    if noise is None and stated.all():
        problem.noise_of(pulls.sd / pulls.size, spread, "sd_um of each row")
    elif noise is not None:
        words = f"{100 * noise:g} % of the size of each displacement"
        words += ", sd_um where a row has it" if stated.any() else ""
        problem.noise_of(np.where(stated, pulls.sd / pulls.size, noise), spread, words)
    else:
        share = share_left(problem)
        words = f"estimated, {100 * share:.2g} % of the size of each displacement (say --noise)"
        problem.noise_of(np.full(len(pulls), share), spread, words)
    return problem, noise is not None or bool(stated.all())


def diagnose_elements(problem: PullProblem, known: bool) -> ElementDiagnosis:
    """The verdict on pulls; `known`: whether somebody states how they scatter."""
    ranked = explanations(problem, problem.none)
    verdict, plausible = verdict_of(problem, problem.none, ranked, known)
    return ElementDiagnosis(problem, verdict, plausible, ranked)
