"""Sheets of Excel workbooks as cells; openpyxl reads them, and is imported only for that."""

from __future__ import annotations

import io
import math
import os
import re
import warnings
import zipfile
from typing import Any

from toolpath_stiff.errors import InputError, InputErrors, TableError
from toolpath_stiff.grid import Grid, counts, typed

ZIP, OLD_EXCEL = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
LARGEST_BYTES = 200_000_000  # unpacked
LARGEST_CELLS = 500_000  # of a sheet, empty ones among them: openpyxl makes an object of each
SAVE_AS = "save it as .xlsx or CSV"


def split_name(path: str) -> tuple[str, str]:
    """File and sheet of `FILE.xlsx#SHEET`; a file that has the whole name comes first."""
    parts = re.fullmatch(r"(.+\.xls[xm])#(.+)", path, re.IGNORECASE)
    return (path, "") if parts is None or os.path.lexists(path) else (parts[1], parts[2])


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
        notes.append(f"{hidden} hidden rows of sheet {chosen.title!r} are read as well")
    merged = _fill_merged(chosen, cells)
    rows = [(line, [_shown(value) for value in row]) for line, row in enumerate(cells, 1)]
    return Grid([(line, row) for line, row in rows if counts(row)], "", tuple(notes), merged)


def _too_large(size: str, file: str) -> InputError:
    expected = f"at most {LARGEST_CELLS:,} cells, empty ones among them"
    return TableError(size, expected=expected, hint="delete the empty ones, or save the sheet as CSV", file=file)


def _chosen_sheet(workbook: Any, file: str, sheet: str) -> tuple[Any, list[str]]:
    """The sheet of that name, or the first that is not empty, and a note where there are others."""
    for page in workbook.worksheets:
        if page.max_row * page.max_column > LARGEST_CELLS:
            raise _too_large(f"sheet {page.title!r} has {page.max_row} rows and {page.max_column} columns", file)
    filled = {
        page.title: page for page in workbook.worksheets if any(v is not None for row in page.values for v in row)
    }
    if not filled:
        raise TableError("the workbook is empty", file=file)
    if sheet:
        if sheet not in filled:
            absent = f"the workbook has no sheet {sheet!r} with cells"
            raise TableError(absent, expected=f"one of {', '.join(filled)}", file=file)
        return filled[sheet], []
    first, *others = filled
    if not others:
        return filled[first], []
    return filled[first], [f"sheet {first!r} is read, not {', '.join(others)}; {file}#SHEET names another"]


def _refuse_large(content: bytes, file: str) -> None:
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
    import openpyxl

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what it leaves out (validations, pictures) is nothing of ours
            return openpyxl.load_workbook(io.BytesIO(content), data_only=values)
    except Exception as error:  # whatever a damaged file makes of the library
        reason = str(error.__cause__ or error).partition("\n")[0] or type(error).__name__  # the library's: three lines
        raise TableError(f"an Excel workbook that cannot be read: {reason}", hint=SAVE_AS, file=file) from None


def _refuse_formulas(cells: list[list[Any]], written: Any, file: str) -> None:
    errors = []
    for line, row in enumerate(written.iter_rows(), 1):
        for column, cell in enumerate(row):
            if cell.data_type == "f" and cells[line - 1][column] is None:
                mistake = f"cell {cell.coordinate} holds the formula {cell.value!s} without a stored value"
                hint = "open and save the workbook in Excel once, or save it as CSV"
                errors.append(TableError(mistake, hint=hint, file=file, line=line))
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
