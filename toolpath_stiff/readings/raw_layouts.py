"""Layouts of bench records: struts or dates side by side, heads of several rows, blocks one below the other.

Cells are only rearranged, to one table a block with the columns strut, date, force, displacement (or stiffness); units,
decimal marks and numbers are read afterwards as of every table (`tables`). What has no layout of a bench, as the jogged
loops of a machine, is left as it is.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from functools import cached_property
from typing import NamedTuple

from toolpath_stiff.errors import TableError
from toolpath_stiff.readings.dates import REDUCED, like_date, read_dates
from toolpath_stiff.readings.raw_labels import BARE, KEYED_DATE, STRUT, WORDS, keyed_dates, strut_label
from toolpath_stiff.readings.rows import DATE
from toolpath_stiff.tables import (
    FORCES,
    LENGTHS,
    SPREADSHEET_ERROR,
    STIFFNESSES,
    Columns,
    Grid,
    Table,
    grid_table,
    heading_key,
)

QUANTITIES = {
    **dict.fromkeys(("force", "forces", "load", "loads", "f", "kraft", "last"), "force"),
    **dict.fromkeys(
        ("displacement", "disp", "displ", "d", "u", "dl", "deflection", "extension", "elongation", "stretch", "lvdt",
         "deformation", "weg", "verschiebung", "verformung", "indicator", "dial"), "displacement",
    ),
    **dict.fromkeys(("stiffness", "k", "steifigkeit"), "stiffness"),
    **dict.fromkeys(("date", "datum", "year", "jahr", "datetime"), DATE),
    **dict.fromkeys(("time", "zeit", "timestamp", "t", "elapsed"), "time"),
}  # fmt: skip


FILLERS = frozenset(
    ("no", "nr", "number", "of", "the", "cell", "gauge", "sensor", "probe", "channel", "ch", "value", "axial", "in",
     "measured", "reading", "test", "mean", "average", "measuring", "measurement", "id", "applied", "delta", "l")
)  # fmt: skip


UNIT_WORDS = {
    **dict.fromkeys(FORCES, "force"), **dict.fromkeys(LENGTHS, "displacement"),
    **dict.fromkeys(STIFFNESSES, "stiffness"),
}  # fmt: skip


RAW_UNITS = frozenset(("v", "mv", "volt", "volts", "counts", "count", "bits", "bit", "digits", "adc", "lsb"))


TIMES = frozenset(("s", "min", "h"))


OWN_UNIT = {"force": "n", "displacement": "um", "stiffness": "n_per_mm"}


NAMES = {"force": "force_N", "displacement": "displacement_um", "stiffness": "stiffness_N_per_mm"}


CARRIED = ("setup", "clamp", "repeat", "point", "length_mm", "temperature_C", "strut_force_N")


DEEPEST = 3  # rows of a heading: struts, quantities, units


LOOKED_AT = 80  # rows among which the heading is searched


MISSING = ("", "-", "--", "---", "nan", "n/a", "na", "null", "none", "#n/a")  # what is written for a lost reading


NUMBER = re.compile(r"[+-]?(?:\d[\d.,'’ \u00a0\u202f]*|[.,]\d+)(?:e[+-]?\d+)?", re.IGNORECASE)


TARE = re.compile(r"tare|tara|zero|zeroing|null|nullung|nullpunkt", re.IGNORECASE)


DATED = re.compile(r"(?<!\d)(?:\d{4}-\d{2}(?:-\d{2})?(?:T00:00:00)?|\d{1,2}\.\d{1,2}\.\d{4}|(?:19|20)\d{2})(?!\d)")


FEWEST_CELLS = 3  # of a row of dates that are headings


ALL_STRUTS = 6


Rows = list[tuple[int, list[str]]]


Units = Mapping[str, str]  # quantity -> unit of headings that state none


class Head(NamedTuple):
    """What a heading says: quantity, strut, date and unit, each "" if it does not; `worded` of a strut by its word."""

    quantity: str = ""
    strut: str = ""
    date: str = ""
    unit: str = ""
    worded: bool = False

    @property
    def group(self) -> tuple[str, str]:
        """Whose the column is."""
        return self.strut, self.date


@dataclass(frozen=True)
class _Layout:
    """Columns of a table by what they hold.

    Attributes
    ----------
    line
        Of the first row of the heading.
    start, stop
        Rows of the heading.
    heads, texts
        One a column: what it says, and its text.
    groups
        (strut, date) -> quantity -> columns.
    shared
        Quantity -> columns that hold for all groups.
    """

    line: int
    start: int
    stop: int
    heads: tuple[Head, ...]
    texts: tuple[str, ...]
    groups: Mapping[tuple[str, str], Mapping[str, list[int]]]
    shared: Mapping[str, list[int]]

    @cached_property
    def data(self) -> list[int]:
        """Columns of forces, displacements, stiffnesses."""
        return [i for i, head in enumerate(self.heads) if head.quantity in OWN_UNIT]

    def readings(self, cells: Sequence[str]) -> list[str]:
        """Cells of these columns of a row that may be short."""
        return [cells[i] for i in self.data if i < len(cells)]


def head_of(text: str) -> Head | None:
    """What a heading, or several one below the other, say; None where a word is not known.

    Examples
    --------
    >>> head_of("Strut 1 force [kN]")
    Head(quantity='force', strut='1', date='', unit='kn', worded=True)
    >>> head_of("d4/mm")
    Head(quantity='displacement', strut='4', date='', unit='mm', worded=False)
    """
    text = " ".join(text.split())
    if like_date(text) or re.fullmatch(r"(?:19|20)\d{2}(?:-\d{2})?", text):
        return Head(date=text)
    if KEYED_DATE.fullmatch(text):
        return Head(quantity=DATE)
    label = "" if text == "F" else strut_label(text)  # the force, unless other letters stand beside it
    if label:
        return Head(strut=label, worded=bool(STRUT.fullmatch(text)))
    tokens = [part for token in heading_key(text).split("_") for part in _parted(token)]
    return _of_tokens(tokens) if tokens else None


def _parted(token: str) -> list[str]:
    """`f1` is the force of strut 1."""
    match = re.fullmatch(r"([a-z]+)0?(\d)", token)
    return [match[1], match[2]] if match else [token]


def _of_tokens(tokens: list[str]) -> Head | None:
    found: dict[str, str] = {"quantity": "", "strut": "", "date": "", "unit": ""}
    worded, i = False, 0
    while i < len(tokens):
        token, rest = tokens[i], tokens[i + 1 :]
        unit, length = _unit_at(tokens, i, bool(found["quantity"] or found["strut"]))
        if token in WORDS or (token in ("l", "s") and rest and re.fullmatch(r"\d", rest[0])):
            rest = [one for one in rest if one not in ("no", "nr", "number")]
            if rest and re.fullmatch(r"\d|[a-f]", rest[0]) and not _is_quantity(rest):
                found["strut"], worded = rest[0].upper(), True
                i = len(tokens) - len(rest) + 1
                continue
            found["quantity"] = found["quantity"] or "strut"
        elif unit:
            found["unit"] = found["unit"] or unit
            i += length
            continue
        elif not _taken(token, found):
            return None
        i += 1
    return Head(**found, worded=worded)


def _taken(token: str, found: dict[str, str]) -> bool:
    """Whether a word of a heading is understood on its own; what it tells is put into `found`."""
    if token in QUANTITIES and (not found["quantity"] or found["quantity"] == "strut" or len(token) > 1):
        if found["quantity"] in ("", "strut"):
            found["quantity"] = QUANTITIES[token]
    elif re.fullmatch(r"\d|[a-f]", token) and (found["quantity"] or found["strut"]):
        found["strut"] = found["strut"] or token.upper()
    elif re.fullmatch(r"(?:19|20)\d{2}", token):
        found["date"] = token
    elif token in RAW_UNITS:
        found["unit"] = token
    else:
        return token in FILLERS or token in TIMES or token == "per"
    return True


def _is_quantity(tokens: list[str]) -> bool:
    """Whether the letter after a word for a strut is its f or d rather than strut D or F."""
    return tokens[0] in QUANTITIES and not any(token in QUANTITIES for token in tokens[1:])


def _unit_at(tokens: list[str], at: int, known: bool) -> tuple[str, int]:
    """The unit that begins at a token, and of how many; a letter alone is one only after what it is the unit of."""
    for length in (3, 1):
        unit = "_".join(tokens[at : at + length])
        if unit in UNIT_WORDS and (known or len(unit) > 1):
            # "Kraft in N": a preposition, where another unit follows.
            if unit == "in" and at + 1 < len(tokens) and tokens[at + 1] in UNIT_WORDS:
                return "", 0
            return unit, length
    return "", 0


def _layout_at(rows: Rows, start: int, units: Units) -> _Layout | None:
    """The layout whose heading begins in a row, with as many rows below it as make one."""
    for depth in range(1, DEEPEST + 1):
        stack = [cells for _, cells in rows[start : start + depth]]
        if len(rows) <= start + depth:
            return None
        upper = stack[:-2] if _is_units(stack[-1]) else stack[:-1]
        read = depth > 1 and any(is_number(cell) and re.search(r"[.,]", cell) for cell in stack[-1])
        if read or not all(_is_labels(cells) for cells in upper):
            continue
        width = max(len(cells) for _, cells in rows[start : start + depth + 1])
        found = _layout(rows[start][0], start, start + depth, _stacked(stack, width))
        below = rows[start + depth]
        if found and (_is_data(below[1], found) or _other_block(below, "strut" in found.shared or bool(found.groups))):
            return found
    return None


def _is_units(cells: Sequence[str]) -> bool:
    """Whether a row holds nothing but units."""
    keys = [heading_key(cell) for cell in cells if cell.strip("-–[]() ")]
    return bool(keys) and all(
        key in UNIT_WORDS or key in TIMES or key in RAW_UNITS or key in ("c", "%") for key in keys
    )


def _is_labels(cells: Sequence[str]) -> bool:
    """Whether every cell of a row above the quantities is a strut, a date, a quantity or empty."""
    heads = [head_of(_fenced(cell)) for cell in cells if cell]
    if len(heads) < FEWEST_CELLS and (
        len(heads) < 2 or keyed_dates([(0, cells)]) or (heads[0] is not None and heads[0].quantity == "strut")
    ):
        return False  # `Strut 3` or `Date;2021-03-04` above a heading are of all records
    return bool(heads) and all(head is not None for head in heads) and any(head and any(head.group) for head in heads)


def _stacked(rows: Sequence[Sequence[str]], width: int) -> list[str]:
    """Texts of a heading's rows one below the other, cells of struts and dates (merged ones) carried to their right."""
    found = [""] * width
    for depth, cells in enumerate(rows):
        last = ""
        for i in range(width):
            cell = cells[i] if i < len(cells) else ""
            if depth < len(rows) - 1 and _is_labels(cells):
                head = head_of(_fenced(cell)) if cell else None
                last = cell if head and any(head.group) else ("" if cell else last)
                cell = _fenced(cell or last)
            found[i] = f"{found[i]} {cell}".strip() if cell != found[i] else found[i]
    return found


