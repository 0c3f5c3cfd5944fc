"""At the machine: one pose after another of a plan, each chosen from the readings before it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from toolpath_stiff.column_names import Mapped

if TYPE_CHECKING:
    from toolpath_stiff.planning.next_visit import NextVisit


def next_visit(
    folder: str | Path, data: Sequence[str | Path] | str | Path = (), *, columns: Mapped = None
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
    ...     _ = tps.plan(machine="nist", between=("spindle_compliance", "none"), n=2).save(folder, plots=False)
    ...     found = tps.next_visit(folder)
    ...     [file.name for file in found.save()]
    ['next_1.csv']
    >>> found
    <NextVisit: 0 readings, open>
    >>> found.probability, found.settled
    ({'spindle_compliance': 0.5, 'none': 0.5}, False)
    >>> len(found.to_frame()) == len(found.to_dict()["rows"]) == len(found.rows)
    True
    """
    from toolpath_stiff.planning.next_visit import next_visit as choose_next

    files = (data,) if isinstance(data, str | Path) else tuple(data)
    return choose_next(folder, tuple(map(str, files)), columns)
