"""Columns to files: rows by arithmetic against Python's own formatting, Parquet against pyarrow's reader."""

import csv
import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import parquet

from toolpath_stiff import column_files
from toolpath_stiff.column_files import csv_pieces, csv_rows, csv_text, parquet_pieces
from toolpath_stiff.tables import Columns, read_table

DECIMALS = {"line": None, "word": None, "a": 6, "b": 3, "c": 0}


def columns_of(numbers):
    column = np.array(numbers, dtype=float)
    words = np.array(["rapid", "feed"])[np.arange(len(column)) % 2]
    return {"line": np.arange(len(column)), "word": words, "a": column, "b": column[::-1], "c": column}


def text_of(pieces):
    return b"".join(pieces).decode()


any_number = st.floats(-1e8, 1e8) | st.just(float("nan")) | st.sampled_from([0.5, 1.5, 0.0, -0.0, -1e-9, 2.5e-7, 1e12])


@settings(max_examples=200, deadline=None)
@given(st.lists(any_number, min_size=1, max_size=50))
def test_arithmetic_writes_what_python_formats(numbers):
    columns = columns_of(numbers)
    rows = column_files._by_digits(columns, DECIMALS)
    assert rows is None or rows.decode() == csv_rows(columns, DECIMALS)


def test_decimals_are_those_of_the_printed_number():
    columns = {"x": np.array([1.0, -0.25, np.nan, -1e-7])}
    assert column_files._by_digits(columns, {"x": 3}) == b"1.000\n-0.250\n\n0.000\n"


@pytest.mark.parametrize("number", [np.inf, 1e300])
def test_numbers_that_whole_units_cannot_hold_are_written_all_the_same(number):
    columns = {"x": np.array([1.0, number])}
    text = text_of(csv_pieces(lambda rows: {"x": columns["x"][rows]}, 2, {"x": 1}))
    assert [float(cell) for cell in text.split()[1:]] == [1.0, number]


def test_words_beyond_ascii_and_minus_signs_are_written_all_the_same():
    words = {"word": np.array(["Fr\u00e4sen", "", "x"]), "n": np.array([-12, 0, 7]), "x": np.array([-1.5, -1.5, -1.5])}
    decimals = {"word": None, "n": None, "x": 2}
    assert text_of(csv_pieces(lambda rows: words, 3, decimals)).splitlines()[1:] == [
        "Fr\u00e4sen,-12,-1.50",
        ",0,-1.50",
        "x,7,-1.50",
    ]
    plain = {**words, "word": np.array(["a", "", "b"])}
    assert column_files._by_digits(plain, decimals) == b"a,-12,-1.50\n,0,-1.50\nb,7,-1.50\n"
    assert column_files._by_digits(words, decimals) is None


def test_blocks_join_without_seam(monkeypatch):
    monkeypatch.setattr(column_files, "BLOCK", 7)
    columns = columns_of(np.linspace(-5.0, 5.0, 100))

    def some(rows):
        return {name: column[rows] for name, column in columns.items()}

    expected = ",".join(DECIMALS) + "\n" + csv_rows(columns, DECIMALS)
    assert text_of(csv_pieces(some, 100, DECIMALS)) == expected
    table = parquet.read_table(io.BytesIO(b"".join(parquet_pieces(some, 100))))
    assert table.num_rows == 100
    for name, column in columns.items():
        np.testing.assert_array_equal(table[name].to_numpy(), column)


def test_no_rows_are_a_heading():
    empty = columns_of([])
    assert text_of(csv_pieces(lambda rows: empty, 0, DECIMALS)) == "line,word,a,b,c\n"
    assert parquet.read_table(io.BytesIO(b"".join(parquet_pieces(lambda rows: empty, 0)))).num_rows == 0


def test_words_that_a_spreadsheet_would_run_are_written_as_text():
    """`=HYPERLINK(...)` in a comment must stay a comment; numbers keep their signs."""
    words = ["=1+1", "+A1", "-A1", "@SUM(A1)", "\t=1", 'plain, "quoted"']
    numbers = ["-1.5", "+3", "-inf", -2, 7.5, None]
    rows = list(csv.reader(io.StringIO(csv_text(["a"] * 6, [words, numbers]))))
    assert rows[1] == ["'=1+1", "'+A1", "'-A1", "'@SUM(A1)", "'\t=1", 'plain, "quoted"']
    assert rows[2] == ["-1.5", "+3", "-inf", "-2", "7.5", ""]


def test_such_words_are_read_back_as_they_were(tmp_path):
    """Points called -A1 and =B are the same points in a plan, in the file of its readings and in the next plan."""
    file = tmp_path / "points.csv"
    file.write_text(csv_text(["point", "x_mm"], [["-A1", "-1.5"], ["=B", "2"], ["it's", "3"]]))
    rows = read_table(str(file), "points", Columns(("x_mm",), ("point",))).rows
    assert [list(cells) for _, cells in rows] == [["-A1", "-1.5"], ["=B", "2"], ["it's", "3"]]


def test_rows_that_repeat_are_written_as_the_others():
    twice = np.repeat(np.array([-1.25, 3.0, np.nan, 0.5, 7.75]), 2)
    words = np.repeat(np.array(["strut1", "x min", "strut1", "", "x"]), 2)
    columns = {"a": twice, "word": words, "b": np.roll(twice, 1), "line": np.arange(10), "c": np.zeros(10)}
    decimals = {"a": 3, "word": None, "b": 6, "line": None, "c": 1}
    assert column_files._by_digits(columns, decimals) == csv_rows(columns, decimals).encode()
    table = parquet.read_table(io.BytesIO(b"".join(parquet_pieces(lambda rows: columns, 10))))
    assert table["word"].to_pylist() == words.tolist()
