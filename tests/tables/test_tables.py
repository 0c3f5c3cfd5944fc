"""Tables as offices write them: the same numbers from every dialect, or a refusal that names the column."""

from __future__ import annotations

import io
import zipfile
from datetime import datetime

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from openpyxl import Workbook

from tests.stiffness.cases import nist
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.tables import Columns, parse_table, read_table

COLUMNS = Columns(
    numbers=("x_mm", "y_mm", "z_mm", "stiffness_N_per_mm", "force_N", "temperature_C", "displacement_um"),
    texts=("direction", "point", "setup"),
)
NAMES = ("x_mm", "y_mm", "z_mm", "direction", "point", "stiffness_N_per_mm")
SPELLINGS = {
    "names": NAMES,
    "brackets": ("X [mm]", "Y [mm]", "Z (mm)", "Direction", "Point", "Stiffness [N/mm]"),
    "spaces": (" x mm ", "y_mm", "z mm", "direction ", "POINT", "stiffness  N/mm"),
}


def written(rows, spelling: str, separator: str, mark: str, ends: str, quoted: bool) -> str:
    table = [list(SPELLINGS[spelling])]
    for x, y, z, direction, point, k in rows:
        numbers = [repr(float(v)).replace(".", mark) for v in (x, y, z, k)]
        table.append([*numbers[:3], direction, point, numbers[3]])

    def cell(text: str) -> str:
        return f'"{text}"' if quoted or separator in text or '"' in text else text

    return ends.join(separator.join(cell(text) for text in row) for row in table) + ends


NUMBERS = st.floats(-1e4, 1e4, allow_nan=False).map(lambda v: round(v, 4))


@settings(max_examples=150, deadline=None)
@given(
    rows=st.lists(
        st.tuples(NUMBERS, NUMBERS, NUMBERS, st.sampled_from("XYZ"), st.sampled_from(["A", "P1,2", "7", "ü;b", "µ"]),
                  st.floats(100, 1e7)),
        min_size=1, max_size=6,
    ),
    spelling=st.sampled_from([*SPELLINGS]),
    separator=st.sampled_from([",", ";", "\t"]),
    mark=st.sampled_from([".", ","]),
    ends=st.sampled_from(["\n", "\r\n", "\r"]),
    quoted=st.booleans(),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
)  # fmt: skip
def test_every_dialect_reads_as_the_same_numbers(
    tmp_path_factory, rows, spelling, separator, mark, ends, quoted, encoding
):
    mark = "." if separator == "," else mark
    # A row whose numbers show which mark is the decimal one, as any table of measurements has.
    rows = [(0.25, 0.5, 800.125, "Z", "first", 40000.75), *rows]
    file = tmp_path_factory.mktemp("t") / "data.csv"
    file.write_bytes(written(rows, spelling, separator, mark, ends, quoted).encode(encoding))
    table = read_table(str(file), "measurements", COLUMNS)
    assert table.heading == NAMES and len(table.rows) == len(rows)
    for (_, cells), (x, y, z, direction, point, k) in zip(table.rows, rows, strict=True):
        record = table.record(cells)
        assert [float(record[name]) for name in ("x_mm", "y_mm", "z_mm", "stiffness_N_per_mm")] == [x, y, z, k]
        assert (record["direction"], record["point"]) == (direction, point)


