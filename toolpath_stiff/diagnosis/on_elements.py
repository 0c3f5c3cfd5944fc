"""Diagnosis of machines of elements by pulls: displacements as vectors or along a dial, or stiffnesses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from toolpath_stiff.arrays import AnyArray, FloatArray
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.diagnosis.examination import fitted_sizes, held_errors, percent_of
from toolpath_stiff.documents import Document, json_number, to_dict
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.element_fits import (
    LEAST,
    PullProblem,
    chi_square,
    contradicted,
    estimate_noise,
    explanations,
    label_of,
    question,
    verdict_of,
)
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.left_out import held_out
from toolpath_stiff.inference.noise import GUESSES
from toolpath_stiff.readings.pulls import Pulls, read_pulls
from toolpath_stiff.results import FolderResult, frame_of
from toolpath_stiff.stiffness.model import StiffnessModel, effects_stated
from toolpath_stiff.stiffness.sizes import joined
from toolpath_stiff.units import deg_from_rad, um_from_m

if TYPE_CHECKING:
    import pandas as pd

NRAD = 1e9  # nrad/(N m) of rad/(N m)
FEWEST = 6  # readings below which nothing is fitted
SHOWN = 12  # explanations in the document
NAMED = 4  # causes in a sentence
FAR_OFF, SD_OF_MEDIAN = 8.0, 1.4826  # standard deviations; sd over median of absolute deviations (normal)
WORTHWHILE = 0.8  # share of the error as given below which refitted joints must bring it to be mentioned
NO_NAME = {
    "adequate": "nothing is missing that shows",
    "unexplained": "no effect of the catalogue by itself explains the readings",
}


@dataclass(frozen=True, repr=False, eq=False)
class ElementDiagnosis(FolderResult):
    """Verdict on what a machine of elements lacks, with its errors and the joints fitted alone.

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
        """Effect and element of each plausible explanation: "joint_torsion, joint 3"."""
        return [label_of(fit) for fit in self.plausible]

    @property
    def error_as_given(self) -> float:
        """Root mean square of measured less modelled, in per cent of that of the measured values."""
        return self.counted(self.problem.observed)

    @cached_property
    def joints(self) -> Fit | None:
        """Fit of the torsions of all turning joints in place of the file's; None without such joints."""
        return self.problem.joints_fitted if self.problem.torsions else None

    @cached_property
    def left_out(self) -> FloatArray:
        """(m,) residuals at each pose with joints fitted to all other poses, relative to each pull's displacement."""
        return self.problem.observed if self.joints is None else held_out(self.joints, self.problem.point).residual

    @property
    def torsions(self) -> Mapping[str, float]:
        """Joint -> fitted rad/(N m)."""
        return {} if self.joints is None else fitted_torsions(self.problem, self.joints)

    def to_dict(self) -> Document:
        """Content of diagnose.json: the keys of a hexapod's, and the joints fitted alone."""
        problem, fits = self.problem, self.ranked[:SHOWN]
        error = json_number(self.counted(self.left_out)) if self.joints else None
        return {
            "machine": problem.machine.name,
            **effects_stated(problem.model),
            "readings": len(self.pulls),
            "poses": int(self.pulls.pose.max()) + 1,
            "noise": {"name": problem.noise.name, "origin": problem.noise.origin},
            "outlying_rows": self.wild,
            "verdict": self.verdict,
            "text": self.sentence,
            "question": question(problem),
            "baseline": {"noise_floor_percent": problem.noise.floor_percent, "as_given": errors_of(problem.none, self)},
            "plausible": self.labels,
            "entries": [list(dict.fromkeys(fit.names[-1] for fit in self.plausible))],
            "best": self.plausible[0].names[-1] if self.verdict == "identified" else None,
            "findings": [finding for fit in self.plausible for finding in fit.findings],
            "chi_square_as_given": chi_square(problem.none),
            "error_as_given_percent": self.error_as_given,
            "candidates": [
                {
                    "effect": fit.names[-1],
                    "title": fit.candidates[-1].effect.title,
                    "link": fit.candidates[-1].effect.link,
                    "choice": dict(fit.candidates[-1].choice),
                    "parameters": to_dict(fitted_sizes(fit)[fit.names[-1]]),
                    "probability": None,
                    **errors_of(fit, self),
                    "chi_square": chi_square(fit),
                    "finding": fit.findings[-1],
                }
                for fit in fits
            ],
            "joints_fitted_nrad_per_Nm": {name: NRAD * value for name, value in self.torsions.items()},
            "chi_square_of_joints_fitted": None if self.joints is None else chi_square(self.joints),
            "error_of_joints_fitted_at_left_out_poses_percent": error,
            "gates": dict.fromkeys(f"{name}_probability" for name in ("baseline", "squares", "structure", "gain")),
            **{key: [] for key in ("why", "warnings", "bounds", "next_measurements")},
            "assumptions": [f"noise: {problem.noise.origin}"],
            "components": self.components,
            "notes": list(self.pulls.notes),
        }

    @property
    def sentence(self) -> str:
        """Sentences on verdict, cause, error, and the next step."""
        causes, problem = [finding for fit in self.plausible for finding in fit.findings], self.problem
        more = [f"{len(causes) - NAMED} more"] if len(causes) > NAMED else []
        told = NO_NAME.get(self.verdict) or joined([*causes[:NAMED], *more])
        text = f"{self.verdict.capitalize()}: {told}. Error as given {self.error_as_given:.1f} %"
        text += " of the displacements (rms)"
        if self.verdict == "adequate" and problem.typical > GUESSES["low"] and problem.together:
            return f"{text}, all of which counts as scatter, since nobody says how pulls scatter (--noise, sd_um)."
        if self.verdict == "ambiguous" and len(self.plausible) == 1 and problem.together:
            text += ". Nobody says how pulls scatter (--noise, sd_um), without which it stands for no certain name"
        left = self.counted(self.left_out)
        if self.verdict == "identified" or question(problem) or not left < WORTHWHILE * self.error_as_given:
            return f"{text}."
        return (
            f"{text}; the torsions of all joints refitted leave {left:.1f} % at left-out poses (tps update --joints)."
        )

    @cached_property
    def components(self) -> list[Document]:
        """For each component read: rms of readings and of the error as given, and its mean error; um."""
        pulls, error = self.pulls, um_from_m(self.problem.predicted - self.pulls.value)
        chosen = {str(name): pulls.component == name for name in np.unique(pulls.component)}
        return [
            {
                "component": name,
                "measured_rms_um": float(np.sqrt(np.mean(um_from_m(pulls.value[rows]) ** 2))),
                "error_rms_um": float(np.sqrt(np.mean(error[rows] ** 2))),
                "error_mean_um": float(error[rows].mean()),
            }
            for name, rows in chosen.items()
        ]

    def vectors(self) -> dict[str, AnyArray]:
        """Column of `vectors.csv` -> values, for each pull read in three directions: displacement and error."""
        pulls = self.pulls
        first = np.unique(pulls.pull, return_index=True)[1]
        whole = np.bincount(pulls.pull) == len("xyz")
        moved, error = (um_from_m(pulls.vectors(v)[whole]) for v in (pulls.value, self.problem.predicted - pulls.value))
        lengths = [np.linalg.norm(v, axis=1) for v in (moved, moved + error)]
        cosine = (moved * (moved + error)).sum(axis=1) / np.maximum(np.multiply(*lengths), 1e-300)
        columns: dict[str, AnyArray] = {"file": pulls.file[first][whole], "line": pulls.line[first][whole]}
        columns |= {f"u{axis}_um": moved[:, i] for i, axis in enumerate("xyz")}
        columns |= {f"error_{axis}_um": error[:, i] for i, axis in enumerate("xyz")}
        columns["error_percent"] = 100.0 * np.linalg.norm(error, axis=1) / lengths[0]
        return columns | {"angle_deg": deg_from_rad(np.arccos(np.clip(cosine, -1.0, 1.0)))}

    @cached_property
    def wild_rows(self) -> list[int]:
        """Readings that the likeliest explanation takes to be wild; without one, those far off the refitted joints."""
        if self.verdict != "unexplained":
            return sorted((self.plausible or [self.problem.none])[0].scatter.wild)
        pulls, error = self.pulls, (self.joints or self.problem.none).residual * self.pulls.size
        left, moved = (np.bincount(pulls.pull, part**2)[pulls.pull] for part in (error, pulls.value - error))
        off = np.sqrt(left / np.maximum(moved, pulls.least**2))
        return np.flatnonzero(off > FAR_OFF * SD_OF_MEDIAN * np.median(off)).tolist()

    @property
    def wild(self) -> list[str]:
        """Wild readings as "FILE:LINE x"."""
        pulls = self.pulls
        return [f"{pulls.file[i]}:{pulls.line[i]} {pulls.component[i]}" for i in self.wild_rows]

    def counted(self, residual: FloatArray) -> float:
        """Error of (m,) residuals over the readings that are not wild, per cent."""
        return self.problem.error_percent(residual, self.wild_rows)

    def to_frame(self) -> pd.DataFrame:
        """One row per reading, as in `residuals.csv`."""
        return frame_of(self.columns())

    def columns(self) -> dict[str, AnyArray]:
        """Column of `residuals.csv` -> values."""
        return residual_columns(self.problem, {"joints_fitted_left_out_um": self.left_out})

    def _short(self) -> str:
        return f"{self.problem.machine.name}, {self.verdict}, error as given {self.error_as_given:.1f} %"


