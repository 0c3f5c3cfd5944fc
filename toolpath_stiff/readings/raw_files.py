"""Files of raw records: folders, sheets of a workbook, text with any mark or spaces between cells, LabVIEW, JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from toolpath_stiff.errors import TableError
from toolpath_stiff.files import decoded, read_bytes
from toolpath_stiff.readings.dates import dates_in
from toolpath_stiff.readings.raw_labels import STRUT, strut_label
from toolpath_stiff.readings.raw_layouts import Rows, Units, is_number, layouts
from toolpath_stiff.tables import (
    SPREADSHEET_ERROR,
    Columns,
    Grid,
    Table,
    grid_table,
    is_workbook,
    read_table,
    sheet_grid,
    sheet_names,
    split_name,
    text_grid,
    typed,
)

READ = (".csv", ".txt", ".dat", ".asc", ".tsv", ".lvm", ".json", ".xlsx", ".xlsm")  # of a folder


OWN_OUTPUT = "_measurements.csv"


COMMENT = re.compile(r"[ \t]*(?:#|%|//)+[ \t]*")


FOREIGN = {
    b"MATLAB": "a MATLAB file", b"\x89HDF": "an HDF5 file (or MATLAB 7.3)", b"TDSm": "a TDMS file",
    b"MDF ": "an MDF file", b"PAR1": "a Parquet file", b"%PDF": "a PDF",
}  # fmt: skip


def raw_tables(names: Sequence[str], columns: Columns, units: Units) -> list[Table]:
    """Tables of raw records of files and folders, every sheet of a workbook, every block of a sheet.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read, or its cells can be read in two ways; a folder without one.
    """
    return [table for name in names for file in _files(name) for table in _file_tables(file, columns, units)]


def _files(name: str) -> list[str]:
    """A file, or those of a folder and the folders in it, in the order of their names."""
    if not Path(name).is_dir():
        return [name]
    found = sorted(p for p in Path(name).rglob("*") if p.suffix.lower() in READ and not p.name.startswith((".", "~")))
    files = [str(path) for path in found if path.is_file() and not path.name.endswith(OWN_OUTPUT)]
    if not files:
        raise TableError("a folder without records", expected=f"files {', '.join(READ)}", file=name)
    return files


def _file_tables(path: str, columns: Columns, units: Units) -> list[Table]:
    workbook, sheet = split_name(path)
    content = read_bytes(workbook, "raw records")
    for start, what in FOREIGN.items():
        if content.startswith(start):
            raise TableError(what, expected="text, JSON or .xlsx", hint="export the channels as CSV", file=path)
    found: list[Table] = []
    if is_workbook(content):
        names = [sheet] if sheet else sheet_names(content, workbook)
        passed = []
        for name in names:
            told = len(names) > 1 or sheet or STRUT.search(name) or dates_in(name) or strut_label(name)
            grid = sheet_grid(content, workbook, name)
            own = layouts(grid, f"{workbook}#{name}" if told else path, columns, units)
            found += own
            passed += [] if own else [name]
        if found and passed:
            notes = (f"{workbook}: no records in the sheets {', '.join(passed)}", *found[0].notes)
            found[0] = replace(found[0], notes=notes)
        return found or [read_table(path, "raw records", columns)]
    text = decoded(content)
    if text.lstrip().startswith(("{", "[")):
        return _json_tables(text, path, columns, units)
    grid, comments = _text_cells(text, path, columns)
    return layouts(grid, path, columns, units, comments) or [_whole(grid, comments, path, columns)]


def _whole(grid: Grid, comments: frozenset[int], path: str, columns: Columns) -> Table:
    """A table of no layout of a bench; its comments are none of it."""
    return grid_table(replace(grid, rows=[row for row in grid.rows if row[0] not in comments]), path, columns)


def _text_cells(text: str, path: str, columns: Columns) -> tuple[Grid, frozenset[int]]:
    """Cells of a text file, and which lines were comments: these without their mark, but no numbers put aside so."""
    lines, comments = text.splitlines(), set()
    for i, line in enumerate(lines):
        mark = COMMENT.match(line)
        if mark and not SPREADSHEET_ERROR.match(line.strip()):
            rest = line[mark.end() :]
            lines[i] = "" if re.match(r"[+-]?[\d.]", rest) else rest.replace('"', "")
            comments.add(i + 1)
    filled = [line for line in lines if line.strip()]
    # A mark in most lines that cannot stand in a number; commas can.
    usual = (mark for mark in ";\t" if sum(mark in line for line in filled) > 0.5 * len(filled))
    declared = re.match(r"\ufeff?sep=", text, re.IGNORECASE)
    separator = "" if declared else next(usual, "")
    grid = _by_spaces(lines) or text_grid("\n".join(lines), path, columns, separator)
    return grid, frozenset(comments)


def _by_spaces(lines: Sequence[str]) -> Grid | None:
    """Cells of a text with columns of a fixed width, or with spaces between them; None of any other."""
    parted = [line.split() for line in lines]
    numbers = [sum(is_number(c.replace(",", ".")) and c[-1] not in ",;" for c in cells) for cells in parted]
    rows = [i for i, n in enumerate(numbers) if n >= 2 and not re.search(r"[;\t]", lines[i].strip())]
    filled = sum(bool(line.strip()) for line in lines)
    if not rows or len(rows) < 0.5 * filled:
        return None
    width = len(parted[rows[0]])
    found: Rows = []
    for i, line in enumerate(lines):
        wide = re.split(r" {2,}|\t", line.strip())
        cells = parted[i] if numbers[i] >= 2 or (len(parted[i]) == width and len(wide) != width) else wide
        if line.strip():
            found.append((i + 1, [typed(cell) for cell in cells]))
    return Grid(found, " ")


def _json_tables(text: str, path: str, columns: Columns, units: Units) -> list[Table]:
    """Records of JSON: lists of them, or columns as lists, at any depth; names above them count as their head."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise TableError(f"no JSON: {error}", file=path) from None
    found: list[Table] = []
    for above, heading, rows in _json_blocks(document, []):
        head = [(0, [line]) for line in above]
        body = [(n, [_json_cell(cell) for cell in row]) for n, row in enumerate(rows, 1)]
        found += layouts(Grid([*head, (0, heading), *body], ""), path, columns, units)
    if not found:
        expected = "records or columns named strut, date, force_N, displacement_um"
        raise TableError("JSON without records", expected=expected, file=path)
    return found