def _fenced(cell: str) -> str:
    """A strut's bare number with its word, so that it is not taken for a part of another heading."""
    return f"strut {strut_label(cell)}" if BARE.fullmatch(cell) else cell


def _layout(line: int, start: int, stop: int, texts: Sequence[str]) -> _Layout | None:
    letters = {"A", "B", "C"} <= set(texts)
    heads = _without_corner([_head(_fenced(text) if letters else text) for text in texts])
    quantities = {head.quantity for head in heads} & set(OWN_UNIT)
    if "stiffness" not in quantities and not {"force", "displacement"} <= quantities:
        if quantities or not _names_series(heads):
            return None
        heads = [head._replace(quantity="stiffness") if any(head.group) else head for head in heads]
    groups: dict[tuple[str, str], dict[str, list[int]]] = {}
    shared: dict[str, list[int]] = {}
    for i, head in enumerate(heads):
        if any(head.group) and head.quantity in OWN_UNIT:
            groups.setdefault(head.group, {}).setdefault(head.quantity, []).append(i)
        elif head.quantity:
            shared.setdefault(head.quantity, []).append(i)
    return _Layout(line, start, stop, tuple(heads), tuple(texts), groups, shared)


def _names_series(heads: Sequence[Head]) -> bool:
    """Whether headings without a quantity are struts or dates, each once, beside a column that tells the other."""
    named = [head.group for head in heads if any(head.group)]
    return len(named) > 1 and len(set(named)) == len(named) and not any(heads[0].group)


