"""Tables that users supply: one heading, then one row per line; known columns by name, numbers with a decimal point.

Text with commas, semicolons or tabs between the cells, or a sheet of an Excel workbook. The heading is the first line
that is neither empty nor a comment; where a mapping names columns, the first that has them all: what instruments write
above it is passed over. A row of units may follow. Between semicolons and tabs numbers may have decimal commas. Columns
of other names or in other units are read where a mapping says which they are.
"""

import csv
import difflib
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import NamedTuple

from toolpath_stiff.column_names import UNITS, columns_option, converted, heading_key, parted, same_quantity
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import decoded, read_bytes
from toolpath_stiff.workbooks import Rows, is_workbook, sheet_rows, split_name

SEPARATORS = ",;\t"
ALIKE = 0.75  # similarity of two names from which one may be a typing slip of the other
SPREADSHEET_ERROR = re.compile(r"#[A-ZÄÖÜ][A-ZÄÖÜ0-9/_]*[!?]|#N/?[AV]")
MARKED = re.compile(r"[+-]?(?:\d+[.,]\d*|[.,]\d+)(?:e[+-]?\d+)?", re.IGNORECASE)
NUMBER = re.compile(r"[+-]?[\d.,]+(?:e[+-]?\d+)?", re.IGNORECASE)
LIKE_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")


class Source(NamedTuple):
    """Origin of a column's cells as a mapping states it: a heading of the file, or one text for all rows."""

    heading: str = ""
    unit: str = ""  # or form, of dates; "" where the mapping leaves it to the heading
    text: str = ""


@dataclass(frozen=True)
class Columns:
    """Columns that a kind of table may have: number columns, named with their units, and text columns.

    `sources`: of those that the file calls otherwise; None of a kind of table that takes no mapping.
    """

    numbers: tuple[str, ...]
    texts: tuple[str, ...] = ()
    sources: Mapping[str, Source] | None = None


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
    remarks
        What was read differently from how it is written, in words.
    constants
        Columns that hold one text in all rows; the last ones of the heading.
    """

    file: str
    heading: tuple[str, ...]
    heading_line: int
    rows: tuple[tuple[int, tuple[str, ...]], ...]
    remarks: tuple[str, ...] = ()
    constants: Mapping[str, str] = field(default_factory=dict)

    @property
    def notes(self) -> tuple[str, ...]:
        """One line on cells read differently from how they are written; empty if there are none."""
        return (f"{self.file}: {'; '.join(self.remarks)}",) if self.remarks else ()

    def record(self, cells: Sequence[str], line: int | None = None) -> dict[str, str]:
        """Column -> cell of one row, at that line. Raises `InputError` if the row has too few or too many cells."""
        written = len(self.heading) - len(self.constants)
        if len(cells) != written:
            hint = "a decimal comma between commas? Write semicolons between the cells" if len(cells) > written else ""
            found = f"row with {len(cells)} cell{'s' * (len(cells) != 1)}"
            raise InputError(found, expected=f"{written} as in the heading", hint=hint, file=self.file, line=line)
        return {**dict(zip(self.heading, cells, strict=False)), **self.constants}


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
    InputError
        The file cannot be read, is empty, or its cells can be read in two ways; with line and column.
    """
    workbook, sheet = split_name(path)
    content = read_bytes(workbook, what)
    if is_workbook(content):
        rows, remark = sheet_rows(content, workbook, sheet)
        return _table(rows, path, columns, "", [remark] * bool(remark))
    if sheet:
        raise InputError(f"{workbook!r} is not an Excel workbook and has no sheets", file=path)
    return parse_table(decoded(content), path, columns)


