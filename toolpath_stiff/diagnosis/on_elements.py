"""Which effect a machine of elements lacks, by pulls: displacements as vectors or along a dial, or stiffnesses."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from toolpath_stiff.arrays import AnyArray, FloatArray
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.documents import Document
from toolpath_stiff.inference.element_fits import (
    Explanation,
    PullModel,
    explanations,
    left_out,
    non_negative,
    verdict_of,
    whitening,
)
from toolpath_stiff.readings.pulls import Pulls, read_pulls
from toolpath_stiff.results import FolderResult, frame_of
from toolpath_stiff.stiffness.catalogue import effects_of_elements
from toolpath_stiff.stiffness.model import StiffnessModel, effects_stated
from toolpath_stiff.units import um_from_m

if TYPE_CHECKING:
    import pandas as pd

NRAD = 1e9  # nrad/(N m) of rad/(N m)
TORSION = re.compile(r"(?m)^(torsion_nrad_per_Nm\s*=\s*)\[[^\]]*\]")
SHOWN = 12  # explanations in the document


@dataclass(frozen=True, repr=False, eq=False)
class ElementDiagnosis(FolderResult):
    """Verdict on what a machine of elements lacks, with its errors and its joints fitted alone.

    Attributes
    ----------
    model, sd
        Machine, pulls and prediction; (m,) m, standard deviations of the readings.
    noise
        Where these come from.
    verdict, plausible
        As of a hexapod: "adequate", "identified", "ambiguous", "unexplained"; the explanations that it leaves.
    ranked
        All explanations, each fitted alone, the likeliest first.
    joints, torsion, chi_square_fitted
        Names of the joints that turn, (j,) rad/(N m) fitted in place of the file's, and the misfit that these leave.
    left_out
        (m,) m, by joints fitted without the readings of the same pose.
    """

    command: ClassVar[str] = "diagnose"
    shown_by: ClassVar[str] = "diagnose_elements"

    model: PullModel
    sd: FloatArray
    noise: str
    chi_square: float
    verdict: str
    plausible: list[Explanation]
    ranked: list[Explanation]
    joints: list[str]
    torsion: FloatArray
    chi_square_fitted: float
    left_out: FloatArray
    inputs: tuple[str, ...] = ()

    @property
    def pulls(self) -> Pulls:
        """The readings."""
        return self.model.pulls

    def error_percent(self, modelled: FloatArray) -> float:
        """Root mean square of what is read less what is modelled, of that of what is read, all components together."""
        value = self.pulls.value
        return float(100.0 * np.sqrt(((value - modelled) ** 2).sum() / (value**2).sum()))

    @property
    def fitted_text(self) -> str:
        """The machine file with the fitted torsions; "" where the file does not list them or they predict no better."""
        better = self.error_percent(self.left_out) < self.error_percent(self.model.predicted)
        text = self.model.machine.text
        if not better or len(TORSION.findall(text)) != 1 or not len(self.torsion):
            return ""
        return TORSION.sub(rf"\g<1>[{', '.join(f'{NRAD * c:.4g}' for c in self.torsion)}]", text)

    def to_dict(self) -> Document:
        """The content of diagnose.json."""
        ends = zip(self.joints, (NRAD * self.torsion).tolist(), strict=True)
        error = self.error_percent(self.left_out) if self.joints else None
        return {
            "machine": self.model.machine.name,
            **effects_stated(self.model.model),
            "readings": len(self.pulls),
            "poses": int(self.pulls.pose.max()) + 1,
            "noise": self.noise,
            "verdict": self.verdict,
            "plausible": [row.label for row in self.plausible],
            "findings": [self.words(row) for row in self.plausible],
            "chi_square_as_given": self.chi_square,
            "error_as_given_percent": self.error_percent(self.model.predicted),
            "explanations": [
                {
                    "effect": row.effect,
                    "element": row.element or None,
                    "chi_square": row.chi_square,
                    "finding": self.words(row),
                }
                for row in self.ranked[:SHOWN]
            ],
            "joints_fitted_nrad_per_Nm": dict(ends),
            "chi_square_of_joints_fitted": self.chi_square_fitted if self.joints else None,
            "error_of_joints_fitted_at_left_out_poses_percent": error,
        }

    def to_frame(self) -> pd.DataFrame:
        """One row a reading, as in `residuals.csv`."""
        return frame_of(self.columns())

    def columns(self) -> dict[str, AnyArray]:
        """Column of `residuals.csv` -> values."""
        pulls = self.pulls
        return {
            "file": pulls.file, "line": pulls.line, "component": pulls.component, "pose": pulls.pose + 1,
            "measured_um": um_from_m(pulls.value), "modelled_um": um_from_m(self.model.predicted),
            "joints_fitted_left_out_um": um_from_m(self.left_out), "sd_um": um_from_m(self.sd),
        }  # fmt: skip

    def words(self, row: Explanation) -> str:
        """An explanation as its effect says it."""
        effect = effects_of_elements()[row.effect]
        values = {p.name: row.sizes[p.name] / p.si for p in effect.parameters if p.name in row.sizes}
        if "factor" in values:  # fitted as a share of the element's compliance that is added
            values["factor"] = 1.0 / (1.0 + row.sizes["factor"])
        return effect.finding({"element": row.element, **values})

    def _short(self) -> str:
        error = self.error_percent(self.model.predicted)
        return f"{self.model.machine.name}, {self.verdict}, error as given {error:.1f} %"


def diagnose_elements(
    machine: StiffnessModel, files: Sequence[str], mapping: Mapped, noise: float | None, spread: float
) -> ElementDiagnosis:
    """The verdict.

    `noise` is the standard deviation of a displacement relative to the size of its pull's, `spread` that of the
    elements' compliances, relative.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read, a row is no pull, or the machine cannot stand there.
    """
    model = PullModel(machine, read_pulls(files, machine.machine, mapping))
    sd, source_of_noise, known = _noise(model, noise)
    white = whitening(model, sd, spread)
    chi_square, ranked = explanations(model, white)
    verdict, plausible = verdict_of(chi_square, ranked, len(sd))
    if not known and verdict == "unexplained":
        verdict, plausible = "ambiguous", [row for row in ranked if row.chi_square < chi_square]
    joints, columns = model.torsions()
    value, torsion, without, left = model.pulls.value, np.zeros(0), model.predicted, chi_square
    if joints:
        stated = np.array(_file_torsions(model, joints))
        fixed = model.predicted - columns @ stated
        torsion, left = non_negative(white @ columns, white @ (value - fixed))
        without = left_out(columns, value, fixed, sd, model.pulls.pose)
    return ElementDiagnosis(
        model, sd, source_of_noise, chi_square, verdict, plausible, ranked, joints, torsion, left, without, tuple(files)
    )


def _file_torsions(model: PullModel, joints: Sequence[str]) -> list[float]:
    """Rad/(N m) about its axis of each joint, as the machine file has it."""
    named = dict(zip((e.name for e in model.machine.elements), model.pulls.stance.loads, strict=True))
    return [float(np.atleast_2d(named[name].compliance)[0, 5]) for name in joints]


def _noise(model: PullModel, relative: float | None) -> tuple[FloatArray, str, bool]:
    """(m,) m, where it comes from, and whether somebody states it: the rows, else a share of each pull's size.

    Where nobody does, it is what all candidates together leave: then nothing can be said to be missing from them.
    """
    pulls = model.pulls
    key = np.unique(np.char.add(pulls.file, pulls.line.astype(str)), return_inverse=True)[1]
    size = np.sqrt(np.bincount(key, pulls.value**2))[key]
    stated = ~np.isnan(pulls.sd)
    if relative is None and stated.all():
        return pulls.sd, "sd_um of each row", True
    if relative is not None:
        words = f"{100 * relative:g} % of the size of each displacement" + (
            ", sd_um where a row has it" if stated.any() else ""
        )
        return np.where(stated, pulls.sd, relative * size), words, True
    columns = np.concatenate([row[-1] for row in model.candidates()], axis=1)
    _, left = non_negative(columns / size[:, None], (pulls.value - model.predicted) / size)
    share = max(np.sqrt(left / max(len(size) - np.linalg.matrix_rank(columns), 1)), 1e-4)
    return share * size, f"estimated, {100 * share:.2g} % of the size of each displacement (say --noise)", False