def _without_corner(heads: list[Head]) -> list[Head]:
    """A corner that names the quantity of the columns beside it: stiffnesses of struts or dates."""
    corners = [i for i, head in enumerate(heads) if head.quantity == "stiffness" and not any(head.group)]
    beside = [i for i, head in enumerate(heads) if not head.quantity and any(head.group)]
    if len(corners) != 1 or len(beside) < 2 or any(head.quantity in ("force", "displacement") for head in heads):
        return heads
    unit = heads[corners[0]].unit
    return [
        Head() if i in corners else head._replace(quantity="stiffness", unit=unit) if i in beside else head
        for i, head in enumerate(heads)
    ]


def _head(text: str) -> Head:
    """Of a whole column; a date among other words is taken out first."""
    found = head_of(text)
    if found is None and (match := DATED.search(text)):
        rest = head_of(text.replace(match[0], " "))
        found = rest and rest._replace(date=match[0])
    return found or Head()


def is_number(cell: str) -> bool:
    """Whether a cell is written like a number, whatever its marks."""
    return bool(NUMBER.fullmatch(cell)) and not (cell.count(".") > 1 and like_date(cell))


def _is_data(cells: Sequence[str], layout: _Layout) -> bool:
    """Whether a row below a heading holds readings, or none where a logger lost them."""
    data = layout.readings(cells)
    return _has_numbers(cells, layout) or (any(cells) and bool(data) and all(c.lower() in MISSING for c in data))


