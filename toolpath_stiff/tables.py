"""Tables as offices write them, to one form: headings by their known names, numbers with a decimal point.

Text with commas, semicolons or tabs between the cells, decimal commas, a byte-order mark, UTF-16 or Latin-1, any line
ends; or a sheet of an Excel workbook. Titles above the heading are passed over, a row of units below
it is held against the headings. What could mean two things ("1,234") is refused.

A sheet is read by openpyxl, which is imported only for that.
"""

from __future__ import annotations

import csv
import io
import math
import os
import re
import unicodedata
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from functools import cache
from typing import Any

from toolpath_stiff.errors import InputError, InputErrors, TableError
from toolpath_stiff.files import decoded, read_bytes

__all__ = [
    "SPREADSHEET_ERROR",
    "Columns",
    "Grid",
    "Table",
    "counts",
    "grid_table",
    "heading_key",
    "is_workbook",
    "parse_table",
    "read_table",
    "sheet_grid",
    "sheet_names",
    "split_name",
    "text_grid",
    "typed",
]

SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab"}
LOOKED_AT = 60  # rows among which the heading is searched
HEADING_FROM = 3  # known columns in a row make it the heading, so that titles may stand above it
FEWEST = 2  # known columns of a heading, where no row has so many

# Tokens of units, as `heading_key` makes them: those of the columns and those that stand there by mistake.
LENGTHS = ("nm", "um", "mm", "cm", "m", "in", "inch", "inches", "mil", "mils", "thou", "uin")
FORCES = ("n", "kn", "dan", "kgf", "kp", "lbf", "lb", "lbs")
STIFFNESSES = ("n_per_um", "n_per_mm", "n_per_m", "kn_per_mm", "kn_per_um", "mn_per_m", "kgf_per_mm", "lbf_per_in")
OTHERS = (*STIFFNESSES, "deg", "rad", "mrad", "s", "min", "h", "c", "k", "f", "%")
UNITS = frozenset((*LENGTHS, *FORCES, *OTHERS))