def test_a_german_excel_file_becomes_measurements(tmp_path):
    file = tmp_path / "messung.csv"
    text = "x [mm];y [mm];z [mm];direction;Stiffness [N/mm];Displacement [µm];Force [N]\r\n"
    file.write_bytes((text + "0;-12,5;800;X;40000,5;25,0;1000\r\n;;;;;;\r\n").encode("utf-8-sig"))
    data = read_measurements(str(file), nist())
    assert data.position.tolist() == [[0.0, -0.0125, 0.8]] and data.stiffness[0] == 40000500.0
    assert any("decimal commas" in note for note in data.notes)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        # A comma that may be a decimal comma or a thousands separator.
        ("x_mm;y_mm;z_mm;direction;stiffness_N_per_mm\n0;0;800;X;41,250\n",
         ":2: stiffness_N_per_mm = '41,250' could be 41.250 or 41250"),
        ("x_mm;y_mm;z_mm;direction;stiffness_N_per_mm\n0;0;353;X;40000\n0;0;1.268;X;40000\n",
         ":3: z_mm = '1.268' could be 1.268 or 1268"),
        ("x_mm;y_mm;z_mm;direction;stiffness_N_per_mm\n0,5;0,25;800;X;41.250\n",
         ":2: stiffness_N_per_mm = '41.250' could be 41.250 or 41250"),
        ("x_mm;y_mm;z_mm;direction;stiffness_N_per_mm\n0.5;0.25;800;X;41,250\n",
         ":2: stiffness_N_per_mm = '41,250' could be 41.250 or 41250"),
        ('x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n0,0,800,X,"41,250"\n', "expected a finite number"),
        # Thousands separators beside a decimal mark, with blanks, apostrophes, twice.
        ("x_mm;y_mm;z_mm;direction;stiffness_N_per_mm\n0;0;800;X;41.250,5\n", "stiffness_N_per_mm = '41.250"),
        ("x_mm;y_mm;z_mm;direction;stiffness_N_per_mm\n0;0;800;X;41 250\n", "without thousands separators"),
        ("x_mm;y_mm;z_mm;direction;stiffness_N_per_mm\n0;0;800;X;41'250\n", "without thousands separators"),
        ("x_mm;y_mm;z_mm;direction;stiffness_N_per_mm\n0;0;800;X;1.041.250\n", "without thousands separators"),
        # A comma between commas splits a number in two.
        ("x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n0,5,0,800,X,40000\n", "Write semicolons between the cells"),
        # Units that are not those of the columns.
        ("x;y;z;direction;stiffness\n0;0;1;X;4e4\n", "column 'x'; expected x_mm"),
        ("x_mm;y_mm;z_mm;direction;Stiffness [N/µm]\n0;0;1;X;40\n", "did you mean stiffness_N_per_mm?"),
        # Errors of the spreadsheet, in a first column as well, where a comment would begin.
        ("x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n#DIV/0!,0,800,X,4e4\n0,0,800,X,#WERT!\n",
         ":2: x_mm = '#DIV/0!'"),
    ],
)  # fmt: skip
def test_what_can_be_read_in_two_ways_is_refused_by_column(tmp_path, text, told):
    file = tmp_path / "data.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises((InputError, InputErrors)) as caught:
        read_measurements(str(file), nist())
    assert told.lower() in str(caught.value).lower() and "data.csv" in str(caught.value)


def test_trailing_emptiness_is_passed_over():
    text = "# Campaign 3;;;;;;\n;;;;;;\nx_mm;y_mm;z_mm;direction;stiffness_N_per_mm;;\n"
    table = parse_table(text + "0;0;800;X;40000;;\n;;;;;;\n", "a.csv", COLUMNS)
    assert table.heading_line == 3 and len(table.heading) == 5 and len(table.rows) == 1


def workbook(*sheets, merged: str = "") -> bytes:
    book = Workbook()
    book.remove(book.active)
    for title, rows in sheets:
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
        if merged:
            sheet.merge_cells(merged)
    stream = io.BytesIO()
    book.save(stream)
    return stream.getvalue()


HEADING = ["x [mm]", "y_mm", "z_mm", "direction", "Stiffness [N/mm]", "setup"]


