"""Mapping of a file's columns to ours: which of them hold what, written by the user.

`strut=hp, date=day_ms:ms, stiffness=stiff_mean:N/um`: ours = theirs, and after a colon the unit, or of dates the form:
ms or s since 1970, or as they are written, DD.MM.YYYY. A heading with commas or colons stands in double quotes; `==3`
is one text for all rows. `FILE.columns.toml` beside a file holds the same, as `stiffness = "stiff_mean:N/um"`.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.column_names import UNITS, Mapped, columns_option, heading_key, parted, same_quantity
from toolpath_stiff.errors import MeasurementError
from toolpath_stiff.tables import Columns, Source, Table, read_table
from toolpath_stiff.toml_reader import TomlReader
from toolpath_stiff.workbooks import split_name

EXAMPLE = "strut=hp, date=day_ms:ms, stiffness=stiff_mean:N/um"
BESIDE = ".columns.toml"
DATE = "date"
ENTRY = re.compile(r"""\s*([\w ]+?)\s*=\s*((?:"[^"]*"|[^",])*?)\s*(?:,|$)""")
THEIRS = re.compile(r"""(?:=\s*(?P<text>.+)|"(?P<quoted>[^"]+)"|(?P<heading>[^":]+?))(?:\s*:\s*(?P<unit>.+))?""")
SINCE_1970 = {"s": 1.0, "ms": 1e-3}
PARTS = {"YYYY": "%Y", "YY": "%y", "MM": "%m", "DD": "%d", "hh": "%H", "mm": "%M", "ss": "%S"}


def mapped_table(path: str, what: str, columns: Columns, mapping: Mapped = None) -> Table:
    """A table with columns renamed by the mapping and by the one kept beside the file; dates in ISO 8601.

    Where both name a column the mapping holds.

    Raises
    ------
    InputError, InputErrors
        As `read_table`; the mapping names what is not there.
    """
    beside = Path(split_name(path)[0] + BESIDE)
    remarks: tuple[str, ...] = ()
    sources: dict[str, Source] = {}
    if beside.is_file():
        sources = sources_of(TomlReader.read(beside, "a mapping of columns", MeasurementError).data, columns)
        remarks = (f"as {beside} says",)
    sources |= sources_of(mapping, columns) if mapping else {}
    table = read_table(path, what, replace(columns, sources=sources))
    form = sources[DATE].unit if DATE in sources else ""
    if form:
        table = _with_dates(table, form)
    return replace(table, remarks=(*table.remarks, *remarks))


def sources_of(mapping: str | Mapping[str, str], columns: Columns) -> dict[str, Source]:
    """Sources of the columns in a mapping. Raises `InputError`."""
    entries = _parsed(mapping) if isinstance(mapping, str) else mapping
    sources: dict[str, Source] = {}
    for ours, theirs in entries.items():
        match = THEIRS.fullmatch(theirs.strip() if isinstance(theirs, str) else f"={theirs}")
        if match is None:
            raise MeasurementError(f"columns: {ours}={theirs}", expected=f"a heading and its unit, as {EXAMPLE}")
        unit = (match["unit"] or "").strip()
        unit = UNITS.get(heading_key(unit), unit)
        known = (*columns.numbers, *columns.texts)
        names = [name for name in known if heading_key(ours) in (heading_key(name), parted(name)[0])]
        if not names:
            short = ", ".join(dict.fromkeys(parted(name)[0] for name in known))
            raise MeasurementError(f"columns: {ours} is no column", expected=f"one of {short}")
        name = next((name for name in names if same_quantity(unit, parted(name)[1])), names[0])
        dated = name == DATE and (unit in SINCE_1970 or "%" in _pattern(unit))
        if unit and not dated and not same_quantity(unit, parted(name)[1]):
            expected = "ms, s, or a form as DD.MM.YYYY" if name == DATE else f"a unit as {parted(name)[1] or 'none'}"
            raise MeasurementError(f"columns: {ours} in {unit!r}", expected=expected)
        sources[name] = Source(match["quoted"] or match["heading"] or "", unit, (match["text"] or "").strip())
    return sources


def _parsed(text: str) -> dict[str, str]:
    entries, end = {}, 0
    while end < len(text):
        match = ENTRY.match(text, end)
        if match is None or not match[2]:
            raise MeasurementError(f"columns {text[end:].strip()!r}", expected=f"entries as {EXAMPLE}")
        entries[match[1]] = match[2]
        end = match.end()
    return entries


def _pattern(form: str) -> str:
    """Form of a date in the syntax of `strptime`."""
    return re.sub("YYYY|YY|MM|DD|hh|mm|ss", lambda part: PARTS[part[0]], form.replace("%", "%%"))


def as_iso(text: str, form: str) -> str:
    """A date of that form in ISO 8601; "" if it is not one."""
    try:
        since = SINCE_1970.get(form)
        moment = datetime.fromtimestamp(float(text) * since, UTC) if since else datetime.strptime(text, _pattern(form))
    except (ValueError, OverflowError, OSError):
        return ""
    return moment.replace(tzinfo=None).isoformat(timespec="seconds").removesuffix("T00:00:00")


def _with_dates(table: Table, form: str) -> Table:
    """Table with dates in ISO 8601. Raises `InputError` for a date not written in this form."""
    place, rows = table.heading.index(DATE), []
    for line, cells in table.rows:
        iso = [as_iso(cell, form) if i == place else cell for i, cell in enumerate(cells)]
        if place < len(cells) and cells[place] and not iso[place]:
            raise MeasurementError(f"date {cells[place]!r}", expected=f"one as {form}", file=table.file, line=line)
        rows.append((line, tuple(iso)))
    return replace(table, rows=tuple(rows), remarks=(*table.remarks, f"dates are written {form}"))


def number_columns(table: Table, names: Sequence[str]) -> FloatArray:
    """(rows, names) numbers of columns; nan for absent columns. Raises `InputError` for cells that are no number."""
    places = [(place, name) for place, name in enumerate(names) if name in table.heading]
    values = np.full((len(table.rows), len(names)), np.nan)
    for row, (line, cells) in enumerate(table.rows):
        record = table.record(cells, line)
        for place, name in places:
            with suppress(ValueError):
                values[row, place] = float(record[name])
            if not np.isfinite(values[row, place]):
                fault = f"{name} = {record[name]!r}"
                raise MeasurementError(fault, expected="a finite number", file=table.file, line=line)
    return values


def unused(table: Table, known: Collection[str]) -> list[str]:
    """Notes, one for each unknown column."""
    return [f"{table.file}: column {name} is not used" for name in table.heading if name and name not in known]


def check_needed(table: Table, needed: Sequence[str], layouts: str) -> None:
    """Raise `InputError`, with the mapping to write, if a column is missing."""
    absent = [name for name in needed if name not in table.heading]
    if absent:
        theirs = ", ".join(name for name in table.heading if name) or "none"
        raise MeasurementError(
            f"column {absent[0]} is missing (found {theirs})",
            expected=layouts,
            hint=f"say which columns they are: {columns_option([f'{parted(name)[0]}=...' for name in absent])}, "
            f"or in {split_name(table.file)[0]}{BESIDE}",
            file=table.file,
            line=table.heading_line,
        )
