"""Measurements of a machine, and what the functions on them are asked in common."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.documents import without_nan
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import Asked
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.options import Option, numbers
from toolpath_stiff.readings.measurements import Readings, read_measurements, reading_columns

if TYPE_CHECKING:
    import pandas as pd


Noise = float | tuple[float, float] | None
COMMON = ("columns", "noise_percent", "strut_spread_percent")  # options that `Asked.command` says


class Measurements:
    """Measured stiffnesses of a machine: the files that hold them.

    A machine says what the readings mean (its reference tool, which poses it has), so each function reads them for its
    own.

    Attributes
    ----------
    files
        Their names: CSV, "FILE.xlsx#SHEET", or "nist-table1", the paper's Table 1.
    columns
        Which columns they call otherwise, as --columns has it; None: as FILE.columns.toml beside a file says.

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
        self._last: tuple[Hexapod, Readings] | None = None

    @classmethod
    def read(cls, *files: str | Path, columns: Mapped = None) -> Measurements:
        """Measurement files, several as one set of readings.

        Parameters
        ----------
        files
            CSV, "FILE.xlsx#SHEET", or "nist-table1".
        columns
            Which columns the files call otherwise: "stiffness=stiff_mean:N/um, date=day:DD.MM.YYYY", or such a dict.

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
        model = machine.model.given or machine.model.machine
        if self._last is None or self._last[0] is not model:
            self._last = (model, read_measurements(self.files, model, columns=self.columns))
        return self._last[1]

    def to_frame(self, machine: Machine | str | Path = MACHINE) -> pd.DataFrame:
        """One row a reading: file, line, point, pose, direction, measured stiffness, force.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Measurements.read("nist-table1").to_frame()[["point", "dx", "stiffness_N_per_mm"]].values.tolist()[0]
        ['P1', 1.0, 56813.0]
        """
        import pandas as pd

        return pd.DataFrame(reading_columns(self.on(machine_from(machine))))

    def to_dict(self, machine: Machine | str | Path = MACHINE) -> dict[str, Any]:
        """The files, and the readings as `to_frame` has them: the unit in each key, None where one does not say.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> found = tps.Measurements.read("nist-table1").to_dict()
        >>> found["files"], found["readings"][0]["stiffness_N_per_mm"]
        (['nist-table1'], 56813.0)
        """
        columns = reading_columns(self.on(machine_from(machine)))
        cells = zip(*(values.tolist() for values in columns.values()), strict=True)
        rows = [dict(zip(columns, row, strict=True)) for row in cells]
        return {"files": list(self.files), "readings": without_nan(rows)}

    def __repr__(self) -> str:
        return f"<Measurements {', '.join(self.files)}>"

    def _repr_html_(self) -> str:
        """For notebooks: the readings on the default machine, its first and last rows if they are many."""
        return str(self.to_frame().to_html(max_rows=20, notebook=True))


Data = Measurements | str | Path | Sequence[str | Path]


def measurements_from(data: Data, columns: Mapped = None) -> Measurements:
    """Measurements; of a file's name or several, those in the files, whose columns are called as `columns` says."""
    if isinstance(data, Measurements):
        return data
    return Measurements([str(file) for file in ([data] if isinstance(data, str | Path) else data)], columns)


class Question:
    """What the functions on measurements are asked in common, checked and in SI."""

    def __init__(
        self,
        machine: Machine | str | Path,
        data: Data | None,
        noise_percent: Noise,
        strut_spread_percent: float,
        seed: int,
        columns: Mapped = None,
    ) -> None:
        self.on = machine_from(machine)
        self.model = self.on.model.given or self.on.model.machine
        self.data = None if data is None else measurements_from(data, columns)
        self.noise = _noise(noise_percent)
        self.strut_spread = strut_spread_percent / 100.0
        self.seed = seed
        self.files = self.data.files if self.data else ()
        columns = self.data.columns if self.data else None
        self.request = Asked(self.files, self.on.asked, self.on.effect_files, self.noise, self.strut_spread, columns)
        self.inputs = (*self.files, *self.on.inputs)

    @property
    def readings(self) -> Readings:
        """Of the measurement files, on this machine."""
        assert self.data is not None
        return self.data.on(self.on)

    @property
    def common(self) -> dict[str, Any]:
        """What every function below takes by these names."""
        common = {"noise": self.noise, "strut_spread": self.strut_spread, "seed": self.seed}
        return {**common, "effect_files": self.on.effect_files}


def _percents(text: str) -> float | tuple[float, ...]:
    """`2` or `2,1.5`."""
    values = numbers(text)
    return values[0] if len(values) == 1 else values


# Options that the functions on measurements share.
NoisePercent = Annotated[
    Noise,
    Option(
        "--noise",
        "PERCENT[,PERCENT]",
        read=_percents,
        help="Standard deviation of one reading, re-clamping included; or of the reading alone and of a clamping. "
        "Unless given, from repeats, else from sd_N_per_mm, else a guess.",
    ),
]
StrutSpread = Annotated[
    float, Option("--strut-spread", "%", at_least=0, at_most=50, help="Standard deviation of the struts' stiffness.")
]
Seed = Annotated[int, Option("--seed", at_least=0, help="Of every random draw.")]


def _noise(percent: Noise) -> Noise:
    """Percentages as relative standard deviations."""
    if percent is None:
        return None
    parts = [percent] if isinstance(percent, int | float) else list(percent)
    shares = [float(part) / 100.0 for part in parts]
    if len(shares) not in (1, 2) or not all(0.0 <= part <= 0.5 for part in shares) or shares[0] <= 0.0:
        raise InputError(f"noise {percent} %", expected="one or two percentages, more than 0 and at most 50")
    return shares[0] if len(shares) == 1 else (shares[0], shares[1])
