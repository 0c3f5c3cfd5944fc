"""Columns of numbers and words to CSV and Parquet, block by block, so that a long table never stands in memory twice.

Short tables are formatted by Python, long ones by Arrow: its numbers of a fixed count of decimals give the same bytes
three times faster, and loading it costs a tenth of a second.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from toolpath_stiff.arrays import AnyArray, FloatArray

Columns = Mapping[str, AnyArray]
Decimals = Mapping[str, int | None]  # None: a whole number or a word

BLOCK = 65_536  # rows
FEWEST_FOR_ARROW = 20_000  # rows
LARGEST = 2.0**53  # beyond, a double does not hold every whole number


FORMULA = ("=", "+", "-", "@", "\t", "\r")  # what a spreadsheet takes for a formula when a cell begins with it


def csv_text(heading: Iterable[str], rows: Iterable[Sequence[object]]) -> str:
    """A short table with words in it as CSV: None is an empty cell, quotes stand where they are needed.

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
    for block in _blocks(rows):
        columns = columns_of(block)
        piece = _by_arrow(columns, decimals) if rows >= FEWEST_FOR_ARROW else None
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


def parquet_pieces(columns_of: Callable[[slice], Columns], rows: int) -> Iterator[bytes]:
    """A Parquet file in pieces, a row group a block; nan is null."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pieces = _Pieces()
    writer: Any = None
    for block in _blocks(rows, 2 * BLOCK):
        columns = {name: pa.array(column, from_pandas=True) for name, column in columns_of(block).items()}
        table = pa.table(columns)
        if writer is None:
            words = [field.name for field in table.schema if pa.types.is_string(field.type)]
            writer = pq.ParquetWriter(pieces, table.schema, use_dictionary=words, compression="snappy")
        writer.write_table(table)
        yield from pieces.taken()
    writer.close()
    yield from pieces.taken()


def _blocks(rows: int, size: int = BLOCK) -> Iterator[slice]:
    """Slices over all rows; one empty slice if there are none."""
    yield from (slice(start, min(start + size, rows)) for start in range(0, max(rows, 1), size))


class _Pieces:
    """A file open for writing that holds what was written until it is taken."""

    closed = False

    def __init__(self) -> None:
        self._held: list[bytes] = []
        self._length = 0

    def write(self, data: bytes) -> int:
        self._held.append(bytes(data))
        self._length += len(data)
        return len(data)

    def tell(self) -> int:
        return self._length

    def flush(self) -> None:
        pass

    def taken(self) -> list[bytes]:
        held, self._held = self._held, []
        return held


def _by_arrow(columns: Columns, decimals: Decimals) -> bytes | None:
    """Rows as `csv_rows` has them; None where a number is infinite or too large for it."""
    import pyarrow as pa
    import pyarrow.csv as pc

    arrays = {}
    for name, column in columns.items():
        digits = decimals[name]
        array = pa.array(column) if digits is None else _fixed(column, digits)
        if array is None:
            return None
        arrays[name] = array
    stream = pa.BufferOutputStream()
    pc.write_csv(pa.table(arrays), stream, pc.WriteOptions(include_header=False, quoting_style="none"))
    return bytes(stream.getvalue().to_pybytes())


def _fixed(column: FloatArray, digits: int) -> Any:
    """Numbers rounded to some decimals, exactly, as Arrow's 128-bit decimals: a whole number of units and a scale."""
    import pyarrow as pa

    missing = np.isnan(column)
    # As numpy's round counts them, so that both ways print the same digits.
    units = np.rint(np.where(missing, 0.0, column) * 10.0**digits)
    if not (np.abs(units) < LARGEST).all():
        return None
    whole = units.astype(np.int64)
    words = np.empty((len(column), 2), dtype=np.int64)  # low and high half, two's complement
    words[:, 0], words[:, 1] = whole, whole >> 63
    valid = pa.py_buffer(np.packbits(~missing, bitorder="little")) if missing.any() else None
    return pa.Array.from_buffers(pa.decimal128(18, digits), len(column), [valid, pa.py_buffer(words)])
