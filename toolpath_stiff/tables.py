"""Tables as offices write them, to one form: headings by their known names, numbers with a decimal point.

Text with commas, semicolons or tabs between the cells, decimal commas, a byte-order mark, UTF-16 or Latin-1, any line
ends; or a sheet of an Excel workbook. Titles above the heading are passed over, a row of units below it is held against
the headings. What could mean two things ("1,234") is refused. Columns of other names are read where a mapping says
which they are.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import NamedTuple

from toolpath_stiff.column_names import (
    NO_UNITS,
    UNITS,
    converted,
    heading_key,
    keys,
    meant,
    parted,
    same_quantity,
    unit_of,
)
from toolpath_stiff.decimal_marks import refuse_spreadsheet_errors, with_points
from toolpath_stiff.errors import TableError
from toolpath_stiff.files import decoded, read_bytes
from toolpath_stiff.grid import Grid, counts, typed
from toolpath_stiff.workbooks import is_workbook, sheet_grid, split_name

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
LOOKED_AT = 60  # rows among which the heading is searched
HEADING_FROM = 3  # known columns in a row make it the heading, so that titles may stand above it
FEWEST = 2  # known columns of a heading, where no row has so many
BETWEEN_COMMAS = "a decimal comma between commas? Write semicolons between the cells"


class Source(NamedTuple):
    """Where a column's cells come from, as a mapping says: a heading of the file, or one text for all rows."""

    heading: str = ""
    unit: str = ""  # or form, of dates; "" where the mapping leaves it to the heading
    text: str = ""


@dataclass(frozen=True)
class Columns:
    """Columns that a kind of table may have: those of numbers, named with their units, and those of text.

    `sources`: of those that the file calls otherwise. With `mappable` a heading of the wrong unit is left to the
    caller, who says which mapping to write; else it is refused.
    """

    numbers: tuple[str, ...]
    texts: tuple[str, ...] = ()
    sources: Mapping[str, Source] = field(default_factory=dict)
    mappable: bool = False


class Doubt(NamedTuple):
    """A heading that seems to mean a column, but for its unit: which column, and what is wrong."""

    heading: str
    name: str
    unit: str
    fault: str