def errors_of(fit: Fit, diagnosis: ElementDiagnosis) -> Document:
    """Errors of a fit relative to each displacement, per cent, overall and at left-out poses."""
    held = held_out(fit, diagnosis.problem.point)
    return {"mean_abs_error_percent": percent_of(float(fit.errors.mean())), **held_errors(held)}


def residual_columns(problem: PullProblem, further: Mapping[str, FloatArray]) -> dict[str, AnyArray]:
    """Columns of `residuals.csv`; `further`: residuals (m,) of other fits."""
    pulls = problem.pulls
    return {
        "file": pulls.file, "line": pulls.line, "component": pulls.component, "pose": pulls.pose + 1,
        "measured_um": um_from_m(pulls.value), "modelled_um": um_from_m(problem.predicted),
        **{name: um_from_m(pulls.value - residual * pulls.size) for name, residual in further.items()},
        "sd_um": um_from_m(problem.noise.repeat * pulls.size),
    }  # fmt: skip


def fitted_torsions(problem: PullProblem, joints: Fit) -> dict[str, float]:
    """Joint -> rad/(N m) of joints fitted in place of the file's, the first parameters of the fit."""
    stated = problem.torsions.items()
    return {name: was + float(size[0]) for (name, (_, was)), size in zip(stated, joints.sizes, strict=False)}


