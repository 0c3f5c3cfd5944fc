"""Which columns of a file hold what, where it calls them otherwise: the mapping that one writes, or is asked to write.

`strut=hp, date=day_ms:ms, stiffness=stiff_mean:N/um`: ours = theirs, and after a colon the unit, or of dates the form:
ms or s since 1970, or as they are written, DD.MM.YYYY. A heading with commas or colons stands in double quotes; `==3`
is one text for all rows. `FILE.columns.toml` beside a file holds the same, as `stiffness = "stiff_mean:N/um"`.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from toolpath_stiff.column_names import UNITS, Mapped, heading_key, keys, parted, same_quantity, unit_of
from toolpath_stiff.errors import MeasurementError
from toolpath_stiff.readings.dates import EXPECTED, is_date
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
# Columns that are told by their cells.
HELD = {"strut": re.compile("[1-6]"), "direction": re.compile("[+-]?[XYZxyz]"), DATE: re.compile(".+")}
NUMBER = re.compile(r"[+-]?[\d.]+(e[+-]?\d+)?", re.IGNORECASE)
ABSENT = {  # column -> what is said where it is missing, and what is expected
    "direction": ("no direction", "direction, or dx,dy,dz"),
    "stiffness_N_per_mm": ("no measured stiffness", "stiffness_N_per_mm, or force_N with displacement_um"),
}
YEAR, ALIKE = 4, 0.5  # letters of a year alone; likeness of two names that counts
LIKE_MS = re.compile(r"\d{12,13}")  # from 1973 on
FORMS = ("DD.MM.YYYY", "DD.MM.YYYY hh:mm", "YYYYMMDD", "YYYY/MM/DD", "DD/MM/YYYY", "MM/DD/YYYY", "DD.MM.YY", "ms")


def mapped_table(path: str, what: str, columns: Columns, mapping: Mapped = None) -> Table:
    """A table, its columns named by the mapping, or by the one that is kept beside the file; dates in ISO 8601.

    Raises
    ------
    InputError, InputErrors
        As `read_table`; the mapping names what is not there.
    """
    beside = Path(split_name(path)[0] + BESIDE)
    remark = []
    if mapping is None and beside.is_file():
        mapping, remark = TomlReader.read(beside, "a mapping of columns", MeasurementError).data, [f"as {beside} says"]
    sources = sources_of(mapping, columns) if mapping else {}
    table = read_table(path, what, replace(columns, sources=sources, mappable=True))
    return _with_dates(replace(table, remarks=(*table.remarks, *remark)))


def sources_of(mapping: str | Mapping[str, str], columns: Columns) -> dict[str, Source]:
    """Where the columns of a mapping come from. Raises `InputError`."""
    entries = _parsed(mapping) if isinstance(mapping, str) else mapping
    known = keys((*columns.numbers, *columns.texts))
    sources: dict[str, Source] = {}
    for ours, theirs in entries.items():
        match = THEIRS.fullmatch(theirs.strip() if isinstance(theirs, str) else f"={theirs}")
        if match is None:
            raise MeasurementError(f"columns: {ours}={theirs}", expected=f"a heading and its unit, as {EXAMPLE}")
        unit = (match["unit"] or "").strip()
        unit = UNITS.get(heading_key(unit), unit)
        names = [name for key, name in known.items() if heading_key(ours) in (key, parted(key)[0])]
        name = next((name for name in names if same_quantity(unit, unit_of(name))), names[0] if names else None)
        if name is None:
            short = ", ".join(dict.fromkeys(parted(key)[0] for key in known))
            raise MeasurementError(f"columns: {ours} is no column", expected=f"one of {short}")
        if unit and name != DATE and not same_quantity(unit, unit_of(name)):
            raise MeasurementError(f"columns: {ours} in {unit!r}", expected=f"a unit as {unit_of(name) or 'none'}")
        if unit and name == DATE and unit not in SINCE_1970 and "%" not in _pattern(unit):
            raise MeasurementError(f"columns: {ours} as {unit!r}", expected="ms, s, or a form as DD.MM.YYYY")
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
    """The form of a date as `strptime` has it."""
    return re.sub("YYYY|YY|MM|DD|hh|mm|ss", lambda part: PARTS[part[0]], form.replace("%", "%%"))


def as_iso(text: str, form: str) -> str:
    """A date of that form in ISO 8601; "" where it is none."""
    try:
        if form in SINCE_1970:
            moment = datetime.fromtimestamp(float(text) * SINCE_1970[form], UTC).replace(tzinfo=None)
        else:
            moment = datetime.strptime(text, _pattern(form))
    except (ValueError, OverflowError, OSError):
        return ""
    if "DD" not in form and form not in SINCE_1970:
        return moment.strftime("%Y-%m" if "MM" in form else "%Y")
    whole = (moment.hour, moment.minute, moment.second) == (0, 0, 0)
    return moment.date().isoformat() if whole else moment.isoformat(timespec="seconds")


def _with_dates(table: Table) -> Table:
    """The table with dates in ISO 8601, where the mapping says how they are written."""
    if DATE not in table.heading[: len(table.heading) - len(table.texts)]:
        return table
    place = table.heading.index(DATE)
    form = table.sources[DATE].unit if DATE in table.sources else ""
    if not form:
        _refuse_other_form(table, [cells[place] for _, cells in table.rows if place < len(cells) and cells[place]])
        return table
    rows = []
    for line, cells in table.rows:
        text = cells[place] if place < len(cells) else ""
        iso = as_iso(text, form)
        if text and not iso:
            raise MeasurementError(f"date {text!r}", expected=f"one as {form}", file=table.file, line=line)
        rows.append((line, (*cells[:place], iso, *cells[place + 1 :]) if text else cells))
    return replace(table, rows=tuple(rows), remarks=(*table.remarks, f"dates are written {form}"))


def _refuse_other_form(table: Table, cells: Sequence[str]) -> None:
    """Raise `InputError` where all dates are written in a form that a mapping can say."""
    forms = _forms(cells)
    if not forms or all(is_date(cell) for cell in cells):
        return
    foreign_date = next(cell for cell in cells if not is_date(cell))
    heading = table.sources[DATE].heading if DATE in table.sources else DATE
    sources = {**table.sources, DATE: Source(heading, forms[0])}
    doubt = f"{' or '.join(forms)}? " if len(forms) > 1 else ""
    raise MeasurementError(
        f"date {foreign_date!r}",
        expected=EXPECTED,
        hint=doubt + to_write(replace(table, sources=sources), ()),
        file=table.file,
        line=table.heading_line,
    )


def to_write(table: Table, needed: Sequence[str]) -> str:
    """The mapping to write, filled with the file's own headings, as a hint says it.

    Columns that are still needed get the unused heading that fits best by what its cells hold, its unit and its name: a
    proposal, to be looked at before it is used.
    """
    entries = {name: _entry(name, source) for name, source in table.sources.items()}
    entries |= {doubt.name: _entry(doubt.name, Source(doubt.heading, doubt.unit)) for doubt in table.doubts}
    used = {*needed, *entries, *(doubt.heading for doubt in table.doubts)}
    free = {
        heading: [cells[i] for _, cells in table.rows if i < len(cells) and cells[i]]
        for i, heading in enumerate(table.heading)
        if heading and heading not in used
    }
    known_by_cells = [name for name in HELD if name in (DATE, *needed)]
    lacking = [name for name in (*known_by_cells, *needed) if name not in (*entries, *table.heading)]
    for name in dict.fromkeys(lacking):
        fits = {heading: _fit(name, heading, cells) for heading, cells in free.items()}
        heading = max(fits, key=lambda heading: fits[heading], default="")
        if heading and (fits[heading][0] or name != DATE):
            entries[name] = _entry(name, Source(heading, _unit(table, name, heading, free.pop(heading))))
    entries |= {name: f"{_short(name)}=?" for name in needed if name not in (*entries, *table.heading)}
    ordered = [entries[name] for name in dict.fromkeys((*needed, *entries)) if name in entries]
    text = ", ".join(ordered)
    quoted = f"'{text}'" if '"' in text else f'"{text}"'
    return f"say which columns they are: --columns {quoted} (columns=), or in {split_name(table.file)[0]}{BESIDE}"


def _short(name: str) -> str:
    return parted(heading_key(name))[0]


def _entry(name: str, source: Source) -> str:
    heading = f'"{source.heading}"' if re.search(r'[,:="]|^\s|\s$', source.heading) else source.heading
    theirs = heading if source.heading else f"={source.text}"
    return f"{_short(name)}={theirs}" + (f":{source.unit}" if source.unit else "")


def _fit(name: str, heading: str, cells: Sequence[str]) -> tuple[bool, bool, float]:
    """How well a heading fits a column: by its cells, its unit, its name."""
    key, short = heading_key(heading), _short(name)
    likeness = difflib.SequenceMatcher(None, parted(key)[0], short).ratio()
    if name == DATE:
        dated = all(is_date(cell) for cell in cells) and (
            len(min(cells, key=len, default="")) > YEAR or likeness > ALIKE
        )
        return bool(cells) and (dated or bool(_forms(cells))), False, likeness
    form = HELD.get(name, NUMBER)
    return (
        all(map(form.fullmatch, cells)),
        same_quantity(unit_of(heading), unit_of(name)),
        likeness * (likeness > ALIKE),
    )


def _unit(table: Table, name: str, heading: str, cells: Sequence[str]) -> str:
    """The unit that stands below or in a heading, else the column's own; of dates their form."""
    if name == DATE:
        return "" if all(is_date(cell) for cell in cells) else next(iter(_forms(cells)), "")
    default, units = unit_of(name), (table.units.get(heading, ""), unit_of(heading))
    return next((unit for unit in units if same_quantity(unit, default)), default)