def _has_numbers(cells: Sequence[str], layout: _Layout) -> bool:
    return any(is_number(cell) for cell in layout.readings(cells))


def layouts(
    grid: Grid, file: str, columns: Columns, units: Units, comments: frozenset[int] = frozenset()
) -> list[Table]:
    """Tables of a grid, one a block; none where it has no layout of a bench.

    Parameters
    ----------
    grid, file, columns
        Cells, the name for messages, and the columns that the tables may have.
    units
        Of headings that state none.
    comments
        Lines that were marked as comments: they count as a head, not among the records.

    Raises
    ------
    InputError
        A layout that can be read in two ways, or without what it needs.
    """
    found: list[Table] = []
    rows, start = grid.rows, 0
    layout = _next(rows, 0, units)
    while layout is not None:
        above = rows[start : layout.start]
        body = [row for row in rows[layout.stop :] if row[0] not in comments]
        records, rest = _records(body, layout, units)
        if records.rows:
            found += _tables(records, layout, above, replace(grid, merged={}), file, columns, units)
        if not rest:
            break
        later = rows.index(rest[0])
        again = _next(rows, later, units)
        if again is None or again.start > later + LOOKED_AT or _data_before(rows, later, again.start, layout):
            # A line that names another strut or date, and records below it under the same heading.
            kept = rows[layout.start : layout.stop]
            head = next(i for i, row in enumerate(rest) if _is_data(row[1], layout))
            rows = [*rest[:head], *kept, *rest[head:]]
            start, layout = 0, _layout_at(rows, head, units)
        else:
            start, layout = later, again
    return found


def _next(rows: Rows, start: int, units: Units) -> _Layout | None:
    """The first layout from a row on; none in a file of jogged loops, which is no bench's."""
    for i in range(start, min(len(rows), start + LOOKED_AT)):
        if any(heading_key(cell).startswith("jog") for cell in rows[i][1]):
            return None
        if found := _layout_at(rows, i, units):
            return found
    return None


def _data_before(rows: Rows, start: int, stop: int, layout: _Layout) -> bool:
    return any(_has_numbers(cells, layout) for _, cells in rows[start:stop])