@dataclass(frozen=True)
class Table:
    """A heading and rows of cells.

    Attributes
    ----------
    file
        For messages.
    heading, heading_line
        Known columns by their names, others as they stand; the line that it stands on.
    rows
        Line (row of a sheet) and cells, stripped; numbers have a decimal point.
    separator
        Between the cells of a text file; "" for a sheet.
    remarks
        What was read differently from how it is written, in words.
    texts
        Columns that hold one text in all rows; the last ones of the heading.
    sources, doubts, units
        As of `Columns`; headings that were left as they stand; heading -> unit in the row below it.
    """

    file: str
    heading: tuple[str, ...]
    heading_line: int
    rows: tuple[tuple[int, tuple[str, ...]], ...]
    separator: str
    remarks: tuple[str, ...] = ()
    texts: tuple[str, ...] = ()
    sources: Mapping[str, Source] = field(default_factory=dict)
    doubts: tuple[Doubt, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def notes(self) -> tuple[str, ...]:
        """One line on what was read differently from how it is written; none where nothing was."""
        return (f"{self.file}: {'; '.join(self.remarks)}",) if self.remarks else ()

    def record(self, cells: Sequence[str]) -> dict[str, str]:
        """Column -> cell of one row. Raises `InputError` where a row has too few or too many."""
        written = len(self.heading) - len(self.texts)
        if len(cells) == written:
            return dict(zip(self.heading, (*cells, *self.texts), strict=True))
        comma = self.separator == "," and len(cells) > written
        raise TableError(
            f"row with {len(cells)} cells",
            expected=f"{written} as in the heading",
            hint=BETWEEN_COMMAS if comma else "",
        )


def read_table(path: str, what: str, columns: Columns) -> Table:
    """Read a table from a text file or an Excel workbook, whatever its name ends in.

    Parameters
    ----------
    path
        The file; `FILE.xlsx#SHEET` names the sheet, else it is the first that is not empty.
    what
        What the file holds, for messages.
    columns
        What it may have.

    Raises
    ------
    InputError, InputErrors
        The file cannot be read, is empty, or its cells can be read in two ways; with line and column.
    """
    workbook, sheet = split_name(path)
    content = read_bytes(workbook, what)
    if is_workbook(content):
        return grid_table(sheet_grid(content, workbook, sheet), path, columns)
    if sheet:
        raise TableError(f"{workbook!r} is not an Excel workbook and has no sheets", file=path)
    return parse_table(decoded(content), path, columns)


def parse_table(text: str, file: str, columns: Columns) -> Table:
    """The same from the text of a file."""
    declared = re.match(r"\ufeff?sep=(.)\s*[\r\n]", text, re.IGNORECASE)  # Excel's own first line
    if declared and declared[1] in SEPARATORS:
        return grid_table(Grid(list(_lines(text, file, declared[1]))[1:], declared[1]), file, columns)
    scored = []
    for rank, separator in enumerate(SEPARATORS):
        top = [cells for _, cells in islice(_lines(text, file, separator, strict=False), LOOKED_AT)]
        score = max((_score(cells, columns) for cells in top), default=0)
        scored.append((score, max(map(len, top), default=0), -rank, separator))
    separator = max(scored)[-1]
    return grid_table(Grid(list(_lines(text, file, separator)), separator), file, columns)


def _lines(text: str, file: str, separator: str, strict: bool = True) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of every line that is neither empty nor a comment. Raises `InputError`."""
    reader = csv.reader(io.StringIO(text, newline=None), delimiter=separator)
    try:
        for cells in reader:
            stripped = [typed(cell) for cell in cells]
            if counts(stripped):
                yield reader.line_num, stripped
    except csv.Error as error:  # a quote that never ends, say
        if strict:
            raise TableError(f"not a CSV file: {error}", file=file, line=reader.line_num) from None


def grid_table(grid: Grid, file: str, columns: Columns) -> Table:
    """The same from cells. Raises as `read_table`."""
    if not grid.rows:
        raise TableError("the file is empty", expected="a heading and rows below it", file=file)
    first = _heading_row(grid, columns, file)
    line, written = grid.rows[first]
    body, remarks = grid.rows[first + 1 :], list(grid.notes)
    if first:
        remarks.append(f"what stands above the heading in line {line} is not read as rows")
    units: list[str] = []
    if body and _is_unit_row(body[0][1], written):
        remarks.append(f"line {body[0][0]} is a row of units")
        units, body = body[0][1], body[1:]
    written = _as_wide(grid, written, [written, *(cells for _, cells in body)])
    _refuse_merged(grid, written, file, line)
    heading, scales, doubts = _named(written, [*units, *[""] * len(written)], columns)
    if doubts and not columns.mappable:
        hint = f"did you mean {doubts[0].name}? Otherwise give it another name"
        raise TableError(doubts[0].fault, expected=doubts[0].name, hint=hint, file=file, line=line)
    renamed = [
        f"{name} from {old!r}" + (f" in {scales[i][0]}" if i in scales else "")
        for i, (old, name) in enumerate(zip(written, heading, strict=True))
        if old != name or i in scales
    ]
    texts = {name: source.text for name, source in columns.sources.items() if not source.heading}
    if renamed or texts:
        remarks.append(
            ", ".join(["read " + ", ".join(renamed)] * bool(renamed) + [f"{n} {t}" for n, t in texts.items()])
        )
    rows = [(n, _fitted(cells, len(heading), grid.separator == "")) for n, cells in body]
    refuse_spreadsheet_errors(heading, rows, file)
    numbers = [i for i, name in enumerate(heading) if name not in columns.texts]
    rows, commas = with_points(heading, rows, numbers, grid.separator, file)
    remarks += ["numbers are read with decimal commas"] * commas
    if scales:
        rows = [(n, [converted(c, *scales[i]) if i in scales else c for i, c in enumerate(row)]) for n, row in rows]
    return Table(
        file,
        (*heading, *texts),
        line,
        tuple((n, tuple(cells)) for n, cells in rows),
        grid.separator,
        tuple(remarks),
        tuple(texts.values()),
        columns.sources,
        tuple(doubts),
        {cell: UNITS.get(heading_key(unit), "") for cell, unit in zip(written, units, strict=False)},
    )


def _heading_row(grid: Grid, columns: Columns, file: str) -> int:
    """Row of the heading: that with all mapped headings; else the first with enough known columns, or with most."""
    top = [cells for _, cells in grid.rows[:LOOKED_AT]]
    mapped = [source.heading for source in columns.sources.values() if source.heading]
    scores = [_score(cells, columns) for cells in top]
    most = scores.index(max(scores)) if max(scores) >= FEWEST else 0
    row = next((i for i, score in enumerate(scores) if score >= HEADING_FROM), most)
    if not mapped:
        return row
    rows = [i for i, cells in enumerate(top) if set(mapped) <= set(cells)]
    if not rows:
        row = max(range(len(top)), key=lambda i: (len({*mapped} & {*top[i]}), scores[i], -i))
        absent = next(name for name in mapped if name not in top[row])
        shown = ", ".join(repr(cell) for cell in top[row] if cell)
        raise TableError(f"no column {absent!r}", expected=f"one of {shown}", file=file, line=grid.rows[row][0])
    return rows[0]


def _as_wide(grid: Grid, heading: list[str], rows: list[list[str]]) -> list[str]:
    """The heading as wide as the last cell with something in it; of a text file not wider than it is."""
    width = max((i + 1 for cells in rows for i, cell in enumerate(cells) if cell), default=0)
    return (heading + [""] * width)[:width] if grid.separator == "" or len(heading) > width else heading


def _fitted(cells: list[str], width: int, pad: bool) -> list[str]:
    """Without empty cells beyond the heading; those of a sheet are as long as the heading."""
    while len(cells) > width and not cells[-1]:
        cells = cells[:-1]
    return cells + [""] * (width - len(cells)) if pad else cells


def _score(cells: Sequence[str], columns: Columns) -> int:
    """How many cells of a row are headings."""
    known = keys((*columns.numbers, *columns.texts))
    mapped = {source.heading for source in columns.sources.values()}
    headings = {heading_key(cell) for cell in cells if cell and cell not in mapped}
    return sum(key in known or meant(key, known) is not None for key in headings) + len(mapped & {*cells} - {""})


def _is_unit_row(cells: Sequence[str], heading: Sequence[str]) -> bool:
    """Whether the cells are units, empty, a dash, or (merged cells) the heading once more; and one is a unit."""
    units = [cell for cell, above in zip(cells, [*heading, *[""] * len(cells)], strict=False) if cell != above]
    known = [heading_key(cell) in {*UNITS, *NO_UNITS} for cell in units]
    return any(known) and all(is_unit or not cell.strip("-–[]() ") for is_unit, cell in zip(known, units, strict=True))


def _named(
    written: Sequence[str], units: Sequence[str], columns: Columns
) -> tuple[list[str], dict[int, tuple[str, str]], list[Doubt]]:
    """Names of the headings; place -> unit and the column's own of those to be converted; and what is in doubt."""
    known = keys((*columns.numbers, *columns.texts))
    mapped = {source.heading: name for name, source in columns.sources.items() if source.heading}
    heading, scales, doubts = [], {}, []
    for i, (cell, below) in enumerate(zip(written, units, strict=False)):
        name = mapped.get(cell)
        if name is None:
            name, doubt = _name(cell, below, known)
            taken = doubt is not None and doubt.name in columns.sources
            doubts += [doubt] if doubt and not taken else []
        elif column_unit := unit_of(name):
            stated = (columns.sources[name].unit, UNITS.get(heading_key(below), ""), unit_of(cell))
            unit = next((unit for unit in stated if same_quantity(unit, column_unit)), column_unit)
            scales[i] = (unit, column_unit)
        heading.append(name)
    return heading, scales, doubts


def _name(written: str, below: str, known: Mapping[str, str]) -> tuple[str, Doubt | None]:
    """The known name of a heading and the unit below it, others as they stand; and what is in doubt about it."""
    key, unit = heading_key(written), heading_key(below)
    bare = unit not in UNITS and unit not in NO_UNITS
    if not key or (not bare and f"{key}_{unit}" in known):
        return known.get(f"{key}_{unit}", written), None
    name = known.get(key) or meant(key, known)
    if name is None or (key in known and (bare or key.endswith(f"_{unit}"))):
        return name or written, None
    fault = f"column {written!r} has no unit"
    stated = unit_of(written)
    if not bare:
        fault, stated = f"column {written!r} with {below!r} in the row of units", UNITS.get(unit, "")
    elif parted(key)[1]:
        fault = f"unknown column {written!r} (in another unit?)"
    return written, Doubt(written, name, stated if same_quantity(stated, unit_of(name)) else unit_of(name), fault)


def _refuse_merged(grid: Grid, heading: Sequence[str], file: str, line: int) -> None:
    if "" in heading and line in grid.merged:
        raise TableError(
            f"merged cells in the heading: {grid.merged[line]}",
            expected="one heading a column",
            hint="split the merged cells, or leave them in a row above the heading",
            file=file,
            line=line,
        )