def parse_table(text: str, file: str, columns: Columns) -> Table:
    """Parse a table from the text of a file; as `read_table`."""
    if "\0" in text:
        raise InputError("neither text nor an Excel workbook", hint="export it as CSV", file=file)
    lines = (re.sub('"[^"]*"', "quoted", line) for line in io.StringIO(text, newline=None))
    filled = (line for line in lines if line.strip(" ,;\t\n") and not line.startswith("#"))
    first, named = next(filled, ""), _mapped(columns)
    first = next((line for line in chain([first], filled) if all(name in line for name in named)), first)
    separator = max(SEPARATORS, key=first.count)
    reader = csv.reader(io.StringIO(text, newline=None), delimiter=separator)
    try:
        return _table([(reader.line_num, cells) for cells in reader], file, columns, separator, [])
    except csv.Error as error:  # a quote that never ends, say
        raise InputError(f"not a CSV file: {error}", file=file, line=reader.line_num) from None


def _table(rows: Rows, file: str, columns: Columns, separator: str, remarks: list[str]) -> Table:
    rows = [(line, [_stripped(cell) for cell in cells]) for line, cells in rows]
    # A row that begins like a comment may begin with an error of the spreadsheet.
    rows = [(n, row) for n, row in rows if any(row) and (row[0][:1] != "#" or SPREADSHEET_ERROR.fullmatch(row[0]))]
    if not rows:
        raise InputError("the file is empty", expected="a heading and rows below it", file=file)
    named = _mapped(columns)
    start = next((i for i, (_, row) in enumerate(rows) if named.keys() <= set(row)), 0)
    if start:
        remarks.append(f"{start} lines above the heading are skipped")
    (line, written), *body = rows[start:]
    while not written[-1]:
        written.pop()
    full = written  # with the units below
    # A row that is longer than the heading is refused as any other.
    if body and len(stated := _fitted(body[0][1], len(written), pad=True)) == len(written) and _are_units(stated):
        (below, _), *body = body
        for cell, unit in zip(written, stated, strict=True):
            wanted = parted(name := named.get(cell, ""))[1]
            if wanted and heading_key(unit) not in {"", *UNITS} and not (columns.sources or {})[name].unit:
                hint = f"say in the mapping what it is: {name}={cell}:{wanted}"
                raise InputError(f"unit {unit!r} of {cell!r}", expected=wanted, hint=hint, file=file, line=below)
        remarks.append(f"line {below} is a row of units")
        full = [f"{cell} [{unit}]" for cell, unit in zip(written, stated, strict=True)]
    heading = _named(written, full, columns, file, line)
    units = {i: pair for i, cell in enumerate(written) if (pair := _units(cell, full[i], heading[i], columns))}
    # Instruments leave a last column of remarks out where it is empty.
    least = (
        0 if not separator else max((i + 1 for i, name in enumerate(heading) if not named or name in named.values()))
    )
    body = [(n, _fitted(row, len(heading), len(row) >= least)) for n, row in body]
    numbers = [i for i, name in enumerate(heading) if name not in columns.texts]
    if separator in ";\t" and separator and _has_commas(heading, body, numbers, file):
        remarks.append("numbers are read with decimal commas")
        body = [(n, [c.replace(",", ".") if i in numbers else c for i, c in enumerate(row)]) for n, row in body]
    body = [(n, [converted(c, *units[i]) if i in units else c for i, c in enumerate(row)]) for n, row in body]
    constants = {name: source.text for name, source in (columns.sources or {}).items() if not source.heading}
    read = [
        f"{name} from {old!r}" + (f" in {units[i][0]}" if i in units else "")
        for i, (old, name) in enumerate(zip(written, heading, strict=True))
        if old != name
    ] + [f"{name} = {text}" for name, text in constants.items()]
    if read:
        remarks.insert(0, f"read {', '.join(read)}")
    table_rows = tuple((n, tuple(row)) for n, row in body)
    return Table(file, (*heading, *constants), line, table_rows, tuple(remarks), constants)


def _stripped(cell: str) -> str:
    """A cell without surrounding space, and with a typographic minus replaced by the keyboard's.

    The apostrophe that keeps spreadsheets from running a word (`column_files.csv_text`) is no part of the word.
    """
    text = cell.strip().replace("\u2212", "-")
    return text[1:] if text[:2] in ("'=", "'+", "'-", "'@") else text


def _are_units(cells: Sequence[str]) -> bool:
    """True if the cells below a heading are units: at least one is known, and none is a number."""
    return not any(map(NUMBER.fullmatch, cells)) and any(heading_key(cell) in UNITS for cell in cells)


