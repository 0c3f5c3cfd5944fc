"""Columns of numbers and words to CSV and Parquet, block by block, so that a long table never stands in memory twice.

Rows of CSV are made by arithmetic on whole columns: a number of a fixed count of decimals is a whole number of units,
its digits are looked up four at a time, and every cell is as wide as the widest of its column, filled up with zero
bytes that are taken out at the end. Where that cannot hold a number or a word, Python formats the rows.
"""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import AnyArray
from toolpath_stiff.errors import InputError

Columns = Mapping[str, AnyArray]
Decimals = Mapping[str, int | None]  # None: a whole number or a word
Cells = NDArray[np.uint8]

BLOCK = 8_192  # rows of CSV: their bytes fit into a processor's cache
ROW_GROUP = 131_072  # rows of Parquet
LARGEST = 2.0**53  # beyond, a double does not hold every whole number
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # a cell that begins with one of these is a formula to a spreadsheet


def csv_text(heading: Iterable[str], rows: Iterable[Sequence[object]]) -> str:
    """A short table with words as CSV text: None is an empty cell, and cells are quoted where needed.

    A word that a spreadsheet would run as a formula ("=cmd()", a point called "-A1") gets an apostrophe before it,
    which spreadsheets take for "this is text"; numbers, with their signs, stay as they are. OWASP, "CSV Injection".
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(heading)
    writer.writerows([_harmless(cell) for cell in row] for row in rows)
    return stream.getvalue()


def _harmless(cell: object) -> object:
    if not isinstance(cell, str) or not cell.startswith(FORMULA):
        return cell
    try:
        float(cell)
    except ValueError:
        return f"'{cell}"
    return cell


def csv_pieces(columns_of: Callable[[slice], Columns], rows: int, decimals: Decimals) -> Iterator[bytes]:
    """A CSV file in pieces: the heading, then blocks of rows; nan is an empty cell, minus zero is zero.

    Parameters
    ----------
    columns_of
        The columns of some rows.
    rows
        How many there are.
    decimals
        The columns in order, with their decimals.
    """
    yield (",".join(decimals) + "\n").encode()
    for block in _blocks(rows, BLOCK):
        columns = columns_of(block)
        piece = _by_digits(columns, decimals)
        yield csv_rows(columns, decimals).encode() if piece is None else piece


def csv_rows(columns: Columns, decimals: Decimals) -> str:
    """Rows of a CSV file from columns; a nan is an empty cell, minus zero is zero.

    One template formats a whole row, many times faster than the `csv` module.
    """
    template = ",".join("%s" if decimals[name] is None else f"%.{decimals[name]}f" for name in columns) + "\n"
    values = []
    for name, column in columns.items():
        digits = decimals[name]
        # Adding 0.0 turns the minus zero of rounding into zero.
        values.append(column.tolist() if digits is None else (np.round(column, digits) + 0.0).tolist())
    text = "".join([template % row for row in zip(*values, strict=True)])
    return text.replace("nan", "") if "nan" in text else text


def check_parquet() -> None:
    """Raise `InputError` if Parquet cannot be written because pyarrow is missing; does not import it."""
    if find_spec("pyarrow") is None:
        raise InputError("Parquet needs the package pyarrow", hint="run `pip install 'toolpath-stiff[parquet]'`")


def parquet_pieces(columns_of: Callable[[slice], Columns], rows: int) -> Iterator[bytes]:
    """A Parquet file, compressed block by block, a row group each; nan is null."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = pa.BufferOutputStream()
    writer: Any = None
    for block in _blocks(rows, ROW_GROUP):
        table = pa.table({name: _arrow(column) for name, column in columns_of(block).items()})
        if writer is None:
            words = [field.name for field in table.schema if pa.types.is_string(field.type)]
            writer = pq.ParquetWriter(file, table.schema, use_dictionary=words, compression="snappy")
        writer.write_table(table)
    writer.close()
    yield file.getvalue().to_pybytes()


def _arrow(column: AnyArray) -> Any:
    """A column of a Parquet file; each distinct word, which costs a microsecond to convert, is converted once."""
    import pyarrow as pa

    if column.dtype.kind != "U":
        return pa.array(column, from_pandas=True)
    words, places = np.unique(column, return_inverse=True)
    return pa.array(words).take(pa.array(places))


