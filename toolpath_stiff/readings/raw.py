"""Raw records of a stiffness test (ASME B5.54): force and displacement while the machine is jogged against a gauge.

The machine is jogged from zero to one extreme, to the other, and back to zero (the paper: 0, +200, -200, 0 um in steps
of 100 um), restrained by a force gauge; indicators read how far it really moved. A strut on a bench is measured alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.errors import InputError, TableError
from toolpath_stiff.files import Content, read_bytes, write_atomically
from toolpath_stiff.readings.dates import day_of, short_dates
from toolpath_stiff.readings.history import SURE, HistoryDocument, Readings, StrutEntry, history
from toolpath_stiff.readings.loop_figures import NO_FIGURES, LoopFigures, in_tension, reduce_loops, side_of, stuck_at
from toolpath_stiff.readings.mapping import DATE, Mapped, mapped_table
from toolpath_stiff.readings.raw_records import COLUMNS, CONDITIONS, PLACE, Loop, is_table, read_raw, read_stiffnesses
from toolpath_stiff.readings.raw_shape import Shape
from toolpath_stiff.results import Result
from toolpath_stiff.tables import Table
from toolpath_stiff.units import certain, n_per_mm_from_n_per_m, um_from_m
from toolpath_stiff.workbooks import split_name

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

FIGURES = ("lost_motion_um", "loop_width_um", "linearity_percent", "closure_um")
READ = (".csv", ".txt", ".dat", ".asc", ".tsv", ".xlsx", ".xlsm")  # of a folder
OWN_OUTPUT = "_measurements.csv"
FOREIGN = {
    b"MATLAB": "a MATLAB file", b"\x89HDF": "an HDF5 file (or MATLAB 7.3)", b"TDSm": "a TDMS file",
    b"MDF ": "an MDF file", b"PAR1": "a Parquet file", b"%PDF": "a PDF", b"{": "JSON", b"[": "JSON",
}  # fmt: skip
OTHER_SIDE = 1.05  # ratio of two slopes of a loop from which one side counts as softer; assumed, twice the scatter
# What the records of a strut are compared by.
BEYOND = "slope beyond the lost motion"
BLURRED = "secant, which its lost motion blurs: not every date has a closed cycle of both sides"
SECANT, IN_TENSION, IN_COMPRESSION = "secant", "slope in tension", "slope in compression"
OF_ONE_SIDE = ", which its lost motion blurs in records of one side alone"


@dataclass(frozen=True, repr=False, eq=False)
class Reduction(Result):
    """Raw records of force and displacement as measured stiffnesses, and what each loop says of play and friction.

    Attributes
    ----------
    raw
        Names of the files.
    loops, figures
        Records in SI, and what each loop says.
    notes
        What was assumed in reading them.
    read_as
        One line a file: which columns were read as what.
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
    >>> type(found.plot()).__name__
    'Figure'
    """

    command: ClassVar[str] = "reduce"
    shown_by: ClassVar[str] = "measuring"

    raw: tuple[str, ...]
    loops: tuple[Loop, ...]
    figures: tuple[LoopFigures, ...]
    notes: list[str]
    read_as: tuple[str, ...]
    history: HistoryDocument

    @property
    def recorded(self) -> list[tuple[Loop, LoopFigures]]:
        """Loops with their records, and what they say; rows of a table of stiffnesses have none."""
        return [pair for pair in zip(self.loops, self.figures, strict=True) if len(pair[0].force)]

    @property
    def title(self) -> str:
        """The first file, and how many others there are."""
        name, others = Path(self.raw[0]).name, len(self.raw) - 1
        return f"{name} and {others} more" if others else name

    def to_dict(self) -> dict[str, Any]:
        """One entry a loop, under "loops"; struts measured alone over their dates, under "history"."""
        pairs = zip(self.loops, self.figures, strict=True)
        return {"loops": [_entry(loop, figures) for loop, figures in pairs], "history": dict(self.history)}

    def to_frame(self) -> pd.DataFrame:
        """One row a loop."""
        import pandas as pd

        return pd.DataFrame(self.to_dict()["loops"])

    def plot(self) -> Figure:
        """Force against deflection of each loop; without records the struts over their dates."""
        figure: Figure = self.view.reduction_figure(self)
        return figure

    def __str__(self) -> str:
        return str(self.view.reduction_text(self))

    def _short(self) -> str:
        return f"{self.title}, {len(self.loops)} loop{'s' * (len(self.loops) != 1)}"

    def files(self, file: str | Path, *, plots: bool = True) -> Mapping[Path, Content]:
        """The measurement file; beside it the picture of the loops, and of dated struts that over their dates."""
        pictures: Mapping[Path, Content] = self.view.reduction_pictures(self, Path(file)) if plots else {}
        return {Path(file): measurement_csv(self), **pictures}

    def save(self, file: str | Path, *, plots: bool = True) -> list[Path]:
        """Write the measurement file and, beside it, the picture of the loops."""
        return [write_atomically(name, content) for name, content in self.files(file, plots=plots).items()]


def reduce(*raw: str | Path, columns: Mapped = None, compression_positive: bool = False) -> Reduction:
    """Raw records of force and displacement to measured stiffnesses: the secant of each loop (the paper's equation 12).

    Parameters
    ----------
    raw
        Files and folders of them: CSV, or FILE.xlsx[#SHEET]. Of struts on a bench also tables of their stiffnesses.
    columns
        Which columns the files call otherwise: "strut=hp, date=day_ms:ms, force=Kraft:kN", or such a dict; unless
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
    loops: list[Loop] = []
    figures: list[LoopFigures] = []
    notes: list[str] = []
    read_as: list[str] = []
    for file in (file for name in raw for file in _files(str(name))):
        table = _table(file, columns)
        if is_table(table):
            records, known = read_stiffnesses(table)
            figures += [replace(NO_FIGURES, stiffness=stiffness, force=force) for stiffness, force in known]
        else:
            records = read_raw(table)
            if compression_positive:
                records = records._replace(loops=[in_tension(loop) for loop in records.loops])
            figures += reduce_loops(records.loops)
        loops += records.loops
        notes += [*table.notes, *records.notes]
        read_as.append(_read_as(table, len(records.loops)))
    changes = _history(loops, figures)
    notes += [*_stuck(loops, figures), *_replaced(loops), *_to_bear_in_mind(loops, figures, changes)]
    return Reduction(tuple(map(str, raw)), tuple(loops), tuple(figures), notes, tuple(read_as), changes)


def _files(name: str) -> list[str]:
    """A file, or those of a folder and the folders in it, in the order of their names."""
    if not Path(name).is_dir():
        return [name]
    paths = sorted(p for p in Path(name).rglob("*") if p.suffix.lower() in READ and not p.name.startswith((".", "~")))
    files = [str(path) for path in paths if path.is_file() and not path.name.endswith(OWN_OUTPUT)]
    if not files:
        raise TableError("a folder without records", expected=f"files {', '.join(READ)}", file=name)
    return files


def _table(file: str, columns: Mapped) -> Table:
    start = read_bytes(split_name(file)[0], "raw records").lstrip()
    for first, kind in FOREIGN.items():
        if start.startswith(first):
            raise TableError(kind, expected="CSV or .xlsx", hint="export the channels as CSV", file=file)
    return mapped_table(file, "raw records", COLUMNS, columns)


def _read_as(table: Table, loops: int) -> str:
    """Which reading a file got, in one line."""
    known = [name for name in table.heading if name in (*COLUMNS.numbers, *COLUMNS.texts)]
    kind = "stiffnesses of struts" if is_table(table) else f"records of {loops} loop{'s' * (loops != 1)}"
    return f"{table.file}: {kind} from {', '.join(known)}, heading in line {table.heading_line}"


def _replaced(loops: Sequence[Loop]) -> list[str]:
    """Notes where a strut's serial number changes."""
    notes = []
    for strut in sorted({loop.place["loop"] for loop in loops if loop.serial}):
        dates = [(loop.place.get(DATE, ""), loop.serial) for loop in loops if loop.place.get("loop") == strut]
        dated = sorted((day_of(date), date, serial) for date, serial in dates if serial)
        for (_, last, before), (_, first, after) in pairwise(dated):
            if before != after:
                notes.append(
                    f"{strut}: serial number {before} until {last or '?'}, {after} from {first or '?'}: another part, "
                    "so that a change between these dates is its replacement"
                )
    return notes


def _to_bear_in_mind(loops: Sequence[Loop], figures: Sequence[LoopFigures], history: HistoryDocument) -> Iterator[str]:
    """What stands in the measurement file in place of a secant, and which of its rows are of a strut as it was."""
    own = {one["strut"] for one in history["struts"] if one["judged_on"] == BEYOND}
    pairs = zip(loops, figures, strict=True)
    playing = [(loop.title, one) for loop, one in pairs if one.plays and loop.place["loop"] in own]
    if playing:
        title, one = max(playing, key=lambda pair: pair[1].elastic / pair[1].stiffness)
        yield (
            f"{len(playing)} loops show lost motion; the rows of their struts hold the slope beyond it, their own "
            f"stiffness. The secant is at most {100.0 * (1.0 - one.stiffness / one.elastic):.2g} % less: {title}"
        )
    both = sorted(_sided(loops, figures, history))
    if both:
        yield f"tension and compression differ: a row of each side for {', '.join(both)}"
    for strut, (pulled, pushed) in _changing_places(loops, figures).items():
        yield (
            f"{strut}: softer in tension on {pulled}, in compression on {pushed}: does a file count compression "
            "positive? Its head may say so (compression positive)"
        )
    changed = {one["strut"]: one["changes"][-1]["before"] for one in history["struts"] if one["changes"]}
    for strut, since in changed.items():
        yield f"{strut} changed: leave out its rows before {since} for diagnose and update, which take all dates as one"


def _changing_places(loops: Sequence[Loop], figures: Sequence[LoopFigures]) -> dict[str, tuple[str, str]]:
    """Struts that are softer in tension on one date and in compression on another: which dates."""
    softer: dict[str, dict[bool, str]] = {}
    for loop, one in zip(loops, figures, strict=True):
        if max(one.tension, one.compression) > OTHER_SIDE * min(one.tension, one.compression):
            found = softer.setdefault(loop.place["loop"], {})
            found.setdefault(one.tension < one.compression, loop.place.get(DATE, "") or f"line {loop.line}")
    return {name: (found[True], found[False]) for name, found in softer.items() if len(found) > 1}


def differs(strut: StrutEntry) -> bool:
    """Whether a strut is told to differ in tension and compression."""
    return strut["sides"] is not None and strut["sides"]["p"] < SURE


def _stuck(loops: Sequence[Loop], figures: Sequence[LoopFigures]) -> list[str]:
    """A note where indicators stood still while the force went on."""
    tried = [(loop.title, stuck_at(loop, one)) for loop, one in zip(loops, figures, strict=True)]
    found = [(title, still) for title, still in tried if still]
    if not found:
        return []
    title, (displacement, start, end) = found[0]
    others = f"; so in {len(found) - 1} further loops" if len(found) > 1 else ""
    return [
        f"{title}: the indicator stands still at {um_from_m(displacement):g} um while the force goes on from "
        f"{start:.4g} to {end:.4g} N: at the end of its range? The stiffness is too high then, and does not count in "
        f"the history; leave out its row{others}"
    ]


def _history(loops: Sequence[Loop], figures: Sequence[LoopFigures]) -> HistoryDocument:
    """Struts measured alone over their dates; those of several lengths by length, as a strut's stiffness varies."""
    rows = [(loop, one) for loop, one in zip(loops, figures, strict=True) if loop.jog is None]
    lengths: dict[str, set[str]] = {}
    for loop, _ in rows:
        lengths.setdefault(loop.place["loop"], set()).add(loop.place.get("length_mm", ""))

    def readings(chosen: list[tuple[Loop, float, float]]) -> Readings:
        names = [loop.place["loop"] for loop, _, _ in chosen]
        some = [loop.place.get("length_mm", "") for loop, _, _ in chosen]
        shown = [f"{n}, {mm} mm" if len(lengths[n]) > 1 and mm else n for n, mm in zip(names, some, strict=True)]
        return Readings(
            np.array(shown, dtype=str),
            np.array([day_of(loop.place.get(DATE, "")) for loop, _, _ in chosen]),
            np.log([stiffness for _, stiffness, _ in chosen]),
            np.array([side for _, _, side in chosen]),
            short_dates(loop.place.get(DATE, "") for loop, _, _ in chosen),
        )

    rows = [(loop, one) for loop, one in rows if not stuck_at(loop, one)]
    judged = {name: _judged(name, rows) for name in lengths}
    seen = [(loop, *_seen(loop, one, judged[loop.place["loop"]])) for loop, one in rows]
    slopes = [(loop, k, s) for loop, one in rows for k, s in ((one.tension, 1.0), (one.compression, -1.0))]
    slopes = [one for one in slopes if math.isfinite(one[1])]
    found = history(readings(seen), readings(slopes or seen))
    for strut in found["struts"]:
        strut["judged_on"] = judged[strut["strut"].split(" alone")[0] + " alone"]
        if strut["judged_on"] not in ("", SECANT):
            strut["text"] = "; ".join(filter(None, [strut["text"], f"judged on the {strut['judged_on']}"]))
    return found


def _judged(name: str, rows: Sequence[tuple[Loop, LoopFigures]]) -> str:
    """What all records of a strut can be compared by."""
    own = [(loop, one) for loop, one in rows if loop.place["loop"] == name]
    recorded = [(loop, one) for loop, one in own if len(loop.force)]
    if not recorded:
        return ""
    both = [one for loop, one in recorded if not side_of(loop)]
    play = any(one.plays for one in both)
    if len(recorded) == len(own):
        if side := _shared_side({side_of(loop) for loop, _ in recorded}, both):
            return side + (OF_ONE_SIDE if play else "")
        if play and all(math.isfinite(one.beyond) for _, one in own):
            return BEYOND
    return BLURRED if play else SECANT


def _shared_side(sides: set[float], both: Sequence[LoopFigures]) -> str:
    """The side that every record has, where some have no other (`both`: those with either); else nothing."""
    if len(sides) != 2 or 0.0 not in sides or not all(math.isfinite(one.tension) for one in both):
        return ""
    return IN_TENSION if 1.0 in sides else IN_COMPRESSION


def _seen(loop: Loop, one: LoopFigures, judged: str) -> tuple[float, float]:
    """Stiffness in N/m by which a record is compared with others, and the side on which that is."""
    side = side_of(loop) if len(loop.force) else one.side
    if judged == BEYOND:
        return one.beyond, side
    if judged.startswith(IN_TENSION) and not side:
        return one.tension, 1.0
    if judged.startswith(IN_COMPRESSION) and not side:
        return one.compression, -1.0
    return one.stiffness, side


def _entry(loop: Loop, figures: LoopFigures) -> dict[str, Any]:
    """A loop in the shop's units; what it cannot say is None. `slope_N_per_mm`: beyond the lost motion."""
    numbers = {
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(figures.stiffness),
        "force_N": figures.force,
        "deflection_um": um_from_m(figures.deflection),
        "slope_N_per_mm": n_per_mm_from_n_per_m(figures.beyond if figures.plays else math.nan),
        "tension_N_per_mm": n_per_mm_from_n_per_m(figures.tension),
        "compression_N_per_mm": n_per_mm_from_n_per_m(figures.compression),
        **shop_figures(figures),
    }
    shown = {name: round(value, 6) if math.isfinite(value) else None for name, value in numbers.items()}
    return {"loop": loop.title, "line": loop.line, **shown, "shape": _shape(figures.shape)}


def _shape(shape: Shape) -> dict[str, Any]:
    """What stands out of a straight line."""
    numbers = {
        "force_N": shape.force,
        "first_N_per_mm": n_per_mm_from_n_per_m(shape.first),
        "second_N_per_mm": n_per_mm_from_n_per_m(shape.second),
        "work_lost_mJ": 1e3 * shape.lost,
    }
    shown = {name: certain(value) if math.isfinite(value) else None for name, value in numbers.items()}
    return {"kind": shape.kind, **shown, "text": str(shape)}


def shop_figures(figures: LoopFigures) -> dict[str, float]:
    """`FIGURES` in the shop's units."""
    return {
        "lost_motion_um": um_from_m(figures.lost_motion),
        "loop_width_um": um_from_m(figures.loop_width),
        "linearity_percent": 100.0 * figures.linearity,
        "closure_um": um_from_m(figures.closure),
    }


def _rows_of(reduction: Reduction) -> list[tuple[Loop, LoopFigures]]:
    """Loops as they stand in a measurement file: struts with their own stiffness, two rows where the sides differ."""
    sided = _sided(reduction.loops, reduction.figures, reduction.history)
    mixed = {one["strut"] for one in reduction.history["struts"] if one["judged_on"] != BEYOND}
    found = []
    for loop, one in zip(reduction.loops, reduction.figures, strict=True):
        if loop.place.get("loop") in sided:
            high, low = float(loop.force.max()), float(loop.force.min())
            found.append((loop, replace(one, stiffness=one.tension, force=high)))
            found.append((loop, replace(one, stiffness=one.compression, force=low)))
        else:
            own = one.stiffness if loop.place.get("loop") in mixed else one.elastic
            found.append((loop, replace(one, stiffness=own)))
    return found


def _sided(loops: Sequence[Loop], figures: Sequence[LoopFigures], history: HistoryDocument) -> set[str]:
    """Struts that differ in tension and compression and whose loops all say so: rows of both would not be alike."""
    lacking = {loop.place.get("loop") for loop, one in zip(loops, figures, strict=True) if math.isnan(one.tension)}
    return {one["strut"] for one in history["struts"] if differs(one)} - lacking


def measurement_csv(reduction: Reduction) -> str:
    """A measurement file, one row a loop; of a strut that differs in tension and compression a row of each.

    A figure that some loop lacks is left out as a column.
    """
    loops, figures = zip(*_rows_of(reduction), strict=True)
    shown = [shop_figures(one) for one in figures]
    there = [name for name in FIGURES if all(math.isfinite(one[name]) for one in shown)]
    place = _place_columns(loops)
    forces = _force_columns(loops)
    conditions = [name for name in CONDITIONS if all(name in loop.conditions for loop in loops)]
    rows = []
    for loop, one, own in zip(loops, figures, shown, strict=True):
        force = f"{one.force:.2f}" if math.isfinite(one.force) else ""
        cells = [loop.place.get(name, "") for name in place]
        cells += [f"{n_per_mm_from_n_per_m(one.stiffness):.1f}"]
        cells += [force if name == _force_column(loop) else "" for name in forces]
        cells += [f"{loop.conditions[name]:.6g}" for name in conditions]
        cells += [f"{own[name] + 0.0:.3f}" for name in there]
        rows.append(cells)
    return csv_text([*place, "stiffness_N_per_mm", *forces, *conditions, *there], rows)


def _place_columns(loops: Sequence[Loop]) -> list[str]:
    """Columns that say where the loops were; of struts alone those with something in them."""
    place = [name for name in PLACE if any(name in loop.place for loop in loops)]
    alone = all(loop.jog is None for loop in loops)
    return [name for name in place if not alone or any(loop.place.get(name) for loop in loops)]


def _force_column(loop: Loop) -> str:
    """The column of its force: at the tool tip, or along a strut measured alone."""
    return "strut_force_N" if loop.jog is None else "force_N"


def _force_columns(loops: Sequence[Loop]) -> list[str]:
    return sorted({_force_column(loop) for loop in loops})