class _Records(NamedTuple):
    """Rows of readings of a block, rows at zero load, and what was passed over."""

    rows: Rows
    tare: Rows
    notes: list[str]


def _records(body: Rows, layout: _Layout, units: Units) -> tuple[_Records, Rows]:
    """Readings of a block, and what begins with the head of the next one."""
    kept: Rows = []
    tare: Rows = []
    passed: list[int] = []
    rest: Rows = []
    own_strut = any(strut for strut, _ in layout.groups) or "strut" in layout.shared
    last = max((k for k, (_, cells) in enumerate(body) if _has_numbers(cells, layout)), default=-1)
    for k, (line, cells) in enumerate(body):
        data = layout.readings(cells)
        if _is_record(cells, layout):
            words = [cell for i, cell in enumerate(cells) if i not in layout.data]
            (tare if any(TARE.fullmatch(word) for word in words) else kept).append((line, cells))
        elif k < last and (_layout_at(body, k, units) or _other_block((line, cells), own_strut)):
            rest = body[_after(body, k, {n for n, _ in (*kept, *tare)}) :]
            passed = [p for p in passed if p < rest[0][0]]
            break
        elif any(data) and all(cell.lower() in MISSING for cell in data):
            kept.append((line, cells))
        else:
            passed.append(line)
    return _Records(kept, tare, _passed_note(passed)), rest


def _passed_note(passed: list[int]) -> list[str]:
    many = f"{len(passed)} lines without readings are" if len(passed) > 1 else "a line without readings is"
    return [f"{many} passed over, from line {passed[0]}"] if passed else []


def _is_record(cells: list[str], layout: _Layout) -> bool:
    """Whether a row has readings, and is no summary of others."""
    numbers = any(is_number(cell) or SPREADSHEET_ERROR.fullmatch(cell) for cell in layout.readings(cells))
    return numbers and not _is_footer(cells, layout)


def _after(body: Rows, at: int, read: set[int]) -> int:
    """The first row after the last record before a row."""
    while at and body[at - 1][0] not in read:
        at -= 1
    return at


def _other_block(row: tuple[int, list[str]], own_strut: bool) -> bool:
    """Whether a line among the records names a strut or a date, as the head of a block does."""
    text = " ".join(row[1])
    named = STRUT.search(text) if not own_strut else None
    dated = sum(map(bool, row[1])) < FEWEST_CELLS and any(read_dates([d], "dmy").of(d) for d, _ in keyed_dates([row]))
    return dated or bool(named and len(text) <= len(named[0]) + 30)


def _is_footer(cells: Sequence[str], layout: _Layout) -> bool:
    """A row of a summary: a word in a column of readings, as `mean`, beside numbers."""
    first = next((i for i, cell in enumerate(cells) if cell), 0)
    word = cells[first].lower()
    return first in layout.data and bool(re.match(r"[^\W\d_]{3,}", word)) and word not in MISSING


def _tables(
    records: _Records, layout: _Layout, above: Rows, grid: Grid, file: str, columns: Columns, units: Units
) -> list[Table]:
    """The table of a block, its groups one below the other."""
    told = _stated_units(above, units)
    notes = [f"{file}: {note}" for note in records.notes]
    if not layout.groups:
        heading, rows, more = _long(records, layout, told, file)
    else:
        heading, rows, more = _unpivoted(records, layout, told, file)
    notes += [f"{file}: {note}" for note in more]
    if "" in heading or len(set(heading)) < len(heading):
        keep = [i for i, name in enumerate(heading) if name and heading.index(name) == i]
        for n, cells in rows:
            if len(cells) <= max(keep, default=0):
                expected = f"{len(heading)} as in the heading"
                raise TableError(f"row with {len(cells)} cells", expected=expected, file=file, line=n)
        heading, rows = [heading[i] for i in keep], [(n, [c[i] for i in keep]) for n, c in rows]
    known = Grid([(layout.line, heading), *rows], grid.separator, grid.notes)
    table = grid_table(known, file, columns)
    lines = tuple((n, tuple(c)) for n, c in above)
    return [replace(table, above=lines, notes=(*notes, *table.notes))]


