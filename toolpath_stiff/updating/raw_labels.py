"""Files of one strut and one date: what their head or their name says of all records."""

from __future__ import annotations

import re
from pathlib import Path

from toolpath_stiff.errors import MeasurementError
from toolpath_stiff.tables import Table, split_name
from toolpath_stiff.updating.rows import DATE, POSITION

STRUT = re.compile(r"(?<![a-z])strut[ _:=#-]*(?:no\.?[ _]*)?([1-9])(?![0-9])", re.IGNORECASE)
NAMED_DATE = re.compile(r"(?<![0-9])[0-9]{4}-[0-9]{2}-[0-9]{2}(?![0-9])")
KEYED_DATE = re.compile(r"(?:test |measuring )?date", re.IGNORECASE)


def told_of_all(table: Table) -> tuple[dict[str, str], list[str]]:
    """Strut and date of a file whose heading has neither, and notes that say where they stand.

    Above the heading `strut` with a number, and `date` with a value in the next cell or after a colon; else the names
    of the file and its sheet.

    Raises
    ------
    InputError
        The head and the name, or two lines of the head, say different things.
    """
    if "loop" in table.heading or any(name in table.heading for name in POSITION):
        return {}, []
    found, notes = {}, []
    for column, searched in (("strut", _struts), (DATE, _dates)):
        if column in table.heading:
            continue
        places = searched(table)
        values = list(dict.fromkeys(value for value, _ in places))
        if len(values) > 1:
            said = " and ".join(f"{value!r} ({where})" for value, where in places)
            raise MeasurementError(
                f"{column}: {said}",
                expected=f"one {column} a file, or a column {column}",
                file=table.file,
                line=table.heading_line,
            )
        if values:
            found[column] = values[0]
            notes.append(f"{table.file}: {column} {values[0]} is taken from {places[0][1]}")
    return found, notes


def _struts(table: Table) -> list[tuple[str, str]]:
    """Number and place of every strut that is named."""
    lines = [(" ".join(cells), f"line {line}") for line, cells in table.above]
    return [(match[1], where) for text, where in [*lines, *_names(table)] for match in STRUT.finditer(text)]


def _dates(table: Table) -> list[tuple[str, str]]:
    """Text and place of the date of the head; where it has none, of the names."""
    found = []
    for line, cells in table.above:
        key, _, value = cells[0].partition(":") if ":" in cells[0] else (cells[0], "", " ".join(cells[1:2]))
        if KEYED_DATE.fullmatch(key.strip()) and (value or "".join(cells[1:2])).strip():
            found.append(((value or cells[1]).strip(), f"line {line}"))
    return found or [(match[0], where) for text, where in _names(table) for match in NAMED_DATE.finditer(text)]


def _names(table: Table) -> list[tuple[str, str]]:
    file, sheet = split_name(table.file)
    return [(Path(file).stem, "the file's name"), *([(sheet, "the sheet's name")] if sheet else [])]