# Units of one quantity by their size, as ratios of whole numbers (BIPM: The International System of Units, 9th ed.;
# inch, pound-force and kilogram-force: NIST Special Publication 811:2008, B.8, exact).
INCH, POUND_FORCE, KILOGRAM_FORCE = (254, 10**4), (44482216152605, 10**13), (980665, 10**5)
SCALES: tuple[Mapping[str, tuple[int, int]], ...] = (
    {
        "nm": (1, 10**9), "um": (1, 10**6), "mm": (1, 1000), "cm": (1, 100), "m": (1, 1),
        **dict.fromkeys(("in", "inch", "inches"), INCH),
        **dict.fromkeys(("mil", "mils", "thou"), (INCH[0], 1000 * INCH[1])), "uin": (INCH[0], 10**6 * INCH[1]),
    },
    {
        "n": (1, 1), "kn": (1000, 1), "dan": (10, 1), **dict.fromkeys(("kgf", "kp"), KILOGRAM_FORCE),
        **dict.fromkeys(("lbf", "lb", "lbs"), POUND_FORCE),
    },
    {"s": (1, 1), "min": (60, 1), "h": (3600, 1)},
    {
        "n_per_m": (1, 1), "n_per_mm": (1000, 1), "n_per_um": (10**6, 1), "kn_per_mm": (10**6, 1),
        "kn_per_um": (10**9, 1), "mn_per_m": (10**6, 1), "kgf_per_mm": (1000 * KILOGRAM_FORCE[0], KILOGRAM_FORCE[1]),
        "lbf_per_in": (POUND_FORCE[0] * INCH[1], POUND_FORCE[1] * INCH[0]),
    },
)  # fmt: skip
SAME_TOKEN = {"degc": "c", "degrees": "deg", "minutes": "min", "micron": "um", "microns": "um"}
PLAIN = re.compile(r"[+-]?\d+(?:e[+-]?\d+)?", re.IGNORECASE)
ONE_MARK = re.compile(r"[+-]?(?:\d+[.,]\d*|[.,]\d+)(?:e[+-]?\d+)?", re.IGNORECASE)
LIKE_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:[.,'’ \u00a0\u202f]\d{3})+(?:[.,]\d*)?")
BETWEEN_COMMAS = "a decimal comma between commas? Write semicolons between the cells"
REMOVE_THEM = "write numbers without thousands separators"
Rows = list[tuple[int, list[str]]]
Cell = tuple[int, str, str]  # line, column, text
SPREADSHEET_ERROR = re.compile(r"#[A-ZÄÖÜ][A-ZÄÖÜ0-9/_]*[!?]|#N/A|#N/?V")
ZIP, OLD_EXCEL = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
LARGEST_BYTES = 200_000_000  # unpacked
LARGEST_CELLS = 500_000  # of a sheet, empty ones among them: openpyxl makes an object of each
SAVE_AS = "save it as .xlsx or CSV"


@dataclass(frozen=True)
class Columns:
    """Columns that a kind of table may have: those of numbers, named with their units, and those of text.

    With `converted`, another unit of the same quantity that a heading states is converted, as a logger's file is not
    written by hand; else it is refused.
    """

    numbers: tuple[str, ...]
    texts: tuple[str, ...] = ()
    converted: bool = False


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
    notes
        What was read differently from how it is written, in words.
    above
        Line and cells of what stands above the heading.
    """

    file: str
    heading: tuple[str, ...]
    heading_line: int
    rows: tuple[tuple[int, tuple[str, ...]], ...]
    separator: str
    notes: tuple[str, ...] = ()
    above: tuple[tuple[int, tuple[str, ...]], ...] = ()

    def record(self, cells: Sequence[str]) -> dict[str, str]:
        """Column -> cell of one row. Raises `InputError` where a row has too few or too many."""
        if len(cells) == len(self.heading):
            return dict(zip(self.heading, cells, strict=True))
        comma = self.separator == "," and len(cells) > len(self.heading)
        raise TableError(
            f"row with {len(cells)} cells",
            expected=f"{len(self.heading)} as in the heading",
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
    return grid_table(text_grid(text, file, columns), file, columns)


def text_grid(text: str, file: str, columns: Columns, mark: str = "") -> Grid:
    """Cells of a text, parted by a mark; "" is that which makes the best heading of it. Raises `InputError`."""
    if mark:
        return Grid(list(_lines(text, file, mark)), mark)
    declared = re.match(r"\ufeff?sep=(.)\s*[\r\n]", text, re.IGNORECASE)  # Excel's own first line
    if declared and declared[1] in SEPARATORS:
        return Grid(list(_lines(text, file, declared[1]))[1:], declared[1])
    known = _known(columns)
    scored = []
    for rank, separator in enumerate(SEPARATORS):
        first = []
        for row in _lines(text, file, separator, strict=False):
            first.append(row[1])
            if len(first) == LOOKED_AT:
                break
        best = max((_score(cells, known) for cells in first), default=0)
        scored.append((best, max((len(cells) for cells in first), default=0), -rank, separator))
    separator = max(scored)[-1]
    return Grid(list(_lines(text, file, separator)), separator)


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
    known = _known(columns)
    at = _heading_row(grid, known)
    line, written = grid.rows[at]
    body, notes = grid.rows[at + 1 :], list(grid.notes)
    if at:
        notes.append(f"{file}: what stands above the heading in line {line} is not read as rows")
    body, units, told = _without_unit_row(body, written, file)
    notes += told
    written = _as_wide(grid, written, [written, *(cells for _, cells in body)])
    _refuse_merged(grid, written, file, line)
    factors = [_factor(cell, unit, known) if columns.converted else None for cell, unit in _paired(written, units)]
    heading = [
        factor[0] if factor else _name(cell, unit, known, file, line)
        for factor, (cell, unit) in zip(factors, _paired(written, units), strict=True)
    ]
    renamed = [f"{old!r} as {new}" for old, new in zip(written, heading, strict=True) if old != new]
    if renamed:
        notes.append(f"{file}: headings are read by their known names: {', '.join(renamed)}")
    rows = [(at_line, _fitted(cells, len(heading), grid.separator == "")) for at_line, cells in body]
    rows, told = _plain_numbers(rows, heading, grid.separator, columns, file)
    notes += told
    if scales := {i: factor[1:] for i, factor in enumerate(factors) if factor}:
        rows = [(n, _row_in_our_units(row, scales)) for n, row in rows]
        converted = ", ".join(f"{written[i]!r} to {heading[i]}" for i in scales)
        notes.append(f"{file}: units are converted: {converted}")
    above = tuple((n, tuple(cells)) for n, cells in grid.rows[:at])
    body_rows = tuple((n, tuple(c)) for n, c in rows)
    return Table(file, tuple(heading), line, body_rows, grid.separator, tuple(notes), above)


def _without_unit_row(
    body: list[tuple[int, list[str]]], written: list[str], file: str
) -> tuple[list[tuple[int, list[str]]], list[str], list[str]]:
    """Rows below the heading, the units of the row of units if there is one, and a note on it."""
    if not body or not _is_unit_row(body[0][1], written):
        return body, [], []
    return body[1:], body[0][1], [f"{file}: line {body[0][0]} is a row of units"]


def _plain_numbers(
    rows: list[tuple[int, list[str]]], heading: list[str], separator: str, columns: Columns, file: str
) -> tuple[list[tuple[int, list[str]]], list[str]]:
    """Numbers with decimal points and without separators of thousands; notes on what was read so."""
    _refuse_spreadsheet_errors(heading, rows, file)
    notes: list[str] = []
    numbers = [i for i, name in enumerate(heading) if name not in columns.texts]
    if columns.converted:
        rows, grouped = _without_groups(rows, numbers)
        notes = [f"{file}: {grouped!r} is read as a thousands separator"] if grouped else []
    rows, commas = with_points(heading, rows, numbers, separator, file)
    return rows, [*notes, *([f"{file}: numbers are read with decimal commas"] if commas else [])]


def _heading_row(grid: Grid, known: Mapping[str, str]) -> int:
    """Row of the heading: the first with enough known columns, else that with most of them, else the first."""
    top = min(len(grid.rows), LOOKED_AT)
    scores = [_score(cells, known) for _, cells in grid.rows[:top]]
    most = scores.index(max(scores)) if max(scores) >= FEWEST else 0
    return next((i for i, score in enumerate(scores) if score >= HEADING_FROM), most)


def _as_wide(grid: Grid, heading: list[str], rows: list[list[str]]) -> list[str]:
    """The heading as wide as the last cell with something in it; of a text file not wider than it is."""
    width = max((i + 1 for cells in rows for i, cell in enumerate(cells) if cell), default=0)
    return (heading + [""] * width)[:width] if grid.separator == "" or len(heading) > width else heading


def _fitted(cells: list[str], width: int, pad: bool) -> list[str]:
    """Without empty cells beyond the heading; those of a sheet are as long as the heading."""
    while len(cells) > width and not cells[-1]:
        cells = cells[:-1]
    return cells + [""] * (width - len(cells)) if pad else cells


def _paired(written: list[str], units: list[str]) -> Iterator[tuple[str, str]]:
    return zip(written, (units + [""] * len(written))[: len(written)], strict=True)


def heading_key(name: str) -> str:
    """A heading without case, brackets, spaces and signs: `Stiffness [N/mm]` and `stiffness_N_per_mm` are one."""
    text = unicodedata.normalize("NFKC", name.replace("°", "deg").replace("º", "deg")).casefold()
    tokens = re.findall(r"[^\W_]+|%", text.replace("μ", "u").replace("/", " per "))
    return "_".join(SAME_TOKEN.get(token, token) for token in tokens)


def _known(columns: Columns) -> dict[str, str]:
    """Key -> name of every column."""
    return {heading_key(name): name for name in (*columns.numbers, *columns.texts)}


def _meant(key: str, known: Mapping[str, str]) -> str | None:
    """The known column that a heading with no unit, or with another one, means."""
    for own, name in known.items():
        base = _without_unit(own)
        if base and (key == base or (key.startswith(f"{base}_") and key[len(base) + 1 :] in UNITS)):
            return name
    return None


@cache
def _without_unit(key: str) -> str | None:
    """The key of a known column without the longest unit that it ends in; None if it has none."""
    return next((key[: -len(unit) - 1] for unit in sorted(UNITS, key=len, reverse=True) if _ends(key, unit)), None)


def _ends(key: str, unit: str) -> bool:
    return key.endswith(f"_{unit}") and len(key) > len(unit) + 1


def _score(cells: Sequence[str], known: Mapping[str, str]) -> int:
    """How many cells of a row are headings."""
    keys = {heading_key(cell) for cell in cells if cell}
    return sum(key in known or _meant(key, known) is not None for key in keys)


def _is_unit_row(cells: Sequence[str], heading: Sequence[str]) -> bool:
    """Whether the cells are units, empty, a dash, or (merged cells) the heading once more; and one is a unit."""
    units = [cell for cell, above in zip(cells, [*heading, *[""] * len(cells)], strict=False) if cell != above]
    return any(heading_key(cell) in UNITS for cell in units) and all(
        heading_key(cell) in UNITS or not cell.strip("-–[]() ") for cell in units
    )


def _name(written: str, unit: str, known: Mapping[str, str], file: str, line: int) -> str:
    """The known name of a heading and the unit below it; others as they stand. Raises `InputError`."""
    key, unit_key = heading_key(written), heading_key(unit)
    if not key:
        return written
    bare = unit_key not in UNITS
    if not bare and f"{key}_{unit_key}" in known:
        return known[f"{key}_{unit_key}"]
    name = known.get(key) or _meant(key, known)
    if name is None:
        return written
    if key in known and (bare or _ends(key, unit_key)):
        return name
    if not bare:
        found = f"column {written!r} with {unit!r} in the row of units"
    elif any(_ends(key, other) for other in UNITS):
        found = f"unknown column {written!r} (in another unit?)"
    else:
        found = f"column {written!r} has no unit"
    raise TableError(
        found, expected=name, hint=f"did you mean {name}? Otherwise give it another name", file=file, line=line
    )


def _factor(written: str, unit: str, known: Mapping[str, str]) -> tuple[str, int, int] | None:
    """The known name, and the ratio by which numbers in the unit that the heading states become those of its own."""
    key = "_".join(filter(None, (heading_key(written), heading_key(unit))))
    name = None if heading_key(written) in known or key in known else _meant(key, known)
    base = _without_unit(heading_key(name)) if name else None
    if name is None or not base or not key.startswith(f"{base}_"):
        return None
    stated, own = key[len(base) + 1 :], heading_key(name)[len(base) + 1 :]
    for scale in SCALES:
        if stated in scale and own in scale:
            (up, down), (own_up, own_down) = scale[stated], scale[own]
            return name, up * own_down, down * own_up
    return None


def _row_in_our_units(row: list[str], scales: Mapping[int, tuple[int, int]]) -> list[str]:
    return [_scaled(cell, *scales[i]) if i in scales else cell for i, cell in enumerate(row)]


def _scaled(cell: str, up: int, down: int) -> str:
    """A number in another unit, without a rounding where the ratio is decimal; other cells as they are."""
    try:
        return str(Decimal(cell) * up / down)
    except InvalidOperation:
        return cell


def _refuse_merged(grid: Grid, heading: Sequence[str], file: str, line: int) -> None:
    if "" in heading and grid.merged and line in grid.merged:
        raise TableError(
            f"merged cells in the heading: {grid.merged[line]}",
            expected="one heading a column",
            hint="split the merged cells, or leave them in a row above the heading",
            file=file,
            line=line,
        )


def _refuse_spreadsheet_errors(heading: Sequence[str], rows: list[tuple[int, list[str]]], file: str) -> None:
    errors = [
        TableError(f"{name} = {cell}, an error of the spreadsheet", expected="a value", file=file, line=line)
        for line, cells in rows
        for name, cell in zip(heading, cells, strict=False)
        if SPREADSHEET_ERROR.fullmatch(cell)
    ]
    if errors:
        raise InputErrors(errors)


def with_points(
    heading: Sequence[str], rows: Rows, numbers: Sequence[int], separator: str, file: str
) -> tuple[Rows, bool]:
    """Numbers with decimal points, and whether they had commas.

    A comma in a number is a decimal comma only if some number of the file shows it: "1,234" alone says nothing. Between
    semicolons, which go with decimal commas, a column of "353" and "1.268" is as doubtful.

    Parameters
    ----------
    heading, rows
        Names; lines and cells.
    numbers
        Columns that may hold numbers.
    separator
        Between the cells, "" for a sheet.
    file
        For messages.

    Raises
    ------
    InputError, InputErrors
        Thousands separators, two kinds of decimal marks, or numbers that can be read in two ways.
    """
    cells = [(line, heading[i], row[i]) for line, row in rows for i in numbers if i < len(row)]
    _refuse_grouped(cells, file)
    marked = [cell for cell in cells if ONE_MARK.fullmatch(cell[2])]
    commas = [cell for cell in marked if "," in cell[2]]
    points = [cell for cell in marked if "." in cell[2]]
    if commas and points:
        raise _two_marks(commas, points, file)
    if commas and all(LIKE_THOUSANDS.fullmatch(text) for _, _, text in commas):
        raise _ambiguous(commas[0], file)
    if separator == ";":
        _refuse_doubtful_points(cells, points, file)
    if not commas:
        return rows, False
    chosen = frozenset(numbers)
    return [(line, [_with_point(c) if i in chosen else c for i, c in enumerate(row)]) for line, row in rows], True


def _with_point(cell: str) -> str:
    return cell.replace(",", ".") if ONE_MARK.fullmatch(cell) else cell


def _without_groups(rows: Rows, numbers: Sequence[int]) -> tuple[Rows, str]:
    """Numbers of a logger without their thousands separators, and which it is.

    "" where no number shows one, or others of the file contradict.
    """
    cells = [row[i] for _, row in rows for i in numbers if i < len(row)]
    sure = [cell for cell in cells if THOUSANDS.fullmatch(cell) and not ONE_MARK.fullmatch(cell)]
    marks = {match[1] for cell in sure if (match := re.match(r"[+-]?\d{1,3}([^\d])", cell))}
    if len(marks) != 1:
        return rows, ""
    mark = marks.pop()
    if any(mark in cell and (not _groups_by(mark).fullmatch(cell)) for cell in cells if re.match(r"[+-]?[\d.,]", cell)):
        return rows, ""
    of = frozenset(numbers)
    return [(n, [c.replace(mark, "") if i in of else c for i, c in enumerate(row)]) for n, row in rows], mark


@cache
def _groups_by(mark: str) -> re.Pattern[str]:
    return re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:{re.escape(mark)}\d{{3}})+(?:[.,]\d*)?")


def _refuse_grouped(cells: list[Cell], file: str) -> None:
    grouped = [cell for cell in cells if THOUSANDS.fullmatch(cell[2]) and not ONE_MARK.fullmatch(cell[2])]
    if grouped:
        raise InputErrors(
            TableError(f"{name} = {text!r} has thousands separators", hint=REMOVE_THEM, file=file, line=line)
            for line, name, text in grouped
        )


def _refuse_doubtful_points(cells: list[Cell], points: list[Cell], file: str) -> None:
    """A column in which only numbers from 1000 up have a point."""
    whole = {name for _, name, text in cells if PLAIN.fullmatch(text)}
    sure = {name for _, name, text in points if not LIKE_THOUSANDS.fullmatch(text)}
    for cell in points:
        if cell[1] in whole and cell[1] not in sure:
            raise _ambiguous(cell, file)


def _two_marks(commas: list[Cell], points: list[Cell], file: str) -> InputError:
    rare, usual = (commas, points) if len(commas) < len(points) else (points, commas)
    (line, name, text), (other_line, other_name, other) = rare[0], usual[0]
    return TableError(
        f"{name} = {text!r} and {other_name} = {other!r} (line {other_line}) have different decimal marks",
        expected="decimal points, or decimal commas, in the whole file",
        hint=REMOVE_THEM,
        file=file,
        line=line,
    )


def _ambiguous(cell: Cell, file: str) -> InputError:
    line, name, text = cell
    return TableError(
        f"{name} = {text!r} could be {text.replace(',', '.')} or {re.sub('[.,]', '', text)}",
        expected="a number that can be read in one way",
        hint=f"{REMOVE_THEM}, decimals with a point",
        file=file,
        line=line,
    )


@dataclass(frozen=True)
class Grid:
    """Line (row of a sheet) and cells of every row that is neither empty nor a comment.

    `separator` is "" for a sheet; `merged` are cells that are merged side by side, row -> which.
    """

    rows: list[tuple[int, list[str]]]
    separator: str
    notes: tuple[str, ...] = ()
    merged: Mapping[int, str] = field(default_factory=dict)


def typed(cell: str) -> str:
    """A cell without space around it; the printer's minus as a keyboard's.

    The apostrophe that keeps spreadsheets from running a word (`column_files.csv_text`) is no part of the word.
    """
    found = cell.strip().replace("\u2212", "-")
    return found[1:] if found[:2] in ("'=", "'+", "'-", "'@") else found


def counts(cells: list[str]) -> bool:
    """Whether a row is neither empty nor a comment; an error of the spreadsheet begins like one."""
    return any(cells) and (not cells[0].startswith("#") or bool(SPREADSHEET_ERROR.fullmatch(cells[0])))


def split_name(path: str) -> tuple[str, str]:
    """File and sheet of `FILE.xlsx#SHEET`; a file that has the whole name comes first."""
    found = re.fullmatch(r"(.+\.xls[xm])#(.+)", path, re.IGNORECASE)
    return (path, "") if found is None or os.path.lexists(path) else (found[1], found[2])


def is_workbook(content: bytes) -> bool:
    """Whether the bytes are a workbook's rather than text."""
    return content.startswith((ZIP, OLD_EXCEL))


def sheet_grid(content: bytes, file: str, sheet: str = "") -> Grid:
    """Cells of a sheet, the stored values of formulas; line numbers are the sheet's rows.

    Parameters
    ----------
    content, file
        The workbook and its name.
    sheet
        Name of the sheet; "" is the first that is not empty.

    Raises
    ------
    InputError, InputErrors
        Not a workbook that can be read, no such sheet, too large, or formulas without a stored value.
    """
    if content.startswith(OLD_EXCEL):
        raise TableError("an old or a protected Excel file", expected="an .xlsx workbook", hint=SAVE_AS, file=file)
    _refuse_large(content, file)
    chosen, notes = _chosen_sheet(_open(content, file, values=True), file, sheet)
    cells = [list(row) for row in chosen.values]
    if any(value is None for row in cells for value in row):
        _refuse_formulas(cells, _open(content, file, values=False)[chosen.title], file)
    hidden = sum(bool(row.hidden) for i, row in chosen.row_dimensions.items() if i <= len(cells))
    if hidden:
        notes.append(f"{file}: {hidden} hidden rows of sheet {chosen.title!r} are read as well")
    merged = _fill_merged(chosen, cells)
    rows = [(line, [_shown(value) for value in row]) for line, row in enumerate(cells, 1)]
    return Grid([(line, row) for line, row in rows if counts(row)], "", tuple(notes), merged)


def sheet_names(content: bytes, file: str) -> list[str]:
    """Names of the sheets that are not empty, in their order. Raises as `sheet_grid`."""
    if content.startswith(OLD_EXCEL):
        raise TableError("an old or a protected Excel file", expected="an .xlsx workbook", hint=SAVE_AS, file=file)
    _refuse_large(content, file)
    return [one.title for one in _filled(_open(content, file, values=True), file)]


def _filled(workbook: Any, file: str) -> list[Any]:
    """Sheets with something in them. Raises `InputError` where one is too large to be looked through."""
    for sheet in workbook.worksheets:
        if sheet.max_row * sheet.max_column > LARGEST_CELLS:
            raise _too_large(f"sheet {sheet.title!r} has {sheet.max_row} rows and {sheet.max_column} columns", file)
    return [sheet for sheet in workbook.worksheets if any(v is not None for row in sheet.values for v in row)]


def _too_large(found: str, file: str) -> InputError:
    expected = f"at most {LARGEST_CELLS:,} cells, empty ones among them"
    return TableError(found, expected=expected, hint="delete the empty ones, or save the sheet as CSV", file=file)


def _chosen_sheet(workbook: Any, file: str, sheet: str) -> tuple[Any, list[str]]:
    """The sheet of that name, or the first that is not empty, and a note where there are others."""
    filled = _filled(workbook, file)
    names = [one.title for one in filled]
    if not filled:
        raise TableError("the workbook is empty", file=file)
    if sheet and sheet not in names:
        found = f"the workbook has no sheet {sheet!r} with cells"
        raise TableError(found, expected=f"one of {', '.join(names)}", file=file)
    chosen = filled[names.index(sheet) if sheet else 0]
    if len(filled) == 1 or sheet:
        return chosen, []
    others = ", ".join(names[1:])
    return chosen, [f"{file}: sheet {chosen.title!r} is read, not {others}; {file}#SHEET names another"]


def _refuse_large(content: bytes, file: str) -> None:
    import zipfile

    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = archive.namelist()
            size = sum(part.file_size for part in archive.infolist())
            sheets = [name for name in names if name.startswith("xl/worksheets/") and size <= LARGEST_BYTES]
            cells = sum(len(re.findall(rb"<c[ >/]", archive.read(name))) for name in sheets)
    except Exception:  # a damaged one, or of a kind that the library does not know
        raise TableError("a damaged Excel workbook", hint=SAVE_AS, file=file) from None
    if "xl/workbook.xml" not in names:
        raise TableError("neither text nor an Excel workbook", hint=SAVE_AS, file=file)
    if size > LARGEST_BYTES:
        raise TableError(f"a workbook of {size / 1e6:.0f} MB unpacked", hint="save the sheet as CSV", file=file)
    if cells > LARGEST_CELLS:
        raise _too_large(f"a workbook of {cells:,} cells", file)


def _open(content: bytes, file: str, values: bool) -> Any:
    try:
        import openpyxl
    except ImportError:
        raise TableError(
            "reading .xlsx needs openpyxl, which is not installed",
            hint="install it (`pip install openpyxl`), or save the sheet as CSV",
            file=file,
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what it leaves out (validations, pictures) is nothing of ours
            return openpyxl.load_workbook(io.BytesIO(content), data_only=values)
    except Exception as error:  # whatever a damaged file makes of the library
        reason = (
            str(error.__cause__ or error).partition("\n")[0] or type(error).__name__
        )  # the library's has three lines
        raise TableError(f"an Excel workbook that cannot be read: {reason}", hint=SAVE_AS, file=file) from None


def _refuse_formulas(cells: list[list[Any]], written: Any, file: str) -> None:
    errors = []
    for line, row in enumerate(written.iter_rows(), 1):
        for column, cell in enumerate(row):
            if cell.data_type == "f" and cells[line - 1][column] is None:
                found = f"cell {cell.coordinate} holds the formula {cell.value!s} without a stored value"
                hint = "open and save the workbook in Excel once, or save it as CSV"
                errors.append(TableError(found, hint=hint, file=file, line=line))
    if errors:
        raise InputErrors(errors)


def _fill_merged(sheet: Any, cells: list[list[Any]]) -> dict[int, str]:
    """Cells merged one below the other all get their value; row -> those merged side by side, which are not filled."""
    beside: dict[int, str] = {}
    for area in sheet.merged_cells.ranges:
        value = cells[area.min_row - 1][area.min_col - 1]
        if area.min_col == area.max_col:
            for row in range(area.min_row, area.max_row):
                cells[row][area.min_col - 1] = value
        else:
            beside[area.min_row] = f"{area.coord} ({_shown(value)!r})"
    return beside


def _shown(value: Any) -> str:
    """A cell as text; whole numbers without decimals, dates as ISO writes them."""
    if value is None:
        return ""
    if isinstance(value, float) and math.isfinite(value) and value == int(value) and abs(value) < 1e15:
        return str(int(value))
    return typed(value.isoformat() if hasattr(value, "isoformat") else str(value))