def _stated_units(above: Rows, units: Units) -> dict[str, str]:
    """Units that a line above the heading states (`Units: N, um`; LabVIEW's Y_Unit_Label), or those that were given."""
    found = dict(units)
    for _, cells in above:
        text = " ".join(cells)
        listed = re.match(r"(?:y_)?(?:units?|einheit(?:en)?)(?:_label)?\b[\s:=]*(.*)", text, re.IGNORECASE)
        parts = re.split(r"[\s,;]+", listed[1]) if listed else re.findall(r"[\[(]([^\])]+)[\])]", text)
        for part in parts:
            key = heading_key(part)
            if key in UNIT_WORDS and (listed or key in STIFFNESSES):
                found[UNIT_WORDS[key]] = key
    return found


def _named(quantity: str, head: Head, units: Units, text: str, file: str, line: int) -> str:
    """The name of a column of readings with its unit. Raises `InputError` where it has none, or one of the logger."""
    unit = head.unit or units.get(quantity, "")
    if unit in RAW_UNITS:
        raise TableError(
            f"column {text!r} holds the logger's own {unit}",
            expected="a force, a length or a stiffness",
            hint="multiply it by the sensor's calibration and save it in N, mm or um",
            file=file,
            line=line,
        )
    if not unit:
        raise TableError(
            f"column {text!r} has no unit",
            expected=f"{quantity} with its unit, as {NAMES[quantity]}",
            hint="name it in the heading, or say --units N,um (units=) of force and displacement, N/um of a stiffness",
            file=file,
            line=line,
        )
    if UNIT_WORDS[unit] != quantity:
        found = f"column {text!r}: {unit.replace('_per_', '/')} is no unit of a {quantity}"
        raise TableError(found, file=file, line=line)
    return NAMES[quantity] if unit == OWN_UNIT[quantity] else f"{quantity}_{unit}"


Long = tuple[list[str], Rows, list[str]]


def _long(records: _Records, layout: _Layout, units: Units, file: str) -> Long:
    """One group: known columns by their names, others as they stand."""
    heading, notes = _known_names(layout, units, file), []
    heading = [_time(name, i, layout, records.rows) for i, name in enumerate(heading)]
    needed = [*layout.data, *layout.shared.get("strut", []), *layout.shared.get(DATE, [])]
    rows = [(n, _fitted(cells, len(heading), needed)) for n, cells in records.rows]
    dated = next((i for i, head in enumerate(layout.heads) if head == Head() and _holds_dates(i, records.rows)), None)
    if DATE not in heading and dated is not None:
        notes.append(f"column {heading[dated]!r} is read as date")
        heading[dated] = DATE
    several = layout.shared.get("displacement", [])
    if len(several) > 1:
        notes.append(_averaged_note(several, layout))
        rows = [(n, _averaged(cells, several)) for n, cells in rows]
        heading = [name for i, name in enumerate(heading) if i not in several[1:]]
    return heading, _tared(rows, records.tare, notes), notes


def _known_names(layout: _Layout, units: Units, file: str) -> list[str]:
    """The heading with known columns by their names. Raises `InputError` where forces have no strut."""
    heading = list(layout.texts)
    for quantity in OWN_UNIT:
        own = layout.shared.get(quantity, [])
        own = [i for i in own if not (quantity == "force" and _is_strut_force(layout, i))] or own
        if quantity == "force" and "stiffness" in layout.shared:
            continue
        if quantity == "force" and len(own) > 1:
            raise TableError(
                f"{len(own)} columns of forces without their struts",
                expected="force_1, displacement_1, force_2, ..., or a row of struts above the heading",
                file=file,
                line=layout.line,
            )
        for i in own:
            heading[i] = _named(quantity, layout.heads[i], units, layout.texts[i], file, layout.line)
    for i, head in enumerate(layout.heads):
        if head.quantity in ("strut", DATE) and not head.unit:
            heading[i] = head.quantity
    return heading


def _holds_dates(i: int, rows: Rows) -> bool:
    """Whether a column without a known name holds nothing but dates."""
    cells = [cells[i] for _, cells in rows if i < len(cells)]
    return bool(cells) and all(like_date(cell) for cell in cells)