def pull_problem(
    model: StiffnessModel,
    files: Sequence[str],
    mapping: Mapped = None,
    noise: float | None = None,
    spread: float = 0.0,
    effect_files: Sequence[str] = (),
) -> tuple[PullProblem, bool]:
    """Pulls with their scatter, and True if it is known: stated in rows or as a share of the displacement, or repeats.

    `noise` is the standard deviation of a displacement relative to the size of its pull's, `spread` that of the
    elements' compliances, relative. Repeats that scatter by more than is stated overrule it. Where neither tells, it is
    what all candidates together leave.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read, a row is no pull, or the machine cannot stand there.
    """
    problem = PullProblem(model, read_pulls(files, model.machine, mapping), effect_files)
    pulls = problem.pulls
    if len(pulls) < FEWEST:
        raise InputError(f"{len(pulls)} readings", expected=f"at least {FEWEST} components of displacements")
    stated = ~np.isnan(pulls.sd)
    if noise is None and stated.all():
        problem.noise_of(pulls.sd / pulls.size, spread, "sd_um of each row")
    elif noise is not None:
        words = f"{100 * noise:g} % of the size of each displacement"
        words += ", sd_um where a row has it" if stated.any() else ""
        problem.noise_of(np.where(stated, pulls.sd / pulls.size, noise), spread, words)
    else:
        problem.noise_of(np.full(len(pulls), LEAST), spread)
    said = noise is not None or bool(stated.all())
    if not said or contradicted(problem):
        estimate_noise(problem)
    return problem, said or not problem.together


def diagnose_elements(problem: PullProblem, known: bool) -> ElementDiagnosis:
    """Verdict on pulls; `known`: their scatter is known."""
    ranked = explanations(problem, problem.none)
    verdict, plausible = verdict_of(problem, problem.none, ranked, known)
    return ElementDiagnosis(problem, verdict, plausible, ranked)
