"""Measurements of a machine: the files that hold them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.documents import Document, without_nan
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.readings.measurements import Readings, read_measurements, reading_columns
from toolpath_stiff.results import DataFrame, frame_of


class Measurements:
    """Measured stiffnesses of a machine: the files that hold them.

    A machine says what the readings mean (its reference tool, which poses it has), so each function reads them for its
    own.

    Attributes
    ----------
    files
        Their names: CSV, "FILE.xlsx#SHEET", or "nist-table1", the paper's Table 1.
    columns
        Columns that they name differently, as in --columns; None: as FILE.columns.toml beside a file says.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> data = tps.Measurements.read("nist-table1")
    >>> len(data.to_frame())
    42
    """

    def __init__(self, files: Sequence[str], columns: Mapped = None) -> None:
        if columns is not None and not isinstance(columns, str):
            columns = ", ".join(f"{ours}={theirs}" for ours, theirs in columns.items())
        self.columns = columns
        self.files = tuple(files)
        self._last: tuple[MachineTool, Readings] | None = None

    @classmethod
    def read(cls, *files: str | Path, columns: Mapped = None) -> Measurements:
        """Measurement files, several as one set of readings.

        Parameters
        ----------
        files
            CSV, "FILE.xlsx#SHEET", or "nist-table1".
        columns
            Columns that the files name differently: "stiffness=stiff_mean:N/um, date=day:DD.MM.YYYY", or such a dict.

        Raises
        ------
        InputError, InputErrors
            A file cannot be read, or has not the right columns; every bad row.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Measurements.read("nist-table1")
        <Measurements nist-table1>
        """
        measurements = cls([str(file) for file in files], columns)
        measurements.on(Machine.load())
        return measurements

    def on(self, machine: Machine) -> Readings:
        """The readings as arrays in SI, checked against a machine.

        Raises `InputError` or `InputErrors`, for poses that the machine cannot have too.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> readings = tps.Measurements.read("nist-table1").on(tps.Machine.load("nist"))
        >>> len(readings), readings.position.shape
        (42, (42, 3))
        """
        if self._last is None or self._last[0] is not machine.stated:
            self._last = (machine.stated, read_measurements(self.files, machine.stated, columns=self.columns))
        return self._last[1]

    def to_frame(self, machine: Machine | str | Path = MACHINE) -> DataFrame:
        """A row for each reading: file, line, point, pose, direction, measured stiffness, force.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Measurements.read("nist-table1").to_frame()[["point", "dx", "stiffness_N_per_mm"]].values.tolist()[0]
        ['P1', 1.0, 56813.0]
        """
        return frame_of(reading_columns(self.on(machine_from(machine))))

    def to_dict(self, machine: Machine | str | Path = MACHINE) -> Document:
        """The files, and the readings as in `to_frame`: the unit in each key, None for values not given.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> found = tps.Measurements.read("nist-table1").to_dict()
        >>> found["files"], found["readings"][0]["stiffness_N_per_mm"]
        (['nist-table1'], 56813.0)
        """
        return {"files": list(self.files), "readings": without_nan(self.to_frame(machine).to_dict("records"))}

    def __repr__(self) -> str:
        return f"<Measurements {', '.join(self.files)}>"

    def _repr_html_(self) -> str:
        """HTML for notebooks: the readings on the default machine; of many, the first and last rows."""
        return str(self.to_frame().to_html(max_rows=20, notebook=True))


Data = Measurements | str | Path | Sequence[str | Path]


def measurements_from(data: Data, columns: Mapped = None) -> Measurements:
    """Measurements as given, or those in a file or several, with columns named as `columns` says."""
    if isinstance(data, Measurements):
        return data
    return Measurements([str(file) for file in ([data] if isinstance(data, str | Path) else data)], columns)