def _forms(cells: Sequence[str]) -> list[str]:
    """How all dates of a column may be written; none where no form is known."""
    likely = [form for form in FORMS if form != "ms" or all(LIKE_MS.fullmatch(cell) for cell in cells)]
    return [form for form in likely if cells and all(is_date(as_iso(cell, form)) for cell in cells)]


def check_heading(table: Table, known: Sequence[str], needed: Sequence[str], layouts: str = "") -> None:
    """Raise `InputError` at the first thing that is wrong: a unit, a name there twice or almost right, or missing."""
    heading, place = table.heading, {"file": table.file, "line": table.heading_line}
    fault, expected, hint, long = "", "", "", [name for name in known if len(name) > 2]
    if table.doubts:
        fault, expected = table.doubts[0].fault, table.doubts[0].name
        hint = f"did you mean {expected}? "
    for name in filter(None, () if fault else heading):
        if heading.count(name) > 1:
            raise MeasurementError(f"column {name} stands twice", **place)  # type: ignore[arg-type]
        near = difflib.get_close_matches(name, long, n=1, cutoff=0.75)
        if name not in known and near and near[0] not in heading:
            hint = f"did you mean {near[0]}? Otherwise give it another name"
            raise MeasurementError(f"unknown column {name!r}", hint=hint, **place)  # type: ignore[arg-type]
    absent = next((name for name in needed if name not in heading), "")
    if absent and not fault:
        fault, expected = ABSENT.get(absent, (f"column {absent} is missing", ""))
    if fault:
        hint += to_write(table, needed)
        raise MeasurementError(fault, expected=layouts or expected, hint=hint, **place)  # type: ignore[arg-type]
    if "direction" in heading and "dx" in heading:
        raise MeasurementError("two directions", expected="direction, or dx,dy,dz", **place)  # type: ignore[arg-type]
