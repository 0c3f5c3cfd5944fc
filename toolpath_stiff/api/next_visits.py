"""At the machine: one pose after another of a plan, each chosen from the readings before it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from toolpath_stiff.results import Result

if TYPE_CHECKING:
    import pandas as pd

    from toolpath_stiff.planning.next_visit import NextVisit as Found


class NextVisit(Result):
    """Where a plan stands, and the visit to make next.

    Attributes
    ----------
    probability
        Explanation -> probability, the likeliest first.
    settled
        Whether one of them has 95 %.
    """

    command: ClassVar[str] = "plan"

    def __init__(self, found: Found, folder: str) -> None:
        from toolpath_stiff.planning.next_document import next_document

        self.folder = folder
        self._document = next_document(found)
        self.probability = {one["name"]: one["probability"] for one in self._document["rivals"]}
        self.settled = found.settled

    def to_dict(self) -> dict[str, Any]:
        """Probabilities, the next visit and its rows."""
        return dict(self._document)

    def to_frame(self) -> pd.DataFrame:
        """One row a reading of the next visit, the stiffness left empty; none where there is no next visit."""
        import pandas as pd

        return pd.DataFrame(self._document["rows"])

    def save(self) -> list[Path]:
        """Write the next visit's rows, a measurement file to fill in, as next_1.csv (2, 3...) into the plan's folder.

        A file that is there already stays: it is the same visit, perhaps filled in.
        """
        from toolpath_stiff.files import write_atomically
        from toolpath_stiff.planning.document import plan_csv

        rows = self._document["rows"]
        file = Path(self.folder) / f"next_{rows[0]['clamp']}.csv" if rows else None
        return [] if file is None or file.exists() else [write_atomically(file, plan_csv(rows))]

    def __str__(self) -> str:
        return "\n".join([*self._document["text"], *(f"note: {note}" for note in self._document["notes"])])

    def _short(self) -> str:
        from toolpath_stiff.report.words import counted

        return f"{counted(self._document['readings'], 'reading')}, {'settled' if self.settled else 'open'}"


def next_visit(
    folder: str | Path, data: Sequence[str | Path] | str | Path = (), *, columns: str | Mapping[str, str] | None = None
) -> NextVisit:
    """Which pose of a plan to go to next, after the readings so far.

    Parameters
    ----------
    folder
        Where `plan` has been saved; a plan between explanations, not a first campaign.
    data
        Measurement files with the plan's readings taken so far, rows still empty among them; unless given, the
        folder's own plan.csv and next_1.csv, next_2.csv ... Readings from before the plan are in it already.
    columns
        Which columns the files call otherwise: "stiffness=stiff_mean:N/um", or such a dict.

    Raises
    ------
    InputError, InputErrors
        The folder holds no plan between explanations; a file cannot be read, every bad row.

    Examples
    --------
    >>> import tempfile
    >>> import toolpath_stiff as tps
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = tps.plan("nist", between=("spindle_compliance", "none"), n=2).save(folder, plots=False)
    ...     found = tps.next_visit(folder)
    ...     [file.name for file in found.save()]
    ['next_1.csv']
    >>> found
    <NextVisit: 0 readings, open>
    >>> found.probability, found.settled
    ({'spindle_compliance': 0.5, 'none': 0.5}, False)
    >>> len(found.to_frame()) == len(found.to_dict()["rows"])
    True
    """
    from toolpath_stiff.planning.next_visit import next_visit as choose_next

    files = (data,) if isinstance(data, str | Path) else tuple(data)
    return NextVisit(choose_next(folder, tuple(map(str, files)), columns), str(folder))