def test_a_workbook_reads_as_the_csv_does(tmp_path):
    rows = [[0.1, -12.5, 800, "X", 40000.25, "riser"], [0, 0, 900, "Z", 90000, None]]
    (tmp_path / "a.xlsx").write_bytes(workbook(("Data", [HEADING, *rows, [None] * 6])))
    lines = ["x_mm,y_mm,z_mm,direction,stiffness_N_per_mm,setup", "0.1,-12.5,800,X,40000.25,riser", "0,0,900,Z,90000,"]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    one, two = (read_measurements(str(tmp_path / name), nist()) for name in ("a.xlsx", "a.csv"))
    for name in ("position", "stiffness", "direction", "setup", "line"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name


def test_a_sheet_can_be_named_and_the_first_filled_one_is_told(tmp_path):
    rows = [[0, 0, 800, "X", 40000, ""]]
    file = tmp_path / "a.xlsx"
    other = [[0, 0, 700, "Y", 50000, ""]]
    file.write_bytes(workbook(("empty", []), ("Mon", [HEADING, *rows]), ("Tue", [HEADING, *other])))
    data = read_measurements(str(file), nist())
    assert data.stiffness[0] == 4e7 and any("sheet 'Mon' is read" in note for note in data.notes)
    assert read_measurements(f"{file}#Tue", nist()).stiffness[0] == 5e7
    with pytest.raises(InputError, match="no sheet 'Wed' with cells; expected one of Mon, Tue"):
        read_measurements(f"{file}#Wed", nist())


@pytest.mark.parametrize(
    ("rows", "merged", "told"),
    [
        ([HEADING, [0, 0, 800, "X", "#DIV/0!", ""]], "", "a.xlsx:2: stiffness_N_per_mm = '#DIV/0!'"),
        ([HEADING, [0, 0, 800, "X", "=A2*2", ""]], "", "a.xlsx:2: cell E2 holds a formula without a stored"),
        ([["x_mm", None, None, *HEADING[3:]], [0, 0, 800, "X", 40000, ""]], "A1:C1", "merged cells A1:C1"),
        ([HEADING, [0, 0, 800, "X", "41,250", ""]], "", "a.xlsx:2: stiffness_N_per_mm = '41,250'"),
        ([HEADING, [0, 0, datetime(2024, 5, 4), "X", 40000, ""]], "", "z_mm = '2024-05-04T00:00:00'"),
        ([], "", "the workbook is empty"),
    ],
)
def test_what_is_wrong_in_a_workbook_is_named_by_row_and_column(tmp_path, rows, merged, told):
    file = tmp_path / "a.xlsx"
    file.write_bytes(workbook(("Data", rows), merged=merged))
    with pytest.raises((InputError, InputErrors)) as caught:
        read_measurements(str(file), nist())
    assert told in str(caught.value)


def part_replaced(content: bytes, old: bytes, new: bytes) -> bytes:
    """A workbook with other text in its only sheet."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as source, zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as target:
        for name in source.namelist():
            part = source.read(name)
            target.writestr(name, part.replace(old, new) if name.endswith("sheet1.xml") else part)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (b'r="A2"', b'r="A1e400"', "a workbook that cannot be read: invalid literal"),
        (b'r="A2"', b'r="A100000"', "sheet 'Data' has 100000 rows and 6 columns; expected at most 500,000 cells"),
    ],
)
def test_a_broken_or_endless_sheet_is_refused_in_one_line(tmp_path, monkeypatch, old, new, told):
    """Nothing is looked through cell by cell before its size is known."""
    file = tmp_path / "a.xlsx"
    file.write_bytes(part_replaced(workbook(("Data", [HEADING, [0, 0, 800, "X", 40000, "a"]])), old, new))
    monkeypatch.setattr(
        "openpyxl.worksheet.worksheet.Worksheet.values", property(lambda _: pytest.fail("looked through"))
    )
    with pytest.raises(InputError) as caught:
        read_measurements(str(file), nist())
    assert told in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"\xd0\xcf\x11\xe0" + bytes(600), "a workbook that cannot be read"),
        (b"PK\x03\x04" + bytes(100), "a workbook that cannot be read"),
        (bytes(100), "neither text nor an Excel workbook"),
    ],
)
def test_other_files_are_refused(tmp_path, content, told):
    file = tmp_path / "a.xlsx"
    file.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_measurements(str(file), nist())
    assert told in str(caught.value)


def test_raw_records_are_read_by_the_same_reader(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = "x [mm];y [mm];z [mm];direction;jog [µm];Force [N];Displacement [µm]\n"
    text += "0;0;800;X;0;0;0\n0;0;800;X;200;900,5;170\n0;0;800;X;-200;-900,5;-170\n0;0;800;X;0;0;0\n"
    (tmp_path / "raw.csv").write_text(text, encoding="cp1252")
    assert main(["reduce", "raw.csv", "--no-plots"]) == 0
    told = capsys.readouterr()
    # 1801 N over 60 um: (F+ - F-) / (0.4 mm - (D+ - D-)), the paper's equation 12.
    assert f"{1801 / 0.06:.0f}" in told.out and "decimal commas" in told.err


def test_an_unknown_unit_below_a_heading_is_refused_unless_the_mapping_says_it(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("x;y;z;d;k\nmm;mm;mm;;kp/mm\n0;0;800;X;30000\n")
    mapping = "x=x, y=y, z=z, direction=d, stiffness=k"
    with pytest.raises(InputError, match=r"a\.csv:2: unit 'kp/mm' of 'k'; expected N/mm\. Say .*stiffness_N_per_mm=k:"):
        read_measurements(str(file), nist(), columns=mapping)
    assert len(read_measurements(str(file), nist(), columns=f"{mapping}:N/mm")) == 1


@settings(max_examples=150, deadline=None)
@example(content=b"\x01\r,M")  # a row of units longer than the heading
@given(content=st.binary(max_size=60) | st.text(alphabet="x_m0;,\t\n\r\"'.#N/A1 ", max_size=80).map(str.encode))
def test_whatever_the_bytes_are_is_read_or_refused(tmp_path_factory, content):
    file = tmp_path_factory.mktemp("t") / "a.csv"
    file.write_bytes(content)
    try:
        read_measurements(str(file), nist())
    except (InputError, InputErrors) as error:
        assert "a.csv" in str(error)