def _blocks(rows: int, size: int) -> Iterator[slice]:
    """Slices over all rows; one empty slice if there are none."""
    yield from (slice(start, min(start + size, rows)) for start in range(0, max(rows, 1), size))


def _by_digits(columns: Columns, decimals: Decimals) -> bytes | None:
    """Rows as `csv_rows` gives them; None if a number is infinite or too large, or a word is not plain ASCII."""
    cells = [_cell(np.asarray(column), decimals[name]) for name, column in columns.items()]
    known = [cell for cell in cells if cell is not None]
    if len(known) < len(cells):
        return None
    ends = np.cumsum([cell.shape[1] + 1 for cell in known])
    rows = np.full((len(known[0]), int(ends[-1])), ord(","), dtype=np.uint8)
    for cell, end in zip(known, ends, strict=True):
        rows[:, end - 1 - cell.shape[1] : end - 1] = cell
    rows[:, -1] = ord("\n")
    return rows.tobytes().replace(b"\0", b"")


def _cell(column: AnyArray, digits: int | None) -> Cells | None:
    """(n, width) characters of a column, zero where a cell has none."""
    if not len(column):
        return np.empty((0, 0), dtype=np.uint8)
    if column.dtype.kind == "U":
        letters = np.ascontiguousarray(column).view(np.uint32).reshape(len(column), -1)
        longest = int(np.flatnonzero(letters.any(axis=0)).max(initial=-1)) + 1
        return letters[:, :longest].astype(np.uint8) if letters.max() < 128 else None
    if digits is None and column.dtype.kind not in "iu":
        return None
    # Rounded as numpy's round does, so that both ways print the same digits.
    units = column if digits is None else np.rint(column * 10.0**digits)
    missing = np.isnan(units) if np.isnan(units.min()) else None
    if missing is not None:
        units[missing] = 0.0
    low, high = units.min(), units.max()
    if not max(-low, high) < LARGEST:
        return None
    cell = _number(units, digits or 0, int(low), int(high))
    return cell if missing is None else np.where(missing[:, None], np.uint8(0), cell)


def _number(units: AnyArray, digits: int, low: int, high: int) -> Cells:
    """Whole numbers of units (n,), from `low` to `high`, with a decimal point before the last `digits`."""
    if low == high:  # an axis that stands still, the only tool
        text = f"{'-' * (low < 0)}{abs(low) // 10**digits}" + (f".{abs(low) % 10**digits:0{digits}d}" if digits else "")
        return np.broadcast_to(np.frombuffer(text.encode(), dtype=np.uint8), (len(units), len(text)))
    largest = max(-low, high)
    # Numbers of half the width divide four times as fast.
    size = np.abs(units).astype(np.uint32 if largest < 2**32 else np.int64)
    least, width = max(low, -high, 0), max(len(str(largest)), digits + 1)
    fours = np.empty((len(units), -(-width // 4)), dtype=np.uint32)
    rest: Any = size
    for place in range(fours.shape[1] - 1, 0, -1):
        above = rest // 10_000
        fours[:, place] = _FOUR_DIGITS.take(rest - 10_000 * above, mode="clip")
        rest = above
    fours[:, 0] = _FOUR_DIGITS.take(rest, mode="clip")
    figures = fours.view(np.uint8)[:, -width:]
    for place in range(width - digits - 1):  # no zeros before the first figure, but the one before the point
        if least < 10 ** (width - 1 - place):
            figures[:, place] *= size >= 10 ** (width - 1 - place)
    # Only where a column has a sign or a point: every empty byte has to be taken out again.
    sign, point = int(low < 0), width - digits
    cell = np.empty((len(units), sign + width + bool(digits)), dtype=np.uint8)
    cell[:, sign : sign + point] = figures[:, :point]
    cell[:, cell.shape[1] - digits :] = figures[:, point:]
    if sign:
        np.multiply(units < 0, np.uint8(ord("-")), out=cell[:, 0])
    if digits:
        cell[:, sign + point] = ord(".")
    return cell


# "0000" to "9999" as four bytes each.
_FOUR_DIGITS = np.frombuffer("".join(f"{i:04d}" for i in range(10_000)).encode(), dtype=np.uint32)
