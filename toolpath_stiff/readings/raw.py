"""Raw records of a stiffness test (ASME B5.54): force and displacement while the machine is jogged against a gauge.

The machine is jogged from zero to one extreme, to the other, and back to zero (the paper: 0, +200, -200, 0 um in steps
of 100 um), restrained by a force gauge; indicators read how far it really moved. A strut on a bench is measured alone.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from toolpath_stiff.column_names import Mapped
from toolpath_stiff.documents import to_dict
from toolpath_stiff.errors import InputError, InputErrors, MeasurementError
from toolpath_stiff.files import Content, write_atomically
from toolpath_stiff.readings.history import StrutHistory
from toolpath_stiff.readings.loop_figures import LoopFigures, in_tension, reduce_loop
from toolpath_stiff.readings.mapping import DATE, check_needed, mapped_table, unused
from toolpath_stiff.readings.raw_records import COLUMNS, PLACE, STIFFNESS, Loop, read_raw, strut_or_loop
from toolpath_stiff.readings.raw_rows import loop_entry, measurement_csv, remarks, struts_over_dates
from toolpath_stiff.readings.rows import LABELS, SOFTEST, STIFFEST, number, optional_number, parsed_rows
from toolpath_stiff.results import DataFrame, Result, frame_of
from toolpath_stiff.tables import Table
from toolpath_stiff.units import n_per_m_from_n_per_mm

FAILED = 0.05  # share of a table's rows that may be failed tests, near zero; if more, the unit is wrong; assumed


@dataclass(frozen=True, repr=False, eq=False)
class Reduction(Result):
    """Raw records of force and displacement as measured stiffnesses, with play and friction of each loop.

    Attributes
    ----------
    raw
        Names of the files.
    figures
        What each loop says, with its records, in SI.
    notes
        What was assumed in reading them.
    read_as
        One line per file: which columns were read as what.
    history
        Of struts measured alone, over their dates.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> rows = ["x_mm,y_mm,z_mm,direction,jog_um,force_N,displacement_um"]
    >>> rows += [f"0,0,800,X,{jog},{40 * jog},{0.2 * jog}" for jog in (0, 200, -200, 0)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "raw.csv")
    ...     _ = file.write_text(chr(10).join(rows))
    ...     found = tps.reduce(file)
    ...     names = [one.name for one in found.save(pathlib.Path(folder, "measurements.csv"), plots=False)]
    >>> names == [one.name for one in found.files("measurements.csv", plots=False)]
    True
    >>> found.to_dict()["loops"][0]["stiffness_N_per_mm"], found.notes
    (50000.0, [])
    >>> found.title, len(found.recorded)
    ('raw.csv', 1)
    >>> type(found.plot()).__name__
    'Figure'
    """

    command: ClassVar[str] = "reduce"
    shown_by: ClassVar[str] = "measuring"

    raw: tuple[str, ...]
    figures: tuple[LoopFigures, ...]
    notes: list[str]
    read_as: tuple[str, ...]
    history: StrutHistory

    @property
    def recorded(self) -> list[LoopFigures]:
        """Figures of the loops with records; rows of a table of stiffnesses have none."""
        return [figures for figures in self.figures if len(figures.loop.force)]

    @property
    def title(self) -> str:
        """Name of the first file, and the number of others."""
        name, others = Path(self.raw[0]).name, len(self.raw) - 1
        return f"{name} and {others} more" if others else name

    def to_dict(self) -> dict[str, Any]:
        """One entry per loop, under "loops"; struts measured alone over their dates, under "history"."""
        return {"loops": [loop_entry(figures) for figures in self.figures], "history": to_dict(self.history)}

    def to_frame(self) -> DataFrame:
        """One row per loop."""
        return frame_of(self.to_dict()["loops"])

    def _short(self) -> str:
        return f"{self.title}, {len(self.figures)} loops"

    def files(self, file: str | Path, *, plots: bool = True) -> Mapping[Path, Content]:
        """The measurement file; beside it pictures of the loops and, for dated struts, of their course over time."""
        out, pictures = Path(file), self.view.pictures(self) if plots else {}
        beside = {out.with_name(f"{out.stem}_{name}"): content for name, content in pictures.items()}
        return {out: measurement_csv(self.figures, self.history), **beside}

    def save(self, file: str | Path, *, plots: bool = True) -> list[Path]:
        """Write the measurement file and, beside it, the picture of the loops."""
        return [write_atomically(name, content) for name, content in self.files(file, plots=plots).items()]


def reduce(*raw: str | Path, columns: Mapped = None, compression_positive: bool = False) -> Reduction:
    """Raw records of force and displacement to measured stiffnesses: the secant of each loop (the paper's equation 12).

    Parameters
    ----------
    raw
        Files: CSV, or FILE.xlsx[#SHEET]. Of struts on a bench also tables of their stiffnesses.
    columns
        Columns that the files name differently: "strut=hp, date=day_ms:ms, force=Kraft:kN", or such a dict; unless
        given, as FILE.columns.toml beside a file says.
    compression_positive
        Whether the forces of struts on a bench count compression positive.

    Raises
    ------
    InputError, InputErrors
        No file, or one that cannot be read or lacks columns; every record and every loop that gives no stiffness.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> rows = ["x_mm,y_mm,z_mm,direction,jog_um,force_N,displacement_um"]
    >>> rows += [f"0,0,800,X,{jog},{40 * jog},{0.2 * jog}" for jog in (0, 200, -200, 0)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "raw.csv")
    ...     _ = file.write_text(chr(10).join(rows))
    ...     found = tps.reduce(file)
    >>> found.to_frame()["stiffness_N_per_mm"].tolist()
    [50000.0]
    """
    if not raw:
        raise InputError("no raw records", expected="a file or several")
    figures: list[LoopFigures] = []
    notes: list[str] = []
    read_as: list[str] = []
    errors: list[InputError] = []
    for file in map(str, raw):
        table = mapped_table(file, "raw records", COLUMNS, columns)
        if STIFFNESS[0] in table.heading and "displacement_um" not in table.heading:
            reduced, remarked = read_strut_table(table)
            figures += reduced
            kind = "stiffnesses of struts"
        else:
            loops, remarked = read_raw(table)
            for loop in loops:
                try:
                    figures.append(reduce_loop(in_tension(loop) if compression_positive else loop))
                except InputError as error:
                    errors.append(error)
            kind = f"records of {len(loops)} loops"
        notes += [*table.notes, *remarked]
        known = [name for name in table.heading if name in (*COLUMNS.numbers, *COLUMNS.texts)]
        read_as.append(f"{file}: {kind} from {', '.join(known)}")
    if errors:
        raise InputErrors(errors)
    over_time = struts_over_dates(figures)
    return Reduction(
        tuple(map(str, raw)), tuple(figures), [*notes, *remarks(figures, over_time)], tuple(read_as), over_time
    )


def read_strut_table(table: Table) -> tuple[list[LoopFigures], list[str]]:
    """Struts alone without records; and remarks.

    A few rows with a stiffness near zero are failed tests: they are left out, with a note.

    Raises
    ------
    InputError, InputErrors
        Rows that are not of a strut alone, have no stiffness or none that could be; all of them.
    """
    needed = STIFFNESS[:1] if "loop" in table.heading else ("strut", STIFFNESS[0])
    check_needed(table, needed, "strut,date,stiffness_N_per_mm of struts alone")

    def strut(line: int, record: dict[str, str]) -> LoopFigures:
        if strut_or_loop(record).kind != "alone":
            raise MeasurementError("a row of no strut", expected="strut 1 to 6")
        failed = abs(number(record, STIFFNESS[0], (-STIFFEST, STIFFEST))) < SOFTEST
        stiffness = math.nan if failed else n_per_m_from_n_per_mm(number(record, STIFFNESS[0]))
        place = {name: record[name] for name in PLACE if record.get(name)}
        loop = Loop(place, None, np.empty(0), np.empty(0), line, table.file)
        return LoopFigures(loop, stiffness, optional_number(record, STIFFNESS[1]))

    struts, errors = parsed_rows(table, strut)
    failed = [row.loop.line for row in struts if math.isnan(row.stiffness)]
    fault = f"{len(failed)} of {len(table.rows)} rows with a stiffness within {SOFTEST:g} N/mm of zero"
    if len(failed) > FAILED * len(table.rows):
        hint = f"is the unit right? At most {100 * FAILED:g} % are left out as failed tests"
        errors.append(MeasurementError(fault, hint=hint, file=table.file, line=failed[0]))
    if errors:
        raise InputErrors(errors)
    if not struts:
        raise MeasurementError("no rows below the heading", file=table.file, line=table.heading_line)
    notes = unused(table, ("strut", *LABELS, DATE, "length_mm", *STIFFNESS))
    if failed:
        notes.append(f"{table.file}: {fault} are left out as failed tests, from line {failed[0]}")
    return [row for row in struts if not math.isnan(row.stiffness)], notes
