"""Strut and date of raw records: what columns, heads and names say of them, in one form for a whole set of files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from toolpath_stiff.errors import InputError, MeasurementError
from toolpath_stiff.readings.dates import Order, dates_in, day_of, finer, read_dates
from toolpath_stiff.readings.rows import DATE, POSITION, with_cells, with_dates
from toolpath_stiff.tables import BETWEEN_COMMAS, Table, split_name

WORDS = ("strut", "leg", "actuator", "limb", "ram", "stab", "bein", "strebe")


_WORD = rf"(?i:(?<![a-z])(?:{'|'.join(WORDS)})[ _:=#-]*(?:(?:no|nr|number)\.?[ _:]*)?[LlSs]?)"


STRUT = re.compile(rf"{_WORD}(0?[0-9](?![0-9.])|[A-F](?![A-Za-z0-9]))")


BARE = re.compile(r"(?:[LlSs][-_ ]?)?0?([0-9])|([A-F])")  # the whole of a cell, of a sheet's or a file's name


IN_NAME = re.compile(r"(?<![A-Za-z0-9])[LlSs]0?([0-9])(?![A-Za-z0-9])|(?<![A-Za-z0-9])([A-F])(?![A-Za-z0-9])")


LETTERS = "ABCDEF"


KEYED_DATE = re.compile(
    r"(?:test |measuring |measurement )?dat(?:e|um)(?: of (?:the )?(?:test|measurement))?|(?:measured|tested)(?: on)?"
    r"|prüfdatum|messdatum|year|jahr|date ?(?:/|and) ?time",
    re.IGNORECASE,
)


SERIAL = re.compile(
    r"(?:(?:strut|leg|actuator) )?(?:serial(?: ?(?:no|nr|number|#)\.?)?|s/n|sn|serien(?:nummer|-?nr\.?))", re.IGNORECASE
)


ORDER_HINT = "say --date-order dmy (day first) or mdy (date_order=), or write the dates as YYYY-MM-DD"


ZERO_BASED, ONE_BASED = "0", "6"


def strut_label(text: str) -> str:
    """The number or letter of a strut that a cell names, as it stands there; "" where it names none."""
    found = STRUT.fullmatch(text.strip())
    if found:
        return found[1].lstrip("0") or "0"
    bare = BARE.fullmatch(text.strip())
    return (bare[1] or bare[2]) if bare else ""


def labelled(table: Table) -> Table:
    """The table with columns strut and date where its head or its name says them of all records.

    Above the heading a word for a strut with its number, and `date` with a value in the next cell or after a colon;
    else the names of the file and its sheet; else the names of its folders, as they were given.

    Raises
    ------
    InputError
        The head and the name, or two lines of the head, say different things.
    """
    if any(name in table.heading for name in POSITION):
        return table
    found, notes = {}, []
    for column, searched in (("strut", _struts), (DATE, _dates)):
        if column in table.heading or (column == "strut" and "loop" in table.heading):
            continue
        places = searched(table)
        values = _distinct([value for value, _ in places], dated=column == DATE)
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
            where = next(where for value, where in places if value == values[0])
            notes.append(f"{table.file}: {column} {values[0]} is taken from {where}")
    if not found:
        return table
    for line, cells in table.rows:
        if len(cells) != len(table.heading):
            raise MeasurementError(
                f"row with {len(cells)} cells",
                expected=f"{len(table.heading)} as in the heading",
                hint=BETWEEN_COMMAS if table.separator == "," and len(cells) > len(table.heading) else "",
                file=table.file,
                line=line,
            )
    rows = tuple((line, (*cells, *found.values())) for line, cells in table.rows)
    return replace(table, heading=(*table.heading, *found), rows=rows, notes=(*table.notes, *notes))


def serial_number(table: Table, line: int) -> str:
    """The serial number that a record's own cells, or else the head, state; "" where neither does."""
    for i, name in enumerate(table.heading):
        if SERIAL.fullmatch(name.replace("_", " ").strip()):
            return next((cells[i].strip() for n, cells in table.rows if n == line and i < len(cells)), "")
    for _, cells in table.above:
        for i, cell in enumerate(cells):
            key, _, value = cell.partition(":")
            if SERIAL.fullmatch(key.replace("_", " ").strip()):
                return value.strip() or next((c.strip() for c in cells[i + 1 :] if c.strip()), "")
    return ""


