"""The result of a diagnosis, which prints, tabulates, draws and saves itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from toolpath_stiff.diagnosis.document import document_of
from toolpath_stiff.diagnosis.examination import Examination
from toolpath_stiff.results import FolderResult, frame_of

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Examination, FolderResult):
    """Which physical effect the model lacks, if any, and what stands behind it; attributes as of `Examination`."""

    command: ClassVar[str] = "diagnose"
    shown_by: ClassVar[str] = "diagnose"

    def to_dict(self) -> dict[str, Any]:
        """The content of diagnose.json."""
        return dict(document_of(self))

    def to_frame(self) -> pd.DataFrame:
        """The candidates, one a row: probability, errors, why not."""
        return frame_of(self.to_dict()["candidates"])

    def _short(self) -> str:
        return f"{self.verdict}: {', '.join(self.plausible)}" if self.plausible else self.verdict
