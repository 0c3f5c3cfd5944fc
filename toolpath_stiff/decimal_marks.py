"""Numbers of a table with decimal points: which mark is the decimal one, and a refusal where that cannot be told."""

from __future__ import annotations

import re
from collections.abc import Sequence

from toolpath_stiff.errors import InputErrors, TableError
from toolpath_stiff.grid import SPREADSHEET_ERROR, Rows

PLAIN = re.compile(r"[+-]?\d+(?:e[+-]?\d+)?", re.IGNORECASE)
ONE_MARK = re.compile(r"[+-]?(?:\d+[.,]\d*|[.,]\d+)(?:e[+-]?\d+)?", re.IGNORECASE)
LIKE_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:[.,'’ \u00a0\u202f]\d{3})+(?:[.,]\d*)?")
REMOVE_THEM = "write numbers without thousands separators"


def refuse_spreadsheet_errors(heading: Sequence[str], rows: Rows, file: str) -> None:
    """Raise `InputErrors` with every cell that is an error of the spreadsheet."""
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
    grouped = [cell for cell in cells if THOUSANDS.fullmatch(cell[2]) and not ONE_MARK.fullmatch(cell[2])]
    if grouped:
        raise InputErrors(
            TableError(f"{name} = {text!r} has thousands separators", hint=REMOVE_THEM, file=file, line=line)
            for line, name, text in grouped
        )
    marked = [cell for cell in cells if ONE_MARK.fullmatch(cell[2])]
    commas = [cell for cell in marked if "," in cell[2]]
    points = [cell for cell in marked if "." in cell[2]]
    if commas and points:
        rare, usual = (commas, points) if len(commas) < len(points) else (points, commas)
        (line, name, text), (other_line, other_name, other) = rare[0], usual[0]
        raise TableError(
            f"{name} = {text!r} and {other_name} = {other!r} (line {other_line}) have different decimal marks",
            expected="decimal points, or decimal commas, in the whole file",
            hint=REMOVE_THEM,
            file=file,
            line=line,
        )
    doubtful = commas[:1] if all(LIKE_THOUSANDS.fullmatch(text) for _, _, text in commas) else []
    if separator == ";":  # a column in which only numbers from 1000 up have a point
        whole = {name for _, name, text in cells if PLAIN.fullmatch(text)}
        whole -= {name for _, name, text in points if not LIKE_THOUSANDS.fullmatch(text)}
        doubtful += [cell for cell in points if cell[1] in whole]
    if doubtful:
        line, name, text = doubtful[0]
        raise TableError(
            f"{name} = {text!r} could be {text.replace(',', '.')} or {re.sub('[.,]', '', text)}",
            expected="a number that can be read in one way",
            hint=f"{REMOVE_THEM}, decimals with a point",
            file=file,
            line=line,
        )
    if not commas:
        return rows, False
    pointed = {(line, i) for line, row in rows for i in numbers if i < len(row) and ONE_MARK.fullmatch(row[i])}
    return [(n, [c.replace(",", ".") if (n, i) in pointed else c for i, c in enumerate(row)]) for n, row in rows], True