def _fitted(cells: list[str], width: int, pad: bool) -> list[str]:
    """A row without empty cells beyond the heading; with `pad`, filled up to the heading's length."""
    while len(cells) > width and not cells[-1]:
        cells = cells[:-1]
    return cells + [""] * (width - len(cells)) if pad else cells


def _mapped(columns: Columns) -> dict[str, str]:
    """Heading -> the column that the mapping assigns to it."""
    return {source.heading: name for name, source in (columns.sources or {}).items() if source.heading}


def _named(written: Sequence[str], full: Sequence[str], columns: Columns, file: str, line: int) -> list[str]:
    """Names of the headings (`full`: with their units); unknown ones stay unchanged.

    Raises `InputError`.
    """
    sources, mapped = columns.sources or {}, _mapped(columns)
    known = {heading_key(name): name for name in (*columns.numbers, *columns.texts)}
    heading = [mapped.get(cell) or known.get(heading_key(text), cell) for cell, text in zip(written, full, strict=True)]
    for cell in mapped:
        if cell not in written:
            shown = ", ".join(repr(cell) for cell in written if cell)
            raise InputError(f"no column {cell!r}", expected=f"one of {shown}", file=file, line=line)
    absent = [name for name in known.values() if name not in (*heading, *sources)]
    for name in heading:
        if name and heading.count(name) > 1:
            raise InputError(f"column {name} stands twice", file=file, line=line)
    slips = {name: meant for name in heading if name not in known.values() and (meant := _meant(name, absent))}
    if slips:
        name, meant = next(iter(slips.items()))
        hint = f"did you mean {meant}? Otherwise give it another name"
        if columns.sources is not None:
            pairs = [(theirs, parted(full[heading.index(theirs)])[1], *parted(of)) for theirs, of in slips.items()]
            entries = [f"{name}={cell}:{unit if same_quantity(unit, own) else own}" for cell, unit, name, own in pairs]
            hint += f", or say its unit: {columns_option(entries)}"
        raise InputError(f"column {name!r}", expected=meant, hint=hint, file=file, line=line)
    return heading


def _units(written: str, full: str, name: str, columns: Columns) -> tuple[str, str] | None:
    """Unit of a mapped column (`full`: heading and unit), and the unit it needs; None if they are equal."""
    source, unit = (columns.sources or {}).get(name), parted(name)[1]
    if source is None or source.heading != written:
        return None
    stated = next((stated for stated in (source.unit, parted(full)[1]) if same_quantity(stated, unit)), unit)
    return None if stated == unit else (stated, unit)


def _meant(cell: str, absent: Sequence[str]) -> str:
    """Absent column that a heading seems to mean (in another unit, in none, or misspelt); "" if none."""
    near = difflib.get_close_matches(heading_key(cell), [heading_key(n) for n in absent if len(n) > 2], 1, ALIKE)
    quantity = parted(cell)[0]
    alike = [name for name in absent if parted(name)[1] and parted(name)[0] == quantity]
    return next(iter(alike + [name for name in absent if heading_key(name) in near]), "")


def _has_commas(heading: Sequence[str], rows: Rows, numbers: Sequence[int], file: str) -> bool:
    """True if numbers have decimal commas. Raises `InputError` if they can be read in two ways."""
    cells = [(line, heading[i], row[i]) for line, row in rows for i in numbers if i < len(row)]
    marked = [cell for cell in cells if MARKED.fullmatch(cell[2])]
    commas = ["," in text for _, _, text in marked]
    if not marked:
        return False
    if all(LIKE_THOUSANDS.fullmatch(text) for _, _, text in marked) or len(set(commas)) == 2:
        line, name, text = marked[commas.index(not commas[0]) if len(set(commas)) == 2 else 0]
        raise InputError(
            f"{name} = {text!r} could be {text.replace(',', '.')} or {re.sub('[.,]', '', text)}",
            expected="decimal commas in the whole file, or decimal points, and no thousands separators",
            file=file,
            line=line,
        )
    return commas[0]
