"""Sheets of Excel workbooks as cells, read by openpyxl, which is imported only then."""

import io
import os
import re
import warnings
import zipfile
from typing import Any

from toolpath_stiff.errors import InputError

ZIP, OLD_EXCEL = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
LARGEST_BYTES = 50_000_000  # unpacked
LARGEST_CELLS = 500_000  # of a sheet, empty ones among them: openpyxl makes an object of each
SAVE_AS = "save the sheet as CSV"

Rows = list[tuple[int, list[str]]]  # line (row of a sheet) and cells


def split_name(path: str) -> tuple[str, str]:
    """File and sheet of `FILE.xlsx#SHEET`; a file whose own name is the whole text comes first."""
    parts = re.fullmatch(r"(.+\.xls[xm])#(.+)", path, re.IGNORECASE)
    return (path, "") if parts is None or os.path.lexists(path) else (parts[1], parts[2])


def is_workbook(content: bytes) -> bool:
    """True if the bytes are a workbook rather than text."""
    return content.startswith((ZIP, OLD_EXCEL))


def sheet_rows(content: bytes, file: str, sheet: str = "") -> tuple[Rows, str]:
    """Cells of a sheet, with the stored values of formulas; and a remark if there are other sheets.

    Parameters
    ----------
    content, file
        The workbook and its name.
    sheet
        Name of the sheet; "" is the first that is not empty.

    Raises
    ------
    InputError
        Not a workbook that can be read, no such sheet, too large, merged cells, or formulas without a stored value.
    """
    pages = {page.title: page for page in _open(content, file, values=True).worksheets}
    large = next((page for page in pages.values() if page.max_row * page.max_column > LARGEST_CELLS), None)
    if large is not None:
        fault = f"sheet {large.title!r} has {large.max_row} rows and {large.max_column} columns"
        raise InputError(fault, expected=f"at most {LARGEST_CELLS:,} cells", hint=SAVE_AS, file=file)
    filled = [title for title, page in pages.items() if any(v is not None for row in page.values for v in row)]
    if not filled or (sheet and sheet not in filled):
        fault = f"the workbook has no sheet {sheet!r} with cells" if filled else "the workbook is empty"
        raise InputError(fault, expected=f"one of {', '.join(filled)}" if filled else "", file=file)
    chosen = pages[sheet or filled[0]]
    if chosen.merged_cells.ranges:
        merged = ", ".join(sorted(area.coord for area in chosen.merged_cells.ranges))
        raise InputError(f"merged cells {merged}", hint="split them, each cell with its own value", file=file)
    rows = [list(row) for row in chosen.values]
    if any(value is None for row in rows for value in row):
        for row in _open(content, file, values=False)[chosen.title].iter_rows():
            for cell in row:
                if cell.data_type == "f" and rows[cell.row - 1][cell.column - 1] is None:
                    fault = f"cell {cell.coordinate} holds a formula without a stored value"
                    raise InputError(fault, hint="open and save the workbook in Excel once", file=file, line=cell.row)
    others = "" if sheet or len(filled) == 1 else f"sheet {filled[0]!r} is read; {file}#SHEET names another"
    return [(line, [_shown(value) for value in row]) for line, row in enumerate(rows, 1)], others


def _open(content: bytes, file: str, values: bool) -> Any:
    import openpyxl

    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(part.file_size for part in archive.infolist()) > LARGEST_BYTES:
                raise ValueError(f"more than {LARGEST_BYTES / 1e6:.0f} MB unpacked")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it warns of what it drops (validations, pictures), which we do not need
            return openpyxl.load_workbook(io.BytesIO(content), data_only=values)
    except Exception as error:  # a damaged file may raise anything in the library
        reason = str(error.__cause__ or error).partition("\n")[0] or type(error).__name__  # the library's: three lines
        raise InputError(f"a workbook that cannot be read: {reason}", hint=SAVE_AS, file=file) from None


def _shown(value: Any) -> str:
    """A cell as text; dates in ISO form."""
    if value is None:
        return ""
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return value.isoformat() if hasattr(value, "isoformat") else str(value)