def _json_cell(value: object) -> str:
    return "" if value is None else str(value)


def _json_blocks(value: Any, above: list[str]) -> Iterator[tuple[list[str], list[str], list[list[Any]]]]:
    """Head, heading and rows of every table within a value."""
    if isinstance(value, list):
        if value and all(isinstance(one, dict) and not _holds_more(one) for one in value):
            heading = list(dict.fromkeys(key for one in value for key in one))
            yield above, heading, [[one.get(key) for key in heading] for one in value]
        else:
            for one in value:
                yield from _json_blocks(one, above)
    elif isinstance(value, dict):
        yield from _json_columns(value, above)


def _json_columns(value: dict[str, Any], above: list[str]) -> Iterator[tuple[list[str], list[str], list[list[Any]]]]:
    """The same of an object: lists of one length are the columns of a table."""
    plain = [f"{key}: {one}" for key, one in value.items() if not isinstance(one, dict | list)]
    lists = {k: one for k, one in value.items() if isinstance(one, list) and one and not _holds_more({k: one[0]})}
    if len(lists) > 1 and len({len(one) for one in lists.values()}) == 1:
        yield [*above, *plain], list(lists), [list(row) for row in zip(*lists.values(), strict=True)]
        return
    for key, one in value.items():
        if isinstance(one, dict | list):
            yield from _json_blocks(one, [*above, *plain, _json_head(key)])


def _holds_more(value: Mapping[str, Any]) -> bool:
    return any(isinstance(one, dict | list) for one in value.values())


def _json_head(key: str) -> str:
    """The name of a part as a line of a head."""
    if strut_label(key) and not STRUT.search(key):
        return f"strut {strut_label(key)}"
    return f"date: {key}" if dates_in(key) else key