def _is_strut_force(layout: _Layout, i: int) -> bool:
    return heading_key(layout.texts[i]).startswith("strut_force")


def _time(name: str, i: int, layout: _Layout, rows: Rows) -> str:
    """The name of a column of times: a date where its cells are, with its unit where it has one; else none."""
    if layout.heads[i].quantity != "time":
        return name
    cells = [row[i] for _, row in rows if i < len(row) and row[i]]
    if cells and all(like_date(cell) for cell in cells) and DATE not in layout.shared:
        return DATE
    tokens = heading_key(name).split("_")
    unit = next((token for token in tokens[::-1] if token in TIMES), "")
    return f"time_{unit}" if unit and all(is_number(cell) for cell in cells) else f"{name} (not used)"


def _fitted(cells: list[str], width: int, needed: Sequence[int]) -> list[str]:
    """A row as long as the heading, where nothing that is needed is lacking and nothing is left over."""
    while len(cells) > width and not cells[-1]:
        cells = cells[:-1]
    return [*cells, *[""] * (width - len(cells))] if len(cells) > max(needed, default=0) else cells


def _averaged_note(columns: Sequence[int], layout: _Layout) -> str:
    return f"{' and '.join(layout.texts[i] for i in columns)} are averaged, as sensors of one strut"


def _averaged(cells: list[str], columns: Sequence[int]) -> list[str]:
    """The row with the mean of several displacements in the place of the first of them."""
    mean = _mean([cells[i] for i in columns])
    return [mean if i == columns[0] else cell for i, cell in enumerate(cells) if i not in columns[1:]]


def _mean(cells: Sequence[str]) -> str:
    """Of numbers as they are written; "" where one is lost."""
    if len(cells) == 1:
        return cells[0]
    comma = any("," in cell for cell in cells)
    try:
        mean = str(sum(Decimal(cell.replace(",", ".")) for cell in cells) / len(cells))
    except InvalidOperation:
        return ""
    return mean.replace(".", ",") if comma else mean


def _tared(rows: Rows, tare: Rows, notes: list[str]) -> Rows:
    """Rows of a tare are left out: a stiffness is a difference, and whether they were subtracted is not known."""
    if tare:
        notes.append(f"{len(tare)} rows of the tare are passed over and not subtracted, from line {tare[0][0]}")
    return rows


def _unpivoted(records: _Records, layout: _Layout, units: Units, file: str) -> Long:
    """Groups side by side as one long table."""
    of_strut, of_date = (any(group[k] for group in layout.groups) for k in (0, 1))
    table = "stiffness" in {q for group in layout.groups.values() for q in group}
    wanted = ("stiffness",) if table else ("force", "displacement")
    if not table and not of_date and _are_sensors(layout):
        return _long(records, _as_sensors(layout), units, file)
    strut, date = _row_column(layout, "strut", records, of_strut), _row_column(layout, DATE, records, of_date)
    columns = {group: _parts(layout, group, wanted, file) for group in layout.groups}
    carried = [i for i, text in enumerate(layout.texts) if text in CARRIED]
    named = [
        _common_name(quantity, sorted({i for parts in columns.values() for i in parts[k]}), layout, units, file)
        for k, quantity in enumerate(wanted)
    ]
    with_strut, with_date = of_strut or strut is not None, of_date or date is not None
    heading = ["strut"] * with_strut + [DATE] * with_date + named + [layout.texts[i] for i in carried]

    def who(group: tuple[str, str], cells: list[str]) -> list[str]:
        label, day = group
        return [label or cells[strut or 0]] * with_strut + [day or cells[date or 0]] * with_date

    rows = _group_rows(records, layout, columns, who, carried, table, file)
    notes = [f"{len(columns)} groups of columns side by side are read one by one: {_listed(columns)}"]
    return heading, _tared(rows, records.tare, notes), notes