def replaced(found: Sequence[tuple[str, str, str]]) -> list[str]:
    """Notes where a strut's serial number changes: strut, date and serial number of every record."""
    notes = []
    for strut in sorted({name for name, _, _ in found}):
        own = sorted((day_of(date), date, number) for name, date, number in found if name == strut and number)
        for (_, last, before), (_, first, after) in pairwise(own):
            if before != after:
                notes.append(
                    f"{strut}: serial number {before} until {last or '?'}, {after} from {first or '?'}: another part, "
                    "so that a change between these dates is its replacement"
                )
    return notes


def _distinct(values: list[str], dated: bool) -> list[str]:
    """Different values; of dates that agree the most precise."""
    kept: list[str] = []
    for value in dict.fromkeys(values):
        same = next((k for k, one in enumerate(kept) if dated and _agree(one, value)), None)
        if same is None:
            kept.append(value)
        elif len(_iso(value)) > len(_iso(kept[same])):
            kept[same] = value
    return kept


def _agree(one: str, other: str) -> bool:
    return finer(_iso(one), _iso(other)) is not None


def _iso(text: str) -> str:
    """As ISO 8601, where that can be told of it alone."""
    try:
        return read_dates([text]).of(text)
    except InputError:
        return text


def settled(tables: Sequence[Table], order: Order | None = None) -> list[Table]:
    """Tables of one set, with dates in ISO 8601 and struts by their numbers 1 to 6.

    Raises
    ------
    InputError
        Dates that can be read in two ways; struts numbered both from 0 and to 6.
    """
    dated = with_dates(tables, order, ORDER_HINT)
    at = [(table, table.heading.index("strut")) for table in dated if "strut" in table.heading]
    cells = {cells[i] for table, i in at for _, cells in table.rows if i < len(cells)}
    labels = {cell: strut_label(cell) for cell in cells}
    from_zero = ZERO_BASED in labels.values()
    if from_zero and ONE_BASED in labels.values():
        raise MeasurementError("struts 0 and 6", expected="numbers from 1 to 6, or from 0 to 5", file=at[0][0].file)
    numbers = {cell: _number(label, from_zero) if label else cell for cell, label in labels.items()}
    found, told = [], ""
    if from_zero:
        told = "struts 0 to 5 are read as 1 to 6"
    elif any(label in LETTERS for label in labels.values() if label):
        told = "struts A to F are read as 1 to 6"
    for table in dated:
        found.append(with_cells(table, "strut", numbers, told))
        told = "" if "strut" in table.heading else told
    return found


def _number(label: str, from_zero: bool) -> str:
    if label in LETTERS:
        return str(LETTERS.index(label) + 1)
    return str(int(label) + from_zero)


Places = list[tuple[str, str]]


def _struts(table: Table) -> Places:
    """Label and place of every strut that is named; of folders and short names only where nothing else does."""
    names = _names(table)
    lines = [(" ".join(cells), f"line {line}") for line, cells in table.above]
    found = [(m[1].lstrip("0") or "0", where) for text, where in [*lines, *names] for m in STRUT.finditer(text)]
    if found:
        return found
    found = [(label, where) for text, where in names[::-1] if (label := strut_label(text))][:1]
    short = [(m[1] or m[2], where) for text, where in names for m in IN_NAME.finditer(text)]
    return found or short or [(m[1], where) for text, where in _folders(table) for m in STRUT.finditer(text)][:1]


def _dates(table: Table) -> Places:
    """Text and place of the date of the head; where it has none, of the names; of a title that names a strut."""
    found = keyed_dates(table.above)
    found = found or [(date, where) for text, where in _names(table) for date in dates_in(text)]
    titles = [(" ".join(cells), f"line {line}") for line, cells in table.above]
    found = found or [(date, where) for text, where in titles if STRUT.search(text) for date in dates_in(text)]
    return found or [(date, where) for text, where in _folders(table) for date in dates_in(text)][:1]


def keyed_dates(lines: Sequence[tuple[int, Sequence[str]]]) -> Places:
    """Text and place of the dates that lines of a head state: `Date: 2021-03-04`, or the value in the next cell."""
    found = []
    for line, cells in lines:
        key, _, value = cells[0].partition(":") if ":" in cells[0] else (cells[0], "", "")
        value = value.strip() or next((cell for cell in cells[1:] if cell), "")
        if KEYED_DATE.fullmatch(key.strip()) and value:
            found.append((value, f"line {line}"))
    return found


def _names(table: Table) -> Places:
    file, sheet = split_name(table.file)
    return [(Path(file).stem, "the file's name"), *([(sheet, "the sheet's name")] if sheet else [])]


def _folders(table: Table) -> Places:
    """Names of the two inmost folders, the inmost first."""
    return [(name, "the folder's name") for name in reversed(Path(split_name(table.file)[0]).parts[-3:-1])]
