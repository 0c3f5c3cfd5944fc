"""One sheet of an Excel workbook (.xlsx) as cells of text, for `tables`. openpyxl is imported only here."""

from __future__ import annotations

import io
import math
import os
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from toolpath_stiff.errors import InputErrors, TableError

SPREADSHEET_ERROR = re.compile(r"#[A-ZÄÖÜ][A-ZÄÖÜ0-9/_]*[!?]|#N/A|#N/?V")

ZIP, OLD_EXCEL = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
LARGEST_BYTES = 200_000_000  # unpacked
LARGEST_CELLS = 5_000_000
SAVE_AS = "save it as .xlsx or CSV"


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
    hidden = sum(bool(chosen.row_dimensions[i].hidden) for i in range(1, chosen.max_row + 1))
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
    return [one.title for one in _filled(_open(content, file, values=True))]


def _filled(workbook: Any) -> list[Any]:
    return [one for one in workbook.worksheets if any(v is not None for row in one.values for v in row)]


def _chosen_sheet(workbook: Any, file: str, sheet: str) -> tuple[Any, list[str]]:
    """The sheet of that name, or the first that is not empty, and a note where there are others."""
    filled = _filled(workbook)
    names = [one.title for one in filled]
    if not filled:
        raise TableError("the workbook is empty", file=file)
    if sheet and sheet not in names:
        found = f"the workbook has no sheet {sheet!r} with cells"
        raise TableError(found, expected=f"one of {', '.join(names)}", file=file)
    chosen = filled[names.index(sheet) if sheet else 0]
    if chosen.max_row * chosen.max_column > LARGEST_CELLS:
        raise TableError(
            f"sheet {chosen.title!r} has {chosen.max_row} rows and {chosen.max_column} columns",
            hint="delete the empty ones, or save the sheet as CSV",
            file=file,
        )
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
    except Exception:  # a damaged one, or of a kind that the library does not know
        raise TableError("a damaged Excel workbook", hint=SAVE_AS, file=file) from None
    if "xl/workbook.xml" not in names:
        raise TableError("neither text nor an Excel workbook", hint=SAVE_AS, file=file)
    if size > LARGEST_BYTES:
        raise TableError(f"a workbook of {size / 1e6:.0f} MB unpacked", hint="save the sheet as CSV", file=file)


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
        raise TableError(f"an Excel workbook that cannot be read: {error}", hint=SAVE_AS, file=file) from None


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