def _group_rows(
    records: _Records, layout: _Layout, columns: Mapping[tuple[str, str], list[list[int]]],
    who: Callable[[tuple[str, str], list[str]], list[str]], carried: Sequence[int], table: bool, file: str,
) -> Rows:  # fmt: skip
    """Rows of every group, one group below the other; `who`: strut and date of a row, `table`: of stiffnesses."""
    rows: Rows = []
    for group, parts in columns.items():
        for line, written in records.rows:
            cells = _no_wider(written, len(layout.texts), file, line)
            values = [_mean([cells[i] for i in part]) for part in parts]
            if not any(values) or (table and values[0].lower() in MISSING):
                continue  # columns of different lengths, or a strut without a reading
            rows.append((line, [*who(group, cells), *values, *(cells[i] for i in carried)]))
    return rows


def _no_wider(written: list[str], width: int, file: str, line: int) -> list[str]:
    """A row as long as the heading; raises `InputError` where it is longer."""
    cells = _fitted(written, width, ())
    if len(cells) > width:
        raise TableError(f"row with {len(cells)} cells", expected=f"{width} as in the heading", file=file, line=line)
    return cells


def _common_name(quantity: str, own: list[int], layout: _Layout, units: Units, file: str) -> str:
    """The name with unit of the columns of one quantity; raises `InputError` where the units differ."""
    names = {_named(quantity, layout.heads[i], units, layout.texts[i], file, layout.line) for i in own}
    if len(names) > 1:
        raise TableError(f"columns in different units: {', '.join(sorted(names))}", file=file, line=layout.line)
    return names.pop()


def _parts(layout: _Layout, group: tuple[str, str], wanted: Sequence[str], file: str) -> list[list[int]]:
    """Columns of the quantities of a group. Raises `InputError` where one has none, or several forces."""
    own = layout.groups[group]
    found = [own.get(quantity) or _partly_shared(layout, group, quantity) for quantity in wanted]
    for quantity, columns in zip(wanted, found, strict=True):
        if not columns or (len(columns) > 1 and quantity != "displacement"):
            count = "several columns" if columns else "no column"
            raise TableError(
                f"{count} of the {quantity} of {_listed([group])}", expected="one of each", file=file, line=layout.line
            )
    return found


def _listed(groups: Iterable[tuple[str, str]]) -> str:
    return ", ".join(" ".join(filter(None, (f"strut {strut}" if strut else "", date))) for strut, date in groups)


def _are_sensors(layout: _Layout) -> bool:
    """One force, and displacements with numbers that are not those of all struts: sensors of one strut."""
    forces = layout.shared.get("force", [])
    of_groups = [q for group in layout.groups.values() for q in group]
    worded = any(layout.heads[i].worded for group in layout.groups.values() for own in group.values() for i in own)
    return (
        len(forces) == 1
        and set(of_groups) == {"displacement"}
        and not worded
        and (len(layout.groups) < ALL_STRUTS or "strut" in layout.shared)
    )


def _as_sensors(layout: _Layout) -> _Layout:
    own = sorted(i for group in layout.groups.values() for i in group["displacement"])
    shared = {**layout.shared, "displacement": [*layout.shared.get("displacement", []), *own]}
    return replace(layout, groups={}, shared=shared)


def _partly_shared(layout: _Layout, group: tuple[str, str], quantity: str) -> list[int]:
    """Columns of a quantity that a group shares with others of its strut, its date, or with all."""
    for other in ((group[0], ""), ("", group[1])):
        if other != group and (found := layout.groups.get(other, {}).get(quantity)):
            return found
    return layout.shared.get(quantity, [])


def _row_column(layout: _Layout, quantity: str, records: _Records, given: bool) -> int | None:
    """The column that names each row's strut or date; without a heading the first, where its cells are such."""
    if given or layout.shared.get(quantity):
        return None if given else layout.shared[quantity][0]
    taken = [*layout.data, *layout.shared.get(DATE, []), *layout.shared.get("strut", [])]
    for i in (*layout.shared.get("time", []), 0):
        cells = [row[i] for _, row in records.rows if i < len(row)]
        told = _is_dated if quantity == DATE else strut_label
        if cells and i not in taken and all(told(cell) for cell in cells):
            return i
    return None


def _is_dated(cell: str) -> bool:
    return like_date(cell) or bool(REDUCED.fullmatch(cell)) or bool(read_dates([cell], "dmy").iso)
